//! Pixels that pop: that change more between two frames than their motion explains.
//!
//! Every vertex is projected in both frames, and where the texture slides over the shell the point where its texel was before
//! (to the nearest whole turn). The motions of the tetrahedra that are seen in a tile of 16 x 16 pixels, at either time, make a
//! box of vectors; what is seen in a pixel was before at the pixel less one of these, and one pixel more for rounding to
//! pixels. So the pixel's colour ought to be among those of that neighbourhood in the other frame: between the least and the
//! greatest in each channel, or no further beyond them than half of what is between them. That is what a wave of four pixels a
//! period or more can hide between the pixels: sampled at the worst phase both across and down, its extremes are
//! `cos(pi / 4)^2 = 1 / 2` of what they are. A pixel *pops* where it is further out by more than [`TOLERANCE`], and what was there
//! before is not explained by the frame after either: what comes into view from behind is found in no pixel before it, but
//! takes nothing away; what is replaced is unexplained in both directions. A spot that appears is seen where it is larger
//! than the neighbourhood.
//!
//! In a tile that is opaque all over at both times, and where there are no surfaces beside the shell, no tetrahedron is seen that
//! begins deeper than the mean depth at which light was stopped in any of its pixels by more than the shell is thick. In other
//! tiles all are seen, and the background, which stands still, too.
//!
//! Assumed: texture, light and transparency change by less than the tolerance from frame to frame where nothing moves; the
//! surfaces beside the shell stand still. Where the neighbourhood is wider than [`WIDEST`] or goes over the picture's edge
//! nothing is said: such pixels are not judged.

use std::ops::RangeInclusive;
use std::sync::Arc;

use rayon::prelude::*;
use serde::Serialize;

use super::LISTED;
use super::motion::{Reach, motions};
use crate::frame::Image;
use crate::scene::View;
use crate::shell::Shell;

/// Of linear premultiplied RGBA, where white is 1: what fades in or out within ten frames stays below.
pub const TOLERANCE: f32 = 0.1;

/// The widest and highest neighbourhood, in pixels.
pub const WIDEST: i64 = 96;

/// Pixels along a tile's side.
pub(super) const TILE: usize = 16;

/// A frame to be compared.
#[derive(Clone, Copy)]
pub struct Seen<'a> {
    /// The geometry.
    pub shell: &'a Arc<Shell>,
    /// Where from.
    pub view: &'a View,
    /// The picture.
    pub image: &'a Image,
    /// Of each pixel, as in [`Frame::depth`](crate::frame::Frame::depth).
    pub depth: &'a [f32],
    /// Whether there are surfaces beside the shell.
    pub has_solids: bool,
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
    let grid = [width, height].map(|side| side.div_ceil(TILE));
    let motions = motions(before, now, grid);
    let tiles = motions.into_par_iter().enumerate().filter_map(|(tile, motion)| {
        let at = [tile % grid[0], tile / grid[0]].map(|at| at * TILE);
        motion.reach().map(|reach| compare(before.image, now.image, at, &reach))
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

/// What was found in a tile.
struct Tile {
    popping: Vec<[u32; 2]>,
    judged: u64,
    greatest: f32,
}

fn compare(before: &Image, now: &Image, [left, top]: [usize; 2], reach: &Reach) -> Tile {
    let [width, height] = [now.width, now.height].map(|side| side as usize);
    let mut tile = Tile { popping: Vec::new(), judged: 0, greatest: 0.0 };
    let from = Ranges::of(before, [left, top], &reach.from);
    let to = Ranges::of(now, [left, top], &reach.to);
    let is_inside = |at: usize, axis: usize, end: usize| {
        let [from, to] = [&reach.from[axis], &reach.to[axis]];
        let low = reach.place[axis].min(*from.start()).min(*to.start());
        let high = reach.place[axis].max(*from.end()).max(*to.end());
        at as i64 + low >= 0 && at as i64 + high < end as i64
    };
    for y in (top..(top + TILE).min(height)).filter(|&y| is_inside(y, 1, height)) {
        for x in (left..(left + TILE).min(width)).filter(|&x| is_inside(x, 0, width)) {
            tile.judged += 1;
            let at = [x - left, y - top];
            let [old_x, old_y] = [x as i64 + reach.place[0], y as i64 + reach.place[1]].map(|at| at as usize);
            let (colour, old) = (now.rgba[y * width + x], before.rgba[old_y * width + old_x]);
            let beyond = from.beyond(at, colour).min(to.beyond(at, old));
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
    fn of(image: &Image, [left, top]: [usize; 2], [across, down]: &[RangeInclusive<i64>; 2]) -> Self {
        let [width, height] = [image.width, image.height].map(|side| side as usize);
        let inside = |at: i64, end: usize| at.clamp(0, end as i64) as usize;
        let around = |at: usize, range: &RangeInclusive<i64>, end: usize| {
            inside(at as i64 + range.start(), end)..inside(at as i64 + range.end() + 1, end)
        };
        let first_row = inside(top as i64 + down.start(), height);
        let rows = first_row..inside((top + TILE) as i64 + down.end(), height);
        let along: Vec<[[f32; 4]; 2]> = rows
            .flat_map(|y| (left..left + TILE).map(move |x| (x, y)))
            .map(|(x, y)| {
                let pixels = around(x, across, width).map(|x| image.rgba[y * width + x]);
                pixels.fold(NONE, |range, pixel| joined(range, [pixel, pixel]))
            })
            .collect();
        let mut ranges = [NONE; TILE * TILE];
        for (i, range) in ranges.iter_mut().enumerate() {
            let (x, y) = (i % TILE, top + i / TILE);
            let near = around(y, down, height).map(|y| along[(y - first_row) * TILE + x]);
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
    use glam::DVec3;

    use super::*;
    use crate::instrument::motion;
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

    /// All is seen, however deep.
    fn depths() -> Vec<f32> {
        vec![100.0; (SIDE * SIDE) as usize]
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
        let depth = depths();
        let seen = |shell, image| Seen { shell, view: &view, image, depth: &depth, has_solids: false };
        let found = pops(7, seen(&before, &first), seen(&now, &second));
        assert_eq!((found.since, found.pixels), (7, 0), "{found:?}");
        // Neighbourhoods reach some 4 pixels: the rest is judged.
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
        let depth = depths();
        let seen = |image| Seen { shell: &shell, view: &view, image, depth: &depth, has_solids: false };
        assert_eq!(pops(1, seen(&image), seen(&image)).pixels, 0);
        assert!(pops(1, seen(&image), seen(&other)).pixels > 1000, "crests take the place of troughs");
        assert_eq!(pops(1, seen(&image), seen(&image)).judged, u64::from(SIDE - 2).pow(2));
    }

    #[test]
    fn a_texture_that_slides_moves() {
        let before = Arc::new(torus(0.1));
        let mut slid = (*before).clone();
        for corners in Arc::make_mut(&mut slid.texture) {
            *corners = corners.map(|t| t + DVec3::new(1.0 / 32.0, 0.0, 0.0));
        }
        // Half the 16th part of a turn, whose chord along the inner equator is 2 (0.75) sin(pi / 16).
        let chord = 0.75 * (std::f64::consts::PI / 16.0).sin();
        let lengths: Vec<f64> = (0..slid.topology.tetrahedra.len())
            .flat_map(|t| motion::slid(&before, &slid, t))
            .map(DVec3::length)
            .collect();
        assert!(lengths.iter().any(|length| (length - chord).abs() < 1e-9), "{chord} {:?}", &lengths[..12]);
        assert!(lengths.iter().all(|&length| length > 0.0 && length < 3.0 * chord));
    }

    #[test]
    fn a_pan_is_followed_however_long() {
        let before = Arc::new(torus(0.1));
        let view = view(&before);
        let step = 20.0 * view.pixel_at_unit_depth() * view.camera.eye.distance(view.camera.target);
        let now = Arc::new(moved(&before, |p| p + step * view.camera.frame().right));
        let (first, second, depth) = (stripes(0.0), stripes(20.0), depths());
        let seen = |shell, image| Seen { shell, view: &view, image, depth: &depth, has_solids: false };
        let found = pops(1, seen(&before, &first), seen(&now, &second));
        assert!(found.pixels == 0 && found.judged > 60 * 80, "{found:?}");
        let mut replaced = second.clone();
        replaced.rgba.iter_mut().for_each(|pixel| *pixel = [0.1, 0.9, 0.9, 1.0]);
        assert_eq!(pops(1, seen(&before, &first), seen(&now, &replaced)).pixels, found.judged);
    }

    #[test]
    fn what_an_opaque_surface_hides_moves_unseen() {
        let before = Arc::new(torus(0.1));
        let view = view(&before);
        let [eye, middle] = [view.camera.eye, view.camera.target];
        let (distance, frame) = (eye.distance(middle), view.camera.frame());
        let step = 10.0 * view.pixel_at_unit_depth() * distance;
        let behind = |p: DVec3| (p - middle).dot(frame.forward) > 0.0;
        let now = Arc::new(moved(&before, |p| if behind(p) { p + step * frame.right } else { p }));
        let image = stripes(0.0);
        let widest = |depth: f64| {
            let depth = vec![depth as f32; (SIDE * SIDE) as usize];
            let seen = |shell| Seen { shell, view: &view, image: &image, depth: &depth, has_solids: false };
            // The tile around the middle.
            motions(seen(&before), seen(&now), [6, 6])[3 * 6 + 3].high.x
        };
        assert!(widest(distance + 1.0) > 9.0);
        // Tetrahedra are up to 0.55 long, along the ring: none that reaches behind the middle begins before that.
        assert!(widest(distance - 0.7) < 0.1, "{}", widest(distance - 0.7));
    }

    #[test]
    fn nothing_is_said_of_what_moves_too_far() {
        let before = Arc::new(torus(0.1));
        let view = view(&before);
        let now = Arc::new(moved(&before, |p| p + 2.0 * view.camera.frame().right * p.y));
        let (first, second, depth) = (stripes(0.0), stripes(1.0), depths());
        let seen = |shell, image| Seen { shell, view: &view, image, depth: &depth, has_solids: false };
        let found = pops(1, seen(&before, &first), seen(&now, &second));
        assert!(found.judged < 60 * 60, "{found:?}");
    }
}
