//! Mean extinction: the limit of short paths. A merged texel takes from a thin beam, and adds to it, what the texels under it
//! do in the mean:
//!
//! ```text
//!   D(a) = sum w_i D(a_i)      p D(a) / a = sum w_i p_i D(a_i) / a_i      (medium.rs defines D; sum w_i = 1)
//! ```
//!
//! It is exact for a mist too thin to hide anything. Elsewhere it is too opaque, as `exp` of a mean is below the mean of
//! `exp` (Jensen): of a wall with a hole in it nothing but the wall is left.

use super::coverage::{VolumeCoverage, volume_of};
use super::geometry::Geometry;
use super::medium::{depth, opacity};
use crate::volume::{Quantity, Volume};

/// The levels after the full volume, each from the one before it.
pub fn levels(full: &Volume, geometry: &Geometry) -> Vec<Volume> {
    let mut levels: Vec<Volume> = Vec::new();
    for level in 1..geometry.sizes.len() {
        let finer = levels.last().unwrap_or(full);
        levels.push(next(finer, geometry.sizes[level]));
    }
    levels
}

fn next(finer: &Volume, size: [u32; 3]) -> Volume {
    let coverage = VolumeCoverage::new(finer.size, size);
    volume_of(size, finer.quantity, |at| {
        mean(coverage.of(at).map(|(place, part)| (part, finer.texel(place).map(f64::from))), finer.quantity)
    })
}

fn mean(texels: impl Iterator<Item = (f64, [f64; 4])> + Clone, quantity: Quantity) -> [f64; 4] {
    // A wall's extinction is infinitely larger than all else: of others nothing remains.
    let is_wall = |alpha: f64| depth(alpha, quantity) == f64::INFINITY;
    let has_wall = texels.clone().any(|(_, texel)| is_wall(texel[3]));
    let mut sum = [0.0; 4];
    let mut weights = 0.0;
    for (weight, [red, green, blue, alpha]) in texels.filter(|(_, texel)| !has_wall || is_wall(texel[3])) {
        let rate = if has_wall { 1.0 } else { rate(alpha, quantity) };
        for (sum, value) in
            sum.iter_mut().zip([red * rate, green * rate, blue * rate, depth(alpha, quantity)])
        {
            *sum += weight * value;
        }
        weights += weight;
    }
    let [red, green, blue, depth] = sum.map(|sum| sum / weights);
    let alpha = match quantity {
        Quantity::Opacity => opacity(depth),
        Quantity::Extinction => depth,
    };
    let rate = if has_wall { 1.0 } else { rate(alpha, quantity) };
    [red / rate, green / rate, blue / rate, alpha]
}

/// `D(a) / a`, the limit of `E(a, t) / t` for short paths.
fn rate(alpha: f64, quantity: Quantity) -> f64 {
    if alpha == 0.0 { 1.0 } else { depth(alpha, quantity) / alpha }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{ROUNDING, assert_near, random_volume};
    use super::*;
    use crate::volume::{Filter, Pyramid};

    #[test]
    fn extinction_and_its_light_are_kept() {
        for (size, quantity) in [
            ([8, 4, 6], Quantity::Opacity),
            ([5, 3, 7], Quantity::Opacity),
            ([5, 3, 7], Quantity::Extinction),
        ] {
            let mut volume = Volume { quantity, ..random_volume(size) };
            volume.texels.iter_mut().filter(|texel| texel[3] == 1.0).for_each(|texel| *texel = [0.1; 4]);
            let sums = |volume: &Volume| {
                let mut sum = [0.0; 4];
                for &texel in &volume.texels {
                    let [red, green, blue, alpha] = texel.map(f64::from);
                    let rate = rate(alpha, quantity);
                    let values = [red * rate, green * rate, blue * rate, depth(alpha, quantity)];
                    sum = std::array::from_fn(|i| sum[i] + values[i]);
                }
                sum.map(|sum| (sum / volume.texels.len() as f64) as f32)
            };
            let levels =
                |volume: &Volume| Pyramid::build_with(volume.clone(), Filter::Extinction, [1.0; 3]).levels;
            let expected = sums(&volume);
            for level in levels(&volume) {
                // An opacity of a that is off by e has a depth that is off by e / (1 - a), and texels go to 1 - 1e-3.
                assert_near(sums(&level), expected, 1e3 * ROUNDING);
            }
            volume.texels[3][3] += 0.05;
            assert!((sums(&levels(&volume)[1])[3] - expected[3]).abs() > 1e-4);
        }
    }

    #[test]
    fn of_a_wall_with_a_hole_the_wall_is_left() {
        let texels = vec![[0.0, 0.25, 0.0, 0.5], [1.0, 0.0, 0.0, 1.0]];
        let volume = Volume::new([2, 1, 1], texels).unwrap();
        let merged = Pyramid::build_with(volume, Filter::Extinction, [1.0; 3]).levels[1].texels[0];
        assert_eq!(merged, [1.0, 0.0, 0.0, 1.0]);
    }
}
