//! The floating-point targets that pictures are blended in and read back from.

use std::cell::Cell;
use std::marker::PhantomData;
use std::sync::Arc;

use ash::vk;

use super::buffer::Buffer;
use super::device::{Gpu, vulkan_error};
use super::format::Rgba;
use super::image::DeviceImage;
use crate::{Error, Result};

/// One or more floating-point RGBA images of one size, with a framebuffer over them and memory to read them back.
#[derive(Debug)]
pub struct Target {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) images: Vec<DeviceImage>,
    pub(super) readbacks: Vec<Buffer>,
    /// Begins a picture.
    pub(super) clearing: vk::RenderPass,
    /// Goes on with one.
    pub(super) continuing: vk::RenderPass,
    pub(super) framebuffer: vk::Framebuffer,
    pub(super) format: Rgba,
    pub(super) gpu: Arc<Gpu>,
    // What is drawn is read from the same memory: one thread at a time may do either.
    not_shared: PhantomData<Cell<()>>,
}

impl Target {
    /// `attachments` images of `width x height` pixels, in the most accurate format that the device blends.
    ///
    /// # Errors
    /// [`Error::Usage`] where a side is 0; [`Error::Device`] where one is longer than the device allows;
    /// [`Error::OutOfMemory`].
    ///
    /// # Panics
    /// Where there are no attachments, or more than the device draws into at once.
    pub fn new(gpu: &Arc<Gpu>, width: u32, height: u32, attachments: usize) -> Result<Self> {
        let (format, bytes) = Self::check(gpu, width, height, attachments)?;
        assert!((1..=gpu.limits.max_color_attachments as usize).contains(&attachments));

        let info = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(format.raw())
            .extent(vk::Extent3D { width, height, depth: 1 })
            .mip_levels(1)
            .array_layers(1)
            .samples(vk::SampleCountFlags::TYPE_1)
            .tiling(vk::ImageTiling::OPTIMAL)
            .usage(vk::ImageUsageFlags::COLOR_ATTACHMENT | vk::ImageUsageFlags::TRANSFER_SRC);
        let images: Vec<DeviceImage> = (0..attachments)
            .map(|_| DeviceImage::new(gpu, "the picture", &info, vk::ImageViewType::TYPE_2D))
            .collect::<Result<_>>()?;
        let readbacks =
            (0..attachments).map(|_| Buffer::readback(gpu, "the picture", bytes)).collect::<Result<_>>()?;
        // From here on `Drop` cleans up, null handles included.
        let mut target = Self {
            width,
            height,
            images,
            readbacks,
            clearing: vk::RenderPass::null(),
            continuing: vk::RenderPass::null(),
            framebuffer: vk::Framebuffer::null(),
            format,
            gpu: gpu.clone(),
            not_shared: PhantomData,
        };
        target.clearing = render_pass(gpu, format, attachments, true)?;
        target.continuing = render_pass(gpu, format, attachments, false)?;
        let views: Vec<vk::ImageView> = target.images.iter().map(|image| image.view).collect();
        let framebuffer_info = vk::FramebufferCreateInfo::default()
            .render_pass(target.clearing)
            .attachments(&views)
            .width(width)
            .height(height)
            .layers(1);
        // SAFETY: the views are of this device, of the render pass's formats, and of this size.
        target.framebuffer = unsafe { gpu.raw.create_framebuffer(&framebuffer_info, None) }
            .map_err(|error| vulkan_error("creating the framebuffer", error))?;
        Ok(target)
    }

    /// Whether the device can hold such a target: in which format, and of how many bytes an image.
    pub(super) fn check(gpu: &Gpu, width: u32, height: u32, attachments: usize) -> Result<(Rgba, u64)> {
        if width.min(height) == 0 {
            let message = format!("a picture of {width} x {height} pixels");
            return Err(Error::Usage { message, help: Some("ask for at least one pixel a side".into()) });
        }
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
        let format = Rgba::best(gpu, features).ok_or_else(|| Error::Device {
            message: format!("{} blends into no floating-point target", gpu.info().name),
            help: None,
        })?;
        let bytes = u64::from(width) * u64::from(height) * format.bytes();
        gpu.check_memory("the picture", 2 * bytes * attachments as u64)?;
        Ok((format, bytes))
    }

    /// The pixels of one image as of the last draw, row by row from the top left.
    pub fn read(&self, attachment: usize) -> Vec<[f32; 4]> {
        self.format.decode(self.readbacks[attachment].read())
    }
}

/// Clears to zero or keeps what is there, draws, and leaves the images ready to be copied. Both kinds are compatible in Vulkan's
/// sense: one framebuffer and one pipeline serve both.
fn render_pass(gpu: &Gpu, format: Rgba, attachments: usize, clears: bool) -> Result<vk::RenderPass> {
    let (load, layout) = match clears {
        true => (vk::AttachmentLoadOp::CLEAR, vk::ImageLayout::UNDEFINED),
        false => (vk::AttachmentLoadOp::LOAD, vk::ImageLayout::TRANSFER_SRC_OPTIMAL),
    };
    let descriptions = vec![
        vk::AttachmentDescription::default()
            .format(format.raw())
            .samples(vk::SampleCountFlags::TYPE_1)
            .load_op(load)
            .store_op(vk::AttachmentStoreOp::STORE)
            .stencil_load_op(vk::AttachmentLoadOp::DONT_CARE)
            .stencil_store_op(vk::AttachmentStoreOp::DONT_CARE)
            .initial_layout(layout)
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
        // The clear waits for the copy of the frame before, what goes on for what was drawn before.
        vk::SubpassDependency::default()
            .src_subpass(vk::SUBPASS_EXTERNAL)
            .dst_subpass(0)
            .src_stage_mask(
                vk::PipelineStageFlags::TRANSFER | vk::PipelineStageFlags::COLOR_ATTACHMENT_OUTPUT,
            )
            .src_access_mask(vk::AccessFlags::COLOR_ATTACHMENT_WRITE)
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
            self.gpu.raw.destroy_render_pass(self.clearing, None);
            self.gpu.raw.destroy_render_pass(self.continuing, None);
        }
    }
}
