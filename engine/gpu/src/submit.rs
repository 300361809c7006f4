//! The submission of what was recorded.

use ash::vk;

use super::submissions::Flight;
use super::{Recorder, Ticket, check, lock};
use base::error::{Error, Kind, Result};

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
        if let Some(failed) = self.failed.take() {
            return Err(failed);
        }
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
