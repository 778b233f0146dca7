//! Normals and tangents of a volume: the "3D normal map" of Dufort, Leblanc, Poulin 2005, section 5.3, read from a file or
//! derived from the volume.

mod derivatives;
mod normals;
mod tangents;

use std::path::Path;

use glam::DVec3;
use rayon::prelude::*;

use super::pyramid::coverage::{VolumeCoverage, index_of, texels_of};
use super::{Volume, ktx2_file, texel_at};
use crate::{Error, Result};

/// A direction for every texel of a volume, and the means of ever more of them.
///
/// Each is in texture space and multiplied by a weight, as colour is by alpha, so that filters mean what is there and no more.
/// Of a volume's normals the components are those of a covector, `(d/du, d/dv, d/dw)`, of its tangents those of a vector,
/// `(du, dv, dw)`: see [`FrameKind`](crate::shell::FrameKind).
#[derive(Debug, Clone, PartialEq)]
pub struct Directions {
    /// As many, of the same sizes, as the volume's pyramid.
    pub levels: Vec<DirectionLevel>,
}

/// One level of [`Directions`].
#[derive(Debug, Clone, PartialEq)]
pub struct DirectionLevel {
    /// Texels along u, v, w.
    pub size: [u32; 3],
    /// `[x weight, y weight, z weight, weight]`, u fastest. In level 0 the weight is the texel's alpha as a part of the largest alpha,
    /// and `(x, y, z)` is of unit length, or shorter by how uncertain it is; both are 0 where there is no direction. In other
    /// levels they are means.
    pub texels: Vec<[f32; 4]>,
}

/// A stored vector shorter than this is none: bytes cannot say 0 exactly, and are 0.0068 off where all three mean it.
const SHORTEST: f64 = 0.01;

impl Directions {
    /// Outward normals: minus the gradient of alpha, by central differences; none where that is 0.
    pub fn normals(volume: &Volume) -> Self {
        Self::of(volume, |at| normals::normal(volume, at).normalize_or_zero())
    }

    /// Tangents of fibres: along which alpha changes least, shorter where that is less clear. Of the two senses it is that which
    /// rises towards w = 1.
    pub fn tangents(volume: &Volume) -> Self {
        let tensors = tangents::Tensors::of(volume);
        Self::of(volume, |at| tensors.tangent(at))
    }

    /// Directions from a KTX2 file of three or four channels, of which the first three are read: `2 x - 1` of UNORM, themselves of
    /// SFLOAT. Lengths do not count, but what is shorter than 0.01 is none.
    ///
    /// # Errors
    /// [`Error::Input`] where the file cannot be read, has other formats or another size than the volume.
    pub fn stored(path: &Path, volume: &Volume) -> Result<Self> {
        let (size, vectors) = ktx2_file::read_vectors(path)?;
        if size != volume.size {
            let [[a, b, c], [d, e, f]] = [size, volume.size];
            let message =
                format!("holds {a} x {b} x {c} directions, but the volume has {d} x {e} x {f} texels");
            return Err(Error::input(path, message).with_help("there must be one direction a texel"));
        }
        let texel = |[u, v, w]: [u32; 3]| {
            let [width, height] = [size[0] as usize, size[1] as usize];
            let vector = vectors[(w as usize * height + v as usize) * width + u as usize];
            if vector.length() < SHORTEST { DVec3::ZERO } else { vector.normalize() }
        };
        Ok(Self::of(volume, texel))
    }

    /// From a vector for each texel, no longer than 1: a shorter one is less certain, or the mean of several.
    pub fn of(volume: &Volume, vector: impl Fn([u32; 3]) -> DVec3 + Sync) -> Self {
        let largest = volume.texels.par_iter().map(|texel| texel[3]).reduce(|| 0.0, f32::max);
        let texel = |(index, [.., alpha]): (usize, &[f32; 4])| {
            let direction = vector(texel_at(volume.size, index));
            if direction == DVec3::ZERO || *alpha == 0.0 {
                return [0.0; 4];
            }
            let weight = f64::from(alpha / largest);
            (weight * direction).extend(weight).to_array().map(|value| value as f32)
        };
        let texels = volume.texels.par_iter().enumerate().map(texel).collect();
        let mut levels = vec![DirectionLevel { size: volume.size, texels }];
        while let Some(finer) = levels.last().filter(|level| level.size != [1; 3]) {
            levels.push(halved(finer));
        }
        Self { levels }
    }
}

/// The next level: means over the finer texels that each coarse one covers.
fn halved(finer: &DirectionLevel) -> DirectionLevel {
    let size = finer.size.map(|n| (n / 2).max(1));
    let coverage = VolumeCoverage::new(finer.size, size);
    let texel = |at| {
        let mut sum = [0.0; 4];
        let mut parts = 0.0;
        for (place, part) in coverage.of(at) {
            let texel = finer.texels[index_of(finer.size, place)];
            for (sum, value) in sum.iter_mut().zip(texel) {
                *sum += part * f64::from(value);
            }
            parts += part;
        }
        sum.map(|sum| (sum / parts) as f32)
    };
    DirectionLevel { size, texels: texels_of(size, texel) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::AlphaMode;
    use crate::volume::{Pyramid, RawVolume, Sample, write_raw};

    fn grey(size: [u32; 3], alpha: impl Fn([u32; 3]) -> f32) -> Volume {
        let count = size.iter().product::<u32>() as usize;
        let texel = |index| {
            let alpha = alpha(texel_at(size, index));
            [0.5 * alpha, 0.5 * alpha, 0.5 * alpha, alpha]
        };
        Volume::new(size, (0..count).map(texel).collect()).unwrap()
    }

    #[test]
    fn levels_are_those_of_the_volume_and_keep_the_mean() {
        let volume = grey([6, 5, 3], |[u, v, w]| ((u + 2 * v + 3 * w) % 5) as f32 / 5.0);
        let directions = Directions::normals(&volume);
        let sizes = directions.levels.iter().map(|level| level.size);
        assert!(sizes.eq(Pyramid::build(volume).levels.iter().map(|level| level.size)));
        let mean = |level: &DirectionLevel| {
            let sum = level
                .texels
                .iter()
                .fold([0.0; 4], |sum: [f64; 4], texel| std::array::from_fn(|c| sum[c] + f64::from(texel[c])));
            sum.map(|value| value / level.texels.len() as f64)
        };
        let whole = mean(&directions.levels[0]);
        for level in &directions.levels {
            for (found, expected) in mean(level).into_iter().zip(whole) {
                // Each level rounds to f32 once, values of at most 1.
                assert!((found - expected).abs() < 4.0 * f64::from(f32::EPSILON), "{found} {expected}");
            }
        }
    }

    #[test]
    fn weights_are_parts_of_the_largest_alpha() {
        let volume = grey([4, 1, 2], |[u, ..]| [0.0, 0.2, 0.4, 0.1][u as usize]);
        let level = &Directions::of(&volume, |[u, ..]| if u == 0 { DVec3::ZERO } else { DVec3::X }).levels[0];
        let weights: Vec<f32> = level.texels[..4].iter().map(|texel| texel[3]).collect();
        assert_eq!(weights, [0.0, 0.5, 1.0, 0.25]);
        assert_eq!(level.texels[1], [0.5, 0.0, 0.0, 0.5]);
    }

    #[test]
    fn stored_vectors_are_decoded_and_measured() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("normals.ktx2");
        let volume = grey([2, 1, 2], |_| 0.5);
        let write = |size: [u32; 3], channels: u32, values: Vec<f32>, sample| {
            let raw = RawVolume {
                path: path.clone(),
                format: String::new(),
                size,
                channels,
                values,
                full_scale: 1.0,
                alpha_mode: AlphaMode::Straight,
            };
            write_raw(&path, &raw, sample).unwrap();
        };
        // Half way between the bytes is none; 0 is -1.
        let half = 127.0 / 255.0;
        write(
            [2, 1, 2],
            3,
            vec![half, half, 1.0, half, half, half, 0.0, half, half, 1.0, half, half],
            Sample::Unorm8,
        );
        let found = Directions::stored(&path, &volume).unwrap();
        let z: Vec<f32> = found.levels[0].texels.iter().map(|texel| texel[2]).collect();
        assert!((z[0] - 1.0).abs() < 1e-4 && z[1] == 0.0 && z[2].abs() < 0.01, "{z:?}");
        assert!((found.levels[0].texels[2][0] + 1.0).abs() < 1e-4);
        assert_eq!(found.levels[0].texels[1], [0.0; 4]);
        let signed = vec![0.0, 0.0, -3.0, 9.0, 0.0, 2.0, 0.0, 9.0, 1.0, 0.0, 0.0, 9.0, 0.0, 0.0, 0.0, 9.0];
        write([2, 1, 2], 4, signed, Sample::Float16);
        let found = Directions::stored(&path, &volume).unwrap();
        let expected = [[0.0, 0.0, -1.0, 1.0], [0.0, 1.0, 0.0, 1.0], [1.0, 0.0, 0.0, 1.0], [0.0; 4]];
        assert_eq!(found.levels[0].texels, expected);
        let refused = |words: &str| {
            let error = Directions::stored(&path, &volume).unwrap_err();
            assert!(error.to_string().contains(words) && error.exit_code() == 3, "{error}");
        };
        write([2, 2, 2], 3, vec![1.0; 24], Sample::Float32);
        refused("2 x 2 x 2 directions, but the volume has 2 x 1 x 2 texels");
        write([2, 1, 2], 2, vec![1.0; 8], Sample::Float32);
        refused("2 channels");
        write([2, 1, 2], 3, vec![1.0; 12], Sample::Srgb8);
        refused("SRGB");
    }
}
