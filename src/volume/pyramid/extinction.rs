//! Mean extinction: the limit of short paths. A merged texel takes from a thin beam, and adds to it, what the texels under it
//! do in the mean:
//!
//! ```text
//!   D(a) = sum w_i D(a_i)      p D(a) / a = sum w_i p_i D(a_i) / a_i      (medium.rs defines D; sum w_i = 1)
//! ```
//!
//! It is exact for a mist too thin to hide anything. Elsewhere it is too opaque, as `exp` of a mean is below the mean of
//! `exp` (Jensen): of a wall with a hole in it nothing but the wall is left.

use super::coverage::{coverage, halved, volume_of};
use super::medium::depth;
use crate::volume::{Quantity, Volume};

/// The level after `finer`.
pub fn next(finer: &Volume) -> Volume {
    let size = halved(finer.size);
    volume_of(size, finer.quantity, |at| {
        let axis = |axis: usize| coverage(finer.size[axis], size[axis], at[axis]);
        let taps = axis(2).flat_map(|w| axis(1).flat_map(move |v| axis(0).map(move |u| [u, v, w])));
        let taps = taps.map(|taps| {
            (taps.iter().map(|tap| tap.1).product::<f64>(), finer.texel(taps.map(|tap| tap.0)).map(f64::from))
        });
        mean(taps, finer.quantity)
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
        Quantity::Opacity => super::medium::opacity(depth),
        Quantity::Extinction => depth,
    };
    let rate = if has_wall { 1.0 } else { rate(alpha, quantity) };
    [red / rate, green / rate, blue / rate, alpha]
}

/// `D(a) / a`, the limit of `E(a, t) / t` for short paths.
fn rate(alpha: f64, quantity: Quantity) -> f64 {
    if alpha == 0.0 { 1.0 } else { depth(alpha, quantity) / alpha }
}
