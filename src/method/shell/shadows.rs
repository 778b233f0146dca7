//! The pictures that lights take of the scene: for every pixel how the medium dims the light along its ray
//! (`glsl/shadow.frag.glsl`), and which solid stops it (`glsl/blocker.frag.glsl`). They lie side by side in one image of each kind,
//! depend on no eye, and are drawn once.
//!
//! Dufort, Leblanc, Poulin 2005, section 5.3, read an opaque shadow map at every sample, and give transmittance up as too costly.
//! Here the map holds transmittance as a function of depth (Lokovic, Veach 2000), which one pass over the shell makes.

use std::ops::Range;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::{DMat3, DVec2, DVec3};
use rayon::prelude::*;

use super::constants::{ViewConstants, constants_of_volume};
use super::seen::{Cell, Tile};
use super::volume::DeviceVolume;
use crate::Result;
use crate::gpu::{Batch, Buffer, Draw, Gpu, Keeps, Pipeline, PipelineInfo, Sampled, Target, draw, shaders};
use crate::progress::{Interrupt, Progress};
use crate::scene::shading::MOST_LIGHTS;
use crate::scene::{LightView, March, Scene, Skip};
use crate::shell::Shell;

/// `LightPicture` of `glsl/include/picture.glsl`: see there for each member.
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "documented at the one declaration in glsl")]
pub struct LightPicture {
    pub from_world: [[f32; 4]; 3],
    pub middle: [f32; 2],
    pub half_side: f32,
    pub pixel: f32,
    pub is_parallel: u32,
    pub opacity_distances: f32,
    pub padding: [u32; 2],
}

/// `Blocker` of `glsl/include/blocker.glsl`: see there for each member.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "documented at the one declaration in glsl")]
pub struct Blocker {
    pub corners: [[f32; 4]; 3],
    pub depth_function: [f32; 4],
    pub picture: u32,
    pub padding: [u32; 3],
}

/// `MOST_PICTURES` of `glsl/include/lights.glsl`: a point light in the midst of the scene has six.
pub const MOST_PICTURES: usize = 6 * MOST_LIGHTS;

/// `PARTS` of `glsl/include/curve.glsl`.
const PARTS: usize = 4;

/// The side of a [`Tile`] in pixels: a power of two. Where many tetrahedra are seen in one, it is smaller.
const TILE: u32 = 16;

/// Tetrahedra in a tile from which on it is too large, unless it is a pixel already: every pixel of it tries them all, a few times,
/// and gives up after `MOST_PASSES` of `glsl/include/gather.glsl`.
const CROWD: usize = 4096;

/// Depth before which a light sees nothing, as a part of the depth of its picture: what it stands in is not drawn by infinite
/// slopes.
const NEAR: f32 = 1e-6;

/// Texels a step, at most: coarser ones miss what is a texel thick.
const COARSEST_STEP: f64 = 0.5;

/// What all lights see.
pub struct Shadows {
    views: Vec<LightView>,
    /// Of the views, by light that casts shadows.
    ranges: Vec<Range<usize>>,
    /// Pixels a side of a picture.
    side: u32,
    /// Pictures in a row of the image.
    columns: u32,
    opacity_distance: f64,
    curves: Target,
    /// Where there are solids.
    blockers: Option<Target>,
}

/// How a light's tetrahedra lie in its picture.
#[derive(Default)]
struct Drawn {
    cells: Vec<Cell>,
    tiles: Vec<Tile>,
    members: Vec<u32>,
    minified: bool,
}

impl Shadows {
    /// Draws the pictures of all lights that cast shadows; `None` where there is no such light. Where `leaps`, rays do, over what is empty.
    ///
    /// # Errors
    /// [`Error::Device`](crate::Error::Device) where the pictures are too large for the device,
    /// [`Error::OutOfMemory`](crate::Error::OutOfMemory), [`Error::Interrupted`](crate::Error::Interrupted).
    pub fn draw(
        gpu: &Arc<Gpu>,
        scene: &Scene,
        volume: &DeviceVolume,
        leaps: bool,
        progress: &dyn Progress,
        interrupt: &Interrupt,
    ) -> Result<Option<Self>> {
        let Some(shading) = scene.shading.as_ref().filter(|shading| shading.casts_shadows()) else {
            return Ok(None);
        };
        let (centre, radius) = scene.bounds();
        let mut views = Vec::new();
        let mut ranges = Vec::new();
        for light in shading.lights.iter().filter(|light| light.shadow) {
            let first = views.len();
            views.extend(LightView::of(light, centre, radius, shading.shadow_size));
            ranges.push(first..views.len());
        }
        progress.stage("drawing shadows");
        let side = shading.shadow_size;
        let columns = (1..).find(|columns| columns * columns >= views.len() as u32).expect("few pictures");
        let rows = (views.len() as u32).div_ceil(columns);
        let size = [columns, rows].map(|pictures| pictures * side);
        let target = |images, nearest| {
            Target::sampled(gpu, "the shadows", size, images, nearest).map_err(|error| {
                error.with_help("make shading.shadow_size smaller, or let fewer lights cast shadows")
            })
        };
        let mut shadows = Self {
            curves: target(1 + PARTS, false)?,
            blockers: if scene.solids.is_empty() { None } else { Some(target(1, true)?) },
            views,
            ranges,
            side,
            columns,
            opacity_distance: scene.medium.opacity_distance,
        };
        shadows.draw_curves(gpu, scene, volume, leaps, &|done| {
            progress.fraction(done);
            interrupt.check()
        })?;
        shadows.draw_blockers(gpu, scene, interrupt)?;
        Ok(Some(shadows))
    }

    /// How many pictures there are.
    pub fn pictures(&self) -> usize {
        self.views.len()
    }

    /// The most that one light has.
    pub fn pictures_a_light(&self) -> usize {
        self.ranges.iter().map(Range::len).max().unwrap_or(0)
    }

    /// The longest way, in world units, from one pixel of a picture to the next.
    pub fn widest_pixel(&self) -> f64 {
        let width = |view: &LightView| if view.is_parallel { view.pixel } else { view.pixel * view.far };
        self.views.iter().map(width).fold(0.0, f64::max)
    }

    /// By the binding that shaders name.
    pub fn textures(&self) -> Vec<(u32, Sampled<'_>)> {
        let blockers = self.blockers.iter().map(|target| (14, Sampled::Picture(target)));
        [(10, Sampled::Picture(&self.curves))].into_iter().chain(blockers).collect()
    }

    /// The pictures, for points in world space around `eye` in parts of `unit`: as many of each light, the last of which may hold
    /// nothing; and as many as shaders declare.
    pub fn seen_from(&self, eye: DVec3, unit: f64) -> Vec<LightPicture> {
        let picture = |(index, view): (usize, &LightView)| {
            let way = eye - view.origin;
            // Pixels are counted where depth is 1, in the light's own unit.
            let across = if view.is_parallel { view.pixel } else { view.pixel * view.far };
            let row = |axis: DVec3, per: f64| {
                let row = (axis * (unit / per)).extend(axis.dot(way) / per);
                row.as_vec4().to_array()
            };
            LightPicture {
                from_world: [
                    row(view.frame.right, across),
                    row(view.frame.up, across),
                    row(view.frame.forward, view.far),
                ],
                ..self.picture(index)
            }
        };
        let nothing = LightPicture { half_side: -1.0, ..LightPicture::default() };
        let most = self.pictures_a_light();
        let mut pictures = Vec::new();
        for range in &self.ranges {
            pictures.extend(range.clone().map(|index| picture((index, &self.views[index]))));
            pictures.resize(pictures.len().next_multiple_of(most), nothing);
        }
        pictures.resize(MOST_PICTURES, nothing);
        pictures
    }

    /// Of no eye.
    fn picture(&self, index: usize) -> LightPicture {
        let view = &self.views[index];
        let place = [index as u32 % self.columns, index as u32 / self.columns];
        let half_side = 0.5 * self.side as f32;
        LightPicture {
            middle: place.map(|place| (place * self.side) as f32 + half_side),
            half_side,
            pixel: in_its_unit(view) as f32,
            is_parallel: view.is_parallel.into(),
            opacity_distances: (view.far / self.opacity_distance) as f32,
            ..LightPicture::default()
        }
    }

    fn pictures_of_no_eye(&self) -> Vec<LightPicture> {
        (0..self.views.len()).map(|index| self.picture(index)).collect()
    }

    fn draw_curves(
        &mut self,
        gpu: &Arc<Gpu>,
        scene: &Scene,
        volume: &DeviceVolume,
        leaps: bool,
        between: &dyn Fn(f64) -> Result<()>,
    ) -> Result<()> {
        let mut drawn = Drawn::default();
        for index in 0..self.views.len() {
            self.add_picture(&mut drawn, scene, index);
        }
        let step = match scene.march {
            March::Default { step } => step.min(COARSEST_STEP),
            March::Paper { .. } | March::Exact => COARSEST_STEP,
        };
        let constants = ViewConstants {
            near: NEAR,
            lod_scale: scene.medium.lod_footprint as f32,
            step: step as f32,
            samples: 1,
            ..ViewConstants::of_volume(&scene.volume)
        };
        let minified = drawn.minified || !scene.skips.allow(Skip::Levels);
        let info = PipelineInfo {
            vertex: shaders::TILE_VERT.with(&["LIGHT"]),
            fragment: shaders::SHADOW_FRAG.with(if leaps { &["SPARSE"] } else { &[] }),
            constants: &constants_of_volume(March::default(), minified, &scene.volume),
            storage_buffers: &[0, 1, 2, 6],
            uniform_buffers: &[],
            texel_buffers: &[],
            textures: if leaps { &[8, 22] } else { &[8] },
            push_constant_bytes: size_of::<ViewConstants>() as u32,
            keeps: Keeps::Last,
        };
        let pipeline = Pipeline::new(gpu, &self.curves, &info)?;
        let tiles = drawn.tiles.len() as u32;
        let cells = Buffer::storage(gpu, "the lights' tetrahedra", &drawn.cells)?;
        let tiles_buffer = Buffer::storage(gpu, "the lights' tiles", &drawn.tiles)?;
        let members = Buffer::storage(gpu, "the members of the lights' tiles", &drawn.members)?;
        let pictures = Buffer::storage(gpu, "the lights' pictures", &self.pictures_of_no_eye())?;
        draw(&Draw {
            target: &self.curves,
            clears: true,
            buffers: &[(0, &cells), (1, &tiles_buffer), (2, &members), (6, &pictures)],
            textures: &volume.textures(),
            push_constants: bytemuck::bytes_of(&constants),
            batches: &[Batch { pipeline: &pipeline, vertices: 0..6 * tiles }],
            between,
        })?;
        Ok(())
    }

    /// Adds what one light sees of the shell.
    fn add_picture(&self, drawn: &mut Drawn, scene: &Scene, index: usize) {
        let view = &self.views[index];
        let lens = Lens::new(view, self.side);
        let found = (0..scene.shell.topology.tetrahedra.len()).into_par_iter();
        let mut found: Vec<(Cell, Bounds, bool)> = found.filter_map(|t| lens.cell(scene, t)).collect();
        // Members that come about nearest first are sorted quickly in every pixel.
        found.par_sort_by(|a, b| a.1.nearest.total_cmp(&b.1.nearest));
        let first_cell = drawn.cells.len() as u32;
        let (tile_side, inside) = self.tiled(first_cell, &found);
        let across = self.side.div_ceil(tile_side);
        for (cell, _, minified) in found {
            drawn.cells.push(cell);
            drawn.minified |= minified;
        }
        let [width, height] = self.curves.size().map(f64::from);
        let corner =
            [index as u32 % self.columns, index as u32 / self.columns].map(|place| place * self.side);
        for tile in inside.chunk_by(|a, b| a.0 == b.0) {
            let first = drawn.members.len() as u32;
            drawn.members.extend(tile.iter().map(|(_, cell)| cell));
            let [x, y] = [tile[0].0 % across * tile_side, tile[0].0 / across * tile_side];
            let clip = |axis: usize, pixel: u32, size: f64| {
                (2.0 * f64::from(corner[axis] + pixel.min(self.side)) / size - 1.0) as f32
            };
            drawn.tiles.push(Tile {
                bounds: [
                    clip(0, x, width),
                    clip(1, y, height),
                    clip(0, x + tile_side, width),
                    clip(1, y + tile_side, height),
                ],
                members: [first, drawn.members.len() as u32],
                picture: index as u32,
                padding: 0,
            });
        }
    }

    /// The tiles of a picture, and the cells that are seen in each, as sorted pairs of tile and cell; and the side of a tile.
    fn tiled(&self, first_cell: u32, found: &[(Cell, Bounds, bool)]) -> (u32, Vec<(u32, u32)>) {
        let mut tile_side = TILE;
        loop {
            let across = self.side.div_ceil(tile_side);
            let mut inside: Vec<(u32, u32)> = Vec::new(); // tile, cell
            for (cell, (_, bounds, _)) in (first_cell..).zip(found) {
                let tiles = |axis: usize| {
                    // A pixel more on either side than rounding can be off.
                    let tile = |pixel: f64| pixel.clamp(0.0, f64::from(self.side) - 1.0) as u32 / tile_side;
                    tile(bounds.low[axis] - 1.0)..=tile(bounds.high[axis] + 1.0)
                };
                inside.extend(tiles(1).flat_map(|y| tiles(0).map(move |x| (y * across + x, cell))));
            }
            inside.par_sort_unstable();
            let largest = inside.chunk_by(|a, b| a.0 == b.0).map(<[_]>::len).max().unwrap_or(0);
            if largest <= CROWD || tile_side == 1 {
                return (tile_side, inside);
            }
            tile_side /= 2;
        }
    }

    fn draw_blockers(&mut self, gpu: &Arc<Gpu>, scene: &Scene, interrupt: &Interrupt) -> Result<()> {
        let Some(target) = &self.blockers else { return Ok(()) };
        let mut blockers: Vec<Blocker> = Vec::new();
        for (index, view) in (0..).zip(&self.views) {
            for solid in scene.solids.iter() {
                let of_triangle = |t: usize| blocker(view, solid.corners(t), index);
                blockers.extend((0..solid.mesh.triangles.len()).filter_map(of_triangle));
            }
        }
        let [width, height] = target.size();
        let constants = ViewConstants {
            centre: [0.5 * width as f32, 0.5 * height as f32],
            near: NEAR,
            ..ViewConstants::zeroed()
        };
        let info = PipelineInfo {
            vertex: shaders::BLOCKER_VERT.with(&[]),
            fragment: shaders::BLOCKER_FRAG.with(&[]),
            constants: &[],
            storage_buffers: &[6, 7],
            uniform_buffers: &[],
            texel_buffers: &[],
            textures: &[],
            push_constant_bytes: size_of::<ViewConstants>() as u32,
            keeps: Keeps::Nearest,
        };
        let pipeline = Pipeline::new(gpu, target, &info)?;
        let pictures = Buffer::storage(gpu, "the lights' pictures", &self.pictures_of_no_eye())?;
        let buffer = Buffer::storage(gpu, "what blocks the lights", &blockers)?;
        draw(&Draw {
            target,
            clears: true,
            buffers: &[(6, &pictures), (7, &buffer)],
            textures: &[],
            push_constants: bytemuck::bytes_of(&constants),
            batches: &[Batch { pipeline: &pipeline, vertices: 0..3 * blockers.len() as u32 }],
            between: &|_| interrupt.check(),
        })?;
        Ok(())
    }
}

/// Distance of pixel centres, at depth 1 or of parallel rays, in parts of the picture's depth.
fn in_its_unit(view: &LightView) -> f64 {
    if view.is_parallel { view.pixel / view.far } else { view.pixel }
}

/// `None` where the light sees the triangle edge-on.
fn blocker(view: &LightView, corners: [DVec3; 3], picture: u32) -> Option<Blocker> {
    let [a, b, c] = corners.map(|corner| view.frame.view_from_world() * (corner - view.origin) / view.far);
    let normal = (b - a).cross(c - a).normalize_or_zero();
    let height = normal.dot(a);
    let pixel = in_its_unit(view);
    let [along, right, down, constant] = if view.is_parallel {
        [normal.z, -normal.x * pixel, normal.y * pixel, height]
    } else {
        [height, normal.x * pixel, -normal.y * pixel, normal.z]
    };
    let depth_function = DVec3::new(constant, right, down) / along;
    depth_function.is_finite().then(|| Blocker {
        corners: [a, b, c].map(|corner| corner.as_vec3().extend(0.0).to_array()),
        depth_function: depth_function.as_vec3().extend(0.0).to_array(),
        picture,
        padding: [0; 3],
    })
}

/// Where a tetrahedron is in a light's picture.
struct Bounds {
    /// In pixels from the upper left corner.
    low: DVec2,
    high: DVec2,
    /// The least depth of a vertex.
    nearest: f64,
}

/// A light's picture, ready to place tetrahedra in.
struct Lens<'a> {
    view: &'a LightView,
    light_from_world: DMat3,
    side: f64,
}

impl<'a> Lens<'a> {
    fn new(view: &'a LightView, side: u32) -> Self {
        Self { view, light_from_world: view.frame.view_from_world(), side: f64::from(side) }
    }

    /// A tetrahedron, where it is, and whether more than level 0 can be needed in it; `None` where none of it is seen.
    fn cell(&self, scene: &Scene, t: usize) -> Option<(Cell, Bounds, bool)> {
        let Shell { vertices, texture, .. } = &*scene.shell;
        if !scene.shell.has_maps(t) {
            return None;
        }
        let unit = self.view.far;
        let corners = scene.shell.vertices_of(t);
        let corners = corners.map(|corner| self.light_from_world * (corner - self.view.origin) / unit);
        let bounds = self.bounds(&corners)?;
        let planes = scene.shell.planes(t);
        let planes = std::array::from_fn(|k| {
            // From a vertex of the face that both its cells choose, as for the eye.
            let on_face = vertices[scene.shell.face(t, k)[0] as usize] - self.view.origin;
            let normal = planes[k].truncate();
            (self.light_from_world * normal).as_vec3().extend((normal.dot(on_face) / unit) as f32).into()
        });
        let texture_from_light =
            scene.shell.cells()[t].texture_from_world * self.light_from_world.transpose() * unit;
        let at_origin = texture[t][0] - texture_from_light * corners[0];
        let rows =
            std::array::from_fn(|i| texture_from_light.row(i).as_vec3().extend(at_origin[i] as f32).into());
        let size = scene.volume.levels[0].size;
        let densest =
            (0..3).map(|i| f64::from(size[i]) * texture_from_light.row(i).length()).fold(0.0, f64::max);
        let farthest = if self.view.is_parallel {
            1.0
        } else {
            corners.iter().map(|corner| corner.length()).fold(0.0, f64::max)
        };
        let footprint = scene.medium.lod_footprint * in_its_unit(self.view) * farthest;
        let cell = Cell { outline: [[0.0; 4]; 2], planes, texture: rows };
        Some((cell, bounds, footprint * densest > 1.0))
    }

    fn bounds(&self, corners: &[DVec3; 4]) -> Option<Bounds> {
        let nearest = corners.iter().map(|corner| corner.z).fold(f64::INFINITY, f64::min);
        let farthest = corners.iter().map(|corner| corner.z).fold(f64::NEG_INFINITY, f64::max);
        let near = f64::from(NEAR);
        if farthest <= near {
            return None;
        }
        let (mut low, mut high) = (DVec2::splat(f64::INFINITY), DVec2::splat(f64::NEG_INFINITY));
        let mut include = |point: DVec3| {
            let scale = in_its_unit(self.view) * if self.view.is_parallel { 1.0 } else { point.z };
            let place = DVec2::new(point.x, -point.y) / scale + 0.5 * self.side;
            (low, high) = (low.min(place), high.max(place));
        };
        let is_cut = !self.view.is_parallel && nearest < near;
        for (i, &corner) in corners.iter().enumerate() {
            if !is_cut || corner.z >= near {
                include(corner);
            }
            if is_cut {
                for &other in &corners[..i] {
                    if (corner.z < near) != (other.z < near) {
                        let part = (near - corner.z) / (other.z - corner.z);
                        include(corner.lerp(other, part).with_z(near));
                    }
                }
            }
        }
        let is_beside = high.min_element() < -1.0 || low.max_element() > self.side + 1.0;
        (!is_beside).then_some(Bounds { low, high, nearest })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn host_and_shader_agree_on_the_pictures_of_a_curve() {
        let shader = include_str!("../../../glsl/include/curve.glsl");
        assert!(shader.contains(&format!("const uint PARTS = {PARTS};")));
    }
}
