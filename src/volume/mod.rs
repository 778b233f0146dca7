//! Volumes: RGBA 3D textures, their files, recipes and mip pyramids.

mod contact;
mod directions;
mod file;
pub(crate) mod grey;
mod haze;
mod interpretation;
mod ktx2_file;
mod loss;
mod nrrd;
mod proximity;
mod pyramid;
mod raw;
pub mod recipe;
mod sample;
pub(crate) mod stack;
mod strip;
mod transfer;
pub mod voxelize;

pub use contact::contact_sheet;
pub use directions::{DirectionLevel, Directions};
pub use file::{info, is_recipe, read, read_or_make, size};
pub use haze::Haze;
pub use interpretation::Interpretation;
pub use ktx2_file::{write_raw, write_volume};
pub use loss::Loss;
pub use proximity::{Proximity, ProximityLevel, commonest, part_like};
pub use pyramid::Filter;
pub use raw::{AlphaMode, ChannelRange, RawVolume, VolumeInfo};
pub use sample::Sample;
pub use strip::strip;
pub use transfer::{ControlPoint, InvalidTransferFunction, TransferFunction};

/// What the fourth channel of a [`Volume`] holds. It is interpolated as such.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum Quantity {
    /// The opacity, 0..1, of a path of one `opacity_distance`: the medium of the 2005 paper.
    #[default]
    Opacity,
    /// The extinction: the optical depth, at least 0, of a path of one `opacity_distance`. Simulation data are densities.
    /// Along a ray it is a cubic in each cell, so its integral has a closed form.
    Extinction,
}

/// An RGBA 3D texture in texture space (u, v, w).
///
/// Alpha is what [`Quantity`] says; colour is linear and premultiplied by alpha. Values between texel centres `(i + 1/2) / n` are linearly interpolated; u and v
/// repeat, w clamps to the edge.
#[derive(Debug, Clone, PartialEq)]
pub struct Volume {
    /// Texels along u, v, w; each at least 1.
    pub size: [u32; 3],
    /// `[r a, g a, b a, a]`, u fastest, then v, then w; all finite and at least 0, an opacity at most 1.
    pub texels: Vec<[f32; 4]>,
    /// What `a` is.
    pub quantity: Quantity,
}

/// A volume and its ever coarser copies; level `l` has `max(1, size >> l)` texels an axis.
///
/// [`Pyramid::build`] says how a level is made from the one before it.
#[derive(Debug, Clone, PartialEq)]
pub struct Pyramid {
    /// Level 0 is the full volume; the last level is one texel.
    pub levels: Vec<Volume>,
}

/// Why a size and some texels are not a [`Volume`].
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum InvalidVolume {
    /// An axis has no texels, or the three together have more than can be counted.
    #[error("a volume of {} x {} x {} texels is impossible", size[0], size[1], size[2])]
    Size {
        /// Texels along u, v, w.
        size: [u32; 3],
    },
    /// The size and the texels disagree.
    #[error("{} x {} x {} texels were promised, but there are {found}", size[0], size[1], size[2])]
    Count {
        /// Texels along u, v, w.
        size: [u32; 3],
        /// The texels that there are.
        found: usize,
    },
    /// A value is NaN, infinite or out of range.
    #[error(
        "{channel} of texel ({}, {}, {}) is {value}; it must be {}",
        at[0], at[1], at[2],
        if *channel == Channel::Alpha { "in 0..=1, or finite and at least 0 if an extinction" } else { "finite and at least 0" }
    )]
    Value {
        /// The texel's indices along u, v, w.
        at: [u32; 3],
        /// The component in question.
        channel: Channel,
        /// Its value.
        value: f32,
    },
}

/// A component of a texel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Channel {
    /// Premultiplied linear red.
    Red,
    /// Premultiplied linear green.
    Green,
    /// Premultiplied linear blue.
    Blue,
    /// Opacity.
    Alpha,
}

impl std::fmt::Display for Channel {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Red => "red",
            Self::Green => "green",
            Self::Blue => "blue",
            Self::Alpha => "alpha",
        })
    }
}

impl Volume {
    /// A volume of `size` texels along u, v, w, whose `texels` are `[r a, g a, b a, a]`, u fastest, with opacities. Colour where
    /// alpha is 0 would not be seen, and is dropped.
    ///
    /// # Errors
    /// The first of the ranges promised by [`Volume`]'s fields that is broken, and where.
    pub fn new(size: [u32; 3], texels: Vec<[f32; 4]>) -> Result<Self, InvalidVolume> {
        Self::of(Quantity::Opacity, size, texels)
    }

    /// The same with opacities or extinctions.
    ///
    /// # Errors
    /// As [`Volume::new`].
    pub fn of(quantity: Quantity, size: [u32; 3], mut texels: Vec<[f32; 4]>) -> Result<Self, InvalidVolume> {
        let most = if quantity == Quantity::Opacity { 1.0 } else { f32::MAX };
        let count = texel_count(size).ok_or(InvalidVolume::Size { size })?;
        if count != texels.len() {
            return Err(InvalidVolume::Count { size, found: texels.len() });
        }
        for (index, [red, green, blue, alpha]) in texels.iter().copied().enumerate() {
            let valid = [
                (Channel::Red, red, red.is_finite() && red >= 0.0),
                (Channel::Green, green, green.is_finite() && green >= 0.0),
                (Channel::Blue, blue, blue.is_finite() && blue >= 0.0),
                (Channel::Alpha, alpha, (0.0..=most).contains(&alpha)),
            ];
            if let Some(&(channel, value, _)) = valid.iter().find(|(.., valid)| !valid) {
                return Err(InvalidVolume::Value { at: texel_at(size, index), channel, value });
            }
        }
        texels.iter_mut().filter(|texel| texel[3] == 0.0).for_each(|texel| *texel = [0.0; 4]);
        Ok(Self { size, texels, quantity })
    }

    /// The texel at `(u, v, w)` indices.
    ///
    /// # Panics
    /// Where an index is not less than the size along its axis.
    pub fn texel(&self, at: [u32; 3]) -> [f32; 4] {
        assert!((0..3).all(|axis| at[axis] < self.size[axis]), "texel {at:?} of {:?}", self.size);
        let [x, y, z] = at.map(|i| i as usize);
        self.texels[(z * self.size[1] as usize + y) * self.size[0] as usize + x]
    }
}

/// The product of a size; `None` if it is zero or overflows.
fn texel_count(size: [u32; 3]) -> Option<usize> {
    size.iter().try_fold(1usize, |count, &n| count.checked_mul(n as usize)).filter(|&count| count > 0)
}

/// The indices along u, v, w of the texel that is stored at `index`.
fn texel_at(size: [u32; 3], index: usize) -> [u32; 3] {
    let [width, height] = [size[0] as usize, size[1] as usize];
    [index % width, index / width % height, index / width / height].map(|i| i as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colour_without_opacity_is_dropped() {
        let texels = vec![[0.5, 0.0, 2.0, 0.0], [0.5, 0.0, 2.0, 1e-30]];
        for quantity in [Quantity::Opacity, Quantity::Extinction] {
            let volume = Volume::of(quantity, [2, 1, 1], texels.clone()).unwrap();
            assert_eq!(volume.texels, [[0.0; 4], texels[1]]);
        }
    }

    #[test]
    fn a_bad_value_is_told_with_its_place() {
        let size = [2, 3, 4];
        let good = vec![[0.5, 0.0, 2.0, 1.0]; 24];
        assert!(Volume::new(size, good.clone()).is_ok());
        let bad = [(0, f32::NAN), (1, f32::INFINITY), (2, -1e-9), (3, 1.0 + 1e-6), (3, f32::NAN)];
        for (channel, value) in bad {
            let mut texels = good.clone();
            texels[(2 * 3 + 1) * 2 + 1][channel] = value;
            let message = Volume::new(size, texels).unwrap_err().to_string();
            assert!(message.contains("(1, 1, 2)"), "{message}");
            assert!(message.contains(["red", "green", "blue", "alpha"][channel]), "{message}");
        }
    }

    #[test]
    fn sizes_must_agree_with_the_texels() {
        assert_eq!(Volume::new([1, 0, 1], vec![]), Err(InvalidVolume::Size { size: [1, 0, 1] }));
        let size = [u32::MAX; 3];
        assert_eq!(Volume::new(size, vec![]), Err(InvalidVolume::Size { size }));
        let size = [1, 2, 1];
        assert_eq!(Volume::new(size, vec![[0.0; 4]]), Err(InvalidVolume::Count { size, found: 1 }));
    }
}
