//! External images, such as those of a swapchain, which somebody else owns. One is acquired for a frame and
//! released after it. Between [`Recorder::acquire_image`] and [`Recorder::release_image`] it is in the
//! general layout; outside, its layout does not matter.

use ash::vk;

use super::hazards::DEPTH_TESTS;
use super::image::whole;
use super::{Context, Format, Gpu, Image, Recorder, check};
use base::error::Result;

impl Gpu {
    /// Wraps an image that somebody else owns, such as one of a swapchain.
    ///
    /// # Safety
    /// `handle` is an image of this device with `layers` layers of this format and size, made for attachments
    /// of its kind, colour or depth. Its owner wants it released in `release_layout`, and keeps it until this
    /// image was dropped and the device has finished with it.
    pub unsafe fn external_image(
        &self,
        name: &str,
        handle: vk::Image,
        format: Format,
        size: [u32; 2],
        layers: u32,
        release_layout: vk::ImageLayout,
    ) -> Result<Image> {
        let context: &Context = &self.0;
        context.name(handle, name);
        let info = vk::ImageViewCreateInfo::default()
            .image(handle)
            .view_type(vk::ImageViewType::TYPE_2D_ARRAY)
            .format(format.vk())
            .subresource_range(whole(format));
        // SAFETY: as the caller promises.
        let view = check(name, unsafe { context.device.create_image_view(&info, None) })?;
        Ok(Image {
            gpu: self.clone(),
            handle,
            view,
            allocation: None,
            release_layout: Some(release_layout),
            size: [size[0], size[1], 1],
            layers,
            format,
            name: name.to_owned(),
            purpose: "of others",
        })
    }
}

impl Recorder {
    /// Acquires an external image from its owner; its content is lost.
    ///
    /// # Panics
    /// If the image is not external.
    pub fn acquire_image(&mut self, image: &Image) {
        assert!(image.release_layout.is_some(), "{} is not an external image", image.name());
        let (stage, read, write) = attached(image);
        let layout = vk::ImageMemoryBarrier2::default()
            // The wait for the owner's semaphore holds back this stage.
            .src_stage_mask(stage)
            .dst_stage_mask(stage)
            .dst_access_mask(read | write)
            .old_layout(vk::ImageLayout::UNDEFINED)
            .new_layout(vk::ImageLayout::GENERAL);
        self.change_layout(image, layout);
    }

    /// Releases an external image to its owner; only drawings may have written it.
    ///
    /// # Panics
    /// If the image is not external.
    pub fn release_image(&mut self, image: &Image) {
        let Some(release_layout) = image.release_layout else {
            panic!("{} is not an external image", image.name())
        };
        let (stage, _, write) = attached(image);
        let layout = vk::ImageMemoryBarrier2::default()
            .src_stage_mask(stage)
            .src_access_mask(write)
            .dst_stage_mask(stage)
            .old_layout(vk::ImageLayout::GENERAL)
            .new_layout(release_layout);
        self.change_layout(image, layout);
    }

    /// Records a barrier that changes the layout of an image.
    fn change_layout(&mut self, image: &Image, barrier: vk::ImageMemoryBarrier2<'_>) {
        let barrier = [barrier.image(image.handle()).subresource_range(whole(image.format()))];
        let info = vk::DependencyInfo::default().image_memory_barriers(&barrier);
        // SAFETY: recording; the image is ours for this frame.
        unsafe { self.gpu.0.device.cmd_pipeline_barrier2(self.commands(), &info) };
    }
}

/// Returns the stages at which drawings have an image attached, and their read and write accesses to it
/// there.
fn attached(image: &Image) -> (vk::PipelineStageFlags2, vk::AccessFlags2, vk::AccessFlags2) {
    use vk::AccessFlags2 as Access;
    match image.format().is_depth() {
        true => (DEPTH_TESTS, Access::DEPTH_STENCIL_ATTACHMENT_READ, Access::DEPTH_STENCIL_ATTACHMENT_WRITE),
        false => (
            vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT,
            Access::COLOR_ATTACHMENT_READ,
            Access::COLOR_ATTACHMENT_WRITE,
        ),
    }
}
