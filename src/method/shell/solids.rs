//! The solids as the eye sees them: their colour and depth in every pixel, before the shell is marched up to them.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::ViewConstants;
use crate::Result;
use crate::gpu::{
    Batch, Buffer, Draw, Gpu, Keeps, Pipeline, PipelineInfo, Sampled, Target, Texture3d, draw, shaders,
};
use crate::progress::Interrupt;
use crate::scene::{Scene, Solid, View};
use crate::volume::{Pyramid, Quantity, Volume};

/// `Triangle` of `glsl/include/triangle.glsl`: see there for each member.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "documented at the one declaration in glsl")]
pub struct Triangle {
    pub corners: [[f32; 4]; 3],
    pub plane: [f32; 4],
    pub texture: [[f32; 4]; 2],
    pub normal: [[f32; 4]; 3],
    pub facing: [f32; 4],
    pub colour: [f32; 4],
}

/// What does not depend on the view: a texture for each solid.
pub struct Solids {
    textures: Vec<Texture3d>,
}

impl Solids {
    /// Uploads the textures; `None` where there are no solids.
    ///
    /// # Errors
    /// [`Error::Device`](crate::Error::Device) where one is too large, [`Error::OutOfMemory`](crate::Error::OutOfMemory).
    pub fn new(gpu: &Arc<Gpu>, solids: &[Solid]) -> Result<Option<Self>> {
        let white = || Pyramid {
            levels: vec![Volume { size: [1; 3], texels: vec![[1.0; 4]], quantity: Quantity::Opacity }],
        };
        let texture = |solid: &Solid| match &solid.texture {
            Some(texture) => Texture3d::upload(gpu, "a solid's texture", texture),
            None => Texture3d::upload(gpu, "a solid's texture", &white()),
        };
        let texture = |solid: &Solid| {
            texture(solid).map_err(|error| {
                error.of(&solid.origin.display().to_string()).with_help("scale the solid's picture down")
            })
        };
        let textures: Vec<Texture3d> = solids.iter().map(texture).collect::<Result<_>>()?;
        Ok((!textures.is_empty()).then_some(Self { textures }))
    }
}

/// Whether what [`Solids::new`] uploads of the two is the same.
pub fn have_same_textures(a: &[Solid], b: &[Solid]) -> bool {
    let same = |(a, b): (&Solid, &Solid)| match (&a.texture, &b.texture) {
        (Some(a), Some(b)) => Arc::ptr_eq(a, b),
        (None, None) => true,
        _ => false,
    };
    a.len() == b.len() && a.iter().zip(b).all(same)
}

/// A picture of them, and what draws it.
pub struct SolidView {
    target: Target,
    pipeline: Pipeline,
}

impl SolidView {
    /// For pictures of this size; `on`: what is compiled in, with these specialisation constants.
    ///
    /// # Errors
    /// As [`Solids::new`].
    pub fn new(gpu: &Arc<Gpu>, view: &View, on: &[&str], constants: &[u32]) -> Result<Self> {
        let target = Target::sampled(gpu, "the solids", [view.width, view.height], 2, true)?;
        let textures = [10, 11, 12, 13, 14, 17];
        let info = PipelineInfo {
            vertex: shaders::SOLID_VERT.with(on),
            fragment: shaders::SOLID_FRAG.with(on),
            constants,
            storage_buffers: &[7],
            uniform_buffers: match (on.contains(&"LIT"), on.contains(&"SHADOWS")) {
                (false, _) => &[],
                (true, false) => &[5],
                (true, true) => &[5, 6],
            },
            texel_buffers: &[],
            textures: if on.contains(&"SHADOWS") { &textures } else { &textures[5..] },
            push_constant_bytes: size_of::<ViewConstants>() as u32,
            keeps: Keeps::Nearest,
        };
        let pipeline = Pipeline::new(gpu, &target, &info)?;
        Ok(Self { target, pipeline })
    }

    /// Draws the solids. `lights` and `shadows` are what a lit scene's shaders read; `bias` is how far, in world units, points are
    /// moved off the surface before their shadow is looked up.
    ///
    /// # Errors
    /// As [`Solids::new`], and [`Error::Interrupted`](crate::Error::Interrupted).
    #[expect(clippy::too_many_arguments, reason = "one pass has many inputs")]
    pub fn draw(
        &self,
        gpu: &Arc<Gpu>,
        scene: &Scene,
        solids: &Solids,
        view: &View,
        unit: f64,
        constants: &ViewConstants,
        lights: &[(u32, &Buffer)],
        shadows: &[(u32, Sampled<'_>)],
        bias: f64,
        interrupt: &Interrupt,
    ) -> Result<()> {
        let eye = Eye::new(view, unit, bias);
        let triangles: Vec<Triangle> = scene
            .solids
            .iter()
            .flat_map(|solid| (0..solid.mesh.triangles.len()).map(move |triangle| (solid, triangle)))
            .collect::<Vec<_>>()
            .into_par_iter()
            .map(|(solid, triangle)| eye.triangle(solid, triangle))
            .collect();
        let buffer = Buffer::storage(gpu, "the solids", &triangles)?;
        let buffers: Vec<(u32, &Buffer)> = lights.iter().copied().chain([(7, &buffer)]).collect();
        let mut first = 0;
        for (index, (solid, texture)) in scene.solids.iter().zip(&solids.textures).enumerate() {
            let end = first + 3 * solid.mesh.triangles.len() as u32;
            let textures: Vec<_> = shadows.iter().copied().chain([(17, Sampled::Texture(texture))]).collect();
            draw(&Draw {
                target: &self.target,
                clears: index == 0,
                buffers: &buffers,
                textures: &textures,
                push_constants: bytemuck::bytes_of(constants),
                batches: &[Batch { pipeline: &self.pipeline, vertices: first..end }],
                between: &|_| interrupt.check(),
            })?;
            first = end;
        }
        Ok(())
    }

    /// By the binding that shaders name: depth, colour.
    pub fn textures(&self) -> [(u32, Sampled<'_>); 2] {
        [(15, Sampled::Picture(&self.target, 1)), (16, Sampled::Picture(&self.target, 0))]
    }
}

struct Eye {
    position: DVec3,
    /// Rows: right, up, forward.
    view_from_world: DMat3,
    unit: f64,
    bias: f64,
}

impl Eye {
    fn new(view: &View, unit: f64, bias: f64) -> Self {
        let view_from_world = view.camera.frame().view_from_world();
        Self { position: view.camera.eye, view_from_world, unit, bias }
    }

    fn triangle(&self, solid: &Solid, triangle: usize) -> Triangle {
        let corners = solid.corners(triangle).map(|corner| corner - self.position);
        let [a, b, c] = corners;
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let side = if normal.dot(a) <= 0.0 { 1.0 } else { -1.0 };
        let gradients = solid.gradients(triangle);
        // Affine in the point: its value at corner `a`, and how it grows from there.
        let row = |values: [f64; 3]| {
            let gradient: DVec3 = (0..3).map(|k| gradients[k] * values[k]).sum();
            let at_eye = values[0] - gradient.dot(a);
            (self.view_from_world * gradient * self.unit).as_vec3().extend(at_eye as f32).to_array()
        };
        let ids = solid.mesh.triangles[triangle];
        let normals = ids.map(|id| side * solid.mesh.normals[id as usize]);
        // Whole repeats make no difference, and cost digits.
        let uvs = solid.mesh.uvs[triangle];
        let whole = uvs[0].min(uvs[1]).min(uvs[2]).floor();
        let uvs = uvs.map(|uv| uv - whole);
        Triangle {
            corners: corners
                .map(|corner| (self.view_from_world * corner / self.unit).as_vec3().extend(0.0).to_array()),
            plane: (self.view_from_world * normal)
                .as_vec3()
                .extend((normal.dot(a) / self.unit) as f32)
                .to_array(),
            texture: [row(uvs.map(|uv| uv.x)), row(uvs.map(|uv| uv.y))],
            normal: [0, 1, 2].map(|axis| row(normals.map(|normal| normal[axis]))),
            facing: (side * normal).as_vec3().extend((self.bias / self.unit) as f32).to_array(),
            colour: solid
                .colour
                .as_vec3()
                .extend((solid.texels_per_unit(triangle) * self.unit) as f32)
                .to_array(),
        }
    }
}
