//! Graphics pipelines that blend front to back, and the one call that draws with them.

use std::ops::Range;
use std::sync::{Arc, PoisonError};
use std::time::Duration;

use ash::vk;

use super::buffer::Buffer;
use super::device::{Gpu, vulkan_error};
use super::target::Target;
use super::texture::Texture3d;
use crate::Result;

/// What a [`Pipeline`] is made of.
#[derive(Debug, Clone, Copy)]
pub struct PipelineInfo<'a> {
    /// SPIR-V of the vertex shader, entry point `main`.
    pub vertex: &'a [u32],
    /// SPIR-V of the fragment shader, entry point `main`: an output for each attachment of the target.
    pub fragment: &'a [u32],
    /// Values of the specialisation constants 0, 1, ... of the fragment shader (booleans are 0 or 1).
    pub constants: &'a [u32],
    /// Storage buffers at the bindings 0, 1, ... of set 0, read by either shader.
    pub storage_buffers: u32,
    /// Sampled textures at the bindings after the buffers, read by the fragment shader.
    pub textures: u32,
    /// Size of the push constants, in bytes; at most 128.
    pub push_constant_bytes: u32,
}

/// A graphics pipeline without vertex input: triangles pulled from buffers, blended front to back,
/// `destination += (1 - destination.alpha) * source`, no depth test. Only triangles that run clockwise on the
/// picture are drawn.
#[derive(Debug)]
pub struct Pipeline {
    raw: vk::Pipeline,
    layout: vk::PipelineLayout,
    set_layout: vk::DescriptorSetLayout,
    pool: vk::DescriptorPool,
    set: vk::DescriptorSet,
    buffers: u32,
    textures: u32,
    push_constant_bytes: u32,
    gpu: Arc<Gpu>,
}

impl Pipeline {
    /// Builds the pipeline for targets like `target`.
    ///
    /// # Errors
    /// [`Error::Device`](crate::Error::Device) where the driver refuses.
    pub fn new(gpu: &Arc<Gpu>, target: &Target, info: &PipelineInfo<'_>) -> Result<Self> {
        // From here on `Drop` cleans up, null handles included.
        let mut pipeline = Self {
            raw: vk::Pipeline::null(),
            layout: vk::PipelineLayout::null(),
            set_layout: vk::DescriptorSetLayout::null(),
            pool: vk::DescriptorPool::null(),
            set: vk::DescriptorSet::null(),
            buffers: info.storage_buffers,
            textures: info.textures,
            push_constant_bytes: info.push_constant_bytes,
            gpu: gpu.clone(),
        };
        pipeline.create_layout()?;
        let vertex = ShaderModule::new(gpu, info.vertex)?;
        let fragment = ShaderModule::new(gpu, info.fragment)?;
        let entries: Vec<vk::SpecializationMapEntry> = (0..info.constants.len())
            .map(|index| vk::SpecializationMapEntry {
                constant_id: u32::try_from(index).expect("few constants"),
                offset: u32::try_from(index * 4).expect("few constants"),
                size: 4,
            })
            .collect();
        let specialization = vk::SpecializationInfo::default()
            .map_entries(&entries)
            .data(bytemuck::cast_slice(info.constants));
        let stages = [
            vk::PipelineShaderStageCreateInfo::default()
                .stage(vk::ShaderStageFlags::VERTEX)
                .module(vertex.raw)
                .name(c"main"),
            vk::PipelineShaderStageCreateInfo::default()
                .stage(vk::ShaderStageFlags::FRAGMENT)
                .module(fragment.raw)
                .name(c"main")
                .specialization_info(&specialization),
        ];
        let vertex_input = vk::PipelineVertexInputStateCreateInfo::default();
        let assembly = vk::PipelineInputAssemblyStateCreateInfo::default()
            .topology(vk::PrimitiveTopology::TRIANGLE_LIST);
        let viewports = vk::PipelineViewportStateCreateInfo::default().viewport_count(1).scissor_count(1);
        let raster = vk::PipelineRasterizationStateCreateInfo::default()
            .polygon_mode(vk::PolygonMode::FILL)
            .cull_mode(vk::CullModeFlags::BACK)
            .front_face(vk::FrontFace::CLOCKWISE)
            .line_width(1.0);
        let samples = vk::PipelineMultisampleStateCreateInfo::default()
            .rasterization_samples(vk::SampleCountFlags::TYPE_1);
        let blends = vec![
            vk::PipelineColorBlendAttachmentState {
                blend_enable: vk::TRUE,
                src_color_blend_factor: vk::BlendFactor::ONE_MINUS_DST_ALPHA,
                dst_color_blend_factor: vk::BlendFactor::ONE,
                color_blend_op: vk::BlendOp::ADD,
                src_alpha_blend_factor: vk::BlendFactor::ONE_MINUS_DST_ALPHA,
                dst_alpha_blend_factor: vk::BlendFactor::ONE,
                alpha_blend_op: vk::BlendOp::ADD,
                color_write_mask: vk::ColorComponentFlags::RGBA,
            };
            target.images.len()
        ];
        let blending = vk::PipelineColorBlendStateCreateInfo::default().attachments(&blends);
        let dynamic = vk::PipelineDynamicStateCreateInfo::default()
            .dynamic_states(&[vk::DynamicState::VIEWPORT, vk::DynamicState::SCISSOR]);
        let create_info = vk::GraphicsPipelineCreateInfo::default()
            .stages(&stages)
            .vertex_input_state(&vertex_input)
            .input_assembly_state(&assembly)
            .viewport_state(&viewports)
            .rasterization_state(&raster)
            .multisample_state(&samples)
            .color_blend_state(&blending)
            .dynamic_state(&dynamic)
            .layout(pipeline.layout)
            .render_pass(target.render_pass);
        // SAFETY: all structures live through the call, and the handles are of this device.
        let created =
            unsafe { gpu.raw.create_graphics_pipelines(vk::PipelineCache::null(), &[create_info], None) };
        pipeline.raw = created.map_err(|(_, error)| vulkan_error("building the pipeline", error))?[0];
        Ok(pipeline)
    }

    fn create_layout(&mut self) -> Result<()> {
        let raw = &self.gpu.raw;
        let mut bindings: Vec<vk::DescriptorSetLayoutBinding<'_>> = Vec::new();
        for binding in 0..self.buffers + self.textures {
            let (kind, stage) = if binding < self.buffers {
                let both = vk::ShaderStageFlags::VERTEX | vk::ShaderStageFlags::FRAGMENT;
                (vk::DescriptorType::STORAGE_BUFFER, both)
            } else {
                (vk::DescriptorType::COMBINED_IMAGE_SAMPLER, vk::ShaderStageFlags::FRAGMENT)
            };
            bindings.push(
                vk::DescriptorSetLayoutBinding::default()
                    .binding(binding)
                    .descriptor_type(kind)
                    .descriptor_count(1)
                    .stage_flags(stage),
            );
        }
        let set_info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
        // SAFETY: the structures live through the call; handles are of this device.
        self.set_layout = unsafe { raw.create_descriptor_set_layout(&set_info, None) }
            .map_err(|error| vulkan_error("describing the bindings", error))?;
        let push = [vk::PushConstantRange {
            stage_flags: vk::ShaderStageFlags::VERTEX | vk::ShaderStageFlags::FRAGMENT,
            offset: 0,
            size: self.push_constant_bytes,
        }];
        let set_layouts = [self.set_layout];
        let layout_info =
            vk::PipelineLayoutCreateInfo::default().set_layouts(&set_layouts).push_constant_ranges(&push);
        // SAFETY: as above.
        self.layout = unsafe { raw.create_pipeline_layout(&layout_info, None) }
            .map_err(|error| vulkan_error("describing the pipeline's layout", error))?;
        let sizes = [
            vk::DescriptorPoolSize { ty: vk::DescriptorType::STORAGE_BUFFER, descriptor_count: self.buffers },
            vk::DescriptorPoolSize {
                ty: vk::DescriptorType::COMBINED_IMAGE_SAMPLER,
                descriptor_count: self.textures,
            },
        ];
        let pool_info = vk::DescriptorPoolCreateInfo::default().max_sets(1).pool_sizes(&sizes);
        // SAFETY: as above.
        self.pool = unsafe { raw.create_descriptor_pool(&pool_info, None) }
            .map_err(|error| vulkan_error("reserving descriptors", error))?;
        let allocate =
            vk::DescriptorSetAllocateInfo::default().descriptor_pool(self.pool).set_layouts(&set_layouts);
        // SAFETY: as above; the pool has room for this one set.
        self.set = unsafe { raw.allocate_descriptor_sets(&allocate) }
            .map_err(|error| vulkan_error("reserving descriptors", error))?[0];
        Ok(())
    }

    fn bind(&self, buffers: &[&Buffer], textures: &[&Texture3d]) {
        assert_eq!((buffers.len(), textures.len()), (self.buffers as usize, self.textures as usize));
        let buffer_infos: Vec<[vk::DescriptorBufferInfo; 1]> = buffers
            .iter()
            .map(|buffer| [vk::DescriptorBufferInfo { buffer: buffer.raw, offset: 0, range: vk::WHOLE_SIZE }])
            .collect();
        let image_infos: Vec<[vk::DescriptorImageInfo; 1]> = textures
            .iter()
            .map(|texture| {
                [vk::DescriptorImageInfo {
                    sampler: texture.sampler,
                    image_view: texture.image.view,
                    image_layout: vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL,
                }]
            })
            .collect();
        let write = |binding| vk::WriteDescriptorSet::default().dst_set(self.set).dst_binding(binding);
        let mut writes = Vec::new();
        for (binding, info) in (0..).zip(&buffer_infos) {
            writes.push(write(binding).descriptor_type(vk::DescriptorType::STORAGE_BUFFER).buffer_info(info));
        }
        for (binding, info) in (self.buffers..).zip(&image_infos) {
            writes.push(
                write(binding).descriptor_type(vk::DescriptorType::COMBINED_IMAGE_SAMPLER).image_info(info),
            );
        }
        // SAFETY: the set is in no pending submission, since each is waited for; the infos live through the call.
        unsafe { self.gpu.raw.update_descriptor_sets(&writes, &[]) };
    }
}

impl Drop for Pipeline {
    fn drop(&mut self) {
        // SAFETY: every submission that used them was waited for; null handles are allowed.
        unsafe {
            self.gpu.raw.destroy_pipeline(self.raw, None);
            self.gpu.raw.destroy_pipeline_layout(self.layout, None);
            self.gpu.raw.destroy_descriptor_pool(self.pool, None);
            self.gpu.raw.destroy_descriptor_set_layout(self.set_layout, None);
        }
    }
}

struct ShaderModule<'a> {
    raw: vk::ShaderModule,
    gpu: &'a Gpu,
}

impl<'a> ShaderModule<'a> {
    fn new(gpu: &'a Gpu, words: &[u32]) -> Result<Self> {
        let info = vk::ShaderModuleCreateInfo::default().code(words);
        // SAFETY: the words come from glslang, by way of the build script.
        let raw = unsafe { gpu.raw.create_shader_module(&info, None) }
            .map_err(|error| vulkan_error("loading a shader", error))?;
        Ok(Self { raw, gpu })
    }
}

impl Drop for ShaderModule<'_> {
    fn drop(&mut self) {
        // SAFETY: a module is not needed once the pipelines made from it exist.
        unsafe { self.gpu.raw.destroy_shader_module(self.raw, None) };
    }
}

/// Draws into a cleared target, one after another: blending keeps their order.
#[derive(Debug, Clone, Copy)]
pub struct Draw<'a> {
    /// Where to.
    pub target: &'a Target,
    /// For every pipeline, at the bindings 0, 1, ...
    pub buffers: &'a [&'a Buffer],
    /// For every pipeline, at the bindings after those.
    pub textures: &'a [&'a Texture3d],
    /// As many bytes as the pipelines were built with.
    pub push_constants: &'a [u8],
    /// What is drawn, in order.
    pub batches: &'a [Batch<'a>],
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
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DrawTimes {
    /// Clearing and drawing.
    pub draw: Duration,
    /// Copying the target to host memory.
    pub readback: Duration,
}

/// Clears the target to zero, draws, copies the target to host memory and waits for all of it. Device times
/// are `None` where the device has no timestamps.
///
/// # Errors
/// [`Error::OutOfMemory`](crate::Error::OutOfMemory) or [`Error::Device`](crate::Error::Device) where the device fails.
///
/// # Panics
/// Where bindings or push constants do not match the pipeline.
pub fn draw(gpu: &Arc<Gpu>, draw: &Draw<'_>) -> Result<Option<DrawTimes>> {
    let target = draw.target;
    let mut bound: Vec<&Pipeline> = Vec::new();
    for Batch { pipeline, .. } in draw.batches {
        if !bound.iter().any(|one| std::ptr::eq(*one, *pipeline)) {
            assert_eq!(draw.push_constants.len(), pipeline.push_constant_bytes as usize);
            pipeline.bind(draw.buffers, draw.textures);
            bound.push(pipeline);
        }
    }
    let timestamps = gpu.timestamp_period.map(|period| Timestamps::new(gpu, period)).transpose()?;
    let stamp = |commands, stage, index| {
        if let Some(timestamps) = &timestamps {
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
        if let Some(timestamps) = &timestamps {
            timestamps.reset(commands);
        }
        stamp(commands, vk::PipelineStageFlags::TOP_OF_PIPE, 0);
        let clears =
            vec![vk::ClearValue { color: vk::ClearColorValue { float32: [0.0; 4] } }; target.images.len()];
        let begin = vk::RenderPassBeginInfo::default()
            .render_pass(target.render_pass)
            .framebuffer(target.framebuffer)
            .render_area(area)
            .clear_values(&clears);
        // SAFETY: every object belongs to this device and lives until the submission is waited for; the pipeline
        // was built for this kind of target and its bindings were just written.
        unsafe {
            gpu.raw.cmd_begin_render_pass(commands, &begin, vk::SubpassContents::INLINE);
            gpu.raw.cmd_set_viewport(commands, 0, &[viewport]);
            gpu.raw.cmd_set_scissor(commands, 0, &[area]);
            for Batch { pipeline, vertices } in draw.batches {
                let raw = &gpu.raw;
                raw.cmd_bind_pipeline(commands, vk::PipelineBindPoint::GRAPHICS, pipeline.raw);
                let sets = [pipeline.set];
                let graphics = vk::PipelineBindPoint::GRAPHICS;
                raw.cmd_bind_descriptor_sets(commands, graphics, pipeline.layout, 0, &sets, &[]);
                let stages = vk::ShaderStageFlags::VERTEX | vk::ShaderStageFlags::FRAGMENT;
                raw.cmd_push_constants(commands, pipeline.layout, stages, 0, draw.push_constants);
                raw.cmd_draw(commands, vertices.len() as u32, 1, vertices.start, 0);
            }
            gpu.raw.cmd_end_render_pass(commands);
        }
        stamp(commands, vk::PipelineStageFlags::COLOR_ATTACHMENT_OUTPUT, 1);
        copy_to_host(gpu, commands, target);
        stamp(commands, vk::PipelineStageFlags::TRANSFER, 2);
    })?;
    timestamps.map(|timestamps| timestamps.read()).transpose()
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

/// Records commands, submits them, and waits until they are done.
pub(super) fn submit(gpu: &Gpu, what: &str, record: impl FnOnce(vk::CommandBuffer)) -> Result<()> {
    let explain = |error| vulkan_error(what, error);
    let pool_info = vk::CommandPoolCreateInfo::default()
        .flags(vk::CommandPoolCreateFlags::TRANSIENT)
        .queue_family_index(gpu.queue_family);
    // SAFETY: the pool, its commands and the fence are of this device, used by this thread alone, and destroyed only once
    // the submission is done or was never made.
    unsafe {
        let pool = gpu.raw.create_command_pool(&pool_info, None).map_err(explain)?;
        let run = || -> std::result::Result<(), vk::Result> {
            let allocate = vk::CommandBufferAllocateInfo::default()
                .command_pool(pool)
                .level(vk::CommandBufferLevel::PRIMARY)
                .command_buffer_count(1);
            let commands = gpu.raw.allocate_command_buffers(&allocate)?;
            let begin =
                vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
            gpu.raw.begin_command_buffer(commands[0], &begin)?;
            record(commands[0]);
            gpu.raw.end_command_buffer(commands[0])?;
            let fence = gpu.raw.create_fence(&vk::FenceCreateInfo::default(), None)?;
            let work = vk::SubmitInfo::default().command_buffers(&commands);
            let done = gpu
                .raw
                .queue_submit(*gpu.queue.lock().unwrap_or_else(PoisonError::into_inner), &[work], fence)
                .and_then(|()| gpu.raw.wait_for_fences(&[fence], true, u64::MAX));
            gpu.raw.destroy_fence(fence, None);
            done
        };
        let result = run();
        gpu.raw.destroy_command_pool(pool, None);
        result.map_err(explain)
    }
}
