//! The mip pyramid of a semi-transparent volume: what a texel holds that stands for many.
//!
//! A pixel that is `n` texels wide sees the mean light of the rays through it. A merged texel, `n` times as long as well,
//! should therefore let through, and send out, what the texels under it do in the mean *at its own length*. Alpha stays the
//! opacity of one `opacity_distance`, so a merged texel that is `t` of them long and lets through `T` has the alpha
//! `1 - T^(1 / t)`. Filters differ in how they get at `T` and at the light: see [`Filter`].

mod column;
pub(super) mod coverage;
mod directional;
mod extinction;
mod geometry;
mod medium;
mod paper;
mod transmittance;
mod visibility;

use serde::{Deserialize, Serialize};

use self::geometry::Geometry;
use super::{Pyramid, Volume};

/// How texels are merged into the next level's.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Filter {
    /// The 2005 paper, section 5.2: layers composited along w, then opacities averaged across u and v.
    Paper,
    /// The mean extinction: exact for what hides nothing, too opaque elsewhere.
    Extinction,
    /// The mean transmittance over the merged texel's length, whatever the direction.
    Transmittance,
    /// Optical depths summed along each axis, transmittances averaged across it, and then the mean over the axes of what is
    /// seen from outside the shell: the most accurate of the four, by `benches/antialiasing.toml`.
    #[default]
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
        let geometry = Geometry::new(volume.size, texel);
        let mut coarser = match filter {
            Filter::Paper => paper::levels(&volume, &geometry),
            Filter::Extinction => extinction::levels(&volume, &geometry),
            Filter::Transmittance => transmittance::levels(&volume, &geometry),
            Filter::Directional => directional::levels(&volume, &geometry),
        };
        coarser.insert(0, volume);
        Self { levels: coarser }
    }
}

#[cfg(test)]
mod tests {
    use rand::RngExt as _;
    use rand_pcg::Pcg64;

    use super::*;
    use crate::volume::Quantity;

    /// A texel is rounded to f32 once a level: half a unit in the last place, each of at most 8 levels here.
    pub const ROUNDING: f32 = 8.0 * f32::EPSILON / 2.0;

    /// Texels that are not cubes, and not one opacity distance long.
    const FLAT: [f64; 3] = [0.9, 1.7, 0.3];

    pub fn random_volume(size: [u32; 3]) -> Volume {
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

    pub fn assert_near(found: [f32; 4], expected: [f32; 4], relative: f32) {
        for (found, expected) in found.into_iter().zip(expected) {
            assert!((found - expected).abs() <= relative * expected.abs(), "{found} is not {expected}");
        }
    }

    /// Every filter over every kind of texel.
    fn pyramids(volume: &Volume) -> impl Iterator<Item = (Filter, Pyramid)> {
        Filter::ALL.into_iter().flat_map(move |filter| {
            [[1.0; 3], FLAT].map(|texel| (filter, Pyramid::build_with(volume.clone(), filter, texel)))
        })
    }

    #[test]
    fn levels_halve_down_to_one_texel() {
        for filter in Filter::ALL {
            let sizes = |size| {
                let pyramid = Pyramid::build_with(random_volume(size), filter, FLAT);
                pyramid.levels.iter().map(|level| level.size).collect::<Vec<_>>()
            };
            assert_eq!(sizes([1, 1, 1]), [[1, 1, 1]]);
            assert_eq!(sizes([5, 3, 7]), [[5, 3, 7], [2, 1, 3], [1, 1, 1]]);
            assert_eq!(sizes([8, 2, 1]), [[8, 2, 1], [4, 1, 1], [2, 1, 1], [1, 1, 1]]);
        }
    }

    #[test]
    fn every_level_is_a_valid_volume() {
        for size in [[5, 3, 7], [16, 8, 4], [1, 9, 2], [13, 1, 31]] {
            for quantity in [Quantity::Opacity, Quantity::Extinction] {
                let volume = Volume { quantity, ..random_volume(size) };
                for Volume { size, texels, quantity } in
                    pyramids(&volume).flat_map(|(_, pyramid)| pyramid.levels)
                {
                    Volume::of(quantity, size, texels).unwrap();
                }
            }
        }
    }

    #[test]
    fn a_constant_volume_stays_constant() {
        for texel in [[0.1, 0.2, 0.3, 0.4], [3.0, 0.0, 0.5, 1.0], [1e-7, 0.0, 0.0, 1e-7], [0.0; 4]] {
            for size in [[8, 8, 8], [5, 3, 7], [1, 1, 1]] {
                for quantity in [Quantity::Opacity, Quantity::Extinction] {
                    let texels = vec![texel; size.iter().product::<u32>() as usize];
                    for (_, pyramid) in pyramids(&Volume::of(quantity, size, texels).unwrap()) {
                        for found in pyramid.levels.iter().flat_map(|level| &level.texels) {
                            assert_near(*found, texel, ROUNDING);
                            assert_eq!(
                                (found[3] == 0.0, found[3] == 1.0),
                                (texel[3] == 0.0, texel[3] == 1.0)
                            );
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn what_is_empty_stays_empty_and_walls_stay_walls() {
        // Halves along u, empty and wall, of odd and even sizes: the coarse texels beside the border are neither.
        for width in [16, 13] {
            let paint = |i: u32| if i % width < width / 2 { [0.0; 4] } else { [0.5, 0.0, 0.0, 1.0] };
            let volume = Volume::new([width, 4, 4], (0..width * 16).map(paint).collect()).unwrap();
            for (filter, pyramid) in pyramids(&volume) {
                let level = &pyramid.levels[1];
                for v in 0..level.size[1] {
                    assert_eq!(level.texel([0, v, 0]), [0.0; 4], "{filter:?}");
                    assert_eq!(level.texel([level.size[0] - 1, v, 1]), [0.5, 0.0, 0.0, 1.0], "{filter:?}");
                }
            }
        }
    }

    #[test]
    fn one_colour_stays_that_colour() {
        let straight = [0.8, 0.1, 1.5];
        let mut volume = random_volume([6, 5, 8]);
        for texel in &mut volume.texels {
            *texel = [straight[0] * texel[3], straight[1] * texel[3], straight[2] * texel[3], texel[3]];
        }
        let mut seen = 0;
        for texel in pyramids(&volume).flat_map(|(_, pyramid)| pyramid.levels).flat_map(|level| level.texels)
        {
            let [red, green, blue] = straight.map(|colour| colour * texel[3]);
            // Premultiplied colour and alpha are rounded apart in each texel that is merged.
            assert_near(texel, [red, green, blue, texel[3]], 4.0 * ROUNDING);
            seen += usize::from(texel[3] > 0.0);
        }
        assert!(seen > 1000);
    }

    #[test]
    fn the_length_of_texels_counts() {
        let volume = random_volume([8, 8, 8]);
        let merged =
            |filter, length| Pyramid::build_with(volume.clone(), filter, [length; 3]).levels[1].clone();
        for filter in [Filter::Transmittance, Filter::Directional] {
            assert_ne!(merged(filter, 1.0), merged(filter, 1.1), "{filter:?}");
        }
        // Over short lengths all but the paper's are the mean extinction where there are no walls.
        let mut mist = volume.clone();
        mist.texels.iter_mut().for_each(|texel| *texel = texel.map(|value| 0.5 * value.min(1.0)));
        let thin = |filter| Pyramid::build_with(mist.clone(), filter, [1e-4; 3]).levels[1].clone();
        for texel in 0..64 {
            // To first order in an optical depth of 2e-4 ln 2 times the reach.
            let [a, b] = [Filter::Extinction, Filter::Transmittance].map(|filter| thin(filter).texels[texel]);
            assert_near(a, b, 1e-3);
        }
    }

    #[test]
    fn threads_do_not_change_a_bit() {
        let volume = random_volume([17, 12, 9]);
        let [alone, crowd] = [1, 7].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| pyramids(&volume).map(|(_, pyramid)| pyramid).collect::<Vec<_>>())
        });
        assert_eq!(alone, crowd);
    }
}
