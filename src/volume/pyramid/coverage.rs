//! Which fine texels a coarse one covers. A level has `floor(n / 2)` texels an axis, as Vulkan has it, and each covers
//! `n / floor(n / 2)` finer ones with the weights of that coverage (Guthe and Heckbert, "Non-power-of-two mipmapping",
//! 2005): no texel is dropped and none is counted twice.

use rayon::prelude::*;

use crate::volume::{Quantity, Volume};

/// The size of the level after one of this size.
pub fn halved(size: [u32; 3]) -> [u32; 3] {
    size.map(|n| (n / 2).max(1))
}

/// The texels, of `fine` along an axis, that texel `coarse_texel` of `coarse` covers, each with the part, in (0, 1], of it
/// that is covered.
pub fn coverage(
    fine: u32,
    coarse: u32,
    coarse_texel: u32,
) -> impl DoubleEndedIterator<Item = (u32, f64)> + Clone {
    // In parts of a fine texel, `coarse` of which are one: whole numbers.
    let [start, end] = [coarse_texel, coarse_texel + 1].map(|edge| u64::from(edge) * u64::from(fine));
    let part = u64::from(coarse);
    (start / part..end.div_ceil(part)).map(move |texel| {
        let covered = end.min((texel + 1) * part) - start.max(texel * part);
        (texel as u32, covered as f64 / part as f64)
    })
}

/// The length of a coarse texel in fine ones: the sum of the weights of its [`coverage`].
pub fn texels_per_coarse(fine: u32, coarse: u32) -> f64 {
    f64::from(fine) / f64::from(coarse)
}

/// The texels that a coarse texel covers in the plane of two axes, and the part of each that is covered.
pub fn covered_area(
    fine: [u32; 2],
    coarse: [u32; 2],
    texel: [u32; 2],
) -> impl Iterator<Item = ([u32; 2], f64)> + Clone {
    coverage(fine[1], coarse[1], texel[1]).flat_map(move |(v, weight_v)| {
        coverage(fine[0], coarse[0], texel[0]).map(move |(u, weight_u)| ([u, v], weight_u * weight_v))
    })
}

/// A volume whose texels are computed in f64 and independently, so that it does not depend on the threads.
pub fn volume_of(size: [u32; 3], quantity: Quantity, texel: impl Fn([u32; 3]) -> [f64; 4] + Sync) -> Volume {
    let [width, height, depth] = size.map(|n| n as usize);
    let mut texels = vec![[0.0; 4]; width * height * depth];
    texels.par_chunks_mut(width).enumerate().for_each(|(row, out)| {
        let (v, w) = ((row % height) as u32, (row / height) as u32);
        for (u, out) in (0..).zip(out) {
            // Only a glow near the end of f32, gathered from several layers, would overflow.
            *out = texel([u, v, w]).map(|value| value.min(f64::from(f32::MAX)) as f32);
        }
    });
    Volume { size, texels, quantity }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fine_texel_is_covered_once() {
        for fine in 1..40 {
            for coarse in [1, (fine / 4).max(1), (fine / 2).max(1), fine] {
                let mut covered = vec![0.0; fine as usize];
                for texel in 0..coarse {
                    let taps: Vec<_> = coverage(fine, coarse, texel).collect();
                    let sum: f64 = taps.iter().map(|(_, weight)| weight).sum();
                    assert!((sum - texels_per_coarse(fine, coarse)).abs() < 1e-12);
                    for (texel, weight) in taps {
                        assert!(weight > 0.0 && weight <= 1.0);
                        covered[texel as usize] += weight;
                    }
                }
                let once = |part: &f64| (part - 1.0).abs() < 1e-12;
                assert!(covered.iter().all(once), "{fine} by {coarse}: {covered:?}");
            }
        }
    }
}
