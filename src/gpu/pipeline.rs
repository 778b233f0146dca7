//! Graphics pipelines: what blends front to back, and what keeps the nearest.

use std::cell::Cell;
use std::marker::PhantomData;
use std::sync::Arc;

use ash::vk;
use rayon::prelude::*;

use super::buffer::Buffer;
use super::device::{Gpu, vulkan_error};
use super::draw::{Draw, Sampled};
use super::format::Rgba;
use super::shaders::Spirv;
use super::target::Target;
use crate::Result;

/// The binding in set 0 by which shaders read the pixel that they mark.
pub const PICTURE: u32 = 24;

/// What becomes of several fragments of a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Keeps {
    /// `destination += (1 - destination.alpha) * source`, in the order in which they are drawn. Only triangles that run clockwise
    /// on the picture are drawn.
    Blend,
    /// The last, for targets that are read by shaders. Only triangles that run clockwise on the picture are drawn.
    Last,
    /// That of the greatest depth value, for targets that keep the nearest; both sides of triangles are drawn.
    Nearest,
    /// None: each marks its pixel by its depth value, for targets that have marks.
    Marks,
    /// The same, for targets that are marked by what was drawn: the shader may read its pixel, as the input attachment at binding
    /// [`PICTURE`].
    MarksByPicture,
    /// As `Blend`, and only of pixels whose mark is less than its depth value. Shaders should test that before they run.
    BlendAbove,
    /// As `Blend`, and only of pixels whose mark is greater than its depth value.
    BlendBelow,
}

/// What a [`Pipeline`] is made of: bindings and bytes are those that its shaders use.
#[derive(Debug, Clone, Copy)]
pub struct PipelineInfo<'a> {
    /// The vertex shader, entry point `main`.
    pub vertex: Spirv,
    /// The fragment shader, entry point `main`: an output for each attachment of the target.
    pub fragment: Spirv,
    /// Values of the specialisation constants 0, 1, ... of the fragment shader (booleans are 0 or 1).
    pub constants: &'a [u32],
    /// Bindings in set 0 of the storage buffers that either shader reads.
    pub storage_buffers: &'a [u32],
    /// Bindings in set 0 of the uniform buffers that the fragment shader reads.
    pub uniform_buffers: &'a [u32],
    /// Bindings in set 0 of the buffers of texels that the fragment shader reads.
    pub texel_buffers: &'a [u32],
    /// Bindings in set 0 of the textures that the fragment shader reads.
    pub textures: &'a [u32],
    /// Whether more than the first level of detail of the textures is read. lavapipe 22.3 looks up the level of each pixel by itself in
    /// textures that have several, even where the shader always asks for the first: that takes a quarter of the time.
    pub minified: bool,
    /// Size of the push constants, in bytes: 4 to 128, a multiple of 4.
    pub push_constant_bytes: u32,
    /// What becomes of several fragments of a pixel.
    pub keeps: Keeps,
}

/// What of a target its pipelines depend on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct TargetKind {
    format: Rgba,
    attachments: usize,
    has_depths: bool,
    /// Whether any of the pipelines that draw into it reads its pixels.
    reads_itself: bool,
}

impl TargetKind {
    fn of(target: &Target) -> Self {
        Self {
            format: target.format,
            attachments: target.attachments(),
            has_depths: target.depth.is_some(),
            reads_itself: target.reads_itself,
        }
    }
}

/// A graphics pipeline without vertex input: triangles pulled from buffers.
#[derive(Debug)]
pub struct Pipeline {
    pub(super) raw: vk::Pipeline,
    pub(super) layout: vk::PipelineLayout,
    set_layout: vk::DescriptorSetLayout,
    pool: vk::DescriptorPool,
    pub(super) set: vk::DescriptorSet,
    buffers: Vec<u32>,
    uniform_buffers: Vec<u32>,
    texel_buffers: Vec<u32>,
    textures: Vec<u32>,
    /// [`PICTURE`], where that is read.
    input_attachments: Vec<u32>,
    minified: bool,
    push_constant_bytes: u32,
    /// Of the targets that it draws into.
    kind: TargetKind,
    gpu: Arc<Gpu>,
    // One thread at a time binds and draws.
    not_shared: PhantomData<Cell<()>>,
}

impl Pipeline {
    /// Builds several at once, on several processors, which takes drivers milliseconds each.
    ///
    /// # Errors
    /// As [`Pipeline::new`]; of several, any.
    ///
    /// # Panics
    /// As [`Pipeline::new`].
    pub fn all<const N: usize>(
        gpu: &Arc<Gpu>,
        target: &Target,
        infos: [Option<PipelineInfo<'_>>; N],
    ) -> Result<[Option<Self>; N]> {
        assert!(Arc::ptr_eq(gpu, &target.gpu), "the target is another device's");
        let (kind, pass) = (TargetKind::of(target), target.clearing);
        let build =
            |info: Option<PipelineInfo<'_>>| info.map(|info| Self::build(gpu, kind, pass, &info)).transpose();
        let pipelines = infos.into_par_iter().map(build).collect::<Result<Vec<_>>>()?;
        Ok(pipelines.try_into().expect("as many as there were"))
    }

    /// Builds the pipeline for targets like `target`.
    ///
    /// # Errors
    /// [`Error::Device`](crate::Error::Device) where the driver refuses.
    ///
    /// # Panics
    /// Where the target is another device's, or a number in `info` is out of its range.
    pub fn new(gpu: &Arc<Gpu>, target: &Target, info: &PipelineInfo<'_>) -> Result<Self> {
        assert!(Arc::ptr_eq(gpu, &target.gpu), "the target is another device's");
        Self::build(gpu, TargetKind::of(target), target.clearing, info)
    }

    /// `pass` is of the same device, and outlives the call. Several threads may be here at once: nothing that Vulkan is given here
    /// must be in the hands of one thread alone.
    fn build(
        gpu: &Arc<Gpu>,
        kind: TargetKind,
        pass: vk::RenderPass,
        info: &PipelineInfo<'_>,
    ) -> Result<Self> {
        let nearest = info.keeps == Keeps::Nearest;
        let blends = matches!(info.keeps, Keeps::Blend | Keeps::BlendAbove | Keeps::BlendBelow);
        let depths = match info.keeps {
            Keeps::Nearest => Some((vk::CompareOp::GREATER, true)),
            Keeps::Marks | Keeps::MarksByPicture => Some((vk::CompareOp::ALWAYS, true)),
            Keeps::BlendAbove => Some((vk::CompareOp::GREATER, false)),
            Keeps::BlendBelow => Some((vk::CompareOp::LESS, false)),
            Keeps::Blend | Keeps::Last => None,
        };
        let reads_picture = info.keeps == Keeps::MarksByPicture;
        assert!(depths.is_none() || kind.has_depths, "a target for the other kind of pipeline");
        assert!(!reads_picture || kind.reads_itself, "a target that is not marked by what was drawn");
        assert!((4..=128).contains(&info.push_constant_bytes) && info.push_constant_bytes.is_multiple_of(4));
        // From here on `Drop` cleans up, null handles included.
        let mut pipeline = Self {
            raw: vk::Pipeline::null(),
            layout: vk::PipelineLayout::null(),
            set_layout: vk::DescriptorSetLayout::null(),
            pool: vk::DescriptorPool::null(),
            set: vk::DescriptorSet::null(),
            buffers: info.storage_buffers.to_vec(),
            uniform_buffers: info.uniform_buffers.to_vec(),
            texel_buffers: info.texel_buffers.to_vec(),
            textures: info.textures.to_vec(),
            input_attachments: if reads_picture { vec![PICTURE] } else { Vec::new() },
            minified: info.minified,
            push_constant_bytes: info.push_constant_bytes,
            kind,
            gpu: gpu.clone(),
            not_shared: PhantomData,
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
            .cull_mode(if nearest { vk::CullModeFlags::NONE } else { vk::CullModeFlags::BACK })
            .front_face(vk::FrontFace::CLOCKWISE)
            .line_width(1.0);
        let samples = vk::PipelineMultisampleStateCreateInfo::default()
            .rasterization_samples(vk::SampleCountFlags::TYPE_1);
        let blends = vec![
            vk::PipelineColorBlendAttachmentState {
                blend_enable: blends.into(),
                src_color_blend_factor: vk::BlendFactor::ONE_MINUS_DST_ALPHA,
                dst_color_blend_factor: vk::BlendFactor::ONE,
                color_blend_op: vk::BlendOp::ADD,
                src_alpha_blend_factor: vk::BlendFactor::ONE_MINUS_DST_ALPHA,
                dst_alpha_blend_factor: vk::BlendFactor::ONE,
                alpha_blend_op: vk::BlendOp::ADD,
                color_write_mask: match info.keeps {
                    Keeps::Marks | Keeps::MarksByPicture => vk::ColorComponentFlags::empty(),
                    _ => vk::ColorComponentFlags::RGBA,
                },
            };
            kind.attachments
        ];
        let blending = vk::PipelineColorBlendStateCreateInfo::default().attachments(&blends);
        let depth = vk::PipelineDepthStencilStateCreateInfo::default()
            .depth_test_enable(depths.is_some())
            .depth_write_enable(depths.is_some_and(|(_, writes)| writes))
            .depth_compare_op(depths.map_or(vk::CompareOp::ALWAYS, |(compares, _)| compares));
        let dynamic = vk::PipelineDynamicStateCreateInfo::default()
            .dynamic_states(&[vk::DynamicState::VIEWPORT, vk::DynamicState::SCISSOR]);
        let create_info = vk::GraphicsPipelineCreateInfo::default()
            .stages(&stages)
            .vertex_input_state(&vertex_input)
            .input_assembly_state(&assembly)
            .viewport_state(&viewports)
            .rasterization_state(&raster)
            .multisample_state(&samples)
            .depth_stencil_state(&depth)
            .color_blend_state(&blending)
            .dynamic_state(&dynamic)
            .layout(pipeline.layout)
            .render_pass(pass);
        // SAFETY: all structures live through the call, and the handles are of this device.
        let created =
            unsafe { gpu.raw.create_graphics_pipelines(vk::PipelineCache::null(), &[create_info], None) };
        pipeline.raw = created.map_err(|(_, error)| vulkan_error("building the pipeline", error))?[0];
        Ok(pipeline)
    }

    fn create_layout(&mut self) -> Result<()> {
        let raw = &self.gpu.raw;
        let mut bindings: Vec<vk::DescriptorSetLayoutBinding<'_>> = Vec::new();
        let kinds = [
            (
                &self.buffers,
                vk::DescriptorType::STORAGE_BUFFER,
                vk::ShaderStageFlags::VERTEX | vk::ShaderStageFlags::FRAGMENT,
            ),
            (&self.uniform_buffers, vk::DescriptorType::UNIFORM_BUFFER, vk::ShaderStageFlags::FRAGMENT),
            (&self.texel_buffers, vk::DescriptorType::UNIFORM_TEXEL_BUFFER, vk::ShaderStageFlags::FRAGMENT),
            (&self.textures, vk::DescriptorType::COMBINED_IMAGE_SAMPLER, vk::ShaderStageFlags::FRAGMENT),
            (&self.input_attachments, vk::DescriptorType::INPUT_ATTACHMENT, vk::ShaderStageFlags::FRAGMENT),
        ];
        for (numbers, kind, stages) in kinds {
            bindings.extend(numbers.iter().map(|&binding| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(binding)
                    .descriptor_type(kind)
                    .descriptor_count(1)
                    .stage_flags(stages)
            }));
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
        // Vulkan has no pool for none of a kind.
        let size = |(numbers, ty, _): (&Vec<u32>, _, _)| vk::DescriptorPoolSize {
            ty,
            descriptor_count: u32::try_from(numbers.len().max(1)).expect("few bindings"),
        };
        let sizes = kinds.map(size);
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

    /// Panics unless `draw` is of the pipeline's device, for targets of its kind, and has what it reads.
    pub(super) fn check(&self, draw: &Draw<'_>) {
        let devices = (draw.buffers.iter().map(|(_, buffer)| &buffer.gpu))
            .chain(draw.textures.iter().map(|(_, texture)| texture.gpu()))
            .chain([&draw.target.gpu]);
        assert!(devices.into_iter().all(|gpu| Arc::ptr_eq(gpu, &self.gpu)), "objects of several devices");
        assert_eq!(TargetKind::of(draw.target), self.kind, "a target for the other kind of pipeline");
        for (_, texture) in draw.textures {
            if let Sampled::Picture(picture) = texture {
                assert!(picture.sampler != vk::Sampler::null(), "a target that shaders cannot read");
                assert!(!std::ptr::eq(*picture, draw.target), "a target that is read while it is drawn");
            }
        }
        assert_eq!(draw.push_constants.len(), self.push_constant_bytes as usize);
    }

    /// Whether its shader reads the pixel that it marks.
    pub(super) fn reads_picture(&self) -> bool {
        !self.input_attachments.is_empty()
    }

    /// Panics where a binding of the pipeline is not among those that `draw` gives.
    pub(super) fn bind(&self, draw: &Draw<'_>) {
        let Draw { target, buffers, textures, .. } = draw;
        let buffer = |binding: &u32| -> &Buffer {
            let (_, buffer) =
                buffers.iter().find(|(one, _)| one == binding).expect("a buffer for each binding");
            buffer
        };
        let whole = |binding: &u32| {
            [vk::DescriptorBufferInfo { buffer: buffer(binding).raw, offset: 0, range: vk::WHOLE_SIZE }]
        };
        let storage_infos: Vec<_> = self.buffers.iter().map(whole).collect();
        let uniform_infos: Vec<_> = self.uniform_buffers.iter().map(whole).collect();
        let views: Vec<_> = self.texel_buffers.iter().map(|binding| [buffer(binding).view]).collect();
        let image_infos = self.textures.iter().map(|&binding| {
            let (_, texture) =
                textures.iter().find(|(one, _)| *one == binding).expect("a texture for each binding");
            let (sampler, image_view) = texture.sampler_and_view(self.minified);
            [vk::DescriptorImageInfo {
                sampler,
                image_view,
                image_layout: vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL,
            }]
        });
        let image_infos: Vec<_> = image_infos.collect();
        let write = |&binding: &u32| vk::WriteDescriptorSet::default().dst_set(self.set).dst_binding(binding);
        let mut writes = Vec::new();
        for (binding, info) in self.buffers.iter().zip(&storage_infos) {
            writes.push(write(binding).descriptor_type(vk::DescriptorType::STORAGE_BUFFER).buffer_info(info));
        }
        for (binding, info) in self.uniform_buffers.iter().zip(&uniform_infos) {
            writes.push(write(binding).descriptor_type(vk::DescriptorType::UNIFORM_BUFFER).buffer_info(info));
        }
        for (binding, view) in self.texel_buffers.iter().zip(&views) {
            let of_texels = write(binding).descriptor_type(vk::DescriptorType::UNIFORM_TEXEL_BUFFER);
            writes.push(of_texels.texel_buffer_view(view));
        }
        for (binding, info) in self.textures.iter().zip(&image_infos) {
            writes.push(
                write(binding).descriptor_type(vk::DescriptorType::COMBINED_IMAGE_SAMPLER).image_info(info),
            );
        }
        let picture = [vk::DescriptorImageInfo {
            sampler: vk::Sampler::null(),
            image_view: target.images[0].view,
            image_layout: vk::ImageLayout::GENERAL,
        }];
        for binding in &self.input_attachments {
            writes.push(
                write(binding).descriptor_type(vk::DescriptorType::INPUT_ATTACHMENT).image_info(&picture),
            );
        }
        // SAFETY: the set is in no pending submission, since each is waited for, by the only thread that has the pipeline;
        // the infos and views live through the call.
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
    fn new(gpu: &'a Gpu, shader: Spirv) -> Result<Self> {
        let info = vk::ShaderModuleCreateInfo::default().code(shader.words());
        // SAFETY: the words come from glslang: there is no other `Spirv`.
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
