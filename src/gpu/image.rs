//! Images in device memory.

use std::mem::ManuallyDrop;
use std::sync::Arc;

use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::Allocation;

use super::device::{Gpu, vulkan_error};
use super::memory::{allocate, free};
use crate::Result;

/// An image with its memory, one view of all of it, one of each layer where it has several, and one of the first mip level where it has
/// several.
#[derive(Debug)]
pub(super) struct DeviceImage {
    pub(super) raw: vk::Image,
    pub(super) view: vk::ImageView,
    layers: Vec<vk::ImageView>,
    first_level: Option<vk::ImageView>,
    allocation: ManuallyDrop<Allocation>,
    gpu: Arc<Gpu>,
}

impl DeviceImage {
    /// An image as `info` says, in device memory; the caller has checked that the device has such images.
    pub(super) fn new(
        gpu: &Arc<Gpu>,
        name: &str,
        info: &vk::ImageCreateInfo<'_>,
        view_type: vk::ImageViewType,
        aspect: vk::ImageAspectFlags,
    ) -> Result<Self> {
        Self::with_channels(gpu, name, info, view_type, aspect, vk::ComponentMapping::default())
    }

    /// The same, whose texels are seen with other channels.
    pub(super) fn with_channels(
        gpu: &Arc<Gpu>,
        name: &str,
        info: &vk::ImageCreateInfo<'_>,
        view_type: vk::ImageViewType,
        aspect: vk::ImageAspectFlags,
        channels: vk::ComponentMapping,
    ) -> Result<Self> {
        // SAFETY: the caller checked sides against the limits, and the format against its features.
        let raw = unsafe { gpu.raw.create_image(info, None) }
            .map_err(|error| vulkan_error(&format!("creating the image of {name}"), error))?;
        // SAFETY: `raw` was just made by this device.
        let requirements = unsafe { gpu.raw.get_image_memory_requirements(raw) };
        let allocation = match allocate(gpu, name, requirements, MemoryLocation::GpuOnly, false) {
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
            layers: Vec::new(),
            first_level: None,
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
            .components(channels)
            .subresource_range(vk::ImageSubresourceRange { aspect_mask: aspect, ..whole() });
        let view = |info: &vk::ImageViewCreateInfo<'_>| {
            // SAFETY: each view covers the image that was just made, or a layer or level that it has.
            unsafe { gpu.raw.create_image_view(info, None) }
                .map_err(|error| vulkan_error(&format!("creating the view of {name}"), error))
        };
        image.view = view(&view_info)?;
        if info.array_layers > 1 {
            for layer in 0..info.array_layers {
                let range = vk::ImageSubresourceRange {
                    aspect_mask: aspect,
                    base_array_layer: layer,
                    layer_count: 1,
                    ..whole()
                };
                let of_layer = view_info.view_type(vk::ImageViewType::TYPE_2D).subresource_range(range);
                image.layers.push(view(&of_layer)?);
            }
        }
        if info.mip_levels > 1 {
            let range = vk::ImageSubresourceRange { aspect_mask: aspect, level_count: 1, ..whole() };
            image.first_level = Some(view(&view_info.subresource_range(range))?);
        }
        Ok(image)
    }

    /// The view of no other mip level than the first.
    pub(super) fn first_level(&self) -> vk::ImageView {
        self.first_level.unwrap_or(self.view)
    }

    /// One view a layer.
    pub(super) fn layers(&self) -> &[vk::ImageView] {
        if self.layers.is_empty() { std::slice::from_ref(&self.view) } else { &self.layers }
    }
}

impl Drop for DeviceImage {
    fn drop(&mut self) {
        // SAFETY: every submission that used the image was waited for; destroying a null view does nothing.
        unsafe {
            self.gpu.raw.destroy_image_view(self.view, None);
            for &layer in self.layers.iter().chain(&self.first_level) {
                self.gpu.raw.destroy_image_view(layer, None);
            }
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
