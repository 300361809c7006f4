//! The placement of a new object in device memory.

use std::sync::atomic::Ordering;

use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme};

use super::memory::Dropped;
use super::{Context, lock};
use crate::error::Result;

/// Requirements and purpose of an allocation.
pub(super) struct Placement<'a> {
    pub(super) name: &'a str,
    pub(super) purpose: &'static str,
    pub(super) requirements: vk::MemoryRequirements,
    pub(super) location: MemoryLocation,
    /// True for buffers.
    pub(super) linear: bool,
}

impl Context {
    /// Allocates memory for an object that was just created and is not used yet; destroys the object if there
    /// is no memory.
    pub(super) fn place(&self, placement: &Placement<'_>, made: Dropped) -> Result<Allocation> {
        let &Placement { name, purpose, requirements, location, linear } = placement;
        let desc = AllocationCreateDesc {
            name,
            requirements,
            location,
            linear,
            allocation_scheme: AllocationScheme::GpuAllocatorManaged,
        };
        let placed = lock(&self.memory).allocate(&desc, purpose);
        match &placed {
            Ok(_) => _ = self.counters.allocations.fetch_add(1, Ordering::Relaxed),
            // SAFETY: it was never used.
            Err(_) => unsafe { made.destroy(&self.device) },
        }
        placed
    }
}
