//! Images on the device, and the floating-point targets that pictures are blended in and read back from.

use std::mem::ManuallyDrop;
use std::sync::Arc;

use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::Allocation;

use super::buffer::{Buffer, allocate, free};
use super::device::{Gpu, vulkan_error};
use crate::{Error, Result};

/// An image with its memory and one view of all of it.
#[derive(Debug)]
pub(super) struct DeviceImage {
    pub(super) raw: vk::Image,
    pub(super) view: vk::ImageView,
    allocation: ManuallyDrop<Allocation>,
    gpu: Arc<Gpu>,
}

impl DeviceImage {
    pub(super) fn new(
        gpu: &Arc<Gpu>,
        name: &str,
        info: &vk::ImageCreateInfo<'_>,
        view_type: vk::ImageViewType,
        location: MemoryLocation,
    ) -> Result<Self> {
        // SAFETY: the caller checked sides against the limits, and the format against its features.
        let raw = unsafe { gpu.raw.create_image(info, None) }
            .map_err(|error| vulkan_error(&format!("creating the image of {name}"), error))?;
        // SAFETY: `raw` was just made by this device.
        let requirements = unsafe { gpu.raw.get_image_memory_requirements(raw) };
        let allocation = match allocate(gpu, name, requirements, location, false) {
            Ok(allocation) => allocation,
            Err(error) => {
                // SAFETY: nothing uses the image yet.
                unsafe { gpu.raw.destroy_image(raw, None) };
                return Err(error);
            }
        };
        let mut image = Self {
            raw,
            view: vk::ImageView::null(),
            allocation: ManuallyDrop::new(allocation),
            gpu: gpu.clone(),
        };
        // SAFETY: the allocation meets the image's requirements and is bound once.
        unsafe { gpu.raw.bind_image_memory(raw, image.allocation.memory(), image.allocation.offset()) }
            .map_err(|error| vulkan_error(&format!("binding the memory of {name}"), error))?;
        let view_info = vk::ImageViewCreateInfo::default()
            .image(raw)
            .view_type(view_type)
            .format(info.format)
            .subresource_range(whole());
        // SAFETY: the view covers the image that was just made.
        image.view = unsafe { gpu.raw.create_image_view(&view_info, None) }
            .map_err(|error| vulkan_error(&format!("creating the view of {name}"), error))?;
        Ok(image)
    }
}

impl Drop for DeviceImage {
    fn drop(&mut self) {
        // SAFETY: every submission that used the image was waited for; destroying a null view does nothing.
        unsafe {
            self.gpu.raw.destroy_image_view(self.view, None);
            self.gpu.raw.destroy_image(self.raw, None);
            free(&self.gpu, &mut self.allocation);
        }
    }
}

/// All levels and layers of a colour image.
pub(super) fn whole() -> vk::ImageSubresourceRange {
    vk::ImageSubresourceRange {
        aspect_mask: vk::ImageAspectFlags::COLOR,
        base_mip_level: 0,
        level_count: vk::REMAINING_MIP_LEVELS,
        base_array_layer: 0,
        layer_count: vk::REMAINING_ARRAY_LAYERS,
    }
}

/// A barrier that takes a whole image from one layout and use to another.
pub(super) fn transition(
    image: vk::Image,
    from: (vk::ImageLayout, vk::AccessFlags),
    to: (vk::ImageLayout, vk::AccessFlags),
) -> vk::ImageMemoryBarrier<'static> {
    vk::ImageMemoryBarrier::default()
        .image(image)
        .old_layout(from.0)
        .src_access_mask(from.1)
        .new_layout(to.0)
        .dst_access_mask(to.1)
        .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
        .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
        .subresource_range(whole())
}

/// Formats by falling accuracy; devices need only offer the last with blending.
const FORMATS: [vk::Format; 2] = [vk::Format::R32G32B32A32_SFLOAT, vk::Format::R16G16B16A16_SFLOAT];

/// One or more floating-point RGBA images of one size, with a framebuffer over them and memory to read them back.
#[derive(Debug)]
pub struct Target {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) images: Vec<DeviceImage>,
    pub(super) readbacks: Vec<Buffer>,
    pub(super) render_pass: vk::RenderPass,
    pub(super) framebuffer: vk::Framebuffer,
    format: vk::Format,
    gpu: Arc<Gpu>,
}

impl Target {
    /// `attachments` images of `width x height` pixels, in the most accurate format that the device blends.
    ///
    /// # Errors
    /// [`Error::Device`] where a side is longer than the device allows; [`Error::OutOfMemory`].
    pub fn new(gpu: &Arc<Gpu>, width: u32, height: u32, attachments: usize) -> Result<Self> {
        let limits = &gpu.limits;
        let limit = limits
            .max_image_dimension2_d
            .min(limits.max_framebuffer_width)
            .min(limits.max_framebuffer_height);
        if width.max(height) > limit {
            return Err(Error::Device {
                message: format!(
                    "a picture of {width} x {height} pixels; {} draws at most {limit} a side",
                    gpu.info().name
                ),
                help: Some("ask for a smaller picture".into()),
            });
        }
        let features = vk::FormatFeatureFlags::COLOR_ATTACHMENT_BLEND | vk::FormatFeatureFlags::TRANSFER_SRC;
        let format = FORMATS.into_iter().find(|format| gpu.supports(*format, features)).ok_or_else(|| {
            Error::Device {
                message: format!("{} blends into no floating-point target", gpu.info().name),
                help: None,
            }
        })?;
        let pixels = u64::from(width) * u64::from(height);
        let pixel_bytes: u64 = if format == FORMATS[0] { 16 } else { 8 };
        gpu.check_memory("the picture", 2 * pixels * pixel_bytes * attachments as u64)?;

        let info = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(format)
            .extent(vk::Extent3D { width, height, depth: 1 })
            .mip_levels(1)
            .array_layers(1)
            .samples(vk::SampleCountFlags::TYPE_1)
            .tiling(vk::ImageTiling::OPTIMAL)
            .usage(vk::ImageUsageFlags::COLOR_ATTACHMENT | vk::ImageUsageFlags::TRANSFER_SRC);
        let images: Vec<DeviceImage> = (0..attachments)
            .map(|_| {
                DeviceImage::new(
                    gpu,
                    "the picture",
                    &info,
                    vk::ImageViewType::TYPE_2D,
                    MemoryLocation::GpuOnly,
                )
            })
            .collect::<Result<_>>()?;
        let readbacks = (0..attachments)
            .map(|_| Buffer::readback(gpu, "the picture", pixels * pixel_bytes))
            .collect::<Result<_>>()?;
        // From here on `Drop` cleans up, null handles included.
        let mut target = Self {
            width,
            height,
            images,
            readbacks,
            render_pass: vk::RenderPass::null(),
            framebuffer: vk::Framebuffer::null(),
            format,
            gpu: gpu.clone(),
        };
        target.render_pass = render_pass(gpu, format, attachments)?;
        let views: Vec<vk::ImageView> = target.images.iter().map(|image| image.view).collect();
        let framebuffer_info = vk::FramebufferCreateInfo::default()
            .render_pass(target.render_pass)
            .attachments(&views)
            .width(width)
            .height(height)
            .layers(1);
        // SAFETY: the views are of this device, of the render pass's formats, and of this size.
        target.framebuffer = unsafe { gpu.raw.create_framebuffer(&framebuffer_info, None) }
            .map_err(|error| vulkan_error("creating the framebuffer", error))?;
        Ok(target)
    }

    /// The pixels of one image as of the last draw, row by row from the top left.
    pub fn read(&self, attachment: usize) -> Vec<[f32; 4]> {
        let bytes = self.readbacks[attachment].read();
        if self.format == FORMATS[0] {
            bytemuck::pod_collect_to_vec(bytes)
        } else {
            let halves: Vec<[half::f16; 4]> = bytemuck::pod_collect_to_vec(bytes);
            halves.into_iter().map(|pixel| pixel.map(half::f16::to_f32)).collect()
        }
    }

    /// The pixels' format, as in `"R32G32B32A32_SFLOAT"`.
    pub fn format(&self) -> String {
        format!("{:?}", self.format)
    }
}

/// Clears to zero, draws, and leaves the images ready to be copied.
fn render_pass(gpu: &Gpu, format: vk::Format, attachments: usize) -> Result<vk::RenderPass> {
    let descriptions = vec![
        vk::AttachmentDescription::default()
            .format(format)
            .samples(vk::SampleCountFlags::TYPE_1)
            .load_op(vk::AttachmentLoadOp::CLEAR)
            .store_op(vk::AttachmentStoreOp::STORE)
            .stencil_load_op(vk::AttachmentLoadOp::DONT_CARE)
            .stencil_store_op(vk::AttachmentStoreOp::DONT_CARE)
            .initial_layout(vk::ImageLayout::UNDEFINED)
            .final_layout(vk::ImageLayout::TRANSFER_SRC_OPTIMAL);
        attachments
    ];
    let references: Vec<vk::AttachmentReference> = (0..attachments)
        .map(|index| vk::AttachmentReference {
            attachment: u32::try_from(index).expect("few attachments"),
            layout: vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL,
        })
        .collect();
    let subpass = vk::SubpassDescription::default()
        .pipeline_bind_point(vk::PipelineBindPoint::GRAPHICS)
        .color_attachments(&references);
    let dependencies = [
        // The clear waits for the copy of the frame before.
        vk::SubpassDependency::default()
            .src_subpass(vk::SUBPASS_EXTERNAL)
            .dst_subpass(0)
            .src_stage_mask(vk::PipelineStageFlags::TRANSFER)
            .dst_stage_mask(vk::PipelineStageFlags::COLOR_ATTACHMENT_OUTPUT)
            .dst_access_mask(
                vk::AccessFlags::COLOR_ATTACHMENT_WRITE | vk::AccessFlags::COLOR_ATTACHMENT_READ,
            ),
        // The copy waits for the drawing.
        vk::SubpassDependency::default()
            .src_subpass(0)
            .dst_subpass(vk::SUBPASS_EXTERNAL)
            .src_stage_mask(vk::PipelineStageFlags::COLOR_ATTACHMENT_OUTPUT)
            .src_access_mask(vk::AccessFlags::COLOR_ATTACHMENT_WRITE)
            .dst_stage_mask(vk::PipelineStageFlags::TRANSFER)
            .dst_access_mask(vk::AccessFlags::TRANSFER_READ),
    ];
    let subpasses = [subpass];
    let info = vk::RenderPassCreateInfo::default()
        .attachments(&descriptions)
        .subpasses(&subpasses)
        .dependencies(&dependencies);
    // SAFETY: the structure and what it points to live through the call.
    unsafe { gpu.raw.create_render_pass(&info, None) }
        .map_err(|error| vulkan_error("creating the render pass", error))
}

impl Drop for Target {
    fn drop(&mut self) {
        // SAFETY: every submission that used them was waited for; null handles are allowed.
        unsafe {
            self.gpu.raw.destroy_framebuffer(self.framebuffer, None);
            self.gpu.raw.destroy_render_pass(self.render_pass, None);
        }
    }
}
