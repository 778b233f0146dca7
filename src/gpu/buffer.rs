//! Buffers that the host writes or reads and the device reads or writes.

use std::mem::ManuallyDrop;
use std::sync::Arc;

use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::Allocation;

use super::device::{Gpu, vulkan_error};
use super::memory::{allocate, free};
use crate::{Error, Result};

/// How shaders see a buffer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// Not at all.
    Transfer(vk::BufferUsageFlags),
    Storage,
    Uniform,
    /// As a row of texels, which is read by `texelFetch`: where neighbouring fragments read here and there, that is faster on some
    /// devices than a storage buffer.
    Texels(vk::Format),
}

/// Mapped memory of one fixed size.
#[derive(Debug)]
pub struct Buffer {
    pub(super) raw: vk::Buffer,
    /// Of texels.
    pub(super) view: vk::BufferView,
    kind: Kind,
    bytes: u64,
    name: &'static str,
    allocation: ManuallyDrop<Allocation>,
    pub(super) gpu: Arc<Gpu>,
}

impl Buffer {
    /// A storage buffer that shaders read, filled with `data`.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]; [`Error::Device`] where `data` is larger than the device's storage buffers.
    pub fn storage<T: bytemuck::NoUninit>(gpu: &Arc<Gpu>, name: &'static str, data: &[T]) -> Result<Self> {
        Self::filled(gpu, name, Kind::Storage, bytemuck::cast_slice(data))
    }

    /// A uniform buffer, of the size that shaders declare: of few bytes that all fragments read alike.
    ///
    /// # Errors
    /// As [`Buffer::storage`].
    pub fn uniform<T: bytemuck::NoUninit>(gpu: &Arc<Gpu>, name: &'static str, data: &[T]) -> Result<Self> {
        Self::filled(gpu, name, Kind::Uniform, bytemuck::cast_slice(data))
    }

    /// Texels of four floats that shaders fetch, as many as `data` has; `T` is made of such.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]; [`Error::Device`] where `data` has more texels than the device's texel buffers.
    pub fn floats<T: bytemuck::NoUninit>(gpu: &Arc<Gpu>, name: &'static str, data: &[T]) -> Result<Self> {
        assert!(size_of::<T>().is_multiple_of(16), "{name}: no whole texels");
        let kind = Kind::Texels(vk::Format::R32G32B32A32_SFLOAT);
        Self::filled(gpu, name, kind, bytemuck::cast_slice(data))
    }

    /// Texels of an unsigned number each that shaders fetch.
    ///
    /// # Errors
    /// As [`Buffer::floats`].
    pub fn numbers(gpu: &Arc<Gpu>, name: &'static str, data: &[u32]) -> Result<Self> {
        Self::filled(gpu, name, Kind::Texels(vk::Format::R32_UINT), bytemuck::cast_slice(data))
    }

    /// Texels of two unsigned numbers each that shaders fetch.
    ///
    /// # Errors
    /// As [`Buffer::floats`].
    pub fn pairs(gpu: &Arc<Gpu>, name: &'static str, data: &[[u32; 2]]) -> Result<Self> {
        Self::filled(gpu, name, Kind::Texels(vk::Format::R32G32_UINT), bytemuck::cast_slice(data))
    }

    fn filled(gpu: &Arc<Gpu>, name: &'static str, kind: Kind, data: &[u8]) -> Result<Self> {
        let (bytes, limit) = match kind {
            Kind::Texels(format) => {
                let texel = match format {
                    vk::Format::R32_UINT => 4,
                    vk::Format::R32G32_UINT => 8,
                    vk::Format::R32G32B32A32_SFLOAT => 16,
                    _ => unreachable!("no buffer has texels of another format"),
                };
                (data.len().max(texel), u64::from(gpu.limits.max_texel_buffer_elements) * texel as u64)
            }
            Kind::Uniform => (data.len().max(4), u64::from(gpu.limits.max_uniform_buffer_range)),
            _ => (data.len().max(4), u64::from(gpu.limits.max_storage_buffer_range)),
        };
        if bytes as u64 > limit {
            return Err(Error::Device {
                message: format!("{name}: {bytes} bytes are more than the device's buffers hold ({limit})"),
                help: Some(match kind {
                    Kind::Uniform => "use another device".into(),
                    Kind::Texels(vk::Format::R32G32_UINT) => "ask for a smaller picture".into(),
                    _ => "use a mesh with fewer triangles".into(),
                }),
            });
        }
        let mut buffer = Self::new(gpu, name, bytes as u64, kind, MemoryLocation::CpuToGpu)?;
        buffer.write_bytes(0, data);
        Ok(buffer)
    }

    /// A buffer that the device copies from.
    pub(super) fn staging(gpu: &Arc<Gpu>, name: &'static str, bytes: u64) -> Result<Self> {
        Self::new(
            gpu,
            name,
            bytes,
            Kind::Transfer(vk::BufferUsageFlags::TRANSFER_SRC),
            MemoryLocation::CpuToGpu,
        )
    }

    /// A buffer that the device copies to.
    pub(super) fn readback(gpu: &Arc<Gpu>, name: &'static str, bytes: u64) -> Result<Self> {
        Self::new(
            gpu,
            name,
            bytes,
            Kind::Transfer(vk::BufferUsageFlags::TRANSFER_DST),
            MemoryLocation::GpuToCpu,
        )
    }

    fn new(
        gpu: &Arc<Gpu>,
        name: &'static str,
        bytes: u64,
        kind: Kind,
        location: MemoryLocation,
    ) -> Result<Self> {
        let usage = match kind {
            Kind::Transfer(usage) => usage,
            Kind::Storage => vk::BufferUsageFlags::STORAGE_BUFFER,
            Kind::Uniform => vk::BufferUsageFlags::UNIFORM_BUFFER,
            Kind::Texels(_) => vk::BufferUsageFlags::UNIFORM_TEXEL_BUFFER,
        };
        gpu.check_memory(name, bytes)?;
        let info = vk::BufferCreateInfo::default().size(bytes).usage(usage);
        assert!(bytes > 0, "{name}: Vulkan has no empty buffers");
        // SAFETY: the size is at least 1 and the device outlives the buffer, which holds it.
        let raw = unsafe { gpu.raw.create_buffer(&info, None) }
            .map_err(|error| vulkan_error(&format!("creating the buffer of {name}"), error))?;
        // SAFETY: `raw` was just made by this device.
        let requirements = unsafe { gpu.raw.get_buffer_memory_requirements(raw) };
        let allocation = match allocate(gpu, name, requirements, location, true) {
            Ok(allocation) => allocation,
            Err(error) => {
                // SAFETY: nothing uses the buffer yet.
                unsafe { gpu.raw.destroy_buffer(raw, None) };
                return Err(error);
            }
        };
        let (view, allocation) = (vk::BufferView::null(), ManuallyDrop::new(allocation));
        let mut buffer = Self { raw, view, kind, bytes, name, allocation, gpu: gpu.clone() };
        // SAFETY: the allocation meets the buffer's requirements and is bound once.
        unsafe { gpu.raw.bind_buffer_memory(raw, buffer.allocation.memory(), buffer.allocation.offset()) }
            .map_err(|error| vulkan_error(&format!("binding the memory of {name}"), error))?;
        if let Kind::Texels(format) = kind {
            let info = vk::BufferViewCreateInfo::default().buffer(raw).format(format).range(vk::WHOLE_SIZE);
            // SAFETY: the buffer has its memory, and was made for views; every device has these formats for them.
            buffer.view = unsafe { gpu.raw.create_buffer_view(&info, None) }
                .map_err(|error| vulkan_error(&format!("viewing {name}"), error))?;
        }
        Ok(buffer)
    }

    /// Overwrites the first `data.len()` elements of a buffer that shaders read; where they are more than it
    /// holds, a new one takes its place.
    ///
    /// # Errors
    /// As [`Buffer::storage`].
    pub fn refill<T: bytemuck::NoUninit>(&mut self, data: &[T]) -> Result<()> {
        if size_of_val(data) as u64 > self.bytes {
            *self = Self::filled(&self.gpu, self.name, self.kind, bytemuck::cast_slice(data))?;
        } else {
            self.write_bytes(0, bytemuck::cast_slice(data));
        }
        Ok(())
    }

    /// Overwrites bytes from `start` on; panics where they do not fit.
    pub(super) fn write_bytes(&mut self, start: usize, bytes: &[u8]) {
        let mapped = self.allocation.mapped_slice_mut().expect("buffers are host-visible");
        mapped[start..start + bytes.len()].copy_from_slice(bytes);
    }

    /// The buffer's contents.
    pub(super) fn read(&self) -> &[u8] {
        let mapped = self.allocation.mapped_slice().expect("buffers are host-visible");
        &mapped[..usize::try_from(self.bytes).expect("mapped memory fits the address space")]
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        // SAFETY: every submission that used the buffer was waited for; it is not used again. Null handles are allowed.
        unsafe {
            self.gpu.raw.destroy_buffer_view(self.view, None);
            self.gpu.raw.destroy_buffer(self.raw, None);
            free(&self.gpu, &mut self.allocation);
        }
    }
}
