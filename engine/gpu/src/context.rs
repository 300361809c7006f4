//! The context of a device: created once, shared by every handle, destroyed with the last one.

use std::collections::BTreeSet;
use std::sync::Mutex;
use std::sync::atomic::Ordering;

use ash::vk;

#[cfg(feature = "fault")]
use super::Fault;
use super::c_name::c_name;
use super::device_description::offers;
use super::hitches::Counters;
use super::instance::Instance;
use super::memory::Memory;
use super::pipeline::{Pipeline, Pipelines};
use super::pipeline_creation::Builder;
use super::submissions::Submissions;
use super::times::Times;
use super::{DeviceDescription, GpuOptions, Limits, Recipe, check, lock, pipeline_cache};
use base::error::Result;

/// Everything that lives as long as the device. `Drop` destroys by hand, in order; the instance goes last.
pub(super) struct Context {
    pub(super) instance: Instance,
    pub(super) physical: vk::PhysicalDevice,
    pub(super) description: DeviceDescription,
    pub(super) limits: Limits,
    /// True if the device tells how much memory is free.
    pub(super) tells_budget: bool,
    /// See [`GpuOptions::free_limit`].
    pub(super) free_limit: Option<u64>,
    /// True if each buffer and image has memory of its own, so that a fault meets each of them.
    pub(super) alone: bool,
    pub(super) device: ash::Device,
    /// How descriptors are pushed; absent where sets from pools are bound.
    pub(super) push_descriptor: Option<ash::khr::push_descriptor::Device>,
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
    /// Recipes of all pipelines that were created.
    pub(super) recipes: Mutex<BTreeSet<Recipe>>,
}

impl Context {
    /// Takes over a device that was just created, and creates everything that belongs to it.
    pub(super) fn new(
        instance: Instance,
        physical: vk::PhysicalDevice,
        device: ash::Device,
        queue_family: u32,
        description: DeviceDescription,
        pushes: bool,
        options: &GpuOptions,
    ) -> Result<Self> {
        let handle = instance.handle.clone();
        // SAFETY: plain query on a live device; the family was asked for when the device was made.
        let queue = unsafe { device.get_device_queue(queue_family, 0) };
        let mut context = Context {
            limits: Limits::of(&handle, physical, queue_family, options.storage_range_limit),
            push_descriptor: pushes.then(|| ash::khr::push_descriptor::Device::new(&handle, &device)),
            debug_utils: instance
                .has_messenger()
                .then(|| ash::ext::debug_utils::Device::new(&handle, &device)),
            tells_budget: offers(&handle, physical, ash::ext::memory_budget::NAME),
            free_limit: options.free_limit,
            #[cfg(feature = "fault")]
            alone: Fault::in_force(options.fault.as_ref())?.is_some_and(Fault::meets_memory),
            #[cfg(not(feature = "fault"))]
            alone: false,
            instance,
            physical,
            description,
            device,
            queue_family,
            timeline: vk::Semaphore::null(),
            pipeline_cache: vk::PipelineCache::null(),
            sampler: vk::Sampler::null(),
            queue: Mutex::new(Submissions::new(queue)),
            memory: Mutex::default(),
            times: Mutex::default(),
            counters: Counters::default(),
            pipelines: Mutex::default(),
            recipes: Mutex::default(),
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

    /// Returns where pipelines for this device are built.
    pub(super) fn builder(&self) -> Builder<'_> {
        Builder {
            device: &self.device,
            cache: self.pipeline_cache,
            flags: vk::PipelineCreateFlags::empty(),
            pushes: self.push_descriptor.is_some(),
        }
    }

    /// Counts a pipeline that was just built, names it and keeps its recipe.
    pub(super) fn made(&self, pipeline: Pipeline, recipe: Recipe) {
        self.counters.pipelines.fetch_add(1, Ordering::Relaxed);
        self.name(pipeline.handle, &recipe.shaders[0]);
        lock(&self.recipes).insert(recipe);
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
