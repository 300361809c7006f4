//! The Vulkan layer: device, memory, kernels, recorded passes. Knows Vulkan, never medicine.
//!
//! A program boots one [`Gpu`], allocates [`Buffer`]s from it (each with a name and a purpose), makes [`Kernel`]s
//! from compiled shaders and records passes with a [`Recorder`]. Barriers follow from the declared reads and
//! writes; nobody outside this folder writes one. Handles keep the device alive; a dropped buffer waits in the
//! graveyard until the device has passed the last submission that may use it.
//!
//! This is the one module of the engine with `unsafe` code. Three facts hold for all of it and are not repeated
//! at every call: handles passed to the device were created by it and are destroyed only after
//! it has finished with them (graveyard, or `device_wait_idle` at the end); create-info structs point to locals
//! that outlive the call; the queue, the allocator and the recorder slots are reached through one mutex each.
#![allow(unsafe_code, reason = "calls into Vulkan; see the module text for the rules that hold throughout")]

mod boot;
mod draw;
mod image;
mod kernel;
mod memory;
mod recorder;
mod submissions;
mod surface;
mod timing;

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};

use ash::vk;

use crate::error::{Error, Kind, Result};

pub use boot::{Boot, DeviceDescription, GpuOptions, Windows, devices};
pub use draw::{DrawPass, Drawing};
pub use image::{Format, Image};
pub use kernel::Kernel;
pub use memory::Buffer;
pub use recorder::Recorder;
pub use submissions::Ticket;
pub use surface::{Acquired, Surface};
pub use timing::PassTime;

/// A booted Vulkan device. Cheap to clone; all clones are the same device.
#[derive(Clone)]
pub struct Gpu(Arc<Context>);

/// What the device reported about itself, and the limits that this engine plans with.
#[derive(Clone, Debug)]
pub struct Limits {
    /// Largest range one storage-buffer binding may have, bytes. [`GpuOptions::storage_range_limit`] lowers it for
    /// tests.
    pub storage_range: u64,
    /// Nanoseconds per timestamp tick; 0 when the queue has no timestamps.
    pub timestamp_period: f32,
    /// Most workgroups along x in one dispatch.
    pub workgroups: u32,
    /// Most texels along an axis of a volume.
    pub volume_edge: u32,
    /// Most pixels along an axis of a picture.
    pub picture_edge: u32,
    /// Whether volumes of 16-bit fractions can be sampled with interpolation.
    pub filters_fractions: bool,
}

/// How often something was done that a frame loop must not do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Hitches {
    /// Allocations of device memory for a buffer or an image.
    pub allocations: u64,
    /// Pipelines that were made.
    pub pipelines: u64,
    /// Waits of the host for the device.
    pub waits: u64,
}

#[derive(Default)]
struct Counters {
    allocations: AtomicU64,
    pipelines: AtomicU64,
    waits: AtomicU64,
}

/// Everything that lives as long as the device. Field order is irrelevant: `Drop` destroys by hand, in order.
struct Context {
    instance: boot::Instance,
    physical: vk::PhysicalDevice,
    description: DeviceDescription,
    limits: Limits,
    device: ash::Device,
    push_descriptor: ash::khr::push_descriptor::Device,
    debug_utils: Option<ash::ext::debug_utils::Device>,
    queue_family: u32,
    timeline: vk::Semaphore,
    pipeline_cache: vk::PipelineCache,
    /// Linear, clamped to the edge: the one sampler of the engine.
    sampler: vk::Sampler,
    queue: Mutex<submissions::Submissions>,
    memory: Mutex<memory::Memory>,
    times: Mutex<timing::Times>,
    counters: Counters,
    pipelines: Mutex<kernel::Pipelines>,
}

/// A poisoned mutex means that another thread panicked while holding it; its data are counters and handles that
/// stay valid, so going on is right.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

/// Turns a Vulkan result into an error that says what was being done.
fn check<T>(doing: &str, result: ash::prelude::VkResult<T>) -> Result<T> {
    result.map_err(|e| match e {
        vk::Result::ERROR_OUT_OF_DEVICE_MEMORY => {
            Error::new(Kind::Temporary, "VGS-GPU-010", format!("{doing}: out of device memory"))
                .help("close other programs that use the GPU, use fewer splats or a smaller ROI")
        }
        vk::Result::ERROR_OUT_OF_HOST_MEMORY => {
            Error::new(Kind::HostMemory, "VGS-GPU-011", format!("{doing}: out of host memory"))
        }
        vk::Result::ERROR_DEVICE_LOST => {
            Error::new(Kind::Temporary, "VGS-GPU-012", format!("{doing}: the device was lost"))
                .help("run it again; if it happens again, update the driver or choose another --device")
        }
        e => Error::new(Kind::Internal, "VGS-GPU-013", format!("{doing}: Vulkan said {e}")),
    })
}

impl Gpu {
    /// Boots an instance and a device of its own. Callers that bring their own (OpenXR) use [`Gpu::with_boot`].
    pub fn new(options: &GpuOptions) -> Result<Self> {
        Self::with_boot(&boot::Own, options)
    }

    /// The device that was chosen: name, driver, kind, features.
    pub fn description(&self) -> &DeviceDescription {
        &self.0.description
    }

    /// Limits that buffers and dispatches are planned with.
    pub fn limits(&self) -> &Limits {
        &self.0.limits
    }

    /// What was done since the start that a frame loop must not do.
    pub fn hitches(&self) -> Hitches {
        let Counters { allocations, pipelines, waits } = &self.0.counters;
        let [allocations, pipelines, waits] =
            [allocations, pipelines, waits].map(|counter| counter.load(Ordering::Relaxed));
        Hitches { allocations, pipelines, waits }
    }

    /// Bytes of device memory in use now, by purpose.
    pub fn memory_by_purpose(&self) -> BTreeMap<&'static str, u64> {
        lock(&self.0.memory).by_purpose.clone()
    }

    /// The most bytes of device memory that were in use at any one time.
    pub fn peak_bytes(&self) -> u64 {
        lock(&self.0.memory).peak
    }

    /// Messages of the validation layers so far (errors and warnings); empty when all is well or no layer is on.
    pub fn validation_messages(&self) -> Vec<String> {
        self.0.instance.messages()
    }

    /// Waits until the device has finished all that was submitted.
    pub fn wait_idle(&self) -> Result<()> {
        let last = lock(&self.0.queue).last_value();
        self.wait(Ticket(last))
    }
}

impl Context {
    fn name<H: vk::Handle>(&self, handle: H, name: &str) {
        if let Some(debug) = &self.debug_utils
            && let Ok(name) = std::ffi::CString::new(name)
        {
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
            boot::save_pipeline_cache(&self.device, self.pipeline_cache, &self.description);
            self.device.destroy_pipeline_cache(self.pipeline_cache, None);
            self.device.destroy_sampler(self.sampler, None);
            self.device.destroy_semaphore(self.timeline, None);
            self.instance.destroy_device(&self.device);
        }
    }
}
