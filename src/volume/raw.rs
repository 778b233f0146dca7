//! What a volume file holds, before it means colour and opacity.

use std::fs::File;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::{Volume, texel_at, texel_count};
use crate::{Error, Result, input};

/// The most texels that a file may have: 4 GiB as RGBA in f32. A few kilobytes of compressed zeros can
/// claim, and honestly hold, far more than any machine has.
pub(super) const MAX_TEXELS: usize = 1 << 28;

/// The numbers of a volume file.
///
/// Values mean **what the format itself says that its numbers mean**: normalised formats (KTX2 UNORM, PNG) are
/// fractions of their full range, 0..=1, and sRGB formats are decoded to linear; integers and floats
/// (NRRD, KTX2 SFLOAT) are themselves. [`RawVolume::full_scale`] says which value stands for 1.
#[derive(Debug, Clone, PartialEq)]
pub struct RawVolume {
    /// Where it was read from, for messages.
    pub path: PathBuf,
    /// The container and the format of its values, for people.
    pub format: String,
    /// Texels along u, v, w; each at least 1.
    pub size: [u32; 3],
    /// 1: scalar; 2: luminance, alpha; 3: red, green, blue; 4: red, green, blue, alpha.
    pub channels: u32,
    /// `channels` values a texel, u fastest, then v, then w; all finite.
    pub values: Vec<f32>,
    /// The value that means 1 as a colour or an opacity: the largest one of an integer type, otherwise 1.
    pub full_scale: f32,
    /// Whether the file says that its colours are premultiplied.
    pub alpha_mode: AlphaMode,
}

/// How colour relates to alpha.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum AlphaMode {
    /// Colour is what an opaque texel would show.
    #[default]
    Straight,
    /// Colour has been multiplied by alpha.
    Premultiplied,
}

/// What `mesoshell volume info` tells of a file.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct VolumeInfo {
    /// The container and the format of its values, for people.
    pub format: String,
    /// Texels along u, v, w.
    pub size: [u32; 3],
    /// Values a texel.
    pub channels: u32,
    /// For each channel, its values as [`RawVolume::values`] has them.
    pub ranges: Vec<ChannelRange>,
    /// What level 0 of the texture takes as RGBA in f32.
    pub texture_bytes: u64,
}

/// The values of a channel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ChannelRange {
    /// The least.
    pub min: f32,
    /// The greatest.
    pub max: f32,
    /// The arithmetic mean.
    pub mean: f64,
}

impl RawVolume {
    /// The numbers of a volume that was computed, not read; `path` is where its recipe or its like was.
    pub fn of(volume: Volume, path: &Path, format: String) -> Self {
        let Volume { size, texels, .. } = volume;
        Self {
            path: path.to_owned(),
            format,
            size,
            channels: 4,
            values: texels.into_flattened(),
            full_scale: 1.0,
            alpha_mode: AlphaMode::Premultiplied,
        }
    }

    /// The same numbers, once they are known to be finite and as many as the size says.
    pub(super) fn validated(self) -> Result<Self> {
        let Self { path, size, channels, values, .. } = &self;
        if Some(values.len()) != texel_count(*size).map(|count| count * *channels as usize) {
            let [width, height, depth] = size;
            let message = format!(
                "holds {} values, not the {width} x {height} x {depth} x {channels} that it promises",
                values.len()
            );
            return Err(Error::input(path, message));
        }
        if let Some(index) = values.iter().position(|value| !value.is_finite()) {
            let [x, y, z] = texel_at(*size, index / *channels as usize);
            let channel = index % *channels as usize;
            let message = format!("channel {channel} of texel ({x}, {y}, {z}) is {}", values[index]);
            return Err(Error::input(path, message).with_help("every value of a volume must be finite"));
        }
        Ok(self)
    }

    /// The extent, the format and the range of the values.
    pub fn info(&self) -> VolumeInfo {
        let channels = self.channels as usize;
        let texels = self.values.len() / channels;
        let range = |channel| {
            let values = || self.values.iter().copied().skip(channel).step_by(channels);
            ChannelRange {
                min: values().fold(f32::INFINITY, f32::min),
                max: values().fold(f32::NEG_INFINITY, f32::max),
                mean: values().map(f64::from).sum::<f64>() / texels as f64,
            }
        };
        VolumeInfo {
            format: self.format.clone(),
            size: self.size,
            channels: self.channels,
            ranges: (0..channels).map(range).collect(),
            texture_bytes: (texels * size_of::<[f32; 4]>()) as u64,
        }
    }
}

/// The size of a volume and its number of values, from what a header claims: each axis positive, and the
/// count small enough for byte counts of up to 16 a value.
pub(super) fn claimed_size(path: &Path, size: [u64; 3], channels: u32) -> Result<([u32; 3], usize)> {
    let [width, height, depth] = size;
    let impossible = || {
        let message = format!("claims {width} x {height} x {depth} texels of {channels} channels");
        Error::input(path, message)
            .with_help("every axis needs at least one texel, and the data must fit into memory")
    };
    let narrow = |n: u64| u32::try_from(n).map_err(|_| impossible());
    let size = [narrow(width)?, narrow(height)?, narrow(depth)?];
    let count = texel_count(size).and_then(|count| count.checked_mul(channels as usize));
    let count = count.filter(|&count| count <= isize::MAX as usize / 16).ok_or_else(impossible)?;
    Ok((size, count))
}

/// Refuses a volume of more than [`MAX_TEXELS`]; to be asked once the file's length vouches for its size.
pub(super) fn check_fits_memory(path: &Path, size: [u32; 3]) -> Result<()> {
    let [width, height, depth] = size;
    if texel_count(size).is_some_and(|count| count <= MAX_TEXELS) {
        return Ok(());
    }
    let message = format!(
        "{}: a volume of {width} x {height} x {depth} texels is more than {MAX_TEXELS} texels",
        path.display()
    );
    Err(Error::OutOfMemory { message, help: Some("downsample the volume or cut a part out of it".into()) })
}

/// A regular file, open for reading, and its length in bytes.
pub(super) fn open(path: &Path) -> Result<(File, u64)> {
    input::open(path).map_err(|error| unreadable(path, &error))
}

/// The system would not let a file be read.
pub(super) fn unreadable(path: &Path, error: &std::io::Error) -> Error {
    Error::input(path, format!("cannot be read: {error}"))
}
