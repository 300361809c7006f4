//! The version and features of Vulkan that the engine needs: the check for them, and how they are
//! turned on.

use ash::vk;

/// The version of Vulkan that is asked for.
pub(super) const API: u32 = vk::API_VERSION_1_3;

/// Returns the names of the needed features that a device of version 1.3 lacks.
pub(super) fn missing(instance: &ash::Instance, physical: vk::PhysicalDevice) -> Vec<String> {
    let mut v11 = vk::PhysicalDeviceVulkan11Features::default();
    let mut v12 = vk::PhysicalDeviceVulkan12Features::default();
    let mut v13 = vk::PhysicalDeviceVulkan13Features::default();
    let mut features =
        vk::PhysicalDeviceFeatures2::default().push_next(&mut v11).push_next(&mut v12).push_next(&mut v13);
    // SAFETY: a query on a physical device of this instance; the chained structs live until it returns.
    unsafe { instance.get_physical_device_features2(physical, &mut features) };
    let without_format = features.features.shader_storage_image_write_without_format;
    [
        ("feature multiview", v11.multiview),
        ("feature shaderStorageImageWriteWithoutFormat", without_format),
        ("feature dynamicRendering", v13.dynamic_rendering),
        ("feature timelineSemaphore", v12.timeline_semaphore),
        ("feature scalarBlockLayout", v12.scalar_block_layout),
        ("feature synchronization2", v13.synchronization2),
        ("feature maintenance4", v13.maintenance4),
    ]
    .into_iter()
    .filter(|(_, there)| *there == vk::FALSE)
    .map(|(name, _)| name.to_owned())
    .collect()
}

/// The structs that turn features on. They are single ones, not `Vulkan12Features`: an OpenXR runtime may
/// chain its own timeline struct.
pub(super) struct Features<'a> {
    basic: vk::PhysicalDeviceFeatures,
    multiview: vk::PhysicalDeviceMultiviewFeatures<'a>,
    timeline: vk::PhysicalDeviceTimelineSemaphoreFeatures<'a>,
    scalar: vk::PhysicalDeviceScalarBlockLayoutFeatures<'a>,
    v13: vk::PhysicalDeviceVulkan13Features<'a>,
}

impl<'a> Features<'a> {
    /// Returns the features of [`missing`], all turned on.
    pub(super) fn needed() -> Self {
        Features {
            basic: vk::PhysicalDeviceFeatures::default().shader_storage_image_write_without_format(true),
            multiview: vk::PhysicalDeviceMultiviewFeatures::default().multiview(true),
            timeline: vk::PhysicalDeviceTimelineSemaphoreFeatures::default().timeline_semaphore(true),
            scalar: vk::PhysicalDeviceScalarBlockLayoutFeatures::default().scalar_block_layout(true),
            v13: vk::PhysicalDeviceVulkan13Features::default()
                .synchronization2(true)
                .maintenance4(true)
                .dynamic_rendering(true),
        }
    }

    /// Chains the structs to the create-info of a device.
    pub(super) fn chain(&'a mut self, info: vk::DeviceCreateInfo<'a>) -> vk::DeviceCreateInfo<'a> {
        info.enabled_features(&self.basic)
            .push_next(&mut self.multiview)
            .push_next(&mut self.timeline)
            .push_next(&mut self.scalar)
            .push_next(&mut self.v13)
    }
}
