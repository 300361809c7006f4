//! The context of a device: created once, shared by every handle, destroyed with the last one.

use std::ffi::CString;
use std::sync::atomic::AtomicU64;
use std::sync::{Mutex, MutexGuard};

use ash::vk;

use super::instance::Instance;
use super::memory::Memory;
use super::pipeline::Pipelines;
use super::submissions::Submissions;
use super::timing::Times;
use super::{DeviceDescription, GpuOptions, Limits, check, pipeline_cache};
use crate::error::Result;

/// Everything that lives as long as the device. `Drop` destroys by hand, in order; the instance goes last.
pub(super) struct Context {
    pub(super) instance: Instance,
    pub(super) physical: vk::PhysicalDevice,
    pub(super) description: DeviceDescription,
    pub(super) limits: Limits,
    pub(super) device: ash::Device,
    pub(super) push_descriptor: ash::khr::push_descriptor::Device,
    pub(super) debug_utils: Option<ash::ext::debug_utils::Device>,
    pub(super) queue_family: u32,
    pub(super) timeline: vk::Semaphore,
    pub(super) pipeline_cache: vk::PipelineCache,
    /// The one sampler of the engine: linear, clamped to the edge.
    pub(super) sampler: vk::Sampler,
    pub(super) queue: Mutex<Submissions>,
    pub(super) memory: Mutex<Memory>,
    pub(super) times: Mutex<Times>,
    pub(super) counters: Counters,
    pub(super) pipelines: Mutex<Pipelines>,
}

/// The numbers behind [`super::Hitches`].
#[derive(Default)]
pub(super) struct Counters {
    pub(super) allocations: AtomicU64,
    pub(super) pipelines: AtomicU64,
    pub(super) waits: AtomicU64,
}

/// Locks a mutex, poisoned or not. A poisoned one means that another thread panicked while holding it; its
/// data are counters and handles that stay valid, so going on is right.
pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

/// Turns a name into a `CString`; a name with a NUL inside loses what follows it.
pub(super) fn c_name(name: &str) -> CString {
    CString::new(name.split('\0').next().unwrap_or_default()).unwrap_or_default()
}

impl Context {
    /// Takes over a device that was just created, and creates everything that belongs to it.
    pub(super) fn new(
        instance: Instance,
        physical: vk::PhysicalDevice,
        device: ash::Device,
        queue_family: u32,
        description: DeviceDescription,
        options: &GpuOptions,
    ) -> Result<Self> {
        let handle = instance.handle.clone();
        // SAFETY: plain query on a live device; the family was asked for when the device was made.
        let queue = unsafe { device.get_device_queue(queue_family, 0) };
        let mut context = Context {
            limits: limits(&handle, physical, queue_family, options.storage_range_limit),
            push_descriptor: ash::khr::push_descriptor::Device::new(&handle, &device),
            debug_utils: instance
                .has_messenger()
                .then(|| ash::ext::debug_utils::Device::new(&handle, &device)),
            instance,
            physical,
            description,
            device,
            queue_family,
            timeline: vk::Semaphore::null(),
            pipeline_cache: vk::PipelineCache::null(),
            sampler: vk::Sampler::null(),
            queue: Mutex::new(Submissions::new(queue, options.lost_at)),
            memory: Mutex::default(),
            times: Mutex::default(),
            counters: Counters::default(),
            pipelines: Mutex::default(),
        };
        // From here on `Drop` cleans up: destroying a null handle is allowed.
        let device = &context.device;
        let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
        let semaphore_info = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
        // SAFETY: the device is live and has the timeline feature on.
        context.timeline =
            check("creating the timeline", unsafe { device.create_semaphore(&semaphore_info, None) })?;
        context.pipeline_cache = pipeline_cache::load(device, &context.description)?;
        let edge = vk::SamplerAddressMode::CLAMP_TO_EDGE;
        let sampler_info = vk::SamplerCreateInfo::default()
            .mag_filter(vk::Filter::LINEAR)
            .min_filter(vk::Filter::LINEAR)
            .address_mode_u(edge)
            .address_mode_v(edge)
            .address_mode_w(edge);
        // SAFETY: the device is live.
        context.sampler =
            check("creating the sampler", unsafe { device.create_sampler(&sampler_info, None) })?;
        context.memory = Mutex::new(Memory::new(handle, physical, device.clone())?);
        Ok(context)
    }

    /// Gives a handle a name, for debuggers and for messages of the validation layers.
    pub(super) fn name<H: vk::Handle>(&self, handle: H, name: &str) {
        if let Some(debug) = &self.debug_utils {
            let name = c_name(name);
            let info = vk::DebugUtilsObjectNameInfoEXT::default().object_handle(handle).object_name(&name);
            // SAFETY: `handle` is a live object of this device. A failure to name costs nothing but the name.
            let _ = unsafe { debug.set_debug_utils_object_name(&info) };
        }
    }
}

/// Asks for the limits of a device and of a family of its queues.
fn limits(
    instance: &ash::Instance,
    physical: vk::PhysicalDevice,
    queue_family: u32,
    range_limit: Option<u64>,
) -> Limits {
    // SAFETY: plain queries.
    let (properties, families) = unsafe {
        (
            instance.get_physical_device_properties(physical),
            instance.get_physical_device_queue_family_properties(physical),
        )
    };
    let range = u64::from(properties.limits.max_storage_buffer_range);
    let has_timestamps = families.get(queue_family as usize).is_some_and(|f| f.timestamp_valid_bits > 0);
    Limits {
        storage_range: range_limit.map_or(range, |limit| limit.min(range)),
        timestamp_period: if has_timestamps { properties.limits.timestamp_period } else { 0.0 },
        workgroups: properties.limits.max_compute_work_group_count[0],
        volume_edge: properties.limits.max_image_dimension3_d,
        picture_edge: properties.limits.max_image_dimension2_d,
        filters_fractions: [vk::Format::R16_UNORM, vk::Format::R16G16_UNORM].iter().all(|&format| {
            // SAFETY: plain query.
            let found = unsafe { instance.get_physical_device_format_properties(physical, format) };
            found.optimal_tiling_features.contains(vk::FormatFeatureFlags::SAMPLED_IMAGE_FILTER_LINEAR)
        }),
    }
}

impl Drop for Context {
    fn drop(&mut self) {
        // SAFETY: the last handle to the context is gone, so nobody records or submits any more.
        unsafe {
            let _ = self.device.device_wait_idle();
            lock(&self.queue).destroy(&self.device);
            lock(&self.memory).destroy(&self.device);
            lock(&self.pipelines).destroy(&self.device);
            pipeline_cache::save(&self.device, self.pipeline_cache, &self.description);
            self.device.destroy_pipeline_cache(self.pipeline_cache, None);
            self.device.destroy_sampler(self.sampler, None);
            self.device.destroy_semaphore(self.timeline, None);
            self.device.destroy_device(None);
        }
    }
}
