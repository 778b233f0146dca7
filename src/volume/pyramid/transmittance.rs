//! Mean transmittance over the texel: a beam as wide as a merged texel, and as long as its mean beam, loses and gains what beams
//! through the single texels under it would, each as if its texel went on for the whole length `t`:
//!
//! ```text
//!   exp(-D(a) t) = sum w_i exp(-D(a_i) t)      p E(a, t) = sum w_i p_i E(a_i, t)
//! ```
//!
//! It knows no direction, and takes what lies in line for longer than it is: half a wall lets half of the light through,
//! across it as well as along it. Levels are made from level 0, not from one another.

use super::coverage::{VolumeCoverage, volume_of};
use super::geometry::Geometry;
use super::medium::{Passage, depth};
use crate::volume::Volume;

/// The levels after the full volume.
pub fn levels(full: &Volume, geometry: &Geometry) -> Vec<Volume> {
    let level = |level: usize| merged(full, geometry.sizes[level], geometry.beam_length(level));
    (1..geometry.sizes.len()).map(level).collect()
}

fn merged(full: &Volume, size: [u32; 3], length: f64) -> Volume {
    let coverage = VolumeCoverage::new(full.size, size);
    volume_of(size, full.quantity, |at| {
        let passages = coverage.of(at).map(|(place, part)| {
            let texel = full.texel(place).map(f64::from);
            (part, Passage::through(texel, depth(texel[3], full.quantity) * length))
        });
        Passage::mean(passages).texel(length, full.quantity)
    })
}

#[cfg(test)]
mod tests {
    use super::super::tests::{ROUNDING, assert_near, random_volume};
    use crate::volume::{Filter, Pyramid, Volume};

    fn merged(volume: Volume, edge: f64) -> [f32; 4] {
        Pyramid::build_with(volume, Filter::Transmittance, [edge; 3]).levels[1].texels[0]
    }

    #[test]
    fn half_a_wall_lets_half_of_the_light_through() {
        let volume = Volume::new([2, 2, 2], [[0.0; 4], [0.6, 0.0, 0.0, 1.0]].repeat(4)).unwrap();
        for edge in [0.25_f64, 1.0, 4.0] {
            let alpha = 1.0 - 0.5_f64.powf(0.5 / edge);
            assert_near(
                merged(volume.clone(), edge),
                [0.6 * alpha, 0.0, 0.0, alpha].map(|x| x as f32),
                ROUNDING,
            );
        }
    }

    #[test]
    fn light_and_transmittance_are_kept_at_the_merged_length() {
        let volume = random_volume([2, 2, 2]);
        // What a texel lets through and sends out over two opacity distances, in the paper's terms.
        let over_two = |[red, _, _, alpha]: [f32; 4]| {
            let alpha = f64::from(alpha);
            [(1.0 - alpha).powi(2), f64::from(red) * (1.0 + (1.0 - alpha))]
        };
        let mean = |volume: &Volume| {
            let sum = volume.texels.iter().map(|&texel| over_two(texel));
            sum.fold([0.0; 2], |sum, value| [sum[0] + value[0] / 8.0, sum[1] + value[1] / 8.0])
        };
        let found = over_two(merged(volume.clone(), 1.0));
        let close =
            |a: [f64; 2], b: [f64; 2]| (0..2).all(|i| (a[i] - b[i]).abs() < 4.0 * f64::from(ROUNDING));
        assert!(close(found, mean(&volume)), "{found:?}");
        let mut denser = volume.clone();
        denser.texels[1][3] = 0.5 * (denser.texels[1][3] + 0.9);
        assert!(!close(found, mean(&denser)));
    }
}
