//! The Vulkan instance, with its loader and its message catcher.

use std::ffi::{CStr, c_void};

use ash::vk;

use super::features::API;
use super::{Boot, GpuOptions, MessageLog, check};
use base::error::{Error, Kind, Result};

const VALIDATION: &CStr = c"VK_LAYER_KHRONOS_validation";

/// The instance with its loader and message catcher; dropped after the device was destroyed.
pub(super) struct Instance {
    pub(super) entry: ash::Entry,
    pub(super) handle: ash::Instance,
    messenger: Option<(ash::ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    messages: Box<MessageLog>,
}

impl Instance {
    /// Creates the instance; with the validation layer and for windows if the options ask for them.
    pub(super) fn new(boot: &dyn Boot, options: &GpuOptions) -> Result<Self> {
        let validation = options.validation;
        // SAFETY: loading the Vulkan loader runs its initialisers; it is the system's own library.
        let entry = unsafe { ash::Entry::load() }.map_err(|e| {
            Error::new(Kind::Unavailable, "VGS-GPU-001", format!("no Vulkan loader: {e}"))
                .help(super::boot::INSTALL)
        })?;
        // SAFETY: plain enumeration.
        let layers = unsafe { entry.enumerate_instance_layer_properties() }.unwrap_or_default();
        if validation && !layers.iter().any(|l| l.layer_name_as_c_str() == Ok(VALIDATION)) {
            return Err(Error::new(
                Kind::Unavailable,
                "VGS-GPU-003",
                "the validation layer VK_LAYER_KHRONOS_validation is not installed",
            )
            .help("`tools/setup test` installs it"));
        }
        let layer_names: Vec<_> = validation.then_some(VALIDATION.as_ptr()).into_iter().collect();
        // SAFETY: plain enumeration.
        let offered = unsafe { entry.enumerate_instance_extension_properties(None) }.unwrap_or_default();
        let debug = validation
            || offered.iter().any(|e| e.extension_name_as_c_str() == Ok(ash::ext::debug_utils::NAME));
        let mut extensions: Vec<_> =
            debug.then_some(ash::ext::debug_utils::NAME.as_ptr()).into_iter().collect();
        extensions.extend(options.windows.iter().flat_map(|windows| windows.0));

        let app =
            vk::ApplicationInfo::default().application_name(c"vgs").engine_name(c"vgs").api_version(API);
        let messages = Box::new(options.messages.clone());
        let mut messenger_info = vk::DebugUtilsMessengerCreateInfoEXT::default()
            .message_severity(
                vk::DebugUtilsMessageSeverityFlagsEXT::ERROR | vk::DebugUtilsMessageSeverityFlagsEXT::WARNING,
            )
            .message_type(
                vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION
                    | vk::DebugUtilsMessageTypeFlagsEXT::PERFORMANCE,
            )
            .pfn_user_callback(Some(on_message))
            .user_data(std::ptr::from_ref::<MessageLog>(&messages) as *mut c_void);
        let enables = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&enables);
        let mut info = vk::InstanceCreateInfo::default()
            .application_info(&app)
            .enabled_layer_names(&layer_names)
            .enabled_extension_names(&extensions);
        if validation {
            info = info.push_next(&mut features).push_next(&mut messenger_info);
        }
        let handle = boot.create_instance(&entry, &info)?;
        // From here on `Drop` cleans up.
        let mut instance = Instance { entry, handle, messenger: None, messages };
        if validation {
            let utils = ash::ext::debug_utils::Instance::new(&instance.entry, &instance.handle);
            messenger_info.p_next = std::ptr::null();
            // SAFETY: the messages are boxed and outlive the messenger, which `Drop` removes first.
            let made = unsafe { utils.create_debug_utils_messenger(&messenger_info, None) };
            instance.messenger = Some((utils, check("creating the message catcher", made)?));
        }
        Ok(instance)
    }

    /// Returns true if messages are caught, that is, if the validation layer is on.
    pub(super) fn has_messenger(&self) -> bool {
        self.messenger.is_some()
    }

    /// Returns the messages caught so far.
    pub(super) fn messages(&self) -> Vec<String> {
        self.messages.all()
    }

    /// Lists the devices, in Vulkan's order.
    pub(super) fn physical_devices(&self) -> Result<Vec<vk::PhysicalDevice>> {
        // SAFETY: plain enumeration on a live instance.
        check("listing Vulkan devices", unsafe { self.handle.enumerate_physical_devices() })
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        // SAFETY: whoever created a device from the instance has destroyed it before: `Context` does so in
        // its own `Drop`.
        unsafe {
            if let Some((utils, messenger)) = &self.messenger {
                utils.destroy_debug_utils_messenger(*messenger, None);
            }
            self.handle.destroy_instance(None);
        }
    }
}

/// Receives a message of the validation layers.
unsafe extern "system" fn on_message(
    _: vk::DebugUtilsMessageSeverityFlagsEXT,
    _: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the layer passes valid callback data, and `user` is the boxed message list of a live instance.
    let (text, messages) = unsafe {
        let text = (*data).message_as_c_str().map(|t| t.to_string_lossy().into_owned()).unwrap_or_default();
        (text, &*user.cast::<MessageLog>())
    };
    messages.push(text);
    vk::FALSE
}
