//! The devices of this machine.

use super::boot::Own;
use super::device_description::describe_all;
use super::instance::Instance;
use super::{DeviceDescription, GpuOptions};
use base::error::Result;

/// Lists all Vulkan devices of this machine, usable or not.
pub fn devices() -> Result<Vec<DeviceDescription>> {
    let instance = Instance::new(&Own, &GpuOptions::default())?;
    Ok(describe_all(&instance.handle, &instance.physical_devices()?))
}
