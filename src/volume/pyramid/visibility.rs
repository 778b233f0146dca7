//! What part of the light from outside the shell reaches each texel: the weight of what is seen sideways.

use rayon::prelude::*;

use super::coverage::{Coverage, index_of, texels_of, texels_per_coarse};

/// Rays come in at a slant, and their way down is as much longer: `int (1 / cos) cos / int cos` over the hemisphere.
const MEAN_SLANT: f64 = 2.0;

/// What is hidden has a colour nonetheless, for where the shell is cut open: it counts as if so much of it were seen.
const LEAST: f64 = 1e-3;

/// A number for each texel of a volume, or for each piece of a column of texels.
pub struct Visibility {
    size: [u32; 3],
    parts: Vec<f32>,
}

impl Visibility {
    /// Of the middle of each texel of a volume of `size`, through the layers above it, which are `layer` opacity distances thick;
    /// `depths` are those of its texels over one.
    pub fn from_above(size: [u32; 3], depths: &[f64], layer: f64) -> Self {
        let slice = size[0] as usize * size[1] as usize;
        let mut parts = vec![0.0; depths.len()];
        let mut above = vec![0.0; slice];
        for (parts, depths) in parts.chunks_mut(slice).zip(depths.chunks(slice)).rev() {
            let columns = parts.par_iter_mut().zip(depths).zip(&mut above);
            columns.for_each(|((part, depth), above)| {
                let within = MEAN_SLANT * layer * depth;
                *part = (-(*above + 0.5 * within)).exp().max(LEAST) as f32;
                *above += within;
            });
        }
        Self { size, parts }
    }

    /// Of one texel.
    pub fn at(&self, texel: [u32; 3]) -> f64 {
        f64::from(self.parts[index_of(self.size, texel)])
    }

    /// The means over the pieces of columns along an axis that is cut into `coarse`.
    pub fn mean_along(&self, axis: usize, coarse: u32) -> Self {
        let fine = self.size[axis];
        let mut size = self.size;
        size[axis] = coarse;
        let coverage = Coverage::new(fine, coarse);
        let mean = |at: [u32; 3]| {
            let parts = coverage.of(at[axis]).iter().map(|&(texel, part)| {
                let mut place = at;
                place[axis] = texel;
                part * self.at(place)
            });
            (parts.sum::<f64>() / texels_per_coarse(fine, coarse)) as f32
        };
        Self { size, parts: texels_of(size, mean) }
    }
}

#[cfg(test)]
mod tests {
    use super::super::medium::depths;
    use super::*;
    use crate::volume::Volume;

    #[test]
    fn what_lies_above_hides() {
        let texels = [0.5, 0.0, 0.5, 1.0, 0.25, 0.0].map(|alpha| [0.0, 0.0, 0.0, alpha]);
        let volume = Volume::new([2, 1, 3], texels.to_vec()).unwrap();
        let visibility = Visibility::from_above(volume.size, &depths(&volume), 0.5);
        // From the top: a quarter, then half of the light is stopped, of a slanted ray through half an opacity distance.
        let left = [0.75_f64.sqrt(), 0.75 * 0.5_f64.sqrt(), 0.75 * 0.5 * 0.5_f64.sqrt()];
        for (w, expected) in [(2, left[0]), (1, left[1]), (0, left[2])] {
            assert!((visibility.at([0, 0, w]) - expected).abs() < 1e-7);
        }
        assert_eq!(
            [2, 1, 0].map(|w| visibility.at([1, 0, w])),
            [1.0, f64::from(LEAST as f32), f64::from(LEAST as f32)]
        );
        let along = visibility.mean_along(0, 1);
        assert!((along.at([0, 0, 2]) - 0.5 * (left[0] + 1.0)).abs() < 1e-7);
    }
}
