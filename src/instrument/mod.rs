//! The instrument for those who test deformation: what a shell suffers in each frame of an animation.
//!
//! [`walk()`] goes through the frames of a [`Sequence`](crate::scene::Sequence), renders them, and puts together what the
//! measures tell: single tetrahedra ([`faults`]), the texture map ([`stretch`]), pairs of tetrahedra ([`overlap`]), the
//! thickness at which the shell folds ([`fold`]), and pictures ([`pops`]). [`page`] shows it, [`heatmap`] paints it.

pub mod faults;
pub mod fold;
pub mod heatmap;
mod motion;
pub mod overlap;
pub mod page;
mod plot;
pub mod pops;
pub mod results;
pub mod stretch;
pub mod walk;

pub use page::{check_writable, write};
pub use results::{FrameResults, Results};
pub use walk::{Options, Outcome, walk};

/// At most so many tetrahedra, pairs and pixels of a frame are told by name; all are counted.
pub const LISTED: usize = 16;

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::DVec3;

    use crate::mesh::Mesh;
    use crate::mesh::generate::{Generator, Torus};
    use crate::shell::{Shell, ShellOptions};

    /// Radii 1 and 0.25; vertices stand exactly on the inner equator.
    pub fn torus(thickness: f64) -> Shell {
        torus_with(thickness, |normal| normal)
    }

    pub fn torus_with(thickness: f64, normal: impl Fn(DVec3) -> DVec3) -> Shell {
        let torus = Torus { major_radius: 1.0, minor_radius: 0.25, segments: 16, rings: 8 };
        let mut mesh: Mesh = Generator::Torus(torus).build().expect("sound parameters");
        mesh.normals.iter_mut().for_each(|n| *n = normal(*n));
        Shell::build(&mesh, &ShellOptions::new(thickness)).expect("a sound mesh")
    }

    /// With every vertex moved; the maps are those of the shell as it was.
    pub fn moved(shell: &Shell, to: impl Fn(DVec3) -> DVec3) -> Shell {
        let mut moved = shell.clone();
        moved.vertices = Arc::new(shell.vertices.iter().map(|&vertex| to(vertex)).collect());
        moved
    }
}
