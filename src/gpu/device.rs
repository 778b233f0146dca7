//! Choice of device, logical device, memory allocator.

use std::mem::ManuallyDrop;
use std::str::FromStr;
use std::sync::{Arc, Mutex, OnceLock};

use ash::vk;
use gpu_allocator::vulkan::{Allocator, AllocatorCreateDesc};

use super::instance::{DeviceInfo, Instance, Messages};
use super::target::{ReadBy, Target};
use super::texture::{Texture3d, most_levels};
use crate::{Error, Result};

/// Which of the machine's devices to use.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum DeviceChoice {
    /// The first discrete GPU, else integrated, else virtual, else a CPU driver.
    #[default]
    Any,
    /// The position in the list of [`devices`](super::devices).
    Index(usize),
    /// A part of the name, in any case.
    Name(String),
    /// The UUID as [`DeviceInfo::uuid`] prints it.
    Uuid(String),
}

impl FromStr for DeviceChoice {
    type Err = std::convert::Infallible;

    fn from_str(text: &str) -> std::result::Result<Self, Self::Err> {
        let is_uuid = text.len() == 36
            && text.bytes().enumerate().all(|(i, byte)| match i {
                8 | 13 | 18 | 23 => byte == b'-',
                _ => byte.is_ascii_hexdigit(),
            });
        Ok(match text.parse() {
            Ok(index) => Self::Index(index),
            Err(_) if is_uuid => Self::Uuid(text.to_ascii_lowercase()),
            Err(_) => Self::Name(text.to_owned()),
        })
    }
}

/// `error` as one of ours: out of memory or a device fault, while doing `what`.
pub(super) fn vulkan_error(what: &str, error: vk::Result) -> Error {
    match error {
        // Pools here are as large as what is made from them: where one runs out, memory did.
        vk::Result::ERROR_OUT_OF_HOST_MEMORY
        | vk::Result::ERROR_OUT_OF_DEVICE_MEMORY
        | vk::Result::ERROR_OUT_OF_POOL_MEMORY
        | vk::Result::ERROR_FRAGMENTED_POOL => Error::OutOfMemory {
            message: format!("the device ran out of memory while {what}"),
            help: Some("use a smaller picture, volume or mesh".into()),
        },
        error => Error::Device { message: format!("Vulkan failed while {what}: {error}"), help: None },
    }
}

/// An open device with one queue and a memory allocator.
pub struct Gpu {
    pub(super) raw: ash::Device,
    pub(super) queue: Mutex<vk::Queue>,
    pub(super) queue_family: u32,
    pub(super) limits: vk::PhysicalDeviceLimits,
    /// Nanoseconds a timestamp tick, where the queue has timestamps.
    pub(super) timestamp_period: Option<f64>,
    pub(super) allocator: ManuallyDrop<Mutex<Allocator>>,
    /// Once that was measured.
    pub(super) blends_levels: OnceLock<bool>,
    physical: vk::PhysicalDevice,
    info: DeviceInfo,
    instance: Instance,
}

impl std::fmt::Debug for Gpu {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_tuple("Gpu").field(&self.info).finish()
    }
}

impl Gpu {
    /// Opens a device. With `messages`, the Khronos validation layer watches (with synchronization validation) and what
    /// it says is collected there, until the device is dropped and after.
    ///
    /// # Errors
    /// [`Error::Device`] where there is no such device, no driver, or no validation layer.
    pub fn open(choice: &DeviceChoice, messages: Option<&Messages>) -> Result<Arc<Self>> {
        let instance = Instance::new(messages)?;
        let (physical, info) = choose(choice, instance.physical_devices()?)?;
        // SAFETY: plain queries on a handle of this instance.
        let (properties, families) = unsafe {
            (
                instance.raw.get_physical_device_properties(physical),
                instance.raw.get_physical_device_queue_family_properties(physical),
            )
        };
        if properties.api_version < vk::API_VERSION_1_1 {
            return Err(Error::Device {
                message: format!("{} offers Vulkan {}; 1.1 is needed", info.name, info.api_version),
                help: Some("choose another device: `mesoshell devices` lists them".into()),
            });
        }
        let queue_family = families
            .iter()
            .position(|family| {
                family.queue_flags.contains(vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE)
            })
            .ok_or_else(|| Error::Device {
                message: format!("{} has no graphics queue", info.name),
                help: Some("choose another device: `mesoshell devices` lists them".into()),
            })?;
        let has_timestamps = families[queue_family].timestamp_valid_bits > 0;
        let queue_family = u32::try_from(queue_family).expect("Vulkan counts queue families in u32");
        let queues =
            [vk::DeviceQueueCreateInfo::default().queue_family_index(queue_family).queue_priorities(&[1.0])];
        let device_info = vk::DeviceCreateInfo::default().queue_create_infos(&queues);
        // SAFETY: the queue family exists; no feature or extension is asked for.
        let raw = unsafe { instance.raw.create_device(physical, &device_info, None) }
            .map_err(|error| vulkan_error("opening the device", error))?;
        // SAFETY: one queue of this family was created.
        let queue = unsafe { raw.get_device_queue(queue_family, 0) };
        let allocator = Allocator::new(&AllocatorCreateDesc {
            instance: instance.raw.clone(),
            device: raw.clone(),
            physical_device: physical,
            debug_settings: gpu_allocator::AllocatorDebugSettings::default(),
            buffer_device_address: false,
            allocation_sizes: gpu_allocator::AllocationSizes::default(),
        });
        let allocator = match allocator {
            Ok(allocator) => allocator,
            Err(error) => {
                // SAFETY: nothing was made from the device yet.
                unsafe { raw.destroy_device(None) };
                return Err(Error::Device { message: format!("no memory allocator: {error}"), help: None });
            }
        };
        Ok(Arc::new(Self {
            raw,
            queue: Mutex::new(queue),
            queue_family,
            limits: properties.limits,
            timestamp_period: has_timestamps.then_some(f64::from(properties.limits.timestamp_period)),
            allocator: ManuallyDrop::new(Mutex::new(allocator)),
            blends_levels: OnceLock::new(),
            physical,
            info,
            instance,
        }))
    }

    /// What the device says of itself.
    pub fn info(&self) -> &DeviceInfo {
        &self.info
    }

    /// The rasteriser's subpixels a pixel: it snaps vertices to this grid.
    pub fn subpixels(&self) -> u32 {
        1 << self.limits.sub_pixel_precision_bits
    }

    /// How many texels a buffer of texels holds: 65,536 at least.
    pub fn most_texels(&self) -> usize {
        self.limits.max_texel_buffer_elements as usize
    }

    /// Refuses a picture or a volume that the device could not hold, of so many pixels or texels a side. What is asked here is
    /// asked again when they are made; this is for asking before the volume is computed.
    ///
    /// # Errors
    /// [`Error::Device`] where a side is too long, [`Error::OutOfMemory`].
    pub fn check_sizes(&self, picture: [u32; 2], volume: [u32; 3]) -> Result<()> {
        Target::check(self, "the picture", picture, 1, ReadBy::Host { marked: true })?;
        Texture3d::check(self, "the volume", volume, most_levels(volume))?;
        Ok(())
    }

    /// Whether images of `format` with optimal tiling can do all of `features`.
    pub(super) fn supports(&self, format: vk::Format, features: vk::FormatFeatureFlags) -> bool {
        // SAFETY: plain query.
        let properties =
            unsafe { self.instance.raw.get_physical_device_format_properties(self.physical, format) };
        properties.optimal_tiling_features.contains(features)
    }

    /// Refuses what cannot fit: software drivers grant more memory than there is and are killed for it later.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub(super) fn check_memory(&self, what: &str, bytes: u64) -> Result<()> {
        let mut free = self.info.memory_bytes;
        if self.info.kind == "cpu" {
            free = free.min(available_system_memory().unwrap_or(free));
        }
        if bytes <= free {
            return Ok(());
        }
        Err(Error::OutOfMemory {
            message: format!(
                "{what} needs {} MiB, but {} has {} MiB",
                bytes >> 20,
                self.info.name,
                free >> 20
            ),
            help: Some("use a smaller picture, volume or mesh".into()),
        })
    }
}

impl Drop for Gpu {
    fn drop(&mut self) {
        // SAFETY: all objects of the device held an `Arc` of it and are gone; every submission was waited for. The
        // allocator frees its memory before the device goes, and is not used again.
        unsafe {
            ManuallyDrop::drop(&mut self.allocator);
            self.raw.destroy_device(None);
        }
    }
}

/// The memory that the system can still give, in bytes, where it says so.
fn available_system_memory() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    Some(line.trim().trim_end_matches("kB").trim().parse::<u64>().ok()? << 10)
}

fn choose(
    choice: &DeviceChoice,
    devices: Vec<(vk::PhysicalDevice, DeviceInfo)>,
) -> Result<(vk::PhysicalDevice, DeviceInfo)> {
    let names: Vec<String> =
        devices.iter().map(|(_, info)| format!("{} ({})", info.index, info.name)).collect();
    let preference = |info: &DeviceInfo| {
        ["discrete", "integrated", "virtual", "cpu"].iter().position(|kind| info.kind == *kind).unwrap_or(4)
    };
    let chosen = match choice {
        DeviceChoice::Any => devices.into_iter().min_by_key(|(_, info)| (preference(info), info.index)),
        DeviceChoice::Index(index) => devices.into_iter().find(|(_, info)| info.index == *index),
        DeviceChoice::Uuid(uuid) => devices.into_iter().find(|(_, info)| info.uuid == *uuid),
        DeviceChoice::Name(part) => {
            let part = part.to_lowercase();
            devices.into_iter().find(|(_, info)| info.name.to_lowercase().contains(&part))
        }
    };
    chosen.ok_or_else(|| {
        let asked = match choice {
            DeviceChoice::Any => "any".to_owned(),
            DeviceChoice::Index(index) => format!("number {index}"),
            DeviceChoice::Name(part) => format!("with \"{part}\" in its name"),
            DeviceChoice::Uuid(uuid) => format!("with the UUID {uuid}"),
        };
        Error::Device {
            message: format!("there is no device {asked}"),
            help: Some(format!("there is: {}", names.join(", "))),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn want_of_memory_is_told_from_other_failures() {
        let exit_code = |error| vulkan_error("drawing", error).exit_code();
        for error in [
            vk::Result::ERROR_OUT_OF_HOST_MEMORY,
            vk::Result::ERROR_OUT_OF_DEVICE_MEMORY,
            vk::Result::ERROR_OUT_OF_POOL_MEMORY,
            vk::Result::ERROR_FRAGMENTED_POOL,
        ] {
            assert_eq!(exit_code(error), 5, "{error:?}");
        }
        assert_eq!(exit_code(vk::Result::ERROR_DEVICE_LOST), 4);
    }
}
