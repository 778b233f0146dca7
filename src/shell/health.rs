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

use super::{Health, SLIVER_QUALITY, Shell, ShellOptions, Topology, cell, extrude};
use crate::mesh::Mesh;

/// How many tetrahedra have which fault.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Faults {
    inverted: u64,
    zero_volume: u64,
    slivers: u64,
}

impl Faults {
    /// Those of one tetrahedron, given its entry of [`Shell::determinants`] and the sum of its squared edges.
    pub(super) fn of(determinant: f64, squared_edges: f64) -> Self {
        if determinant == 0.0 {
            return Self { zero_volume: 1, ..Self::default() };
        }
        Self {
            inverted: u64::from(determinant < 0.0),
            zero_volume: 0,
            slivers: u64::from(quality(squared_edges, determinant) < SLIVER_QUALITY),
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

impl Shell {
    /// Six times the signed volume of tetrahedron `t`, in cubic world units, with the exact sign: negative where it is inverted.
    pub fn determinant(&self, t: usize) -> f64 {
        cell::determinant(self.vertices_of(t))
    }

    /// Shape quality of tetrahedron `t`, 0 (flat) to 1 (regular): `6 sqrt(2) |V| / l_rms^3`. See [`SLIVER_QUALITY`].
    pub fn quality(&self, t: usize) -> f64 {
        quality(squared_edges(self.vertices_of(t)), self.determinant(t))
    }
}

/// The sum of the squared lengths of the six edges.
pub(super) fn squared_edges([a, b, c, d]: [DVec3; 4]) -> f64 {
    [b - a, c - a, d - a, c - b, d - b, d - c].iter().map(|edge| edge.length_squared()).sum()
}

/// Shape quality, 0 (flat) to 1 (regular), given the sum of the squared edges and six times the signed volume.
fn quality(squared_edges: f64, determinant: f64) -> f64 {
    let mean_square = squared_edges / 6.0;
    SQRT_2 * determinant.abs() / (mean_square * mean_square.sqrt())
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use glam::DVec2;

    use super::*;
    use crate::mesh::generate::{Generator, Sphere, Torus};

    const REGULAR: [DVec3; 4] = [
        DVec3::new(1.0, 1.0, 1.0),
        DVec3::new(1.0, -1.0, -1.0),
        DVec3::new(-1.0, 1.0, -1.0),
        DVec3::new(-1.0, -1.0, 1.0),
    ];

    fn sphere() -> Mesh {
        Generator::Sphere(Sphere { radius: 1.0, segments: 14, rings: 9 }).build().expect("sound parameters")
    }

    /// With vertices exactly on its inner equator, where its radius is 0.75.
    fn torus() -> Mesh {
        let torus = Torus { major_radius: 1.0, minor_radius: 0.25, segments: 16, rings: 16 };
        Generator::Torus(torus).build().expect("sound parameters")
    }

    /// `count` copies of the unit triangle, side by side and apart.
    fn row(count: u32) -> Mesh {
        let mut mesh = Mesh::default();
        for i in 0..count {
            let at = DVec3::X * 3.0 * f64::from(i);
            mesh.positions.extend([at, at + DVec3::X, at + DVec3::Y]);
            mesh.normals.extend([DVec3::Z; 3]);
            mesh.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
            mesh.uvs.push([DVec2::ZERO, DVec2::X, DVec2::Y]);
        }
        mesh
    }

    /// The same surface with its other side out.
    fn inside_out(mut mesh: Mesh) -> Mesh {
        mesh.normals.iter_mut().for_each(|normal| *normal = -*normal);
        mesh.triangles.iter_mut().for_each(|ids| ids.swap(1, 2));
        mesh.uvs.iter_mut().for_each(|uvs| uvs.swap(1, 2));
        mesh
    }

    fn of(mesh: &Mesh, options: &ShellOptions) -> Health {
        Shell::build(mesh, options).expect("a sound mesh").health
    }

    #[test]
    fn quality_is_one_when_regular_at_any_scale_and_less_otherwise() {
        for scale in [1e-6, 1.0, 1e6] {
            let vertices = REGULAR.map(|v| scale * v);
            // Ten or so roundings.
            assert!((quality(squared_edges(vertices), cell::determinant(vertices)) - 1.0).abs() < 1e-14);
        }
        let mut bent = REGULAR;
        bent[0].x += 0.1;
        assert!(quality(squared_edges(bent), cell::determinant(bent)) < 1.0 - 1e-4);
    }

    /// The corner of a cube lowered to height `h`: `det = h`, squared edges 1, 1, 2, h2, 1 + h2, 1 + h2.
    #[test]
    fn quality_of_a_lowered_corner() {
        let h = 0.01f64;
        let vertices = [DVec3::ZERO, DVec3::X, DVec3::Y, h * DVec3::Z];
        let expected = SQRT_2 * h / (1.0 + 0.5 * h * h).powf(1.5);
        assert!((quality(squared_edges(vertices), h) / expected - 1.0).abs() < 1e-14);
    }

    #[test]
    fn faults_are_told_apart() {
        let faults = |vertices: [DVec3; 4]| {
            let determinant = cell::determinant(vertices);
            let Faults { inverted, zero_volume, slivers } = Faults::of(determinant, squared_edges(vertices));
            [inverted, zero_volume, slivers]
        };
        let lowered = |h: f64| [DVec3::ZERO, DVec3::X, DVec3::Y, h * DVec3::Z];
        assert_eq!(faults(lowered(1.0)), [0, 0, 0]);
        assert_eq!(faults(lowered(-1.0)), [1, 0, 0]);
        assert_eq!(faults(lowered(0.0)), [0, 1, 0]);
        assert_eq!(faults(lowered(1e-4)), [0, 0, 1]);
        assert_eq!(faults(lowered(-1e-4)), [1, 0, 1]);
    }

    #[test]
    fn sound_shells_have_no_faults() {
        for (mesh, boundary_edges) in [(row(5), 15), (sphere(), 0), (torus(), 0)] {
            let expected =
                Health { tetrahedra: 3 * mesh.triangles.len() as u64, boundary_edges, ..Health::default() };
            assert_eq!(of(&mesh, &ShellOptions::new(0.1)), expected);
        }
    }

    #[test]
    fn planted_faults_are_counted_exactly() {
        let sound = Health { tetrahedra: 21, boundary_edges: 21, ..Health::default() };
        let mut mesh = row(7);
        let mut options = ShellOptions { thickness_scale: vec![1.0; 21], ..ShellOptions::new(0.5) };
        assert_eq!(of(&mesh, &options), sound);

        mesh.normals[0..3].fill(-DVec3::Z);
        assert_eq!(of(&mesh, &options), Health { inverted: 3, ..sound });

        // Flat over one vertex: one tetrahedron of that prism. Flat over all: three.
        options.thickness_scale[4] = 0.0;
        assert_eq!(of(&mesh, &options), Health { inverted: 3, zero_volume: 1, ..sound });
        options.thickness_scale[6..9].fill(0.0);
        assert_eq!(of(&mesh, &options), Health { inverted: 3, zero_volume: 4, ..sound });

        // Half legs, 1e-4 of a leg high: quality is near sqrt(2) 1e-4 / (7/6)^(3/2).
        options.thickness_scale[9..12].fill(2e-4);
        assert_eq!(of(&mesh, &options), Health { inverted: 3, zero_volume: 4, slivers: 3, ..sound });

        // A second triangle that runs along an edge the same way as the first: it lies upside down.
        mesh.positions.push(DVec3::new(12.5, -1.0, 0.0));
        mesh.normals.push(DVec3::Z);
        options.thickness_scale.push(1.0);
        mesh.triangles.push([12, 13, 21]);
        mesh.uvs.push([DVec2::ZERO; 3]);
        let expected = Health {
            tetrahedra: 24,
            inverted: 6,
            zero_volume: 4,
            slivers: 3,
            non_manifold_edges: 1,
            boundary_edges: 22,
            overlap_risk_vertices: 0,
        };
        assert_eq!(of(&mesh, &options), expected);
    }

    #[test]
    fn a_bowl_thicker_than_its_radius_is_at_risk_and_a_ball_is_not() {
        let risk = |mesh: &Mesh, thickness| of(mesh, &ShellOptions::new(thickness)).overlap_risk_vertices;
        let (ball, bowl) = (sphere(), inside_out(sphere()));
        // On a sphere the estimate is the radius itself, up to rounding.
        assert_eq!(risk(&bowl, 1.0 + 1e-9), bowl.positions.len() as u64);
        assert_eq!(risk(&bowl, 1.0 - 1e-9), 0);
        assert_eq!(risk(&ball, 100.0), 0);
    }

    #[test]
    fn only_the_thick_vertices_of_a_bowl_are_at_risk() {
        let bowl = inside_out(sphere());
        let mut options = ShellOptions::new(0.5);
        options.thickness_scale = vec![1.0; bowl.positions.len()];
        options.thickness_scale[10] = 2.1;
        options.thickness_scale[20] = 2.1;
        assert_eq!(of(&bowl, &options).overlap_risk_vertices, 2);
    }

    /// Around its hole a torus is concave: with radius 0.75 on the inner equator, and with radius
    /// `(1 + 0.25 cos v) / -cos v = 0.832` on the next of 16 rings, `v = pi - pi / 8`.
    #[test]
    fn a_torus_is_at_risk_on_its_inner_equator() {
        let next = (PI - PI / 8.0).cos();
        assert!(((1.0 + 0.25 * next) / -next - 0.832).abs() < 1e-3);
        let risk = |thickness| of(&torus(), &ShellOptions::new(thickness)).overlap_risk_vertices;
        assert_eq!([0.749, 0.751, 0.83, 0.84].map(risk), [0, 16, 16, 48]);
    }
}
