//! The floating-point targets that pictures are drawn in, and read from: by the host, or by shaders.

use std::cell::Cell;
use std::marker::PhantomData;
use std::sync::Arc;

use ash::vk;

use super::buffer::Buffer;
use super::device::{Gpu, vulkan_error};
use super::format::Rgba;
use super::image::DeviceImage;
use crate::{Error, Result};

/// One or more floating-point RGBA images of one size with a framebuffer over them, and who reads them.
#[derive(Debug)]
pub struct Target {
    pub(super) width: u32,
    pub(super) height: u32,
    /// For the host one for each attachment; for shaders a single one, with a layer for each.
    pub(super) images: Vec<DeviceImage>,
    /// That the nearest of several surfaces is kept by, or by which pixels are marked; and its format.
    pub(super) depth: Option<(DeviceImage, vk::Format)>,
    /// Whether shaders that draw into it may read the first image, of their own pixel.
    pub(super) reads_itself: bool,
    /// What the host reads; none for shaders.
    pub(super) readbacks: Vec<Buffer>,
    /// What shaders read through; null for the host.
    pub(super) sampler: vk::Sampler,
    /// Begins a picture.
    pub(super) clearing: vk::RenderPass,
    /// Goes on with one.
    pub(super) continuing: vk::RenderPass,
    pub(super) framebuffer: vk::Framebuffer,
    pub(super) format: Rgba,
    pub(super) gpu: Arc<Gpu>,
    /// Seconds a vertex of the last draw.
    pub(super) pace: Cell<Option<f64>>,
    // What is drawn is read from the same memory: one thread at a time may do either.
    not_shared: PhantomData<Cell<()>>,
}

/// By what the pixels of a target can be marked, so that no more is drawn there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Marked {
    /// Nothing.
    Never,
    /// What shaders know without it: [`Keeps::Marks`](super::Keeps::Marks).
    Apart,
    /// What was drawn there, too: [`Keeps::MarksByPicture`](super::Keeps::MarksByPicture).
    ByPicture,
}

/// Who reads a target.
#[derive(Debug, Clone, Copy)]
pub(super) enum ReadBy {
    /// From a copy in its memory. With a depth image, where pixels are `marked`.
    Host {
        /// See [`Marked`].
        marked: bool,
    },
    /// With a depth image, where the `nearest` is kept.
    Shaders {
        /// See [`Keeps::Nearest`](super::Keeps::Nearest).
        nearest: bool,
    },
}

/// What waits for what where a target reads itself: before it is read, and after.
pub(super) const ITSELF: [[(vk::PipelineStageFlags, vk::AccessFlags); 2]; 2] = {
    let written = (
        vk::PipelineStageFlags::COLOR_ATTACHMENT_OUTPUT,
        vk::AccessFlags::from_raw(
            vk::AccessFlags::COLOR_ATTACHMENT_WRITE.as_raw()
                | vk::AccessFlags::COLOR_ATTACHMENT_READ.as_raw(),
        ),
    );
    let read = (vk::PipelineStageFlags::FRAGMENT_SHADER, vk::AccessFlags::INPUT_ATTACHMENT_READ);
    [[written, read], [read, written]]
};

/// Of surfaces.
const DEPTH_FORMAT: vk::Format = vk::Format::D32_SFLOAT;
/// Of marks: Vulkan has every device draw into it.
const MARK_FORMAT: vk::Format = vk::Format::D16_UNORM;

impl Target {
    /// `attachments` images of `width x height` pixels that the host reads, in the most accurate format that the device blends.
    ///
    /// # Errors
    /// [`Error::Usage`] where a side is 0; [`Error::Device`] where one is longer than the device allows;
    /// [`Error::OutOfMemory`].
    ///
    /// # Panics
    /// Where there are no attachments.
    pub fn new(
        gpu: &Arc<Gpu>,
        [width, height]: [u32; 2],
        attachments: usize,
        marked: Marked,
    ) -> Result<Self> {
        let name = "the picture";
        let read_by = ReadBy::Host { marked: marked != Marked::Never };
        let (format, bytes) = Self::check(gpu, name, [width, height], attachments, read_by)?;
        let reads_itself = marked == Marked::ByPicture;
        let mut target = Self::empty(gpu, name, format, [width, height], [attachments, 1], reads_itself)?;
        if marked != Marked::Never {
            target.keep_depths(name, MARK_FORMAT)?;
        }
        target.readbacks =
            (0..attachments).map(|_| Buffer::readback(gpu, "the picture", bytes)).collect::<Result<_>>()?;
        target.finish()
    }

    /// The same for shaders, which read it texel by texel: an array of pictures where there are several attachments. `nearest` keeps of
    /// several surfaces the nearest.
    ///
    /// # Errors
    /// As [`Target::new`], and [`Error::Device`] where the device has no such format.
    ///
    /// # Panics
    /// As [`Target::new`].
    pub fn sampled(
        gpu: &Arc<Gpu>,
        name: &'static str,
        [width, height]: [u32; 2],
        attachments: usize,
        nearest: bool,
    ) -> Result<Self> {
        let (format, _) = Self::check(gpu, name, [width, height], attachments, ReadBy::Shaders { nearest })?;
        let mut target = Self::empty(gpu, name, format, [width, height], [1, attachments], false)?;
        if nearest {
            if !gpu.supports(DEPTH_FORMAT, vk::FormatFeatureFlags::DEPTH_STENCIL_ATTACHMENT) {
                let message = format!("{} has no depth buffer of 32 bits", gpu.info().name);
                return Err(Error::Device { message, help: None });
            }
            target.keep_depths(name, DEPTH_FORMAT)?;
        }
        let clamp = vk::SamplerAddressMode::CLAMP_TO_EDGE;
        // With a bound of 0 lavapipe 22.3 would look up the level of each pixel by itself, as if there were several.
        let sampler_info = vk::SamplerCreateInfo::default()
            .address_mode_u(clamp)
            .address_mode_v(clamp)
            .max_lod(vk::LOD_CLAMP_NONE);
        // SAFETY: a plain sampler of a device that outlives it.
        target.sampler = unsafe { gpu.raw.create_sampler(&sampler_info, None) }
            .map_err(|error| vulkan_error("creating a sampler", error))?;
        target.finish()
    }

    /// Lets the next draw begin with a small part, as if it were the first.
    pub fn forget_pace(&self) {
        self.pace.set(None);
    }

    fn keep_depths(&mut self, name: &'static str, format: vk::Format) -> Result<()> {
        let usage = vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT;
        let info = image_info(format, [self.width, self.height], 1, usage);
        let aspect = vk::ImageAspectFlags::DEPTH;
        let image = DeviceImage::new(&self.gpu, name, &info, vk::ImageViewType::TYPE_2D, aspect)?;
        self.depth = Some((image, format));
        Ok(())
    }

    /// Images, but nothing that draws or reads.
    fn empty(
        gpu: &Arc<Gpu>,
        name: &'static str,
        format: Rgba,
        [width, height]: [u32; 2],
        [images, layers]: [usize; 2],
        reads_itself: bool,
    ) -> Result<Self> {
        let layers = u32::try_from(layers).expect("few attachments");
        let usage = vk::ImageUsageFlags::COLOR_ATTACHMENT
            | vk::ImageUsageFlags::TRANSFER_SRC
            | vk::ImageUsageFlags::SAMPLED
            | if reads_itself { vk::ImageUsageFlags::INPUT_ATTACHMENT } else { vk::ImageUsageFlags::empty() };
        let info = image_info(format.raw(), [width, height], layers, usage);
        let view = if layers > 1 { vk::ImageViewType::TYPE_2D_ARRAY } else { vk::ImageViewType::TYPE_2D };
        let aspect = vk::ImageAspectFlags::COLOR;
        let images: Vec<DeviceImage> =
            (0..images).map(|_| DeviceImage::new(gpu, name, &info, view, aspect)).collect::<Result<_>>()?;
        // From here on `Drop` cleans up, null handles included.
        Ok(Self {
            width,
            height,
            images,
            depth: None,
            reads_itself,
            readbacks: Vec::new(),
            sampler: vk::Sampler::null(),
            clearing: vk::RenderPass::null(),
            continuing: vk::RenderPass::null(),
            framebuffer: vk::Framebuffer::null(),
            format,
            gpu: gpu.clone(),
            pace: Cell::new(None),
            not_shared: PhantomData,
        })
    }

    /// Makes what draws.
    fn finish(mut self) -> Result<Self> {
        self.clearing = render_pass(&self, true)?;
        self.continuing = render_pass(&self, false)?;
        let views: Vec<vk::ImageView> = self
            .images
            .iter()
            .chain(self.depth.iter().map(|(image, _)| image))
            .flat_map(DeviceImage::layers)
            .copied()
            .collect();
        let framebuffer_info = vk::FramebufferCreateInfo::default()
            .render_pass(self.clearing)
            .attachments(&views)
            .width(self.width)
            .height(self.height)
            .layers(1);
        // SAFETY: the views are of this device, of the render pass's formats, and of this size.
        self.framebuffer = unsafe { self.gpu.raw.create_framebuffer(&framebuffer_info, None) }
            .map_err(|error| vulkan_error("creating the framebuffer", error))?;
        Ok(self)
    }

    /// How many there are.
    pub(super) fn attachments(&self) -> usize {
        self.images.iter().map(|image| image.layers().len()).sum()
    }

    /// The size in pixels.
    pub fn size(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    /// Whether the device can hold such a target: in which format, and of how many bytes an image.
    pub(super) fn check(
        gpu: &Gpu,
        name: &str,
        [width, height]: [u32; 2],
        attachments: usize,
        read_by: ReadBy,
    ) -> Result<(Rgba, u64)> {
        assert!(attachments > 0);
        if width.min(height) == 0 {
            let message = format!("{name}: {width} x {height} pixels");
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
                    "{name}: {width} x {height} pixels; {} draws at most {limit} a side",
                    gpu.info().name
                ),
                help: Some("ask for a smaller picture".into()),
            });
        }
        let (format, lacks) = match read_by {
            ReadBy::Host { .. } => {
                let features =
                    vk::FormatFeatureFlags::COLOR_ATTACHMENT_BLEND | vk::FormatFeatureFlags::TRANSFER_SRC;
                (Rgba::best(gpu, features), "blends into no floating-point target")
            }
            // These hold depths and planes, for which 11 bits will not do.
            ReadBy::Shaders { .. } => {
                let features =
                    vk::FormatFeatureFlags::COLOR_ATTACHMENT | vk::FormatFeatureFlags::SAMPLED_IMAGE;
                let supported = gpu.supports(Rgba::F32.raw(), features);
                (supported.then_some(Rgba::F32), "draws into no target of 32-bit floats")
            }
        };
        let format = format
            .ok_or_else(|| Error::Device { message: format!("{} {lacks}", gpu.info().name), help: None })?;
        let pixels = u64::from(width) * u64::from(height);
        let bytes = pixels * format.bytes();
        let all = attachments as u64 * bytes;
        let (copies, depths) = match read_by {
            ReadBy::Host { marked } => (all, marked),
            ReadBy::Shaders { nearest } => (0, nearest),
        };
        let besides = copies + if depths { 4 * pixels } else { 0 };
        gpu.check_memory(name, all + besides)?;
        let most = gpu.limits.max_color_attachments;
        if attachments > most as usize {
            let message =
                format!("{name}: {} draws into {most} images at once, not {attachments}", gpu.info().name);
            return Err(Error::Device { message, help: None });
        }
        Ok((format, bytes))
    }

    /// The pixels of one image as of the last draw, row by row from the top left.
    ///
    /// # Panics
    /// Where the target is for shaders.
    pub fn read(&self, attachment: usize) -> Vec<[f32; 4]> {
        self.format.decode(self.readbacks[attachment].read())
    }
}

fn image_info(
    format: vk::Format,
    [width, height]: [u32; 2],
    layers: u32,
    usage: vk::ImageUsageFlags,
) -> vk::ImageCreateInfo<'static> {
    vk::ImageCreateInfo::default()
        .image_type(vk::ImageType::TYPE_2D)
        .format(format)
        .extent(vk::Extent3D { width, height, depth: 1 })
        .mip_levels(1)
        .array_layers(layers)
        .samples(vk::SampleCountFlags::TYPE_1)
        .tiling(vk::ImageTiling::OPTIMAL)
        .usage(usage)
}

/// Clears to zero or keeps what is there, draws, and leaves the images ready for who reads them. Both kinds are compatible in
/// Vulkan's sense: one framebuffer and one pipeline serve both.
fn render_pass(target: &Target, clears: bool) -> Result<vk::RenderPass> {
    let gpu = &target.gpu;
    let is_sampled = target.sampler != vk::Sampler::null();
    // Who reads what was drawn, before and after.
    let (read_layout, reads, read_stage) = if is_sampled {
        (
            vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL,
            vk::AccessFlags::SHADER_READ,
            vk::PipelineStageFlags::FRAGMENT_SHADER,
        )
    } else {
        (
            vk::ImageLayout::TRANSFER_SRC_OPTIMAL,
            vk::AccessFlags::TRANSFER_READ,
            vk::PipelineStageFlags::TRANSFER,
        )
    };
    let description = |format, kept| {
        let (load, layout) = match clears {
            true => (vk::AttachmentLoadOp::CLEAR, vk::ImageLayout::UNDEFINED),
            false => (vk::AttachmentLoadOp::LOAD, kept),
        };
        vk::AttachmentDescription::default()
            .format(format)
            .samples(vk::SampleCountFlags::TYPE_1)
            .load_op(load)
            .store_op(vk::AttachmentStoreOp::STORE)
            .stencil_load_op(vk::AttachmentLoadOp::DONT_CARE)
            .stencil_store_op(vk::AttachmentStoreOp::DONT_CARE)
            .initial_layout(layout)
            .final_layout(kept)
    };
    let mut descriptions = vec![description(target.format.raw(), read_layout); target.attachments()];
    let depth_layout = vk::ImageLayout::DEPTH_STENCIL_ATTACHMENT_OPTIMAL;
    if let Some((_, format)) = target.depth {
        descriptions.push(description(format, depth_layout));
    }
    let count = u32::try_from(target.attachments()).expect("few attachments");
    let layout = match target.reads_itself {
        true => vk::ImageLayout::GENERAL,
        false => vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL,
    };
    let references: Vec<vk::AttachmentReference> =
        (0..count).map(|attachment| vk::AttachmentReference { attachment, layout }).collect();
    let depth_reference = vk::AttachmentReference { attachment: count, layout: depth_layout };
    let mut subpass = vk::SubpassDescription::default()
        .pipeline_bind_point(vk::PipelineBindPoint::GRAPHICS)
        .color_attachments(&references);
    let (mut stages, mut writes, mut accesses) = (
        vk::PipelineStageFlags::COLOR_ATTACHMENT_OUTPUT,
        vk::AccessFlags::COLOR_ATTACHMENT_WRITE,
        vk::AccessFlags::COLOR_ATTACHMENT_WRITE | vk::AccessFlags::COLOR_ATTACHMENT_READ,
    );
    if target.depth.is_some() {
        subpass = subpass.depth_stencil_attachment(&depth_reference);
        stages |= vk::PipelineStageFlags::EARLY_FRAGMENT_TESTS | vk::PipelineStageFlags::LATE_FRAGMENT_TESTS;
        writes |= vk::AccessFlags::DEPTH_STENCIL_ATTACHMENT_WRITE;
        accesses |=
            vk::AccessFlags::DEPTH_STENCIL_ATTACHMENT_WRITE | vk::AccessFlags::DEPTH_STENCIL_ATTACHMENT_READ;
    }
    let mut dependencies = vec![
        // The clear waits for the reads of the frame before, what goes on for what was drawn before.
        vk::SubpassDependency::default()
            .src_subpass(vk::SUBPASS_EXTERNAL)
            .dst_subpass(0)
            .src_stage_mask(read_stage | stages)
            .src_access_mask(writes)
            .dst_stage_mask(stages)
            .dst_access_mask(accesses),
        // Who reads waits for the drawing.
        vk::SubpassDependency::default()
            .src_subpass(0)
            .dst_subpass(vk::SUBPASS_EXTERNAL)
            .src_stage_mask(stages)
            .src_access_mask(writes)
            .dst_stage_mask(read_stage)
            .dst_access_mask(reads),
    ];
    if target.reads_itself {
        subpass = subpass.input_attachments(&references[..1]);
        dependencies.extend(ITSELF.map(|[from, to]| {
            vk::SubpassDependency::default()
                .src_subpass(0)
                .dst_subpass(0)
                .src_stage_mask(from.0)
                .src_access_mask(from.1)
                .dst_stage_mask(to.0)
                .dst_access_mask(to.1)
                .dependency_flags(vk::DependencyFlags::BY_REGION)
        }));
    }
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
            self.gpu.raw.destroy_sampler(self.sampler, None);
            self.gpu.raw.destroy_framebuffer(self.framebuffer, None);
            self.gpu.raw.destroy_render_pass(self.clearing, None);
            self.gpu.raw.destroy_render_pass(self.continuing, None);
        }
    }
}
