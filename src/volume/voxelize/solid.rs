//! What a closed mesh encloses: where its winding number is not zero, so that parts may overlap.
//!
//! A ray that hits an edge or a corner belongs to one triangle there as if all rays were shifted by (e, e^2) for an e smaller
//! than any number (H. Edelsbrunner, E. P. Mücke, *Simulation of Simplicity*, 1990), and on which side of an edge a ray lies
//! is decided exactly (J. R. Shewchuk, *Adaptive Precision Floating-Point Arithmetic*, 1997). So the turns of every ray sum up
//! to zero, whatever the mesh.

use glam::{DVec2, DVec3};
use robust::{Coord, orient2d};

use super::Facet;
use super::rays::{Filling, Turn};

/// The triangles of a closed mesh.
pub(super) struct Solid<'a> {
    facets: &'a [Facet],
}

impl<'a> Solid<'a> {
    pub fn new(facets: &'a [Facet]) -> Self {
        Self { facets }
    }
}

impl Filling for Solid<'_> {
    fn parts(&self) -> usize {
        self.facets.len()
    }

    fn bounds(&self, part: usize) -> [DVec2; 2] {
        let [a, b, c] = self.facets[part].corners.map(DVec3::truncate);
        [a.min(b).min(c), a.max(b).max(c)]
    }

    fn cross(&self, part: usize, point: DVec2, tell: &mut dyn FnMut(Turn)) {
        let corners = self.facets[part].corners;
        let [a, b, c] = corners.map(DVec3::truncate);
        // Seen edge on, two corners in one: no ray that is shifted a little goes through it.
        if a == b || b == c || c == a {
            return;
        }
        // A ray through the triangle has every edge on the same side.
        let side = is_left(b, c, point);
        if side != is_left(c, a, point) || side != is_left(a, b, point) {
            return;
        }
        let weights = [
            (b - point).perp_dot(c - point),
            (c - point).perp_dot(a - point),
            (a - point).perp_dot(b - point),
        ];
        let total: f64 = weights.iter().sum();
        let w = corners.map(|corner| corner.z);
        let (low, high) = (w[0].min(w[1]).min(w[2]), w[0].max(w[1]).max(w[2]));
        let w = (w[0] * weights[0] + w[1] * weights[1] + w[2] * weights[2]) / total;
        // Where it is seen nearly edge on, the weights are rounding.
        let w = if w.is_finite() { w.clamp(low, high) } else { 0.5 * (low + high) };
        // Counter-clockwise as seen from above: a ray upward leaves.
        tell(Turn { w, winding: if side { -1 } else { 1 } });
    }
}

/// Whether the point, shifted by (e, e^2), lies to the left of the edge.
fn is_left(from: DVec2, to: DVec2, point: DVec2) -> bool {
    let coord = |p: DVec2| Coord { x: p.x, y: p.y };
    let side = orient2d(coord(from), coord(to), coord(point));
    if side != 0.0 {
        return side > 0.0;
    }
    // The derivative of the same determinant by the shift.
    if from.y != to.y { to.y < from.y } else { to.x > from.x }
}

#[cfg(test)]
mod tests {
    use rand::RngExt;
    use rand_pcg::Pcg32;

    use super::*;

    fn facet(corners: [DVec3; 3]) -> Facet {
        let [a, b, c] = corners;
        Facet { corners, area: 0.5 * (b - a).cross(c - a), uvs: [DVec2::ZERO; 3], material: 0 }
    }

    /// The turns of the ray through `point`, from below.
    fn turns(facets: &[Facet], point: DVec2) -> Vec<Turn> {
        let solid = Solid::new(facets);
        let mut turns = Vec::new();
        for part in 0..solid.parts() {
            solid.cross(part, point, &mut |turn| turns.push(turn));
        }
        turns.sort_by(|a, b| a.w.total_cmp(&b.w));
        turns
    }

    #[test]
    fn a_ray_through_a_corner_goes_in_once_and_out_once() {
        let corner = |axis: usize, sign: f64| DVec3::AXES[axis] * sign;
        let mut octahedron = Vec::new();
        for signs in 0..8 {
            let sign = |axis: u32| if signs >> axis & 1 == 0 { 1.0 } else { -1.0 };
            let [a, b, c] = [corner(0, sign(0)), corner(1, sign(1)), corner(2, sign(2))];
            let outward = sign(0) * sign(1) * sign(2) > 0.0;
            octahedron.push(facet(if outward { [a, b, c] } else { [a, c, b] }));
        }
        // Through two corners; through edges above and below; through the rim's inside.
        for (point, height) in
            [([0.0, 0.0], 1.0), ([0.25, 0.0], 0.75), ([0.0, -0.5], 0.5), ([0.25, 0.25], 0.5)]
        {
            let turns = turns(&octahedron, DVec2::from(point));
            let found: Vec<_> = turns.iter().map(|turn| (turn.w, turn.winding)).collect();
            assert_eq!(found, [(-height, 1), (height, -1)], "{point:?}");
        }
    }

    #[test]
    fn whatever_a_ray_hits_its_turns_sum_up_to_zero() {
        // Corners on a small grid, rays through its points: most hit an edge or a corner, and many triangles are seen edge on.
        let mut random = Pcg32::new(3, 3);
        let (mut hits, mut wrong_without_shift) = (0, 0);
        for _ in 0..500 {
            let [a, b, c, d] = std::array::from_fn(|_| {
                DVec3::from_array(std::array::from_fn(|_| f64::from(random.random_range(0..5))))
            });
            let facets = [[a, c, b], [a, b, d], [b, c, d], [c, a, d]].map(facet);
            for point in (0..25).map(|i| DVec2::new(f64::from(i % 5), f64::from(i / 5))) {
                let turns = turns(&facets, point);
                assert_eq!(
                    turns.iter().map(|turn| turn.winding).sum::<i32>(),
                    0,
                    "{a} {b} {c} {d} at {point}"
                );
                assert!(turns.len() == 2 || turns.is_empty(), "a tetrahedron is convex");
                hits += turns.len();
                // The test that this one must tell from the right one: edges belong to all their triangles.
                let naive = facets.iter().map(|facet| {
                    let [p, q, r] = facet.corners.map(|corner| corner.truncate() - point);
                    let sides = [p.perp_dot(q), q.perp_dot(r), r.perp_dot(p)];
                    i32::from(sides.iter().all(|&x| x >= 0.0)) - i32::from(sides.iter().all(|&x| x <= 0.0))
                });
                wrong_without_shift += usize::from(naive.sum::<i32>() != 0);
            }
        }
        assert!(hits > 1000 && wrong_without_shift > 100, "{hits} {wrong_without_shift}");
    }
}
