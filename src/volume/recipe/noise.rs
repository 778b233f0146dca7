//! Noise that repeats exactly in u and v: the raw material of the soft recipes.
//!
//! Gradient noise: Ken Perlin, "Improving Noise", SIGGRAPH 2002. Cellular noise: Steven Worley, "A Cellular
//! Texture Basis Function", SIGGRAPH 1996. Both deviate from their source in how a lattice point gets its
//! random numbers: from an integer hash (the finaliser of MurmurHash3, Austin Appleby) of the wrapped
//! lattice coordinates and a seed, not from a permutation table. So any period works, seeds are
//! independent, and nothing is stored.
//!
//! A lattice has `period` cells a tile along x and y, where it wraps, and does not repeat along z.

use glam::{IVec3, Vec2, Vec3};

/// 32 well-mixed bits for a lattice point.
pub(super) fn hash(point: IVec3, seed: u32) -> u32 {
    let mut bits = seed.wrapping_mul(0x9e37_79b1) ^ 0x85eb_ca6b;
    for coordinate in point.to_array() {
        bits = (bits ^ coordinate as u32).wrapping_mul(0xcc9e_2d51);
        bits = bits.rotate_left(15).wrapping_mul(0x1b87_3593);
    }
    bits ^= bits >> 16;
    bits = bits.wrapping_mul(0x85eb_ca6b);
    bits ^= bits >> 13;
    bits = bits.wrapping_mul(0xc2b2_ae35);
    bits ^ (bits >> 16)
}

/// A number in 0..1 for item `index` of a list.
pub(super) fn random(index: u32, seed: u32) -> f32 {
    unit(hash(IVec3::new(index as i32, 0, 0), seed), 0, 24)
}

/// `count` bits of `bits` from bit `first` on, as a fraction of their range.
fn unit(bits: u32, first: u32, count: u32) -> f32 {
    ((bits >> first) & ((1 << count) - 1)) as f32 / (1u32 << count) as f32
}

fn wrap(cell: IVec3, period: [i32; 2]) -> IVec3 {
    IVec3::new(cell.x.rem_euclid(period[0]), cell.y.rem_euclid(period[1]), cell.z)
}

/// The 12 edges of a cube; four of them twice, so that four bits choose one without a bias in z.
const GRADIENTS: [[f32; 3]; 16] = [
    [1., 1., 0.],
    [-1., 1., 0.],
    [1., -1., 0.],
    [-1., -1., 0.],
    [1., 0., 1.],
    [-1., 0., 1.],
    [1., 0., -1.],
    [-1., 0., -1.],
    [0., 1., 1.],
    [0., -1., 1.],
    [0., 1., -1.],
    [0., -1., -1.],
    [1., 1., 0.],
    [-1., 1., 0.],
    [0., -1., 1.],
    [0., -1., -1.],
];

/// [`GRADIENTS`] after a quarter turn, each in its own plane. From a table, as a processor does not foresee which plane it is.
const QUARTER_TURNS: [[f32; 3]; 16] = {
    let mut turns = GRADIENTS;
    let mut edge = 0;
    while edge < turns.len() {
        let [a, b, c] = GRADIENTS[edge];
        turns[edge] = if c == 0. {
            [-b, a, 0.]
        } else if b == 0. {
            [-c, 0., a]
        } else {
            [0., -c, b]
        };
        edge += 1;
    }
    turns
};

/// Gradient noise at a point in lattice units, where a tile has `period` cells along x and y (each at
/// least 1). Smooth (C2), 0 at lattice points, within +-1.04.
pub(super) fn gradient(point: Vec3, period: [u32; 2], seed: u32) -> f32 {
    flowing(point, period, seed, Vec2::X)
}

/// A direction that has turned by `phase` of a circle from (1, 0); exactly that where `phase` is whole.
pub(super) fn turned(phase: f32) -> Vec2 {
    let phase = phase.fract();
    if phase == 0. { Vec2::X } else { Vec2::from_angle(std::f32::consts::TAU * phase) }
}

/// The same whose gradients have [`turned`], each in its own plane: noise that swirls in place, and comes back to itself (Ken Perlin,
/// Fabrice Neyret, "Flow Noise", SIGGRAPH 2001).
pub(super) fn flowing(point: Vec3, period: [u32; 2], seed: u32, turned: Vec2) -> f32 {
    let floor = point.floor();
    let (cell, within) = (floor.as_ivec3(), point - floor);
    let period = period.map(|cells| cells as i32);
    let near = wrap(cell, period);
    let far = wrap(cell + IVec3::new(1, 1, 0), period) + IVec3::Z;
    let corner = |x: i32, y: i32, z: i32| {
        let lattice = IVec3::new([near.x, far.x][x as usize], [near.y, far.y][y as usize], near.z + z);
        let edge = (hash(lattice, seed) & 15) as usize;
        let slope = turned.x * Vec3::from(GRADIENTS[edge]) + turned.y * Vec3::from(QUARTER_TURNS[edge]);
        slope.dot(within - IVec3::new(x, y, z).as_vec3())
    };
    let fade = within * within * within * (within * (within * 6. - 15.) + 10.);
    let row = |y, z| mix(corner(0, y, z), corner(1, y, z), fade.x);
    let plane = |z| mix(row(0, z), row(1, z), fade.y);
    mix(plane(0), plane(1), fade.z)
}

fn mix(a: f32, b: f32, t: f32) -> f32 {
    a + (b - a) * t
}

/// Octaves of noise, each with twice the cells and `gain` times the weight of the one before.
#[derive(Debug, Clone, Copy)]
pub(super) struct Octaves {
    /// Cells a tile of the first octave.
    pub cells: u32,
    /// How many octaves.
    pub count: u32,
    /// Weight of an octave relative to the one before.
    pub gain: f32,
    /// Octaves with more cells a tile than this are left out: the grid could not hold them.
    pub finest: u32,
}

impl Octaves {
    /// The weighted sum of `noise(cells, seed)`, scaled so that the weights of all octaves, left-out ones
    /// too, sum to one: a finer grid adds detail and changes nothing else.
    pub fn sum(&self, seed: u32, noise: impl Fn(u32, u32) -> f32) -> f32 {
        let (mut total, mut weights, mut weight) = (0., 0., 1.);
        for octave in 0..self.count {
            let cells = self.cells << octave;
            if octave == 0 || cells <= self.finest {
                total += weight * noise(cells, seed.wrapping_add(octave.wrapping_mul(0x632b_e5ab)));
            }
            weights += weight;
            weight *= self.gain;
        }
        total / weights
    }

    /// Fractal gradient noise at a point in tile widths; within +-1.04, mostly within +-0.5.
    pub fn gradient(&self, point: Vec3, seed: u32) -> f32 {
        self.sum(seed, |cells, seed| gradient(point * cells as f32, [cells; 2], seed))
    }

    /// Fractal gradient noise whose gradients have [`turned`].
    pub fn flowing(&self, point: Vec3, seed: u32, turned: Vec2) -> f32 {
        self.sum(seed, |cells, seed| flowing(point * cells as f32, [cells; 2], seed, turned))
    }

    /// Fractal cellular noise at a point in tile widths: 1 at the features, falling to 0 between them.
    pub fn billows(&self, point: Vec3, seed: u32) -> f32 {
        self.sum(seed, |cells, seed| {
            1. - nearest_feature(point * cells as f32, [cells; 2], seed).offset.length().min(1.)
        })
    }
}

/// What cellular noise knows of a point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Feature {
    /// From the point to its nearest feature, in lattice units.
    pub offset: Vec3,
    /// Random bits that belong to that feature.
    pub id: u32,
}

/// The nearest of the features, one at a random place in each cell, to a point in lattice units.
///
/// Only the 27 cells around the point are searched. A feature within one cell's width is always found,
/// which is nearly every point's nearest.
pub(super) fn nearest_feature(point: Vec3, period: [u32; 2], seed: u32) -> Feature {
    let floor = point.floor();
    let (cell, within) = (floor.as_ivec3(), point - floor);
    let period = period.map(|cells| cells as i32);
    // Squared distances to the near faces of the neighbours -1, 0, 1: cells farther than what was found are
    // passed over, and nearer cells come first.
    let gaps = [within * within, Vec3::ZERO, (1. - within) * (1. - within)];
    let gap = |step: i32| gaps[(step + 1) as usize];
    const STEPS: [i32; 3] = [0, -1, 1];
    let mut nearest = Feature { offset: Vec3::INFINITY, id: 0 };
    let mut squared = f32::INFINITY;
    for z in STEPS {
        for y in STEPS {
            for x in STEPS {
                if gap(x).x + gap(y).y + gap(z).z >= squared {
                    continue;
                }
                let neighbour = IVec3::new(x, y, z);
                let id = hash(wrap(cell + neighbour, period), seed);
                let jitter = Vec3::new(unit(id, 0, 10), unit(id, 10, 11), unit(id, 21, 11));
                let offset = neighbour.as_vec3() + jitter - within;
                if offset.length_squared() < squared {
                    squared = offset.length_squared();
                    nearest = Feature { offset, id };
                }
            }
        }
    }
    nearest
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Exact, because the lattice wraps as integers; a whole point's fraction is exactly 0.
        #[test]
        fn both_noises_repeat_exactly(
            periods in [1u32..20, 1u32..20], y in 0f32..20., z in -3f32..3., seed: u32,
        ) {
            let near = Vec3::new(0., y, z);
            let far = Vec3::new(periods[0] as f32, y, z);
            prop_assert_eq!(gradient(near, periods, seed), gradient(far, periods, seed));
            let features = [near, far].map(|point| nearest_feature(point, periods, seed));
            prop_assert_eq!(features[0].offset, features[1].offset);
            prop_assert_eq!(features[0].id, features[1].id);
            let swapped = [near, far].map(|p| gradient(Vec3::new(p.y, p.x, p.z), [periods[1], periods[0]], seed));
            prop_assert_eq!(swapped[0], swapped[1]);
        }

        /// 1.04 is the known maximum of three-dimensional noise with these gradients.
        #[test]
        fn gradient_noise_keeps_its_bounds(x in 0f32..8., y in 0f32..8., z in -8f32..8., seed: u32) {
            prop_assert!(gradient(Vec3::new(x, y, z), [8, 8], seed).abs() <= 1.04);
            prop_assert_eq!(gradient(Vec3::new(x, y, z).floor(), [8, 8], seed), 0.);
        }

        /// As the lattice does; and a circle is a circle.
        #[test]
        fn flowing_noise_repeats_in_space_and_in_time(phase in 0.05f32..0.95, y in 0f32..5., z in -3f32..3., seed: u32) {
            let at = |x: f32, phase: f32| flowing(Vec3::new(x, y, z), [5, 5], seed, turned(phase));
            prop_assert_eq!(at(0., phase), at(5., phase));
            prop_assert_eq!(at(0.3, 0.), gradient(Vec3::new(0.3, y, z), [5, 5], seed));
            prop_assert_eq!(at(0.3, 1.), at(0.3, 0.));
            // Opposite gradients, opposite noise: the two halves of a circle, to the rounding of its points.
            prop_assert!((at(0.3, phase) + at(0.3, phase + 0.5)).abs() < 1e-5);
        }

        /// The cells that are passed over hold nothing nearer.
        #[test]
        fn the_nearest_feature_is_the_nearest_of_all_27(
            x in 0f32..5., y in 0f32..5., z in 0f32..5., seed: u32,
        ) {
            let point = Vec3::new(x, y, z);
            let found = nearest_feature(point, [5, 5], seed).offset.length();
            let cell = point.floor().as_ivec3();
            let all = (0..27).map(|index| {
                let neighbour = cell + IVec3::new(index % 3, index / 3 % 3, index / 9) - 1;
                let id = hash(wrap(neighbour, [5, 5]), seed);
                let jitter = Vec3::new(unit(id, 0, 10), unit(id, 10, 11), unit(id, 21, 11));
                (neighbour.as_vec3() + jitter).distance(point)
            });
            // Both are within a few roundings of coordinates up to 6, whose spacing is 4.8e-7.
            prop_assert!((all.fold(f32::INFINITY, f32::min) - found).abs() < 4e-6);
        }
    }

    #[test]
    fn noise_without_the_right_period_does_not_repeat() {
        let at = |x: f32| gradient(Vec3::new(x, 0.4, 0.3), [8, 8], 1);
        assert_ne!(at(0.), at(7.));
    }

    #[test]
    fn finer_grids_add_octaves_and_change_no_others() {
        let octaves = |finest| Octaves { cells: 2, count: 4, gain: 0.5, finest };
        let weights = |finest| octaves(finest).sum(0, |_, _| 1.);
        assert_eq!(weights(16), 1.);
        assert_eq!(weights(8), 14. / 15.);
        assert_eq!(weights(0), 8. / 15.);
    }
}
