//! Submissions: the queue, what is in flight on it, and the wait for it.

use std::sync::atomic::Ordering;

use ash::vk;

use super::{Context, Gpu, check, lock, timing};
use crate::error::Result;

/// Timestamps in one submission: two per pass.
pub(super) const QUERIES: u32 = 512;

/// A submission: the value that the timeline reaches when the device has finished it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Ticket(pub(super) u64);

/// The queue and the command buffers that go round.
pub(super) struct Submissions {
    pub(super) queue: vk::Queue,
    pub(super) last: u64,
    /// [`super::GpuOptions::lost_at`].
    pub(super) lost_at: Option<u64>,
    pub(super) free: Vec<Slot>,
    pub(super) flying: Vec<Flight>,
}

/// A command buffer with what belongs to it, used for one submission at a time.
pub(super) struct Slot {
    pub(super) pool: vk::CommandPool,
    pub(super) commands: vk::CommandBuffer,
    pub(super) queries: vk::QueryPool,
}

/// A submission that the device may not have finished: the timeline's value, and the names of its passes.
pub(super) struct Flight {
    pub(super) value: u64,
    pub(super) slot: Slot,
    pub(super) passes: Vec<String>,
}

impl Submissions {
    pub(super) fn new(queue: vk::Queue) -> Self {
        Submissions { queue, last: 0, lost_at: None, free: Vec::new(), flying: Vec::new() }
    }

    pub(super) fn is_lost(&self) -> bool {
        self.lost_at.is_some_and(|at| self.last + 1 >= at)
    }

    pub(super) fn last_value(&self) -> u64 {
        self.last
    }

    /// # Safety
    /// The device must be idle.
    pub(super) unsafe fn destroy(&mut self, device: &ash::Device) {
        let flying = self.flying.drain(..).map(|f| f.slot);
        for slot in self.free.drain(..).chain(flying) {
            // SAFETY: as the caller promises.
            unsafe {
                device.destroy_command_pool(slot.pool, None);
                device.destroy_query_pool(slot.queries, None);
            }
        }
    }
}

impl Gpu {
    /// Waits until the device has finished `ticket`, then counts its timestamps and frees what it was the last to use.
    pub fn wait(&self, ticket: Ticket) -> Result<()> {
        let context = &self.0;
        context.counters.waits.fetch_add(1, Ordering::Relaxed);
        let semaphores = [context.timeline];
        let values = [ticket.0];
        let info = vk::SemaphoreWaitInfo::default().semaphores(&semaphores).values(&values);
        // SAFETY: the timeline is live. No time limit: submissions are kept short, and a hung device is lost.
        check("waiting for the device", unsafe { context.device.wait_semaphores(&info, u64::MAX) })?;
        self.collect()
    }

    /// Takes finished submissions out of flight.
    pub(super) fn collect(&self) -> Result<()> {
        let context = &self.0;
        let passed = context.passed()?;
        let done: Vec<Flight> = lock(&context.queue).flying.extract_if(.., |f| f.value <= passed).collect();
        for flight in done {
            if context.limits.timestamp_period > 0.0 && !flight.passes.is_empty() {
                timing::read(context, Ticket(flight.value), flight.slot.queries, &flight.passes)?;
            }
            lock(&context.queue).free.push(flight.slot);
        }
        lock(&context.memory).bury(&context.device, passed);
        Ok(())
    }
}

pub(super) fn new_slot(context: &Context) -> Result<Slot> {
    let device = &context.device;
    let pool_info = vk::CommandPoolCreateInfo::default()
        .flags(vk::CommandPoolCreateFlags::TRANSIENT)
        .queue_family_index(context.queue_family);
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
            Ok((commands, queries)) => Ok(Slot { pool, commands, queries }),
            Err(e) => {
                device.destroy_command_pool(pool, None);
                check("creating commands", Err(e))
            }
        }
    }
}
