//! A shell as seen from one eye: what the shaders need of each tetrahedron, front to back. Positions are taken relative to the
//! eye in f64 before anything is f32, so that a scene far from the origin loses nothing.

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

/// All that can be seen, and what cannot.
#[derive(Debug, Clone)]
pub struct Seen {
    /// Front to back.
    pub cells: Vec<Cell>,
    /// Tetrahedra before the near plane.
    pub before_near: u64,
    /// Tetrahedra beside the picture.
    pub beside: u64,
    /// Whether any level of detail but 0 is needed.
    pub minified: bool,
}

impl Seen {
    /// Maps the tetrahedra of `scene` in the order `sorted` to `view`, on a rasteriser that snaps to `subpixels`
    /// a pixel.
    pub fn new(scene: &Scene, sorted: &Sorted, view: &View, subpixels: u32) -> Self {
        let eye = Eye::new(scene, view, subpixels);
        let drawn: Vec<u32> =
            sorted.order.sequence.iter().copied().filter(|&t| sorted.exit_faces[t as usize] != 0).collect();
        let found: Vec<Result<(Cell, bool), Unseen>> =
            drawn.par_iter().map(|&t| eye.cell(t as usize, sorted.exit_faces[t as usize])).collect();
        let mut seen =
            Self { cells: Vec::with_capacity(found.len()), before_near: 0, beside: 0, minified: false };
        for cell in found {
            match cell {
                Ok((cell, minified)) => {
                    seen.minified |= minified;
                    seen.cells.push(cell);
                }
                Err(Unseen::BeforeNear) => seen.before_near += 1,
                Err(Unseen::Beside) => seen.beside += 1,
            }
        }
        seen
    }
}

/// The eye, with all that maps to its picture.
struct Eye<'a> {
    scene: &'a Scene,
    position: DVec3,
    /// Rows: right, up, forward.
    view_from_world: DMat3,
    projection: Projection,
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
        Self {
            scene,
            position: view.camera.eye,
            view_from_world: DMat3::from_cols(frame.right, frame.up, frame.forward).transpose(),
            projection,
        }
    }

    /// What the shaders need of tetrahedron `t`, and whether more than level 0 can be needed in it.
    fn cell(&self, t: usize, exit_faces: u8) -> Result<(Cell, bool), Unseen> {
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
            (self.view_from_world * normal).as_vec3().extend(normal.dot(on_face) as f32).into()
        });
        let texture_from_view = shell.cells[t].texture_from_world * self.view_from_world.transpose();
        let texture_at_eye = shell.texture[t][0] - texture_from_view * vertices[0];
        let texture = std::array::from_fn(|i| {
            texture_from_view.row(i).as_vec3().extend(texture_at_eye[i] as f32).into()
        });
        let cell = Cell { outline: [[a.x, a.y, b.x, b.y], [c.x, c.y, d.x, d.y]], planes, texture };
        let farthest = vertices.iter().map(|vertex| vertex.z).fold(f64::NEG_INFINITY, f64::max);
        // Of all directions, so at least that across the ray.
        let size = self.scene.volume.levels[0].size;
        let texels_per_unit =
            (0..3).map(|i| f64::from(size[i]) * texture_from_view.row(i).length()).fold(0.0, f64::max);
        let footprint = self.scene.medium.lod_footprint * self.projection.pixel * farthest;
        Ok((cell, footprint * texels_per_unit > 1.0))
    }
}
