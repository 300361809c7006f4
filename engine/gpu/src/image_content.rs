//! What images hold: zeros at first, then what the host writes and reads back.

use ash::vk;
use bytemuck::Pod;

use super::{Format, Gpu, Image};
use base::error::{Error, Kind, Result};

impl Image {
    /// Reads all texels back, layer after layer, x fastest. Waits for the device.
    ///
    /// # Panics
    /// If `T` does not have the size of a texel.
    pub fn read<T: Pod>(&self) -> Result<Vec<T>> {
        assert_eq!(size_of::<T>(), self.format().bytes(), "{}: texels differ in size", self.name());
        let staging = self.gpu.readback::<T>(&format!("{} read back", self.name()), self.texels())?;
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
        assert_eq!(size_of::<T>(), self.format().bytes(), "{}: texels differ in size", self.name());
        assert_eq!(data.len(), self.texels(), "{}: number of texels", self.name());
        let staging = self.gpu.staged(&format!("{} upload", self.name()), data)?;
        let mut recorder = self.gpu.record()?;
        recorder.fill_image(&staging, self, self.region());
        let ticket = recorder.submit()?;
        self.gpu.wait(ticket)
    }
}

impl Gpu {
    /// Creates a volume of `size` texels, all zero, that is sampled with trilinear interpolation and clamped
    /// at its faces. Kernels can write to one of halves.
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
        let mut usage = vk::ImageUsageFlags::SAMPLED
            | vk::ImageUsageFlags::TRANSFER_DST
            | vk::ImageUsageFlags::TRANSFER_SRC;
        if format == Format::Rgba16f {
            usage |= vk::ImageUsageFlags::STORAGE;
        }
        let image = self.raw_image(name, purpose, format, size, 1, vk::ImageType::TYPE_3D, usage)?;
        self.begun(image)
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
        let (size, kind) = ([size[0], size[1], 1], vk::ImageType::TYPE_2D);
        let image = self.raw_image(name, purpose, format, size, layers, kind, usage)?;
        self.begun(image)
    }

    /// Brings a new image into the general layout, all zero.
    fn begun(&self, image: Image) -> Result<Image> {
        let mut recorder = self.record()?;
        recorder.begin_image(&image);
        recorder.submit()?;
        Ok(image)
    }
}
