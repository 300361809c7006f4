//! The description of a drawing: shaders, reads, constants, pictures.

use std::ops::Range;

use ash::vk;
use bytemuck::Pod;

use super::bindings::Bindings;
use super::drawing::{STAGES, view_mask};
use super::hazards::Resident;
use super::{Buffer, Drawing, Image, Recorder};

/// The vertices that are drawn.
enum Vertices {
    Of(Range<u32>),
    /// A buffer from which the range is read, and the byte at which it lies.
    From(vk::Buffer, u64),
}

/// One drawing being described. Resources are only read; they are bound in the order of the bindings of the
/// shaders, each by its name there. A mismatch panics, as with [`super::Pass`].
pub struct DrawPass<'a> {
    recorder: &'a mut Recorder,
    drawing: &'a Drawing,
    bindings: Bindings,
    push: Vec<u8>,
    size: Option<[u32; 2]>,
    rows: Option<Range<u32>>,
}

impl Recorder {
    /// Starts a drawing.
    pub fn draw<'a>(&'a mut self, drawing: &'a Drawing) -> DrawPass<'a> {
        DrawPass {
            recorder: self,
            drawing,
            bindings: Bindings::default(),
            push: Vec::new(),
            size: None,
            rows: None,
        }
    }
}

impl<'a> DrawPass<'a> {
    /// Binds the next buffer, which the shaders call `name`.
    #[must_use]
    pub fn read<T: Pod>(mut self, name: &str, buffer: &'a Buffer<T>) -> Self {
        self.bindings.buffer(&self.drawing.place(name), buffer, size_of::<T>());
        self
    }

    /// Binds the next image, which the shaders call `name`, to be sampled.
    #[must_use]
    pub fn sample(mut self, name: &str, image: &'a Image) -> Self {
        self.bindings.image(&self.drawing.place(name), image);
        self
    }

    /// Sets the push constants.
    #[must_use]
    pub fn push<P: Pod>(mut self, params: &P) -> Self {
        self.push = bytemuck::bytes_of(params).to_vec();
        self
    }

    /// Draws into the upper left corner of the pictures, `size` pixels large, instead of all over them.
    #[must_use]
    pub fn within(mut self, size: [u32; 2]) -> Self {
        self.size = Some(size);
        self
    }

    /// Draws into these rows only; nothing else changes of what is drawn there.
    #[must_use]
    pub fn in_rows(mut self, rows: Range<u32>) -> Self {
        self.rows = Some(rows);
        self
    }

    /// Records the drawing into `pictures`, over what they hold. When it runs it reads `arguments[index]`:
    /// vertices, instances, first vertex, first instance.
    ///
    /// # Panics
    /// If pictures, resources or push constants are not those that the drawing was created for.
    pub fn over(self, pictures: &mut [&mut Image], arguments: &Buffer<[u32; 4]>, index: usize) {
        assert!(index < arguments.len(), "{}: no such row", arguments.name());
        let offset = (index * size_of::<[u32; 4]>()) as u64;
        self.record(pictures, Vertices::From(arguments.handle(), offset));
    }

    /// Records the drawing of a range of vertices into `pictures`, over what they hold.
    ///
    /// # Panics
    /// Under the same conditions as [`DrawPass::over`].
    pub fn vertices_over(self, pictures: &mut [&mut Image], vertices: Range<u32>) {
        self.record(pictures, Vertices::Of(vertices));
    }

    /// Checks that everything is bound, and records the drawing.
    fn record(self, pictures: &mut [&mut Image], vertices: Vertices) {
        let DrawPass { recorder, drawing, mut bindings, push, size, rows } = self;
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
        recorder.hazards.graphics = true;
        let Some(way) = recorder.way(drawing.pipeline.set_layout) else { return };
        recorder.touch(&bindings.accesses);
        let whole = [pictures[0].size()[0], pictures[0].size()[1]];
        let [width, height] = size.unwrap_or(whole);
        assert!(width <= whole[0] && height <= whole[1], "{name}: larger than the pictures");
        let rows = rows.unwrap_or(0..height);
        assert!(rows.end <= height, "{name}: rows behind the end");
        if rows.is_empty() {
            return;
        }
        let area = vk::Rect2D {
            offset: vk::Offset2D { x: 0, y: rows.start as i32 },
            extent: vk::Extent2D { width, height: rows.end - rows.start },
        };
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
            // SAFETY: recording; pipeline, pictures and buffers are live and of the kinds that the pipeline
            // was made for; the arguments lie in a buffer made for them.
            unsafe {
                device.cmd_begin_rendering(commands, &rendering);
                device.cmd_bind_pipeline(commands, vk::PipelineBindPoint::GRAPHICS, drawing.pipeline.handle);
                bindings.record(
                    context,
                    commands,
                    vk::PipelineBindPoint::GRAPHICS,
                    drawing.pipeline.layout,
                    way,
                );
                if !push.is_empty() {
                    device.cmd_push_constants(commands, drawing.pipeline.layout, STAGES, 0, &push);
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
