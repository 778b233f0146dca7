//! Device memory, from the allocator of [`Gpu`].

use std::mem::ManuallyDrop;
use std::sync::PoisonError;

use ash::vk;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme};
use gpu_allocator::{AllocationError, MemoryLocation};

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
    let allocated = gpu.allocator.lock().unwrap_or_else(PoisonError::into_inner).allocate(&description);
    allocated.map_err(|error| explain(name, requirements.size, &error))
}

/// Why there are no `bytes` for `name`. The allocator calls want of host memory an internal error, or one of mapping.
fn explain(name: &str, bytes: u64, error: &AllocationError) -> Error {
    let message = format!("no {} MiB of device memory for {name}: {error}", bytes >> 20);
    match error {
        AllocationError::OutOfMemory | AllocationError::FailedToMap(_) | AllocationError::Internal(_) => {
            Error::OutOfMemory { message, help: Some("use a smaller picture, volume or mesh".into()) }
        }
        _ => Error::Device { message, help: None },
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn want_of_memory_is_told_from_want_of_a_kind_of_memory() {
        let exit_code = |error| explain("the volume", 1 << 20, &error).exit_code();
        assert_eq!(exit_code(AllocationError::OutOfMemory), 5);
        assert_eq!(exit_code(AllocationError::NoCompatibleMemoryTypeFound), 4);
    }
}
