//! The Utah teapot: M. Newell, "The Utilization of Procedure Models in Digital Image Synthesis", 1975, as
//! 32 bicubic Bezier patches (24 around the axis, 4 of the handle, 4 of the spout), with Crow's bottom
//! and in Blinn's proportions, which are those of the data commonly handed on.
//!
//! The patches repeat themselves: those around the axis are four quarter turns of one profile, those of
//! handle and spout a half and its mirror image. Here only the profiles are kept. Neighbouring
//! patches meet with one tangent plane, so a part is sampled as one surface with any count of segments.
//! With its default parameters the teapot has 2,142 triangles, as in Dufort, Leblanc and Poulin 2005, Table 1.

use glam::{DVec2, DVec3};
use serde::Deserialize;

use super::bezier::{piece, slopes, weights};
use super::grid::Grid;
use super::{Checked, check_count, check_length};
use crate::mesh::Mesh;

/// The height of Newell's teapot, knob to bottom.
const HEIGHT: f64 = 3.15;

/// A control point of a profile that is turned around the axis.
struct Turned {
    /// Distance from the axis.
    radius: f64,
    /// Offset of the inner control points of a quarter turn: 0.56 radii, but for the knob, whose data are
    /// rounded.
    tangent: f64,
    height: f64,
}

const fn turned(radius: f64, height: f64) -> Turned {
    Turned { radius, tangent: 0.56 * radius, height }
}

/// Bottom, lower body, upper body, rim: cubic curves that share their end points.
const BODY: [Turned; 13] = [
    turned(0.0, 0.0),
    turned(1.425, 0.0),
    turned(1.5, 0.075),
    turned(1.5, 0.15),
    turned(1.5, 0.225),
    turned(2.0, 0.45),
    turned(2.0, 0.9),
    turned(2.0, 1.35),
    turned(1.75, 1.875),
    turned(1.5, 2.4),
    turned(1.4375, 2.53125),
    turned(1.3375, 2.53125),
    turned(1.4, 2.4),
];

/// Lid and knob.
const LID: [Turned; 7] = [
    turned(1.3, 2.4),
    turned(1.3, 2.55),
    turned(0.4, 2.55),
    turned(0.2, 2.7),
    turned(0.0, 2.85),
    Turned { radius: 0.8, tangent: 0.45, height: 3.15 },
    turned(0.0, 3.15),
];

/// A control row of a tube that is symmetric about the plane of handle and spout.
struct Halved {
    /// Where the half begins, in that plane (distance from the axis towards the spout, height).
    first: DVec2,
    /// Where it ends, in that plane.
    last: DVec2,
    /// How far its inner control points lie from that plane.
    width: f64,
}

const fn halved(first: [f64; 2], last: [f64; 2], width: f64) -> Halved {
    Halved { first: DVec2::from_array(first), last: DVec2::from_array(last), width }
}

/// From the upper end to the lower. Newell's last row begins at -2, in a point of the body that would have to have the normals of
/// both; here it ends a little inside, as the rest of the row does.
const HANDLE: [Halved; 7] = [
    halved([-1.6, 2.025], [-1.5, 2.25], 0.3),
    halved([-2.3, 2.025], [-2.5, 2.25], 0.3),
    halved([-2.7, 2.025], [-3.0, 2.25], 0.3),
    halved([-2.7, 1.8], [-3.0, 1.8], 0.3),
    halved([-2.7, 1.575], [-3.0, 1.35], 0.3),
    halved([-2.5, 1.125], [-2.65, 0.9375], 0.3),
    halved([-1.99, 0.9], [-1.9, 0.6], 0.3),
];

/// From the body to the tip, which turns inward.
const SPOUT: [Halved; 7] = [
    halved([1.7, 1.425], [1.7, 0.6], 0.66),
    halved([2.6, 1.425], [3.1, 0.825], 0.66),
    halved([2.3, 2.1], [2.4, 2.025], 0.25),
    halved([2.7, 2.4], [3.3, 2.4], 0.25),
    halved([2.8, 2.475], [3.525, 2.49375], 0.25),
    halved([2.9, 2.475], [3.45, 2.5125], 0.15),
    halved([2.8, 2.4], [3.2, 2.4], 0.15),
];

/// The teapot, standing on the origin, its spout towards +X. Body, lid, handle and spout are four
/// surfaces that pass through or stand off one another, as in the original; each has u around it and v along it.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Teapot {
    /// World units; default 3.15, the size of Newell's data.
    pub height: f64,
    /// Quads around body and lid, 3 to 2048; default 34.
    pub segments: u32,
    /// Rows of the body from the middle of the bottom to the rim, 2 to 2048; default 12.
    pub body_rings: u32,
    /// Rows of the lid from its edge to the top of the knob, 2 to 2048; default 6.
    pub lid_rings: u32,
    /// Quads around the handle, 3 to 2048; default 12.
    pub handle_segments: u32,
    /// Quads along the handle, 1 to 2048; default 27.
    pub handle_rings: u32,
    /// Quads around the spout, 3 to 2048; default 13.
    pub spout_segments: u32,
    /// Quads along the spout, 1 to 2048; default 13.
    ///
    /// There are `2 (segments (body_rings + lid_rings - 1) + handle_segments handle_rings +
    /// spout_segments spout_rings)` triangles.
    pub spout_rings: u32,
}

impl Default for Teapot {
    fn default() -> Self {
        Self {
            height: HEIGHT,
            segments: 34,
            body_rings: 12,
            lid_rings: 6,
            handle_segments: 12,
            handle_rings: 27,
            spout_segments: 13,
            spout_rings: 13,
        }
    }
}

impl Teapot {
    pub(super) fn check(&self) -> Checked {
        let default = Self::default();
        check_length("height", self.height, default.height)?;
        check_count("segments", self.segments, 3, default.segments)?;
        check_count("body_rings", self.body_rings, 2, default.body_rings)?;
        check_count("lid_rings", self.lid_rings, 2, default.lid_rings)?;
        check_count("handle_segments", self.handle_segments, 3, default.handle_segments)?;
        check_count("handle_rings", self.handle_rings, 1, default.handle_rings)?;
        check_count("spout_segments", self.spout_segments, 3, default.spout_segments)?;
        check_count("spout_rings", self.spout_rings, 1, default.spout_rings)
    }

    pub(super) fn mesh(&self) -> Mesh {
        let body = Grid { first_pole: true, ..tube(self.segments, self.body_rings) };
        let lid = Grid { last_pole: true, ..tube(self.segments, self.lid_rings) };
        let handle = tube(self.handle_segments, self.handle_rings);
        let spout = tube(self.spout_segments, self.spout_rings);

        let mut mesh = body.mesh(|u, v| around_axis(&BODY, u, v));
        append(&mut mesh, lid.mesh(|u, v| around_axis(&LID, u, v)));
        append(&mut mesh, handle.mesh(|u, v| mirrored(&HANDLE, u, v)));
        append(&mut mesh, spout.mesh(|u, v| mirrored(&SPOUT, u, v)));

        mesh.positions.iter_mut().for_each(|position| *position *= self.height / HEIGHT);
        mesh
    }
}

/// Adds a part, none of whose positions is there yet.
fn append(mesh: &mut Mesh, part: Mesh) {
    let offset = mesh.positions.len() as u32;
    mesh.positions.extend(part.positions);
    mesh.normals.extend(part.normals);
    mesh.triangles.extend(part.triangles.iter().map(|ids| ids.map(|id| id + offset)));
    mesh.uvs.extend(part.uvs);
}

fn tube(segments: u32, rings: u32) -> Grid {
    Grid { segments, rings, closed_u: true, closed_v: false, first_pole: false, last_pole: false }
}

/// A point and unit normal of a surface around the Y axis; u begins under the handle, at -X.
fn around_axis(profile: &[Turned], u: f64, v: f64) -> (DVec3, DVec3) {
    const QUARTERS: [DVec3; 4] = [DVec3::NEG_X, DVec3::Z, DVec3::X, DVec3::NEG_Z];
    let (quarter, s) = piece(u, 4);
    let (from, to) = (QUARTERS[quarter], QUARTERS[(quarter + 1) % 4]);
    let (curve, t) = piece(v, profile.len() / 3);
    let patch = |row: usize| {
        let Turned { radius, tangent, height } = profile[3 * curve + row];
        let up = height * DVec3::Y;
        [
            radius * from + up,
            radius * from + tangent * to + up,
            tangent * from + radius * to + up,
            radius * to + up,
        ]
    };
    let (point, normal) = evaluate([0, 1, 2, 3].map(patch), s, t);
    // At a pole all directions around the axis are alike.
    let is_pole = point.x == 0.0 && point.z == 0.0;
    (point, if is_pole { DVec3::Y * if v == 0.0 { -1.0 } else { 1.0 } } else { normal })
}

/// A point and unit normal of a tube that is symmetric about the XY plane; its first half lies at z > 0.
fn mirrored(rows: &[Halved], u: f64, v: f64) -> (DVec3, DVec3) {
    let (half, s) = piece(u, 2);
    let (curve, t) = piece(v, rows.len() / 3);
    let side = [1.0, -1.0][half];
    let patch = |row: usize| {
        let Halved { first, last, width } = rows[3 * curve + row];
        let controls =
            [first.extend(0.0), first.extend(side * width), last.extend(side * width), last.extend(0.0)];
        if half == 0 { controls } else { [controls[3], controls[2], controls[1], controls[0]] }
    };
    evaluate([0, 1, 2, 3].map(patch), s, t)
}

/// A point of a bicubic patch, `patch[row][column]`, and the unit normal du x dv.
fn evaluate(patch: [[DVec3; 4]; 4], s: f64, t: f64) -> (DVec3, DVec3) {
    let blend = |along_u: [f64; 4], along_v: [f64; 4]| -> DVec3 {
        (0..4).map(|row| along_v[row] * (0..4).map(|k| along_u[k] * patch[row][k]).sum::<DVec3>()).sum()
    };
    let (du, dv) = (blend(slopes(s), weights(t)), blend(weights(s), slopes(t)));
    (blend(weights(s), weights(t)), du.cross(dv).normalize_or_zero())
}
