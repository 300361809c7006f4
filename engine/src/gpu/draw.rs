//! Drawings: a vertex and a fragment shader whose triangles are blended into pictures, all views at once (multiview).

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use ash::vk;
use bytemuck::Pod;
use shaders_glsl::{Binding, Shader, Stage};

use super::recorder::{Bindings, Resident};
use super::{Buffer, Context, Format, Gpu, Image, Recorder, boot, check, kernel, lock};
use crate::error::Result;

/// A graphics pipeline that draws triangles without vertex buffers and blends premultiplied colours over what is
/// there: result = source + (1 - source alpha) · target, in every picture alike. The depth of what is drawn last replaces the
/// one before, where there is a picture of depth.
pub struct Drawing {
    context: Arc<Context>,
    vertex: &'static Shader,
    bindings: Vec<Binding>,
    push_bytes: usize,
    formats: Vec<Format>,
    views: u32,
    pipeline: vk::Pipeline,
    layout: vk::PipelineLayout,
    set_layout: vk::DescriptorSetLayout,
}

const STAGES: vk::ShaderStageFlags = vk::ShaderStageFlags::from_raw(
    vk::ShaderStageFlags::VERTEX.as_raw() | vk::ShaderStageFlags::FRAGMENT.as_raw(),
);

impl Drawing {
    /// Builds the pipeline. `constants` are the specialisation constants of both shaders in id order; `formats` are those
    /// of the pictures, of which the last may be depth; `views` is the number of layers that are drawn at once.
    ///
    /// # Panics
    /// If the shaders are no pair: the stages, or bindings or push constants that differ.
    pub fn new(
        gpu: &Gpu,
        vertex: &'static Shader,
        fragment: &'static Shader,
        constants: &[u32],
        formats: &[Format],
        views: u32,
    ) -> Result<Self> {
        let name = vertex.name;
        assert!(
            vertex.stage == Stage::Vertex && fragment.stage == Stage::Fragment,
            "{name}: a pair of shaders"
        );
        let mut bindings: Vec<Binding> = vertex.bindings.iter().chain(fragment.bindings).copied().collect();
        bindings.sort_by_key(|b| b.number);
        bindings.dedup_by_key(|b| b.number);
        assert!(
            bindings.iter().map(|b| b.number).eq(0..bindings.len() as u32),
            "{name}: bindings count up from 0"
        );
        let push_bytes = vertex.push_bytes.max(fragment.push_bytes);
        let context = Arc::clone(&gpu.0);
        let set_layout = kernel::set_layout(&context, name, &bindings, STAGES)?;
        let mut drawing = Drawing {
            vertex,
            bindings,
            push_bytes,
            formats: formats.to_vec(),
            views,
            pipeline: vk::Pipeline::null(),
            layout: vk::PipelineLayout::null(),
            set_layout,
            context: Arc::clone(&context),
        };
        // From here on `Drop` cleans up: destroying a null handle is allowed.
        let ranges = [vk::PushConstantRange { stage_flags: STAGES, offset: 0, size: push_bytes as u32 }];
        let layouts = [set_layout];
        let mut layout_info = vk::PipelineLayoutCreateInfo::default().set_layouts(&layouts);
        if push_bytes > 0 {
            layout_info = layout_info.push_constant_ranges(&ranges);
        }
        // SAFETY: the device is live; the create-info lives on this stack.
        drawing.layout = check(name, unsafe { context.device.create_pipeline_layout(&layout_info, None) })?;
        drawing.pipeline = drawing.build(vertex, fragment, constants)?;
        context.counters.pipelines.fetch_add(1, Ordering::Relaxed);
        if let Some(debug) = &context.debug_utils {
            let name = boot::c_name(name);
            let info =
                vk::DebugUtilsObjectNameInfoEXT::default().object_handle(drawing.pipeline).object_name(&name);
            // SAFETY: the pipeline is live; failing to name it costs nothing but the name.
            let _ = unsafe { debug.set_debug_utils_object_name(&info) };
        }
        Ok(drawing)
    }

    fn build(&self, vertex: &Shader, fragment: &Shader, constants: &[u32]) -> Result<vk::Pipeline> {
        let context = &self.context;
        let entries: Vec<_> = (0..constants.len())
            .map(|i| vk::SpecializationMapEntry { constant_id: i as u32, offset: (i * 4) as u32, size: 4 })
            .collect();
        let special =
            vk::SpecializationInfo::default().map_entries(&entries).data(bytemuck::cast_slice(constants));
        let input = vk::PipelineVertexInputStateCreateInfo::default();
        let assembly = vk::PipelineInputAssemblyStateCreateInfo::default()
            .topology(vk::PrimitiveTopology::TRIANGLE_LIST);
        let viewport = vk::PipelineViewportStateCreateInfo::default().viewport_count(1).scissor_count(1);
        let raster = vk::PipelineRasterizationStateCreateInfo::default()
            .polygon_mode(vk::PolygonMode::FILL)
            .cull_mode(vk::CullModeFlags::NONE)
            .line_width(1.0);
        let samples = vk::PipelineMultisampleStateCreateInfo::default()
            .rasterization_samples(vk::SampleCountFlags::TYPE_1);
        let over = vk::PipelineColorBlendAttachmentState::default()
            .blend_enable(true)
            .src_color_blend_factor(vk::BlendFactor::ONE)
            .dst_color_blend_factor(vk::BlendFactor::ONE_MINUS_SRC_ALPHA)
            .color_blend_op(vk::BlendOp::ADD)
            .src_alpha_blend_factor(vk::BlendFactor::ONE)
            .dst_alpha_blend_factor(vk::BlendFactor::ONE_MINUS_SRC_ALPHA)
            .alpha_blend_op(vk::BlendOp::ADD)
            .color_write_mask(vk::ColorComponentFlags::RGBA);
        let formats: Vec<_> = self.formats.iter().filter(|f| !f.is_depth()).map(|f| f.vk()).collect();
        let attachments = vec![over; formats.len()];
        let depth = self.formats.iter().find(|f| f.is_depth()).map(|f| f.vk());
        let deep = vk::PipelineDepthStencilStateCreateInfo::default()
            .depth_test_enable(depth.is_some())
            .depth_write_enable(depth.is_some())
            .depth_compare_op(vk::CompareOp::ALWAYS);
        let blend = vk::PipelineColorBlendStateCreateInfo::default().attachments(&attachments);
        let dynamic_states = [vk::DynamicState::VIEWPORT, vk::DynamicState::SCISSOR];
        let dynamic = vk::PipelineDynamicStateCreateInfo::default().dynamic_states(&dynamic_states);
        let mut rendering = vk::PipelineRenderingCreateInfo::default()
            .view_mask(view_mask(self.views))
            .color_attachment_formats(&formats)
            .depth_attachment_format(depth.unwrap_or(vk::Format::UNDEFINED));
        let modules = [kernel::module(context, vertex)?, kernel::module(context, fragment)?];
        let stages =
            [(vk::ShaderStageFlags::VERTEX, modules[0]), (vk::ShaderStageFlags::FRAGMENT, modules[1])].map(
                |(stage, module)| {
                    vk::PipelineShaderStageCreateInfo::default()
                        .stage(stage)
                        .module(module)
                        .name(c"main")
                        .specialization_info(&special)
                },
            );
        let info = [vk::GraphicsPipelineCreateInfo::default()
            .stages(&stages)
            .vertex_input_state(&input)
            .input_assembly_state(&assembly)
            .viewport_state(&viewport)
            .rasterization_state(&raster)
            .multisample_state(&samples)
            .color_blend_state(&blend)
            .depth_stencil_state(&deep)
            .dynamic_state(&dynamic)
            .layout(self.layout)
            .push_next(&mut rendering)];
        // SAFETY: modules and layout are live; the modules may go once the pipeline is made.
        let made = unsafe {
            let made = context
                .device
                .create_graphics_pipelines(context.pipeline_cache, &info, None)
                .map_err(|(_, e)| e);
            for module in modules {
                context.device.destroy_shader_module(module, None);
            }
            made
        };
        Ok(check(vertex.name, made)?[0])
    }
}

/// One bit a view; 0, which turns multiview off, for a single one.
fn view_mask(views: u32) -> u32 {
    if views > 1 { (1 << views) - 1 } else { 0 }
}

impl Drop for Drawing {
    fn drop(&mut self) {
        // As with kernels: rare, and waiting counts as using the queue.
        let _queue = lock(&self.context.queue);
        // SAFETY: after the wait nothing uses the handles; null handles are ignored.
        unsafe {
            let _ = self.context.device.device_wait_idle();
            self.context.device.destroy_pipeline(self.pipeline, None);
            self.context.device.destroy_pipeline_layout(self.layout, None);
            self.context.device.destroy_descriptor_set_layout(self.set_layout, None);
        }
    }
}

/// Which vertices are drawn.
enum Vertices {
    Of(Range<u32>),
    /// Read from a buffer at this byte.
    From(vk::Buffer, u64),
}

/// One drawing being described. Resources are only read; they are bound in the order of the bindings of the shaders.
pub struct DrawPass<'a> {
    recorder: &'a mut Recorder,
    drawing: &'a Drawing,
    bindings: Bindings,
    push: Vec<u8>,
    size: Option<[u32; 2]>,
}

impl Recorder {
    /// Starts a drawing.
    pub fn draw<'a>(&'a mut self, drawing: &'a Drawing) -> DrawPass<'a> {
        DrawPass { recorder: self, drawing, bindings: Bindings::default(), push: Vec::new(), size: None }
    }
}

impl<'a> DrawPass<'a> {
    /// Binds the next buffer.
    #[must_use]
    pub fn read<T: Pod>(mut self, buffer: &'a Buffer<T>) -> Self {
        self.bindings.buffer(self.drawing.vertex, &self.drawing.bindings, buffer, size_of::<T>(), false);
        self
    }

    /// Binds the next image, to be sampled.
    #[must_use]
    pub fn sample(mut self, image: &'a Image) -> Self {
        self.bindings.image(self.drawing.vertex, &self.drawing.bindings, image, false);
        self
    }

    /// Sets the push constants.
    #[must_use]
    pub fn push<P: Pod>(mut self, params: &P) -> Self {
        self.push = bytemuck::bytes_of(params).to_vec();
        self
    }

    /// Draws into the upper left corner of the pictures, of so many pixels, instead of all over them.
    #[must_use]
    pub fn within(mut self, size: [u32; 2]) -> Self {
        self.size = Some(size);
        self
    }

    /// Records the drawing into `pictures`, over what they hold. `arguments[index]` says when it runs: vertices,
    /// instances, first vertex, first instance.
    ///
    /// # Panics
    /// If pictures, resources or push constants are not those that the drawing was made for.
    pub fn over(self, pictures: &mut [&mut Image], arguments: &Buffer<[u32; 4]>, index: usize) {
        assert!(index < arguments.len(), "{}: no such row", arguments.name());
        let offset = (index * size_of::<[u32; 4]>()) as u64;
        self.record(pictures, Vertices::From(arguments.handle(), offset));
    }

    /// Records the drawing of a range of vertices into `pictures`, over what they hold.
    ///
    /// # Panics
    /// As [`DrawPass::over`].
    pub fn vertices_over(self, pictures: &mut [&mut Image], vertices: Range<u32>) {
        self.record(pictures, Vertices::Of(vertices));
    }

    fn record(self, pictures: &mut [&mut Image], vertices: Vertices) {
        let DrawPass { recorder, drawing, mut bindings, push, size } = self;
        let name = drawing.vertex.name;
        assert_eq!(bindings.accesses.len(), drawing.bindings.len(), "{name}: a resource is missing");
        assert_eq!(push.len(), drawing.push_bytes, "{name}: push constants differ in size");
        assert!(
            pictures.iter().map(|p| p.format).eq(drawing.formats.iter().copied()),
            "{name}: formats differ"
        );
        assert!(pictures.iter().all(|p| p.layers() == drawing.views), "{name}: one layer a view");
        if let Vertices::From(buffer, _) = vertices {
            bindings.accesses.push((Resident::Buffer(buffer), false));
        }
        bindings.accesses.extend(pictures.iter().map(|p| (Resident::Image(p.handle()), true)));
        recorder.wide = true;
        recorder.touch(&bindings.accesses);
        let whole = [pictures[0].size()[0], pictures[0].size()[1]];
        let [width, height] = size.unwrap_or(whole);
        assert!(width <= whole[0] && height <= whole[1], "{name}: larger than the pictures");
        let area = vk::Rect2D { offset: vk::Offset2D::default(), extent: vk::Extent2D { width, height } };
        let attachment = |p: &&mut Image| {
            vk::RenderingAttachmentInfo::default()
                .image_view(p.view)
                .image_layout(vk::ImageLayout::GENERAL)
                .load_op(vk::AttachmentLoadOp::LOAD)
                .store_op(vk::AttachmentStoreOp::STORE)
        };
        let attachments: Vec<_> = pictures.iter().filter(|p| !p.format.is_depth()).map(attachment).collect();
        let depth = pictures.iter().find(|p| p.format.is_depth()).map(attachment);
        let mut rendering = vk::RenderingInfo::default()
            .render_area(area)
            .layer_count(1)
            .view_mask(view_mask(drawing.views))
            .color_attachments(&attachments);
        if let Some(depth) = &depth {
            rendering = rendering.depth_attachment(depth);
        }
        let viewport = [vk::Viewport::default().width(width as f32).height(height as f32).max_depth(1.0)];
        recorder.timed(name, vk::PipelineStageFlags2::ALL_GRAPHICS, |context, commands| {
            let device = &context.device;
            // SAFETY: recording; pipeline, pictures and buffers are live and of the kinds that the pipeline was made
            // for; the arguments lie in a buffer made for them.
            unsafe {
                device.cmd_begin_rendering(commands, &rendering);
                device.cmd_bind_pipeline(commands, vk::PipelineBindPoint::GRAPHICS, drawing.pipeline);
                bindings.push(context, commands, vk::PipelineBindPoint::GRAPHICS, drawing.layout);
                if !push.is_empty() {
                    device.cmd_push_constants(commands, drawing.layout, STAGES, 0, &push);
                }
                device.cmd_set_viewport(commands, 0, &viewport);
                device.cmd_set_scissor(commands, 0, &[area]);
                match vertices {
                    Vertices::Of(range) => device.cmd_draw(commands, range.len() as u32, 1, range.start, 0),
                    Vertices::From(buffer, offset) => {
                        device.cmd_draw_indirect(commands, buffer, offset, 1, 0)
                    }
                }
                device.cmd_end_rendering(commands);
            }
        });
    }
}
