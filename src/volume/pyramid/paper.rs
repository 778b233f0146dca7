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

use super::column::{Sight, merged_along};
use super::coverage::{coverage, halved, texels_per_coarse, volume_of};
use crate::volume::Volume;

/// The level after `finer`, whose layers are `thickness` opacity distances thick.
pub fn next(finer: &Volume, thickness: f64) -> Volume {
    let size = halved(finer.size);
    let columns = merged_along(finer, Sight { axis: 2, from_above: true }, size[2], thickness);
    across(&columns, size)
}

/// The mean of the texels that each covers, as they are.
fn across(columns: &Volume, size: [u32; 3]) -> Volume {
    volume_of(size, columns.quantity, |[x, y, z]| {
        let mut sum = [0.0; 4];
        for (v, weight_v) in coverage(columns.size[1], size[1], y) {
            for (u, weight_u) in coverage(columns.size[0], size[0], x) {
                for (sum, value) in sum.iter_mut().zip(columns.texel([u, v, z])) {
                    *sum += weight_u * weight_v * f64::from(value);
                }
            }
        }
        let area = texels_per_coarse(columns.size[0], size[0]) * texels_per_coarse(columns.size[1], size[1]);
        sum.map(|sum| sum / area)
    })
}
