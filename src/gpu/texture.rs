//! 3D textures with mip levels, sampled linearly: u and v repeat, w clamps to the edge.

use std::borrow::Cow;
use std::sync::Arc;

use ash::vk;

use super::buffer::Buffer;
use super::device::{Gpu, vulkan_error};
use super::format::Rgba;
use super::image::{DeviceImage, whole};
use super::submit::submit;
use crate::volume::{Directions, Proximity, Pyramid};
use crate::{Error, Result};

/// A mip pyramid on the device, with its sampler.
#[derive(Debug)]
pub struct Texture3d {
    pub(super) image: DeviceImage,
    pub(super) sampler: vk::Sampler,
    between: vk::SamplerMipmapMode,
    pub(super) gpu: Arc<Gpu>,
}

/// What an image is used for: its layout, and the accesses in the stages that must be done, or must wait.
type Use = (vk::ImageLayout, vk::AccessFlags, vk::PipelineStageFlags);

const NOTHING: Use =
    (vk::ImageLayout::UNDEFINED, vk::AccessFlags::empty(), vk::PipelineStageFlags::TOP_OF_PIPE);
const COPY: Use = (
    vk::ImageLayout::TRANSFER_DST_OPTIMAL,
    vk::AccessFlags::TRANSFER_WRITE,
    vk::PipelineStageFlags::TRANSFER,
);
const SAMPLING: Use = (
    vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL,
    vk::AccessFlags::SHADER_READ,
    vk::PipelineStageFlags::FRAGMENT_SHADER,
);

/// What a device can do with textures that it filters.
const FILTERED: vk::FormatFeatureFlags = vk::FormatFeatureFlags::from_raw(
    vk::FormatFeatureFlags::SAMPLED_IMAGE_FILTER_LINEAR.as_raw()
        | vk::FormatFeatureFlags::TRANSFER_DST.as_raw(),
);

/// A mip level: its size, and its texels as `T`, u fastest.
type Level<'a, T> = ([u32; 3], &'a [T]);

/// What is read between two of so many levels of detail: their mean, where the device knows that well enough.
fn between_levels(gpu: &Arc<Gpu>, levels: usize) -> Result<vk::SamplerMipmapMode> {
    Ok(match levels > 1 && gpu.blends_levels()? {
        true => vk::SamplerMipmapMode::LINEAR,
        false => vk::SamplerMipmapMode::NEAREST,
    })
}

impl Texture3d {
    /// Uploads all levels in the most accurate format that the device filters linearly.
    ///
    /// # Errors
    /// [`Error::Device`] where a side is longer than the device allows; [`Error::OutOfMemory`]; those of [`Gpu::blends_levels`].
    ///
    /// # Panics
    /// Where the pyramid has no level, or levels of other sizes than a [`Pyramid`] promises.
    pub fn upload(gpu: &Arc<Gpu>, name: &'static str, pyramid: &Pyramid) -> Result<Self> {
        let levels: Vec<Level<'_, _>> =
            pyramid.levels.iter().map(|level| (level.size, level.texels.as_slice())).collect();
        Self::upload_colours(gpu, name, &levels, between_levels(gpu, levels.len())?)
    }

    /// The same for directions.
    ///
    /// # Errors
    /// As [`Texture3d::upload`].
    ///
    /// # Panics
    /// As [`Texture3d::upload`].
    pub fn upload_directions(gpu: &Arc<Gpu>, name: &'static str, directions: &Directions) -> Result<Self> {
        let levels: Vec<Level<'_, _>> =
            directions.levels.iter().map(|level| (level.size, level.texels.as_slice())).collect();
        Self::upload_colours(gpu, name, &levels, between_levels(gpu, levels.len())?)
    }

    /// Uploads distances, read as parts of 255, of the box that a sample is in.
    ///
    /// # Errors
    /// As [`Texture3d::upload`].
    ///
    /// # Panics
    /// As [`Texture3d::upload`].
    pub fn upload_proximity(gpu: &Arc<Gpu>, name: &'static str, proximity: &Proximity) -> Result<Self> {
        let levels: Vec<Level<'_, u8>> =
            proximity.levels.iter().map(|level| (level.size, level.distances.as_slice())).collect();
        assert_is_pyramid(&levels);
        Self::check_sides(gpu, name, levels[0].0)?;
        // Vulkan has every device sample this format.
        let format = (vk::Format::R8_UNORM, vk::ComponentMapping::default());
        let filters = (vk::Filter::NEAREST, vk::SamplerMipmapMode::NEAREST);
        Self::upload_levels(gpu, name, format, filters, &levels, |texels| Cow::Borrowed(texels))
    }

    /// Uploads the fourth channel of all levels, which is all that shaders see of the texels then: a quarter of the memory. `None`
    /// where the device does not filter such textures.
    ///
    /// # Errors
    /// As [`Texture3d::upload`].
    ///
    /// # Panics
    /// As [`Texture3d::upload`].
    pub fn upload_alpha(gpu: &Arc<Gpu>, name: &'static str, pyramid: &Pyramid) -> Result<Option<Self>> {
        let format = vk::Format::R32_SFLOAT;
        if !gpu.supports(format, FILTERED) {
            return Ok(None);
        }
        let levels: Vec<Level<'_, _>> =
            pyramid.levels.iter().map(|level| (level.size, level.texels.as_slice())).collect();
        assert_is_pyramid(&levels);
        Self::check_sides(gpu, name, levels[0].0)?;
        let zero = vk::ComponentSwizzle::ZERO;
        let channels = vk::ComponentMapping { r: zero, g: zero, b: zero, a: vk::ComponentSwizzle::R };
        let filters = (vk::Filter::LINEAR, between_levels(gpu, levels.len())?);
        Self::upload_levels(gpu, name, (format, channels), filters, &levels, |texels| {
            Cow::Owned(texels.iter().flat_map(|texel| texel[3].to_ne_bytes()).collect())
        })
        .map(Some)
    }

    pub(super) fn upload_colours(
        gpu: &Arc<Gpu>,
        name: &'static str,
        levels: &[Level<'_, [f32; 4]>],
        between: vk::SamplerMipmapMode,
    ) -> Result<Self> {
        assert_is_pyramid(levels);
        let count = u32::try_from(levels.len()).expect("at most 32 levels");
        let (format, _) = Self::check(gpu, name, levels[0].0, count)?;
        let raw = (format.raw(), vk::ComponentMapping::default());
        let filters = (vk::Filter::LINEAR, between);
        Self::upload_levels(gpu, name, raw, filters, levels, |texels| format.encode(texels))
    }

    fn upload_levels<T>(
        gpu: &Arc<Gpu>,
        name: &'static str,
        (format, channels): (vk::Format, vk::ComponentMapping),
        (filter, between): (vk::Filter, vk::SamplerMipmapMode),
        pyramid: &[Level<'_, T>],
        encode: impl for<'a> Fn(&'a [T]) -> Cow<'a, [u8]>,
    ) -> Result<Self> {
        let [width, height, depth] = pyramid[0].0;
        let levels = u32::try_from(pyramid.len()).expect("at most 32 levels");
        let encoded: Vec<Cow<'_, [u8]>> = pyramid.iter().map(|(_, texels)| encode(texels)).collect();
        let bytes = encoded.iter().map(|texels| texels.len() as u64).sum();
        // Once on the device, once in the staging buffer.
        gpu.check_memory(name, 2 * bytes)?;
        let mut staging = Buffer::staging(gpu, name, bytes)?;
        let info = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_3D)
            .format(format)
            .extent(vk::Extent3D { width, height, depth })
            .mip_levels(levels)
            .array_layers(1)
            .samples(vk::SampleCountFlags::TYPE_1)
            .tiling(vk::ImageTiling::OPTIMAL)
            .usage(vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_DST);
        let colour = vk::ImageAspectFlags::COLOR;
        let image =
            DeviceImage::with_channels(gpu, name, &info, vk::ImageViewType::TYPE_3D, colour, channels)?;

        let mut regions = Vec::new();
        let mut offset = 0;
        for ((level, (size, _)), texels) in (0..levels).zip(pyramid).zip(&encoded) {
            let [width, height, depth] = *size;
            regions.push(
                vk::BufferImageCopy::default()
                    .buffer_offset(offset as u64)
                    .image_subresource(vk::ImageSubresourceLayers {
                        aspect_mask: vk::ImageAspectFlags::COLOR,
                        mip_level: level,
                        base_array_layer: 0,
                        layer_count: 1,
                    })
                    .image_extent(vk::Extent3D { width, height, depth }),
            );
            staging.write_bytes(offset, texels);
            offset += texels.len();
        }
        submit(gpu, "uploading the volume", |commands| {
            transition(gpu, commands, &image, NOTHING, COPY);
            // SAFETY: image and buffer live until the submission is waited for; the regions lie within both, since
            // each level was found to have the size of a mip level, and its texels.
            unsafe {
                gpu.raw.cmd_copy_buffer_to_image(commands, staging.raw, image.raw, COPY.0, &regions);
            }
            transition(gpu, commands, &image, COPY, SAMPLING);
        })?;
        let sampler_info = vk::SamplerCreateInfo::default()
            .mag_filter(filter)
            .min_filter(filter)
            .mipmap_mode(between)
            .address_mode_u(vk::SamplerAddressMode::REPEAT)
            .address_mode_v(vk::SamplerAddressMode::REPEAT)
            .address_mode_w(vk::SamplerAddressMode::CLAMP_TO_EDGE)
            .max_lod(vk::LOD_CLAMP_NONE);
        // SAFETY: a plain sampler of a device that outlives it.
        let sampler = unsafe { gpu.raw.create_sampler(&sampler_info, None) }
            .map_err(|error| vulkan_error("creating the volume's sampler", error))?;
        Ok(Self { image, sampler, between, gpu: gpu.clone() })
    }

    /// Whether what is read between two levels of detail is their mean, as exact as f32: see [`Gpu::blends_levels`]. Else it is the
    /// nearer one.
    pub fn blends_levels(&self) -> bool {
        self.between == vk::SamplerMipmapMode::LINEAR
    }

    fn check_sides(gpu: &Gpu, name: &str, size: [u32; 3]) -> Result<()> {
        let [width, height, depth] = size;
        let limit = gpu.limits.max_image_dimension3_d;
        if width.max(height).max(depth) <= limit {
            return Ok(());
        }
        Err(Error::Device {
            message: format!(
                "{name}: {width} x {height} x {depth} texels; {} takes 3D textures of at most {limit} a side",
                gpu.info().name
            ),
            help: Some("use a smaller volume or another device".into()),
        })
    }

    /// Whether the device can hold a pyramid above `size` texels: in which format, and of how many bytes.
    pub(super) fn check(gpu: &Gpu, name: &str, size: [u32; 3], levels: u32) -> Result<(Rgba, u64)> {
        Self::check_sides(gpu, name, size)?;
        let format = Rgba::best(gpu, FILTERED).ok_or_else(|| Error::Device {
            message: format!("{} filters no floating-point 3D texture", gpu.info().name),
            help: None,
        })?;
        let texels =
            |level: u32| size.map(|side: u32| u64::from((side >> level).max(1))).into_iter().product::<u64>();
        let bytes = (0..levels).map(texels).sum::<u64>() * format.bytes();
        // Once on the device, once in the staging buffer.
        gpu.check_memory(name, 2 * bytes)?;
        Ok((format, bytes))
    }
}

/// Each level has the size that Vulkan gives a mip level, and as many texels.
fn assert_is_pyramid<T>(pyramid: &[Level<'_, T>]) {
    let full = pyramid[0].0;
    assert!(full.into_iter().all(|side| side > 0), "a volume of {full:?} texels");
    let most = most_levels(full);
    assert!(pyramid.len() <= most as usize, "a pyramid above {full:?} texels has {most} levels");
    for (level, (size, texels)) in pyramid.iter().enumerate() {
        assert_eq!(*size, full.map(|side| (side >> level).max(1)), "level {level}");
        let count = size.iter().map(|&side| side as usize).product::<usize>();
        assert_eq!(texels.len(), count, "level {level} of {size:?} texels");
    }
}

/// How many levels a whole pyramid has.
pub(super) fn most_levels(size: [u32; 3]) -> u32 {
    u32::BITS - size.into_iter().max().unwrap_or(0).leading_zeros()
}

/// Records that an image goes from one use to another, with all of its levels.
fn transition(gpu: &Gpu, commands: vk::CommandBuffer, image: &DeviceImage, from: Use, to: Use) {
    let barrier = vk::ImageMemoryBarrier::default()
        .image(image.raw)
        .old_layout(from.0)
        .src_access_mask(from.1)
        .new_layout(to.0)
        .dst_access_mask(to.1)
        .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
        .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
        .subresource_range(whole());
    let flags = vk::DependencyFlags::empty();
    // SAFETY: the commands are being recorded, and the image lives until their submission is waited for.
    unsafe { gpu.raw.cmd_pipeline_barrier(commands, from.2, to.2, flags, &[], &[], &[barrier]) };
}

impl Drop for Texture3d {
    fn drop(&mut self) {
        // SAFETY: every submission that used the sampler was waited for.
        unsafe { self.gpu.raw.destroy_sampler(self.sampler, None) };
    }
}
