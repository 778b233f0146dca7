//! What a lit scene has on the device beside an unlit one's: directions, the shell's frames, the lights as seen from the eye.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use rayon::prelude::*;

use super::seen::Seen;
use super::shadows::{LightPicture, Shadows};
use crate::Result;
use crate::gpu::{Buffer, Gpu, Texture3d};
use crate::scene::shading::MOST_LIGHTS;
use crate::scene::{Light, Shading, Source, View};
use crate::shell::{self, Shell};

/// A frame of `glsl/include/frame.glsl`: see there.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "documented at the one declaration in glsl")]
pub struct Frame {
    pub columns: [[f32; 4]; 3],
}

/// What `glsl/include/frame.glsl` needs of a tetrahedron: see there.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "documented at the one declaration in glsl")]
pub struct LitCell {
    pub frames: [u32; 4],
    pub per_height: [f32; 4],
}

/// `Lighting` of `glsl/include/lights.glsl`, before its [`MOST_LIGHTS`] sources: see there for each member.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "documented at the one declaration in glsl")]
pub struct Lighting {
    pub world_from_view: [[f32; 4]; 3],
    pub ambient: [f32; 3],
    pub diffuse: f32,
    pub specular: f32,
    pub shininess: f32,
    pub glow: f32,
    pub glow_from: f32,
}

/// `LightSource` of `glsl/include/lights.glsl`: see there for each member.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "documented at the one declaration in glsl")]
pub struct LightSource {
    pub place: [f32; 4],
    pub colour: [f32; 4],
}

/// Specialisation constants 7 to 10 of lit shaders, in `glsl/include/lights.glsl`: how many lights, which of them cast shadows, and from
/// how many pictures.
pub fn constants<'a>(lights: impl Iterator<Item = &'a Light>, shadows: Option<&Shadows>) -> [u32; 4] {
    let mut count = 0;
    let mut casting = 0u64;
    for light in lights {
        casting |= u64::from(light.shadow) << count;
        count += 1;
    }
    let pictures = shadows.map_or(1, Shadows::pictures_a_light);
    [count, casting as u32, (casting >> 32) as u32, pictures as u32]
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
    /// [`LitCell`]s, one a tetrahedron.
    pub cells: Buffer,
    /// [`Lighting`] and its [`LightSource`]s.
    pub lighting: Buffer,
    /// [`LightPicture`]s, where a light casts shadows.
    ///
    /// [`LightPicture`]: super::shadows::LightPicture
    pub pictures: Option<Buffer>,
}

/// What a lit scene is seen with, in one view.
#[derive(Clone, Copy)]
pub struct Sight<'a> {
    /// See [`Shading`].
    pub shading: &'a Shading,
    /// What lights see, where one casts shadows.
    pub shadows: Option<&'a Shadows>,
    /// The scene's.
    pub shell: &'a Shell,
    /// The shell, as it is seen.
    pub seen: &'a Seen,
    /// From where.
    pub view: &'a View,
}

impl Lit {
    /// Uploads directions and frames.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`](crate::Error::OutOfMemory); [`Error::Device`](crate::Error::Device) where the device's
    /// buffers are too small.
    pub fn new(gpu: &Arc<Gpu>, shell: &Shell, shading: &Shading) -> Result<Self> {
        let directions = Texture3d::upload_directions(gpu, "the directions", &shading.directions)?;
        let (frames, of_vertices) = frames(shell, shading);
        Ok(Self { directions, frames: Buffer::floats(gpu, "the shell's frames", &frames)?, of_vertices })
    }

    /// The same directions in another shell.
    ///
    /// # Errors
    /// As [`Lit::new`].
    pub fn place(&mut self, shell: &Shell, shading: &Shading) -> Result<()> {
        let (frames, of_vertices) = frames(shell, shading);
        self.frames.refill(&frames)?;
        self.of_vertices = of_vertices;
        Ok(())
    }

    fn cells(&self, shell: &Shell, seen: &Seen) -> Vec<LitCell> {
        let cell = |(cell, &frames): (&shell::Cell, &[u32; 4])| {
            let per_height = cell.gradients.map(|gradient| (gradient.length() * seen.unit) as f32);
            LitCell { frames, per_height }
        };
        shell.cells().par_iter().zip(&self.of_vertices).map(cell).collect()
    }
}

/// The frames of a shell, and which of them each tetrahedron's vertices have.
fn frames(shell: &Shell, shading: &Shading) -> (Vec<Frame>, Vec<[u32; 4]>) {
    let shell::Frames { maps, of_vertices } = shell.frames(shading.model.frame_kind());
    let column = |column: DVec3| column.as_vec3().extend(0.0).to_array();
    let frame = |map: &glam::DMat3| Frame { columns: [map.x_axis, map.y_axis, map.z_axis].map(column) };
    (maps.iter().map(frame).collect(), of_vertices)
}

impl LitView {
    /// Uploads what is seen.
    ///
    /// # Errors
    /// As [`Lit::new`].
    pub fn new(gpu: &Arc<Gpu>, lit: &Lit, sight: Sight<'_>) -> Result<Self> {
        let pictures = sight.pictures();
        let pictures = pictures.map(|pictures| Buffer::uniform(gpu, "the lights' pictures", &pictures));
        Ok(Self {
            cells: Buffer::floats(gpu, "the tetrahedra's frames", &lit.cells(sight.shell, sight.seen))?,
            lighting: Buffer::uniform(gpu, "the lights", &sight.lighting())?,
            pictures: pictures.transpose()?,
        })
    }

    /// The same into the buffers that there are; the cells where they are others than before.
    ///
    /// # Errors
    /// As [`Lit::new`].
    pub fn refill(&mut self, lit: &Lit, sight: Sight<'_>, cells: bool) -> Result<()> {
        if cells {
            self.cells.refill(&lit.cells(sight.shell, sight.seen))?;
        }
        if let (Some(buffer), Some(pictures)) = (&mut self.pictures, sight.pictures()) {
            buffer.refill(&pictures)?;
        }
        self.lighting.refill(&sight.lighting())
    }

    /// By the binding that shaders name: what all lit shaders read.
    pub fn lights(&self) -> Vec<(u32, &Buffer)> {
        [(5, &self.lighting)].into_iter().chain(self.pictures.iter().map(|pictures| (6, pictures))).collect()
    }
}

impl Sight<'_> {
    fn pictures(&self) -> Option<Vec<LightPicture>> {
        self.shadows.map(|shadows| shadows.seen_from(self.view.camera.eye, self.seen.unit))
    }

    /// [`Lighting`] and its sources, as bytes.
    fn lighting(&self) -> Vec<u8> {
        let Self { shading, view, seen: Seen { unit, .. }, .. } = self;
        let frame = view.camera.frame();
        let lighting = Lighting {
            world_from_view: [frame.right, frame.up, frame.forward]
                .map(|axis| axis.as_vec3().extend(0.0).to_array()),
            ambient: shading.ambient.as_vec3().to_array(),
            diffuse: shading.diffuse as f32,
            specular: shading.specular as f32,
            shininess: shading.shininess as f32,
            glow: shading.emission.glow as f32,
            glow_from: shading.emission.from as f32,
        };
        let source = |light: &Light| {
            let colour = light.colour.as_vec3();
            let (place, kind) = match light.source {
                Source::Directional { towards } => (towards.as_vec3().extend(0.0), 0.0),
                Source::Point { position, falloff } => {
                    let place = (position - view.camera.eye) / *unit;
                    let per_falloff = falloff.map_or(0.0, |falloff| unit / falloff);
                    (place.as_vec3().extend(per_falloff as f32), 1.0)
                }
            };
            LightSource { place: place.into(), colour: colour.extend(kind).into() }
        };
        let mut sources: Vec<LightSource> = shading.lights.iter().map(source).collect();
        sources.resize(MOST_LIGHTS, LightSource::zeroed());
        [bytemuck::bytes_of(&lighting), bytemuck::cast_slice(&sources)].concat()
    }
}
