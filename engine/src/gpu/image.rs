//! Images on explicit memory: volumes that are sampled, and pictures that passes write. They stay in the
//! general layout from their creation on, so that nobody keeps track of layouts.

use std::sync::Arc;

use ash::vk;
use bytemuck::Pod;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::Allocation;

use super::memory::{Dropped, Placement};
use super::{Context, Format, Gpu, check, lock};
use crate::error::{Error, Kind, Result};

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
    fn texels(&self) -> usize {
        self.size.iter().map(|&n| n as usize).product::<usize>() * self.layers as usize
    }

    /// Reads all texels back, layer after layer, x fastest. Waits for the device.
    ///
    /// # Panics
    /// If `T` does not have the size of a texel.
    pub fn read<T: Pod>(&self) -> Result<Vec<T>> {
        assert_eq!(size_of::<T>(), self.format.bytes(), "{}: texels differ in size", self.name);
        let staging = self.gpu.readback::<T>(&format!("{} read back", self.name), self.texels())?;
        let mut recorder = self.gpu.record()?;
        recorder.copy_image(self, &staging, self.region());
        let ticket = recorder.submit()?;
        self.gpu.wait(ticket)?;
        Ok(staging.mapped()?.to_vec())
    }

    /// Overwrites all texels. Waits for the device.
    ///
    /// # Panics
    /// If `data` is not one `T` of a texel's size for every texel.
    pub fn write<T: Pod>(&mut self, data: &[T]) -> Result<()> {
        assert_eq!(size_of::<T>(), self.format.bytes(), "{}: texels differ in size", self.name);
        assert_eq!(data.len(), self.texels(), "{}: number of texels", self.name);
        let staging = self.gpu.staged(&format!("{} upload", self.name), data)?;
        let mut recorder = self.gpu.record()?;
        recorder.fill_image(&staging, self, self.region());
        let ticket = recorder.submit()?;
        self.gpu.wait(ticket)
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
    /// Creates a volume of `size` texels, all zero, that is sampled with trilinear interpolation and clamped
    /// at its faces.
    pub fn volume(&self, name: &str, purpose: &'static str, format: Format, size: [u32; 3]) -> Result<Image> {
        let most = self.0.limits.volume_edge;
        if size.iter().any(|&n| n > most) {
            return Err(Error::new(
                Kind::Unavailable,
                "VGS-GPU-026",
                format!(
                    "{name} has {size:?} voxels; {} samples at most {most} along an axis",
                    self.0.description.name
                ),
            )
            .help("use a smaller region of interest or a coarser volume"));
        }
        if !self.0.limits.filters_fractions {
            return Err(Error::new(
                Kind::Unavailable,
                "VGS-GPU-028",
                format!("{} does not interpolate volumes of 16 bits", self.0.description.name),
            )
            .help("render the splats, or choose another --device"));
        }
        let usage = vk::ImageUsageFlags::SAMPLED
            | vk::ImageUsageFlags::TRANSFER_DST
            | vk::ImageUsageFlags::TRANSFER_SRC;
        self.image(name, purpose, format, size, 1, vk::ImageType::TYPE_3D, usage)
    }

    /// Creates a picture of `size` pixels and `layers` layers, all zero, that kernels write and drawings are
    /// drawn to.
    pub fn picture(
        &self,
        name: &str,
        purpose: &'static str,
        format: Format,
        size: [u32; 2],
        layers: u32,
    ) -> Result<Image> {
        let most = self.0.limits.picture_edge;
        if size.iter().any(|&n| n > most || n == 0) {
            return Err(Error::new(
                Kind::Unavailable,
                "VGS-GPU-027",
                format!(
                    "a picture of {}x{} pixels; {} draws 1 to {most} along an axis",
                    size[0], size[1], self.0.description.name
                ),
            )
            .help("choose another --size"));
        }
        let attachment = match format.is_depth() {
            true => vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT,
            false => vk::ImageUsageFlags::COLOR_ATTACHMENT,
        };
        let mut usage = attachment
            | vk::ImageUsageFlags::SAMPLED
            | vk::ImageUsageFlags::TRANSFER_DST
            | vk::ImageUsageFlags::TRANSFER_SRC;
        // Kernels write floats; few devices let them write the formats of screens.
        if matches!(format, Format::Rgba32f | Format::Rgba16f | Format::R32f) {
            usage |= vk::ImageUsageFlags::STORAGE;
        }
        self.image(name, purpose, format, [size[0], size[1], 1], layers, vk::ImageType::TYPE_2D, usage)
    }

    /// Creates an image in the general layout, all zero.
    #[expect(clippy::too_many_arguments, reason = "private; the two callers above fix most of them")]
    fn image(
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
        let mut recorder = self.record()?;
        recorder.begin_image(&image);
        recorder.submit()?;
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
