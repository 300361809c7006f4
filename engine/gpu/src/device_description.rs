//! Devices as they describe themselves, and what the engine needs that they lack.

use std::ffi::CStr;

use ash::vk;
use serde::Serialize;

use super::features::{self, API};
use super::heap::{Heap, HeapKind, heaps};

/// One Vulkan device as it describes itself.
#[derive(Clone, Debug, Serialize)]
pub struct DeviceDescription {
    /// Index in the list of devices.
    pub index: usize,
    /// Name, such as "llvmpipe (LLVM 19.1.7, 256 bits)".
    pub name: String,
    /// "discrete GPU", "integrated GPU", "virtual GPU", "CPU" or "other".
    pub kind: &'static str,
    /// Driver name and version text.
    pub driver: String,
    /// Vulkan version of the device, "1.3.255".
    pub api: String,
    /// Bytes of all heaps that are near to the device.
    pub memory_bytes: u64,
    /// All heaps.
    pub heaps: Vec<Heap>,
    /// Number of invocations that run in lockstep; informative, nothing assumes it.
    pub subgroup_size: u32,
    /// Largest storage-buffer binding, bytes.
    pub max_storage_range: u64,
    /// Names of what the engine needs and this device lacks; empty if the device can be used.
    pub missing: Vec<String>,
}

/// Describes a device and what it lacks.
fn describe(instance: &ash::Instance, index: usize, physical: vk::PhysicalDevice) -> DeviceDescription {
    // SAFETY: queries on a physical device of this instance; the chained structs live until the calls return.
    let (properties, driver, subgroup) = unsafe {
        let mut driver = vk::PhysicalDeviceDriverProperties::default();
        let mut subgroup = vk::PhysicalDeviceSubgroupProperties::default();
        let mut two = vk::PhysicalDeviceProperties2::default();
        // The chain is only valid on 1.2 and newer; older devices are listed with the information of 1.0.
        if instance.get_physical_device_properties(physical).api_version >= vk::API_VERSION_1_2 {
            two = two.push_next(&mut driver).push_next(&mut subgroup);
        }
        instance.get_physical_device_properties2(physical, &mut two);
        let properties = two.properties;
        (properties, driver, subgroup)
    };
    let mut missing = if properties.api_version < API {
        vec!["Vulkan 1.3".to_owned()]
    } else {
        features::missing(instance, physical)
    };
    let operations = vk::SubgroupFeatureFlags::VOTE | vk::SubgroupFeatureFlags::ARITHMETIC;
    if !subgroup.supported_operations.contains(operations) {
        missing.push("subgroup vote and arithmetic".to_owned());
    }
    if queue_family(instance, physical).is_none() {
        missing.push("a queue for compute and graphics".to_owned());
    }
    let text = |c: std::result::Result<&CStr, _>| -> String {
        c.map(|c: &CStr| c.to_string_lossy().into_owned())
            .unwrap_or_else(|_: std::ffi::FromBytesUntilNulError| String::new())
    };
    let v = properties.api_version;
    let heaps = heaps(instance, physical, offers(instance, physical, ash::ext::memory_budget::NAME));
    DeviceDescription {
        index,
        name: text(properties.device_name_as_c_str()),
        kind: match properties.device_type {
            vk::PhysicalDeviceType::DISCRETE_GPU => "discrete GPU",
            vk::PhysicalDeviceType::INTEGRATED_GPU => "integrated GPU",
            vk::PhysicalDeviceType::VIRTUAL_GPU => "virtual GPU",
            vk::PhysicalDeviceType::CPU => "CPU",
            _ => "other",
        },
        driver: format!("{} {}", text(driver.driver_name_as_c_str()), text(driver.driver_info_as_c_str()))
            .trim()
            .to_owned(),
        api: format!(
            "{}.{}.{}",
            vk::api_version_major(v),
            vk::api_version_minor(v),
            vk::api_version_patch(v)
        ),
        memory_bytes: heaps.iter().filter(|heap| heap.kind != HeapKind::Host).map(|heap| heap.bytes).sum(),
        heaps,
        subgroup_size: subgroup.subgroup_size,
        max_storage_range: u64::from(properties.limits.max_storage_buffer_range),
        missing,
    }
}

/// Returns true if a device has an extension.
pub(super) fn offers(instance: &ash::Instance, physical: vk::PhysicalDevice, extension: &CStr) -> bool {
    // SAFETY: plain enumeration.
    let offered = unsafe { instance.enumerate_device_extension_properties(physical) }.unwrap_or_default();
    offered.iter().any(|e| e.extension_name_as_c_str() == Ok(extension))
}

/// Finds a queue family that has both compute and graphics: the fit and the renderer share one queue.
pub(super) fn queue_family(instance: &ash::Instance, physical: vk::PhysicalDevice) -> Option<u32> {
    // SAFETY: plain query.
    let families = unsafe { instance.get_physical_device_queue_family_properties(physical) };
    let wanted = vk::QueueFlags::COMPUTE | vk::QueueFlags::GRAPHICS;
    families.iter().position(|f| f.queue_flags.contains(wanted)).and_then(|i| u32::try_from(i).ok())
}

/// Describes these devices of an instance.
pub(super) fn describe_all(
    instance: &ash::Instance,
    physicals: &[vk::PhysicalDevice],
) -> Vec<DeviceDescription> {
    physicals.iter().enumerate().map(|(i, &p)| describe(instance, i, p)).collect()
}
