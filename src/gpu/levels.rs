//! Whether a device blends levels of detail as exactly as f32 does. Vulkan lets it round the weight, and tells by
//! `VkPhysicalDeviceLimits::mipmapPrecisionBits` how many bits are left at least, not how many are: so it is measured.

use std::sync::Arc;

use ash::vk;

use super::device::Gpu;
use super::pipeline::{Keeps, Pipeline, PipelineInfo};
use super::texture::Texture3d;
use super::{Batch, Draw, Marked, Sampled, Target, draw, shaders};
use crate::Result;

/// So many places between two levels are tried.
const PLACES: u32 = 64;

/// The largest error of a weight, a few roundings of f32. Devices that round weights to 8 bits err by 2^-9.
const EXACT: f32 = 1.0 / (1 << 20) as f32;

impl Gpu {
    /// Whether a texture that is read between two levels of detail is their mean to f32: else shaders must read both, which takes
    /// longer. Measured by drawing, once.
    ///
    /// # Errors
    /// [`Error::Device`](crate::Error::Device) or [`Error::OutOfMemory`](crate::Error::OutOfMemory) where the device fails.
    pub fn blends_levels(self: &Arc<Self>) -> Result<bool> {
        if let Some(&known) = self.blends_levels.get() {
            return Ok(known);
        }
        let blends = measure(self)?;
        Ok(*self.blends_levels.get_or_init(|| blends))
    }
}

fn measure(gpu: &Arc<Gpu>) -> Result<bool> {
    let levels = [([2; 3], &[[0.0; 4]; 8][..]), ([1; 3], &[[1.0; 4]][..])];
    let texture = Texture3d::upload_colours(gpu, "levels of detail", &levels, vk::SamplerMipmapMode::LINEAR)?;
    let target = Target::new(gpu, [PLACES, 1], 1, Marked::Never)?;
    let info = PipelineInfo {
        vertex: shaders::LAYER_VERT.with(&[]),
        fragment: shaders::LEVELS_FRAG.with(&[]),
        constants: &[],
        storage_buffers: &[],
        uniform_buffers: &[],
        texel_buffers: &[],
        textures: &[8],
        minified: true,
        push_constant_bytes: 4,
        keeps: Keeps::Blend,
    };
    draw(&Draw {
        target: &target,
        clears: true,
        buffers: &[],
        textures: &[(8, Sampled::Texture(&texture))],
        push_constants: &[0; 4],
        batches: &[Batch { pipeline: &Pipeline::new(gpu, &target, &info)?, vertices: 0..3 }],
        between: &|_| Ok(()),
    })?;
    Ok(are_exact(&target.read(0)))
}

/// Of what `glsl/levels.frag.glsl` draws.
fn are_exact(places: &[[f32; 4]]) -> bool {
    places.iter().all(|[read, expected, ..]| (read - expected).abs() <= EXACT)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_of_fewer_bits_are_found() {
        let places = |bits: u32| -> Vec<[f32; 4]> {
            let level = |place: u32| (0.618_034 * (place as f32 + 0.5)).fract();
            let rounded = |level: f32| (level * (1 << bits) as f32).round() / (1 << bits) as f32;
            (0..PLACES).map(level).map(|level| [rounded(level), level, 0.0, 1.0]).collect()
        };
        assert!(are_exact(&places(23)));
        assert!(!are_exact(&places(16)) && !are_exact(&places(8)));
    }
}
