//! The mip pyramid of a semi-transparent volume: what a texel holds that stands for many.
//!
//! A pixel that is `n` texels wide sees the mean light of the rays through it. A merged texel, `n` times as long as well,
//! should therefore let through, and send out, what the texels under it do in the mean *at its own length*. Alpha stays the
//! opacity of one `opacity_distance`, so a merged texel that is `t` of them long and lets through `T` has the alpha
//! `1 - T^(1 / t)`. Filters differ in how they get at `T` and at the light: see [`Filter`].

mod column;
mod coverage;
mod directional;
mod extinction;
mod medium;
mod paper;
mod transmittance;

use serde::{Deserialize, Serialize};

use self::coverage::{halved, texels_per_coarse};
use super::{Pyramid, Volume};

/// How texels are merged into the next level's.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Filter {
    /// The 2005 paper, section 5.2: layers composited along w, then opacities averaged across u and v.
    #[default]
    Paper,
    /// The mean extinction: exact for what hides nothing, too opaque elsewhere.
    Extinction,
    /// The mean transmittance over the merged texel's length, whatever the direction.
    Transmittance,
    /// Optical depths summed along each axis, transmittances averaged across it, and then the mean over the axes.
    Directional,
}

impl Filter {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Paper, Self::Extinction, Self::Transmittance, Self::Directional];

    /// As scene files have it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Extinction => "extinction",
            Self::Transmittance => "transmittance",
            Self::Directional => "directional",
        }
    }
}

impl Pyramid {
    /// The pyramid above `volume` by the default filter, where each of its texels is one `opacity_distance` along every axis.
    pub fn build(volume: Volume) -> Self {
        Self::build_with(volume, Filter::default(), [1.0; 3])
    }

    /// The pyramid above `volume`: each level is its predecessor with every axis longer than one texel halved (rounding
    /// down). `texel` are the lengths, in opacity distances, of a texel of `volume` along u, v and w; positive.
    ///
    /// Texels are computed in f64 and independently, so that the result does not depend on the threads.
    pub fn build_with(volume: Volume, filter: Filter, texel: [f64; 3]) -> Self {
        let full_size = volume.size;
        let edges = |size: [u32; 3]| [0, 1, 2].map(|i| texel[i] * texels_per_coarse(full_size[i], size[i]));
        if filter == Filter::Directional {
            return directional::pyramid(volume, texel);
        }
        let mut levels = vec![volume];
        while let Some(finer) = levels.last().filter(|level| level.size != [1; 3]) {
            let size = halved(finer.size);
            let next = match filter {
                Filter::Paper => paper::next(finer, edges(finer.size)[2]),
                Filter::Extinction => extinction::next(finer),
                Filter::Transmittance => {
                    transmittance::level(&levels[0], size, edges(size).iter().product::<f64>().cbrt())
                }
                Filter::Directional => unreachable!(),
            };
            levels.push(next);
        }
        Self { levels }
    }
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

    fn paper(volume: Volume) -> Pyramid {
        Pyramid::build_with(volume, Filter::Paper, [1.0; 3])
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
        let sizes = |size| paper(random_volume(size)).levels.iter().map(|l| l.size).collect::<Vec<_>>();
        assert_eq!(sizes([1, 1, 1]), [[1, 1, 1]]);
        assert_eq!(sizes([5, 3, 7]), [[5, 3, 7], [2, 1, 3], [1, 1, 1]]);
        assert_eq!(sizes([8, 2, 1]), [[8, 2, 1], [4, 1, 1], [2, 1, 1], [1, 1, 1]]);
    }

    #[test]
    fn every_level_is_a_valid_volume() {
        for size in [[5, 3, 7], [16, 8, 4], [1, 9, 2], [13, 1, 31]] {
            for Volume { size, texels, .. } in paper(random_volume(size)).levels {
                Volume::new(size, texels).unwrap();
            }
        }
    }

    #[test]
    fn a_constant_volume_stays_constant() {
        for texel in [[0.1, 0.2, 0.3, 0.4], [3.0, 0.0, 0.5, 1.0], [1e-7, 0.0, 0.0, 1e-7], [0.0; 4]] {
            for size in [[8, 8, 8], [5, 3, 7], [1, 1, 1]] {
                let count = size.iter().product::<u32>() as usize;
                let pyramid = paper(Volume::new(size, vec![texel; count]).unwrap());
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
            let levels = paper(column(&texels)).levels;
            let expected = mean_depth(&levels[0]);
            for level in &levels {
                // An alpha in error by e has a depth in error by e / (1 - alpha), and alpha <= 0.9.
                assert!((mean_depth(level) - expected).abs() <= f64::from(ROUNDING) / 0.1);
            }
            let mut thicker = texels.clone();
            thicker[0][3] += 1e-4;
            assert!((mean_depth(&paper(column(&thicker)).levels[1]) - expected).abs() > 1e-6);
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
        assert_near(top(&paper(volume)), expected, 4.0 * ROUNDING);
    }

    #[test]
    fn a_glow_without_opacity_is_gathered_and_stays_finite() {
        let glow = [1.5, 0.0, 3.0, 0.0];
        assert_eq!(top(&paper(column(&[glow; 4]))), glow);
        assert_eq!(top(&paper(column(&[[0.0, 0.0, 0.0, 1.0], glow]))), [1.5, 0.0, 3.0, 1.0]);
        assert_eq!(top(&paper(column(&[[f32::MAX, 0.0, 0.0, 1.0], [f32::MAX, 0.0, 0.0, 0.0]])))[0], f32::MAX);
    }

    #[test]
    fn an_opaque_layer_hides_what_is_below_it() {
        let (red, blue) = ([1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]);
        assert_eq!(top(&paper(column(&[blue, red]))), red);
        assert_eq!(top(&paper(column(&[red, blue]))), blue);
        assert_eq!(top(&paper(column(&[blue, red, [0.0; 4]]))), red);
        let veil = [0.0, 0.25, 0.0, 0.25];
        assert_eq!(top(&paper(column(&[red, veil]))), [0.75, 0.25, 0.0, 1.0]);
    }

    #[test]
    fn layers_of_one_colour_keep_it() {
        let straight = [0.8, 0.1, 1.5];
        let texels = [0.0, 0.3, 1e-6, 0.7, 0.05].map(|alpha: f32| {
            let [red, green, blue] = straight.map(|colour: f32| colour * alpha);
            [red, green, blue, alpha]
        });
        for level in paper(column(&texels)).levels.iter().skip(1) {
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
            let levels = paper(random_volume(size)).levels;
            let expected = mean(&levels[0]).map(|value| value as f32);
            for level in &levels {
                assert_near(mean(level).map(|value| value as f32), expected, ROUNDING);
            }
        }
        let cell = Volume::new([2, 1, 1], vec![[1.0, 0.0, 0.0, 1.0], [0.0; 4]]).unwrap();
        assert_eq!(top(&paper(cell)), [0.5, 0.0, 0.0, 0.5]);
    }

    #[test]
    fn threads_do_not_change_a_bit() {
        let volume = random_volume([17, 12, 9]);
        let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let crowd = rayon::ThreadPoolBuilder::new().num_threads(7).build().unwrap();
        let built = alone.install(|| paper(volume.clone()));
        assert_eq!(built, crowd.install(|| paper(volume)));
    }
}
