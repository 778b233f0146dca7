//! How what is seen in each tile of a picture moves from one frame to the next, for those who look for pixels that [pop](super::pops).

use std::ops::RangeInclusive;
use std::sync::Arc;

use glam::{DMat3, DVec2, DVec3};
use rayon::prelude::*;

use super::fold::thickness;
use super::pops::{Seen, TILE, WIDEST};
use crate::scene::View;
use crate::scene::camera::CameraFrame;
use crate::shell::Shell;

/// A pixel of this alpha hides what is behind it.
const OPAQUE: f32 = 0.98;

/// A box of vectors, from a frame to the next, in pixels; empty where `low` is above `high`.
#[derive(Clone, Copy)]
pub(super) struct Motion {
    low: DVec2,
    pub(super) high: DVec2,
}

impl Motion {
    const NONE: Self = Self { low: DVec2::INFINITY, high: DVec2::NEG_INFINITY };
    const REST: Self = Self { low: DVec2::ZERO, high: DVec2::ZERO };

    fn and(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// `None` where it is too wide to tell anything.
    pub(super) fn reach(self) -> Option<Reach> {
        let Self { low, high } = if self.low.x <= self.high.x { self } else { Self::REST };
        if (high - low).max_element() + 4.0 > WIDEST as f64 || !(low.is_finite() && high.is_finite()) {
            return None;
        }
        let axis = |low: f64, high: f64| {
            let (low, high) = (low.floor() as i64, high.ceil() as i64);
            let middle = (low + high).div_euclid(2);
            [-high - 1..=-low + 1, -middle..=-middle, low - middle - 1..=high - middle + 1]
        };
        let [x, y] = [axis(low.x, high.x), axis(low.y, high.y)];
        let [[from_x, place_x, to_x], [from_y, place_y, to_y]] = [x, y];
        Some(Reach { from: [from_x, from_y], place: [*place_x.start(), *place_y.start()], to: [to_x, to_y] })
    }
}

/// The neighbourhoods of the pixels of a tile, relative to the pixel.
pub(super) struct Reach {
    /// In the frame before, of what is seen now.
    pub(super) from: [RangeInclusive<i64>; 2],
    /// In the frame before, what was most likely there.
    pub(super) place: [i64; 2],
    /// In the frame now, of what was at `place`.
    pub(super) to: [RangeInclusive<i64>; 2],
}

/// How what is seen in each tile moves.
pub(super) fn motions(before: Seen<'_>, now: Seen<'_>, grid @ [columns, rows]: [usize; 2]) -> Vec<Motion> {
    let seen = [before, now];
    let depths = seen.map(|seen| deepest(seen, grid));
    let has_solids = seen.iter().any(|seen| seen.has_solids);
    let hides = |tile: usize| !has_solids && depths.iter().all(|depths| depths[tile].is_finite());
    let start = |tile: usize| if hides(tile) { Motion::NONE } else { Motion::REST };
    let mut motions: Vec<Motion> = (0..columns * rows).map(start).collect();
    let stands_still = Arc::ptr_eq(before.shell, now.shell) && before.view == now.view;
    let count = if stands_still { 0 } else { now.shell.topology.tetrahedra.len() };
    let eyes = seen.map(|seen| Eye::of(seen.view));
    let thickness = seen.map(|seen| thickness(seen.shell).greatest);
    let paths =
        (0..count).into_par_iter().map(|t| path(before.shell, now.shell, &eyes, t)).collect::<Vec<_>>();
    for Path { low, high, motion, nearest } in paths.into_iter().flatten() {
        // The filter's footprint is about a pixel.
        let tile = |at: f64, count: usize| ((at / TILE as f64).max(0.0) as usize).min(count);
        let columns_met = tile(low.x - 1.0, columns)..tile(high.x + 1.0 + TILE as f64, columns);
        let rows_met = tile(low.y - 1.0, rows)..tile(high.y + 1.0 + TILE as f64, rows);
        for tile in rows_met.flat_map(|row| columns_met.clone().map(move |column| row * columns + column)) {
            let is_hidden = |i: usize| nearest[i] > depths[i][tile] + thickness[i];
            if !(hides(tile) && is_hidden(0) && is_hidden(1)) {
                motions[tile] = motions[tile].and(motion);
            }
        }
    }
    motions
}

/// The depth of the deepest pixel of each tile; infinite where one is not opaque.
fn deepest(seen: Seen<'_>, [columns, rows]: [usize; 2]) -> Vec<f64> {
    let mut depths = vec![0.0_f64; columns * rows];
    let width = seen.image.width as usize;
    for (pixel, ([.., alpha], depth)) in seen.image.rgba.iter().zip(seen.depth).enumerate() {
        let tile = pixel / width / TILE * columns + pixel % width / TILE;
        depths[tile] = depths[tile].max(if *alpha >= OPAQUE { f64::from(*depth) } else { f64::INFINITY });
    }
    depths
}

/// Where a tetrahedron is in the picture at either time, and how its vertices move.
struct Path {
    low: DVec2,
    high: DVec2,
    motion: Motion,
    /// The distance of its nearest vertex from the eye, before and now.
    nearest: [f64; 2],
}

/// `None` for what is behind the eye at both times.
fn path(before: &Shell, now: &Shell, eyes: &[Eye; 2], t: usize) -> Option<Path> {
    let (old, new) = (before.vertices_of(t), now.vertices_of(t));
    let slid = slid(before, now, t);
    let came: [DVec3; 4] = std::array::from_fn(|k| old[k] + slid[k]);
    let [from, to] =
        [(came, &eyes[0]), (new, &eyes[1])].map(|(corners, eye)| corners.map(|corner| eye.place(corner)));
    if from.iter().chain(&to).all(Option::is_none) {
        return None;
    }
    let nearest = [(old, &eyes[0]), (new, &eyes[1])].map(|(corners, eye)| {
        corners.into_iter().map(|corner| corner.distance(eye.view.camera.eye)).fold(f64::INFINITY, f64::min)
    });
    let mut path = Path { low: DVec2::INFINITY, high: DVec2::NEG_INFINITY, motion: Motion::NONE, nearest };
    for (from, to) in from.into_iter().zip(to) {
        let (Some(from), Some(to)) = (from, to) else {
            // It passes by the eye: it may be anywhere, and move by any length.
            let motion = Motion { low: DVec2::NEG_INFINITY, high: DVec2::INFINITY };
            return Some(Path { low: DVec2::ZERO, high: DVec2::INFINITY, motion, nearest: [0.0; 2] });
        };
        path.low = path.low.min(from).min(to);
        path.high = path.high.max(from).max(to);
        path.motion = path.motion.and(Motion { low: to - from, high: to - from });
    }
    Some(path)
}

/// From each vertex to where, in the frame before, the texel lay that is at the vertex now; world space.
pub(super) fn slid(before: &Shell, now: &Shell, t: usize) -> [DVec3; 4] {
    let (old, new) = (before.texture[t], now.texture[t]);
    let by: [DVec3; 4] = std::array::from_fn(|k| {
        let difference = new[k] - old[k];
        difference - difference.round()
    });
    if by.iter().all(|by| by.abs().max_element() < 1e-12) {
        return [DVec3::ZERO; 4];
    }
    let [a, b, c, d] = old;
    let [x, y, z, w] = before.vertices_of(t);
    let world_from_texture =
        DMat3::from_cols(y - x, z - x, w - x) * DMat3::from_cols(b - a, c - a, d - a).inverse();
    by.map(|by| world_from_texture * by).map(|by| if by.is_finite() { by } else { DVec3::ZERO })
}

/// Projects.
struct Eye {
    view: View,
    frame: CameraFrame,
}

impl Eye {
    fn of(view: &View) -> Self {
        Self { view: *view, frame: view.camera.frame() }
    }

    /// In pixels from the top left; `None` for what is too near to be seen.
    fn place(&self, point: DVec3) -> Option<DVec2> {
        let Self { view, frame } = self;
        let from_eye = point - view.camera.eye;
        let depth = from_eye.dot(frame.forward);
        (depth > view.camera.near).then(|| {
            let across = DVec2::new(from_eye.dot(frame.right), -from_eye.dot(frame.up)) / depth;
            0.5 * DVec2::new(f64::from(view.width), f64::from(view.height))
                + across / view.pixel_at_unit_depth()
        })
    }
}
