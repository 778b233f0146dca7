//! How far the nearest texel that is unlike most others is from each place in a texture: so far a ray need not look. D. Cohen, Z.
//! Sheffer, *Proximity clouds, an acceleration technique for 3D grid traversal*, 1994; distances are those of the greatest axis. What
//! most are like may be nothing, or a medium that is the same everywhere (J. Freund, K. Sloan, *Accelerated volume rendering using
//! homogeneous region encoding*, 1997).

use std::collections::HashMap;

use rayon::prelude::*;

use super::{Directions, Pyramid, Quantity, Volume};

/// No distance is more, in texels: two fit into a byte. Longer leaps save little: each spares but one more look.
const FARTHEST: u8 = 15;

/// Of a distance.
const BITS: u32 = 4;

/// Distances of places to what is unlike the rest, for each level of a [`Pyramid`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Proximity {
    /// From the level of the full volume on.
    pub levels: Vec<ProximityLevel>,
}

/// The distances at one level of detail.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ProximityLevel {
    /// As that of the level: texels along u, v, w.
    pub size: [u32; 3],
    /// Of each texel's box, u fastest, then v, then w: 0 where a sample in it may read a texel unlike the rest; else the distance, in
    /// texels of this level along the axis where it is greatest, of the nearest box where one may. u and v repeat. At most 15, also where
    /// there is none. In the low four bits of samples of this level alone; in the high ones of those of this and the next coarser, or
    /// the next finer and this.
    pub distances: Vec<u8>,
}

/// A number for each box of a grid, u fastest.
type Boxes = Vec<u8>;

impl Proximity {
    /// Of all levels of `pyramid`, to the texels that are unlike `rest`, or that have a direction.
    pub fn new(pyramid: &Pyramid, directions: Option<&Directions>, rest: [f32; 4]) -> Self {
        let level_of_directions =
            |level: usize| directions.map(|directions| &*directions.levels[level].texels);
        let levels = pyramid.levels.iter().enumerate();
        let unlike: Vec<Boxes> =
            levels.map(|(level, volume)| unlike(volume, level_of_directions(level), rest)).collect();
        let levels = 0..pyramid.levels.len();
        let levels = levels.map(|level| {
            let size = pyramid.levels[level].size;
            let within = |other: usize| reached(&unlike[other], pyramid.levels[other].size, size);
            let alone = within(level);
            let mut near = alone.clone();
            let beside = [level.checked_sub(1), Some(level + 1).filter(|&next| next < pyramid.levels.len())];
            for other in beside.into_iter().flatten() {
                near.iter_mut().zip(within(other)).for_each(|(near, within)| *near |= within);
            }
            let mut distances = distances(&alone, size);
            let blended = self::distances(&near, size);
            distances.iter_mut().zip(blended).for_each(|(alone, blended)| *alone |= blended << BITS);
            ProximityLevel { size, distances }
        });
        Self { levels: levels.collect() }
    }

    /// The part, 0..1, of the full volume's boxes in which all of it is like the rest.
    pub fn part(&self) -> f64 {
        let distances = &self.levels[0].distances;
        distances.iter().filter(|distance| **distance & FARTHEST > 0).count() as f64 / distances.len() as f64
    }
}

/// Whether two texels are the same but for the rounding of means: levels of detail are those of the ones before, by f64, each rounded
/// to f32. Beyond nine of them less may be found to be like the rest than is.
fn is_like(texel: &[f32; 4], rest: &[f32; 4]) -> bool {
    texel.iter().zip(rest).all(|(a, b)| (a - b).abs() <= 9.0 * f32::EPSILON * b)
}

/// The part, 0..1, of a volume's texels that are like `rest`.
pub fn part_like(volume: &Volume, rest: [f32; 4]) -> f64 {
    let like = volume.texels.par_iter().filter(|texel| is_like(texel, &rest)).count();
    like as f64 / volume.texels.len() as f64
}

/// The texel that most others are like, of those that are seen and let something through: of all, or of some thousands that lie as far
/// apart; `None` where there is none.
pub fn commonest(volume: &Volume) -> Option<[f32; 4]> {
    let stride = (volume.texels.len() / 4096).max(1) | 1;
    let mut counts = HashMap::new();
    let lets_through = |alpha: f32| volume.quantity == Quantity::Extinction || alpha < 1.0;
    let some = volume.texels.iter().step_by(stride).filter(|texel| texel[3] > 0.0 && lets_through(texel[3]));
    some.for_each(|texel| *counts.entry(texel.map(f32::to_bits)).or_insert(0) += 1);
    let most = counts.into_iter().max_by_key(|&(texel, count)| (count, texel));
    most.map(|(texel, _)| texel.map(f32::from_bits))
}

/// Where a texel is unlike `rest`, or has a direction.
fn unlike(level: &Volume, directions: Option<&[[f32; 4]]>, rest: [f32; 4]) -> Boxes {
    let mut unlike: Boxes = level.texels.par_iter().map(|texel| u8::from(!is_like(texel, &rest))).collect();
    if let Some(directions) = directions {
        unlike
            .par_iter_mut()
            .zip(directions)
            .for_each(|(unlike, direction)| *unlike |= u8::from(direction[3] != 0.0));
    }
    unlike
}

/// For boxes of a grid of `size`, whether linear interpolation in them reads any of the texels that are true, of a level of another
/// size.
fn reached(texels: &[u8], of_size: [u32; 3], size: [u32; 3]) -> Boxes {
    let mut from = of_size;
    let mut boxes = texels.to_vec();
    for axis in 0..3 {
        let read: Vec<Vec<usize>> =
            (0..size[axis]).map(|i| support(i, size[axis], from[axis], axis)).collect();
        let before = from.map(|side| side as usize);
        from[axis] = size[axis];
        boxes = by_row(from, |[v, w], row| {
            let line = |v: usize, w: usize| &boxes[(w * before[1] + v) * before[0]..][..before[0]];
            match axis {
                0 => {
                    let own = line(v, w);
                    row.iter_mut()
                        .zip(&read)
                        .for_each(|(seen, read)| *seen = read.iter().fold(0, |any, &u| any | own[u]));
                }
                1 => read[v].iter().for_each(|&v| raise(row, line(v, w))),
                _ => read[w].iter().for_each(|&w| raise(row, line(v, w))),
            }
        });
    }
    boxes
}

/// A grid of `size`, of which each row along u is filled in by `fill`, which is told where it is along v and w.
fn by_row(size: [u32; 3], fill: impl Fn([usize; 2], &mut [u8]) + Sync) -> Boxes {
    let [width, height, depth] = size.map(|side| side as usize);
    let mut boxes = vec![0; width * height * depth];
    boxes
        .par_chunks_mut(width)
        .enumerate()
        .for_each(|(row, boxes)| fill([row % height, row / height], boxes));
    boxes
}

/// To the greater of both, box by box.
fn raise(row: &mut [u8], other: &[u8]) {
    row.iter_mut().zip(other).for_each(|(a, b)| *a = (*a).max(*b));
}

/// The texels, of `texels` along an axis, that interpolation reads in box `i` of `boxes`.
fn support(i: u32, boxes: u32, texels: u32, axis: usize) -> Vec<usize> {
    // Twice the sixteenth of a texel to which f32 tells texture coordinates, at worst (`scene::span`): by that a sample may be in the
    // neighbouring box.
    const MARGIN: f64 = 0.125;
    let scale = f64::from(texels) / f64::from(boxes);
    let low = (f64::from(i) * scale - 0.5 - MARGIN).floor() as i64;
    let high = (f64::from(i + 1) * scale - 0.5 + MARGIN).floor() as i64 + 1;
    let last = i64::from(texels) - 1;
    if axis == 2 {
        return (low.clamp(0, last)..=high.clamp(0, last)).map(|j| j as usize).collect();
    }
    // Once round is all there is.
    (low..=high.min(low + last)).map(|j| j.rem_euclid(last + 1) as usize).collect()
}

/// Of each box to the nearest that is true.
fn distances(near: &[u8], size: [u32; 3]) -> Boxes {
    // How far what is true still reaches: one less from box to box, over corners too.
    let mut reach: Boxes = near.iter().map(|near| near * FARTHEST).collect();
    for _ in 0..FARTHEST {
        let mut next = reach.clone();
        for axis in 0..3 {
            next = spread(&next, size, axis);
        }
        next.iter_mut().zip(near).for_each(|(next, near)| *next = next.saturating_sub(1 - near));
        let is_done = next == reach;
        reach = next;
        if is_done {
            break;
        }
    }
    reach.into_iter().map(|reach| FARTHEST - reach).collect()
}

/// The greatest of each box and its two neighbours along an axis.
fn spread(boxes: &[u8], size: [u32; 3], axis: usize) -> Boxes {
    let [width, height, depth] = size.map(|side| side as usize);
    by_row(size, |[v, w], row| {
        let line = |v: usize, w: usize| &boxes[(w * height + v) * width..][..width];
        let own = line(v, w);
        row.copy_from_slice(own);
        match axis {
            0 => {
                raise(&mut row[1..], &own[..width - 1]);
                raise(&mut row[..width - 1], &own[1..]);
                raise(&mut row[..1], &own[width - 1..]);
                raise(&mut row[width - 1..], &own[..1]);
            }
            1 => [(v + 1) % height, (v + height - 1) % height].iter().for_each(|&v| raise(row, line(v, w))),
            _ => [(w + 1).min(depth - 1), w.saturating_sub(1)].iter().for_each(|&w| raise(row, line(v, w))),
        }
    })
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use rand::RngExt as _;
    use rand_pcg::Pcg64;

    use super::*;
    use crate::volume::texel_at;

    const NOTHING: [f32; 4] = [0.0; 4];
    const HAZE: [f32; 4] = [0.03, 0.02, 0.05, 0.07];

    /// Of texels that are all `rest` but for some.
    fn pyramid(size: [u32; 3], rest: [f32; 4], is_other: impl Fn([u32; 3]) -> bool) -> Pyramid {
        let count = size.iter().product::<u32>() as usize;
        let texel = |index| if is_other(texel_at(size, index)) { [0.5; 4] } else { rest };
        Pyramid::build(Volume::of(Quantity::Opacity, size, (0..count).map(texel).collect()).unwrap())
    }

    /// What linear interpolation reads: u and v repeat, w clamps.
    fn read(level: &Volume, point: [f64; 3]) -> impl Iterator<Item = [f32; 4]> {
        let read = [0, 1, 2].map(|k| {
            let side = i64::from(level.size[k]);
            let low = (point[k] * side as f64 - 0.5).floor() as i64;
            let index = |i: i64| if k < 2 { i.rem_euclid(side) } else { i.clamp(0, side - 1) };
            [index(low) as u32, index(low + 1) as u32]
        });
        let corner = move |corner: usize| [0, 1, 2].map(|k| read[k][corner >> k & 1]);
        (0..8).map(move |index| level.texel(corner(index)))
    }

    /// Places from which a texel unlike the rest is read, at any of the levels that a sample may read, before a ray has gone `promised` of
    /// the distance there, wherever that is and however the ray runs.
    fn broken_promises(rest: [f32; 4], promised: impl Fn(u8) -> f64) -> usize {
        let mut random = Pcg64::new(7, 11);
        let mut broken = 0;
        let sizes =
            [[32, 32, 16], [20, 33, 9], [64, 7, 1], [40, 24, 8], [30, 50, 4], [24, 24, 5], [48, 31, 2]];
        // The last layer along w, too: it is clamped there.
        for (size, last) in sizes.into_iter().flat_map(|size| [(size, false), (size, true)]) {
            let mut other = size.map(|side| random.random_range(0..side));
            other[2] = if last { size[2] - 1 } else { other[2] };
            let pyramid = pyramid(size, rest, |place| place == other);
            let proximity = Proximity::new(&pyramid, None, rest);
            let mut leaps = [0, 0];
            for _ in 0..10_000 {
                let level = random.random_range(0..pyramid.levels.len());
                let of = &proximity.levels[level];
                assert_eq!(of.size, pyramid.levels[level].size);
                let point: [f64; 3] = std::array::from_fn(|_| random.random_range(0.0..1.0));
                let [u, v, w] = [0, 1, 2].map(|k| (point[k] * f64::from(of.size[k])).floor() as usize);
                let both = of.distances[(w * of.size[1] as usize + v) * of.size[0] as usize + u];
                let kinds = [
                    (both & FARTHEST, level..level + 1),
                    (both >> BITS, level.saturating_sub(1)..pyramid.levels.len().min(level + 2)),
                ];
                for ((distance, levels), leaps) in kinds.into_iter().zip(&mut leaps) {
                    if distance == 0 {
                        continue;
                    }
                    *leaps += 1;
                    let within = promised(distance);
                    let mut moved = [0, 1, 2]
                        .map(|k| point[k] + random.random_range(-within..=within) / f64::from(of.size[k]));
                    moved[2] = moved[2].clamp(0.0, 1.0);
                    let differs = |level: usize| {
                        read(&pyramid.levels[level], moved).any(|texel| !is_like(&texel, &rest))
                    };
                    broken += usize::from(levels.into_iter().any(differs));
                }
            }
            assert!(leaps.iter().all(|&leaps| leaps > 100), "{size:?}: {leaps:?}");
        }
        broken
    }

    #[test]
    fn nothing_else_is_read_within_the_distance() {
        for rest in [NOTHING, HAZE] {
            assert_eq!(broken_promises(rest, |distance| f64::from(distance - 1)), 0);
            assert!(broken_promises(rest, |distance| f64::from(distance + 2)) > 20);
        }
    }

    #[test]
    fn distances_are_those_of_the_greatest_axis_and_u_and_v_repeat() {
        let full = pyramid([40, 40, 40], NOTHING, |place| place == [1, 20, 30]);
        let level = &Proximity::new(&full, None, NOTHING).levels[0];
        let at = |u: usize, v: usize, w: usize| level.distances[(w * 40 + v) * 40 + u];
        // The texel is read in the boxes beside its own, and half a coarser texel farther: one box more.
        assert_eq!(at(1, 20, 30), 0);
        assert_eq!([at(2, 20, 30) & FARTHEST, at(3, 20, 30) & FARTHEST], [0, 1]);
        let nearest = (2..10).find(|&u| at(u, 20, 30) >> BITS > 0).unwrap();
        assert!((3..=5).contains(&nearest), "{nearest}");
        assert_eq!(at(nearest + 4, 20, 30) >> BITS, 5);
        assert_eq!(at(nearest + 4, 22, 33) >> BITS, 5);
        // Round the other way.
        assert!((1..=7).contains(&(at(36, 20, 30) >> BITS)), "{}", at(36, 20, 30));
        assert_eq!(at(20, 0, 0), FARTHEST | FARTHEST << BITS);
    }

    #[test]
    fn a_dense_volume_is_near_everywhere() {
        let part = |is_other: fn([u32; 3]) -> bool| {
            Proximity::new(&pyramid([8, 8, 8], NOTHING, is_other), None, NOTHING).part()
        };
        assert_eq!((part(|_| true), part(|_| false)), (0.0, 1.0));
    }

    #[test]
    fn what_has_a_direction_is_unlike_the_rest() {
        let size = [8, 8, 8];
        let volume = pyramid(size, HAZE, |_| false);
        let directions =
            Directions::of(&volume.levels[0], |at| if at == [2, 3, 4] { DVec3::Z } else { DVec3::ZERO });
        let all = Proximity::new(&volume, None, HAZE);
        let some = Proximity::new(&volume, Some(&directions), HAZE);
        assert_eq!(all.part(), 1.0);
        // In 27 boxes of 512 it is read.
        assert_eq!(some.part(), 485.0 / 512.0);
        assert_eq!(some.levels[0].distances[(4 * 8 + 3) * 8 + 2], 0);
    }

    #[test]
    fn the_commonest_medium_is_neither_nothing_nor_a_wall() {
        let size = [16, 16, 16];
        let fill = |index: usize| match index % 8 {
            0..3 => NOTHING,
            3..6 => [0.2, 0.2, 0.2, 1.0],
            6 => HAZE,
            _ => [0.0, 0.0, 0.0, 1e-6 * index as f32],
        };
        let volume = Volume::of(Quantity::Opacity, size, (0..4096).map(fill).collect()).unwrap();
        assert_eq!(commonest(&volume), Some(HAZE));
        assert_eq!(part_like(&volume, HAZE), 0.125);
        assert_eq!(part_like(&volume, NOTHING), 0.375);
        assert_eq!(commonest(&Volume::of(Quantity::Opacity, size, vec![NOTHING; 4096]).unwrap()), None);
    }
}
