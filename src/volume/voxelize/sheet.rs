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

#[cfg(test)]
mod tests {
    use rand::RngExt;
    use rand_pcg::Pcg32;

    use super::*;

    /// The distance of a point from a triangle, by brute force: the nearest of many points of it.
    fn distance([a, b, c]: [DVec3; 3], point: DVec3) -> f64 {
        const STEPS: u32 = 60;
        let mut nearest = f64::INFINITY;
        for i in 0..=STEPS {
            for j in 0..=STEPS - i {
                let [s, t] = [i, j].map(|n| f64::from(n) / f64::from(STEPS));
                nearest = nearest.min(point.distance(a + s * (b - a) + t * (c - a)));
            }
        }
        nearest
    }

    #[test]
    fn a_ray_is_inside_where_the_triangle_is_near() {
        let mut random = Pcg32::new(9, 9);
        let mut tested = [0; 2];
        for trial in 0..60 {
            let mut corners: [DVec3; 3] =
                std::array::from_fn(|_| DVec3::from_array(std::array::from_fn(|_| random.random::<f64>())));
            // Some lie along the rays, some across, some are needles.
            match trial % 4 {
                0 => corners[1] = corners[0] + 0.7 * DVec3::Z,
                1 => corners.iter_mut().for_each(|corner| corner.z = 0.25),
                2 => corners[2] = corners[0].lerp(corners[1], 0.4),
                _ => {}
            }
            let [a, b, c] = corners;
            let facets =
                [Facet { corners, area: 0.5 * (b - a).cross(c - a), uvs: [DVec2::ZERO; 3], material: 0 }];
            let sheet = Sheet { facets: &facets, radius: 0.2 };
            for _ in 0..20 {
                let point =
                    DVec2::new(1.4 * random.random::<f64>() - 0.2, 1.4 * random.random::<f64>() - 0.2);
                let mut turns = Vec::new();
                sheet.cross(0, point, &mut |turn| turns.push(turn.w));
                for w in (0..12).map(|i| 0.15 * f64::from(i) - 0.4) {
                    let is_inside = turns.first().is_some_and(|&enter| enter < w && w < turns[1]);
                    // Points of the brute force are at most sqrt(2) / 60 apart, and 2^(1/2) apart the corners.
                    let distance = distance(corners, point.extend(w));
                    if (distance - 0.2).abs() > 0.03 {
                        assert_eq!(is_inside, distance < 0.2, "trial {trial}: {distance} at {point}, {w}");
                        tested[usize::from(is_inside)] += 1;
                    }
                }
            }
        }
        assert!(tested.iter().all(|&count| count > 300), "{tested:?}");
    }
}
