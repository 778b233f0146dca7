//! The one way to the queue.

use std::sync::PoisonError;
use std::time::Duration;

use ash::vk;

use super::device::{Gpu, vulkan_error};
use crate::Result;

/// Records commands, submits them, and waits until they are done.
pub(super) fn submit(gpu: &Gpu, what: &str, record: impl FnOnce(vk::CommandBuffer)) -> Result<()> {
    let explain = |error| vulkan_error(what, error);
    let pool_info = vk::CommandPoolCreateInfo::default()
        .flags(vk::CommandPoolCreateFlags::TRANSIENT)
        .queue_family_index(gpu.queue_family);
    // SAFETY: the pool, its commands and the fence are of this device, used by this thread alone, and destroyed only once
    // the submission is done, was never made, or will not go on because the device is lost.
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
                .and_then(|()| wait(gpu, fence));
            gpu.raw.destroy_fence(fence, None);
            done
        };
        let result = run();
        gpu.raw.destroy_command_pool(pool, None);
        result.map_err(explain)
    }
}

/// Waits until the submission of `fence` is done, or its device lost. A wait that fails for want of memory, the machine's or the
/// device's, is begun anew: what the submission uses must not go before it has ended.
fn wait(gpu: &Gpu, fence: vk::Fence) -> std::result::Result<(), vk::Result> {
    loop {
        // SAFETY: the fence is of this device, and destroyed only after.
        match unsafe { gpu.raw.wait_for_fences(&[fence], true, u64::MAX) } {
            Err(vk::Result::ERROR_OUT_OF_HOST_MEMORY | vk::Result::ERROR_OUT_OF_DEVICE_MEMORY) => {
                std::thread::sleep(Duration::from_millis(10));
            }
            done => return done,
        }
    }
}
