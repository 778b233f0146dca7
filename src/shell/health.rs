//! What is wrong with a shell, in numbers.
//!
//! *Quality* of a tetrahedron is `6 sqrt(2) |V| / l_rms^3`, with the volume `V` and the root mean square of its
//! six edge lengths `l_rms`: 1 when regular, 0 when flat (Parthasarathy, Graichen, Hathaway, "A comparison of
//! tetrahedron quality measures", Finite Elements in Analysis and Design 15, 1994).
//!
//! *Overlap risk*: a surface offset by `t` along its normals stretches by `1 + t kappa` along a line of
//! curvature `kappa` (positive where convex) and folds where that turns negative. The curvature is taken
//! along the edges at a vertex, `kappa = (n_j - n_i) . (x_j - x_i) / |x_j - x_i|^2`, with `n` the directions of
//! extrusion. That is the discrete mesh's own criterion: the outer edge has begun to run backwards. It is
//! an approximation of the principal curvature: a fold between the directions of the edges, or a collision
//! with a part of the surface that is no neighbour, is not seen.

use std::f64::consts::SQRT_2;
use std::ops::Add;

use glam::DVec3;
use rayon::prelude::*;

use super::{Cell, Health, SLIVER_QUALITY, ShellOptions, Topology, extrude};
use crate::mesh::Mesh;

/// How many tetrahedra have which fault.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Faults {
    inverted: u64,
    zero_volume: u64,
    slivers: u64,
}

impl Faults {
    /// Those of one tetrahedron, given six times its volume.
    pub(super) fn of(vertices: [DVec3; 4], determinant: f64, cell: &Cell) -> Self {
        if *cell == Cell::default() {
            return Self { zero_volume: 1, ..Self::default() };
        }
        Self {
            inverted: u64::from(determinant < 0.0),
            zero_volume: 0,
            slivers: u64::from(quality(vertices, determinant) < SLIVER_QUALITY),
        }
    }
}

impl Add for Faults {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            inverted: self.inverted + other.inverted,
            zero_volume: self.zero_volume + other.zero_volume,
            slivers: self.slivers + other.slivers,
        }
    }
}

/// The whole account of a shell.
pub(super) fn health(topology: &Topology, faults: Faults, overlap_risk_vertices: u64) -> Health {
    Health {
        tetrahedra: topology.tetrahedra.len() as u64,
        inverted: faults.inverted,
        zero_volume: faults.zero_volume,
        slivers: faults.slivers,
        non_manifold_edges: topology.non_manifold_edges,
        boundary_edges: topology.boundary_edges,
        overlap_risk_vertices,
    }
}

/// Vertices with an edge along which the extrusion folds over.
pub(super) fn overlap_risk_vertices(mesh: &Mesh, options: &ShellOptions, directions: &[DVec3]) -> u64 {
    let mut at_risk = vec![false; mesh.positions.len()];
    for &[a, b, c] in &mesh.triangles {
        for (i, j) in [(a, b), (b, c), (c, a)] {
            let (i, j) = (i as usize, j as usize);
            let edge = mesh.positions[j] - mesh.positions[i];
            let closing = -(directions[j] - directions[i]).dot(edge);
            for end in [i, j] {
                at_risk[end] |= extrude::thickness_at(options, end) * closing > edge.length_squared();
            }
        }
    }
    at_risk.par_iter().filter(|&&risky| risky).count() as u64
}

/// Shape quality, 0 (flat) to 1 (regular), given six times the signed volume.
fn quality([a, b, c, d]: [DVec3; 4], determinant: f64) -> f64 {
    let edges = [b - a, c - a, d - a, c - b, d - b, d - c];
    let mean_square = edges.iter().map(|edge| edge.length_squared()).sum::<f64>() / 6.0;
    SQRT_2 * determinant.abs() / (mean_square * mean_square.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shell::cell;

    const REGULAR: [DVec3; 4] = [
        DVec3::new(1.0, 1.0, 1.0),
        DVec3::new(1.0, -1.0, -1.0),
        DVec3::new(-1.0, 1.0, -1.0),
        DVec3::new(-1.0, -1.0, 1.0),
    ];

    #[test]
    fn quality_is_one_when_regular_at_any_scale_and_less_otherwise() {
        for scale in [1e-6, 1.0, 1e6] {
            let vertices = REGULAR.map(|v| scale * v);
            // Ten or so roundings.
            assert!((quality(vertices, cell::determinant(vertices)) - 1.0).abs() < 1e-14);
        }
        let mut bent = REGULAR;
        bent[0].x += 0.1;
        assert!(quality(bent, cell::determinant(bent)) < 1.0 - 1e-4);
    }

    /// The corner of a cube lowered to height `h`: `det = h`, squared edges 1, 1, 2, h2, 1 + h2, 1 + h2.
    #[test]
    fn quality_of_a_lowered_corner() {
        let h = 0.01f64;
        let vertices = [DVec3::ZERO, DVec3::X, DVec3::Y, h * DVec3::Z];
        let expected = SQRT_2 * h / (1.0 + 0.5 * h * h).powf(1.5);
        assert!((quality(vertices, h) / expected - 1.0).abs() < 1e-14);
    }

    #[test]
    fn faults_are_told_apart() {
        let faults = |vertices: [DVec3; 4]| {
            let determinant = cell::determinant(vertices);
            let found = cell::maps(vertices, REGULAR, determinant);
            let Faults { inverted, zero_volume, slivers } = Faults::of(vertices, determinant, &found);
            [inverted, zero_volume, slivers]
        };
        let lowered = |h: f64| [DVec3::ZERO, DVec3::X, DVec3::Y, h * DVec3::Z];
        assert_eq!(faults(lowered(1.0)), [0, 0, 0]);
        assert_eq!(faults(lowered(-1.0)), [1, 0, 0]);
        assert_eq!(faults(lowered(0.0)), [0, 1, 0]);
        assert_eq!(faults(lowered(1e-4)), [0, 0, 1]);
        assert_eq!(faults(lowered(-1e-4)), [1, 0, 1]);
    }
}
