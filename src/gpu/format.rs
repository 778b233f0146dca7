//! The floating-point RGBA formats of targets and textures.

use std::borrow::Cow;

use ash::vk;
use half::f16;

use super::device::Gpu;

/// By falling accuracy; every device blends and filters the last.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Rgba {
    F32,
    F16,
}

impl Rgba {
    /// The most accurate format whose images with optimal tiling can do all of `features`.
    pub(super) fn best(gpu: &Gpu, features: vk::FormatFeatureFlags) -> Option<Self> {
        [Self::F32, Self::F16].into_iter().find(|format| gpu.supports(format.raw(), features))
    }

    pub(super) fn raw(self) -> vk::Format {
        match self {
            Self::F32 => vk::Format::R32G32B32A32_SFLOAT,
            Self::F16 => vk::Format::R16G16B16A16_SFLOAT,
        }
    }

    /// Of one pixel or texel.
    pub(super) fn bytes(self) -> u64 {
        match self {
            Self::F32 => 16,
            Self::F16 => 8,
        }
    }

    pub(super) fn encode(self, values: &[[f32; 4]]) -> Cow<'_, [u8]> {
        match self {
            Self::F32 => Cow::Borrowed(bytemuck::cast_slice(values)),
            Self::F16 => {
                let halves: Vec<_> = values.iter().map(|value| value.map(f16::from_f32)).collect();
                Cow::Owned(bytemuck::cast_slice(&halves).to_vec())
            }
        }
    }

    pub(super) fn decode(self, bytes: &[u8]) -> Vec<[f32; 4]> {
        match self {
            Self::F32 => bytemuck::pod_collect_to_vec(bytes),
            Self::F16 => {
                let halves: Vec<[f16; 4]> = bytemuck::pod_collect_to_vec(bytes);
                halves.into_iter().map(|value| value.map(f16::to_f32)).collect()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_encoded_is_decoded() {
        let values = [[0.0, 0.5, 1.0, 0.25], [1.0 / 3.0, 2.0, -1.0, 65504.0]];
        for format in [Rgba::F32, Rgba::F16] {
            let bytes = format.encode(&values);
            assert_eq!(bytes.len() as u64, 2 * format.bytes());
            let decoded = format.decode(&bytes);
            for (found, expected) in decoded.iter().flatten().zip(values.iter().flatten()) {
                // Half a unit in the last of 11 bits.
                let bound = if format == Rgba::F32 { 0.0 } else { expected.abs() * 2f32.powi(-11) };
                assert!((found - expected).abs() <= bound, "{found} for {expected}");
            }
        }
    }
}
