//! The one call that draws.

use std::collections::VecDeque;
use std::ops::{AddAssign, Range};
use std::sync::Arc;
use std::time::{Duration, Instant};

use ash::vk;

use super::buffer::Buffer;
use super::device::{Gpu, vulkan_error};
use super::pipeline::Pipeline;
use super::submit::submit;
use super::target::{ITSELF, Target};
use super::texture::Texture3d;
use crate::Result;

/// Draws into a target, one after another: blending keeps their order.
#[derive(Clone, Copy)]
pub struct Draw<'a> {
    /// Where to.
    pub target: &'a Target,
    /// Whether the target is cleared to zero first; else what is drawn is laid on what there is.
    pub clears: bool,
    /// By binding: all that any of the pipelines has.
    pub buffers: &'a [(u32, &'a Buffer)],
    /// By binding: all that any of the pipelines has.
    pub textures: &'a [(u32, Sampled<'a>)],
    /// As many bytes as the pipelines were built with.
    pub push_constants: &'a [u8],
    /// What is drawn, in order.
    pub batches: &'a [Batch<'a>],
    /// Hears now and then which part of the vertices is done, 0 to 1; an error ends the drawing.
    pub between: &'a dyn Fn(f64) -> Result<()>,
}

/// What a fragment shader reads.
#[derive(Debug, Clone, Copy)]
pub enum Sampled<'a> {
    /// Filtered.
    Texture(&'a Texture3d),
    /// A target that was made [for shaders](Target::sampled) and has been drawn, pixel by pixel.
    Picture(&'a Target),
}

impl Sampled<'_> {
    pub(super) fn gpu(&self) -> &Arc<Gpu> {
        match self {
            Self::Texture(texture) => &texture.gpu,
            Self::Picture(target) => &target.gpu,
        }
    }

    /// Where `minified`, with all mip levels.
    pub(super) fn sampler_and_view(&self, minified: bool) -> (vk::Sampler, vk::ImageView) {
        match self {
            Self::Texture(texture) if minified => (texture.sampler, texture.image.view),
            Self::Texture(texture) => (texture.sampler, texture.image.first_level()),
            Self::Picture(target) => (target.sampler, target.images[0].view),
        }
    }
}

/// Some triangles through one pipeline, which was built for a target with the same number of attachments.
#[derive(Debug, Clone)]
pub struct Batch<'a> {
    /// How.
    pub pipeline: &'a Pipeline,
    /// Three a triangle: the values of `gl_VertexIndex`.
    pub vertices: Range<u32>,
}

/// Device time of a draw, by its own timestamps.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct DrawTimes {
    /// Clearing and drawing.
    pub draw: Duration,
    /// Copying the target to host memory.
    pub readback: Duration,
}

impl AddAssign for DrawTimes {
    fn add_assign(&mut self, other: Self) {
        self.draw += other.draw;
        self.readback += other.readback;
    }
}

/// How long a submission should take: so soon an interrupt is obeyed, and long before a system gives a device up.
const PATIENCE: Duration = Duration::from_millis(400);
/// The first submission of a target's first draw has one of so many parts of all vertices.
const FIRST_PART: u64 = 16;
/// The next may be larger than the one before it by this factor.
const MOST_GROWTH: f64 = 8.0;

/// Draws, copies a target of the host's to its memory, and waits for all of it. Device times
/// are `None` where the device has no timestamps.
///
/// The work is submitted in parts that take less than half a second, judged by the part before, and the first one by the target's last
/// draw: at the end of each, processors wait for one another. Where they end makes no difference to the picture.
///
/// # Errors
/// [`Error::OutOfMemory`](crate::Error::OutOfMemory) or [`Error::Device`](crate::Error::Device) where the device fails, and
/// that of [`Draw::between`]. What the target holds on the host is then what it held before.
///
/// # Panics
/// Where target, bindings or push constants do not match a pipeline, or are another device's.
pub fn draw(draw: &Draw<'_>) -> Result<Option<DrawTimes>> {
    let target = draw.target;
    let gpu = &target.gpu;
    let mut bound: Vec<&Pipeline> = Vec::new();
    for Batch { pipeline, .. } in draw.batches {
        if !bound.iter().any(|one| std::ptr::eq(*one, *pipeline)) {
            pipeline.check(draw);
            pipeline.bind(draw);
            bound.push(pipeline);
        }
    }
    let timestamps = gpu.timestamp_period.map(|period| Timestamps::new(gpu, period)).transpose()?;
    let mut rest: VecDeque<Batch<'_>> = draw.batches.iter().cloned().collect();
    let count =
        |rest: &VecDeque<Batch<'_>>| -> u64 { rest.iter().map(|batch| batch.vertices.len() as u64).sum() };
    let all = count(&rest);
    // Where a draw takes many times what the last one took, an interrupt waits for that part.
    let known = target.pace.get().map(|seconds| (PATIENCE.as_secs_f64() / seconds) as u64);
    let mut part = known.unwrap_or_else(|| all.div_ceil(FIRST_PART));
    let start = Instant::now();
    let mut times = DrawTimes::default();
    let mut render_pass = if draw.clears { target.clearing } else { target.continuing };
    loop {
        let begun = Instant::now();
        let batches = take(&mut rest, part);
        submit_part(draw, render_pass, &batches, rest.is_empty(), timestamps.as_ref())?;
        if let Some(timestamps) = &timestamps {
            times += timestamps.read()?;
        }
        if rest.is_empty() {
            target.pace.set(Some(start.elapsed().as_secs_f64() / all.max(1) as f64));
            return Ok(timestamps.map(|_| times));
        }
        (draw.between)(1.0 - count(&rest) as f64 / all as f64)?;
        let growth = PATIENCE.as_secs_f64() / begun.elapsed().as_secs_f64();
        part = (part as f64 * growth.clamp(MOST_GROWTH.recip(), MOST_GROWTH)) as u64;
        render_pass = target.continuing;
    }
}

/// The first batches of `rest`, the last of them cut so that they have about `most` vertices: whole triangles, at least one.
fn take<'a>(rest: &mut VecDeque<Batch<'a>>, most: u64) -> Vec<Batch<'a>> {
    let mut taken = Vec::new();
    let mut left = u32::try_from(most).unwrap_or(u32::MAX).div_ceil(3).max(1) * 3;
    while left > 0
        && let Some(batch) = rest.front_mut()
    {
        let Range { start, end } = batch.vertices;
        let middle = start + left.min(end - start);
        taken.push(Batch { pipeline: batch.pipeline, vertices: start..middle });
        left -= middle - start;
        batch.vertices.start = middle;
        if middle == end {
            rest.pop_front();
        }
    }
    taken
}

/// Draws `batches` and, where they are the last, copies the target to host memory.
fn submit_part(
    draw: &Draw<'_>,
    render_pass: vk::RenderPass,
    batches: &[Batch<'_>],
    last: bool,
    timestamps: Option<&Timestamps<'_>>,
) -> Result<()> {
    let target = draw.target;
    let gpu = &target.gpu;
    let stamp = |commands, stage, index| {
        if let Some(timestamps) = timestamps {
            timestamps.write(commands, stage, index);
        }
    };
    let area = vk::Rect2D {
        offset: vk::Offset2D::default(),
        extent: vk::Extent2D { width: target.width, height: target.height },
    };
    #[expect(clippy::cast_precision_loss, reason = "a side is at most a device limit, far below 2^24")]
    let viewport = vk::Viewport {
        x: 0.0,
        y: 0.0,
        width: target.width as f32,
        height: target.height as f32,
        min_depth: 0.0,
        max_depth: 1.0,
    };
    submit(gpu, "drawing", |commands| {
        if let Some(timestamps) = timestamps {
            timestamps.reset(commands);
        }
        stamp(commands, vk::PipelineStageFlags::TOP_OF_PIPE, 0);
        // Of colours and of depths; depth 0 is the farthest.
        let attachments = target.attachments() + usize::from(target.depth.is_some());
        let clears = vec![vk::ClearValue { color: vk::ClearColorValue { float32: [0.0; 4] } }; attachments];
        let begin = vk::RenderPassBeginInfo::default()
            .render_pass(render_pass)
            .framebuffer(target.framebuffer)
            .render_area(area)
            .clear_values(&clears);
        // SAFETY: every object belongs to this device and lives until the submission is waited for; each pipeline
        // was found to fit the target, and its bindings were just written.
        unsafe {
            gpu.raw.cmd_begin_render_pass(commands, &begin, vk::SubpassContents::INLINE);
            gpu.raw.cmd_set_viewport(commands, 0, &[viewport]);
            gpu.raw.cmd_set_scissor(commands, 0, &[area]);
            let mut bound = None;
            let raw = &gpu.raw;
            for Batch { pipeline, vertices } in batches {
                // Drivers that are asked to bind what is bound do it all again.
                if bound != Some(pipeline.raw) {
                    bound = Some(pipeline.raw);
                    raw.cmd_bind_pipeline(commands, vk::PipelineBindPoint::GRAPHICS, pipeline.raw);
                    let sets = [pipeline.set];
                    let graphics = vk::PipelineBindPoint::GRAPHICS;
                    raw.cmd_bind_descriptor_sets(commands, graphics, pipeline.layout, 0, &sets, &[]);
                    let stages = vk::ShaderStageFlags::VERTEX | vk::ShaderStageFlags::FRAGMENT;
                    raw.cmd_push_constants(commands, pipeline.layout, stages, 0, draw.push_constants);
                }
                let [before, after] = ITSELF;
                if pipeline.reads_picture() {
                    wait_within(gpu, commands, before);
                }
                raw.cmd_draw(commands, vertices.len() as u32, 1, vertices.start, 0);
                if pipeline.reads_picture() {
                    wait_within(gpu, commands, after);
                }
            }
            gpu.raw.cmd_end_render_pass(commands);
        }
        stamp(commands, vk::PipelineStageFlags::COLOR_ATTACHMENT_OUTPUT, 1);
        if last {
            copy_to_host(gpu, commands, target);
        }
        stamp(commands, vk::PipelineStageFlags::TRANSFER, 2);
    })
}

/// Lets what is drawn next wait for what was drawn, as one of [`ITSELF`] says.
fn wait_within(
    gpu: &Gpu,
    commands: vk::CommandBuffer,
    [from, to]: [(vk::PipelineStageFlags, vk::AccessFlags); 2],
) {
    let barrier = [vk::MemoryBarrier::default().src_access_mask(from.1).dst_access_mask(to.1)];
    let by_region = vk::DependencyFlags::BY_REGION;
    // SAFETY: recorded in a render pass that has this dependency on itself.
    unsafe { gpu.raw.cmd_pipeline_barrier(commands, from.0, to.0, by_region, &barrier, &[], &[]) };
}

fn copy_to_host(gpu: &Gpu, commands: vk::CommandBuffer, target: &Target) {
    let region = vk::BufferImageCopy::default()
        .image_subresource(vk::ImageSubresourceLayers {
            aspect_mask: vk::ImageAspectFlags::COLOR,
            mip_level: 0,
            base_array_layer: 0,
            layer_count: 1,
        })
        .image_extent(vk::Extent3D { width: target.width, height: target.height, depth: 1 });
    let host_reads = vk::MemoryBarrier::default()
        .src_access_mask(vk::AccessFlags::TRANSFER_WRITE)
        .dst_access_mask(vk::AccessFlags::HOST_READ);
    // SAFETY: the render pass left the images in this layout, and its dependency makes the copy wait for it; the
    // buffers hold a pixel for each of the image's.
    unsafe {
        for (image, readback) in target.images.iter().zip(&target.readbacks) {
            gpu.raw.cmd_copy_image_to_buffer(
                commands,
                image.raw,
                vk::ImageLayout::TRANSFER_SRC_OPTIMAL,
                readback.raw,
                &[region],
            );
        }
        gpu.raw.cmd_pipeline_barrier(
            commands,
            vk::PipelineStageFlags::TRANSFER,
            vk::PipelineStageFlags::HOST,
            vk::DependencyFlags::empty(),
            &[host_reads],
            &[],
            &[],
        );
    }
}

/// Three timestamps: before, between, after.
struct Timestamps<'a> {
    pool: vk::QueryPool,
    nanoseconds_per_tick: f64,
    gpu: &'a Gpu,
}

impl<'a> Timestamps<'a> {
    const COUNT: u32 = 3;

    fn new(gpu: &'a Gpu, nanoseconds_per_tick: f64) -> Result<Self> {
        let info =
            vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(Self::COUNT);
        // SAFETY: a plain query pool of a device that outlives it.
        let pool = unsafe { gpu.raw.create_query_pool(&info, None) }
            .map_err(|error| vulkan_error("creating timestamps", error))?;
        Ok(Self { pool, nanoseconds_per_tick, gpu })
    }

    fn reset(&self, commands: vk::CommandBuffer) {
        // SAFETY: recorded outside a render pass, and the pool lives until the submission is waited for.
        unsafe { self.gpu.raw.cmd_reset_query_pool(commands, self.pool, 0, Self::COUNT) };
    }

    fn write(&self, commands: vk::CommandBuffer, stage: vk::PipelineStageFlags, index: u32) {
        // SAFETY: the query was reset earlier in the same commands.
        unsafe { self.gpu.raw.cmd_write_timestamp(commands, stage, self.pool, index) };
    }

    fn read(&self) -> Result<DrawTimes> {
        let mut ticks = [0u64; Self::COUNT as usize];
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        // SAFETY: all three queries were written by a submission that is done.
        unsafe { self.gpu.raw.get_query_pool_results(self.pool, 0, &mut ticks, flags) }
            .map_err(|error| vulkan_error("reading timestamps", error))?;
        #[expect(clippy::cast_precision_loss, reason = "a frame takes far fewer than 2^53 ticks")]
        let time = |from: usize, to: usize| {
            let nanoseconds = ticks[to].saturating_sub(ticks[from]) as f64 * self.nanoseconds_per_tick;
            Duration::from_secs_f64(nanoseconds * 1e-9)
        };
        Ok(DrawTimes { draw: time(0, 1), readback: time(1, 2) })
    }
}

impl Drop for Timestamps<'_> {
    fn drop(&mut self) {
        // SAFETY: the submission that used the pool was waited for.
        unsafe { self.gpu.raw.destroy_query_pool(self.pool, None) };
    }
}
