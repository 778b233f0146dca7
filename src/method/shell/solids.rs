//! The solids as the eye sees them: their colour and depth in every pixel, before the shell is marched up to them.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::ViewConstants;
use super::outline::Projection;
use super::seen::Tile;
use super::squares::Squares;
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
}

/// `Face` of `glsl/surface.frag.glsl`: see there for each member.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Face {
    texture: [[f32; 4]; 2],
    normal: [[f32; 4]; 3],
    facing: [f32; 4],
    colour: [f32; 4],
}

/// The side, in pixels, of the tiles in which solids are lit: small enough that few pixels beside them are.
const TILE: u32 = 16;

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

/// Pictures of them, and what draws those.
pub struct SolidView {
    /// Which triangle is the nearest in each pixel, and its depth.
    nearest: Target,
    solid: Pipeline,
    colours: Target,
    surface: Pipeline,
}

impl SolidView {
    /// For pictures of this size; `on`: what is compiled in, with these specialisation constants.
    ///
    /// # Errors
    /// As [`Solids::new`].
    pub fn new(gpu: &Arc<Gpu>, view: &View, on: &[&str], constants: &[u32]) -> Result<Self> {
        let target = |nearest| Target::sampled(gpu, "the solids", [view.width, view.height], 1, nearest);
        let (nearest, colours) = (target(true)?, target(false)?);
        let solid = PipelineInfo {
            vertex: shaders::SOLID_VERT.with(&[]),
            fragment: shaders::SOLID_FRAG.with(&[]),
            constants: &[],
            storage_buffers: &[7],
            uniform_buffers: &[],
            texel_buffers: &[],
            textures: &[],
            minified: false,
            push_constant_bytes: size_of::<ViewConstants>() as u32,
            keeps: Keeps::Nearest,
        };
        let textures = [10, 14, 15, 17];
        let surface = PipelineInfo {
            vertex: shaders::TILE_VERT.with(&[]),
            fragment: shaders::SURFACE_FRAG.with(on),
            constants,
            storage_buffers: &[1],
            texel_buffers: &[23],
            uniform_buffers: match (on.contains(&"LIT"), on.contains(&"SHADOWS")) {
                (false, _) => &[],
                (true, false) => &[5],
                (true, true) => &[5, 6],
            },
            textures: if on.contains(&"SHADOWS") { &textures } else { &textures[2..] },
            minified: true,
            keeps: Keeps::Last,
            ..solid
        };
        let solid = Pipeline::new(gpu, &nearest, &solid)?;
        let surface = Pipeline::new(gpu, &colours, &surface)?;
        Ok(Self { nearest, solid, colours, surface })
    }

    /// Draws the solids: which is the nearest in each pixel, and then, once a pixel, its colour. `lights` and `shadows` are what a lit
    /// scene's shaders read; `bias` is how far, in world units, points are moved off the surface before their shadow is looked up.
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
        let (triangles, faces): (Vec<Triangle>, Vec<Face>) = scene
            .solids
            .iter()
            .flat_map(|solid| (0..solid.mesh.triangles.len()).map(move |triangle| (solid, triangle)))
            .collect::<Vec<_>>()
            .into_par_iter()
            .map(|(solid, triangle)| eye.triangle(solid, triangle))
            .unzip();
        let mut tiles = Vec::new();
        // Of each solid.
        let mut vertices = Vec::new();
        let mut end = 0;
        for solid in scene.solids.iter() {
            let members = end..end + solid.mesh.triangles.len();
            end = members.end;
            let first = 6 * tiles.len() as u32;
            let bounds = where_seen(&triangles[members.clone()], view);
            let members = [members.start as u32, members.end as u32];
            tiles.extend(bounds.map(|bounds| Tile { bounds, members, picture: 0, coarsely: 0 }));
            vertices.push(first..6 * tiles.len() as u32);
        }
        let triangles = Buffer::storage(gpu, "the solids", &triangles)?;
        let faces = Buffer::floats(gpu, "the solids' faces", &faces)?;
        let tiles = Buffer::storage(gpu, "where solids are", &tiles)?;
        let buffers: Vec<(u32, &Buffer)> =
            lights.iter().copied().chain([(1, &tiles), (7, &triangles), (23, &faces)]).collect();
        let find = Draw {
            target: &self.nearest,
            clears: true,
            buffers: &buffers,
            textures: &[],
            push_constants: bytemuck::bytes_of(constants),
            batches: &[Batch { pipeline: &self.solid, vertices: 0..3 * end as u32 }],
            between: &|_| interrupt.check(),
        };
        draw(&find)?;
        for (index, (texture, vertices)) in solids.textures.iter().zip(vertices).enumerate() {
            let own = [(15, Sampled::Picture(&self.nearest)), (17, Sampled::Texture(texture))];
            let textures: Vec<_> = shadows.iter().copied().chain(own).collect();
            draw(&Draw {
                target: &self.colours,
                clears: index == 0,
                textures: &textures,
                batches: &[Batch { pipeline: &self.surface, vertices }],
                ..find
            })?;
        }
        Ok(())
    }

    /// By the binding that shaders name: depth, colour.
    pub fn textures(&self) -> [(u32, Sampled<'_>); 2] {
        [(15, Sampled::Picture(&self.nearest)), (16, Sampled::Picture(&self.colours))]
    }
}

/// The bounds of the [`Squares`] in which any of these triangles may be seen. lavapipe lights also what it discards, so the fewer the
/// better.
fn where_seen(triangles: &[Triangle], view: &View) -> impl Iterator<Item = [f32; 4]> {
    let squares = Squares::of_side(view, TILE);
    let projection = Projection::new(view, 0.0);
    let mut is_seen = vec![false; squares.count()];
    for triangle in triangles {
        let project = |[x, y, z, _]: [f32; 4]| {
            (z > 0.0).then(|| projection.project(DVec3::new(x.into(), y.into(), z.into())))
        };
        let corners = triangle.corners.map(project);
        if corners.iter().all(Option::is_none) {
            continue; // behind the eye
        }
        for square in squares.around(corners) {
            is_seen[square] = true;
        }
        if corners.iter().any(Option::is_none) {
            break; // it may be seen anywhere
        }
    }
    let seen = is_seen.into_iter().enumerate().filter(|(_, is_seen)| *is_seen);
    seen.map(move |(square, _)| squares.bounds(square))
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

    fn triangle(&self, solid: &Solid, triangle: usize) -> (Triangle, Face) {
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
        let seen = Triangle {
            corners: corners
                .map(|corner| (self.view_from_world * corner / self.unit).as_vec3().extend(0.0).to_array()),
            plane: (self.view_from_world * normal)
                .as_vec3()
                .extend((normal.dot(a) / self.unit) as f32)
                .to_array(),
        };
        let face = Face {
            texture: [row(uvs.map(|uv| uv.x)), row(uvs.map(|uv| uv.y))],
            normal: [0, 1, 2].map(|axis| row(normals.map(|normal| normal[axis]))),
            facing: (side * normal).as_vec3().extend((self.bias / self.unit) as f32).to_array(),
            colour: solid
                .colour
                .as_vec3()
                .extend((solid.texels_per_unit(triangle) * self.unit) as f32)
                .to_array(),
        };
        (seen, face)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Camera;

    #[test]
    fn host_and_shader_agree_on_a_face() {
        let shader = include_str!("../../../glsl/surface.frag.glsl");
        assert!(shader.contains(&format!("int first = {} * int(triangle);", size_of::<Face>() / 16)));
    }

    #[test]
    fn solids_are_lit_where_they_may_be_seen() {
        let camera = Camera { eye: DVec3::ZERO, target: -DVec3::Z, up: DVec3::Y, fov_y: 1.0, near: 0.1 };
        let view = View { camera, width: 64, height: 48, depth: false };
        let tiles = |z: [f32; 3]| {
            let corner = |z: f32| [0.01 * z, 0.01 * z, z, 0.0];
            where_seen(&[Triangle { corners: z.map(corner), plane: [0.0; 4] }], &view).count()
        };
        assert_eq!(tiles([-1.0, -2.0, -1.0]), 0, "behind the eye");
        assert_eq!(tiles([1.0, -2.0, 1.0]), 4 * 3, "beside it");
        assert!((1..=4).contains(&tiles([1.0, 2.0, 1.0])));
    }
}
