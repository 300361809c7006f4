//! The creation of pipelines of any kind: the layouts that follow from reflection, and the modules.

use ash::vk;
use shaders_glsl::{Binding, Resource, Shader};

use super::check;
use super::pipeline::Pipeline;
use base::error::Result;

/// Where pipelines are built: a device with its cache, and how they are to be built.
#[derive(Clone, Copy)]
pub(super) struct Builder<'a> {
    pub(super) device: &'a ash::Device,
    pub(super) cache: vk::PipelineCache,
    pub(super) flags: vk::PipelineCreateFlags,
    /// True if descriptors are pushed with the commands.
    pub(super) pushes: bool,
}

/// The interface of shaders from which the layout of a pipeline is created.
pub(super) struct Interface<'a> {
    pub(super) name: &'a str,
    pub(super) bindings: &'a [Binding],
    pub(super) push_bytes: usize,
    pub(super) stages: vk::ShaderStageFlags,
}

impl Pipeline {
    /// Creates the layouts and, with `build`, the pipeline. If a step fails, the handles created before it
    /// are destroyed.
    pub(super) fn new(
        builder: Builder<'_>,
        interface: &Interface<'_>,
        build: impl FnOnce(vk::PipelineLayout) -> Result<vk::Pipeline>,
    ) -> Result<Self> {
        let mut pipeline = Pipeline::default();
        let made = pipeline.make(builder, interface, build);
        if made.is_err() {
            pipeline.destroy(builder.device);
        }
        made.map(|()| pipeline)
    }

    /// Creates the handles one after the other.
    fn make(
        &mut self,
        Builder { device, pushes, .. }: Builder<'_>,
        interface: &Interface<'_>,
        build: impl FnOnce(vk::PipelineLayout) -> Result<vk::Pipeline>,
    ) -> Result<()> {
        let &Interface { name, push_bytes, stages, .. } = interface;
        self.set_layout = set_layout(device, pushes, interface)?;
        let ranges = [vk::PushConstantRange { stage_flags: stages, offset: 0, size: push_bytes as u32 }];
        let layouts = [self.set_layout];
        let mut info = vk::PipelineLayoutCreateInfo::default().set_layouts(&layouts);
        if push_bytes > 0 {
            info = info.push_constant_ranges(&ranges);
        }
        // SAFETY: the device is live; the create-info lives on this stack.
        self.layout = check(name, unsafe { device.create_pipeline_layout(&info, None) })?;
        self.handle = build(self.layout)?;
        Ok(())
    }
}

/// Returns the kind of descriptor by which a resource is bound.
fn descriptor_type(resource: Resource) -> vk::DescriptorType {
    match resource {
        Resource::Buffer { .. } => vk::DescriptorType::STORAGE_BUFFER,
        Resource::Texture => vk::DescriptorType::COMBINED_IMAGE_SAMPLER,
        Resource::Image => vk::DescriptorType::STORAGE_IMAGE,
    }
}

/// Creates the layout of the set of descriptors of a pipeline.
fn set_layout(
    device: &ash::Device,
    pushes: bool,
    &Interface { name, bindings, stages, .. }: &Interface<'_>,
) -> Result<vk::DescriptorSetLayout> {
    let bindings: Vec<_> = bindings
        .iter()
        .map(|binding| {
            vk::DescriptorSetLayoutBinding::default()
                .binding(binding.number)
                .descriptor_type(descriptor_type(binding.resource))
                .descriptor_count(1)
                .stage_flags(stages)
        })
        .collect();
    let flags = match pushes {
        true => vk::DescriptorSetLayoutCreateFlags::PUSH_DESCRIPTOR_KHR,
        false => vk::DescriptorSetLayoutCreateFlags::empty(),
    };
    let info = vk::DescriptorSetLayoutCreateInfo::default().flags(flags).bindings(&bindings);
    // SAFETY: the device is live; the create-info lives on this stack.
    check(name, unsafe { device.create_descriptor_set_layout(&info, None) })
}

/// The driver's module of a shader, while pipelines are made of it.
pub(super) struct Module<'a> {
    device: &'a ash::Device,
    pub(super) handle: vk::ShaderModule,
}

impl<'a> Module<'a> {
    /// Creates the module.
    pub(super) fn new(device: &'a ash::Device, shader: &Shader) -> Result<Self> {
        let code: Vec<u32> =
            shader.spirv.as_chunks::<4>().0.iter().map(|&word| u32::from_le_bytes(word)).collect();
        let info = vk::ShaderModuleCreateInfo::default().code(&code);
        // SAFETY: the SPIR-V was made and checked by glslang when this program was built.
        let handle = check(shader.name, unsafe { device.create_shader_module(&info, None) })?;
        Ok(Module { device, handle })
    }
}

impl Drop for Module<'_> {
    fn drop(&mut self) {
        // SAFETY: the module may go once pipelines are made.
        unsafe { self.device.destroy_shader_module(self.handle, None) };
    }
}

/// Maps specialisation constants to their places: id after id, four bytes each.
pub(super) fn constant_places(constants: &[u32]) -> Vec<vk::SpecializationMapEntry> {
    (0..constants.len())
        .map(|i| vk::SpecializationMapEntry { constant_id: i as u32, offset: (i * 4) as u32, size: 4 })
        .collect()
}
