//! Images on explicit memory: volumes that are sampled, and pictures that passes write. They stay in the general layout
//! from birth on, so that nobody keeps track of layouts.
//!
//! A foreign picture is one of a swapchain: somebody else owns it and lends it for a frame. It is in the general
//! layout between [`Recorder::borrow_image`] and [`Recorder::return_image`], and in no layout that matters outside.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use ash::vk;
use bytemuck::Pod;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme};

use super::memory::Remains;
use super::{Context, Gpu, Recorder, check, lock};
use crate::error::{Error, Kind, Result};

/// What a texel is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Four 32-bit floats.
    Rgba32f,
    /// Four 16-bit floats.
    Rgba16f,
    /// One 32-bit float.
    R32f,
    /// One byte, a fraction 0 to 1.
    R8,
    /// One 16-bit fraction, 0 to 1.
    R16,
    /// Two 16-bit fractions, 0 to 1.
    Rg16,
    /// Four bytes, fractions 0 to 1, as they are.
    Rgba8,
    /// The same with blue first: what most screens take.
    Bgra8,
    /// Four bytes that hold sRGB: passes read and write linear light.
    Srgba8,
    /// The same with blue first.
    Sbgra8,
    /// One 32-bit float of depth, which drawings write as they write no other.
    D32f,
}

impl Format {
    pub(super) fn vk(self) -> vk::Format {
        match self {
            Format::Rgba32f => vk::Format::R32G32B32A32_SFLOAT,
            Format::Rgba16f => vk::Format::R16G16B16A16_SFLOAT,
            Format::R32f => vk::Format::R32_SFLOAT,
            Format::R8 => vk::Format::R8_UNORM,
            Format::R16 => vk::Format::R16_UNORM,
            Format::Rg16 => vk::Format::R16G16_UNORM,
            Format::Rgba8 => vk::Format::R8G8B8A8_UNORM,
            Format::Bgra8 => vk::Format::B8G8R8A8_UNORM,
            Format::Srgba8 => vk::Format::R8G8B8A8_SRGB,
            Format::Sbgra8 => vk::Format::B8G8R8A8_SRGB,
            Format::D32f => vk::Format::D32_SFLOAT,
        }
    }

    /// Whether it is depth rather than colour.
    pub fn is_depth(self) -> bool {
        self == Format::D32f
    }

    pub(super) fn aspect(self) -> vk::ImageAspectFlags {
        if self.is_depth() { vk::ImageAspectFlags::DEPTH } else { vk::ImageAspectFlags::COLOR }
    }

    /// Whether passes see linear light where memory holds sRGB.
    pub fn is_srgb(self) -> bool {
        matches!(self, Format::Srgba8 | Format::Sbgra8)
    }

    /// Bytes of a texel.
    pub fn bytes(self) -> usize {
        match self {
            Format::Rgba32f => 16,
            Format::Rgba16f => 8,
            Format::R32f | Format::Rg16 | Format::D32f => 4,
            Format::Rgba8 | Format::Bgra8 | Format::Srgba8 | Format::Sbgra8 => 4,
            Format::R16 => 2,
            Format::R8 => 1,
        }
    }
}

/// An image in device memory: a volume, or a picture of one or more layers.
pub struct Image {
    gpu: Gpu,
    handle: vk::Image,
    pub(super) view: vk::ImageView,
    /// `None` inside `Drop`, and where somebody else owns the image.
    allocation: Option<Allocation>,
    /// The layout in which the owner wants it back, where that is somebody else.
    pub(super) lent_in: Option<vk::ImageLayout>,
    size: [u32; 3],
    layers: u32,
    pub(super) format: Format,
    name: String,
    purpose: &'static str,
}

impl Image {
    /// Width, height and depth, texels.
    pub fn size(&self) -> [u32; 3] {
        self.size
    }

    /// Layers of a picture; 1 for a volume.
    pub fn layers(&self) -> u32 {
        self.layers
    }

    /// What a texel is made of.
    pub fn format(&self) -> Format {
        self.format
    }

    /// Name of the image.
    pub fn name(&self) -> &str {
        &self.name
    }

    pub(super) fn handle(&self) -> vk::Image {
        self.handle
    }

    fn region(&self) -> vk::BufferImageCopy {
        vk::BufferImageCopy::default()
            .image_subresource(
                vk::ImageSubresourceLayers::default()
                    .aspect_mask(self.format.aspect())
                    .layer_count(self.layers),
            )
            .image_extent(vk::Extent3D { width: self.size[0], height: self.size[1], depth: self.size[2] })
    }

    fn texels(&self) -> usize {
        self.size.iter().map(|&n| n as usize).product::<usize>() * self.layers as usize
    }

    /// Reads all texels back, layer after layer, x fastest. Waits for the device.
    ///
    /// # Panics
    /// If `T` has not the size of a texel.
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

impl Recorder {
    /// Overwrites a rectangle of a picture of one layer, from `corner` on, with what `texels` holds, rows from the top.
    ///
    /// # Panics
    /// If the rectangle is not inside, or `texels` is not one `T` of a texel's size for each texel of it.
    pub fn write_rectangle<T: Pod>(
        &mut self,
        image: &mut Image,
        corner: [u32; 2],
        size: [u32; 2],
        texels: &[T],
    ) -> Result<()> {
        let name = &image.name;
        assert_eq!(size_of::<T>(), image.format.bytes(), "{name}: texels differ in size");
        assert_eq!(texels.len(), (size[0] * size[1]) as usize, "{name}: number of texels");
        assert!(
            (0..2).all(|i| corner[i] + size[i] <= image.size[i]) && image.layers == 1,
            "{name}: a rectangle outside"
        );
        let staging = self.gpu.staged(&format!("{name} upload"), texels)?;
        let region = image
            .region()
            .image_offset(vk::Offset3D { x: corner[0] as i32, y: corner[1] as i32, z: 0 })
            .image_extent(vk::Extent3D { width: size[0], height: size[1], depth: 1 });
        self.fill_image(&staging, image, region);
        self.keep(staging);
        Ok(())
    }
}

impl Drop for Image {
    fn drop(&mut self) {
        let last = lock(&self.gpu.0.queue).last_value();
        let mut memory = lock(&self.gpu.0.memory);
        match self.allocation.take() {
            Some(allocation) => {
                memory.retire(last, Remains::Image(self.handle, self.view), allocation, self.purpose);
            }
            None => memory.retire_view(last, self.view),
        }
    }
}

impl Gpu {
    /// A volume of `size` texels to be sampled with trilinear interpolation and clamped at its faces; all zero.
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

    /// A picture of `size` pixels and so many layers that kernels write and drawings are drawn to; all zero.
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
        // Kernels write floats; few devices let them write what screens take.
        if matches!(format, Format::Rgba32f | Format::Rgba16f | Format::R32f) {
            usage |= vk::ImageUsageFlags::STORAGE;
        }
        self.image(name, purpose, format, [size[0], size[1], 1], layers, vk::ImageType::TYPE_2D, usage)
    }

    /// A picture that somebody else owns, such as an image of a swapchain.
    ///
    /// # Safety
    /// `handle` is an image of this device with so many layers of this format and size, made for attachments of its kind,
    /// colour or depth; its owner wants it back in the layout `lent_in`, and keeps it until this picture was dropped and
    /// the device has finished with it.
    pub unsafe fn foreign_picture(
        &self,
        name: &str,
        handle: vk::Image,
        format: Format,
        size: [u32; 2],
        layers: u32,
        lent_in: vk::ImageLayout,
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
            lent_in: Some(lent_in),
            size: [size[0], size[1], 1],
            layers,
            format,
            name: name.to_owned(),
            purpose: "of others",
        })
    }

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
        let mut image = Image {
            gpu: Gpu(Arc::clone(&self.0)),
            handle,
            view: vk::ImageView::null(),
            allocation: None,
            lent_in: None,
            size,
            layers,
            format,
            name: name.to_owned(),
            purpose,
        };
        let placed = lock(&context.memory).allocate(
            &AllocationCreateDesc {
                name,
                requirements,
                location: MemoryLocation::GpuOnly,
                linear: false,
                allocation_scheme: AllocationScheme::GpuAllocatorManaged,
            },
            purpose,
        );
        let allocation = match placed {
            Ok(allocation) => allocation,
            Err(e) => {
                // SAFETY: the image was never used; without an allocation its `Drop` does nothing.
                unsafe { context.device.destroy_image(handle, None) };
                return Err(e);
            }
        };
        let (memory, offset) = {
            // SAFETY: read only to bind; the allocation outlives the image.
            unsafe { (allocation.memory(), allocation.offset()) }
        };
        context.counters.allocations.fetch_add(1, Ordering::Relaxed);
        // From here on `Drop` cleans up.
        image.allocation = Some(allocation);
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

/// All layers of an image.
pub(super) fn whole(format: Format) -> vk::ImageSubresourceRange {
    vk::ImageSubresourceRange::default()
        .aspect_mask(format.aspect())
        .level_count(1)
        .layer_count(vk::REMAINING_ARRAY_LAYERS)
}
