//! A surface with a thickness: all within a radius of a triangle, with round edges.
//!
//! A triangle swept by a sphere is convex, so a ray is in it from one depth to another: the least and the greatest that belong
//! to one of its pieces, the prism over the triangle, three cylinders along the edges, three spheres at the corners.

use glam::{DVec2, DVec3};

use super::Facet;
use super::rays::{Filling, Turn};

/// Triangles with a thickness of twice the radius, in texels.
pub(super) struct Sheet<'a> {
    pub facets: &'a [Facet],
    pub radius: f64,
}

impl Filling for Sheet<'_> {
    fn parts(&self) -> usize {
        self.facets.len()
    }

    fn bounds(&self, part: usize) -> [DVec2; 2] {
        let [a, b, c] = self.facets[part].corners.map(DVec3::truncate);
        [a.min(b).min(c) - self.radius, a.max(b).max(c) + self.radius]
    }

    fn cross(&self, part: usize, point: DVec2, tell: &mut dyn FnMut(Turn)) {
        let [mut enter, mut leave] = [f64::INFINITY, f64::NEG_INFINITY];
        for [low, high] in pieces(&self.facets[part], self.radius, point) {
            if low < high {
                (enter, leave) = (enter.min(low), leave.max(high));
            }
        }
        if enter < leave {
            tell(Turn { w: enter, winding: 1 });
            tell(Turn { w: leave, winding: -1 });
        }
    }
}

/// Where the ray is in each piece, from and to; empty where it is from more than to.
fn pieces(facet: &Facet, radius: f64, point: DVec2) -> [[f64; 2]; 7] {
    let corners = facet.corners;
    let edge = |k: usize| [corners[k], corners[(k + 1) % 3]];
    [
        sphere(corners[0], radius, point),
        sphere(corners[1], radius, point),
        sphere(corners[2], radius, point),
        cylinder(edge(0), radius, point),
        cylinder(edge(1), radius, point),
        cylinder(edge(2), radius, point),
        prism(facet, radius, point),
    ]
}

const EMPTY: [f64; 2] = [f64::INFINITY, f64::NEG_INFINITY];
const WHOLE: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

fn sphere(centre: DVec3, radius: f64, point: DVec2) -> [f64; 2] {
    let square = radius * radius - point.distance_squared(centre.truncate());
    if square > 0.0 { [centre.z - square.sqrt(), centre.z + square.sqrt()] } else { EMPTY }
}

fn cylinder([from, to]: [DVec3; 2], radius: f64, point: DVec2) -> [f64; 2] {
    let axis = (to - from).normalize_or_zero();
    let start = point.extend(0.0) - from;
    // Along the ray: w^2 a + 2 w b + c <= 0, the squared distance from the axis less that of the radius.
    let along = start.dot(axis);
    let a = 1.0 - axis.z * axis.z;
    let b = start.z - along * axis.z;
    let c = start.length_squared() - along * along - radius * radius;
    // An axis along the ray, to rounding, has it inside all along, or nowhere.
    let inside = if a < 1e-12 {
        if c < 0.0 { WHOLE } else { EMPTY }
    } else {
        let root = b * b - a * c;
        if root > 0.0 { [(-b - root.sqrt()) / a, (-b + root.sqrt()) / a] } else { EMPTY }
    };
    let behind = clipped(inside, -axis.z, along);
    clipped(behind, axis.z, (to - from).dot(axis) - along)
}

fn prism(facet: &Facet, radius: f64, point: DVec2) -> [f64; 2] {
    let normal = facet.area.normalize_or_zero();
    if normal == DVec3::ZERO {
        return EMPTY;
    }
    let start = point.extend(0.0);
    let height = (start - facet.corners[0]).dot(normal);
    let mut inside = clipped(clipped(WHOLE, normal.z, radius - height), -normal.z, radius + height);
    for k in 0..3 {
        let (from, to) = (facet.corners[k], facet.corners[(k + 1) % 3]);
        let outward = (to - from).cross(normal);
        inside = clipped(inside, outward.z, -(start - from).dot(outward));
    }
    inside
}

/// The part of an interval in which `slope * w <= limit`.
fn clipped([low, high]: [f64; 2], slope: f64, limit: f64) -> [f64; 2] {
    if slope > 0.0 {
        [low, high.min(limit / slope)]
    } else if slope < 0.0 {
        [low.max(limit / slope), high]
    } else if limit >= 0.0 {
        [low, high]
    } else {
        EMPTY
    }
}
