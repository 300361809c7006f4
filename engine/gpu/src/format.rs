//! Formats of texels.

use ash::vk;
use serde::{Deserialize, Serialize};

/// Format of a texel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Format {
    /// Four 32-bit floats.
    Rgba32f,
    /// Four 16-bit floats.
    Rgba16f,
    /// One 32-bit float.
    R32f,
    /// One byte, a fraction 0 to 1.
    R8,
    /// Two bytes, fractions 0 to 1.
    Rg8,
    /// One 16-bit fraction, 0 to 1.
    R16,
    /// Two 16-bit fractions, 0 to 1.
    Rg16,
    /// Four bytes, fractions 0 to 1, without a conversion.
    Rgba8,
    /// [`Format::Rgba8`] with blue first, as most screens take it.
    Bgra8,
    /// Four bytes that hold sRGB; passes read and write linear light.
    Srgba8,
    /// [`Format::Srgba8`] with blue first.
    Sbgra8,
    /// One 32-bit float of depth; only drawings write it.
    D32f,
}

impl Format {
    /// Returns the Vulkan format.
    pub(super) fn vk(self) -> vk::Format {
        match self {
            Format::Rgba32f => vk::Format::R32G32B32A32_SFLOAT,
            Format::Rgba16f => vk::Format::R16G16B16A16_SFLOAT,
            Format::R32f => vk::Format::R32_SFLOAT,
            Format::R8 => vk::Format::R8_UNORM,
            Format::Rg8 => vk::Format::R8G8_UNORM,
            Format::R16 => vk::Format::R16_UNORM,
            Format::Rg16 => vk::Format::R16G16_UNORM,
            Format::Rgba8 => vk::Format::R8G8B8A8_UNORM,
            Format::Bgra8 => vk::Format::B8G8R8A8_UNORM,
            Format::Srgba8 => vk::Format::R8G8B8A8_SRGB,
            Format::Sbgra8 => vk::Format::B8G8R8A8_SRGB,
            Format::D32f => vk::Format::D32_SFLOAT,
        }
    }

    /// Returns true if it is depth rather than colour.
    pub fn is_depth(self) -> bool {
        self == Format::D32f
    }

    /// Returns the aspect of all images of this format.
    pub(super) fn aspect(self) -> vk::ImageAspectFlags {
        if self.is_depth() { vk::ImageAspectFlags::DEPTH } else { vk::ImageAspectFlags::COLOR }
    }

    /// Returns true if memory holds sRGB and passes see linear light.
    pub fn is_srgb(self) -> bool {
        matches!(self, Format::Srgba8 | Format::Sbgra8)
    }

    /// Returns the size of a texel, bytes.
    pub fn bytes(self) -> usize {
        match self {
            Format::Rgba32f => 16,
            Format::Rgba16f => 8,
            Format::R32f | Format::Rg16 | Format::D32f => 4,
            Format::Rgba8 | Format::Bgra8 | Format::Srgba8 | Format::Sbgra8 => 4,
            Format::R16 => 2,
            Format::R8 => 1,
            Format::Rg8 => 2,
        }
    }
}
