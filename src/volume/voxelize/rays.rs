//! How much of each texel is filled: rays along w, each with the exact depths at which it enters and leaves.
//!
//! A texel is seen by [`RAYS`] rays at the points of a Fibonacci lattice, which leaves no gaps in any direction and has as many
//! different places along u and along v as points; along w coverage is exact. Of a half-space whose border is a plane of
//! constant u or v coverage errs by at most `1 / (2 RAYS)`.

use glam::DVec2;

use super::{Grid, LEAST_COVERAGE};

/// Rays through a texel; a Fibonacci number.
pub(super) const RAYS: usize = 89;

/// The Fibonacci number before it.
const BEFORE: usize = 55;

/// What a ray enters and leaves.
pub(super) trait Filling: Sync {
    /// The number of its parts.
    fn parts(&self) -> usize;

    /// A part's bounding box across the rays, lower and upper corner.
    fn bounds(&self, part: usize) -> [DVec2; 2];

    /// Tells where the ray through `point`, which lies in the part's box, enters (by positive numbers) and leaves (by negative
    /// ones). Over all parts a ray's turns sum up to 0; it is inside where those before do not.
    fn cross(&self, part: usize, point: DVec2, tell: &mut dyn FnMut(Turn));
}

/// A surface that a ray goes through.
#[derive(Clone, Copy)]
pub(super) struct Turn {
    pub w: f64,
    pub winding: i32,
}

/// The filled part of each texel, 0 to 1, in the order of a volume.
pub(super) fn coverage(grid: &Grid, filling: &impl Filling) -> Vec<f32> {
    let boxes: Vec<[DVec2; 2]> = (0..filling.parts()).map(|part| filling.bounds(part)).collect();
    let rows = grid.rows(boxes.iter().map(|[low, high]| [low.y, high.y]));
    let lattice = lattice();
    let covered = grid.fill(|v, lengths: &mut [f64]| {
        let mut turns: Vec<(usize, Turn)> = Vec::new();
        for &(part, row) in &rows[v] {
            let [low, high] = boxes[part];
            for column in low.x.floor() as i64..=high.x.floor() as i64 {
                let Some(u) = grid.wrapped(0, column) else { continue };
                for (ray, &within) in lattice.iter().enumerate() {
                    let point = DVec2::new(column as f64, row as f64) + within;
                    if point.cmpge(low).all() && point.cmple(high).all() {
                        filling.cross(part, point, &mut |turn| turns.push((u * RAYS + ray, turn)));
                    }
                }
            }
        }
        // By their content alone, so that the order of the parts does not matter.
        turns.sort_unstable_by(|(a, m), (b, n)| {
            a.cmp(b).then(m.w.total_cmp(&n.w)).then(m.winding.cmp(&n.winding))
        });
        for ray in turns.chunk_by(|(a, _), (b, _)| a == b) {
            let u = ray[0].0 / RAYS;
            let (mut winding, mut entered) = (0, 0.0);
            for (_, turn) in ray {
                let before = winding;
                winding += turn.winding;
                if before == 0 {
                    entered = turn.w;
                } else if winding == 0 {
                    add_length(lengths, grid.size[0], u, entered, turn.w);
                }
            }
        }
    });
    let part = |length: &f64| {
        let part = length / RAYS as f64;
        if part < LEAST_COVERAGE { 0.0 } else { part.min(1.0) as f32 }
    };
    covered.iter().map(part).collect()
}

/// Points of the unit square.
fn lattice() -> [DVec2; RAYS] {
    std::array::from_fn(|i| {
        let place = |index: usize| ((index % RAYS) as f64 + 0.5) / RAYS as f64;
        DVec2::new(place(i), place(i * BEFORE))
    })
}

/// Adds to each texel of column `u` its part of the way from `enter` to `leave`; a whole texel adds exactly 1.
fn add_length(lengths: &mut [f64], width: usize, u: usize, enter: f64, leave: f64) {
    let depth = (lengths.len() / width) as f64;
    let (enter, leave) = (enter.clamp(0.0, depth), leave.clamp(0.0, depth));
    for w in enter as usize..leave.ceil() as usize {
        let texel = w as f64;
        lengths[w * width + u] += leave.min(texel + 1.0) - enter.max(texel);
    }
}
