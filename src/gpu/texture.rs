//! 3D textures with mip levels, sampled linearly: u and v repeat, w clamps to the edge.

use std::sync::Arc;

use ash::vk;
use gpu_allocator::MemoryLocation;

use super::buffer::Buffer;
use super::device::{Gpu, vulkan_error};
use super::draw::submit;
use super::target::{DeviceImage, transition};
use crate::volume::Pyramid;
use crate::{Error, Result};

/// A mip pyramid on the device, with its sampler.
#[derive(Debug)]
pub struct Texture3d {
    pub(super) image: DeviceImage,
    pub(super) sampler: vk::Sampler,
    format: vk::Format,
    gpu: Arc<Gpu>,
}

/// Formats by falling accuracy; devices need only offer the last with linear filtering.
const FORMATS: [vk::Format; 2] = [vk::Format::R32G32B32A32_SFLOAT, vk::Format::R16G16B16A16_SFLOAT];

impl Texture3d {
    /// Uploads all levels in the most accurate format that the device filters linearly.
    ///
    /// # Errors
    /// [`Error::Device`] where a side is longer than the device allows; [`Error::OutOfMemory`].
    pub fn upload(gpu: &Arc<Gpu>, name: &'static str, pyramid: &Pyramid) -> Result<Self> {
        let [width, height, depth] = pyramid.levels[0].size;
        let limit = gpu.limits.max_image_dimension3_d;
        if width.max(height).max(depth) > limit {
            return Err(Error::Device {
                message: format!(
                    "{name}: {width} x {height} x {depth} texels; {} takes 3D textures of at most {limit} a side",
                    gpu.info().name
                ),
                help: Some("use a smaller volume or another device".into()),
            });
        }
        let features =
            vk::FormatFeatureFlags::SAMPLED_IMAGE_FILTER_LINEAR | vk::FormatFeatureFlags::TRANSFER_DST;
        let format = FORMATS.into_iter().find(|format| gpu.supports(*format, features)).ok_or_else(|| {
            Error::Device {
                message: format!("{} filters no floating-point 3D texture", gpu.info().name),
                help: None,
            }
        })?;
        let texels: u64 = pyramid.levels.iter().map(|level| level.texels.len() as u64).sum();
        let texel_bytes: u64 = if format == vk::Format::R32G32B32A32_SFLOAT { 16 } else { 8 };
        // Once on the device, once in the staging buffer.
        gpu.check_memory(name, 2 * texels * texel_bytes)?;

        let staging = match format {
            vk::Format::R32G32B32A32_SFLOAT => {
                let data: Vec<[f32; 4]> =
                    pyramid.levels.iter().flat_map(|l| l.texels.iter().copied()).collect();
                Buffer::staging(gpu, name, &data)?
            }
            _ => {
                let half = |texel: &[f32; 4]| texel.map(half::f16::from_f32);
                let data: Vec<[half::f16; 4]> =
                    pyramid.levels.iter().flat_map(|l| l.texels.iter().map(half)).collect();
                Buffer::staging(gpu, name, &data)?
            }
        };
        let levels = u32::try_from(pyramid.levels.len()).expect("at most 32 levels");
        let info = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_3D)
            .format(format)
            .extent(vk::Extent3D { width, height, depth })
            .mip_levels(levels)
            .array_layers(1)
            .samples(vk::SampleCountFlags::TYPE_1)
            .tiling(vk::ImageTiling::OPTIMAL)
            .usage(vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_DST);
        let image = DeviceImage::new(gpu, name, &info, vk::ImageViewType::TYPE_3D, MemoryLocation::GpuOnly)?;

        let mut regions = Vec::new();
        let mut offset = 0;
        for (level, volume) in (0..levels).zip(&pyramid.levels) {
            let [width, height, depth] = volume.size;
            regions.push(
                vk::BufferImageCopy::default()
                    .buffer_offset(offset)
                    .image_subresource(vk::ImageSubresourceLayers {
                        aspect_mask: vk::ImageAspectFlags::COLOR,
                        mip_level: level,
                        base_array_layer: 0,
                        layer_count: 1,
                    })
                    .image_extent(vk::Extent3D { width, height, depth }),
            );
            offset += volume.texels.len() as u64 * texel_bytes;
        }
        submit(gpu, "uploading the volume", |commands| {
            // SAFETY: image and buffer live until the submission is waited for; the regions lie within both.
            unsafe {
                let to_transfer = transition(
                    image.raw,
                    (vk::ImageLayout::UNDEFINED, vk::AccessFlags::empty()),
                    (vk::ImageLayout::TRANSFER_DST_OPTIMAL, vk::AccessFlags::TRANSFER_WRITE),
                );
                let stages = (vk::PipelineStageFlags::TOP_OF_PIPE, vk::PipelineStageFlags::TRANSFER);
                gpu.raw.cmd_pipeline_barrier(
                    commands,
                    stages.0,
                    stages.1,
                    vk::DependencyFlags::empty(),
                    &[],
                    &[],
                    &[to_transfer],
                );
                gpu.raw.cmd_copy_buffer_to_image(
                    commands,
                    staging.raw,
                    image.raw,
                    vk::ImageLayout::TRANSFER_DST_OPTIMAL,
                    &regions,
                );
                let to_shader = transition(
                    image.raw,
                    (vk::ImageLayout::TRANSFER_DST_OPTIMAL, vk::AccessFlags::TRANSFER_WRITE),
                    (vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL, vk::AccessFlags::SHADER_READ),
                );
                gpu.raw.cmd_pipeline_barrier(
                    commands,
                    vk::PipelineStageFlags::TRANSFER,
                    vk::PipelineStageFlags::FRAGMENT_SHADER,
                    vk::DependencyFlags::empty(),
                    &[],
                    &[],
                    &[to_shader],
                );
            }
        })?;
        let sampler_info = vk::SamplerCreateInfo::default()
            .mag_filter(vk::Filter::LINEAR)
            .min_filter(vk::Filter::LINEAR)
            .mipmap_mode(vk::SamplerMipmapMode::NEAREST)
            .address_mode_u(vk::SamplerAddressMode::REPEAT)
            .address_mode_v(vk::SamplerAddressMode::REPEAT)
            .address_mode_w(vk::SamplerAddressMode::CLAMP_TO_EDGE)
            .max_lod(vk::LOD_CLAMP_NONE);
        // SAFETY: a plain sampler of a device that outlives it.
        let sampler = unsafe { gpu.raw.create_sampler(&sampler_info, None) }
            .map_err(|error| vulkan_error("creating the volume's sampler", error))?;
        Ok(Self { image, sampler, format, gpu: gpu.clone() })
    }

    /// The texels' format, as in `"R32G32B32A32_SFLOAT"`.
    pub fn format(&self) -> String {
        format!("{:?}", self.format)
    }
}

impl Drop for Texture3d {
    fn drop(&mut self) {
        // SAFETY: every submission that used the sampler was waited for.
        unsafe { self.gpu.raw.destroy_sampler(self.sampler, None) };
    }
}
