//! The Vulkan instance: what devices there are, and what the validation layers say.

use std::ffi::{CStr, c_void};
use std::sync::{Arc, Mutex, PoisonError};

use ash::vk;
use serde::Serialize;

use super::device::vulkan_error;
use crate::{Error, Result};

const VALIDATION_LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";
const INSTALL_DRIVER: &str = "install a Vulkan driver; without a GPU, Mesa's software driver serves: \
    on Debian, `apt-get install mesa-vulkan-drivers libvulkan1`";

/// What a device says of itself.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct DeviceInfo {
    /// For [`DeviceChoice::Index`](super::DeviceChoice::Index).
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

/// The library, its layers and its ear for them.
pub(super) struct Instance {
    pub(super) raw: ash::Instance,
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
    pub(super) fn new(messages: Option<&Messages>) -> Result<Self> {
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
    pub(super) fn physical_devices(&self) -> Result<Vec<(vk::PhysicalDevice, DeviceInfo)>> {
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
