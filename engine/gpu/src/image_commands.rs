//! Commands that clear and copy images.

use ash::vk;
use bytemuck::Pod;

use super::hazards::Resident;
use super::image::whole;
use super::{Buffer, Image, Recorder};

impl Recorder {
    /// Brings a new image into the general layout, and clears it.
    pub(super) fn begin_image(&mut self, image: &Image) {
        let layout = [vk::ImageMemoryBarrier2::default()
            .dst_stage_mask(vk::PipelineStageFlags2::ALL_TRANSFER)
            .dst_access_mask(vk::AccessFlags2::TRANSFER_WRITE)
            .old_layout(vk::ImageLayout::UNDEFINED)
            .new_layout(vk::ImageLayout::GENERAL)
            .image(image.handle())
            .subresource_range(whole(image.format()))];
        let info = vk::DependencyInfo::default().image_memory_barriers(&layout);
        // SAFETY: recording; the image is new, nothing else uses it.
        unsafe { self.gpu.0.device.cmd_pipeline_barrier2(self.commands(), &info) };
        self.clear_image(image, [0.0; 4]);
    }

    /// Fills an image with one colour, or with a depth, the first of the four numbers.
    pub fn clear_image(&mut self, image: &Image, colour: [f32; 4]) {
        self.touch(&[(Resident::Image(image.handle()), true)]);
        let (commands, handle, layout) = (self.commands(), image.handle(), vk::ImageLayout::GENERAL);
        let (device, range) = (&self.gpu.0.device, [whole(image.format())]);
        // SAFETY: recording; images have TRANSFER_DST and stay in the general layout.
        unsafe {
            if image.format().is_depth() {
                let depth = vk::ClearDepthStencilValue { depth: colour[0], stencil: 0 };
                device.cmd_clear_depth_stencil_image(commands, handle, layout, &depth, &range);
            } else {
                let colour = vk::ClearColorValue { float32: colour };
                device.cmd_clear_color_image(commands, handle, layout, &colour, &range);
            }
        }
    }

    /// Copies a region of an image to a buffer.
    pub(super) fn copy_image<T: Pod>(&mut self, from: &Image, to: &Buffer<T>, region: vk::BufferImageCopy) {
        self.touch(&[(Resident::Image(from.handle()), false), (Resident::Buffer(to.handle()), true)]);
        self.label(from.name(), |gpu, commands| {
            // SAFETY: recording; the caller made the buffer as large as the image.
            unsafe {
                gpu.0.device.cmd_copy_image_to_buffer(
                    commands,
                    from.handle(),
                    vk::ImageLayout::GENERAL,
                    to.handle(),
                    &[region],
                );
            }
        });
    }

    /// Copies a buffer to a region of an image.
    pub(super) fn fill_image<T: Pod>(&mut self, from: &Buffer<T>, to: &Image, region: vk::BufferImageCopy) {
        self.touch(&[(Resident::Buffer(from.handle()), false), (Resident::Image(to.handle()), true)]);
        self.label(to.name(), |gpu, commands| {
            // SAFETY: recording; the caller made the buffer as large as the image.
            unsafe {
                gpu.0.device.cmd_copy_buffer_to_image(
                    commands,
                    from.handle(),
                    to.handle(),
                    vk::ImageLayout::GENERAL,
                    &[region],
                );
            }
        });
    }
}
