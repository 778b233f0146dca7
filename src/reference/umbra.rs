//! Which part of an eye's ray a light does not reach because solids stand before it: exactly, as intervals of depth.
//!
//! The ray and the light span a plane. A triangle meets the plane in a segment, and the segment, seen from the light, hides an interval of
//! the ray; together they are the shadow. So nothing of it is overlooked, however thin, and the integrand can be cut at
//! its edges: between them it has no jump.
//!
//! ```text
//!        light, far away                   light L
//!          \   \   \                         /\
//!         q --- q'  \                      q/--\q'         a point q of the plane is  a direction + b axis,
//!            \   \                         /    \          axis: the direction to the light, or L itself
//!   eye -------####------->        eye ---######----->     it hides the depth  a, or a / (1 - b)
//! ```
//!
//! Only what is between the ray and the light counts: `b` is not negative, nor above 1 where the light is at `L`. On which side of the
//! plane a vertex lies is computed once for all its triangles, so that intervals of neighbours meet.

use glam::DVec3;

use super::hierarchy::Hierarchy;

/// A light as it is seen from the eye's place.
#[derive(Debug, Clone, Copy)]
pub enum Beacon {
    /// The unit vector towards it.
    Far(DVec3),
    /// Its position, relative to the eye.
    Near(DVec3),
}

/// The shadow of solids on one ray.
#[derive(Debug, Clone, PartialEq)]
pub enum Umbra {
    /// In order, apart from each other; in depth.
    Intervals(Vec<[f64; 2]>),
    /// The ray runs to the light, or away from it: there is no plane.
    Unknown,
}

/// A ray that comes closer to the direction of the light than this, in radians, spans no plane with it. Depths of intervals
/// lose as much of their accuracy as is lost here: 1e-10 of it is left.
const ALONG: f64 = 1e-6;

impl Umbra {
    /// On the part `range` of the ray along `direction`, in depth; no triangle is farther than `extent`, in world units, from any point
    /// of it.
    pub fn new<'a>(
        hierarchy: &Hierarchy,
        corners: impl Fn(usize) -> &'a [DVec3; 3],
        direction: DVec3,
        beacon: Beacon,
        range: [f64; 2],
        extent: f64,
    ) -> Self {
        let (axis, top) = match beacon {
            Beacon::Far(towards) => (towards, f64::INFINITY),
            Beacon::Near(place) => (place, 1.0),
        };
        let normal = direction.cross(axis);
        if normal.length() <= ALONG * direction.length() * axis.length() {
            return Self::Unknown;
        }
        let [along, up] = [axis.cross(normal), normal.cross(direction)];
        let (along, up) = (along / along.dot(direction), up / up.dot(axis));
        let ends = range.map(|depth| depth * direction);
        let lit = match beacon {
            Beacon::Far(towards) => ends.map(|end| end + extent * towards),
            Beacon::Near(place) => [place; 2],
        };
        let hull = [ends[0], ends[1], lit[0], lit[1]];
        let mut intervals = Vec::new();
        hierarchy.visit_plane(normal, &hull, |triangle| {
            let segment =
                meet(corners(triangle), normal).map(|points| points.map(|q| [along.dot(q), up.dot(q)]));
            let Some(segment) = segment.and_then(|segment| clip(segment, top)) else { return };
            let hidden = segment.map(|[a, b]| if top == 1.0 { a / (1.0 - b) } else { a });
            let [low, high] = [hidden[0].min(hidden[1]), hidden[0].max(hidden[1])];
            if low < range[1] && high > range[0] {
                intervals.push([low, high]);
            }
        });
        intervals.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
        intervals.dedup_by(|next, last| {
            let is_joined = next[0] <= last[1];
            if is_joined {
                last[1] = last[1].max(next[1]);
            }
            is_joined
        });
        Self::Intervals(intervals)
    }

    /// Whether the light does not reach the ray at a depth, where that is known.
    pub fn holds(&self, depth: f64) -> Option<bool> {
        match self {
            Self::Intervals(intervals) => {
                let after = intervals.partition_point(|interval| interval[0] <= depth);
                Some(after > 0 && depth < intervals[after - 1][1])
            }
            Self::Unknown => None,
        }
    }

    /// Where it begins and ends.
    pub fn edges(&self) -> &[f64] {
        match self {
            Self::Intervals(intervals) => intervals.as_flattened(),
            Self::Unknown => &[],
        }
    }
}

/// Where two edges of a triangle meet a plane through the origin.
fn meet(corners: &[DVec3; 3], normal: DVec3) -> Option<[DVec3; 2]> {
    let heights = corners.map(|corner| normal.dot(corner));
    let is_above = heights.map(|height| height >= 0.0);
    // The corner that is alone on its side.
    let alone =
        (0..3).find(|&i| is_above[i] != is_above[(i + 1) % 3] && is_above[i] != is_above[(i + 2) % 3])?;
    Some([1, 2].map(|step| {
        let other = (alone + step) % 3;
        corners[alone].lerp(corners[other], heights[alone] / (heights[alone] - heights[other]))
    }))
}

/// The part of a segment of points `[a, b]` with `b` in `0..=top`.
fn clip(segment: [[f64; 2]; 2], top: f64) -> Option<[[f64; 2]; 2]> {
    let [[from_a, from], [to_a, to]] = segment;
    if from.max(to) <= 0.0 || from.min(to) >= top {
        return None;
    }
    let at = |b: f64| [from_a + (b - from) / (to - from) * (to_a - from_a), b];
    Some(segment.map(|[a, b]| {
        if b < 0.0 {
            at(0.0)
        } else if b > top {
            at(top)
        } else {
            [a, b]
        }
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One triangle at height 1 over a ray along X, from x = 2 to x = 3 where z is 0.
    const TRIANGLE: [DVec3; 3] =
        [DVec3::new(2.0, 1.0, -1.0), DVec3::new(2.0, 1.0, 1.0), DVec3::new(4.0, 1.0, -1.0)];

    fn umbra(beacon: Beacon) -> Umbra {
        let hierarchy = Hierarchy::new(std::iter::once((0, TRIANGLE)));
        Umbra::new(&hierarchy, |_| &TRIANGLE, DVec3::X, beacon, [0.0, 10.0], 20.0)
    }

    fn assert_is(beacon: Beacon, expected: Option<[f64; 2]>) {
        let Umbra::Intervals(found) = umbra(beacon) else { panic!("{beacon:?} is known") };
        assert_eq!(found.len(), usize::from(expected.is_some()), "{beacon:?}: {found:?}");
        for (found, expected) in found.iter().zip(expected) {
            let error = (found[0] - expected[0]).abs().max((found[1] - expected[1]).abs());
            assert!(error < 1e-12, "{beacon:?}: {found:?}");
        }
    }

    #[test]
    fn a_triangle_hides_an_interval() {
        assert_is(Beacon::Far(DVec3::Y), Some([2.0, 3.0]));
        assert_is(Beacon::Far(DVec3::new(0.6, 0.8, 0.0)), Some([1.25, 2.25]));
        // Aside, the plane meets the triangle elsewhere: at z = 3/4 it ends at x = 2.25.
        assert_is(Beacon::Far(DVec3::new(0.0, 0.8, 0.6)), Some([2.0, 2.25]));
        assert_is(Beacon::Far(-DVec3::Y), None);
        assert_is(Beacon::Near(DVec3::new(0.0, 2.0, 0.0)), Some([4.0, 6.0]));
        // Not above it, and not beyond what a lamp at its own height sees.
        assert_is(Beacon::Near(DVec3::new(2.5, 0.5, 0.0)), None);
        assert_is(Beacon::Near(DVec3::new(0.0, 1.0, 0.0)), None);
        assert_eq!(umbra(Beacon::Far(DVec3::X)), Umbra::Unknown);
        assert_eq!(umbra(Beacon::Near(3.0 * DVec3::X)), Umbra::Unknown);
    }

    #[test]
    fn a_depth_is_within_or_not() {
        let umbra = Umbra::Intervals(vec![[1.0, 2.0], [4.0, 5.0]]);
        let held = [0.5, 1.5, 3.0, 4.5, 6.0].map(|depth| umbra.holds(depth).unwrap());
        assert_eq!(held, [false, true, false, true, false]);
        assert_eq!(umbra.edges(), [1.0, 2.0, 4.0, 5.0]);
    }
}
