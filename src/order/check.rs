//! Is an order right? The order of the tetrahedra along rays, found independently of how the order was made.
//!
//! Each ray is cut with the four planes of each tetrahedron that it may meet, in f64 with a bound on the
//! error of each cut, and ranks must increase along it. Nothing is shared with the sort but the vertices.

use bvh::aabb::{Aabb, Bounded};
use bvh::bounding_hierarchy::BHShape;
use bvh::bvh::Bvh;
use bvh::ray::Ray;
use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::Order;
use crate::scene::View;
use crate::shell::Shell;

/// At most so many violations are described.
const DESCRIBED: usize = 16;

/// Two tetrahedra in the wrong order on a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Violation {
    /// From the eye, world space.
    pub ray: DVec3,
    /// The tetrahedron that the ray meets first, though the order says otherwise.
    pub front: u32,
    /// The one that it meets later.
    pub back: u32,
}

/// What [`check`] found. Pairs are pairs of tetrahedra that one ray passes through.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Check {
    /// Rays followed.
    pub rays: u64,
    /// Rays with a violation.
    pub wrong_rays: u64,
    /// Pairs compared; the counts below are of these.
    pub pairs: u64,
    /// In the wrong order.
    pub violations: u64,
    /// Members of one cycle, which have no order.
    pub cyclic: u64,
    /// Tetrahedra that intersect on the ray by more than rounding: the shell overlaps itself there, and
    /// neither order is right.
    pub overlapping: u64,
    /// Too thin for the rounding of their depths: either order may be right.
    pub undecided: u64,
    /// Tetrahedra that a ray only touches, as far as rounding can tell; they make no pairs.
    pub touched: u64,
    /// The first of the violations.
    pub first: Vec<Violation>,
}

impl Check {
    /// Both findings together.
    #[must_use]
    pub fn and(mut self, other: Self) -> Self {
        self.rays += other.rays;
        self.wrong_rays += other.wrong_rays;
        self.pairs += other.pairs;
        self.violations += other.violations;
        self.cyclic += other.cyclic;
        self.overlapping += other.overlapping;
        self.undecided += other.undecided;
        self.touched += other.touched;
        let room = DESCRIBED - self.first.len();
        self.first.extend(other.first.into_iter().take(room));
        self
    }
}

/// A computed number with a bound on its absolute error.
#[derive(Debug, Clone, Copy)]
struct Approximate {
    value: f64,
    error: f64,
}

/// Between which numbers the true one lies for sure.
#[derive(Debug, Clone, Copy)]
struct Bounds {
    low: f64,
    high: f64,
}

/// The inside of a face's plane along a ray from the eye: `distance + t * slope >= 0`.
#[derive(Debug, Clone, Copy)]
struct HalfSpace {
    normal: DVec3,
    distance: Approximate,
    /// Error of the slope over the length of the ray's direction.
    slope_error: f64,
}

/// A tetrahedron relative to the eye.
#[derive(Debug)]
struct Solid {
    id: u32,
    rank: u32,
    cycle: u32,
    faces: [HalfSpace; 4],
    low: DVec3,
    high: DVec3,
    node: usize,
}

/// The part of a ray inside a tetrahedron: `t` in multiples of the ray's direction.
#[derive(Debug, Clone, Copy)]
struct Interval {
    id: u32,
    rank: u32,
    cycle: u32,
    entry: Bounds,
    exit: Bounds,
}

/// No cycle.
const ACYCLIC: u32 = u32::MAX;

impl Solid {
    /// `None` without volume.
    fn new(corners: [DVec3; 4], eye: DVec3, id: u32, rank: u32, cycle: u32) -> Option<Self> {
        let half_space = |k: usize| {
            let [p, q, r] = [1, 2, 3].map(|i| corners[(k + i) % 4]);
            let (e, f) = (q - p, r - p);
            let normal = e.cross(f);
            // One rounding u = EPSILON / 2 of each difference, product and sum: each component of the normal
            // is off by at most 4u |e||f|, so the normal by 7u |e||f|; the inner product adds 3u and the
            // offset from the eye 1u. 16u covers the sum and the rounding of the bound itself.
            let unit = 8.0 * f64::EPSILON * e.length() * f.length();
            let inner = normal.dot(corners[k] - p);
            if inner.abs() <= unit * (corners[k] - p).length() {
                return None;
            }
            let normal = normal * inner.signum();
            let offset = eye - p;
            let distance = Approximate { value: normal.dot(offset), error: unit * offset.length() };
            Some(HalfSpace { normal, distance, slope_error: unit })
        };
        let faces = [half_space(0)?, half_space(1)?, half_space(2)?, half_space(3)?];
        let (mut low, mut high) = (corners[0] - eye, corners[0] - eye);
        for corner in corners {
            low = low.min(corner - eye);
            high = high.max(corner - eye);
        }
        // Wider than the rounding of the boxes' own tests, which are relative to the distance.
        let margin = DVec3::splat(1e-9 * low.abs().max(high.abs()).max_element());
        Some(Self { id, rank, cycle, faces, low: low - margin, high: high + margin, node: 0 })
    }

    /// `Err` where the ray passes too near to the boundary to tell whether it passes through.
    fn interval(&self, ray: DVec3) -> Result<Option<Interval>, ()> {
        let mut entry = Bounds { low: 0.0, high: 0.0 };
        let mut exit = Bounds { low: f64::INFINITY, high: f64::INFINITY };
        let length = ray.length();
        for &HalfSpace { normal, distance, slope_error } in &self.faces {
            let slope = Approximate { value: normal.dot(ray), error: slope_error * length };
            if slope.value.abs() <= slope.error {
                // Parallel to the plane as far as can be told: it is crossed no nearer than here.
                let nearest = (distance.value.abs() - distance.error) / (slope.value.abs() + slope.error);
                if distance.value > distance.error {
                    exit.low = exit.low.min(nearest);
                } else {
                    entry.low = entry.low.max(nearest);
                    entry.high = f64::INFINITY;
                }
                continue;
            }
            let t = -distance.value / slope.value;
            let error = (distance.error + t.abs() * slope.error) / (slope.value.abs() - slope.error)
                + f64::EPSILON * t.abs();
            if slope.value > 0.0 {
                entry = Bounds { low: entry.low.max(t - error), high: entry.high.max(t + error) };
            } else {
                exit = Bounds { low: exit.low.min(t - error), high: exit.high.min(t + error) };
            }
        }
        if exit.high < entry.low {
            Ok(None)
        } else if exit.low > entry.high {
            Ok(Some(Interval { id: self.id, rank: self.rank, cycle: self.cycle, entry, exit }))
        } else {
            Err(())
        }
    }
}

impl Bounded<f64, 3> for Solid {
    fn aabb(&self) -> Aabb<f64, 3> {
        Aabb::with_bounds(self.low.to_array().into(), self.high.to_array().into())
    }
}

impl BHShape<f64, 3> for Solid {
    fn set_bh_node_index(&mut self, node: usize) {
        self.node = node;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}

/// Checks `order` along rays from `eye`; both it and the ray directions (of any length) are in world space.
pub fn check(shell: &Shell, order: &Order, eye: DVec3, rays: &[DVec3]) -> Check {
    let mut solids = solids(shell, order, eye);
    let tree = Bvh::build(&mut solids);
    rays.par_chunks(256)
        .map(|rays| {
            let mut intervals = Vec::new();
            rays.iter().fold(Check::default(), |found, &ray| {
                found.and(check_ray(&solids, &tree, ray, &mut intervals))
            })
        })
        .collect::<Vec<_>>()
        .into_iter()
        .fold(Check::default(), Check::and)
}

/// [`check`] along the rays of all pixel centres.
pub fn check_pixels(shell: &Shell, order: &Order, view: &View) -> Check {
    let rays: Vec<DVec3> = (0..view.height)
        .flat_map(|y| (0..view.width).map(move |x| DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5)))
        .map(|centre| view.ray_at_unit_depth(centre))
        .collect();
    check(shell, order, view.camera.eye, &rays)
}

/// The tetrahedra that have volume.
fn solids(shell: &Shell, order: &Order, eye: DVec3) -> Vec<Solid> {
    let mut cycle_at = vec![ACYCLIC; order.sequence.len()];
    for (number, cycle) in (0u32..).zip(&order.cycles) {
        cycle_at[cycle.clone()].fill(number);
    }
    (0u32..)
        .zip(&order.sequence)
        .filter_map(|(rank, &id)| {
            let corners = shell.topology.tetrahedra[id as usize].map(|v| shell.vertices[v as usize]);
            Solid::new(corners, eye, id, rank, cycle_at[rank as usize])
        })
        .collect()
}

fn check_ray(solids: &[Solid], tree: &Bvh<f64, 3>, ray: DVec3, intervals: &mut Vec<Interval>) -> Check {
    let mut found = Check { rays: 1, ..Check::default() };
    intervals.clear();
    // A component of exactly zero would make 0 * infinity in the box test.
    let direction = ray.to_array().map(|c| if c == 0.0 { f64::MIN_POSITIVE } else { c });
    let query = Ray::new([0.0; 3].into(), direction.into());
    for solid in tree.traverse_iterator(&query, solids) {
        match solid.interval(ray) {
            Ok(interval) => intervals.extend(interval),
            Err(()) => found.touched += 1,
        }
    }
    intervals.sort_unstable_by(|a, b| a.entry.low.total_cmp(&b.entry.low).then(a.id.cmp(&b.id)));
    for (i, front) in intervals.iter().enumerate() {
        for back in &intervals[i + 1..] {
            found.pairs += 1;
            if front.cycle == back.cycle && front.cycle != ACYCLIC {
                found.cyclic += 1;
                continue;
            }
            let may_precede = |a: &Interval, b: &Interval| a.exit.low <= b.entry.high;
            match (may_precede(front, back), may_precede(back, front)) {
                (true, true) => found.undecided += 1,
                (false, false) => found.overlapping += 1,
                (true, false) if front.rank < back.rank => {}
                (false, true) if back.rank < front.rank => {}
                (front_first, _) => {
                    found.violations += 1;
                    if found.first.len() < DESCRIBED {
                        let (front, back) = if front_first { (front, back) } else { (back, front) };
                        found.first.push(Violation { ray, front: front.id, back: back.id });
                    }
                }
            }
        }
    }
    found.wrong_rays = u64::from(found.violations > 0);
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    const EYE: DVec3 = DVec3::new(0.1, 0.2, 5.0);

    fn solid(corners: [DVec3; 4]) -> Option<Solid> {
        Solid::new(corners, EYE, 0, 0, ACYCLIC)
    }

    /// A corner of the unit cube.
    fn corner() -> Solid {
        solid([DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z]).unwrap()
    }

    #[test]
    fn intervals_bound_the_true_entry_and_exit() {
        // The ray (0.1, 0.2, 5 - t) enters at x + y + z = 1 and leaves at z = 0, within a few units of rounding.
        let Interval { entry, exit, .. } = corner().interval(-DVec3::Z).unwrap().unwrap();
        assert!(entry.low <= 4.3 && 4.3 <= entry.high && entry.high - entry.low < 1e-13);
        assert!(exit.low <= 5.0 && 5.0 <= exit.high && exit.high - exit.low < 1e-13);
    }

    #[test]
    fn rays_that_miss_pass_behind_or_touch_are_no_intervals() {
        assert!(corner().interval(DVec3::Z).unwrap().is_none());
        assert!(corner().interval(DVec3::new(1.0, 0.0, -1.0)).unwrap().is_none());
        assert!(corner().interval(DVec3::Z - EYE).is_err(), "through a vertex");
        assert!(corner().interval(DVec3::new(0.0, 0.2, 0.8) - EYE).is_err(), "along the outline");
        assert!(solid([DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::X + DVec3::Y]).is_none(), "no volume");
    }

    #[test]
    fn a_ray_in_a_faces_plane_only_touches() {
        let side = solid([DVec3::ZERO, DVec3::X, EYE - DVec3::Z, EYE - 2.0 * DVec3::Z]).unwrap();
        assert!(side.interval(-DVec3::Z).is_err());
    }
}
