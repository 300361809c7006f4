//! Compute pipelines made from reflected shaders. Push descriptors: no pools, no sets to own.

use std::collections::HashMap;
use std::sync::atomic::Ordering;

use ash::vk;
use shaders_glsl::{Binding, Resource, Shader};

use super::{Context, Gpu, boot, check, lock};
use crate::error::{Error, Kind, Result};

pub(super) fn descriptor_type(resource: Resource) -> vk::DescriptorType {
    match resource {
        Resource::Buffer { .. } => vk::DescriptorType::STORAGE_BUFFER,
        Resource::Texture => vk::DescriptorType::COMBINED_IMAGE_SAMPLER,
        Resource::Image => vk::DescriptorType::STORAGE_IMAGE,
    }
}

/// The layout of one set of push descriptors.
pub(super) fn set_layout<'a>(
    context: &Context,
    name: &str,
    bindings: impl IntoIterator<Item = &'a Binding>,
    stages: vk::ShaderStageFlags,
) -> Result<vk::DescriptorSetLayout> {
    let bindings: Vec<_> = bindings
        .into_iter()
        .map(|binding| {
            vk::DescriptorSetLayoutBinding::default()
                .binding(binding.number)
                .descriptor_type(descriptor_type(binding.resource))
                .descriptor_count(1)
                .stage_flags(stages)
        })
        .collect();
    let info = vk::DescriptorSetLayoutCreateInfo::default()
        .flags(vk::DescriptorSetLayoutCreateFlags::PUSH_DESCRIPTOR_KHR)
        .bindings(&bindings);
    // SAFETY: the device is live; the create-info lives on this stack.
    check(name, unsafe { context.device.create_descriptor_set_layout(&info, None) })
}

/// The shader as the driver takes it; to be destroyed when the pipeline is made.
pub(super) fn module(context: &Context, shader: &Shader) -> Result<vk::ShaderModule> {
    let code: Vec<u32> =
        shader.spirv.as_chunks::<4>().0.iter().map(|&word| u32::from_le_bytes(word)).collect();
    let info = vk::ShaderModuleCreateInfo::default().code(&code);
    // SAFETY: the SPIR-V was made and checked by glslang when this program was built.
    check(shader.name, unsafe { context.device.create_shader_module(&info, None) })
}

/// A compute pipeline: one shader with its specialisation constants fixed. Kernels of the same shader and constants share
/// one pipeline, which lives as long as the device: making it is what costs, and a fit or an evaluation makes a dozen.
pub struct Kernel {
    pub(super) shader: &'static Shader,
    pub(super) pipeline: vk::Pipeline,
    pub(super) layout: vk::PipelineLayout,
}

/// The pipelines of a device, by the name of their shader and its constants.
#[derive(Default)]
pub(super) struct Pipelines(HashMap<(&'static str, Vec<u32>), Handles>);

#[derive(Clone, Copy, Default)]
struct Handles {
    pipeline: vk::Pipeline,
    layout: vk::PipelineLayout,
    set_layout: vk::DescriptorSetLayout,
}

impl Pipelines {
    /// Destroys all of them. Nothing may use them any more.
    pub fn destroy(&mut self, device: &ash::Device) {
        self.0.drain().for_each(|(_, handles)| handles.destroy(device));
    }
}

impl Handles {
    /// Builds the pipeline; what was made before a failure is destroyed.
    fn new(context: &Context, shader: &'static Shader, constants: &[u32]) -> Result<Self> {
        let mut handles = Handles::default();
        let made = handles.make(context, shader, constants);
        if made.is_err() {
            handles.destroy(&context.device);
        }
        made.map(|()| handles)
    }

    fn make(&mut self, context: &Context, shader: &'static Shader, constants: &[u32]) -> Result<()> {
        let device = &context.device;
        self.set_layout = set_layout(context, shader.name, shader.bindings, vk::ShaderStageFlags::COMPUTE)?;
        let ranges = [vk::PushConstantRange {
            stage_flags: vk::ShaderStageFlags::COMPUTE,
            offset: 0,
            size: shader.push_bytes as u32,
        }];
        let layouts = [self.set_layout];
        let mut layout_info = vk::PipelineLayoutCreateInfo::default().set_layouts(&layouts);
        if shader.push_bytes > 0 {
            layout_info = layout_info.push_constant_ranges(&ranges);
        }
        // SAFETY: the device is live; the create-info lives on this stack.
        self.layout = check(shader.name, unsafe { device.create_pipeline_layout(&layout_info, None) })?;
        let module = module(context, shader)?;
        let entries: Vec<_> = (0..constants.len())
            .map(|i| vk::SpecializationMapEntry { constant_id: i as u32, offset: (i * 4) as u32, size: 4 })
            .collect();
        let special =
            vk::SpecializationInfo::default().map_entries(&entries).data(bytemuck::cast_slice(constants));
        let stage = vk::PipelineShaderStageCreateInfo::default()
            .stage(vk::ShaderStageFlags::COMPUTE)
            .module(module)
            .name(c"main")
            .specialization_info(&special);
        let info = [vk::ComputePipelineCreateInfo::default().stage(stage).layout(self.layout)];
        // SAFETY: module and layout are live; the module may go once the pipeline is made.
        let made = unsafe {
            let made =
                device.create_compute_pipelines(context.pipeline_cache, &info, None).map_err(|(_, e)| e);
            device.destroy_shader_module(module, None);
            made
        };
        self.pipeline = check(shader.name, made)?[0];
        context.counters.pipelines.fetch_add(1, Ordering::Relaxed);
        if let Some(debug) = &context.debug_utils {
            let name = boot::c_name(shader.name);
            let info =
                vk::DebugUtilsObjectNameInfoEXT::default().object_handle(self.pipeline).object_name(&name);
            // SAFETY: the pipeline is live; failing to name it costs nothing but the name.
            let _ = unsafe { debug.set_debug_utils_object_name(&info) };
        }
        Ok(())
    }

    fn destroy(self, device: &ash::Device) {
        // SAFETY: nothing uses the handles any more, or ever did; null handles are ignored.
        unsafe {
            device.destroy_pipeline(self.pipeline, None);
            device.destroy_pipeline_layout(self.layout, None);
            device.destroy_descriptor_set_layout(self.set_layout, None);
        }
    }
}

impl Kernel {
    /// Returns the pipeline, building it where it is not there yet. `constants` are the specialisation constants in id
    /// order; fewer leave defaults.
    pub fn new(gpu: &Gpu, shader: &'static Shader, constants: &[u32]) -> Result<Self> {
        let context = &gpu.0;
        if constants.len() > shader.constants.len() {
            return Err(Error::new(
                Kind::Internal,
                "VGS-GPU-030",
                format!("{} has {} constants, not {}", shader.name, shader.constants.len(), constants.len()),
            ));
        }
        let key = (shader.name, constants.to_vec());
        // The lock is not held while a pipeline is built: another thread may want another one. Two that build the same
        // one keep the first.
        let there = lock(&context.pipelines).0.get(&key).copied();
        let handles = match there {
            Some(handles) => handles,
            None => {
                let made = Handles::new(context, shader, constants)?;
                let mut pipelines = lock(&context.pipelines);
                match pipelines.0.get(&key) {
                    Some(&first) => {
                        made.destroy(&context.device);
                        first
                    }
                    None => {
                        pipelines.0.insert(key, made);
                        made
                    }
                }
            }
        };
        Ok(Kernel { shader, pipeline: handles.pipeline, layout: handles.layout })
    }

    /// Name of the shader.
    pub fn name(&self) -> &'static str {
        self.shader.name
    }
}
