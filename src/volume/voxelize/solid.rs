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
        // Those of three that agree are the triangle's own orientation: a ray in it has each edge on the same side.
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
        // Seen edge on, all weights are rounding.
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
