//! Submissions: the queue, how work is submitted to it, what is in flight on it, and the wait for it.

use std::sync::atomic::Ordering;

use ash::vk;

use super::{Context, Gpu, Recorder, check, lock, timing};
use crate::error::{Error, Kind, Result};

/// Number of timestamps in one submission: two per pass.
pub(super) const QUERIES: u32 = 512;

/// A submission: the value that the timeline reaches when the device has finished it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Ticket(pub(super) u64);

/// The queue and the command buffers that are reused.
pub(super) struct Submissions {
    pub(super) queue: vk::Queue,
    pub(super) last: u64,
    /// See [`super::GpuOptions::lost_at`].
    lost_at: Option<u64>,
    pub(super) free: Vec<Slot>,
    pub(super) flying: Vec<Flight>,
}

/// A command buffer with its pool and queries, used for one submission at a time.
pub(super) struct Slot {
    pub(super) pool: vk::CommandPool,
    pub(super) commands: vk::CommandBuffer,
    pub(super) queries: vk::QueryPool,
}

/// A submission that the device may not have finished: its timeline value, and the names of its passes.
pub(super) struct Flight {
    pub(super) value: u64,
    pub(super) slot: Slot,
    pub(super) passes: Vec<String>,
}

impl Submissions {
    /// Takes over a queue that nobody else uses.
    pub(super) fn new(queue: vk::Queue, lost_at: Option<u64>) -> Self {
        Submissions { queue, last: 0, lost_at, free: Vec::new(), flying: Vec::new() }
    }

    /// Returns true if the next submission is one at which the device behaves as lost.
    fn is_lost(&self) -> bool {
        self.lost_at.is_some_and(|at| self.last + 1 >= at)
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
    /// Waits until the device has finished `ticket`. Then reads the timestamps of finished submissions and
    /// deletes dropped objects that they were the last to use.
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
        lock(&context.memory).delete_passed(&context.device, passed);
        Ok(())
    }
}

impl Recorder {
    /// Submits the commands recorded so far and continues in a new submission, which follows it.
    pub fn split(&mut self) -> Result<Ticket> {
        let gpu = self.gpu.clone();
        std::mem::replace(self, gpu.record()?).submit()
    }

    /// Ends recording and submits the commands to the device.
    pub fn submit(self) -> Result<Ticket> {
        self.submit_between(None, None)
    }

    /// Submits the commands. Writes of colour wait for `wait`, and `signal` is signalled at the end.
    pub(super) fn submit_between(
        mut self,
        wait: Option<vk::Semaphore>,
        signal: Option<vk::Semaphore>,
    ) -> Result<Ticket> {
        let Some(slot) = self.slot.take() else {
            return Err(Error::new(Kind::Internal, "VGS-GPU-040", "submitted twice"));
        };
        let context = &self.gpu.0;
        // A host read after the wait must see what the device wrote.
        let to_host = [vk::MemoryBarrier2::default()
            .src_stage_mask(vk::PipelineStageFlags2::ALL_TRANSFER | vk::PipelineStageFlags2::COMPUTE_SHADER)
            .src_access_mask(vk::AccessFlags2::TRANSFER_WRITE | vk::AccessFlags2::SHADER_STORAGE_WRITE)
            .dst_stage_mask(vk::PipelineStageFlags2::HOST)
            .dst_access_mask(vk::AccessFlags2::HOST_READ)];
        let dependency = vk::DependencyInfo::default().memory_barriers(&to_host);
        let mut queue = lock(&context.queue);
        let value = queue.last + 1;
        let commands = [vk::CommandBufferSubmitInfo::default().command_buffer(slot.commands)];
        let at_end = |semaphore| {
            vk::SemaphoreSubmitInfo::default()
                .semaphore(semaphore)
                .stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
        };
        let mut signals = vec![at_end(context.timeline).value(value)];
        signals.extend(signal.map(at_end));
        let waits: Vec<_> = wait
            .map(|semaphore| {
                vk::SemaphoreSubmitInfo::default()
                    .semaphore(semaphore)
                    .stage_mask(vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT)
            })
            .into_iter()
            .collect();
        let submit = [vk::SubmitInfo2::default()
            .wait_semaphore_infos(&waits)
            .command_buffer_infos(&commands)
            .signal_semaphore_infos(&signals)];
        if queue.is_lost() {
            queue.free.push(slot);
            return check("submitting", Err(vk::Result::ERROR_DEVICE_LOST));
        }
        // SAFETY: the queue is ours alone while locked; the command buffer is complete.
        let submitted = unsafe {
            context.device.cmd_pipeline_barrier2(slot.commands, &dependency);
            context
                .device
                .end_command_buffer(slot.commands)
                .and_then(|()| context.device.queue_submit2(queue.queue, &submit, vk::Fence::null()))
        };
        if let Err(e) = submitted {
            queue.free.push(slot);
            return check("submitting", Err(e));
        }
        queue.last = value;
        queue.flying.push(Flight { value, slot, passes: std::mem::take(&mut self.passes) });
        // Buffers that were kept are dropped after this, so that their deletion waits for this submission.
        drop(queue);
        Ok(Ticket(value))
    }
}

/// Creates a command buffer with its pool and queries.
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
