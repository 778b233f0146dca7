//! Haze: a thin medium that fills all of a volume, what else is there included. Extinctions add, and colours are weighted by
//! them, as of particles that are mixed.

use glam::Vec3;
use rayon::prelude::*;

use super::{Quantity, Volume};

/// A medium of one colour, as dense everywhere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Haze {
    /// Linear, straight.
    pub colour: Vec3,
    /// Optical depth, at least 0, of a path of one `opacity_distance`.
    pub depth: f64,
}

impl Haze {
    /// Adds the haze to every texel; one that is solid stays as it is.
    pub fn fill(&self, volume: &mut Volume) {
        let Self { colour, depth } = *self;
        let quantity = volume.quantity;
        volume.texels.par_iter_mut().for_each(|texel| {
            let premultiplied = Vec3::from_slice(texel);
            let alpha = f64::from(texel[3]);
            let (mixed, with_haze) = match quantity {
                Quantity::Extinction => (premultiplied + colour * depth as f32, alpha + depth),
                Quantity::Opacity if alpha < 1.0 => {
                    let own = -(-alpha).ln_1p();
                    let all = own + depth;
                    let with_haze = -(-all).exp_m1();
                    // Straight colour times extinction; alpha is nearly the extinction where both are small.
                    let of_own = if alpha > 0.0 { premultiplied * (own / alpha) as f32 } else { Vec3::ZERO };
                    let mixed = (of_own + colour * depth as f32)
                        * if all > 0.0 { (with_haze / all) as f32 } else { 0.0 };
                    (mixed, with_haze)
                }
                Quantity::Opacity => return,
            };
            *texel = mixed.extend(with_haze as f32).to_array();
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn filled(quantity: Quantity, texel: [f32; 4], haze: Haze) -> [f32; 4] {
        let mut volume = Volume::of(quantity, [1, 1, 1], vec![texel]).unwrap();
        haze.fill(&mut volume);
        volume.texels[0]
    }

    /// Equal to a few roundings of f32.
    fn assert_near(found: [f32; 4], expected: [f64; 4]) {
        for (found, expected) in found.into_iter().zip(expected) {
            assert!(
                (f64::from(found) - expected).abs() < 1e-6 * expected.abs().max(1e-3),
                "{found} is not {expected}"
            );
        }
    }

    const BLUE: Haze = Haze { colour: Vec3::Z, depth: 0.5 };

    #[test]
    fn extinctions_add_and_weigh_colours() {
        let clear = -(-0.5f64).exp_m1();
        assert_near(filled(Quantity::Opacity, [0.0; 4], BLUE), [0.0, 0.0, clear, clear]);
        // Red of an optical depth of ln 2, which is 2 ln 2 = 1.39 times the haze's.
        let (own, haze) = (2f64.ln(), 0.5);
        let alpha = 1.0 - 0.5 * (-0.5f64).exp();
        let expected = [alpha * own / (own + haze), 0.0, alpha * haze / (own + haze), alpha];
        assert_near(filled(Quantity::Opacity, [0.5, 0.0, 0.0, 0.5], BLUE), expected);
        assert_near(filled(Quantity::Extinction, [3.0, 0.0, 0.0, 3.0], BLUE), [3.0, 0.0, 0.5, 3.5]);
    }

    #[test]
    fn what_is_solid_and_what_gets_no_haze_stay_as_they_are() {
        let solid = [0.3, 0.2, 0.1, 1.0];
        assert_eq!(filled(Quantity::Opacity, solid, BLUE), solid);
        let none = Haze { depth: 0.0, ..BLUE };
        assert_eq!(filled(Quantity::Opacity, [0.0; 4], none), [0.0; 4]);
        assert_near(filled(Quantity::Opacity, [0.25, 0.0, 0.0, 0.5], none), [0.25, 0.0, 0.0, 0.5]);
    }
}
