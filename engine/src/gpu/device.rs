//! The handle to a booted device: its description, its limits, and the use of its memory.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use super::context::Counters;
use super::{Context, DeviceDescription, Ticket, lock};
use crate::error::Result;

/// A booted Vulkan device. A clone is cheap; all clones are the same device.
#[derive(Clone)]
pub struct Gpu(pub(super) Arc<Context>);

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
}

/// Counts of actions that would interrupt a frame loop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Hitches {
    /// Number of allocations of device memory for a buffer or an image.
    pub allocations: u64,
    /// Number of pipelines that were created.
    pub pipelines: u64,
    /// Number of waits of the host for the device.
    pub waits: u64,
}

impl Gpu {
    /// Returns the description of the device that was chosen: name, driver, kind, features.
    pub fn description(&self) -> &DeviceDescription {
        &self.0.description
    }

    /// Returns the limits that buffers and dispatches are planned with.
    pub fn limits(&self) -> &Limits {
        &self.0.limits
    }

    /// Returns the counts, since the start, of actions that would interrupt a frame loop.
    pub fn hitches(&self) -> Hitches {
        let Counters { allocations, pipelines, waits } = &self.0.counters;
        let [allocations, pipelines, waits] =
            [allocations, pipelines, waits].map(|counter| counter.load(Ordering::Relaxed));
        Hitches { allocations, pipelines, waits }
    }

    /// Returns the bytes of device memory in use now, by purpose.
    pub fn memory_by_purpose(&self) -> BTreeMap<&'static str, u64> {
        lock(&self.0.memory).by_purpose.clone()
    }

    /// Returns the peak of the device memory in use, bytes.
    pub fn peak_bytes(&self) -> u64 {
        lock(&self.0.memory).peak
    }

    /// Returns the messages of the validation layers so far (errors and warnings); none if all is well or no
    /// layer is on.
    pub fn validation_messages(&self) -> Vec<String> {
        self.0.instance.messages()
    }

    /// Waits until the device has finished all submissions.
    pub fn wait_idle(&self) -> Result<()> {
        let last = lock(&self.0.queue).last_value();
        self.wait(Ticket(last))
    }
}
