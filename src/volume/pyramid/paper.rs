//! The filter of Dufort, Leblanc, Poulin, "Interactive Rendering of Meso-structure Surface Details using Semi-transparent 3D
//! Textures", 2005, section 5.2: layers are combined from the top down by the opacity equation along w, and then colour,
//! weighted by opacity, is averaged across u and v.
//!
//! What is made exact here:
//!
//! - **Alpha keeps its meaning** as the opacity of one `opacity_distance`, however thick its texel becomes. For a column of
//!   layers with alphas `a_i` and thicknesses `t_i`, the transmittance is `T = prod (1 - a_i)^t_i`, and the merged alpha is
//!   `1 - T^(1 / sum t_i)`. A merged column is thus as deep, optically, as its layers.
//! - **Colour is what the column sends out at its top**, from texels of colour `p_i E(a_i, t_i)`, shared by the merged one:
//!   its straight colour is the composited one, without its 0 / 0.
//!
//! Across u and v it averages opacities of *one opacity distance*. A texel that is many of them thick lets through less than
//! that: half of it filled with a wall has an alpha of 1/2, and stops all but `2^-t` of the light, not half of it.

use super::column::Columns;
use super::coverage::{Coverage, texels_per_coarse, volume_of};
use super::geometry::Geometry;
use super::medium::depths;
use crate::volume::Volume;

/// The levels after the full volume, each from the one before it.
pub fn levels(full: &Volume, geometry: &Geometry) -> Vec<Volume> {
    let mut levels: Vec<Volume> = Vec::new();
    for level in 1..geometry.sizes.len() {
        let finer = levels.last().unwrap_or(full);
        levels.push(next(finer, geometry.sizes[level], geometry.edges(level - 1)[2]));
    }
    levels
}

/// The level of `size` after `finer`, whose layers are `thickness` opacity distances thick.
fn next(finer: &Volume, size: [u32; 3], thickness: f64) -> Volume {
    let columns = Columns::<1>::of(finer, &depths(finer), 2, size[2], thickness);
    let length = thickness * texels_per_coarse(finer.size[2], size[2]);
    let columns =
        volume_of(columns.size, finer.quantity, |at| columns.passage(at, 1.0).texel(length, finer.quantity));
    across(&columns, size)
}

/// The mean of the texels that each covers, as they are.
fn across(columns: &Volume, size: [u32; 3]) -> Volume {
    let [along_u, along_v] = [0, 1].map(|axis| Coverage::new(columns.size[axis], size[axis]));
    let area = texels_per_coarse(columns.size[0], size[0]) * texels_per_coarse(columns.size[1], size[1]);
    volume_of(size, columns.quantity, |[x, y, z]| {
        let mut sum = [0.0; 4];
        for &(v, part_v) in along_v.of(y) {
            for &(u, part_u) in along_u.of(x) {
                for (sum, value) in sum.iter_mut().zip(columns.texel([u, v, z])) {
                    *sum += part_u * part_v * f64::from(value);
                }
            }
        }
        sum.map(|sum| sum / area)
    })
}

#[cfg(test)]
mod tests {
    use rand::RngExt as _;
    use rand_pcg::Pcg64;

    use super::super::tests::{ROUNDING, assert_near, random_volume};
    use crate::volume::{Filter, Pyramid, Volume};

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
}
