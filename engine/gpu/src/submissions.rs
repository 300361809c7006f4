//! The queue of a context, the command buffers for it, and the submissions in flight on it.

use ash::vk;

use super::check;
use super::descriptors::Descriptors;
use base::error::Result;

/// Number of timestamps in one submission: two per pass.
pub(super) const QUERIES: u32 = 512;

/// The queue and the command buffers that are reused.
pub(super) struct Submissions {
    pub(super) queue: vk::Queue,
    pub(super) last: u64,
    pub(super) free: Vec<Slot>,
    pub(super) flying: Vec<Flight>,
}

/// A command buffer with its pool and queries, used for one submission at a time.
pub(super) struct Slot {
    pub(super) pool: vk::CommandPool,
    pub(super) commands: vk::CommandBuffer,
    pub(super) queries: vk::QueryPool,
    /// Sets of descriptors, where they are not pushed.
    pub(super) descriptors: Descriptors,
}

/// A submission that the device may not have finished: its timeline value, and the names of its passes.
pub(super) struct Flight {
    pub(super) value: u64,
    pub(super) slot: Slot,
    pub(super) passes: Vec<String>,
}

impl Submissions {
    /// Takes over a queue that nobody else uses.
    pub(super) fn new(queue: vk::Queue) -> Self {
        Submissions { queue, last: 0, free: Vec::new(), flying: Vec::new() }
    }

    /// Returns the timeline value of the last submission.
    pub(super) fn last_value(&self) -> u64 {
        self.last
    }

    /// Destroys all command buffers with their pools and queries.
    ///
    /// # Safety
    /// The device must be idle.
    pub(super) unsafe fn destroy(&mut self, device: &ash::Device) {
        let flying = self.flying.drain(..).map(|f| f.slot);
        for mut slot in self.free.drain(..).chain(flying) {
            // SAFETY: as the caller promises.
            unsafe {
                device.destroy_command_pool(slot.pool, None);
                device.destroy_query_pool(slot.queries, None);
                slot.descriptors.destroy(device);
            }
        }
    }
}

impl Slot {
    /// Creates a command buffer with its pool and queries.
    pub(super) fn new(device: &ash::Device, queue_family: u32) -> Result<Self> {
        let pool_info = vk::CommandPoolCreateInfo::default()
            .flags(vk::CommandPoolCreateFlags::TRANSIENT)
            .queue_family_index(queue_family);
        let query_info =
            vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(QUERIES);
        // SAFETY: the device is live; what is made first is destroyed if a later step fails.
        unsafe {
            let pool = check("creating a command pool", device.create_command_pool(&pool_info, None))?;
            let allocate = vk::CommandBufferAllocateInfo::default()
                .command_pool(pool)
                .level(vk::CommandBufferLevel::PRIMARY)
                .command_buffer_count(1);
            let made = device
                .allocate_command_buffers(&allocate)
                .and_then(|c| device.create_query_pool(&query_info, None).map(|q| (c[0], q)));
            match made {
                Ok((commands, queries)) => {
                    Ok(Slot { pool, commands, queries, descriptors: Descriptors::default() })
                }
                Err(e) => {
                    device.destroy_command_pool(pool, None);
                    check("creating commands", Err(e))
                }
            }
        }
    }
}

impl Flight {
    /// Reads the timestamps of the submission, which has finished: two for each of its passes.
    pub(super) fn ticks(&self, device: &ash::Device) -> Result<Vec<u64>> {
        let mut ticks = vec![0u64; self.passes.len() * 2];
        // SAFETY: the submission that wrote these queries has finished.
        let read = unsafe {
            device.get_query_pool_results(self.slot.queries, 0, &mut ticks, vk::QueryResultFlags::TYPE_64)
        };
        check("reading timestamps", read)?;
        Ok(ticks)
    }
}
