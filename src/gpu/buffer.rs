//! Buffers that the host writes or reads and the device reads or writes.

use std::mem::ManuallyDrop;
use std::sync::Arc;

use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::Allocation;

use super::device::{Gpu, vulkan_error};
use super::memory::{allocate, free};
use crate::{Error, Result};

/// Mapped memory of one fixed size.
#[derive(Debug)]
pub struct Buffer {
    pub(super) raw: vk::Buffer,
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
        let bytes = size_of_val(data).max(4) as u64;
        let limit = u64::from(gpu.limits.max_storage_buffer_range);
        if bytes > limit {
            return Err(Error::Device {
                message: format!(
                    "{name}: {bytes} bytes are more than the device's storage buffers hold ({limit})"
                ),
                help: Some("use a mesh with fewer triangles".into()),
            });
        }
        let mut buffer =
            Self::new(gpu, name, bytes, vk::BufferUsageFlags::STORAGE_BUFFER, MemoryLocation::CpuToGpu)?;
        buffer.write_bytes(0, bytemuck::cast_slice(data));
        Ok(buffer)
    }

    /// A buffer that the device copies from.
    pub(super) fn staging(gpu: &Arc<Gpu>, name: &'static str, bytes: u64) -> Result<Self> {
        Self::new(gpu, name, bytes, vk::BufferUsageFlags::TRANSFER_SRC, MemoryLocation::CpuToGpu)
    }

    /// A buffer that the device copies to.
    pub(super) fn readback(gpu: &Arc<Gpu>, name: &'static str, bytes: u64) -> Result<Self> {
        Self::new(gpu, name, bytes, vk::BufferUsageFlags::TRANSFER_DST, MemoryLocation::GpuToCpu)
    }

    fn new(
        gpu: &Arc<Gpu>,
        name: &'static str,
        bytes: u64,
        usage: vk::BufferUsageFlags,
        location: MemoryLocation,
    ) -> Result<Self> {
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
        let buffer = Self { raw, bytes, name, allocation: ManuallyDrop::new(allocation), gpu: gpu.clone() };
        // SAFETY: the allocation meets the buffer's requirements and is bound once.
        unsafe { gpu.raw.bind_buffer_memory(raw, buffer.allocation.memory(), buffer.allocation.offset()) }
            .map_err(|error| vulkan_error(&format!("binding the memory of {name}"), error))?;
        Ok(buffer)
    }

    /// Overwrites the first `data.len()` elements of a buffer made by [`Buffer::storage`]; where they are more than it
    /// holds, a new one takes its place.
    ///
    /// # Errors
    /// As [`Buffer::storage`].
    pub fn refill<T: bytemuck::NoUninit>(&mut self, data: &[T]) -> Result<()> {
        if size_of_val(data) as u64 > self.bytes {
            *self = Self::storage(&self.gpu, self.name, data)?;
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
        // SAFETY: every submission that used the buffer was waited for; it is not used again.
        unsafe {
            self.gpu.raw.destroy_buffer(self.raw, None);
            free(&self.gpu, &mut self.allocation);
        }
    }
}
