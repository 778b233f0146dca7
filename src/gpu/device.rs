//! Instance, choice of device, logical device, memory allocator, and the validation layers' messages.

use std::ffi::{CStr, c_void};
use std::mem::ManuallyDrop;
use std::str::FromStr;
use std::sync::{Arc, Mutex, PoisonError};

use ash::vk;
use gpu_allocator::vulkan::{Allocator, AllocatorCreateDesc};
use serde::Serialize;

use super::target::Target;
use super::texture::{Texture3d, most_levels};
use crate::{Error, Result};

const VALIDATION_LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";
const INSTALL_DRIVER: &str = "install a Vulkan driver; without a GPU, Mesa's software driver serves: \
    on Debian, `apt-get install mesa-vulkan-drivers libvulkan1`";

/// Which of the machine's devices to use.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum DeviceChoice {
    /// The first discrete GPU, else integrated, else virtual, else a CPU driver.
    #[default]
    Any,
    /// The position in the list of [`devices`].
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

/// What a device says of itself.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct DeviceInfo {
    /// For [`DeviceChoice::Index`].
    pub index: usize,
    /// The device's own name.
    pub name: String,
    /// In the usual 8-4-4-4-12 digits; all zero where the driver gives none.
    pub uuid: String,
    /// `discrete`, `integrated`, `virtual`, `cpu` or `other`.
    pub kind: String,
    /// Name and version of the driver; the number of its version where it does not tell its name.
    pub driver: String,
    /// The Vulkan version that it offers.
    pub api_version: String,
    /// The largest memory heap that is local to the device, in bytes.
    pub memory_bytes: u64,
    /// The longest side of a 3D image, in texels.
    pub max_image_3d: u32,
    /// The longest side of a 2D image, in texels.
    pub max_image_2d: u32,
}

/// What the validation layers said. Kept apart from the device, so that messages of its own end are heard.
#[derive(Debug, Clone, Default)]
pub struct Messages(Arc<Mutex<Vec<String>>>);

impl Messages {
    /// All messages so far, warnings and errors alike.
    pub fn all(&self) -> Vec<String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn push(&self, message: String) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(message);
    }
}

/// The devices of this machine.
///
/// # Errors
/// [`Error::Device`] where there is no Vulkan loader or no driver.
pub fn devices() -> Result<Vec<DeviceInfo>> {
    let instance = Instance::new(None)?;
    Ok(instance.physical_devices()?.into_iter().map(|(_, info)| info).collect())
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

struct Instance {
    raw: ash::Instance,
    debug: Option<(ash::ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    // The callback's user data: freed after the instance, whose destruction still reports.
    messages: Option<*mut Messages>,
    // Keeps the loader library open; last to be dropped.
    _entry: ash::Entry,
}

// SAFETY: ash's instance is a table of function pointers and a handle, both usable from any thread; the pointer to
// the messages is only read, and what it points to is behind a mutex.
unsafe impl Send for Instance {}
// SAFETY: as above.
unsafe impl Sync for Instance {}

impl Instance {
    fn new(messages: Option<&Messages>) -> Result<Self> {
        // SAFETY: loading the system's Vulkan loader runs its initialisers, which we must trust.
        let entry = unsafe { ash::Entry::load() }.map_err(|error| Error::Device {
            message: format!("there is no Vulkan loader on this machine ({error})"),
            help: Some(INSTALL_DRIVER.into()),
        })?;
        let mut layers = Vec::new();
        let mut extensions = Vec::new();
        if messages.is_some() {
            // SAFETY: plain query.
            let available = unsafe { entry.enumerate_instance_layer_properties() }
                .map_err(|error| vulkan_error("listing layers", error))?;
            if !available.iter().any(|layer| layer.layer_name_as_c_str() == Ok(VALIDATION_LAYER)) {
                return Err(Error::Device {
                    message: "validation was asked for, but the Khronos validation layer is not installed"
                        .into(),
                    help: Some("on Debian: `apt-get install vulkan-validationlayers`".into()),
                });
            }
            layers.push(VALIDATION_LAYER.as_ptr());
            extensions.push(ash::ext::debug_utils::NAME.as_ptr());
            extensions.push(ash::ext::validation_features::NAME.as_ptr());
        }
        let application = vk::ApplicationInfo::default()
            .application_name(c"mesoshell")
            .engine_name(c"mesoshell")
            .api_version(vk::API_VERSION_1_1);
        let user_data = messages.map(|messages| Box::into_raw(Box::new(messages.clone())));
        let mut messenger_info = vk::DebugUtilsMessengerCreateInfoEXT::default()
            .message_severity(
                vk::DebugUtilsMessageSeverityFlagsEXT::WARNING | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR,
            )
            .message_type(
                vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION
                    | vk::DebugUtilsMessageTypeFlagsEXT::PERFORMANCE,
            )
            .pfn_user_callback(Some(hear))
            .user_data(user_data.map_or(std::ptr::null_mut(), <*mut Messages>::cast));
        let enabled = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&enabled);
        let mut info = vk::InstanceCreateInfo::default()
            .application_info(&application)
            .enabled_layer_names(&layers)
            .enabled_extension_names(&extensions);
        if messages.is_some() {
            info = info.push_next(&mut features).push_next(&mut messenger_info);
        }
        // SAFETY: `info` and what it points to live through the call.
        let created = unsafe { entry.create_instance(&info, None) };
        let raw = created.map_err(|error| {
            if let Some(user_data) = user_data {
                // SAFETY: made by Box::into_raw above; no instance exists that could use it.
                drop(unsafe { Box::from_raw(user_data) });
            }
            match error {
                vk::Result::ERROR_INCOMPATIBLE_DRIVER => Error::Device {
                    message: "there is no Vulkan driver on this machine".into(),
                    help: Some(INSTALL_DRIVER.into()),
                },
                error => vulkan_error("creating the instance", error),
            }
        })?;
        let mut instance = Self { raw, debug: None, messages: user_data, _entry: entry };
        if messages.is_some() {
            let debug = ash::ext::debug_utils::Instance::new(&instance._entry, &instance.raw);
            messenger_info.p_next = std::ptr::null();
            // SAFETY: the extension is enabled; the callback and its data live as long as the instance.
            let messenger = unsafe { debug.create_debug_utils_messenger(&messenger_info, None) }
                .map_err(|error| vulkan_error("listening to the validation layer", error))?;
            instance.debug = Some((debug, messenger));
        }
        Ok(instance)
    }

    /// All devices, with what they say of themselves.
    fn physical_devices(&self) -> Result<Vec<(vk::PhysicalDevice, DeviceInfo)>> {
        // SAFETY: plain query.
        let handles = unsafe { self.raw.enumerate_physical_devices() }
            .map_err(|error| vulkan_error("listing devices", error))?;
        if handles.is_empty() {
            return Err(Error::Device {
                message: "Vulkan knows of no device on this machine".into(),
                help: Some(INSTALL_DRIVER.into()),
            });
        }
        Ok(handles
            .into_iter()
            .enumerate()
            .map(|(index, handle)| (handle, self.describe(index, handle)))
            .collect())
    }

    /// The driver's name and version, where it has `VK_KHR_driver_properties`, as about all of Vulkan 1.2 and later do.
    fn driver(&self, handle: vk::PhysicalDevice) -> Option<String> {
        // SAFETY: plain query on a handle of this instance.
        let extensions = unsafe { self.raw.enumerate_device_extension_properties(handle) }.ok()?;
        let tells = |extension: &vk::ExtensionProperties| {
            extension.extension_name_as_c_str() == Ok(ash::khr::driver_properties::NAME)
        };
        // SAFETY: as above.
        let api_version = unsafe { self.raw.get_physical_device_properties(handle) }.api_version;
        if api_version < vk::API_VERSION_1_1 || !extensions.iter().any(tells) {
            return None;
        }
        let mut driver = vk::PhysicalDeviceDriverProperties::default();
        let mut all = vk::PhysicalDeviceProperties2::default().push_next(&mut driver);
        // SAFETY: the device offers Vulkan 1.1, which has this query, and the extension of the structure.
        unsafe { self.raw.get_physical_device_properties2(handle, &mut all) };
        let parts = [driver.driver_name_as_c_str(), driver.driver_info_as_c_str()];
        let parts = parts.map(|part| part.unwrap_or_default().to_string_lossy());
        let told: Vec<&str> = parts.iter().map(|part| part.trim()).filter(|part| !part.is_empty()).collect();
        (!told.is_empty()).then(|| told.join(" "))
    }

    fn describe(&self, index: usize, handle: vk::PhysicalDevice) -> DeviceInfo {
        // SAFETY: plain queries on a handle of this instance.
        let (properties, memory) = unsafe {
            (
                self.raw.get_physical_device_properties(handle),
                self.raw.get_physical_device_memory_properties(handle),
            )
        };
        let mut id = vk::PhysicalDeviceIDProperties::default();
        if properties.api_version >= vk::API_VERSION_1_1 {
            let mut all = vk::PhysicalDeviceProperties2::default().push_next(&mut id);
            // SAFETY: the device offers Vulkan 1.1, which has this query and this structure.
            unsafe { self.raw.get_physical_device_properties2(handle, &mut all) };
        }
        let driver = self.driver(handle);
        let hex = |bytes: &[u8]| bytes.iter().map(|byte| format!("{byte:02x}")).collect::<String>();
        let uuid = id.device_uuid;
        let version = |version| {
            format!(
                "{}.{}.{}",
                vk::api_version_major(version),
                vk::api_version_minor(version),
                vk::api_version_patch(version)
            )
        };
        DeviceInfo {
            index,
            name: properties.device_name_as_c_str().unwrap_or(c"unnamed").to_string_lossy().into_owned(),
            uuid: [&uuid[0..4], &uuid[4..6], &uuid[6..8], &uuid[8..10], &uuid[10..16]].map(hex).join("-"),
            kind: match properties.device_type {
                vk::PhysicalDeviceType::DISCRETE_GPU => "discrete",
                vk::PhysicalDeviceType::INTEGRATED_GPU => "integrated",
                vk::PhysicalDeviceType::VIRTUAL_GPU => "virtual",
                vk::PhysicalDeviceType::CPU => "cpu",
                _ => "other",
            }
            .to_owned(),
            driver: driver.unwrap_or_else(|| version(properties.driver_version)),
            api_version: version(properties.api_version),
            memory_bytes: memory
                .memory_heaps_as_slice()
                .iter()
                .filter(|heap| heap.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL))
                .map(|heap| heap.size)
                .max()
                .unwrap_or(0),
            max_image_3d: properties.limits.max_image_dimension3_d,
            max_image_2d: properties.limits.max_image_dimension2_d,
        }
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        // SAFETY: the device, if there was one, is gone (`Gpu` drops it first); the callback's data is freed last.
        unsafe {
            if let Some((debug, messenger)) = &self.debug {
                debug.destroy_debug_utils_messenger(*messenger, None);
            }
            self.raw.destroy_instance(None);
            if let Some(messages) = self.messages {
                drop(Box::from_raw(messages));
            }
        }
    }
}

/// Hears a message of the validation layer.
///
/// # Safety
/// Called by Vulkan only, with the user data given at creation: a live `Messages`.
unsafe extern "system" fn hear(
    _severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _types: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user_data: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: Vulkan passes a valid structure, and the user data that we gave it.
    let (data, messages) = unsafe { (&*data, &*user_data.cast::<Messages>()) };
    // SAFETY: a message is a C string that lives through this call, or null.
    if let Some(text) = unsafe { data.message_as_c_str() } {
        messages.push(text.to_string_lossy().into_owned());
    }
    vk::FALSE
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

    /// Refuses a picture or a volume that the device could not hold, of so many pixels or texels a side. What is asked here is
    /// asked again when they are made; this is for asking before the volume is computed.
    ///
    /// # Errors
    /// [`Error::Device`] where a side is too long, [`Error::OutOfMemory`].
    pub fn check_sizes(&self, picture: [u32; 2], volume: [u32; 3]) -> Result<()> {
        Target::check(self, picture[0], picture[1], 1)?;
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
