//! Device memory: the allocator, its account of bytes, and deferred deletion. A dropped object is deleted
//! when the device has passed the last submission that may use it.

use std::collections::BTreeMap;

use ash::vk;
use gpu_allocator::AllocationError;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, Allocator, AllocatorCreateDesc};

use super::HeapKind;
use super::check::out_of_host_memory;
use base::error::{Error, Kind, Result};

/// The allocator, the deferred deletions, and the account of bytes.
#[derive(Default)]
pub(super) struct Memory {
    /// `None` only while the device is being created or destroyed.
    allocator: Option<Allocator>,
    deferred: Vec<DeferredDeletion>,
    pub(super) account: BTreeMap<(&'static str, HeapKind), u64>,
    pub(super) peak: u64,
}

/// A dropped object that the device may still use.
struct DeferredDeletion {
    /// The timeline value after which nothing uses the object.
    after: u64,
    dropped: Dropped,
    /// `None` if somebody else owns the memory.
    allocation: Option<Allocation>,
}

/// Handles of a dropped object.
pub(super) enum Dropped {
    Buffer(vk::Buffer),
    Image(vk::Image, vk::ImageView),
    /// The view of an image that somebody else owns.
    View(vk::ImageView),
}

impl Dropped {
    /// Destroys the handles.
    ///
    /// # Safety
    /// Nothing may use them any more.
    pub(super) unsafe fn destroy(self, device: &ash::Device) {
        // SAFETY: as the caller promises; a null view is ignored.
        unsafe {
            match self {
                Dropped::Buffer(buffer) => device.destroy_buffer(buffer, None),
                Dropped::Image(image, view) => {
                    device.destroy_image_view(view, None);
                    device.destroy_image(image, None);
                }
                Dropped::View(view) => device.destroy_image_view(view, None),
            }
        }
    }
}

impl Memory {
    /// Creates the allocator of a device.
    pub(super) fn new(
        instance: ash::Instance,
        physical: vk::PhysicalDevice,
        device: ash::Device,
    ) -> Result<Self> {
        let allocator = Allocator::new(&AllocatorCreateDesc {
            instance,
            device,
            physical_device: physical,
            debug_settings: gpu_allocator::AllocatorDebugSettings::default(),
            buffer_device_address: false,
            allocation_sizes: gpu_allocator::AllocationSizes::default(),
        })
        .map_err(|e| Error::new(Kind::Internal, "VGS-GPU-020", format!("device memory allocator: {e}")))?;
        Ok(Memory { allocator: Some(allocator), ..Memory::default() })
    }

    /// Deletes the dropped objects that a device which has passed this timeline value no longer uses.
    pub(super) fn delete_passed(&mut self, device: &ash::Device, passed: u64) {
        let Some(allocator) = &mut self.allocator else { return };
        for deletion in self.deferred.extract_if(.., |deletion| deletion.after <= passed) {
            // SAFETY: the device has passed the last submission made before the handles were dropped.
            unsafe { deletion.dropped.destroy(device) };
            if let Some(allocation) = deletion.allocation {
                // Freeing what this allocator gave cannot fail.
                let _ = allocator.free(allocation);
            }
        }
    }

    /// Allocates memory as `desc` says, counted under `purpose`.
    pub(super) fn allocate(
        &mut self,
        desc: &AllocationCreateDesc<'_>,
        purpose: &'static str,
    ) -> Result<Allocation> {
        let Some(allocator) = &mut self.allocator else {
            return Err(Error::new(Kind::Internal, "VGS-GPU-023", "the device is being destroyed"));
        };
        let allocation = allocator.allocate(desc).map_err(|e| {
            let bytes = desc.requirements.size;
            // The allocator hands on results in words only.
            let is_of_host = match &e {
                AllocationError::Internal(said) => said.contains("OUT_OF_HOST_MEMORY"),
                AllocationError::FailedToMap(said) => said.contains("host memory"),
                _ => false,
            };
            if is_of_host {
                return out_of_host_memory(desc.name);
            }
            Error::new(
                Kind::Temporary,
                "VGS-GPU-024",
                format!("{}: {bytes} bytes of device memory: {e}", desc.name),
            )
            .help("close other programs that use the GPU, use fewer splats or a smaller ROI")
        })?;
        let kind = HeapKind::of(allocation.memory_properties());
        *self.account.entry((purpose, kind)).or_default() += allocation.size();
        self.peak = self.peak.max(self.account.values().sum());
        Ok(allocation)
    }

    /// Defers the deletion of a dropped object; `after` is the last submission that may use it. Its bytes are
    /// no longer counted.
    pub(super) fn delete_after(
        &mut self,
        after: u64,
        dropped: Dropped,
        allocation: Allocation,
        purpose: &'static str,
    ) {
        let kind = HeapKind::of(allocation.memory_properties());
        if let Some(bytes) = self.account.get_mut(&(purpose, kind)) {
            *bytes -= allocation.size();
        }
        self.deferred.push(DeferredDeletion { after, dropped, allocation: Some(allocation) });
    }

    /// Defers the deletion of the view of somebody else's image.
    pub(super) fn delete_view_after(&mut self, after: u64, view: vk::ImageView) {
        self.deferred.push(DeferredDeletion { after, dropped: Dropped::View(view), allocation: None });
    }

    /// Deletes all dropped objects, and the allocator.
    ///
    /// # Safety
    /// The device must be idle.
    pub(super) unsafe fn destroy(&mut self, device: &ash::Device) {
        self.delete_passed(device, u64::MAX);
        self.allocator = None;
    }
}
