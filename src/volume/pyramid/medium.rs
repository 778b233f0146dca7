//! The arithmetic of a texel: what it takes away from light that passes through it, and what it sends out.
//!
//! Lengths are in opacity distances. A texel of premultiplied colour `p` and alpha `a` has, over a length `t`, the optical
//! depth `D(a) t` and sends out `p E(a, t)`, where
//!
//! ```text
//!   D(a) = -ln(1 - a)                      of an opacity, infinite for 1;  D(a) = a of an extinction
//!   E(a, t) = (1 - exp(-D(a) t)) / a       nothing where a is 0
//! ```

use crate::volume::Quantity;

/// What passes through a piece of medium, or comes out of it.
#[derive(Debug, Clone, Copy, Default)]
pub struct Passage {
    /// Optical depth; infinite behind a wall.
    pub depth: f64,
    /// Red, green and blue that come out at the viewer's end.
    pub light: [f64; 3],
}

impl Passage {
    /// Through a texel over a length.
    pub fn through(texel: [f64; 4], length: f64, quantity: Quantity) -> Self {
        let [red, green, blue, alpha] = texel;
        if alpha == 0.0 {
            return Self::default();
        }
        let depth = depth(alpha, quantity) * length;
        let emission = match quantity {
            Quantity::Opacity if length == 1.0 => 1.0,
            _ => opacity(depth) / alpha,
        };
        Self { depth, light: [red, green, blue].map(|colour| colour * emission) }
    }

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
        let emission = opacity(self.depth) / alpha;
        let [red, green, blue] = self.light.map(|light| light / emission);
        [red, green, blue, alpha]
    }

    /// Whether nothing is there.
    fn is_empty(&self) -> bool {
        self.depth == 0.0 && self.light == [0.0; 3]
    }

    /// This, with `behind` behind it.
    pub fn before(self, behind: Self) -> Self {
        if self.is_empty() {
            return behind;
        }
        if behind.is_empty() {
            return self;
        }
        let transmittance = (-self.depth).exp();
        let light = std::array::from_fn(|c| self.light[c] + transmittance * behind.light[c]);
        Self { depth: self.depth + behind.depth, light }
    }

    /// The mean transmittance and the mean light of passages side by side, each with its weight.
    pub fn mean(passages: impl Iterator<Item = (f64, Self)> + Clone) -> Self {
        // Relative to the thinnest, so that neither 1 - opacity nor a transmittance below 1e-308 is rounded away.
        let thinnest = passages.clone().map(|(_, passage)| passage.depth).fold(f64::INFINITY, f64::min);
        let mut sum = [0.0; 4];
        let mut weights = 0.0;
        for (weight, Self { depth, light: [red, green, blue] }) in passages {
            let opacity = if depth > thinnest { opacity(depth - thinnest) } else { 0.0 };
            for (sum, value) in sum.iter_mut().zip([red, green, blue, opacity]) {
                *sum += weight * value;
            }
            weights += weight;
        }
        let [red, green, blue, opacity] = sum.map(|sum| sum / weights);
        let beyond = if opacity > 0.0 { optical_depth(opacity) } else { 0.0 };
        Self { depth: thinnest + beyond, light: [red, green, blue] }
    }
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
            let passages = depths.iter().map(|&depth| (0.5, Passage { depth, light: [0.0; 3] }));
            Passage::mean(passages).depth
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
                    let back = Passage::through(texel, length, quantity).texel(length, quantity);
                    // An opacity near 1 - exp(-40 / 2) is rounded by 1e-16 of exp(20): of no matter in f32.
                    let near = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-12 * b.abs();
                    assert!(back.iter().zip(&texel).all(near), "{texel:?} over {length}: {back:?}");
                }
            }
        }
    }

    #[test]
    fn one_passage_before_another_hides_it() {
        let through = |texel| Passage::through(texel, 1.0, Quantity::Opacity);
        let (veil, wall) = (through([0.0, 0.25, 0.0, 0.25]), through([1.0, 0.0, 0.0, 1.0]));
        assert_eq!(veil.before(wall).light, [0.75, 0.25, 0.0]);
        assert_eq!(wall.before(veil).light, [1.0, 0.0, 0.0]);
        assert_eq!(wall.before(veil).depth, f64::INFINITY);
    }
}
