//! How one value is stored in a KTX2 texture.

use half::f16;
use ktx2::Format;

use crate::frame::srgb::{linear_from_srgb, srgb_from_linear};

/// The type of a stored value; the same for all channels of a texture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sample {
    /// 8 bits, 0..=1.
    Unorm8,
    /// 8 bits, 0..=1, with red, green and blue on the sRGB curve.
    Srgb8,
    /// 16 bits, 0..=1.
    Unorm16,
    /// IEEE 754 binary16.
    Float16,
    /// IEEE 754 binary32.
    Float32,
}

/// The formats of 1 to 4 channels of each sample type.
const FORMATS: [(Sample, [Format; 4]); 5] = [
    (Sample::Unorm8, [Format::R8_UNORM, Format::R8G8_UNORM, Format::R8G8B8_UNORM, Format::R8G8B8A8_UNORM]),
    (Sample::Srgb8, [Format::R8_SRGB, Format::R8G8_SRGB, Format::R8G8B8_SRGB, Format::R8G8B8A8_SRGB]),
    (
        Sample::Unorm16,
        [Format::R16_UNORM, Format::R16G16_UNORM, Format::R16G16B16_UNORM, Format::R16G16B16A16_UNORM],
    ),
    (
        Sample::Float16,
        [Format::R16_SFLOAT, Format::R16G16_SFLOAT, Format::R16G16B16_SFLOAT, Format::R16G16B16A16_SFLOAT],
    ),
    (
        Sample::Float32,
        [Format::R32_SFLOAT, Format::R32G32_SFLOAT, Format::R32G32B32_SFLOAT, Format::R32G32B32A32_SFLOAT],
    ),
];

impl Sample {
    /// The sample type and the number of channels of a format, if it is one of ours.
    pub(super) fn of(format: Format) -> Option<(Self, u32)> {
        FORMATS.iter().find_map(|(sample, formats)| {
            let index = formats.iter().position(|&candidate| candidate == format)?;
            Some((*sample, index as u32 + 1))
        })
    }

    /// The format of 1 to 4 channels of this type.
    pub(super) fn format(self, channels: u32) -> Format {
        FORMATS[self as usize].1[channels as usize - 1]
    }

    pub(super) fn bytes(self) -> usize {
        match self {
            Self::Unorm8 | Self::Srgb8 => 1,
            Self::Unorm16 | Self::Float16 => 2,
            Self::Float32 => 4,
        }
    }

    /// Whether a value is in the range of this type; it may still be rounded.
    pub(super) fn can_store(self, value: f32) -> bool {
        match self {
            Self::Unorm8 | Self::Srgb8 | Self::Unorm16 => (0.0..=1.0).contains(&value),
            Self::Float16 => f16::from_f32(value).is_finite(),
            Self::Float32 => value.is_finite(),
        }
    }

    /// The values that little-endian `bytes` store, `channels` of them a texel.
    pub(super) fn decode(self, bytes: &[u8], channels: u32) -> Vec<f32> {
        let unorm8 = |&byte: &u8| f32::from(byte) / 255.0;
        match self {
            Self::Unorm8 => bytes.iter().map(unorm8).collect(),
            Self::Srgb8 => {
                let value = |(i, byte)| {
                    if is_alpha(i, channels) { unorm8(byte) } else { linear_from_srgb(unorm8(byte)) }
                };
                bytes.iter().enumerate().map(value).collect()
            }
            Self::Unorm16 => bytes
                .as_chunks()
                .0
                .iter()
                .map(|&pair| f32::from(u16::from_le_bytes(pair)) / 65535.0)
                .collect(),
            Self::Float16 => {
                bytes.as_chunks().0.iter().map(|&pair| f16::from_le_bytes(pair).to_f32()).collect()
            }
            Self::Float32 => bytes.as_chunks().0.iter().map(|&four| f32::from_le_bytes(four)).collect(),
        }
    }

    /// The inverse of [`Sample::decode`], for values that [`Sample::can_store`], rounded to the nearest.
    pub(super) fn encode(self, values: impl Iterator<Item = f32>, channels: u32) -> Vec<u8> {
        let unorm8 = |value: f32| (value * 255.0).round() as u8;
        match self {
            Self::Unorm8 => values.map(unorm8).collect(),
            Self::Srgb8 => {
                let byte =
                    |(i, value)| unorm8(if is_alpha(i, channels) { value } else { srgb_from_linear(value) });
                values.enumerate().map(byte).collect()
            }
            Self::Unorm16 => {
                values.flat_map(|value| ((value * 65535.0).round() as u16).to_le_bytes()).collect()
            }
            Self::Float16 => values.flat_map(|value| f16::from_f32(value).to_le_bytes()).collect(),
            Self::Float32 => values.flat_map(f32::to_le_bytes).collect(),
        }
    }
}

/// Vulkan decodes red, green and blue of sRGB formats, and only those.
fn is_alpha(index: usize, channels: u32) -> bool {
    channels == 4 && index % 4 == 3
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Sample; 5] =
        [Sample::Unorm8, Sample::Srgb8, Sample::Unorm16, Sample::Float16, Sample::Float32];

    #[test]
    fn formats_are_found_both_ways() {
        for sample in ALL {
            for channels in 1..=4 {
                assert_eq!(Sample::of(sample.format(channels)), Some((sample, channels)));
            }
        }
        assert_eq!(Sample::of(Format::BC7_UNORM_BLOCK), None);
    }

    #[test]
    fn every_stored_value_survives_decoding_and_encoding() {
        let words = (0..=u16::MAX).flat_map(u16::to_le_bytes).collect::<Vec<_>>();
        for sample in ALL {
            for channels in [1, 4] {
                let values = sample.decode(&words, channels);
                let exact: Vec<_> = words
                    .chunks(sample.bytes())
                    .zip(&values)
                    .filter(|(_, v)| sample.can_store(**v))
                    .collect();
                assert!(exact.len() >= 31_000);
                let stored: Vec<u8> = exact.iter().flat_map(|(bytes, _)| bytes.iter().copied()).collect();
                // Only floats are left out (NaN and infinity), and they treat alpha as they treat colour.
                assert_eq!(sample.encode(exact.iter().map(|(_, v)| **v), channels), stored, "{sample:?}");
            }
        }
    }
}
