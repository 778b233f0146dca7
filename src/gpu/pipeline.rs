//! Graphics pipelines that blend front to back.

use std::cell::Cell;
use std::marker::PhantomData;
use std::sync::Arc;

use ash::vk;

use super::buffer::Buffer;
use super::device::{Gpu, vulkan_error};
use super::draw::Draw;
use super::format::Rgba;
use super::shaders::Spirv;
use super::target::Target;
use super::texture::Texture3d;
use crate::Result;

/// What a [`Pipeline`] is made of: numbers of bindings and bytes are those that its shaders use.
#[derive(Debug, Clone, Copy)]
pub struct PipelineInfo<'a> {
    /// The vertex shader, entry point `main`.
    pub vertex: Spirv,
    /// The fragment shader, entry point `main`: an output for each attachment of the target.
    pub fragment: Spirv,
    /// Values of the specialisation constants 0, 1, ... of the fragment shader (booleans are 0 or 1).
    pub constants: &'a [u32],
    /// Storage buffers at the bindings 0, 1, ... of set 0, read by either shader; at least 1.
    pub storage_buffers: u32,
    /// Sampled textures at the bindings after the buffers, read by the fragment shader; at least 1.
    pub textures: u32,
    /// Size of the push constants, in bytes: 4 to 128, a multiple of 4.
    pub push_constant_bytes: u32,
}

/// A graphics pipeline without vertex input: triangles pulled from buffers, blended front to back,
/// `destination += (1 - destination.alpha) * source`, no depth test. Only triangles that run clockwise on the
/// picture are drawn.
#[derive(Debug)]
pub struct Pipeline {
    pub(super) raw: vk::Pipeline,
    pub(super) layout: vk::PipelineLayout,
    set_layout: vk::DescriptorSetLayout,
    pool: vk::DescriptorPool,
    pub(super) set: vk::DescriptorSet,
    buffers: u32,
    textures: u32,
    push_constant_bytes: u32,
    /// Of the targets that it draws into.
    format: Rgba,
    attachments: usize,
    gpu: Arc<Gpu>,
    // One thread at a time binds and draws.
    not_shared: PhantomData<Cell<()>>,
}

impl Pipeline {
    /// Builds the pipeline for targets like `target`.
    ///
    /// # Errors
    /// [`Error::Device`](crate::Error::Device) where the driver refuses.
    ///
    /// # Panics
    /// Where the target is another device's, or a number in `info` is out of its range.
    pub fn new(gpu: &Arc<Gpu>, target: &Target, info: &PipelineInfo<'_>) -> Result<Self> {
        assert!(Arc::ptr_eq(gpu, &target.gpu), "the target is another device's");
        assert!(info.storage_buffers > 0 && info.textures > 0);
        assert!((4..=128).contains(&info.push_constant_bytes) && info.push_constant_bytes.is_multiple_of(4));
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
            format: target.format,
            attachments: target.images.len(),
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
            .render_pass(target.clearing);
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

    /// Panics unless `draw` is of the pipeline's device, for targets of its kind, and has what it reads.
    pub(super) fn check(&self, draw: &Draw<'_>) {
        let devices = (draw.buffers.iter().map(|buffer| &buffer.gpu))
            .chain(draw.textures.iter().map(|texture| &texture.gpu))
            .chain([&draw.target.gpu]);
        assert!(devices.into_iter().all(|gpu| Arc::ptr_eq(gpu, &self.gpu)), "objects of several devices");
        assert_eq!((draw.target.format, draw.target.images.len()), (self.format, self.attachments));
        assert_eq!(
            (draw.buffers.len(), draw.textures.len()),
            (self.buffers as usize, self.textures as usize)
        );
        assert_eq!(draw.push_constants.len(), self.push_constant_bytes as usize);
    }

    pub(super) fn bind(&self, buffers: &[&Buffer], textures: &[&Texture3d]) {
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
        // SAFETY: the set is in no pending submission, since each is waited for, by the only thread that has the pipeline;
        // the infos live through the call.
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
