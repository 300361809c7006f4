//! Compute pipelines created from reflected shaders.

use ash::vk;
use shaders_glsl::Shader;

use super::bindings::Place;
use super::pipeline::Pipeline;
use super::pipeline_creation::{Builder, Interface, Module, constant_places};
use super::{Gpu, Recipe, check, lock};
use base::error::{Error, Kind, Result};

/// A compute pipeline: one shader with its specialisation constants fixed. Kernels of the same shader and
/// constants share one pipeline, which lives as long as the device: its creation is slow, and a fit or an
/// evaluation needs a dozen.
pub struct Kernel {
    pub(super) shader: &'static Shader,
    pub(super) pipeline: Pipeline,
}

impl Kernel {
    /// Returns the kernel; creates its pipeline if it does not exist yet. `constants` are the specialisation
    /// constants in id order; those that are left out keep their defaults.
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
        // The lock is not held while a pipeline is created: another thread may want another one. If two
        // threads create the same one, the first is kept.
        let there = lock(&context.pipelines).0.get(&key).copied();
        let pipeline = match there {
            Some(pipeline) => pipeline,
            None => {
                let made = make(context.builder(), shader, constants)?;
                context.made(made, Recipe::kernel(shader, constants));
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
        Ok(Kernel { shader, pipeline })
    }

    /// Describes a place to which a pass binds.
    pub(super) fn place<'a>(&self, name: &'a str, write: bool) -> Place<'a> {
        Place { shader: self.shader.name, bindings: self.shader.bindings, name, write }
    }

    /// Returns the name of the shader.
    pub fn name(&self) -> &'static str {
        self.shader.name
    }
}

/// Creates a pipeline with its layouts.
pub(super) fn make(builder: Builder<'_>, shader: &Shader, constants: &[u32]) -> Result<Pipeline> {
    let &Shader { name, bindings, push_bytes, .. } = shader;
    let interface = Interface { name, bindings, push_bytes, stages: vk::ShaderStageFlags::COMPUTE };
    Pipeline::new(builder, &interface, |layout| build(builder, shader, constants, layout))
}

/// Creates the pipeline on its layout.
fn build(
    Builder { device, cache, flags, .. }: Builder<'_>,
    shader: &Shader,
    constants: &[u32],
    layout: vk::PipelineLayout,
) -> Result<vk::Pipeline> {
    let module = Module::new(device, shader)?;
    let entries = constant_places(constants);
    let special =
        vk::SpecializationInfo::default().map_entries(&entries).data(bytemuck::cast_slice(constants));
    let stage = vk::PipelineShaderStageCreateInfo::default()
        .stage(vk::ShaderStageFlags::COMPUTE)
        .module(module.handle)
        .name(c"main")
        .specialization_info(&special);
    let info = [vk::ComputePipelineCreateInfo::default().flags(flags).stage(stage).layout(layout)];
    // SAFETY: module and layout are live.
    let made = unsafe { device.create_compute_pipelines(cache, &info, None) };
    Ok(check(shader.name, made.map_err(|(_, e)| e))?[0])
}
