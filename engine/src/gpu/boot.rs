//! Booting: its options, the trait of those who create instance and device, and the steps that lead to a
//! [`Gpu`].

use std::ffi::c_char;
use std::sync::Arc;

use ash::vk;
use raw_window_handle::HasDisplayHandle;

use super::features::{EXTENSIONS, Features};
use super::instance::Instance;
use super::{Context, DeviceDescription, Gpu, check, choice, description};
use crate::error::{Error, Kind, Result};

/// The options of booting.
#[derive(Clone, Debug, Default)]
pub struct GpuOptions {
    /// Index (as `vgs devices` prints it) or part of the name of the device; the best device if absent.
    pub device: Option<String>,
    /// True if the validation layer with synchronisation checks is on; booting fails if the layer is not
    /// installed.
    pub validation: bool,
    /// Largest storage-buffer range to plan with, bytes, as on a smaller device; for tests.
    pub storage_range_limit: Option<u64>,
    /// Number of the submission, counted from 1, at which the device behaves as lost; for tests.
    pub lost_at: Option<u64>,
    /// The windows in which pictures are shown, if any.
    pub windows: Option<Windows>,
}

/// The instance extensions that Vulkan needs to show pictures in the windows of a display.
#[derive(Clone, Debug)]
pub struct Windows(pub(super) &'static [*const c_char]);

// SAFETY: the pointers are to constant strings.
unsafe impl Send for Windows {}
// SAFETY: as above.
unsafe impl Sync for Windows {}

impl Windows {
    /// Returns the windows of this display. Fails if Vulkan cannot show pictures on it.
    pub fn of(display: &impl HasDisplayHandle) -> Result<Self> {
        let unavailable = |what: String| {
            Error::new(Kind::Unavailable, "VGS-GPU-007", what)
                .help("without a display, `vgs render` writes pictures to files")
        };
        let handle = display.display_handle().map_err(|e| unavailable(format!("no display: {e}")))?;
        ash_window::enumerate_required_extensions(handle.as_raw())
            .map(Windows)
            .map_err(|e| unavailable(format!("Vulkan has no windows on this display: {e}")))
    }
}

/// A creator of the instance and the device: the engine itself, or a runtime such as OpenXR that insists on
/// it.
pub trait Boot {
    /// Creates the Vulkan instance from the engine's create-info.
    fn create_instance(&self, entry: &ash::Entry, info: &vk::InstanceCreateInfo<'_>)
    -> Result<ash::Instance>;
    /// Returns the only device that the runtime allows, if it insists on one.
    fn required_device(&self, instance: &ash::Instance) -> Result<Option<vk::PhysicalDevice>>;
    /// Creates the device from the engine's create-info.
    fn create_device(
        &self,
        instance: &ash::Instance,
        physical: vk::PhysicalDevice,
        info: &vk::DeviceCreateInfo<'_>,
    ) -> Result<ash::Device>;
}

/// The engine itself as creator of instance and device.
pub(super) struct Own;

impl Boot for Own {
    fn create_instance(
        &self,
        entry: &ash::Entry,
        info: &vk::InstanceCreateInfo<'_>,
    ) -> Result<ash::Instance> {
        // SAFETY: `info` and all it points to live until the call returns.
        let instance = unsafe { entry.create_instance(info, None) };
        instance.map_err(|e| {
            Error::new(Kind::Unavailable, "VGS-GPU-002", format!("Vulkan refused an instance: {e}"))
                .help("a Vulkan driver must be installed; `tools/setup` brings a software driver (lavapipe)")
        })
    }

    fn required_device(&self, _: &ash::Instance) -> Result<Option<vk::PhysicalDevice>> {
        Ok(None)
    }

    fn create_device(
        &self,
        instance: &ash::Instance,
        physical: vk::PhysicalDevice,
        info: &vk::DeviceCreateInfo<'_>,
    ) -> Result<ash::Device> {
        // SAFETY: `physical` comes from `instance`; the extensions and features were checked to exist.
        check("creating the device", unsafe { instance.create_device(physical, info, None) })
    }
}

impl Gpu {
    /// Boots an instance and a device of its own. Callers that create their own (OpenXR) use
    /// [`Gpu::with_boot`].
    pub fn new(options: &GpuOptions) -> Result<Self> {
        Self::with_boot(&Own, options)
    }

    /// Boots with an instance and a device that `boot` creates.
    pub fn with_boot(boot: &dyn Boot, options: &GpuOptions) -> Result<Self> {
        let instance = Instance::new(boot, options.validation, options.windows.as_ref())?;
        let (physical, description) = choose(boot, options, &instance)?;
        let queue_family = description::queue_family(&instance.handle, physical).unwrap_or_default();
        let device = create_device(boot, options, &instance, physical, queue_family)?;
        Context::new(instance, physical, device, queue_family, description, options)
            .map(|context| Gpu(Arc::new(context)))
    }
}

/// Chooses the device that the runtime insists on, or else the one that the options ask for.
fn choose(
    boot: &dyn Boot,
    options: &GpuOptions,
    instance: &Instance,
) -> Result<(vk::PhysicalDevice, DeviceDescription)> {
    let physicals = instance.physical_devices()?;
    let list = description::describe_all(instance, &physicals);
    let chosen = match boot.required_device(&instance.handle)? {
        Some(p) => {
            let index = physicals.iter().position(|&q| q == p).map(|i| i.to_string());
            choice::choose(&list, index.as_deref())?
        }
        None => choice::choose(&list, options.device.as_deref())?,
    };
    let physical = physicals[chosen.index];
    let swapchain = ash::khr::swapchain::NAME;
    if options.windows.is_some() && !description::offers(&instance.handle, physical, swapchain) {
        return Err(Error::new(
            Kind::Unavailable,
            "VGS-GPU-008",
            format!("{} cannot show pictures in a window (VK_KHR_swapchain)", chosen.name),
        )
        .help("choose another --device, or write pictures to files with `vgs render`"));
    }
    Ok((physical, chosen.clone()))
}

/// Creates the device with one queue, the extensions and the features that the engine needs.
fn create_device(
    boot: &dyn Boot,
    options: &GpuOptions,
    instance: &Instance,
    physical: vk::PhysicalDevice,
    queue_family: u32,
) -> Result<ash::Device> {
    let priorities = [1.0];
    let queues =
        [vk::DeviceQueueCreateInfo::default().queue_family_index(queue_family).queue_priorities(&priorities)];
    let mut extensions: Vec<_> = EXTENSIONS.iter().map(|e| e.as_ptr()).collect();
    if options.windows.is_some() {
        extensions.push(ash::khr::swapchain::NAME.as_ptr());
    }
    let mut features = Features::needed();
    let info =
        vk::DeviceCreateInfo::default().queue_create_infos(&queues).enabled_extension_names(&extensions);
    boot.create_device(&instance.handle, physical, &features.chain(info))
}
