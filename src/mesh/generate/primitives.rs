//! The plane, the tube, the sphere and the torus.

use std::f64::consts::{PI, TAU};

use glam::DVec3;
use serde::Deserialize;

use super::grid::Grid;
use super::{BadParameter, Checked, check_count, check_length};
use crate::mesh::Mesh;

/// A square in the XZ plane, centred on the origin, that faces up; u runs along +X, v along -Z.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Plane {
    /// Length of a side in world units; default 2.
    pub size: f64,
    /// Quads along a side, 1 to 2048; default 16.
    pub segments: u32,
}

impl Default for Plane {
    fn default() -> Self {
        Self { size: 2.0, segments: 16 }
    }
}

impl Plane {
    pub(super) fn check(&self) -> Checked {
        let default = Self::default();
        check_length("size", self.size, default.size)?;
        check_count("segments", self.segments, 1, default.segments)
    }

    pub(super) fn mesh(&self) -> Mesh {
        let grid = Grid { segments: self.segments, rings: self.segments, ..Grid::OPEN };
        grid.mesh(|u, v| (self.size * DVec3::new(u - 0.5, 0.0, 0.5 - v), DVec3::Y))
    }
}

/// A cylinder without caps around the Y axis, centred on the origin; u runs around it, v along it.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Tube {
    /// World units; default 1.
    pub radius: f64,
    /// World units; default 2.
    pub height: f64,
    /// Quads around, 3 to 2048; default 48.
    pub segments: u32,
    /// Quads along, 1 to 2048; default 16.
    pub rings: u32,
}

impl Default for Tube {
    fn default() -> Self {
        Self { radius: 1.0, height: 2.0, segments: 48, rings: 16 }
    }
}

impl Tube {
    pub(super) fn check(&self) -> Checked {
        let default = Self::default();
        check_length("radius", self.radius, default.radius)?;
        check_length("height", self.height, default.height)?;
        check_count("segments", self.segments, 3, default.segments)?;
        check_count("rings", self.rings, 1, default.rings)
    }

    pub(super) fn mesh(&self) -> Mesh {
        let grid = Grid { segments: self.segments, rings: self.rings, closed_u: true, ..Grid::OPEN };
        grid.mesh(|u, v| {
            let normal = around(u);
            (self.radius * normal + self.height * (v - 0.5) * DVec3::Y, normal)
        })
    }
}

/// A sphere centred on the origin; u runs around the Y axis, v from the south to the north pole.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Sphere {
    /// World units; default 1.
    pub radius: f64,
    /// Quads around, 3 to 2048; default 48.
    pub segments: u32,
    /// Rows from pole to pole, 2 to 2048; default 24.
    pub rings: u32,
}

impl Default for Sphere {
    fn default() -> Self {
        Self { radius: 1.0, segments: 48, rings: 24 }
    }
}

impl Sphere {
    pub(super) fn check(&self) -> Checked {
        let default = Self::default();
        check_length("radius", self.radius, default.radius)?;
        check_count("segments", self.segments, 3, default.segments)?;
        check_count("rings", self.rings, 2, default.rings)
    }

    pub(super) fn mesh(&self) -> Mesh {
        let grid = Grid {
            segments: self.segments,
            rings: self.rings,
            closed_u: true,
            first_pole: true,
            last_pole: true,
            ..Grid::OPEN
        };
        grid.mesh(|u, v| {
            // The sine of pi is not quite 0, but a pole lies exactly on the axis.
            let from_axis = if v == 0.0 || v == 1.0 { 0.0 } else { (PI * v).sin() };
            let normal = from_axis * around(u) - (PI * v).cos() * DVec3::Y;
            (self.radius * normal, normal)
        })
    }
}

/// A ring around the Y axis, centred on the origin; u runs around the axis, v around the tube from the
/// outer equator upwards.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Torus {
    /// From the axis to the middle of the tube, in world units; default 1.
    pub major_radius: f64,
    /// Of the tube, in world units, from 1e-9 to less than 1 times the major radius; default 0.4.
    pub minor_radius: f64,
    /// Quads around the axis, 3 to 2048; default 48.
    pub segments: u32,
    /// Quads around the tube, 3 to 2048; default 24.
    pub rings: u32,
}

impl Default for Torus {
    fn default() -> Self {
        Self { major_radius: 1.0, minor_radius: 0.4, segments: 48, rings: 24 }
    }
}

impl Torus {
    pub(super) fn check(&self) -> Checked {
        let default = Self::default();
        check_length("major_radius", self.major_radius, default.major_radius)?;
        check_length("minor_radius", self.minor_radius, default.minor_radius)?;
        // Below, positions run together by rounding; above, the ring cuts itself.
        if !(1e-9..1.0).contains(&(self.minor_radius / self.major_radius)) {
            let message = format!(
                "is {}, but must be less than the major radius {}, and at least 1e-9 of it (default {})",
                self.minor_radius, self.major_radius, default.minor_radius
            );
            return Err(BadParameter { key: "minor_radius", message });
        }
        check_count("segments", self.segments, 3, default.segments)?;
        check_count("rings", self.rings, 3, default.rings)
    }

    pub(super) fn mesh(&self) -> Mesh {
        let grid =
            Grid { segments: self.segments, rings: self.rings, closed_u: true, closed_v: true, ..Grid::OPEN };
        grid.mesh(|u, v| {
            let normal = (TAU * v).cos() * around(u) + (TAU * v).sin() * DVec3::Y;
            (self.major_radius * around(u) + self.minor_radius * normal, normal)
        })
    }
}

/// The horizontal unit vector at the fraction `u` of a turn around the Y axis, from +Z towards +X: to
/// the right as seen from outside with Y up.
pub(super) fn around(u: f64) -> DVec3 {
    let (sine, cosine) = (TAU * u).sin_cos();
    DVec3::new(sine, 0.0, cosine)
}
