//! The vase: a surface of revolution around the Y axis that stands on the origin, closed by its foot and
//! open at its lip. With its default parameters it has the 8,640 triangles of the vase of Dufort,
//! Leblanc and Poulin 2005, Table 1.

use glam::{DVec2, DVec3};
use serde::Deserialize;

use super::bezier::{piece, slopes, weights};
use super::grid::Grid;
use super::primitives::around;
use super::{Checked, check_count, check_length};
use crate::mesh::Mesh;

/// The profile, foot to lip, as cubic Bezier curves in (distance from the axis, height); the tangent is
/// continuous where they meet. It is 2.2 high.
const PROFILE: [[DVec2; 4]; 4] = [
    [DVec2::new(0.0, 0.0), DVec2::new(0.2, 0.0), DVec2::new(0.36, 0.0), DVec2::new(0.4, 0.06)],
    [DVec2::new(0.4, 0.06), DVec2::new(0.48, 0.18), DVec2::new(0.85, 0.5), DVec2::new(0.85, 0.95)],
    [DVec2::new(0.85, 0.95), DVec2::new(0.85, 1.4), DVec2::new(0.35, 1.45), DVec2::new(0.35, 1.8)],
    [DVec2::new(0.35, 1.8), DVec2::new(0.35, 2.0), DVec2::new(0.45, 2.1), DVec2::new(0.6, 2.2)],
];

/// Chords by which the profile's length is measured.
const CHORDS: usize = 1024;

/// A vase; u runs around it, v by arc length from the middle of its foot to its lip.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Vase {
    /// World units; default 2.2. The largest diameter is 1.7 / 2.2 of it.
    pub height: f64,
    /// Quads around, 3 to 2048; default 64.
    pub segments: u32,
    /// Rows from foot to lip, 2 to 2048; default 68. There are `segments (2 rings - 1)` triangles.
    pub rings: u32,
}

impl Default for Vase {
    fn default() -> Self {
        Self { height: 2.2, segments: 64, rings: 68 }
    }
}

impl Vase {
    pub(super) fn check(&self) -> Checked {
        let default = Self::default();
        check_length("height", self.height, default.height)?;
        check_count("segments", self.segments, 3, default.segments)?;
        check_count("rings", self.rings, 2, default.rings)
    }

    pub(super) fn mesh(&self) -> Mesh {
        let scale = self.height / PROFILE[3][3].y;
        let lengths = lengths();
        let grid = Grid {
            segments: self.segments,
            rings: self.rings,
            closed_u: true,
            first_pole: true,
            ..Grid::OPEN
        };
        grid.mesh(|u, v| {
            let (point, tangent) = profile(parameter_at(&lengths, v));
            let normal = (tangent.y * around(u) - tangent.x * DVec3::Y).normalize();
            (scale * (point.x * around(u) + point.y * DVec3::Y), normal)
        })
    }
}

/// A point of the profile and its derivative, at a parameter 0..1 that gives each curve an equal share.
fn profile(t: f64) -> (DVec2, DVec2) {
    let (curve, t) = piece(t, PROFILE.len());
    let blend = |weights: [f64; 4]| (0..4).map(|k| weights[k] * PROFILE[curve][k]).sum();
    (blend(weights(t)), blend(slopes(t)))
}

/// The profile's length from the foot to each of [`CHORDS`] + 1 equally spaced parameters.
fn lengths() -> Vec<f64> {
    let point = |chord: usize| profile(chord as f64 / CHORDS as f64).0;
    let mut lengths = vec![0.0];
    for chord in 0..CHORDS {
        lengths.push(lengths[chord] + point(chord).distance(point(chord + 1)));
    }
    lengths
}

/// The parameter at the fraction `v` of the profile's length; exact at both ends.
fn parameter_at(lengths: &[f64], v: f64) -> f64 {
    let length = v * lengths[CHORDS];
    let after = lengths.partition_point(|&l| l <= length).clamp(1, CHORDS);
    let within = (length - lengths[after - 1]) / (lengths[after] - lengths[after - 1]);
    ((after - 1) as f64 + within) / CHORDS as f64
}
