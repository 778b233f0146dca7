//! The arithmetic of a texel: what it takes away from light that passes through it, and what it sends out.
//!
//! Lengths are in opacity distances. A texel of premultiplied colour `p` and alpha `a` has, over a length `t`, the optical
//! depth `D(a) t` and sends out `p E(a, t)`, where
//!
//! ```text
//!   D(a) = -ln(1 - a)                      of an opacity, infinite for 1;  D(a) = a of an extinction
//!   E(a, t) = (1 - exp(-D(a) t)) / a       nothing where a is 0
//! ```

use rayon::prelude::*;

use crate::volume::{Quantity, Volume};

/// What passes through a piece of medium, or comes out of it, where it is looked at from so many sides.
#[derive(Debug, Clone, Copy)]
pub struct Passage<const SIDES: usize = 1> {
    /// Optical depth; infinite behind a wall.
    pub depth: f64,
    /// `1 - exp(-depth)`.
    pub opacity: f64,
    /// Red, green and blue that come out: at the lower end, of two sides, and at the upper one.
    light: [[f64; 3]; SIDES],
}

// Inlined, as they otherwise go from one to the other through memory: a tenth of the time to filter a volume.
impl<const SIDES: usize> Passage<SIDES> {
    /// Through nothing.
    pub const NOTHING: Self = Self { depth: 0.0, opacity: 0.0, light: [[0.0; 3]; SIDES] };

    /// Through a texel of this optical depth.
    #[inline(always)]
    pub fn through(texel: [f64; 4], depth: f64) -> Self {
        let [red, green, blue, alpha] = texel;
        if alpha == 0.0 {
            return Self::NOTHING;
        }
        let inverse = alpha.recip();
        let straight = [red, green, blue].map(|colour| colour * inverse);
        Self::of(depth, opacity(depth), [straight; SIDES])
    }

    /// Through what is of one colour, seen from each side, throughout: its optical depth, the opacity that this is, and its light for its
    /// opacity.
    #[inline(always)]
    pub fn of(depth: f64, opacity: f64, straight: [[f64; 3]; SIDES]) -> Self {
        Self { depth, opacity, light: straight.map(|colour| colour.map(|colour| colour * opacity)) }
    }

    /// Its light for its opacity, seen from each side.
    #[inline(always)]
    pub fn straight(&self) -> [[f64; 3]; SIDES] {
        let inverse = if self.depth == 0.0 { 1.0 } else { self.opacity.recip() };
        self.light.map(|light| light.map(|light| light * inverse))
    }

    /// As many times as long.
    pub fn stretched(self, times: f64) -> Self {
        let depth = self.depth * times;
        Self::of(depth, opacity(depth), self.straight())
    }

    /// This, with another above it.
    #[inline(always)]
    pub fn under(self, above: Self) -> Self {
        let over = |near: &Self, far: &Self, side: usize| {
            std::array::from_fn(|c| near.light[side][c] + (1.0 - near.opacity) * far.light[side][c])
        };
        let from_above = SIDES - 1;
        let light = std::array::from_fn(|side| match side == from_above {
            true => over(&above, &self, side),
            false => over(&self, &above, side),
        });
        Self {
            depth: self.depth + above.depth,
            opacity: self.opacity + (1.0 - self.opacity) * above.opacity,
            light,
        }
    }

    /// The mean transmittance and the mean light of passages side by side, each with its weight.
    #[inline(always)]
    pub fn mean(passages: impl Iterator<Item = (f64, Self)> + Clone) -> Self {
        // Relative to the thinnest, so that neither 1 - opacity nor a transmittance below 1e-308 is rounded away.
        let thinnest = passages.clone().map(|(_, passage)| passage);
        let thinnest = thinnest.reduce(|a, b| if b.depth < a.depth { b } else { a }).unwrap_or(Self::NOTHING);
        let mut light = [[0.0; 3]; SIDES];
        let mut beyond = 0.0;
        let mut weights = 0.0;
        for (weight, passage) in passages {
            if passage.depth > thinnest.depth {
                // What the thinnest lets through is not rounded away up to here, and the quotient needs no exponential.
                beyond += weight
                    * match thinnest.opacity < 0.75 {
                        true => (passage.opacity - thinnest.opacity) / (1.0 - thinnest.opacity),
                        false => opacity(passage.depth - thinnest.depth),
                    };
            }
            for (sum, light) in light.as_flattened_mut().iter_mut().zip(passage.light.as_flattened()) {
                *sum += weight * light;
            }
            weights += weight;
        }
        let beyond = beyond / weights;
        Self {
            depth: thinnest.depth + if beyond > 0.0 { optical_depth(beyond) } else { 0.0 },
            opacity: thinnest.opacity + (1.0 - thinnest.opacity) * beyond,
            light: light.map(|light| light.map(|light| light / weights)),
        }
    }
}

impl Passage<2> {
    /// Seen from both sides as much.
    pub fn of_both_sides(self) -> Passage {
        let [below, above] = self.light;
        let light = [std::array::from_fn(|c| 0.5 * (below[c] + above[c]))];
        Passage { depth: self.depth, opacity: self.opacity, light }
    }
}

impl Passage {
    /// The texel that over that length is such a passage.
    pub fn texel(self, length: f64, quantity: Quantity) -> [f64; 4] {
        if self.depth == 0.0 {
            return [0.0; 4];
        }
        let alpha = match quantity {
            Quantity::Opacity => opacity(self.depth / length),
            Quantity::Extinction => self.depth / length,
        };
        if alpha == 0.0 {
            return [0.0; 4];
        }
        // Not `E(alpha, length)`: what is so dense that alpha rounds to 1 is no wall yet.
        let [[red, green, blue]] = self.straight().map(|straight| straight.map(|colour| colour * alpha));
        [red, green, blue, alpha]
    }
}

/// `D(a)` of each texel of a volume.
pub fn depths(volume: &Volume) -> Vec<f64> {
    volume.texels.par_iter().map(|texel| depth(f64::from(texel[3]), volume.quantity)).collect()
}

/// `D(a)`.
pub fn depth(alpha: f64, quantity: Quantity) -> f64 {
    match quantity {
        Quantity::Opacity => optical_depth(alpha),
        Quantity::Extinction => alpha,
    }
}

/// Of an opacity.
fn optical_depth(opacity: f64) -> f64 {
    -(-opacity).ln_1p()
}

/// Of an optical depth.
pub fn opacity(depth: f64) -> f64 {
    -(-depth).exp_m1()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_of_transmittances_keeps_its_accuracy_at_both_ends() {
        let mean = |depths: &[f64]| {
            let passages = depths.iter().map(|&depth| (0.5, Passage::of(depth, opacity(depth), [[0.0; 3]])));
            Passage::<1>::mean(passages).depth
        };
        for depth in [0.0, 1e-300, 1e-9, 1.0, 1e5, f64::INFINITY] {
            assert_eq!(mean(&[depth, depth]), depth);
        }
        // To first order thin depths average, and of thick ones half of the thinnest's light is left.
        assert!((mean(&[1e-12, 3e-12]) / 2e-12 - 1.0).abs() < 1e-11);
        assert!((mean(&[1000.0, f64::INFINITY]) - 1000.0 - 2.0_f64.ln()).abs() < 1e-12);
        assert!((mean(&[0.3, 1.2]) + (0.5 * ((-0.3_f64).exp() + (-1.2_f64).exp())).ln()).abs() < 1e-15);
    }

    #[test]
    fn a_texel_survives_the_passage_through_it() {
        for quantity in [Quantity::Opacity, Quantity::Extinction] {
            for texel in [[0.1, 0.2, 0.3, 0.4], [3.0, 0.0, 0.5, 1.0], [1e-7, 0.0, 0.0, 1e-9], [0.0; 4]] {
                for length in [0.01, 1.0, 40.0] {
                    let whole = depth(texel[3], quantity) * length;
                    let back = Passage::<1>::through(texel, whole).texel(length, quantity);
                    // An opacity near 1 - exp(-40 / 2) is rounded by 1e-16 of exp(20): of no matter in f32.
                    let near = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-12 * b.abs();
                    assert!(back.iter().zip(&texel).all(near), "{texel:?} over {length}: {back:?}");
                }
            }
        }
    }

    #[test]
    fn one_passage_hides_another_from_its_own_side() {
        fn stacks<const SIDES: usize>() -> [[[f64; 3]; SIDES]; 2] {
            let through = |texel: [f64; 4]| Passage::<SIDES>::through(texel, optical_depth(texel[3]));
            let (veil, wall) = (through([0.0, 0.5, 0.0, 0.5]), through([1.0, 0.0, 0.0, 1.0]));
            assert_eq!(veil.under(wall).depth, f64::INFINITY);
            [wall.under(veil), veil.under(wall)].map(|stack| stack.light)
        }
        let (wall, both) = ([1.0, 0.0, 0.0], [0.5, 0.5, 0.0]);
        assert_eq!(stacks::<2>(), [[wall, both], [both, wall]]);
        assert_eq!(stacks::<1>(), [[both], [wall]]);
    }

    #[test]
    fn the_mean_of_both_sides_is_that_of_each() {
        let both = Passage { depth: 1.0, opacity: opacity(1.0), light: [[0.5, 0.0, 1.0], [0.25, 0.0, 0.0]] }
            .of_both_sides();
        assert_eq!((both.depth, both.light), (1.0, [[0.375, 0.0, 0.5]]));
    }
}
