//! A shell as seen from one eye: what the shaders need of each tetrahedron, front to back. Positions are taken relative to the
//! eye in f64 before anything is f32, so that a scene far from the origin loses nothing, and in parts of the scene's own reach, so
//! that its scale changes nothing: not what f32 rounds, nor whether it overflows.

use std::collections::HashSet;
use std::ops::Range;

use bytemuck::{Pod, Zeroable};
use glam::{DMat3, DVec2, DVec3};
use rayon::prelude::*;

use super::outline::{Projection, Unseen};
use crate::order::Sorted;
use crate::scene::{Scene, View};

/// `Cell` of `glsl/include/shell.glsl`: see there for each member.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "documented at the one declaration in glsl")]
pub struct Cell {
    pub outline: [[f32; 4]; 2],
    pub planes: [[f32; 4]; 4],
    pub texture: [[f32; 4]; 3],
}

/// `Tile` of `glsl/include/shell.glsl`: see there for each member.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "documented at the one declaration in glsl")]
pub struct Tile {
    pub bounds: [f32; 4],
    pub members: [u32; 2],
    pub picture: u32,
    pub padding: u32,
}

/// The side of a [`Tile`] in pixels: small enough that few members of a large cycle reach into one.
const TILE: u32 = 16;

/// A cell as it is seen.
struct Mapped {
    tetrahedron: u32,
    cell: Cell,
    /// The least depth of a vertex, in world units.
    nearest: f64,
    /// Whether more than level 0 can be needed in it.
    minified: bool,
}

/// `None` where there is no volume.
type Found = Option<Result<Mapped, Unseen>>;

/// What is drawn together.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Run {
    /// These cells, one after another.
    Sorted(Range<u32>),
    /// These tiles, each resolved per pixel among its members.
    Cycle(Range<u32>),
}

/// All that can be seen, and what cannot.
#[derive(Debug, Clone, Default)]
pub struct Seen {
    /// Front to back.
    pub cells: Vec<Cell>,
    /// That of each cell, in the shell.
    pub tetrahedra: Vec<u32>,
    /// Where cells meet that have no order of their own.
    pub tiles: Vec<Tile>,
    /// Cells, by tile.
    pub members: Vec<u32>,
    /// Front to back; every cell is in one.
    pub runs: Vec<Run>,
    /// Tetrahedra before the near plane.
    pub before_near: u64,
    /// Tetrahedra beside the picture.
    pub beside: u64,
    /// Whether any level of detail but 0 is needed.
    pub minified: bool,
    /// The unit of all lengths on the device, in world units: how far the shell reaches from the eye.
    pub unit: f64,
}

impl Seen {
    /// Maps the tetrahedra of `scene` in the order `sorted` to `view`, on a rasteriser that snaps to `subpixels`
    /// a pixel.
    pub fn new(scene: &Scene, sorted: &Sorted, view: &View, subpixels: u32) -> Self {
        let eye = Eye::new(scene, view, subpixels);
        let order = &sorted.order;
        let found: Vec<Found> = order
            .sequence
            .par_iter()
            .map(|&t| {
                let (t, exit_faces) = (t as usize, sorted.exit_faces[t as usize]);
                let has_volume = exit_faces != 0 && scene.shell.cells[t].has_maps();
                has_volume.then(|| eye.cell(t, exit_faces))
            })
            .collect();
        let mut seen = Self { cells: Vec::with_capacity(found.len()), unit: eye.unit, ..Self::default() };
        let mut done = 0;
        for cycle in &order.cycles {
            seen.add_sorted(&found[done..cycle.start]);
            seen.add_cycle(&found[cycle.clone()], view);
            done = cycle.end;
        }
        seen.add_sorted(&found[done..]);
        seen
    }

    fn add_sorted(&mut self, found: &[Found]) {
        let added = self.add(found.iter().flatten());
        if !added.is_empty() {
            self.runs.push(Run::Sorted(added));
        }
    }

    fn add_cycle(&mut self, found: &[Found], view: &View) {
        // No order is right, but members that come about nearest first are sorted quickly in every pixel.
        let mut found: Vec<_> = found.iter().flatten().collect();
        found.sort_by(|a, b| {
            let [a, b] = [a, b].map(|found| found.as_ref().map_or(0.0, |mapped| mapped.nearest));
            a.total_cmp(&b)
        });
        let added = self.add(found);
        if added.is_empty() {
            return;
        }
        let first_tile = self.tiles.len() as u32;
        let columns = view.width.div_ceil(TILE);
        let size = [f64::from(view.width), f64::from(view.height)];
        let mut inside: Vec<(u32, u32)> = Vec::new(); // tile, cell
        for cell in added {
            let corners =
                || self.cells[cell as usize].outline.into_iter().flat_map(|[x, y, z, w]| [[x, y], [z, w]]);
            let [across, down] = [0, 1].map(|axis| {
                let pixels = corners().map(|corner| (0.5 + 0.5 * f64::from(corner[axis])) * size[axis]);
                let (low, high) =
                    pixels.fold((f64::INFINITY, 0.0), |(low, high), x| (low.min(x), x.max(high)));
                // A pixel more on either side than outlines in f32 can be off.
                let tile = |pixel: f64| pixel.clamp(0.0, size[axis] - 1.0) as u32 / TILE;
                tile(low - 1.0)..=tile(high + 1.0)
            });
            inside.extend(down.flat_map(|y| across.clone().map(move |x| (y * columns + x, cell))));
        }
        inside.sort_unstable();
        for tile in inside.chunk_by(|a, b| a.0 == b.0) {
            let first = self.members.len() as u32;
            self.members.extend(tile.iter().map(|(_, cell)| cell));
            let [x, y] = [tile[0].0 % columns * TILE, tile[0].0 / columns * TILE];
            let clip = |pixel: u32, axis: usize| (2.0 * f64::from(pixel) / size[axis] - 1.0) as f32;
            self.tiles.push(Tile {
                bounds: [clip(x, 0), clip(y, 1), clip(x + TILE, 0), clip(y + TILE, 1)],
                members: [first, self.members.len() as u32],
                picture: 0,
                padding: 0,
            });
        }
        self.runs.push(Run::Cycle(first_tile..self.tiles.len() as u32));
    }

    /// Whether a pixel lies in a tile.
    pub fn is_tiled(&self, view: &View) -> impl Fn(u32, u32) -> bool + use<> {
        let columns = view.width.div_ceil(TILE);
        let size = [f64::from(view.width), f64::from(view.height)];
        let place = |tile: &Tile| {
            let [x, y] = [0, 1].map(|axis| {
                // Of a corner of whole pixels, in f32.
                let pixel = (0.5 + 0.5 * f64::from(tile.bounds[axis])) * size[axis];
                pixel.round() as u32 / TILE
            });
            y * columns + x
        };
        let tiles: HashSet<u32> = self.tiles.iter().map(place).collect();
        move |x, y| tiles.contains(&(y / TILE * columns + x / TILE))
    }

    /// Keeps those that can be seen, counts the others.
    fn add<'a>(&mut self, found: impl IntoIterator<Item = &'a Result<Mapped, Unseen>>) -> Range<u32> {
        let first = self.cells.len() as u32;
        for found in found {
            match found {
                Ok(mapped) => {
                    self.minified |= mapped.minified;
                    self.cells.push(mapped.cell);
                    self.tetrahedra.push(mapped.tetrahedron);
                }
                Err(Unseen::BeforeNear) => self.before_near += 1,
                Err(Unseen::Beside) => self.beside += 1,
            }
        }
        first..self.cells.len() as u32
    }
}

/// The eye, with all that maps to its picture.
struct Eye<'a> {
    scene: &'a Scene,
    position: DVec3,
    /// Rows: right, up, forward.
    view_from_world: DMat3,
    projection: Projection,
    /// See [`Seen::unit`].
    unit: f64,
}

impl<'a> Eye<'a> {
    fn new(scene: &'a Scene, view: &View, subpixels: u32) -> Self {
        let frame = view.camera.frame();
        let projection = Projection {
            centre: 0.5 * DVec2::new(f64::from(view.width), f64::from(view.height)),
            pixel: view.pixel_at_unit_depth(),
            near: view.camera.near,
            // Snapping moves an edge by at most half a subpixel diagonally; corners in f32, at most `FARTHEST` pictures away,
            // are off by less than another half up to pictures of 2^13 pixels.
            margin: 2.0 / f64::from(subpixels),
        };
        let distances = scene.shell.vertices.iter().map(|vertex| vertex.distance_squared(view.camera.eye));
        Self {
            scene,
            unit: distances.fold(view.camera.near.powi(2), f64::max).sqrt(),
            position: view.camera.eye,
            view_from_world: DMat3::from_cols(frame.right, frame.up, frame.forward).transpose(),
            projection,
        }
    }

    fn cell(&self, t: usize, exit_faces: u8) -> Result<Mapped, Unseen> {
        let shell = &self.scene.shell;
        let vertices = shell.vertices_of(t).map(|vertex| self.view_from_world * (vertex - self.position));
        let outline = self.projection.outline(&vertices, exit_faces)?;
        let clip = |corner: DVec2| (corner - self.projection.centre) / self.projection.centre;
        let [a, b, c, d] = outline.map(|corner| clip(corner).as_vec2());

        let planes = shell.planes(t);
        let planes = std::array::from_fn(|k| {
            // From a vertex of the face that both its cells choose: planes of a shared face are equal up to their sign.
            let on_face = shell.vertices[shell.face(t, k)[0] as usize] - self.position;
            let normal = planes[k].truncate();
            (self.view_from_world * normal).as_vec3().extend((normal.dot(on_face) / self.unit) as f32).into()
        });
        let texture_from_view = shell.cells[t].texture_from_world * self.view_from_world.transpose();
        let texture_at_eye = shell.texture[t][0] - texture_from_view * vertices[0];
        let texture = std::array::from_fn(|i| {
            (texture_from_view.row(i) * self.unit).as_vec3().extend(texture_at_eye[i] as f32).into()
        });
        let cell = Cell { outline: [[a.x, a.y, b.x, b.y], [c.x, c.y, d.x, d.y]], planes, texture };
        let depths = vertices.map(|vertex| vertex.z);
        let nearest = depths.into_iter().fold(f64::INFINITY, f64::min);
        let farthest = depths.into_iter().fold(f64::NEG_INFINITY, f64::max);
        // Of all directions, so at least that across the ray.
        let size = self.scene.volume.levels[0].size;
        let texels_per_unit =
            (0..3).map(|i| f64::from(size[i]) * texture_from_view.row(i).length()).fold(0.0, f64::max);
        let footprint = self.scene.medium.lod_footprint * self.projection.pixel * farthest;
        Ok(Mapped { tetrahedron: t as u32, cell, nearest, minified: footprint * texels_per_unit > 1.0 })
    }
}
