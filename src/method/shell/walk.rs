//! What rays need that walk by adjacency (`glsl/walk.frag.glsl`): where they enter the shell, and what lies beyond each face.

use std::sync::Arc;

use super::seen::Cell;
use crate::Result;
use crate::gpu::{Buffer, Gpu};
use crate::order::Crossings;
use crate::order::relations::FaceTable;
use crate::shell::{Shell, Topology};

/// In one tetrahedron, at most: a ray that passes a dozen such has nearly as many as `MOST_PASSES` of `glsl/include/walk.glsl`, and
/// would be left to the host. Where there may be more, tetrahedra are sorted.
pub const MOST_SAMPLES: f64 = 500.0;

/// Whether buffers of so many texels hold a shell for the rays of so many pixels to walk through.
pub fn holds(most_texels: usize, shell: &Shell, pixels: usize) -> bool {
    let cells = size_of::<Cell>() / size_of::<[f32; 4]>() * shell.topology.tetrahedra.len();
    cells.max(pixels) <= most_texels
}

/// Whether they hold where these cross its boundary, too.
pub fn holds_crossings(most_texels: usize, shell: &Shell, crossings: &Crossings) -> bool {
    holds(most_texels, shell, crossings.of_pixels.len()) && crossings.places.len() <= most_texels
}

/// A shell's faces.
pub struct Ways {
    topology: Arc<Topology>,
    faces: FaceTable,
    /// What lies beyond each face, and whether every tetrahedron had a positive volume then.
    beyond: Option<(Buffer, bool)>,
}

impl Ways {
    /// Lists the faces of `topology`.
    pub fn new(topology: &Arc<Topology>) -> Self {
        Self { topology: topology.clone(), faces: FaceTable::new(topology), beyond: None }
    }

    /// Whether they are those of this shell.
    pub fn are_of(&self, shell: &Shell) -> bool {
        Arc::ptr_eq(&self.topology, &shell.topology)
    }

    /// Lists of faces, for the A-buffer.
    pub fn faces(&self) -> &FaceTable {
        &self.faces
    }

    /// Uploads what lies beyond the faces of a shell of this topology, unless that is the same as before.
    ///
    /// # Errors
    /// As [`Buffer::numbers`].
    pub fn place(&mut self, gpu: &Arc<Gpu>, shell: &Shell) -> Result<()> {
        let is_sound = shell.health.inverted == 0 && shell.health.zero_volume == 0;
        match &mut self.beyond {
            Some((_, true)) if is_sound => {}
            Some((buffer, was_sound)) => {
                buffer.refill(&self.faces.beyond(&shell.determinants))?;
                *was_sound = is_sound;
            }
            None => {
                let beyond = self.faces.beyond(&shell.determinants);
                self.beyond = Some((Buffer::numbers(gpu, "what lies beyond each face", &beyond)?, is_sound));
            }
        }
        Ok(())
    }

    /// What was uploaded.
    pub fn beyond(&self) -> &Buffer {
        &self.beyond.as_ref().expect("the shell has been placed").0
    }
}

/// Where rays enter the shell and leave it, on the device.
pub struct RayBuffers {
    of_pixels: Buffer,
    places: Buffer,
}

impl RayBuffers {
    /// Uploads them.
    ///
    /// # Errors
    /// As [`Buffer::numbers`].
    pub fn new(gpu: &Arc<Gpu>, crossings: &Crossings) -> Result<Self> {
        Ok(Self {
            of_pixels: Buffer::pairs(gpu, "the pixels' crossings", &crossings.of_pixels)?,
            places: Buffer::numbers(gpu, "where rays cross the boundary", &crossings.places)?,
        })
    }

    /// The same into the buffers that there are.
    ///
    /// # Errors
    /// As [`Buffer::numbers`].
    pub fn refill(&mut self, crossings: &Crossings) -> Result<()> {
        self.of_pixels.refill(&crossings.of_pixels)?;
        self.places.refill(&crossings.places)
    }

    /// By the binding that shaders name.
    pub fn buffers(&self) -> [(u32, &Buffer); 2] {
        [(20, &self.of_pixels), (21, &self.places)]
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::mesh::generate::{Generator, Torus};
    use crate::scene::{Camera, View};
    use crate::shell::ShellOptions;

    #[test]
    fn tetrahedra_pixels_and_crossings_must_all_fit() {
        let mesh = Generator::Torus(Torus { segments: 9, rings: 7, ..Torus::default() }).build().unwrap();
        let shell = Shell::build(&mesh, &ShellOptions::new(0.2)).unwrap();
        let cells = 9 * shell.topology.tetrahedra.len();
        assert!(holds(cells, &shell, 1) && !holds(cells - 1, &shell, 1));
        assert!(holds(cells + 1, &shell, cells + 1) && !holds(cells, &shell, cells + 1));
        let eye = DVec3::new(0.0, 2.0, 3.0);
        let camera = Camera { eye, target: DVec3::ZERO, up: DVec3::Y, fov_y: 0.8, near: 0.1 };
        let view = View { camera, width: 90, height: 80, depth: false };
        let mut crossings = Crossings::new(&FaceTable::new(&shell.topology), &shell, &view, None);
        let most = cells.max(90 * 80).max(crossings.places.len());
        assert!(holds_crossings(most, &shell, &crossings));
        crossings.places.resize(most + 1, 0);
        assert!(!holds_crossings(most, &shell, &crossings));
    }
}
