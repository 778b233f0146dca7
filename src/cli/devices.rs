//! `mesoshell devices`: what there is to render on.

use clap::Args;
use mesoshell::{Result, gpu};

use super::{Talk, table};

/// List the Vulkan devices
#[derive(Args)]
pub struct Arguments {}

/// # Errors
/// No Vulkan loader, or no driver.
pub fn run(_: Arguments, talk: Talk) -> Result<()> {
    let devices = gpu::devices()?;
    talk.result(&devices, || {
        let lines = devices.iter().map(|device| {
            let rows = [
                ("kind", device.kind.clone()),
                ("driver", device.driver.clone()),
                ("Vulkan", device.api_version.clone()),
                ("memory", format!("{} MiB", device.memory_bytes >> 20)),
                ("longest 3D side", format!("{} texels", device.max_image_3d)),
                ("longest 2D side", format!("{} texels", device.max_image_2d)),
                ("UUID", device.uuid.clone()),
            ];
            format!("{}: {}\n{}", device.index, device.name, table(rows))
        });
        lines.collect()
    })
}
