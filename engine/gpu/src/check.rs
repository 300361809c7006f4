//! Conversion of Vulkan results into errors.

use ash::vk;

use base::error::{Error, Kind, Result};

/// Turns a Vulkan result into an error that says what was being done.
pub(super) fn check<T>(doing: &str, result: ash::prelude::VkResult<T>) -> Result<T> {
    result.map_err(|e| match e {
        vk::Result::ERROR_OUT_OF_DEVICE_MEMORY => {
            Error::new(Kind::Temporary, "VGS-GPU-010", format!("{doing}: out of device memory"))
                .help("close other programs that use the GPU, use fewer splats or a smaller ROI")
        }
        vk::Result::ERROR_OUT_OF_HOST_MEMORY => out_of_host_memory(doing),
        vk::Result::ERROR_DEVICE_LOST => {
            Error::new(Kind::Temporary, "VGS-GPU-012", format!("{doing}: the device was lost"))
                .help("run it again; if it happens again, update the driver or choose another --device")
        }
        vk::Result::ERROR_SURFACE_LOST_KHR => {
            Error::new(Kind::Temporary, "VGS-GPU-034", format!("{doing}: the window's surface was lost"))
                .help("run it again")
        }
        e => Error::new(Kind::Internal, "VGS-GPU-013", format!("{doing}: Vulkan said {e}")),
    })
}

/// Creates the error of a host without memory.
pub(super) fn out_of_host_memory(doing: &str) -> Error {
    Error::new(Kind::HostMemory, "VGS-GPU-011", format!("{doing}: out of host memory"))
}
