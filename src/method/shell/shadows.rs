//! The pictures that lights take of the scene: for every pixel how the medium dims the light along its ray
//! (`glsl/shadow.frag.glsl`), and which solid stops it (`glsl/blocker.frag.glsl`). They lie side by side in one image of each kind,
//! depend on no eye, and are drawn once.
//!
//! Dufort, Leblanc, Poulin 2005, section 5.3, read an opaque shadow map at every sample, and give transmittance up as too costly.
//! Here the map holds transmittance as a function of depth (Lokovic, Veach 2000): rays of lights walk through the shell as the eye's do, once.

use std::ops::Range;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::DVec3;

use super::constants::{Levels, ViewConstants, constants_of_volume};
use super::lens::{NEAR, PictureFrame, SeenByLight};
use super::seen::Tile;
use super::volume::DeviceVolume;
use super::walk::{self, RayBuffers, Ways};
use crate::gpu::{Batch, Buffer, Draw, Gpu, Keeps, Pipeline, PipelineInfo, Sampled, Target, draw, shaders};
use crate::order::Crossings;
use crate::progress::{Interrupt, Progress};
use crate::scene::shading::MOST_LIGHTS;
use crate::scene::{Extent, LightView, March, Scene, Skip};
use crate::{Error, Result};

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
    pub rounding: f32,
    pub padding: u32,
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
    /// By how much pixels are wider, at most, than if there were none.
    coarsened_by_solids: f64,
}

/// What draws the curves: of rays that walk, and of those that they leave.
struct CurvePipelines {
    walk: Pipeline,
    left: Pipeline,
}

impl Shadows {
    /// Draws the pictures of all lights that cast shadows, of which there is at least one. `ways` are of the scene's shell, and placed
    /// where the device holds its tetrahedra.
    ///
    /// # Errors
    /// [`Error::Device`] where the pictures are too large for the device,
    /// [`Error::OutOfMemory`], [`Error::Interrupted`].
    pub fn draw(
        gpu: &Arc<Gpu>,
        scene: &Scene,
        volume: &DeviceVolume,
        ways: &Ways,
        progress: &dyn Progress,
        interrupt: &Interrupt,
    ) -> Result<Self> {
        let shading = scene.shading.as_ref().expect("a light casts shadows");
        let extent = scene.extent();
        let mut views = Vec::new();
        let mut ranges = Vec::new();
        let of_shell = (!scene.solids.is_empty()).then(|| Extent::of(scene.shell.vertices.to_vec()));
        let mut coarsened_by_solids: f64 = 1.0;
        for light in shading.lights.iter().filter(|light| light.shadow) {
            let first = views.len();
            views.extend(LightView::of(light, &extent, shading.shadow_size));
            ranges.push(first..views.len());
            if let Some(of_shell) = &of_shell {
                let alone = LightView::of(light, of_shell, shading.shadow_size)[0].pixel;
                coarsened_by_solids = coarsened_by_solids.max(views[first].pixel / alone);
            }
        }
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
            // Rays that have walked are marked by their depth: only the others are gone through again.
            curves: target(1 + PARTS, true)?,
            blockers: if scene.solids.is_empty() { None } else { Some(target(1, true)?) },
            views,
            ranges,
            side,
            columns,
            opacity_distance: scene.medium.opacity_distance,
            coarsened_by_solids,
        };
        // First: rays are followed no farther.
        shadows.draw_blockers(gpu, scene, interrupt)?;
        shadows.draw_curves(gpu, scene, volume, ways, &|done| {
            progress.fraction(done);
            interrupt.check()
        })?;
        Ok(shadows)
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

    /// By how much pixels are wider, at most, than if there were no solids.
    pub fn coarsened_by_solids(&self) -> f64 {
        self.coarsened_by_solids
    }

    /// By the binding that shaders name.
    pub fn textures(&self) -> Vec<(u32, Sampled<'_>)> {
        [(10, Sampled::Picture(&self.curves))].into_iter().chain(self.blocker_texture()).collect()
    }

    fn blocker_texture(&self) -> Option<(u32, Sampled<'_>)> {
        self.blockers.as_ref().map(|target| (14, Sampled::Picture(target)))
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
                // A point's depth, and the three products and three sums that make the light's of it, are rounded by half of EPSILON each,
                // and none is more than the way through all and the eye's to it; one more for the curve.
                rounding: 4.0 * f32::EPSILON * (1.0 + way.length() / view.far) as f32,
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
        let half_side = 0.5 * self.side as f32;
        LightPicture {
            middle: self.corner(index).map(|pixel| pixel as f32 + half_side),
            half_side,
            pixel: view.pixel_of_far() as f32,
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
        ways: &Ways,
        between: &dyn Fn(f64) -> Result<()>,
    ) -> Result<()> {
        let step = match scene.march {
            March::Default { step } => step.min(COARSEST_STEP),
            March::Paper { .. } | March::Exact => COARSEST_STEP,
        };
        let constants = ViewConstants {
            centre: [0.5 * self.side as f32; 2],
            near: NEAR,
            lod_scale: scene.medium.lod_footprint as f32,
            step: step as f32,
            samples: 1,
            ..ViewConstants::of_volume(&scene.volume, volume.even())
        };
        let pictures = Buffer::storage(gpu, "the lights' pictures", &self.pictures_of_no_eye())?;
        let mut textures = volume.textures_of_lights(gpu, &scene.volume)?;
        textures.extend(self.blocker_texture());
        // By whether levels of detail but 0 are needed.
        let mut pipelines: [Option<CurvePipelines>; 2] = [None, None];
        for (index, view) in self.views.iter().enumerate() {
            between(index as f64 / self.views.len() as f64)?;
            let frame = PictureFrame {
                index,
                corner: self.corner(index),
                image: self.curves.size(),
                side: self.side,
            };
            let seen = SeenByLight::new(scene, view, &frame);
            if seen.tiles.is_empty() && index > 0 {
                continue; // the first clears the image
            }
            // What one light's picture takes tells nothing of another's.
            self.curves.forget_pace();
            let crossings = Crossings::of_light(ways.faces(), &scene.shell, view, self.side);
            let minified = seen.minified || !scene.skips.allow(Skip::Levels);
            let pipelines = &mut pipelines[usize::from(minified)];
            if pipelines.is_none() {
                *pipelines = Some(self.curve_pipelines(gpu, scene, volume, volume.levels(minified))?);
            }
            let CurvePipelines { walk: walking, left } = pipelines.as_ref().expect("made just now");
            let cells_of_left =
                Buffer::storage(gpu, "a light's tetrahedra, for rays that are left", &seen.cells)?;
            let of_walked = 0..6 * seen.tiles.len() as u32;
            // Where steps are too many for a ray it takes the longest, in the same tile once more.
            let coarsely = seen.tiles.iter().map(|tile| Tile { coarsely: 1, ..*tile });
            let finely = seen.tiles.iter().copied().filter(|_| step < COARSEST_STEP);
            let tiles: Vec<Tile> = finely.chain(coarsely).collect();
            let of_left = 0..6 * tiles.len() as u32;
            let tiles = Buffer::storage(gpu, "a light's tiles", &tiles)?;
            let members = Buffer::storage(gpu, "the members of a light's tiles", &seen.members)?;
            let mut buffers = vec![(0, &cells_of_left), (1, &tiles), (2, &members), (6, &pictures)];
            let mut batches = vec![Batch { pipeline: left, vertices: of_left }];
            // Where the device has no room for the crossings, no ray walks, and all are left.
            let walked = walk::holds_crossings(gpu.most_texels(), &scene.shell, &crossings).then(|| {
                let cells = Buffer::floats(gpu, "a light's tetrahedra", &seen.cells)?;
                Ok::<_, Error>((cells, RayBuffers::new(gpu, &crossings)?))
            });
            let walked =
                walked.transpose().map_err(|error| error.with_help("make shading.shadow_size smaller"))?;
            if let Some((cells, rays)) = &walked {
                buffers.extend([(18, cells), (19, ways.beyond())]);
                buffers.extend(rays.buffers());
                batches.insert(0, Batch { pipeline: walking, vertices: of_walked });
            }
            draw(&Draw {
                target: &self.curves,
                clears: index == 0,
                buffers: &buffers,
                textures: &textures,
                push_constants: bytemuck::bytes_of(&constants),
                batches: &batches,
                between: &|done| between((index as f64 + done) / self.views.len() as f64),
            })?;
        }
        Ok(())
    }

    fn curve_pipelines(
        &self,
        gpu: &Arc<Gpu>,
        scene: &Scene,
        volume: &DeviceVolume,
        levels: Levels,
    ) -> Result<CurvePipelines> {
        let mut switches = volume.switches().to_vec();
        let mut textures = vec![8];
        if !switches.is_empty() {
            textures.push(22);
        }
        if self.blockers.is_some() {
            switches.push("SOLIDS");
            textures.push(14);
        }
        let mut constants = constants_of_volume(March::default(), levels, &scene.volume).to_vec();
        // Of these the last is used: whether rays begin in the shell.
        let is_any_inside = self.views.iter().any(|view| !view.is_parallel);
        constants.extend([0, 0, u32::from(is_any_inside)]);
        let walk = PipelineInfo {
            vertex: shaders::TILE_VERT.with(&["LIGHT", "WALKED"]),
            fragment: shaders::SHADOW_FRAG.with(&switches),
            constants: &constants,
            storage_buffers: &[1, 6],
            uniform_buffers: &[],
            texel_buffers: &[18, 19, 20, 21],
            textures: &textures,
            minified: levels != Levels::First,
            push_constant_bytes: size_of::<ViewConstants>() as u32,
            keeps: Keeps::Nearest,
        };
        // Those that are left leap over nothing but what is empty.
        switches.retain(|&switch| switch != "SPARSE" || volume.is_sparse());
        let left = PipelineInfo {
            vertex: shaders::TILE_VERT.with(&["LIGHT"]),
            fragment: shaders::SHADOW_LEFT_FRAG.with(&switches),
            storage_buffers: &[0, 1, 2, 6],
            texel_buffers: &[],
            ..walk
        };
        let built = Pipeline::all(gpu, &self.curves, [Some(walk), Some(left)])?;
        let [walk, left] = built.map(|pipeline| pipeline.expect("asked for"));
        Ok(CurvePipelines { walk, left })
    }

    /// Where a picture lies in the image: its upper left corner, in pixels.
    fn corner(&self, index: usize) -> [u32; 2] {
        [index as u32 % self.columns, index as u32 / self.columns].map(|place| place * self.side)
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
            minified: false,
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

/// `None` where the light sees the triangle edge-on.
fn blocker(view: &LightView, corners: [DVec3; 3], picture: u32) -> Option<Blocker> {
    let [a, b, c] = corners.map(|corner| view.place(corner));
    let normal = (b - a).cross(c - a).normalize_or_zero();
    let height = normal.dot(a);
    let pixel = view.pixel_of_far();
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn host_and_shader_agree_on_the_pictures_of_a_curve() {
        let shader = include_str!("../../../glsl/include/curve.glsl");
        assert!(shader.contains(&format!("const uint PARTS = {PARTS};")));
    }

    #[test]
    fn host_and_shader_agree_on_the_longest_step() {
        let shader = include_str!("../../../glsl/shadow_left.frag.glsl");
        assert!(shader.contains(&format!("const float LONGEST_STEP = {COARSEST_STEP};")));
    }
}
