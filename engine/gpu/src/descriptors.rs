//! Sets of descriptors from pools, for devices that do not take them pushed with the commands.

use ash::vk;

use super::check;
use base::error::Result;

/// Number of sets in a pool.
const SETS: u32 = 128;
/// Number of descriptors of each kind in a pool, and of what its sets have on the average.
const KINDS: [(vk::DescriptorType, u32); 3] = [
    (vk::DescriptorType::STORAGE_BUFFER, 12),
    (vk::DescriptorType::COMBINED_IMAGE_SAMPLER, 4),
    (vk::DescriptorType::STORAGE_IMAGE, 4),
];

/// How a pass binds its resources.
#[derive(Clone, Copy)]
pub(super) enum Way {
    /// They are pushed with the commands.
    Pushed,
    /// They are written into a set, and the set is bound.
    Set(vk::DescriptorSet),
}

/// The pools of a submission. They become more as it is recorded, and serve again after it.
#[derive(Default)]
pub(super) struct Descriptors {
    pools: Vec<vk::DescriptorPool>,
    /// Index of the pool that sets come from; those before it are full.
    current: usize,
}

impl Descriptors {
    /// Takes all sets back. The submission that used them has finished.
    pub(super) fn reset(&mut self, device: &ash::Device) -> Result<()> {
        self.current = 0;
        for &pool in &self.pools {
            // SAFETY: nothing in flight uses the sets any more, as the caller promises.
            let reset = unsafe { device.reset_descriptor_pool(pool, vk::DescriptorPoolResetFlags::empty()) };
            check("resetting descriptors", reset)?;
        }
        Ok(())
    }

    /// Returns a new set of this layout.
    pub(super) fn set(
        &mut self,
        device: &ash::Device,
        layout: vk::DescriptorSetLayout,
    ) -> Result<vk::DescriptorSet> {
        let layouts = [layout];
        loop {
            let is_new = self.current == self.pools.len();
            if is_new {
                self.pools.push(pool(device)?);
            }
            let info = vk::DescriptorSetAllocateInfo::default()
                .descriptor_pool(self.pools[self.current])
                .set_layouts(&layouts);
            // SAFETY: pool and layout are live; the submission that owns the pool is recorded by one thread.
            match unsafe { device.allocate_descriptor_sets(&info) } {
                Ok(sets) => return Ok(sets[0]),
                Err(vk::Result::ERROR_OUT_OF_POOL_MEMORY | vk::Result::ERROR_FRAGMENTED_POOL) if !is_new => {
                    self.current += 1;
                }
                Err(e) => return check("creating descriptors", Err(e)),
            }
        }
    }

    /// Destroys the pools with their sets.
    ///
    /// # Safety
    /// The device must be idle.
    pub(super) unsafe fn destroy(&mut self, device: &ash::Device) {
        for pool in self.pools.drain(..) {
            // SAFETY: as the caller promises.
            unsafe { device.destroy_descriptor_pool(pool, None) };
        }
    }
}

/// Creates a pool.
fn pool(device: &ash::Device) -> Result<vk::DescriptorPool> {
    let sizes =
        KINDS.map(|(kind, of_a_set)| vk::DescriptorPoolSize { ty: kind, descriptor_count: SETS * of_a_set });
    let info = vk::DescriptorPoolCreateInfo::default().max_sets(SETS).pool_sizes(&sizes);
    // SAFETY: the device is live; the create-info lives on this stack.
    check("creating a pool of descriptors", unsafe { device.create_descriptor_pool(&info, None) })
}
