//! Mean transmittance over the texel: a beam as wide as a merged texel, and as long as it, loses and gains what beams
//! through the single texels under it would, each as if its texel went on for the whole length `t`:
//!
//! ```text
//!   exp(-D(a) t) = sum w_i exp(-D(a_i) t)      p E(a, t) = sum w_i p_i E(a_i, t)
//! ```
//!
//! It knows no direction, and takes what lies in line for longer than it is: half a wall lets half of the light through,
//! across it as well as along it. Levels are made from level 0, not from one another.

use super::coverage::{coverage, volume_of};
use super::medium::Passage;
use crate::volume::Volume;

/// The level of `size` over the full volume, whose merged texels are `length` opacity distances long.
pub fn level(full: &Volume, size: [u32; 3], length: f64) -> Volume {
    volume_of(size, full.quantity, |at| {
        let axis = |axis: usize| coverage(full.size[axis], size[axis], at[axis]);
        let taps = axis(2).flat_map(|w| axis(1).flat_map(move |v| axis(0).map(move |u| [u, v, w])));
        let passages = taps.map(|taps| {
            let texel = full.texel(taps.map(|tap| tap.0)).map(f64::from);
            let weight = taps.iter().map(|tap| tap.1).product();
            (weight, Passage::through(texel, length, full.quantity))
        });
        Passage::mean(passages).texel(length, full.quantity)
    })
}
