//! What a lit scene has on the device beside an unlit one's: directions, the shell's frames, the lights as seen from the eye.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::DVec4;
use rayon::prelude::*;

use super::seen::Seen;
use super::shadows::{LightPicture, Shadows};
use crate::Result;
use crate::gpu::{Buffer, Gpu, Texture3d};
use crate::scene::shading::MOST_LIGHTS;
use crate::scene::{Light, Shading, Source, View};
use crate::shell::{self, Shell};

/// What `glsl/include/frame.glsl` needs of a tetrahedron: see there.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "documented at the one declaration in glsl")]
pub struct Frame {
    pub entries: [[f32; 4]; 9],
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

/// Specialisation constants 7 to 12 of lit shaders, in `glsl/include/lights.glsl`: how many lights, which of them cast shadows, from
/// how many pictures, and which shine from a point.
pub fn constants<'a>(lights: impl Iterator<Item = &'a Light>, shadows: Option<&Shadows>) -> [u32; 6] {
    let mut count = 0;
    let (mut casting, mut points) = (0u64, 0u64);
    for light in lights {
        casting |= u64::from(light.shadow) << count;
        points |= u64::from(matches!(light.source, Source::Point { .. })) << count;
        count += 1;
    }
    let pictures = shadows.map_or(1, Shadows::pictures_a_light) as u32;
    [count, casting as u32, (casting >> 32) as u32, pictures, points as u32, (points >> 32) as u32]
}

/// What does not depend on the view.
pub struct Lit {
    /// Normals or tangents.
    pub directions: Texture3d,
    /// The shell's, at vertices.
    frames: shell::Frames,
}

/// What depends on it.
pub struct LitView {
    /// [`Frame`]s, one a tetrahedron.
    pub frames: Buffer,
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
    /// Uploads directions.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`](crate::Error::OutOfMemory); [`Error::Device`](crate::Error::Device) where the device's
    /// buffers are too small.
    pub fn new(gpu: &Arc<Gpu>, shell: &Shell, shading: &Shading) -> Result<Self> {
        let directions = Texture3d::upload_directions(gpu, "the directions", &shading.directions)?;
        Ok(Self { directions, frames: shell.frames(shading.model.frame_kind()) })
    }

    /// The same directions in another shell.
    pub fn place(&mut self, shell: &Shell, shading: &Shading) {
        self.frames = shell.frames(shading.model.frame_kind());
    }

    /// The frame of each tetrahedron, as a function of the point in view space. Barycentric coordinates are affine in it, and vertices'
    /// maps are blended by them.
    fn frames(&self, sight: Sight<'_>) -> Vec<Frame> {
        let Sight { shell, seen, view, .. } = sight;
        let view_from_world = view.camera.frame().view_from_world() * seen.unit;
        let frame = |(t, (cell, of_vertices)): (usize, (&shell::Cell, &[u32; 4]))| {
            if !shell.has_maps(t) {
                return Frame::zeroed();
            }
            let vertices = shell.vertices_of(t);
            let mut entries = [DVec4::ZERO; 9];
            for k in 0..4 {
                let at_eye = 1.0 + cell.gradients[k].dot(view.camera.eye - vertices[k]);
                let barycentric = (view_from_world * cell.gradients[k]).extend(at_eye);
                let map = self.frames.maps[of_vertices[k] as usize].to_cols_array();
                for (entry, at_vertex) in entries.iter_mut().zip(map) {
                    *entry += barycentric * at_vertex;
                }
            }
            Frame { entries: entries.map(|entry| entry.as_vec4().to_array()) }
        };
        shell.cells().par_iter().zip(&self.frames.of_vertices).enumerate().map(frame).collect()
    }
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
            frames: Buffer::floats(gpu, "the tetrahedra's frames", &lit.frames(sight))?,
            lighting: Buffer::uniform(gpu, "the lights", &sight.lighting())?,
            pictures: pictures.transpose()?,
        })
    }

    /// The same into the buffers that there are; the frames where they are others than before.
    ///
    /// # Errors
    /// As [`Lit::new`].
    pub fn refill(&mut self, lit: &Lit, sight: Sight<'_>, frames: bool) -> Result<()> {
        if frames {
            self.frames.refill(&lit.frames(sight))?;
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
            let place = match light.source {
                Source::Directional { towards } => towards.as_vec3().extend(0.0),
                Source::Point { position, falloff } => {
                    let place = (position - view.camera.eye) / *unit;
                    let per_falloff = falloff.map_or(0.0, |falloff| unit / falloff);
                    place.as_vec3().extend(per_falloff as f32)
                }
            };
            LightSource { place: place.into(), colour: colour.extend(0.0).into() }
        };
        let mut sources: Vec<LightSource> = shading.lights.iter().map(source).collect();
        sources.resize(MOST_LIGHTS, LightSource::zeroed());
        [bytemuck::bytes_of(&lighting), bytemuck::cast_slice(&sources)].concat()
    }
}
