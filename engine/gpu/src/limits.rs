//! The limits of a device.

use ash::vk;

/// Limits that the engine plans with, as the device reported them.
#[derive(Clone, Debug)]
pub struct Limits {
    /// Largest range of one storage-buffer binding, bytes. [`super::GpuOptions::storage_range_limit`] lowers
    /// it for tests.
    pub storage_range: u64,
    /// Nanoseconds per timestamp tick; 0 if the queue has no timestamps.
    pub timestamp_period: f32,
    /// Greatest number of workgroups along x in one dispatch.
    pub workgroups: u32,
    /// Greatest number of texels along an axis of a volume.
    pub volume_edge: u32,
    /// Greatest number of pixels along an axis of a picture.
    pub picture_edge: u32,
    /// True if volumes of 16-bit fractions can be sampled with interpolation.
    pub filters_fractions: bool,
    /// True if the invocations of a subgroup can work together in fragment shaders, too.
    pub fragment_subgroups: bool,
}

impl Limits {
    /// Asks for the limits of a device and of a family of its queues.
    pub(super) fn of(
        instance: &ash::Instance,
        physical: vk::PhysicalDevice,
        queue_family: u32,
        range_limit: Option<u64>,
    ) -> Self {
        let mut subgroup = vk::PhysicalDeviceSubgroupProperties::default();
        let mut two = vk::PhysicalDeviceProperties2::default().push_next(&mut subgroup);
        // SAFETY: plain queries; the chained struct lives until the first one returns.
        let families = unsafe {
            instance.get_physical_device_properties2(physical, &mut two);
            instance.get_physical_device_queue_family_properties(physical)
        };
        let properties = two.properties;
        let range = u64::from(properties.limits.max_storage_buffer_range);
        let has_timestamps = families.get(queue_family as usize).is_some_and(|f| f.timestamp_valid_bits > 0);
        Limits {
            storage_range: range_limit.map_or(range, |limit| limit.min(range)),
            timestamp_period: if has_timestamps { properties.limits.timestamp_period } else { 0.0 },
            workgroups: properties.limits.max_compute_work_group_count[0],
            volume_edge: properties.limits.max_image_dimension3_d,
            picture_edge: properties.limits.max_image_dimension2_d,
            fragment_subgroups: subgroup.supported_stages.contains(vk::ShaderStageFlags::FRAGMENT),
            filters_fractions: [vk::Format::R16_UNORM, vk::Format::R16G16_UNORM].iter().all(|&format| {
                // SAFETY: plain query.
                let found = unsafe { instance.get_physical_device_format_properties(physical, format) };
                found.optimal_tiling_features.contains(vk::FormatFeatureFlags::SAMPLED_IMAGE_FILTER_LINEAR)
            }),
        }
    }
}
