//! Noise that flows, and comes back after one turn: what moves by itself in a loop.
//!
//! Gradient noise (Ken Perlin, "Improving Noise", SIGGRAPH 2002) whose gradients turn: Ken Perlin, Fabrice Neyret, "Flow
//! Noise", SIGGRAPH 2001 technical sketches. Every lattice point has two perpendicular directions `a` and `b` of unit
//! length; its gradient is `a cos(2 pi phase) + b sin(2 pi phase)`. Deviations: the pairs come from a seeded table of
//! 64, chosen by an integer hash (the finaliser of SplitMix64, Steele, Lea, Flood 2014) of the lattice point, so
//! that nothing has to be stored and there is no period in space.

use std::f64::consts::TAU;

use glam::{DMat3, DVec3, I64Vec3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// How many pairs of directions there are: six bits of a hash choose one.
const PAIRS: usize = 64;

/// Three independent noises, one an axis, as they are at one phase.
///
/// Each is 0 at the lattice points, has two continuous derivatives, and is smaller than 1: at most `sqrt(3) / 2` in the
/// middle of a cell, mostly below a half.
#[derive(Debug, Clone)]
pub struct Flow {
    gradients: [DVec3; PAIRS],
    seed: u64,
}

impl Flow {
    /// The noise at a phase, of which only the fraction counts.
    pub fn new(phase: f64, seed: u32) -> Self {
        // The table is the same for all seeds.
        let mut random = Pcg64Mcg::seed_from_u64(0x666c_6f77);
        let (sine, cosine) = (TAU * (phase - phase.floor())).sin_cos();
        let gradients = std::array::from_fn(|_| {
            let height = random.random_range(-1.0..1.0f64);
            let (y, x) = (TAU * random.random_range(0.0..1.0f64)).sin_cos();
            let a = (DVec3::new(x, y, 0.0) * (1.0 - height * height).sqrt()).with_z(height).normalize();
            let (u, v) = a.any_orthonormal_pair();
            let (turned_v, turned_u) = (TAU * random.random_range(0.0..1.0f64)).sin_cos();
            cosine * a + sine * (turned_u * u + turned_v * v)
        });
        Self { gradients, seed: u64::from(seed).wrapping_mul(0x9e37_79b9_7f4a_7c15) }
    }

    /// The three noises at a point in lattice units, and their derivatives: column `i` by coordinate `i`.
    pub fn at(&self, point: DVec3) -> (DVec3, DMat3) {
        let floor = point.floor();
        let (cell, within) = (floor.as_i64vec3(), point - floor);
        let fade = within * within * within * (within * (within * 6.0 - 15.0) + 10.0);
        let slope = 30.0 * within * within * (within * (within - 2.0) + 1.0);
        let (mut value, mut derivative) = (DVec3::ZERO, DMat3::ZERO);
        for corner in 0..8 {
            let offset = I64Vec3::new(corner & 1, corner >> 1 & 1, corner >> 2);
            // Along each axis the weight of this corner, and its derivative.
            let is_far = offset.as_dvec3();
            let weight = DVec3::ONE - is_far + (2.0 * is_far - DVec3::ONE) * fade;
            let change = (2.0 * is_far - DVec3::ONE) * slope;
            let whole = weight.element_product();
            let changes = change * DVec3::new(weight.y * weight.z, weight.x * weight.z, weight.x * weight.y);
            // Row i is the gradient of noise i at this corner.
            let rows = self.gradients_at(cell + offset);
            let away = within - is_far;
            let ramps = DVec3::from_array(rows.map(|row| row.dot(away)));
            value += whole * ramps;
            derivative += DMat3::from_cols(rows[0], rows[1], rows[2]).transpose() * whole
                + DMat3::from_cols(ramps * changes.x, ramps * changes.y, ramps * changes.z);
        }
        (value, derivative)
    }

    fn gradients_at(&self, lattice: I64Vec3) -> [DVec3; 3] {
        let mut bits = self.seed;
        for coordinate in lattice.to_array() {
            bits = mixed(bits ^ coordinate as u64);
        }
        [0, 6, 12].map(|shift| self.gradients[(bits >> shift) as usize % PAIRS])
    }
}

fn mixed(bits: u64) -> u64 {
    let bits = bits.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ (bits >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points() -> impl Iterator<Item = DVec3> {
        let mut random = Pcg64Mcg::seed_from_u64(3);
        (0..500).map(move |_| DVec3::from_array(std::array::from_fn(|_| random.random_range(-20.0..20.0))))
    }

    #[test]
    fn a_turn_comes_back_and_half_a_turn_is_the_negative() {
        let [start, turned, half, quarter] = [0.3, 1.3, 0.8, 0.55].map(|phase| Flow::new(phase, 7));
        let mut largest = 0.0f64;
        for point in points() {
            // Sines of a few roundings of the phase, 1e-15, times 8 corners.
            assert!((start.at(point).0 - turned.at(point).0).length() < 1e-14);
            assert!((start.at(point).0 + half.at(point).0).length() < 1e-14);
            largest = largest.max((start.at(point).0 - quarter.at(point).0).length());
        }
        assert!(largest > 0.3, "it moves in between: {largest}");
    }

    #[test]
    fn noise_is_bounded_by_1_and_0_at_lattice_points() {
        let flow = Flow::new(0.1, 1);
        let mut largest = 0.0f64;
        for point in points() {
            largest = largest.max(flow.at(point).0.abs().max_element());
            assert_eq!(flow.at(point.floor()).0, DVec3::ZERO);
        }
        assert!((0.5..1.0).contains(&largest), "{largest}");
        assert_ne!(
            flow.at(DVec3::splat(0.4)).0,
            Flow::new(0.1, 2).at(DVec3::splat(0.4)).0,
            "the seed counts"
        );
    }

    /// Central differences with h = 1e-5: third derivatives of some 200 leave 200 h^2 / 6 = 4e-9, rounding 1e-16 / h = 1e-11.
    #[test]
    fn derivatives_are_those_of_the_noise() {
        let flow = Flow::new(0.37, 5);
        for point in points() {
            let (_, derivative) = flow.at(point);
            for axis in 0..3 {
                let mut step = DVec3::ZERO;
                step[axis] = 1e-5;
                let difference = (flow.at(point + step).0 - flow.at(point - step).0) / 2e-5;
                assert!((difference - derivative.col(axis)).length() < 2e-8);
            }
        }
    }
}
