//! What a lit scene has on the device beside an unlit one's: directions, the shell's frames, the lights as seen from the eye.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use rayon::prelude::*;

use super::seen::Seen;
use crate::Result;
use crate::gpu::{Buffer, Gpu, Texture3d};
use crate::scene::{Light, Shading, Source, View};
use crate::shell::{self, Shell};

/// `Frame` of `glsl/include/frame.glsl`: see there for each member.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "documented at the one declaration in glsl")]
pub struct Frame {
    pub columns: [[f32; 4]; 3],
}

/// `LitCell` of `glsl/include/frame.glsl`: see there for each member.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "documented at the one declaration in glsl")]
pub struct LitCell {
    pub frames: [u32; 4],
    pub per_height: [f32; 4],
}

/// `Lighting` of `glsl/include/shade.glsl`, before its sources: see there for each member.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "documented at the one declaration in glsl")]
pub struct Lighting {
    pub world_from_view: [[f32; 4]; 3],
    pub ambient: [f32; 3],
    pub diffuse: f32,
    pub specular: f32,
    pub shininess: f32,
    pub count: u32,
    pub padding: u32,
}

/// `LightSource` of `glsl/include/shade.glsl`: see there for each member.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "documented at the one declaration in glsl")]
pub struct LightSource {
    pub place: [f32; 4],
    pub colour: [f32; 4],
}

/// What does not depend on the view.
pub struct Lit {
    /// Normals or tangents.
    pub directions: Texture3d,
    /// [`Frame`]s.
    pub frames: Buffer,
    /// Of the four vertices of each tetrahedron.
    of_vertices: Vec<[u32; 4]>,
}

/// What depends on it.
pub struct LitView {
    /// [`LitCell`]s, one a drawn cell.
    pub cells: Buffer,
    /// [`Lighting`] and its [`LightSource`]s.
    pub lighting: Buffer,
}

impl Lit {
    /// Uploads directions and frames.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`](crate::Error::OutOfMemory); [`Error::Device`](crate::Error::Device) where the device's
    /// buffers are too small.
    pub fn new(gpu: &Arc<Gpu>, shell: &Shell, shading: &Shading) -> Result<Self> {
        let directions = Texture3d::upload_directions(gpu, "the directions", &shading.directions)?;
        let shell::Frames { maps, of_vertices } = shell.frames(shading.model.frame_kind());
        let column = |column: DVec3| column.as_vec3().extend(0.0).to_array();
        let frame = |map: &glam::DMat3| Frame { columns: [map.x_axis, map.y_axis, map.z_axis].map(column) };
        let frames: Vec<Frame> = maps.iter().map(frame).collect();
        Ok(Self { directions, frames: Buffer::storage(gpu, "the shell's frames", &frames)?, of_vertices })
    }

    fn cells(&self, shell: &Shell, seen: &Seen) -> Vec<LitCell> {
        let cell = |&t: &u32| {
            let t = t as usize;
            let per_height = shell.cells[t].gradients.map(|gradient| (gradient.length() * seen.unit) as f32);
            LitCell { frames: self.of_vertices[t], per_height }
        };
        seen.tetrahedra.par_iter().map(cell).collect()
    }
}

impl LitView {
    /// Uploads what `seen` was seen from `view`.
    ///
    /// # Errors
    /// As [`Lit::new`].
    pub fn new(
        gpu: &Arc<Gpu>,
        lit: &Lit,
        shading: &Shading,
        shell: &Shell,
        seen: &Seen,
        view: &View,
    ) -> Result<Self> {
        Ok(Self {
            cells: Buffer::storage(gpu, "the tetrahedra's frames", &lit.cells(shell, seen))?,
            lighting: Buffer::storage(gpu, "the lights", &lighting(shading, view, seen.unit))?,
        })
    }

    /// The same into the buffers that there are.
    ///
    /// # Errors
    /// As [`Lit::new`].
    pub fn refill(
        &mut self,
        lit: &Lit,
        shading: &Shading,
        shell: &Shell,
        seen: &Seen,
        view: &View,
    ) -> Result<()> {
        self.cells.refill(&lit.cells(shell, seen))?;
        self.lighting.refill(&lighting(shading, view, seen.unit))
    }
}

/// [`Lighting`] and its sources, as bytes. `unit`: see [`Seen::unit`].
fn lighting(shading: &Shading, view: &View, unit: f64) -> Vec<u8> {
    let frame = view.camera.frame();
    let lighting = Lighting {
        world_from_view: [frame.right, frame.up, frame.forward]
            .map(|axis| axis.as_vec3().extend(0.0).to_array()),
        ambient: shading.ambient.as_vec3().to_array(),
        diffuse: shading.diffuse as f32,
        specular: shading.specular as f32,
        shininess: shading.shininess as f32,
        count: shading.lights.len() as u32,
        padding: 0,
    };
    let source = |&Light { source, colour, .. }: &Light| {
        let colour = colour.as_vec3();
        match source {
            Source::Directional { towards } => {
                LightSource { place: towards.as_vec3().extend(0.0).into(), colour: colour.extend(0.0).into() }
            }
            Source::Point { position, falloff } => {
                let place = (position - view.camera.eye) / unit;
                let per_falloff = falloff.map_or(0.0, |falloff| unit / falloff);
                LightSource {
                    place: place.as_vec3().extend(per_falloff as f32).into(),
                    colour: colour.extend(1.0).into(),
                }
            }
        }
    };
    let sources: Vec<LightSource> = shading.lights.iter().map(source).collect();
    [bytemuck::bytes_of(&lighting), bytemuck::cast_slice(&sources)].concat()
}
