//! Images on explicit memory: volumes that are sampled, and pictures that passes write. They stay in the
//! general layout from their creation on, so that nobody keeps track of layouts.

use std::sync::Arc;

use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::Allocation;

use super::memory::Dropped;
use super::placement::Placement;
use super::{Context, Format, Gpu, check, lock};
use base::error::Result;

/// An image in device memory: a volume, or a picture of one or more layers.
pub struct Image {
    pub(super) gpu: Gpu,
    pub(super) handle: vk::Image,
    pub(super) view: vk::ImageView,
    /// `None` inside `Drop`, and for an external image.
    pub(super) allocation: Option<Allocation>,
    /// The layout in which its owner wants an external image back.
    pub(super) release_layout: Option<vk::ImageLayout>,
    pub(super) size: [u32; 3],
    pub(super) layers: u32,
    pub(super) format: Format,
    pub(super) name: String,
    pub(super) purpose: &'static str,
}

impl Image {
    /// Returns width, height and depth, texels.
    pub fn size(&self) -> [u32; 3] {
        self.size
    }

    /// Returns the number of layers of a picture; 1 for a volume.
    pub fn layers(&self) -> u32 {
        self.layers
    }

    /// Returns the format of the texels.
    pub fn format(&self) -> Format {
        self.format
    }

    /// Returns the name of the image.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the handle.
    pub(super) fn handle(&self) -> vk::Image {
        self.handle
    }

    /// Returns the region of all texels.
    pub(super) fn region(&self) -> vk::BufferImageCopy {
        vk::BufferImageCopy::default()
            .image_subresource(
                vk::ImageSubresourceLayers::default()
                    .aspect_mask(self.format.aspect())
                    .layer_count(self.layers),
            )
            .image_extent(vk::Extent3D { width: self.size[0], height: self.size[1], depth: self.size[2] })
    }

    /// Returns the number of texels of all layers.
    pub(super) fn texels(&self) -> usize {
        self.size.iter().map(|&n| n as usize).product::<usize>() * self.layers as usize
    }
}

impl Drop for Image {
    fn drop(&mut self) {
        let last = lock(&self.gpu.0.queue).last_value();
        let mut memory = lock(&self.gpu.0.memory);
        match self.allocation.take() {
            Some(allocation) => {
                memory.delete_after(last, Dropped::Image(self.handle, self.view), allocation, self.purpose);
            }
            None => memory.delete_view_after(last, self.view),
        }
    }
}

impl Gpu {
    /// Creates an image with undefined layout and content. Sizes were checked against the device's limits.
    #[expect(clippy::too_many_arguments, reason = "not public; the two callers fix most of them")]
    pub(super) fn raw_image(
        &self,
        name: &str,
        purpose: &'static str,
        format: Format,
        size: [u32; 3],
        layers: u32,
        kind: vk::ImageType,
        usage: vk::ImageUsageFlags,
    ) -> Result<Image> {
        let context: &Context = &self.0;
        let [width, height, depth] = size;
        let info = vk::ImageCreateInfo::default()
            .image_type(kind)
            .format(format.vk())
            .extent(vk::Extent3D { width, height, depth })
            .mip_levels(1)
            .array_layers(layers)
            .samples(vk::SampleCountFlags::TYPE_1)
            .tiling(vk::ImageTiling::OPTIMAL)
            .usage(usage)
            .sharing_mode(vk::SharingMode::EXCLUSIVE)
            .initial_layout(vk::ImageLayout::UNDEFINED);
        // SAFETY: the device is live; sizes were checked against its limits by the callers.
        let (handle, requirements) = unsafe {
            let handle = check(name, context.device.create_image(&info, None))?;
            (handle, context.device.get_image_memory_requirements(handle))
        };
        context.name(handle, name);
        let placement =
            Placement { name, purpose, requirements, location: MemoryLocation::GpuOnly, linear: false };
        let allocation = context.place(&placement, Dropped::Image(handle, vk::ImageView::null()))?;
        let (memory, offset) = {
            // SAFETY: read only to bind; the allocation outlives the image.
            unsafe { (allocation.memory(), allocation.offset()) }
        };
        // From here on `Drop` cleans up.
        let mut image = Image {
            gpu: Gpu(Arc::clone(&self.0)),
            handle,
            view: vk::ImageView::null(),
            allocation: Some(allocation),
            release_layout: None,
            size,
            layers,
            format,
            name: name.to_owned(),
            purpose,
        };
        // SAFETY: memory and offset are the allocator's answer to this image's requirements.
        check(name, unsafe { context.device.bind_image_memory(handle, memory, offset) })?;
        let view_kind = match kind {
            vk::ImageType::TYPE_3D => vk::ImageViewType::TYPE_3D,
            _ => vk::ImageViewType::TYPE_2D_ARRAY,
        };
        let view_info = vk::ImageViewCreateInfo::default()
            .image(handle)
            .view_type(view_kind)
            .format(format.vk())
            .subresource_range(whole(format));
        // SAFETY: the image is bound to memory and has the usage that the view inherits.
        image.view = check(name, unsafe { context.device.create_image_view(&view_info, None) })?;
        Ok(image)
    }
}

/// Returns the range of all layers of an image.
pub(super) fn whole(format: Format) -> vk::ImageSubresourceRange {
    vk::ImageSubresourceRange::default()
        .aspect_mask(format.aspect())
        .level_count(1)
        .layer_count(vk::REMAINING_ARRAY_LAYERS)
}
