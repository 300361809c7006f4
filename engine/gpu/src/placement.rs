//! The placement of a new object in device memory.

use std::sync::atomic::Ordering;

use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme};

use super::heap::{heaps, most_free};
use super::memory::Dropped;
use super::{Context, lock};
use base::error::{Error, Kind, Result};

/// Bytes from which on an object is large.
const LARGE: u64 = 16 << 20;

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
            allocation_scheme: match made {
                Dropped::Buffer(buffer) if self.alone => AllocationScheme::DedicatedBuffer(buffer),
                Dropped::Image(image, _) if self.alone => AllocationScheme::DedicatedImage(image),
                _ => AllocationScheme::GpuAllocatorManaged,
            },
        };
        let placed = self.room(placement).and_then(|()| lock(&self.memory).allocate(&desc, purpose));
        match &placed {
            Ok(_) => _ = self.counters.allocations.fetch_add(1, Ordering::Relaxed),
            // SAFETY: it was never used.
            Err(_) => unsafe { made.destroy(&self.device) },
        }
        placed
    }

    /// Returns the most bytes that an object may still take, of the device's memory or else of the host's; nothing if the
    /// driver does not tell.
    pub(super) fn free_bytes(&self, of_device: bool) -> Option<u64> {
        let heaps = heaps(&self.instance.handle, self.physical, self.tells_budget);
        self.free_limit.or_else(|| most_free(&heaps, of_device))
    }

    /// Checks that a large object fits into what other programs leave, where the driver tells: some drivers hand out
    /// more, and something else dies of it.
    fn room(&self, &Placement { name, ref requirements, location, .. }: &Placement<'_>) -> Result<()> {
        let bytes = requirements.size;
        if bytes < LARGE {
            return Ok(());
        }
        match self.free_bytes(location == MemoryLocation::GpuOnly).filter(|&free| bytes > free) {
            None => Ok(()),
            Some(free) => {
                let message =
                    format!("{name}: {bytes} bytes of device memory are needed, and {free} bytes are free");
                Err(Error::new(Kind::Temporary, "VGS-GPU-033", message)
                    .help("close other programs that use the GPU, use fewer splats or a smaller ROI"))
            }
        }
    }
}
