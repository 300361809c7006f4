//! The handle to a booted device: its description, its limits, and the use of its memory.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::sync::atomic::Ordering;

use super::heap::heaps;
use super::hitches::Counters;
use super::{Context, DeviceDescription, Heap, HeapKind, Hitches, Limits, Recipe, lock};

/// A booted Vulkan device. A clone is cheap; all clones are the same device.
#[derive(Clone)]
pub struct Gpu(pub(super) Arc<Context>);

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

    /// Returns the recipes of all pipelines that were created since the start.
    pub fn recipes(&self) -> BTreeSet<Recipe> {
        lock(&self.0.recipes).clone()
    }

    /// Returns the bytes of device memory in use now, by purpose.
    pub fn memory_by_purpose(&self) -> BTreeMap<&'static str, u64> {
        let mut rows = BTreeMap::new();
        for (&(purpose, _), &bytes) in &lock(&self.0.memory).account {
            *rows.entry(purpose).or_default() += bytes;
        }
        rows
    }

    /// Returns the bytes of device memory in use now, by purpose and by kind of heap.
    pub fn memory_account(&self) -> BTreeMap<(&'static str, HeapKind), u64> {
        lock(&self.0.memory).account.clone()
    }

    /// Returns the heaps of the device, with what is free in them now.
    pub fn heaps(&self) -> Vec<Heap> {
        heaps(&self.0.instance.handle, self.0.physical, self.0.tells_budget)
    }

    /// Returns the most bytes that an object may still take of the device's memory; nothing if the driver does not tell.
    pub fn free_bytes(&self) -> Option<u64> {
        self.0.free_bytes(true)
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
}
