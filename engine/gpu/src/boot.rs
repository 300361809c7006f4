//! The trait of those who create instance and device, and the engine itself as one of them.

use ash::vk;

use super::check;
use base::error::{Error, Kind, Result};

/// What to do where there is no driver.
pub(super) const INSTALL: &str = "install the Vulkan driver of the GPU, or a software one (Debian, Ubuntu: apt install \
                                  libvulkan1 mesa-vulkan-drivers); in a checkout of vgs, tools/setup brings one";

/// A creator of the instance and the device: the engine itself, or a runtime such as OpenXR that insists on
/// it.
pub trait Boot {
    /// Creates the Vulkan instance from the engine's create-info.
    fn create_instance(&self, entry: &ash::Entry, info: &vk::InstanceCreateInfo<'_>)
    -> Result<ash::Instance>;
    /// Returns the only device that the runtime allows, if it insists on one.
    fn required_device(&self, instance: &ash::Instance) -> Result<Option<vk::PhysicalDevice>>;
    /// Creates the device from the engine's create-info.
    fn create_device(
        &self,
        instance: &ash::Instance,
        physical: vk::PhysicalDevice,
        info: &vk::DeviceCreateInfo<'_>,
    ) -> Result<ash::Device>;
}

/// The engine itself as creator of instance and device.
pub(super) struct Own;

impl Boot for Own {
    fn create_instance(
        &self,
        entry: &ash::Entry,
        info: &vk::InstanceCreateInfo<'_>,
    ) -> Result<ash::Instance> {
        // SAFETY: `info` and all it points to live until the call returns.
        let instance = unsafe { entry.create_instance(info, None) };
        instance.map_err(|e| {
            Error::new(Kind::Unavailable, "VGS-GPU-002", format!("Vulkan refused an instance: {e}"))
                .help(INSTALL)
        })
    }

    fn required_device(&self, _: &ash::Instance) -> Result<Option<vk::PhysicalDevice>> {
        Ok(None)
    }

    fn create_device(
        &self,
        instance: &ash::Instance,
        physical: vk::PhysicalDevice,
        info: &vk::DeviceCreateInfo<'_>,
    ) -> Result<ash::Device> {
        // SAFETY: `physical` comes from `instance`; the extensions and features were checked to exist.
        check("creating the device", unsafe { instance.create_device(physical, info, None) })
    }
}
