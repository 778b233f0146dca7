//! Device memory, from the allocator of [`Gpu`].

use std::mem::ManuallyDrop;
use std::sync::PoisonError;

use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme};

use super::device::Gpu;
use crate::{Error, Result};

/// Memory that meets `requirements`; `linear` for buffers, not for images. `name` is for errors.
pub(super) fn allocate(
    gpu: &Gpu,
    name: &str,
    requirements: vk::MemoryRequirements,
    location: MemoryLocation,
    linear: bool,
) -> Result<Allocation> {
    let description = AllocationCreateDesc {
        name,
        requirements,
        location,
        linear,
        allocation_scheme: AllocationScheme::GpuAllocatorManaged,
    };
    gpu.allocator.lock().unwrap_or_else(PoisonError::into_inner).allocate(&description).map_err(|error| {
        Error::OutOfMemory {
            message: format!("no {} MiB of device memory for {name}: {error}", requirements.size >> 20),
            help: Some("use a smaller picture, volume or mesh".into()),
        }
    })
}

/// Returns memory to the allocator.
///
/// # Safety
/// The allocation is not used again, by the host or the device.
pub(super) unsafe fn free(gpu: &Gpu, allocation: &mut ManuallyDrop<Allocation>) {
    // SAFETY: the caller gives it up.
    let allocation = unsafe { ManuallyDrop::take(allocation) };
    let freed = gpu.allocator.lock().unwrap_or_else(PoisonError::into_inner).free(allocation);
    debug_assert!(freed.is_ok(), "{freed:?}");
}
