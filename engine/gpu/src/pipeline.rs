//! Pipelines of any kind, one owner of three handles, and the table of those that kernels share.

use std::collections::HashMap;

use ash::vk;

/// A pipeline with its layouts. The holder of the last copy, the table of kernels or a drawing, calls
/// [`Pipeline::destroy`].
#[derive(Clone, Copy, Default)]
pub(super) struct Pipeline {
    pub(super) handle: vk::Pipeline,
    pub(super) layout: vk::PipelineLayout,
    pub(super) set_layout: vk::DescriptorSetLayout,
}

/// The pipelines of kernels, by the name and the constants of their shader.
#[derive(Default)]
pub(super) struct Pipelines(pub(super) HashMap<(&'static str, Vec<u32>), Pipeline>);

impl Pipelines {
    /// Destroys all pipelines. Nothing may use them any more.
    pub(super) fn destroy(&mut self, device: &ash::Device) {
        self.0.drain().for_each(|(_, pipeline)| pipeline.destroy(device));
    }
}

impl Pipeline {
    /// Destroys the handles. Nothing may use them any more.
    pub(super) fn destroy(self, device: &ash::Device) {
        // SAFETY: nothing uses the handles any more, or ever did; null handles are ignored.
        unsafe {
            device.destroy_pipeline(self.handle, None);
            device.destroy_pipeline_layout(self.layout, None);
            device.destroy_descriptor_set_layout(self.set_layout, None);
        }
    }
}
