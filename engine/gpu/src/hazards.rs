//! Hazards: the accesses since the last barrier. A barrier is due before an access to the same resource if
//! either access writes.

use std::collections::HashMap;

use ash::vk;

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

/// The accesses since the last barrier.
#[derive(Default)]
pub(super) struct Hazards {
    /// Resources that were accessed since the last barrier; true if they were written.
    touched: HashMap<Resident, bool>,
    /// True if barriers reach the graphics stages and indirect arguments, too; this is needed from their
    /// first use on.
    pub(super) graphics: bool,
}

impl Hazards {
    /// Returns true if one of the coming accesses meets an earlier access and either writes.
    pub(super) fn meet(&self, accesses: &[(Resident, bool)]) -> bool {
        accesses
            .iter()
            .any(|(resident, write)| self.touched.get(resident).is_some_and(|written| *write || *written))
    }

    /// Registers the coming accesses.
    pub(super) fn register(&mut self, accesses: &[(Resident, bool)]) {
        for (resident, write) in accesses {
            *self.touched.entry(*resident).or_default() |= write;
        }
    }

    /// Forgets all accesses and returns the barrier that makes all earlier writes visible to all commands
    /// that follow. It is one memory barrier for all buffers: on the devices we know, a list of buffer
    /// barriers costs more than it saves.
    pub(super) fn barrier(&mut self) -> vk::MemoryBarrier2<'static> {
        self.touched.clear();
        let mut stages = vk::PipelineStageFlags2::COMPUTE_SHADER | vk::PipelineStageFlags2::ALL_TRANSFER;
        let mut writes = vk::AccessFlags2::SHADER_STORAGE_WRITE | vk::AccessFlags2::TRANSFER_WRITE;
        let mut reads = vk::AccessFlags2::SHADER_STORAGE_READ
            | vk::AccessFlags2::SHADER_SAMPLED_READ
            | vk::AccessFlags2::TRANSFER_READ;
        if self.graphics {
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
        vk::MemoryBarrier2::default()
            .src_stage_mask(stages)
            .src_access_mask(writes)
            .dst_stage_mask(stages)
            .dst_access_mask(reads | writes)
    }
}
