//! Drawings: a vertex and a fragment shader whose triangles are blended into pictures, for all views at once
//! (multiview).

use std::sync::Arc;

use ash::vk;
use shaders_glsl::{Binding, Shader, Stage};

use super::bindings::Place;
use super::pipeline::Pipeline;
use super::pipeline_creation::{Builder, Interface, Module, constant_places};
use super::{Context, Format, Gpu, Overlap, Recipe, Targets, check, lock};
use base::error::Result;

/// A graphics pipeline that draws triangles without vertex buffers.
pub struct Drawing {
    context: Arc<Context>,
    pub(super) vertex: &'static Shader,
    pub(super) bindings: Vec<Binding>,
    pub(super) push_bytes: usize,
    pub(super) formats: Vec<Format>,
    pub(super) views: u32,
    pub(super) pipeline: Pipeline,
}

/// The stages that see bindings and push constants.
pub(super) const STAGES: vk::ShaderStageFlags = vk::ShaderStageFlags::from_raw(
    vk::ShaderStageFlags::VERTEX.as_raw() | vk::ShaderStageFlags::FRAGMENT.as_raw(),
);

impl Drawing {
    /// Creates a pipeline that blends premultiplied colours over the target: result = source + (1 - source
    /// alpha) · target, in every picture. If there is a picture of depth, the depth of what is drawn last
    /// replaces the one before. `constants` are the specialisation constants of both shaders in id order;
    /// `formats` are those of the pictures, of which the last may be depth; `views` is the number of layers
    /// that are drawn at once.
    ///
    /// # Panics
    /// If the shaders are not a pair: their stages are wrong, or their bindings or push constants differ.
    pub fn new(
        gpu: &Gpu,
        vertex: &'static Shader,
        fragment: &'static Shader,
        constants: &[u32],
        formats: &[Format],
        views: u32,
    ) -> Result<Self> {
        Self::overlapping(gpu, [vertex, fragment], constants, formats, views, Overlap::Blended)
    }

    /// Creates a pipeline as [`Drawing::new`] does, for another overlap.
    ///
    /// # Panics
    /// If the shaders are not a pair.
    pub fn overlapping(
        gpu: &Gpu,
        [vertex, fragment]: [&'static Shader; 2],
        constants: &[u32],
        formats: &[Format],
        views: u32,
        overlap: Overlap,
    ) -> Result<Self> {
        let context = Arc::clone(&gpu.0);
        let targets = Targets { formats: formats.to_vec(), views, overlap };
        let (pipeline, bindings, push_bytes) =
            make(context.builder(), [vertex, fragment], constants, &targets)?;
        context.made(pipeline, Recipe::drawing([vertex, fragment], constants, targets));
        Ok(Drawing { context, vertex, bindings, push_bytes, formats: formats.to_vec(), views, pipeline })
    }
}

impl Drawing {
    /// Describes a place to which a drawing binds.
    pub(super) fn place<'a>(&'a self, name: &'a str) -> Place<'a> {
        Place { shader: self.vertex.name, bindings: &self.bindings, name, write: false }
    }
}

/// Creates a pipeline with its layouts; returns it with its bindings and the bytes of its push constants.
///
/// # Panics
/// If the shaders are not a pair: their stages are wrong, or their bindings or push constants differ.
pub(super) fn make(
    builder: Builder<'_>,
    [vertex, fragment]: [&Shader; 2],
    constants: &[u32],
    targets: &Targets,
) -> Result<(Pipeline, Vec<Binding>, usize)> {
    let name = vertex.name;
    let is_pair = vertex.stage == Stage::Vertex && fragment.stage == Stage::Fragment;
    assert!(is_pair, "{name}: a pair of shaders");
    let mut bindings: Vec<Binding> = vertex.bindings.iter().chain(fragment.bindings).copied().collect();
    bindings.sort_by_key(|b| b.number);
    bindings.dedup_by_key(|b| b.number);
    let counts_up = bindings.iter().map(|b| b.number).eq(0..bindings.len() as u32);
    assert!(counts_up, "{name}: bindings count up from 0");
    let push_bytes = vertex.push_bytes.max(fragment.push_bytes);
    let interface = Interface { name, bindings: &bindings, push_bytes, stages: STAGES };
    let pipeline = Pipeline::new(builder, &interface, |layout| {
        build(builder, [vertex, fragment], constants, targets, layout)
    })?;
    Ok((pipeline, bindings, push_bytes))
}

/// Builds the pipeline of a vertex and a fragment shader on its layout.
fn build(
    Builder { device, cache, flags, .. }: Builder<'_>,
    shaders: [&Shader; 2],
    constants: &[u32],
    targets: &Targets,
    layout: vk::PipelineLayout,
) -> Result<vk::Pipeline> {
    let &Targets { ref formats, views, overlap } = targets;
    let entries = constant_places(constants);
    let special =
        vk::SpecializationInfo::default().map_entries(&entries).data(bytemuck::cast_slice(constants));
    let input = vk::PipelineVertexInputStateCreateInfo::default();
    let assembly =
        vk::PipelineInputAssemblyStateCreateInfo::default().topology(vk::PrimitiveTopology::TRIANGLE_LIST);
    let viewport = vk::PipelineViewportStateCreateInfo::default().viewport_count(1).scissor_count(1);
    let raster = vk::PipelineRasterizationStateCreateInfo::default()
        .polygon_mode(vk::PolygonMode::FILL)
        .cull_mode(vk::CullModeFlags::NONE)
        .line_width(1.0);
    let samples =
        vk::PipelineMultisampleStateCreateInfo::default().rasterization_samples(vk::SampleCountFlags::TYPE_1);
    let over = vk::PipelineColorBlendAttachmentState::default()
        .blend_enable(overlap == Overlap::Blended)
        .src_color_blend_factor(vk::BlendFactor::ONE)
        .dst_color_blend_factor(vk::BlendFactor::ONE_MINUS_SRC_ALPHA)
        .color_blend_op(vk::BlendOp::ADD)
        .src_alpha_blend_factor(vk::BlendFactor::ONE)
        .dst_alpha_blend_factor(vk::BlendFactor::ONE_MINUS_SRC_ALPHA)
        .alpha_blend_op(vk::BlendOp::ADD)
        .color_write_mask(vk::ColorComponentFlags::RGBA);
    let colours: Vec<_> = formats.iter().filter(|f| !f.is_depth()).map(|f| f.vk()).collect();
    let attachments = vec![over; colours.len()];
    let depth = formats.iter().find(|f| f.is_depth()).map(|f| f.vk());
    let deep = vk::PipelineDepthStencilStateCreateInfo::default()
        .depth_test_enable(depth.is_some())
        .depth_write_enable(depth.is_some())
        .depth_compare_op(match overlap {
            Overlap::Blended => vk::CompareOp::ALWAYS,
            Overlap::Nearest => vk::CompareOp::LESS,
        });
    let blend = vk::PipelineColorBlendStateCreateInfo::default().attachments(&attachments);
    let dynamic_states = [vk::DynamicState::VIEWPORT, vk::DynamicState::SCISSOR];
    let dynamic = vk::PipelineDynamicStateCreateInfo::default().dynamic_states(&dynamic_states);
    let mut rendering = vk::PipelineRenderingCreateInfo::default()
        .view_mask(view_mask(views))
        .color_attachment_formats(&colours)
        .depth_attachment_format(depth.unwrap_or(vk::Format::UNDEFINED));
    let modules = [Module::new(device, shaders[0])?, Module::new(device, shaders[1])?];
    let stages = [(vk::ShaderStageFlags::VERTEX, &modules[0]), (vk::ShaderStageFlags::FRAGMENT, &modules[1])]
        .map(|(stage, module)| {
            vk::PipelineShaderStageCreateInfo::default()
                .stage(stage)
                .module(module.handle)
                .name(c"main")
                .specialization_info(&special)
        });
    let info = [vk::GraphicsPipelineCreateInfo::default()
        .flags(flags)
        .stages(&stages)
        .vertex_input_state(&input)
        .input_assembly_state(&assembly)
        .viewport_state(&viewport)
        .rasterization_state(&raster)
        .multisample_state(&samples)
        .color_blend_state(&blend)
        .depth_stencil_state(&deep)
        .dynamic_state(&dynamic)
        .layout(layout)
        .push_next(&mut rendering)];
    // SAFETY: modules and layout are live.
    let made = unsafe { device.create_graphics_pipelines(cache, &info, None) };
    Ok(check(shaders[0].name, made.map_err(|(_, e)| e))?[0])
}

/// Returns the views as a bit mask; 0, which turns multiview off, for a single view.
pub(super) fn view_mask(views: u32) -> u32 {
    if views > 1 { (1 << views) - 1 } else { 0 }
}

impl Drop for Drawing {
    fn drop(&mut self) {
        // Rare; waiting counts as using the queue.
        let _queue = lock(&self.context.queue);
        // SAFETY: the device is live.
        let _ = unsafe { self.context.device.device_wait_idle() };
        self.pipeline.destroy(&self.context.device);
    }
}
