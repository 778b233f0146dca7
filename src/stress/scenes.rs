//! Scenes without a file, for tests and stress cases: constant media, columns of paint, tetrahedra placed one by one.

use std::collections::HashMap;
use std::f64::consts::TAU;
use std::sync::Arc;

use glam::DVec3;

use crate::Result;
use crate::mesh::Mesh;
use crate::scene::{Camera, END_BELOW, March, Medium, Scene, Skips, Traversal, View};
use crate::shell::{EXTERIOR, Shell, ShellOptions, Topology};
use crate::volume::{Pyramid, Quantity, Volume};

/// A straight linear colour and an alpha.
pub type Paint = ([f32; 3], f32);

/// Three paints that no pixel confuses.
pub const PAINTS: [Paint; 3] = [([0.9, 0.1, 0.1], 0.9), ([0.1, 0.9, 0.1], 0.6), ([0.1, 0.1, 0.9], 0.8)];

/// A scene in a one-texel medium: `alpha` over a path of one `thickness` (world units), grey of the brightness `colour`.
///
/// # Errors
/// As [`Shell::build`].
pub fn constant_scene(mesh: &Mesh, thickness: f64, alpha: f32, colour: f32, view: View) -> Result<Scene> {
    let shell = Shell::build(mesh, &ShellOptions::new(thickness))?;
    Ok(painted(shell, &[([colour; 3], alpha)], thickness, view))
}

/// A shell in a texture of columns along u, one a paint, of which alpha is the opacity over `opacity_distance`.
pub fn painted(shell: Shell, paints: &[Paint], opacity_distance: f64, view: View) -> Scene {
    let medium = Medium { opacity_distance, lod_footprint: 0.0 };
    Scene {
        shell: Arc::new(shell),
        volume: Arc::new(columns(paints)),
        medium,
        shading: None,
        solids: Arc::default(),
        view,
        march: March::default(),
        traversal: Traversal::default(),
        end_below: END_BELOW,
        skips: Skips::default(),
    }
}

/// A texture of columns along u, each of one paint.
pub fn columns(paints: &[Paint]) -> Pyramid {
    let texels = paints.iter().map(|([r, g, b], a)| [r * a, g * a, b * a, *a]).collect();
    Pyramid::build(Volume { size: [paints.len() as u32, 1, 1], texels, quantity: Quantity::Opacity })
}

/// The texture coordinates of `count` tetrahedra that take the columns of [`PAINTS`] in turns.
pub fn in_turns(count: usize) -> Vec<DVec3> {
    (0..count).map(|i| DVec3::new((i as f64 % 3.0 + 0.5) / 3.0, 0.5, 0.5)).collect()
}

/// A square view of `pixels` a side.
pub fn view(eye: DVec3, target: DVec3, fov_degrees: f64, near: f64, pixels: u32) -> View {
    let up = if (target - eye).normalize().y.abs() > 0.99 { DVec3::X } else { DVec3::Y };
    View {
        camera: Camera { eye, target, up, fov_y: fov_degrees.to_radians(), near },
        width: pixels,
        height: pixels,
        depth: false,
    }
}

/// A shell of tetrahedra that share no vertex, each at one point of the texture.
pub fn loose(corners: &[[DVec3; 4]], texture: &[DVec3]) -> Shell {
    let tetrahedra = (0..corners.len() as u32).map(|t| [0, 1, 2, 3].map(|k| 4 * t + k)).collect();
    connected(corners.as_flattened().to_vec(), tetrahedra, texture)
}

/// A shell of tetrahedra given by vertex ids, ascending but for the last two, each at one point of the texture;
/// neighbours are those that share three ids.
pub fn connected(vertices: Vec<DVec3>, tetrahedra: Vec<[u32; 4]>, texture: &[DVec3]) -> Shell {
    let topology = Topology { neighbours: neighbours(&tetrahedra), tetrahedra, ..Topology::default() };
    Shell::assemble(topology, vertices, texture.iter().map(|point| [*point; 4]).collect())
}

fn neighbours(tetrahedra: &[[u32; 4]]) -> Vec<[u32; 4]> {
    let mut neighbours = vec![[EXTERIOR; 4]; tetrahedra.len()];
    let mut open: HashMap<[u32; 3], (usize, usize)> = HashMap::new();
    for (t, ids) in tetrahedra.iter().enumerate() {
        for k in 0..4 {
            let mut face = [1, 2, 3].map(|i| ids[(k + i) % 4]);
            face.sort_unstable();
            match open.remove(&face) {
                Some((other, opposite)) => {
                    neighbours[t][k] = other as u32;
                    neighbours[other][opposite] = t as u32;
                }
                None => {
                    open.insert(face, (t, k));
                }
            }
        }
    }
    neighbours
}

/// A bar whose high end lies over the low end of the next, a third of a turn further.
pub fn interlocking_bar(turn: f64, height: f64) -> [DVec3; 4] {
    let (sin, cos) = turn.sin_cos();
    let along = DVec3::new(-sin, cos, 0.0);
    let across = 0.05 * DVec3::new(cos, sin, 0.0);
    let middle = DVec3::new(0.3 * cos, 0.3 * sin, height);
    let (low, high) = (middle - along - 0.4 * DVec3::Z, middle + along + 0.4 * DVec3::Z);
    [low - across, low + across, high - 0.05 * DVec3::Z, high + 0.05 * DVec3::Z]
}

/// A ring of bars, each over the next, between two more; in turns of three paints.
pub fn ring(count: usize) -> Shell {
    let mut bars = vec![interlocking_bar(0.0, 2.0)];
    bars.extend((0..count).map(|i| interlocking_bar(i as f64 * TAU / count as f64, 0.0)));
    bars.push(interlocking_bar(0.1, -2.0));
    loose(&bars, &in_turns(bars.len()))
}
