//! Voxelisation: from a [`Model`] to a volume whose opacity is coverage, so that any model becomes mesostructure.
//!
//! All is done in *texel space*: (u, v, w) in texels, texel (i, j, k) the unit cube from (i, j, k). The model's X becomes u, its
//! -Z v, its Y w. Then
//!
//! - alpha is the part of a texel that the model fills: `rays` along w, of a `solid` (what a closed mesh encloses) or of a
//!   `sheet` (a surface with a thickness);
//! - colour and normals are averages over the `surface` in a texel, by area;
//! - what is filled but holds no surface has the colour of the nearest texel that does: `nearest`.
//!
//! The same model yields the same bytes whatever the number of threads.

mod closed;
mod nearest;
mod placement;
mod rays;
mod sheet;
mod solid;
mod surface;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::{AlphaMode, RawVolume, Volume};
use crate::mesh::model::Model;
use crate::{Error, Result};
use placement::Placement;

/// The most texels that are filled: 4 GiB.
const MAX_TEXELS: usize = 1 << 28;

/// Coverage below this is rounding, as where a face lies on the border of a texel.
const LEAST_COVERAGE: f64 = 1e-9;

/// How a model is to lie in its volume, and what of it is solid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Texels along u, v, w.
    pub size: [u32; 3],
    /// How the model's box is scaled to the volume.
    pub scaling: Scaling,
    /// What is left free at each border, but for w = 0, in texels. Where it is negative the model sticks out across u and v.
    pub margin: f64,
    /// Whether what sticks out across u and v comes in again on the other side; else it is cut off.
    pub tile: bool,
    /// Fills not what the mesh encloses, but a layer of this thickness around its triangles, in texels.
    pub sheet: Option<f64>,
}

/// How the model's bounding box is scaled to the volume.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Scaling {
    /// As large as there is room with texels that are cubes; in the middle of u and v, standing on w = 0.
    #[default]
    Fit,
    /// Along each axis as large as there is room.
    Stretch,
}

/// A model in texels.
#[derive(Debug, Clone, PartialEq)]
pub struct Voxels {
    /// Opacity is coverage: exactly 1 inside, exactly 0 outside.
    pub volume: Volume,
    /// For each texel the area-weighted average normal of the surface in it, of unit length, along u, v, w as lengths in texels;
    /// zero where there is no surface, or where it cancels out.
    pub normals: Vec<[f32; 3]>,
    /// Texels a unit of the model along u, v, w.
    pub scale: [f64; 3],
}

impl Voxels {
    /// The normals as a volume of three channels, from -1 to 1.
    pub fn raw_normals(&self) -> RawVolume {
        RawVolume {
            path: "normals".into(),
            format: "normals".into(),
            size: self.volume.size,
            channels: 3,
            values: self.normals.as_flattened().to_vec(),
            full_scale: 1.0,
            alpha_mode: AlphaMode::Straight,
        }
    }
}

/// A triangle in texel space, with its area there.
struct Facet {
    corners: [DVec3; 3],
    /// Along the normal, as long as the triangle is large.
    area: DVec3,
    uvs: [DVec2; 3],
    material: u32,
}

/// The texels, and whether u and v go around.
#[derive(Clone, Copy)]
struct Grid {
    size: [usize; 3],
    tile: bool,
}

impl Grid {
    /// The index along `axis`, u or v, of a texel that may lie beyond the borders; none where it is cut off.
    fn wrapped(&self, axis: usize, index: i64) -> Option<usize> {
        let count = self.size[axis] as i64;
        if self.tile {
            Some(index.rem_euclid(count) as usize)
        } else {
            (0..count).contains(&index).then_some(index as usize)
        }
    }

    /// For each row of texels along u (and w), the boxes that reach into it, `[low, high]` along v, and the row that they reach
    /// into before it was wrapped.
    fn rows(&self, boxes: impl IntoIterator<Item = [f64; 2]>) -> Vec<Vec<(usize, i64)>> {
        let mut rows = vec![Vec::new(); self.size[1]];
        for (id, [low, high]) in boxes.into_iter().enumerate() {
            for row in low.floor() as i64..=high.floor() as i64 {
                if let Some(wrapped) = self.wrapped(1, row) {
                    rows[wrapped].push((id, row));
                }
            }
        }
        rows
    }

    /// Computes every row of texels, `values` of u and then w, in parallel, and puts them in the order of a volume.
    fn fill<T: Copy + Default + Send>(&self, row: impl Fn(usize, &mut [T]) + Sync) -> Vec<T> {
        let [width, height, depth] = self.size;
        let mut rows = vec![T::default(); width * height * depth];
        rows.par_chunks_mut(width * depth).enumerate().for_each(|(v, values)| row(v, values));
        let mut ordered = Vec::with_capacity(rows.len());
        for w in 0..depth {
            for v in 0..height {
                ordered.extend_from_slice(&rows[(v * depth + w) * width..][..width]);
            }
        }
        ordered
    }
}

/// Voxelises `model`.
///
/// # Errors
/// [`Error::Usage`] where the options leave no room, [`Error::OutOfMemory`] beyond 2^28 texels, and [`Error::Input`] where the
/// mesh encloses nothing: open edges, triangles that disagree on the outside, no triangle, no volume.
pub fn voxelize(model: &Model, options: &Options) -> Result<Voxels> {
    check(options)?;
    if model.triangles.is_empty() {
        return Err(Error::input(&model.path, "the mesh has no triangle"));
    }
    if options.sheet.is_none() {
        closed::check(model)?;
    }
    let placement = Placement::new(model, options)?;
    let facets = facets(model, &placement);
    let grid = Grid { size: options.size.map(|n| n as usize), tile: options.tile };

    let coverage = match options.sheet {
        None => rays::coverage(&grid, &solid::Solid::new(&facets)),
        Some(thickness) => rays::coverage(&grid, &sheet::Sheet { facets: &facets, radius: 0.5 * thickness }),
    };
    if coverage.iter().all(|&covered| covered == 0.0) {
        let help = "are its surfaces doubled back to back? Give them a thickness by --surface, in texels";
        return Err(Error::input(&model.path, "the mesh fills no part of the volume").with_help(help));
    }
    let patches = surface::patches(&grid, &facets, &model.materials);
    let has_surface: Vec<bool> = patches.iter().map(surface::Patch::is_seen).collect();
    if !has_surface.contains(&true) {
        let help = "the margin cuts all of it off; let it wrap around by --tile, or make the margin larger";
        return Err(
            Error::input(&model.path, "no part of the mesh's surface is in the volume").with_help(help)
        );
    }
    let sources = nearest::sources(&grid, &has_surface);

    let texel = |index: usize| {
        let alpha = coverage[index];
        let colour = if alpha > 0.0 { alpha * patches[sources[index]].colour() } else { glam::Vec3::ZERO };
        colour.extend(alpha).to_array()
    };
    let normal =
        |index: usize| if coverage[index] > 0.0 { patches[index].normal().to_array() } else { [0.0; 3] };
    let texels = (0..coverage.len()).into_par_iter().map(texel).collect();
    let normals = (0..coverage.len()).into_par_iter().map(normal).collect();
    let volume = Volume::new(options.size, texels)
        .map_err(|invalid| Error::input(&model.path, invalid.to_string()))?;
    Ok(Voxels { volume, normals, scale: placement.scale.to_array() })
}

fn check(options: &Options) -> Result<()> {
    let Options { size, sheet, .. } = *options;
    let [width, height, depth] = size;
    match super::texel_count(size) {
        Some(count) if count <= MAX_TEXELS => {}
        None if size.contains(&0) => {
            let message = format!("a volume of {width} x {height} x {depth} texels has none");
            return Err(Error::Usage { message, help: None });
        }
        _ => {
            let message = format!("a volume of {width} x {height} x {depth} texels is more than 2^28 texels");
            return Err(Error::OutOfMemory { message, help: Some("ask for a smaller size".into()) });
        }
    }
    if sheet.is_some_and(|thickness| thickness.is_nan() || thickness <= 0.0) {
        return Err(Error::Usage { message: "a surface needs a thickness above 0".into(), help: None });
    }
    Ok(())
}

fn facets(model: &Model, placement: &Placement) -> Vec<Facet> {
    let positions: Vec<DVec3> =
        model.positions.iter().map(|&position| placement.texel_from_model(position)).collect();
    let facet = |triangle: usize| {
        let corners = model.triangles[triangle].map(|id| positions[id as usize]);
        let [a, b, c] = corners;
        let (uvs, material) = (model.uvs[triangle], model.triangle_materials[triangle]);
        Facet { corners, area: 0.5 * (b - a).cross(c - a), uvs, material }
    };
    (0..model.triangles.len()).map(facet).collect()
}
