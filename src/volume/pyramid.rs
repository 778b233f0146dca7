//! The mip pyramid of a semi-transparent volume.
//!
//! Dufort, Leblanc, Poulin, "Interactive Rendering of Meso-structure Surface Details using
//! Semi-transparent 3D Textures", 2005, section 5.2: layers are combined from the top down by the opacity
//! equation along w, and then colour, weighted by opacity, is averaged across u and v.
//!
//! What is made exact here:
//!
//! - **Alpha keeps its meaning** as the opacity of one `opacity_distance`, however thick its texel becomes.
//!   For a column of layers with alphas `a_i` and thicknesses `t_i`, the transmittance is
//!   `T = prod (1 - a_i)^t_i`, and the merged alpha is `1 - T^(1 / sum t_i)`. A merged column is thus as
//!   deep, optically, as its layers.
//! - **Thickness is counted in w-texels of level 0**, which is the default `opacity_distance`. Compositing is
//!   associative then: four layers give one colour, merged at once or two by two.
//! - **Colour is emission**. A layer of premultiplied colour `p` sends out `p E(a, t)`, where
//!   `E(a, t) = (1 - (1 - a)^t) / a` and `E(0, t) = t`. What leaves the top of the column,
//!   `C = sum p_i E(a_i, t_i) prod_(j above i) (1 - a_j)^t_j`, is what the merged texel sends out:
//!   `p = C / E(a, sum t_i)`. That is the composited straight colour times the merged alpha, without its 0 / 0.
//! - **Odd sizes**: a level has `floor(n / 2)` texels, as Vulkan has it, and each covers `n / floor(n / 2)` finer
//!   ones with the weights of that coverage (Guthe and Heckbert, "Non-power-of-two mipmapping", 2005).
//!   No texel is dropped and none is counted twice.

use rayon::prelude::*;

use super::{Pyramid, Quantity, Volume};

impl Pyramid {
    /// The pyramid above `volume`: each level is its predecessor with every axis longer than one texel
    /// halved (rounding down), first along w and then across u and v, as the head of this file derives.
    ///
    /// Texels are computed in f64 and independently, so that the result does not depend on the threads.
    pub fn build(volume: Volume) -> Self {
        let layers = f64::from(volume.size[2]);
        let mut levels = vec![volume];
        while let Some(finer) = levels.last().filter(|level| level.size != [1; 3]) {
            let thickness = layers / f64::from(finer.size[2]);
            levels.push(halved(finer, thickness));
        }
        Self { levels }
    }
}

/// The next level after `finer`, whose layers are `thickness` w-texels of level 0 thick.
fn halved(finer: &Volume, thickness: f64) -> Volume {
    let size = finer.size.map(|n| (n / 2).max(1));
    let [width, height, depth] = size.map(|n| n as usize);
    let mut texels = vec![[0.0; 4]; width * height * depth];
    texels.par_chunks_mut(width).enumerate().for_each(|(row, out)| {
        let (y, z) = ((row % height) as u32, (row / height) as u32);
        for (x, texel) in (0..).zip(out) {
            let mut sum = [0.0; 4];
            for (v, weight_v) in coverage(finer.size[1], y) {
                for (u, weight_u) in coverage(finer.size[0], x) {
                    let column = merged_column(finer, [u, v], z, thickness);
                    for (sum, value) in sum.iter_mut().zip(column) {
                        *sum += weight_u * weight_v * value;
                    }
                }
            }
            let area = texels_per_coarse(finer.size[0]) * texels_per_coarse(finer.size[1]);
            // Only a glow near the end of f32, gathered from several layers, would overflow.
            *texel = sum.map(|value| (value / area).min(f64::from(f32::MAX)) as f32);
        }
    });
    Volume { size, texels, quantity: finer.quantity }
}

/// The layers under coarse layer `coarse_w` at the fine column `[u, v]`, merged from the top (largest w) down.
fn merged_column(finer: &Volume, [u, v]: [u32; 2], coarse_w: u32, thickness: f64) -> [f64; 4] {
    if finer.size[2] == 1 {
        return finer.texel([u, v, 0]).map(f64::from);
    }
    if finer.quantity == Quantity::Extinction {
        // Emission and extinction per length: their means keep what a thin path sends out and takes away.
        let mut sum = [0.0; 4];
        for (w, weight) in coverage(finer.size[2], coarse_w) {
            let texel = finer.texel([u, v, w]);
            for (sum, value) in sum.iter_mut().zip(texel) {
                *sum += weight * f64::from(value);
            }
        }
        return sum.map(|value| value / texels_per_coarse(finer.size[2]));
    }
    let mut emitted = [0.0; 3];
    let mut depth_above = 0.0_f64;
    for (w, weight) in coverage(finer.size[2], coarse_w).rev() {
        let [red, green, blue, alpha] = finer.texel([u, v, w]).map(f64::from);
        let length = weight * thickness;
        let seen = emission(alpha, length) * (-depth_above).exp();
        for (emitted, colour) in emitted.iter_mut().zip([red, green, blue]) {
            *emitted += colour * seen;
        }
        depth_above += optical_depth(alpha) * length;
    }
    let length = texels_per_coarse(finer.size[2]) * thickness;
    let alpha = opacity(depth_above / length);
    let [red, green, blue] = emitted.map(|colour| colour / emission(alpha, length));
    [red, green, blue, alpha]
}

/// The fine texels that coarse texel `coarse` of an axis of `fine_size` covers, each with the part, in (0, 1],
/// of it that is covered.
pub(super) fn coverage(fine_size: u32, coarse: u32) -> impl DoubleEndedIterator<Item = (u32, f64)> {
    let coarse_size = f64::from((fine_size / 2).max(1));
    let (count, weights) = match fine_size {
        1 => (1, [1.0; 3]),
        even if even % 2 == 0 => (2, [1.0; 3]),
        _ => (3, [1.0 - f64::from(coarse) / coarse_size, 1.0, f64::from(coarse + 1) / coarse_size]),
    };
    (2 * coarse..2 * coarse + count).zip(0..count as usize).map(move |(fine, tap)| (fine, weights[tap]))
}

/// The length of a coarse texel in fine ones: the sum of the weights of its [`coverage`].
pub(super) fn texels_per_coarse(fine_size: u32) -> f64 {
    f64::from(fine_size) / f64::from((fine_size / 2).max(1))
}

/// The optical depth of one `opacity_distance` of opacity `alpha`: infinite for 1.
fn optical_depth(alpha: f64) -> f64 {
    -(-alpha).ln_1p()
}

/// The opacity of an optical depth.
fn opacity(depth: f64) -> f64 {
    -(-depth).exp_m1()
}

/// `E(alpha, length)`: what a layer sends out, relative to its premultiplied colour.
fn emission(alpha: f64, length: f64) -> f64 {
    if alpha == 0.0 || length == 1.0 { length } else { opacity(optical_depth(alpha) * length) / alpha }
}

#[cfg(test)]
mod tests {
    use rand::RngExt as _;
    use rand_pcg::Pcg64;

    use super::*;

    /// A texel is rounded to f32 once a level: half a unit in the last place, each of at most 8 levels here.
    const ROUNDING: f32 = 8.0 * f32::EPSILON / 2.0;

    fn random_volume(size: [u32; 3]) -> Volume {
        let mut random = Pcg64::new(5, 2);
        let count = size.iter().product::<u32>();
        let texel = |_| {
            let alpha = match random.random_range(0..6) {
                0 => 0.0,
                1 => 1.0,
                _ => random.random::<f32>(),
            };
            [random.random::<f32>() * alpha, random.random::<f32>() * alpha, 2.0 * alpha, alpha]
        };
        Volume::new(size, (0..count).map(texel).collect()).unwrap()
    }

    fn column(texels: &[[f32; 4]]) -> Volume {
        Volume::new([1, 1, texels.len() as u32], texels.to_vec()).unwrap()
    }

    fn top(pyramid: &Pyramid) -> [f32; 4] {
        let last = pyramid.levels.last().unwrap();
        assert_eq!(last.size, [1; 3]);
        last.texels[0]
    }

    fn assert_near(found: [f32; 4], expected: [f32; 4], relative: f32) {
        for (found, expected) in found.into_iter().zip(expected) {
            assert!((found - expected).abs() <= relative * expected.abs(), "{found} is not {expected}");
        }
    }

    #[test]
    fn levels_halve_down_to_one_texel() {
        let sizes =
            |size| Pyramid::build(random_volume(size)).levels.iter().map(|l| l.size).collect::<Vec<_>>();
        assert_eq!(sizes([1, 1, 1]), [[1, 1, 1]]);
        assert_eq!(sizes([5, 3, 7]), [[5, 3, 7], [2, 1, 3], [1, 1, 1]]);
        assert_eq!(sizes([8, 2, 1]), [[8, 2, 1], [4, 1, 1], [2, 1, 1], [1, 1, 1]]);
    }

    #[test]
    fn every_level_is_a_valid_volume() {
        for size in [[5, 3, 7], [16, 8, 4], [1, 9, 2], [13, 1, 31]] {
            for Volume { size, texels, .. } in Pyramid::build(random_volume(size)).levels {
                Volume::new(size, texels).unwrap();
            }
        }
    }

    #[test]
    fn a_constant_volume_stays_constant() {
        for texel in [[0.1, 0.2, 0.3, 0.4], [3.0, 0.0, 0.5, 1.0], [1e-7, 0.0, 0.0, 1e-7], [0.0; 4]] {
            for size in [[8, 8, 8], [5, 3, 7], [1, 1, 1]] {
                let count = size.iter().product::<u32>() as usize;
                let pyramid = Pyramid::build(Volume::new(size, vec![texel; count]).unwrap());
                for found in pyramid.levels.iter().flat_map(|level| &level.texels) {
                    assert_near(*found, texel, ROUNDING);
                    assert_eq!((found[3] == 0.0, found[3] == 1.0), (texel[3] == 0.0, texel[3] == 1.0));
                }
            }
        }
    }

    #[test]
    fn a_column_keeps_its_optical_depth_along_w() {
        for layers in [2, 3, 7, 8, 13, 32] {
            let mut random = Pcg64::new(layers, 1);
            let texels: Vec<_> = (0..layers).map(|_| [0.0, 0.0, 0.0, 0.9 * random.random::<f32>()]).collect();
            // Optical depth over the whole shell, in units of the level-0 layer: layers times the mean.
            let mean_depth = |level: &Volume| {
                let depths = level.texels.iter().map(|texel| -(1.0 - f64::from(texel[3])).ln());
                depths.sum::<f64>() / level.texels.len() as f64
            };
            let levels = Pyramid::build(column(&texels)).levels;
            let expected = mean_depth(&levels[0]);
            for level in &levels {
                // An alpha in error by e has a depth in error by e / (1 - alpha), and alpha <= 0.9.
                assert!((mean_depth(level) - expected).abs() <= f64::from(ROUNDING) / 0.1);
            }
            let mut thicker = texels.clone();
            thicker[0][3] += 1e-4;
            assert!((mean_depth(&Pyramid::build(column(&thicker)).levels[1]) - expected).abs() > 1e-6);
        }
    }

    #[test]
    fn layers_merged_two_by_two_are_layers_composited_at_once() {
        let volume = random_volume([1, 1, 8]);
        let mut colour = [0.0; 4];
        for texel in volume.texels.iter().rev() {
            for channel in 0..4 {
                colour[channel] += (1.0 - colour[3]) * texel[channel];
            }
        }
        let alpha = 1.0 - (1.0 - colour[3]).powf(1.0 / 8.0);
        let scale = if colour[3] == 0.0 { 0.0 } else { alpha / colour[3] };
        let expected = [colour[0] * scale, colour[1] * scale, colour[2] * scale, alpha];
        // The expectation itself takes two roundings a layer.
        assert_near(top(&Pyramid::build(volume)), expected, 4.0 * ROUNDING);
    }

    #[test]
    fn a_glow_without_opacity_is_gathered_and_stays_finite() {
        let glow = [1.5, 0.0, 3.0, 0.0];
        assert_eq!(top(&Pyramid::build(column(&[glow; 4]))), glow);
        assert_eq!(top(&Pyramid::build(column(&[[0.0, 0.0, 0.0, 1.0], glow]))), [1.5, 0.0, 3.0, 1.0]);
        assert_eq!(
            top(&Pyramid::build(column(&[[f32::MAX, 0.0, 0.0, 1.0], [f32::MAX, 0.0, 0.0, 0.0]])))[0],
            f32::MAX
        );
    }

    #[test]
    fn an_opaque_layer_hides_what_is_below_it() {
        let (red, blue) = ([1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]);
        assert_eq!(top(&Pyramid::build(column(&[blue, red]))), red);
        assert_eq!(top(&Pyramid::build(column(&[red, blue]))), blue);
        assert_eq!(top(&Pyramid::build(column(&[blue, red, [0.0; 4]]))), red);
        let veil = [0.0, 0.25, 0.0, 0.25];
        assert_eq!(top(&Pyramid::build(column(&[red, veil]))), [0.75, 0.25, 0.0, 1.0]);
    }

    #[test]
    fn layers_of_one_colour_keep_it() {
        let straight = [0.8, 0.1, 1.5];
        let texels = [0.0, 0.3, 1e-6, 0.7, 0.05].map(|alpha: f32| {
            let [red, green, blue] = straight.map(|colour: f32| colour * alpha);
            [red, green, blue, alpha]
        });
        for level in Pyramid::build(column(&texels)).levels.iter().skip(1) {
            for texel in &level.texels {
                let [red, green, blue] = straight.map(|colour| colour * texel[3]);
                assert_near(*texel, [red, green, blue, texel[3]], ROUNDING);
            }
        }
    }

    #[test]
    fn across_u_and_v_premultiplied_colour_is_averaged() {
        for size in [[8, 4, 1], [5, 3, 1], [7, 1, 1], [1, 13, 1]] {
            let mean = |volume: &Volume| {
                let count = volume.texels.len() as f64;
                [0, 1, 2, 3].map(|c| volume.texels.iter().map(|t| f64::from(t[c])).sum::<f64>() / count)
            };
            let levels = Pyramid::build(random_volume(size)).levels;
            let expected = mean(&levels[0]).map(|value| value as f32);
            for level in &levels {
                assert_near(mean(level).map(|value| value as f32), expected, ROUNDING);
            }
        }
        let cell = Volume::new([2, 1, 1], vec![[1.0, 0.0, 0.0, 1.0], [0.0; 4]]).unwrap();
        assert_eq!(top(&Pyramid::build(cell)), [0.5, 0.0, 0.0, 0.5]);
    }

    #[test]
    fn coverage_counts_every_fine_texel_once() {
        for fine_size in 1..40 {
            let mut covered = vec![0.0; fine_size as usize];
            for coarse in 0..(fine_size / 2).max(1) {
                let taps: Vec<_> = coverage(fine_size, coarse).collect();
                let sum: f64 = taps.iter().map(|(_, weight)| weight).sum();
                assert!((sum - texels_per_coarse(fine_size)).abs() < 1e-12);
                for (fine, weight) in taps {
                    covered[fine as usize] += weight;
                }
            }
            assert!(covered.iter().all(|part: &f64| (part - 1.0).abs() < 1e-12), "{fine_size}: {covered:?}");
        }
    }

    #[test]
    fn threads_do_not_change_a_bit() {
        let volume = random_volume([17, 12, 9]);
        let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let crowd = rayon::ThreadPoolBuilder::new().num_threads(7).build().unwrap();
        let built = alone.install(|| Pyramid::build(volume.clone()));
        assert_eq!(built, crowd.install(|| Pyramid::build(volume)));
    }
}
