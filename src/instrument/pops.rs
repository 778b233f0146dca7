//! Pixels that pop: that change more between two frames than their motion explains.
//!
//! Every vertex is projected in both frames, and where the texture slides over the shell the point where its texel was before
//! (to the nearest whole turn). In a tile of 16 x 16 pixels no tetrahedron, at either time, moves by more than the tile's
//! bound; what is seen in a pixel was before within that bound of it, and one pixel more for rounding to pixels. So the pixel's
//! colour ought to be among those of that neighbourhood in the other frame: between the least and the greatest in each
//! channel, or no further beyond them than half of what is between them. That is what a wave of four pixels a period or more
//! can hide between the pixels: sampled at the worst phase both across and down, its extremes are `cos(pi / 4)^2 = 1 / 2` of
//! what they are. A pixel *pops* where it is further out by more than [`TOLERANCE`], and the frame before is not explained by the
//! frame after either: what comes into view from behind is found in no pixel before it, but takes nothing away; what is
//! replaced is unexplained in both directions. A spot that appears is seen where it is larger than the neighbourhood.
//!
//! Assumed: texture, light and transparency change by less than the tolerance from frame to frame where nothing moves; the
//! surfaces beside the shell stand still. Where the neighbourhood is wider than [`WIDEST`] or goes over the picture's edge
//! nothing is said: such pixels are not judged.

use std::sync::Arc;

use glam::{DMat3, DVec2, DVec3};
use rayon::prelude::*;
use serde::Serialize;

use super::LISTED;
use crate::frame::Image;
use crate::scene::View;
use crate::shell::Shell;

/// Of linear premultiplied RGBA, where white is 1: what fades in or out within ten frames stays below.
pub const TOLERANCE: f32 = 0.1;

/// The largest neighbourhood, in pixels to each side.
pub const WIDEST: u32 = 48;

/// Pixels along a tile's side.
const TILE: usize = 16;

/// A frame to be compared.
#[derive(Clone, Copy)]
pub struct Seen<'a> {
    /// The geometry.
    pub shell: &'a Arc<Shell>,
    /// Where from.
    pub view: &'a View,
    /// The picture.
    pub image: &'a Image,
}

/// What pops between a frame and the one that was compared before it.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Pops {
    /// The frame before.
    pub since: u32,
    /// Pixels that pop.
    pub pixels: u64,
    /// Pixels whose neighbourhood is narrow enough, and in the picture.
    pub judged: u64,
    /// By how much the worst of these is further out than it may be; at most [`TOLERANCE`] where none pops.
    pub greatest: f32,
    /// The first of those that pop, from the top left, x and y; at most [`LISTED`].
    pub first: Vec<[u32; 2]>,
}

/// Compares two frames of one size, whose shells have one topology.
pub fn pops(since: u32, before: Seen<'_>, now: Seen<'_>) -> Pops {
    let (width, height) = (now.image.width as usize, now.image.height as usize);
    let [columns, rows] = [width, height].map(|side| side.div_ceil(TILE));
    let radii = radii(before, now, [columns, rows]);
    let tiles = (0..columns * rows).into_par_iter().filter_map(|tile| {
        let radius = radii[tile]?;
        Some(compare(before.image, now.image, [tile % columns, tile / columns].map(|at| at * TILE), radius))
    });
    let tiles: Vec<Tile> = tiles.collect();
    let mut popping: Vec<[u32; 2]> = tiles.iter().flat_map(|tile| tile.popping.iter().copied()).collect();
    popping.sort_unstable_by_key(|&[x, y]| [y, x]);
    Pops {
        since,
        pixels: popping.len() as u64,
        judged: tiles.iter().map(|tile| tile.judged).sum(),
        greatest: tiles.iter().map(|tile| tile.greatest).fold(0.0, f32::max),
        first: popping.into_iter().take(LISTED).collect(),
    }
}

/// The reach of each tile's neighbourhood in pixels; `None` where it is too wide.
fn radii(before: Seen<'_>, now: Seen<'_>, [columns, rows]: [usize; 2]) -> Vec<Option<u32>> {
    let mut bounds = vec![0.0_f64; columns * rows];
    let same_shell = Arc::ptr_eq(before.shell, now.shell) && before.view == now.view;
    let moving = if same_shell { 0 } else { now.shell.cells.len() };
    let eyes = [before.view, now.view].map(Eye::of);
    let paths =
        (0..moving).into_par_iter().map(|t| path(before.shell, now.shell, &eyes, t)).collect::<Vec<_>>();
    for Path { low, high, motion } in paths.into_iter().flatten() {
        // The filter's footprint is about a pixel.
        let tile = |at: f64, count: usize| ((at / TILE as f64).max(0.0) as usize).min(count);
        let (left, right) = (tile(low.x - 1.0, columns), tile(high.x + 1.0 + TILE as f64, columns));
        let (top, bottom) = (tile(low.y - 1.0, rows), tile(high.y + 1.0 + TILE as f64, rows));
        for row in top..bottom {
            for bound in &mut bounds[row * columns + left..row * columns + right.max(left)] {
                *bound = bound.max(motion);
            }
        }
    }
    let radius = |bound: f64| bound.ceil() + 1.0;
    bounds.into_iter().map(|b| (radius(b) <= f64::from(WIDEST)).then(|| radius(b) as u32)).collect()
}

/// Where a tetrahedron is in the picture at either time, and how far its vertices move, in pixels.
struct Path {
    low: DVec2,
    high: DVec2,
    motion: f64,
}

/// `None` for what is behind the eye at both times.
fn path(before: &Shell, now: &Shell, eyes: &[Eye; 2], t: usize) -> Option<Path> {
    let (old, new) = (before.vertices_of(t), now.vertices_of(t));
    let slid = slid(before, now, t);
    let old: [DVec3; 4] = std::array::from_fn(|k| old[k] + slid[k]);
    let places =
        [old, new].into_iter().zip(eyes).map(|(corners, eye)| corners.map(|corner| eye.place(corner)));
    let places: Vec<[Option<DVec2>; 4]> = places.collect();
    if places.iter().flatten().all(Option::is_none) {
        return None;
    }
    let Some(all) = places.iter().flatten().copied().collect::<Option<Vec<DVec2>>>() else {
        // It passes by the eye: it may be anywhere, and move by any length.
        return Some(Path { low: DVec2::ZERO, high: DVec2::INFINITY, motion: f64::INFINITY });
    };
    let low = all.iter().copied().fold(DVec2::INFINITY, DVec2::min);
    let high = all.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max);
    let motion = (0..4).map(|k| (all[k] - all[k + 4]).abs().max_element()).fold(0.0, f64::max);
    Some(Path { low, high, motion })
}

/// From each vertex to where, in the frame before, the texel lay that is at the vertex now; world space.
fn slid(before: &Shell, now: &Shell, t: usize) -> [DVec3; 4] {
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
    frame: crate::scene::camera::CameraFrame,
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

/// What was found in a tile.
struct Tile {
    popping: Vec<[u32; 2]>,
    judged: u64,
    greatest: f32,
}

fn compare(before: &Image, now: &Image, [left, top]: [usize; 2], radius: u32) -> Tile {
    let [width, height, radius] = [now.width, now.height, radius].map(|side| side as usize);
    let mut tile = Tile { popping: Vec::new(), judged: 0, greatest: 0.0 };
    let forth = Ranges::of(before, [left, top], radius);
    let back = Ranges::of(now, [left, top], radius);
    for y in top.max(radius)..(top + TILE).min(height.saturating_sub(radius)) {
        for x in left.max(radius)..(left + TILE).min(width.saturating_sub(radius)) {
            tile.judged += 1;
            let pixel = y * width + x;
            let at = [x - left, y - top];
            let beyond = forth.beyond(at, now.rgba[pixel]).min(back.beyond(at, before.rgba[pixel]));
            tile.greatest = tile.greatest.max(beyond);
            if beyond > TOLERANCE {
                tile.popping.push([x as u32, y as u32]);
            }
        }
    }
    tile
}

/// The least and the greatest of each channel around the pixels of a tile.
struct Ranges([[[f32; 4]; 2]; TILE * TILE]);

impl Ranges {
    /// First along the rows, then down the columns; what is beyond the picture is left out.
    fn of(image: &Image, [left, top]: [usize; 2], radius: usize) -> Self {
        let [width, height] = [image.width, image.height].map(|side| side as usize);
        let rows = top.saturating_sub(radius)..(top + TILE + radius).min(height);
        let around = |at: usize, end: usize| at.saturating_sub(radius)..(at + radius + 1).min(end);
        let along: Vec<[[f32; 4]; 2]> = rows
            .clone()
            .flat_map(|y| (left..left + TILE).map(move |x| (x, y)))
            .map(|(x, y)| {
                let pixels = around(x, width).map(|x| image.rgba[y * width + x]);
                pixels.fold(NONE, |range, pixel| joined(range, [pixel, pixel]))
            })
            .collect();
        let mut ranges = [NONE; TILE * TILE];
        for (i, range) in ranges.iter_mut().enumerate() {
            let (x, y) = (i % TILE, top + i / TILE);
            let near = around(y, height).map(|y| along[(y - rows.start) * TILE + x]);
            *range = near.fold(NONE, joined);
        }
        Self(ranges)
    }

    /// How much further out a colour is than it may be; not positive for one that is explained.
    fn beyond(&self, [x, y]: [usize; 2], colour: [f32; 4]) -> f32 {
        let [low, high] = self.0[y * TILE + x];
        let beyond = (0..4).map(|i| {
            let slack = 0.5 * (high[i] - low[i]);
            (colour[i] - high[i]).max(low[i] - colour[i]) - slack
        });
        beyond.fold(f32::NEG_INFINITY, f32::max)
    }
}

const NONE: [[f32; 4]; 2] = [[f32::INFINITY; 4], [f32::NEG_INFINITY; 4]];

fn joined([low, high]: [[f32; 4]; 2], [other_low, other_high]: [[f32; 4]; 2]) -> [[f32; 4]; 2] {
    [std::array::from_fn(|i| low[i].min(other_low[i])), std::array::from_fn(|i| high[i].max(other_high[i]))]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::instrument::tests::{moved, torus};
    use crate::scene::Camera;

    const SIDE: u32 = 96;

    /// A wave of eight pixels a period, shifted across.
    fn stripes(shift: f32) -> Image {
        let mut image = Image::new(SIDE, SIDE);
        for (i, pixel) in image.rgba.iter_mut().enumerate() {
            let wave = (std::f32::consts::TAU * ((i as u32 % SIDE) as f32 - shift) / 8.0).sin();
            *pixel = [0.5 + 0.5 * wave, 0.2, 0.2 + 0.1 * wave, 1.0];
        }
        image
    }

    /// A part of the ring that fills the picture.
    fn view(shell: &Shell) -> View {
        let camera = Camera { target: DVec3::X, fov_y: 0.1, ..Camera::framing(&shell.vertices) };
        View { camera, width: SIDE, height: SIDE, depth: false }
    }

    #[test]
    fn what_moves_with_the_shell_does_not_pop_and_what_is_replaced_does() {
        let before = Arc::new(torus(0.1));
        let view = view(&before);
        let step = 2.3 * view.pixel_at_unit_depth() * view.camera.eye.distance(view.camera.target);
        let right = view.camera.frame().right;
        let now = Arc::new(moved(&before, |p| p + step * right));
        let (first, second) = (stripes(0.0), stripes(2.3));
        let seen = |shell, image| Seen { shell, view: &view, image };
        let found = pops(7, seen(&before, &first), seen(&now, &second));
        assert_eq!((found.since, found.pixels), (7, 0), "{found:?}");
        // Neighbourhoods are some 4 pixels wide: the rest is judged.
        assert!(found.judged > 80 * 80, "{found:?}");

        let mut popped = second.clone();
        let (spot, is_in) = (40..56, |at: u32| (40..56).contains(&at));
        for (i, pixel) in popped.rgba.iter_mut().enumerate() {
            if is_in(i as u32 % SIDE) && is_in(i as u32 / SIDE) {
                *pixel = [0.1, 0.9, 0.9, 1.0];
            }
        }
        let found = pops(7, seen(&before, &first), seen(&now, &popped));
        // All of the spot but a rim as wide as the neighbourhood, where the stripes are still near.
        assert!(found.pixels >= 6 * 6 && found.pixels <= 16 * 16, "{found:?}");
        assert!(found.first.iter().flatten().all(|at| spot.contains(at)) && found.greatest > 0.3);
    }

    #[test]
    fn a_shell_that_stands_still_has_the_least_neighbourhood() {
        let shell = Arc::new(torus(0.1));
        let view = view(&shell);
        let (image, other) = (stripes(0.0), stripes(4.0));
        let seen = |image| Seen { shell: &shell, view: &view, image };
        assert_eq!(pops(1, seen(&image), seen(&image)).pixels, 0);
        assert!(pops(1, seen(&image), seen(&other)).pixels > 1000, "crests take the place of troughs");
        assert_eq!(pops(1, seen(&image), seen(&image)).judged, u64::from(SIDE - 2).pow(2));
    }

    #[test]
    fn a_texture_that_slides_moves() {
        let before = Arc::new(torus(0.1));
        let mut slid = (*before).clone();
        for corners in &mut slid.texture {
            *corners = corners.map(|t| t + DVec3::new(1.0 / 32.0, 0.0, 0.0));
        }
        // Half the 16th part of a turn, whose chord along the inner equator is 2 (0.75) sin(pi / 16).
        let chord = 0.75 * (std::f64::consts::PI / 16.0).sin();
        let lengths: Vec<f64> =
            (0..slid.cells.len()).flat_map(|t| super::slid(&before, &slid, t)).map(DVec3::length).collect();
        assert!(lengths.iter().any(|length| (length - chord).abs() < 1e-9), "{chord} {:?}", &lengths[..12]);
        assert!(lengths.iter().all(|&length| length > 0.0 && length < 3.0 * chord));
    }

    #[test]
    fn nothing_is_said_of_what_moves_too_far() {
        let before = Arc::new(torus(0.1));
        let view = view(&before);
        let now = Arc::new(moved(&before, |p| p + view.camera.frame().right));
        let image = stripes(0.0);
        let found = pops(
            1,
            Seen { shell: &before, view: &view, image: &image },
            Seen { shell: &now, view: &view, image: &stripes(1.0) },
        );
        assert!(found.judged < 60 * 60, "{found:?}");
    }
}
