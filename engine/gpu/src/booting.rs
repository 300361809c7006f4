//! The steps that lead to a [`Gpu`].

use std::sync::Arc;

use ash::vk;

#[cfg(feature = "fault")]
use super::Fault;
use super::boot::Own;
use super::device_description::{describe_all, offers, queue_family};
use super::features::Features;
use super::instance::Instance;
use super::{Boot, Context, DeviceDescription, Gpu, GpuOptions, choice};
use base::error::{Error, Kind, Result};

impl Gpu {
    /// Boots an instance and a device of its own. Callers that create their own (OpenXR) use
    /// [`Gpu::with_boot`].
    pub fn new(options: &GpuOptions) -> Result<Self> {
        Self::with_boot(&Own, options)
    }

    /// Boots with an instance and a device that `boot` creates.
    pub fn with_boot(boot: &dyn Boot, options: &GpuOptions) -> Result<Self> {
        #[cfg_attr(not(feature = "fault"), expect(unused_mut, reason = "only a fault changes it"))]
        let mut instance = Instance::new(boot, options)?;
        let (physical, mut description) = choose(boot, options, &instance)?;
        description.subgroup_size = options.subgroup_size.unwrap_or(description.subgroup_size);
        let queue_family = queue_family(&instance.handle, physical).unwrap_or_default();
        let device = create_device(boot, options, &instance, physical, queue_family, false)?;
        #[cfg(feature = "fault")]
        let device = match Fault::in_force(options.fault.as_ref())? {
            Some(fault) => fault.install(&mut instance.handle, &device, queue_family),
            None => device,
        };
        let pushes = pushes_descriptors(options, &instance, physical);
        Context::new(instance, physical, device, queue_family, description, pushes, options)
            .map(|context| Gpu(Arc::new(context)))
    }
}

/// Chooses the device that the runtime insists on, or else the one that the options ask for.
pub(super) fn choose(
    boot: &dyn Boot,
    options: &GpuOptions,
    instance: &Instance,
) -> Result<(vk::PhysicalDevice, DeviceDescription)> {
    let physicals = instance.physical_devices()?;
    let list = describe_all(&instance.handle, &physicals);
    let chosen = match boot.required_device(&instance.handle)? {
        Some(p) => {
            let index = physicals.iter().position(|&q| q == p).map(|i| i.to_string());
            choice::choose(&list, index.as_deref())?
        }
        None => choice::choose(&list, options.device.as_deref())?,
    };
    let physical = physicals[chosen.index];
    let swapchain = ash::khr::swapchain::NAME;
    if options.windows.is_some() && !offers(&instance.handle, physical, swapchain) {
        return Err(Error::new(
            Kind::Unavailable,
            "VGS-GPU-008",
            format!("{} cannot show pictures in a window (VK_KHR_swapchain)", chosen.name),
        )
        .help("choose another --device, or write pictures to files with `vgs render`"));
    }
    Ok((physical, chosen.clone()))
}

/// Returns true if passes push their descriptors with the commands.
pub(super) fn pushes_descriptors(
    options: &GpuOptions,
    instance: &Instance,
    physical: vk::PhysicalDevice,
) -> bool {
    !options.descriptor_pools && offers(&instance.handle, physical, ash::khr::push_descriptor::NAME)
}

/// Creates the device with one queue, the extensions and the features that the engine needs; if it `compiles`
/// only, also those by which it tells what it made.
pub(super) fn create_device(
    boot: &dyn Boot,
    options: &GpuOptions,
    instance: &Instance,
    physical: vk::PhysicalDevice,
    queue_family: u32,
    compiles: bool,
) -> Result<ash::Device> {
    let priorities = [1.0];
    let queues =
        [vk::DeviceQueueCreateInfo::default().queue_family_index(queue_family).queue_priorities(&priorities)];
    let mut extensions = Vec::new();
    if pushes_descriptors(options, instance, physical) {
        extensions.push(ash::khr::push_descriptor::NAME.as_ptr());
    }
    if options.windows.is_some() {
        extensions.push(ash::khr::swapchain::NAME.as_ptr());
    }
    if compiles {
        extensions.push(ash::khr::pipeline_executable_properties::NAME.as_ptr());
    }
    let mut features = Features::needed();
    let info =
        vk::DeviceCreateInfo::default().queue_create_infos(&queues).enabled_extension_names(&extensions);
    let mut told =
        vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default().pipeline_executable_info(true);
    let mut info = features.chain(info);
    if compiles {
        info = info.push_next(&mut told);
    }
    boot.create_device(&instance.handle, physical, &info)
}
