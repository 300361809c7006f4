//! Recording of commands. A pass is described by kernel, reads, writes, constants and dispatch. The recorder
//! places the barriers, opens a debug label and takes two timestamps per pass.

use std::any::Any;
use std::sync::Arc;

use ash::vk;
use ash::vk::Handle as _;
use bytemuck::Pod;

use super::c_name::c_name;
use super::descriptors::Way;
use super::hazards::{Hazards, Resident};
use super::submissions::{QUERIES, Slot};
use super::{Buffer, Context, Gpu, check, lock};
use base::error::{Error, Result};

impl Gpu {
    /// Starts recording.
    pub fn record(&self) -> Result<Recorder> {
        let context = &self.0;
        let reused = lock(&context.queue).free.pop();
        let slot = match reused {
            Some(slot) => slot,
            None => Slot::new(&context.device, context.queue_family)?,
        };
        // From here on a slot that cannot be used goes back when the recorder is dropped.
        let mut recorder = Recorder {
            gpu: self.clone(),
            slot: Some(slot),
            passes: Vec::new(),
            hazards: Hazards::default(),
            kept: Vec::new(),
            failed: None,
        };
        recorder.begin()?;
        // Whatever earlier submissions wrote, drawings too, is visible to this one.
        recorder.hazards.graphics = true;
        recorder.barrier();
        recorder.hazards.graphics = false;
        Ok(recorder)
    }
}

/// One submission being recorded.
pub struct Recorder {
    pub(super) gpu: Gpu,
    /// Slot of the recording; `None` after the submission.
    pub(super) slot: Option<Slot>,
    /// Names of the passes that have timestamps.
    pub(super) passes: Vec<String>,
    pub(super) hazards: Hazards,
    /// Staging buffers that the recorded copies read.
    kept: Vec<Box<dyn Any>>,
    /// Why a pass could not be recorded; the submission tells it.
    pub(super) failed: Option<Error>,
}

impl Recorder {
    /// Empties the slot and begins recording in it.
    fn begin(&mut self) -> Result<()> {
        let (device, Some(slot)) = (&self.gpu.0.device, &mut self.slot) else { return Ok(()) };
        let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        slot.descriptors.reset(device)?;
        // SAFETY: the slot is not in flight: it is new, or `wait` saw its submission finished.
        unsafe {
            let reset = device.reset_command_pool(slot.pool, vk::CommandPoolResetFlags::empty());
            check("resetting commands", reset)?;
            check("recording", device.begin_command_buffer(slot.commands, &begin))?;
            device.cmd_reset_query_pool(slot.commands, slot.queries, 0, QUERIES);
        }
        Ok(())
    }

    /// Returns the commands being recorded.
    pub(super) fn commands(&self) -> vk::CommandBuffer {
        self.slot.as_ref().map_or(vk::CommandBuffer::null(), |s| s.commands)
    }

    /// Makes all earlier writes visible to all commands that follow.
    fn barrier(&mut self) {
        let barrier = [self.hazards.barrier()];
        let info = vk::DependencyInfo::default().memory_barriers(&barrier);
        // SAFETY: the command buffer is recording.
        unsafe { self.gpu.0.device.cmd_pipeline_barrier2(self.commands(), &info) };
    }

    /// Registers the coming accesses. Places a barrier first if one of them meets an earlier access and
    /// either writes.
    pub(super) fn touch(&mut self, accesses: &[(Resident, bool)]) {
        if self.hazards.meet(accesses) {
            self.barrier();
        }
        self.hazards.register(accesses);
    }

    /// Returns how a pass with a pipeline of this layout binds its resources; nothing if there is no way, which the
    /// submission then tells.
    pub(super) fn way(&mut self, layout: vk::DescriptorSetLayout) -> Option<Way> {
        let context = &self.gpu.0;
        if context.push_descriptor.is_some() {
            return Some(Way::Pushed);
        }
        match self.slot.as_mut()?.descriptors.set(&context.device, layout) {
            Ok(set) => Some(Way::Set(set)),
            Err(e) => {
                self.failed.get_or_insert(e);
                None
            }
        }
    }

    /// Fills a buffer with zeros.
    pub fn clear<T: Pod>(&mut self, buffer: &Buffer<T>) {
        self.touch(&[(Resident::Buffer(buffer.handle()), true)]);
        // SAFETY: recording; buffers are made with TRANSFER_DST and whole words.
        unsafe {
            self.gpu.0.device.cmd_fill_buffer(self.commands(), buffer.handle(), 0, vk::WHOLE_SIZE, 0);
        }
    }

    /// Copies `len` elements from `from[from_start..]` to `to[to_start..]`.
    pub fn copy<T: Pod>(
        &mut self,
        from: &Buffer<T>,
        from_start: usize,
        to: &mut Buffer<T>,
        to_start: usize,
        len: usize,
    ) {
        assert!(
            from_start + len <= from.len() && to_start + len <= to.len(),
            "{}: copy behind the end",
            to.name()
        );
        let size = size_of::<T>() as u64;
        self.copy_bytes(
            (from.handle(), from_start as u64 * size),
            (to.handle(), to_start as u64 * size),
            len as u64 * size,
            to.name(),
        );
    }

    /// Copies bytes; the callers have checked the ranges.
    pub(super) fn copy_bytes(
        &mut self,
        (from, from_offset): (vk::Buffer, u64),
        (to, to_offset): (vk::Buffer, u64),
        bytes: u64,
        name: &str,
    ) {
        self.touch(&[(Resident::Buffer(from), false), (Resident::Buffer(to), true)]);
        let region = [vk::BufferCopy { src_offset: from_offset, dst_offset: to_offset, size: bytes }];
        self.label(name, |gpu, commands| {
            // SAFETY: recording; ranges were checked by the callers; usage has both transfer bits.
            unsafe { gpu.0.device.cmd_copy_buffer(commands, from, to, &region) };
        });
    }

    /// Runs `record` inside a debug label and, if queries are left, between two timestamps at `stage`.
    pub(super) fn timed(
        &mut self,
        name: &str,
        stage: vk::PipelineStageFlags2,
        record: impl FnOnce(&Context, vk::CommandBuffer),
    ) {
        let query = self.passes.len() as u32 * 2;
        let queries = self.slot.as_ref().map_or(vk::QueryPool::null(), |s| s.queries);
        let timed = query + 2 <= QUERIES && !queries.is_null();
        self.label(name, |gpu, commands| {
            let context: &Arc<Context> = &gpu.0;
            // SAFETY: recording; the two queries were reset when recording began.
            unsafe {
                if timed {
                    context.device.cmd_write_timestamp2(commands, stage, queries, query);
                }
                record(context, commands);
                if timed {
                    context.device.cmd_write_timestamp2(commands, stage, queries, query + 1);
                }
            }
        });
        if timed {
            self.passes.push(name.to_owned());
        }
    }

    /// Runs `record` inside a debug label.
    pub(super) fn label(&self, name: &str, record: impl FnOnce(&Gpu, vk::CommandBuffer)) {
        let commands = self.commands();
        if let Some(debug) = &self.gpu.0.debug_utils {
            let name = c_name(name);
            let label = vk::DebugUtilsLabelEXT::default().label_name(&name);
            // SAFETY: recording; begin and end are paired.
            unsafe { debug.cmd_begin_debug_utils_label(commands, &label) };
            record(&self.gpu, commands);
            // SAFETY: as above.
            unsafe { debug.cmd_end_debug_utils_label(commands) };
        } else {
            record(&self.gpu, commands);
        }
    }

    /// Keeps a staging buffer until this is submitted: only then does its deletion know which submission to
    /// wait for.
    pub(super) fn keep<T: Pod>(&mut self, staging: Buffer<T>) {
        self.kept.push(Box::new(staging));
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        // A slot that was recorded but never submitted goes back; its pool is reset before the next use.
        if let Some(slot) = self.slot.take() {
            lock(&self.gpu.0.queue).free.push(slot);
        }
    }
}
