//! Barriers. The recorder notes accesses since the last barrier, and places a barrier before an access to the
//! same resource if either access writes.

use ash::vk;

use super::Recorder;

/// The stages at which drawings write depth.
pub(super) const DEPTH_TESTS: vk::PipelineStageFlags2 = vk::PipelineStageFlags2::from_raw(
    vk::PipelineStageFlags2::EARLY_FRAGMENT_TESTS.as_raw()
        | vk::PipelineStageFlags2::LATE_FRAGMENT_TESTS.as_raw(),
);

/// A resource by whose handle hazards are tracked; a handle is unique only within its kind.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Resident {
    Buffer(vk::Buffer),
    Image(vk::Image),
}

impl Recorder {
    /// Makes all earlier writes visible to all commands that follow. It is one memory barrier for all
    /// buffers: on the devices we know, a list of buffer barriers costs more than it saves.
    pub(super) fn barrier(&mut self) {
        self.touched.clear();
        let mut stages = vk::PipelineStageFlags2::COMPUTE_SHADER | vk::PipelineStageFlags2::ALL_TRANSFER;
        let mut writes = vk::AccessFlags2::SHADER_STORAGE_WRITE | vk::AccessFlags2::TRANSFER_WRITE;
        let mut reads = vk::AccessFlags2::SHADER_STORAGE_READ
            | vk::AccessFlags2::SHADER_SAMPLED_READ
            | vk::AccessFlags2::TRANSFER_READ;
        if self.graphics_barriers {
            stages |= vk::PipelineStageFlags2::VERTEX_SHADER
                | vk::PipelineStageFlags2::FRAGMENT_SHADER
                | vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT
                | DEPTH_TESTS
                | vk::PipelineStageFlags2::DRAW_INDIRECT;
            writes |=
                vk::AccessFlags2::COLOR_ATTACHMENT_WRITE | vk::AccessFlags2::DEPTH_STENCIL_ATTACHMENT_WRITE;
            reads |= vk::AccessFlags2::COLOR_ATTACHMENT_READ
                | vk::AccessFlags2::DEPTH_STENCIL_ATTACHMENT_READ
                | vk::AccessFlags2::INDIRECT_COMMAND_READ;
        }
        let barrier = [vk::MemoryBarrier2::default()
            .src_stage_mask(stages)
            .src_access_mask(writes)
            .dst_stage_mask(stages)
            .dst_access_mask(reads | writes)];
        let info = vk::DependencyInfo::default().memory_barriers(&barrier);
        // SAFETY: the command buffer is recording.
        unsafe { self.gpu.0.device.cmd_pipeline_barrier2(self.commands(), &info) };
    }

    /// Registers the coming accesses. Places a barrier first if one of them meets an earlier access and
    /// either writes.
    pub(super) fn touch(&mut self, accesses: &[(Resident, bool)]) {
        let hazard = accesses
            .iter()
            .any(|(resident, write)| self.touched.get(resident).is_some_and(|written| *write || *written));
        if hazard {
            self.barrier();
        }
        for (resident, write) in accesses {
            *self.touched.entry(*resident).or_default() |= write;
        }
    }
}
