//! Which fine texels a coarse one covers. A level has `floor(n / 2)` texels an axis, as Vulkan has it, and each covers
//! `n / floor(n / 2)` finer ones with the weights of that coverage (Guthe and Heckbert, "Non-power-of-two mipmapping",
//! 2005): no texel is dropped and none is counted twice.

use rayon::prelude::*;

use crate::volume::{Quantity, Volume};

/// The size of the level after one of this size.
pub fn halved(size: [u32; 3]) -> [u32; 3] {
    size.map(|n| (n / 2).max(1))
}

/// Which of the texels along an axis each texel of a coarser level covers there.
pub struct Coverage {
    /// Of one coarse texel after another: a fine one, and the part of it, in (0, 1], that is covered.
    taps: Vec<(u32, f64)>,
    /// Where the taps of each coarse texel begin, and where those of the last end.
    begins: Vec<usize>,
}

impl Coverage {
    /// Of `fine` texels by `coarse` ones.
    pub fn new(fine: u32, coarse: u32) -> Self {
        // In parts of a fine texel, `coarse` of which are one: whole numbers.
        let part = u64::from(coarse);
        let mut taps = Vec::new();
        let mut begins = vec![0];
        for texel in 0..coarse {
            let [start, end] = [texel, texel + 1].map(|edge| u64::from(edge) * u64::from(fine));
            taps.extend((start / part..end.div_ceil(part)).map(|texel| {
                let covered = end.min((texel + 1) * part) - start.max(texel * part);
                (texel as u32, covered as f64 / part as f64)
            }));
            begins.push(taps.len());
        }
        Self { taps, begins }
    }

    /// What one coarse texel covers, upwards.
    pub fn of(&self, coarse_texel: u32) -> &[(u32, f64)] {
        let texel = coarse_texel as usize;
        &self.taps[self.begins[texel]..self.begins[texel + 1]]
    }
}

/// The length of a coarse texel in fine ones: the sum of the parts that it covers.
pub fn texels_per_coarse(fine: u32, coarse: u32) -> f64 {
    f64::from(fine) / f64::from(coarse)
}

/// Which texels of a volume each of a coarser level covers.
pub struct VolumeCoverage([Coverage; 3]);

impl VolumeCoverage {
    /// Of a volume of `fine` texels by one of `coarse`.
    pub fn new(fine: [u32; 3], coarse: [u32; 3]) -> Self {
        Self([0, 1, 2].map(|axis| Coverage::new(fine[axis], coarse[axis])))
    }

    /// The texels under one coarse texel, and the part of each that is covered.
    pub fn of(&self, at: [u32; 3]) -> impl Iterator<Item = ([u32; 3], f64)> + Clone {
        let [along_u, along_v, along_w] = [0, 1, 2].map(|axis| self.0[axis].of(at[axis]));
        along_w.iter().flat_map(move |&(w, part_w)| {
            along_v.iter().flat_map(move |&(v, part_v)| {
                along_u.iter().map(move |&(u, part_u)| ([u, v, w], part_u * part_v * part_w))
            })
        })
    }
}

/// A volume whose texels are computed in f64 and independently, so that it does not depend on the threads.
pub fn volume_of(size: [u32; 3], quantity: Quantity, texel: impl Fn([u32; 3]) -> [f64; 4] + Sync) -> Volume {
    Volume { size, texels: texels_of(size, |at| texel(at).map(stored)), quantity }
}

/// Rounded to f32. Only a glow near its end, gathered from several layers, would overflow.
pub fn stored(value: f64) -> f32 {
    value.min(f64::from(f32::MAX)) as f32
}

/// Where a texel is in a list of those of a volume.
pub fn index_of(size: [u32; 3], [u, v, w]: [u32; 3]) -> usize {
    let [width, height, u, v, w] = [size[0], size[1], u, v, w].map(|i| i as usize);
    (w * height + v) * width + u
}

/// Something for each texel of a volume, computed independently.
pub fn texels_of<T: Send>(size: [u32; 3], texel: impl Fn([u32; 3]) -> T + Sync) -> Vec<T> {
    let [width, height, depth] = size.map(|n| n as usize);
    let at = |index: usize| {
        let row = index / width;
        [index % width, row % height, row / height].map(|i| i as u32)
    };
    let all = (0..width * height * depth).into_par_iter().with_min_len(width);
    all.map(|index| texel(at(index))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fine_texel_is_covered_once() {
        for fine in 1..40 {
            for coarse in [1, (fine / 4).max(1), (fine / 2).max(1), fine] {
                let mut covered = vec![0.0; fine as usize];
                let coverage = Coverage::new(fine, coarse);
                for texel in 0..coarse {
                    let taps = coverage.of(texel);
                    let sum: f64 = taps.iter().map(|(_, weight)| weight).sum();
                    assert!((sum - texels_per_coarse(fine, coarse)).abs() < 1e-12);
                    for &(texel, weight) in taps {
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
