//! Extinction and transmittance combined per direction. A beam along an axis that fills a merged texel is a bundle of
//! columns: *along* a column optical depths add up, *across* the bundle transmittances average, both at the texel's real
//! length `t`.
//!
//! ```text
//!   T_d = mean over columns of exp(-sum D(a_i) t_i)      C_d = mean over columns of what comes out of them, seen from d
//! ```
//!
//! A texel holds one number for all directions. What is seen of it is the *mean of the light*, so opacities and light are
//! averaged over the directions, not optical depths: the arithmetic mean is what has the least squared error of a pixel
//! whose direction is not known. Where the texel is not a cube, each direction's passage is first brought to one length,
//! the edges' geometric mean.
//!
//! Sideways it is looked at from both ends of u and of v, down from the top of w, since the eye is outside the shell. A
//! surface that is seen from all sides has mean square direction cosines of 1/2 along its normal and 1/4 along each
//! tangent (weighted by projected area: `int cos^3 / int cos` over the hemisphere), and these are the axes' weights.

use super::column::{Sight, merged_along};
use super::coverage::{covered_area, halved, texels_per_coarse, volume_of};
use super::medium::Passage;
use crate::volume::{Pyramid, Volume};

/// Directions of sight and their weights.
fn sights() -> [(Sight, f64); 5] {
    let var = |n: &str, d: f64| std::env::var(n).ok().and_then(|s| s.parse().ok()).unwrap_or(d);
    let w = var("MS_W", 0.5);
    let s = 0.25 * (1.0 - w);
    [
        (Sight { axis: 0, from_above: false }, s),
        (Sight { axis: 0, from_above: true }, s),
        (Sight { axis: 1, from_above: false }, s),
        (Sight { axis: 1, from_above: true }, s),
        (Sight { axis: 2, from_above: true }, w),
    ]
}

/// All levels; `texel` are the edges of one of `full`, in opacity distances.
pub fn pyramid(full: Volume, texel: [f64; 3]) -> Pyramid {
    let mut sizes = vec![full.size];
    while sizes[sizes.len() - 1] != [1; 3] {
        sizes.push(halved(sizes[sizes.len() - 1]));
    }
    let full_size = full.size;
    let edges = |size: [u32; 3]| [0, 1, 2].map(|i| texel[i] * texels_per_coarse(full_size[i], size[i]));
    // [level][texel][sight]
    let mut seen: Vec<Vec<Vec<Passage>>> = vec![Vec::new(); sizes.len()];
    for (sight, _) in sights() {
        let mut columns = full.clone();
        for (&size, seen) in sizes.iter().zip(&mut seen).skip(1) {
            let edge = edges(columns.size)[sight.axis];
            columns = merged_along(&columns, sight, size[sight.axis], edge);
            let passages = bundles(&columns, sight, size, edges(size));
            seen.push(passages);
        }
    }
    let mut levels = vec![full];
    for (&size, seen) in sizes.iter().zip(&seen).skip(1) {
        let common = edges(size).iter().product::<f64>().cbrt();
        let quantity = levels[0].quantity;
        levels.push(volume_of(size, quantity, |[u, v, w]| {
            let index = ((w * size[1] + v) * size[0] + u) as usize;
            let passages = sights().into_iter().zip(seen).map(|((_, weight), seen)| (weight, seen[index]));
            Passage::mean(passages).texel(common, quantity)
        }));
    }
    Pyramid { levels }
}

fn bundles(columns: &Volume, sight: Sight, size: [u32; 3], edges: [f64; 3]) -> Vec<Passage> {
    use rayon::prelude::*;
    let [a, b] = [(sight.axis + 1) % 3, (sight.axis + 2) % 3];
    let own = edges[sight.axis];
    let common = edges.iter().product::<f64>().cbrt();
    (0..size.iter().product::<u32>())
        .into_par_iter()
        .map(|index| {
            let at = [index % size[0], index / size[0] % size[1], index / size[0] / size[1]];
            let area = covered_area([columns.size[a], columns.size[b]], [size[a], size[b]], [at[a], at[b]]);
            let passages = area.map(|([i, j], weight)| {
                let mut place = at;
                (place[a], place[b]) = (i, j);
                let texel = columns.texel(place).map(f64::from);
                (weight, Passage::through(texel, own, columns.quantity))
            });
            let texel = Passage::mean(passages).texel(own, columns.quantity);
            Passage::through(texel, common, columns.quantity)
        })
        .collect()
}
