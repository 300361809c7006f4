//! A device that compiles and never runs: what its compiler makes of pipelines, in registers and instructions.
//!
//! A driver may do that for hardware that is not there. Mesa's RADV has a null device for every AMD GPU
//! that it knows; but its queue and its semaphores do not work, so that [`super::Gpu`] cannot be booted on it.

use std::ffi::{CStr, c_char};

use ash::{khr, vk};
use serde::{Deserialize, Serialize};

use super::boot::Own;
use super::booting::{choose, create_device, pushes_descriptors};
use super::device_description::{offers, queue_family};
use super::instance::Instance;
use super::pipeline_creation::Builder;
use super::{GpuOptions, Recipe, check, drawing, kernel};
use base::error::{Error, Kind, Result};

/// A device that compiles.
pub struct Compiler {
    /// Name of the device.
    pub name: String,
    /// Driver and its version.
    pub driver: String,
    device: ash::Device,
    pushes: bool,
    executables: khr::pipeline_executable_properties::Device,
    // Dropped last.
    _instance: Instance,
}

/// What a compiler made of one stage of a pipeline.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Executable {
    /// Stage, as the driver calls it.
    pub stage: String,
    /// Invocations that run in lockstep.
    pub subgroup_size: u32,
    /// Figures with the names that the driver gives them.
    pub figures: Vec<(String, f64)>,
}

impl Compiler {
    /// Creates the device that `options` choose.
    ///
    /// # Errors
    /// Returns [`Kind::Unavailable`] if there is no such device, or if it does not tell what it compiles
    /// (`VK_KHR_pipeline_executable_properties`).
    pub fn new(options: &GpuOptions) -> Result<Self> {
        let instance = Instance::new(&Own, options)?;
        let (physical, description) = choose(&Own, options, &instance)?;
        let extension = khr::pipeline_executable_properties::NAME;
        if !offers(&instance.handle, physical, extension) {
            let message = format!("{} does not tell what it compiles", description.name);
            return Err(Error::new(Kind::Unavailable, "VGS-GPU-032", message)
                .help("a driver with VK_KHR_pipeline_executable_properties is needed"));
        }
        let family = queue_family(&instance.handle, physical).unwrap_or_default();
        let device = create_device(&Own, options, &instance, physical, family, true)?;
        let executables = khr::pipeline_executable_properties::Device::new(&instance.handle, &device);
        let pushes = pushes_descriptors(options, &instance, physical);
        let (name, driver) = (description.name, description.driver);
        Ok(Compiler { name, driver, device, pushes, executables, _instance: instance })
    }

    /// Compiles a pipeline and returns what was made of its stages.
    ///
    /// # Errors
    /// Returns [`Kind::Usage`] if the recipe names no pipeline, or the error of the driver.
    pub fn compile(&self, recipe: &Recipe) -> Result<Vec<Executable>> {
        let flags = vk::PipelineCreateFlags::CAPTURE_STATISTICS_KHR;
        let builder =
            Builder { device: &self.device, cache: vk::PipelineCache::null(), flags, pushes: self.pushes };
        let shaders = recipe.found()?;
        let pipeline = match (&shaders[..], &recipe.targets) {
            (&[vertex, fragment], Some(targets)) => {
                drawing::make(builder, [vertex, fragment], &recipe.constants, targets)?.0
            }
            _ => kernel::make(builder, shaders[0], &recipe.constants)?,
        };
        let told = self.executables(pipeline.handle);
        pipeline.destroy(&self.device);
        told
    }

    /// Asks what was made of a pipeline.
    fn executables(&self, pipeline: vk::Pipeline) -> Result<Vec<Executable>> {
        let doing = "asking what was compiled";
        let info = vk::PipelineInfoKHR::default().pipeline(pipeline);
        // SAFETY: the pipeline is live and was created with CAPTURE_STATISTICS.
        let stages = unsafe { self.executables.get_pipeline_executable_properties(&info) };
        let figures = |index: usize| {
            let info =
                vk::PipelineExecutableInfoKHR::default().pipeline(pipeline).executable_index(index as u32);
            // SAFETY: as above, and there are so many executables.
            let told = unsafe { self.executables.get_pipeline_executable_statistics(&info) };
            Ok(check(doing, told)?.iter().map(|row| (text(&row.name), value(row))).collect())
        };
        let executable = |(index, row): (usize, &vk::PipelineExecutablePropertiesKHR<'_>)| {
            Ok(Executable {
                stage: text(&row.name),
                subgroup_size: row.subgroup_size,
                figures: figures(index)?,
            })
        };
        check(doing, stages)?.iter().enumerate().map(executable).collect()
    }
}

impl Drop for Compiler {
    fn drop(&mut self) {
        // SAFETY: nothing was submitted, and all pipelines were destroyed.
        unsafe { self.device.destroy_device(None) };
    }
}

/// Returns a text of the driver's.
fn text(bytes: &[c_char]) -> String {
    // The conversion is to u8 on some systems and nothing on others.
    let bytes: Vec<u8> = bytes.iter().map(|&c| c as u8).collect();
    CStr::from_bytes_until_nul(&bytes).map_or_else(|_| String::new(), |c| c.to_string_lossy().into_owned())
}

/// Returns a figure of the driver's as a number.
fn value(row: &vk::PipelineExecutableStatisticKHR<'_>) -> f64 {
    // SAFETY: the format says which of the union's fields was written.
    unsafe {
        match row.format {
            vk::PipelineExecutableStatisticFormatKHR::UINT64 => row.value.u64 as f64,
            vk::PipelineExecutableStatisticFormatKHR::INT64 => row.value.i64 as f64,
            vk::PipelineExecutableStatisticFormatKHR::FLOAT64 => row.value.f64,
            _ => f64::from(row.value.b32),
        }
    }
}
