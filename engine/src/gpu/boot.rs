//! Instance and device: what is there, what is needed, and what is missing.

use std::ffi::{CStr, CString, c_char, c_void};
use std::path::PathBuf;
use std::sync::{Arc, Mutex};

use ash::vk;
use raw_window_handle::HasDisplayHandle;
use serde::Serialize;

use super::{Context, Counters, Gpu, Limits, check, lock, memory, submissions};
use crate::error::{Error, Kind, Result};

/// How to boot.
#[derive(Clone, Debug, Default)]
pub struct GpuOptions {
    /// Index (as `vgs devices` prints it) or part of the name of the device; the best one when absent.
    pub device: Option<String>,
    /// Turns on the validation layer with synchronisation checks; an error when the layer is not installed.
    pub validation: bool,
    /// Plans with a storage-buffer range of at most so many bytes, as a smaller device has; for tests.
    pub storage_range_limit: Option<u64>,
    /// Behaves as a device that is lost at this submission, counted from 1; for tests.
    pub lost_at: Option<u64>,
    /// What pictures are to be shown in, if in anything.
    pub windows: Option<Windows>,
}

/// The windows of a display, as far as booting needs to know them: what Vulkan calls them.
#[derive(Clone, Debug)]
pub struct Windows(&'static [*const c_char]);

// SAFETY: the pointers are to constant strings.
unsafe impl Send for Windows {}
// SAFETY: as above.
unsafe impl Sync for Windows {}

impl Windows {
    /// Those of this display.
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

/// One Vulkan device as it describes itself.
#[derive(Clone, Debug, Serialize)]
pub struct DeviceDescription {
    /// Place in the list of devices.
    pub index: usize,
    /// Name, such as "llvmpipe (LLVM 19.1.7, 256 bits)".
    pub name: String,
    /// "discrete GPU", "integrated GPU", "virtual GPU", "CPU" or "other".
    pub kind: &'static str,
    /// Driver name and version text.
    pub driver: String,
    /// Vulkan version of the device, "1.3.255".
    pub api: String,
    /// Bytes of all device-local heaps.
    pub memory_bytes: u64,
    /// Invocations that run in lockstep; informative, nothing assumes it.
    pub subgroup_size: u32,
    /// Largest storage-buffer binding, bytes.
    pub max_storage_range: u64,
    /// What this device lacks of what the engine needs; empty when it can be used.
    pub missing: Vec<String>,
}

/// Who creates the instance and the device: the engine itself, or a runtime such as OpenXR that insists on it.
pub trait Boot {
    /// Creates the Vulkan instance from the engine's create-info.
    fn create_instance(&self, entry: &ash::Entry, info: &vk::InstanceCreateInfo<'_>)
    -> Result<ash::Instance>;
    /// The only device the runtime allows, if it insists on one.
    fn required_device(&self, instance: &ash::Instance) -> Result<Option<vk::PhysicalDevice>>;
    /// Creates the device from the engine's create-info.
    fn create_device(
        &self,
        instance: &ash::Instance,
        physical: vk::PhysicalDevice,
        info: &vk::DeviceCreateInfo<'_>,
    ) -> Result<ash::Device>;
}

/// The engine boots Vulkan itself.
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

const VALIDATION: &CStr = c"VK_LAYER_KHRONOS_validation";
const EXTENSIONS: [&CStr; 1] = [ash::khr::push_descriptor::NAME];
const API: u32 = vk::API_VERSION_1_3;

/// The instance with its loader and message catcher; destroyed after the device.
pub(super) struct Instance {
    pub(super) entry: ash::Entry,
    pub(super) handle: ash::Instance,
    messenger: Option<(ash::ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    messages: Box<Messages>,
}

type Messages = Mutex<Vec<String>>;

impl Instance {
    fn new(boot: &dyn Boot, validation: bool, windows: Option<&Windows>) -> Result<Self> {
        // SAFETY: loading the Vulkan loader runs its initialisers; it is the system's own library.
        let entry = unsafe { ash::Entry::load() }.map_err(|e| {
            Error::new(Kind::Unavailable, "VGS-GPU-001", format!("no Vulkan loader: {e}"))
                .help("install a Vulkan driver, or run through tools/vgs, which brings a software driver")
        })?;
        // SAFETY: plain enumeration.
        let layers = unsafe { entry.enumerate_instance_layer_properties() }.unwrap_or_default();
        if validation && !layers.iter().any(|l| l.layer_name_as_c_str() == Ok(VALIDATION)) {
            return Err(Error::new(
                Kind::Unavailable,
                "VGS-GPU-003",
                "the validation layer VK_LAYER_KHRONOS_validation is not installed",
            )
            .help("`tools/setup test` installs it"));
        }
        let layer_names: Vec<_> = validation.then_some(VALIDATION.as_ptr()).into_iter().collect();
        // SAFETY: plain enumeration.
        let offered = unsafe { entry.enumerate_instance_extension_properties(None) }.unwrap_or_default();
        let debug = validation
            || offered.iter().any(|e| e.extension_name_as_c_str() == Ok(ash::ext::debug_utils::NAME));
        let mut extensions: Vec<_> =
            debug.then_some(ash::ext::debug_utils::NAME.as_ptr()).into_iter().collect();
        extensions.extend(windows.iter().flat_map(|windows| windows.0));

        let app =
            vk::ApplicationInfo::default().application_name(c"vgs").engine_name(c"vgs").api_version(API);
        let messages: Box<Messages> = Box::default();
        let mut messenger_info = vk::DebugUtilsMessengerCreateInfoEXT::default()
            .message_severity(
                vk::DebugUtilsMessageSeverityFlagsEXT::ERROR | vk::DebugUtilsMessageSeverityFlagsEXT::WARNING,
            )
            .message_type(
                vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION
                    | vk::DebugUtilsMessageTypeFlagsEXT::PERFORMANCE,
            )
            .pfn_user_callback(Some(on_message))
            .user_data(std::ptr::from_ref::<Messages>(&messages) as *mut c_void);
        let enables = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&enables);
        let mut info = vk::InstanceCreateInfo::default()
            .application_info(&app)
            .enabled_layer_names(&layer_names)
            .enabled_extension_names(&extensions);
        if validation {
            info = info.push_next(&mut features).push_next(&mut messenger_info);
        }
        let handle = boot.create_instance(&entry, &info)?;
        let messenger = validation
            .then(|| {
                let utils = ash::ext::debug_utils::Instance::new(&entry, &handle);
                messenger_info.p_next = std::ptr::null();
                // SAFETY: `messages` is boxed and outlives the messenger, which `destroy_device` removes first.
                let made = unsafe { utils.create_debug_utils_messenger(&messenger_info, None) };
                check("creating the message catcher", made).map(|m| (utils, m))
            })
            .transpose()?;
        Ok(Instance { entry, handle, messenger, messages })
    }

    pub(super) fn messages(&self) -> Vec<String> {
        lock(&self.messages).clone()
    }

    fn physical_devices(&self) -> Result<Vec<vk::PhysicalDevice>> {
        // SAFETY: plain enumeration on a live instance.
        check("listing Vulkan devices", unsafe { self.handle.enumerate_physical_devices() })
    }

    /// Destroys the device, the messenger and the instance, in that order.
    ///
    /// # Safety
    /// Nothing made from `device` may be in use.
    pub(super) unsafe fn destroy_device(&self, device: &ash::Device) {
        // SAFETY: the caller says that nothing of the device is in use; the instance outlives its device.
        unsafe {
            device.destroy_device(None);
            self.destroy();
        }
    }

    /// # Safety
    /// No device of this instance may be alive.
    unsafe fn destroy(&self) {
        // SAFETY: as the caller promises.
        unsafe {
            if let Some((utils, messenger)) = &self.messenger {
                utils.destroy_debug_utils_messenger(*messenger, None);
            }
            self.handle.destroy_instance(None);
        }
    }
}

unsafe extern "system" fn on_message(
    _: vk::DebugUtilsMessageSeverityFlagsEXT,
    _: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the layer passes valid callback data, and `user` is the boxed message list of a live instance.
    let (text, messages) = unsafe {
        let text = (*data).message_as_c_str().map(|t| t.to_string_lossy().into_owned()).unwrap_or_default();
        (text, &*user.cast::<Messages>())
    };
    lock(messages).push(text);
    vk::FALSE
}

fn describe(instance: &ash::Instance, index: usize, physical: vk::PhysicalDevice) -> DeviceDescription {
    // SAFETY: queries on a physical device of this instance; the chained structs live until the calls return.
    let (properties, driver, subgroup, memory, extensions) = unsafe {
        let mut driver = vk::PhysicalDeviceDriverProperties::default();
        let mut subgroup = vk::PhysicalDeviceSubgroupProperties::default();
        let mut two = vk::PhysicalDeviceProperties2::default();
        // The chain is only valid on 1.2 and newer; older devices are listed with what 1.0 tells.
        if instance.get_physical_device_properties(physical).api_version >= vk::API_VERSION_1_2 {
            two = two.push_next(&mut driver).push_next(&mut subgroup);
        }
        instance.get_physical_device_properties2(physical, &mut two);
        let properties = two.properties;
        let memory = instance.get_physical_device_memory_properties(physical);
        let extensions = instance.enumerate_device_extension_properties(physical).unwrap_or_default();
        (properties, driver, subgroup, memory, extensions)
    };
    let mut missing = Vec::new();
    if properties.api_version < API {
        missing.push("Vulkan 1.3".to_owned());
    } else {
        let mut v11 = vk::PhysicalDeviceVulkan11Features::default();
        let mut v12 = vk::PhysicalDeviceVulkan12Features::default();
        let mut v13 = vk::PhysicalDeviceVulkan13Features::default();
        let mut features = vk::PhysicalDeviceFeatures2::default()
            .push_next(&mut v11)
            .push_next(&mut v12)
            .push_next(&mut v13);
        // SAFETY: as above; the device is at least 1.3.
        unsafe { instance.get_physical_device_features2(physical, &mut features) };
        let without_format = features.features.shader_storage_image_write_without_format;
        for (name, there) in [
            ("feature multiview", v11.multiview),
            ("feature shaderStorageImageWriteWithoutFormat", without_format),
            ("feature dynamicRendering", v13.dynamic_rendering),
            ("feature timelineSemaphore", v12.timeline_semaphore),
            ("feature scalarBlockLayout", v12.scalar_block_layout),
            ("feature synchronization2", v13.synchronization2),
            ("feature maintenance4", v13.maintenance4),
        ] {
            if there == vk::FALSE {
                missing.push(name.to_owned());
            }
        }
    }
    let operations = vk::SubgroupFeatureFlags::VOTE | vk::SubgroupFeatureFlags::ARITHMETIC;
    if !subgroup.supported_operations.contains(operations) {
        missing.push("subgroup vote and arithmetic".to_owned());
    }
    for needed in EXTENSIONS {
        if !extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(needed)) {
            missing.push(format!("extension {}", needed.to_string_lossy()));
        }
    }
    if queue_family(instance, physical).is_none() {
        missing.push("a queue for compute and graphics".to_owned());
    }
    let text = |c: std::result::Result<&CStr, _>| -> String {
        c.map(|c: &CStr| c.to_string_lossy().into_owned())
            .unwrap_or_else(|_: std::ffi::FromBytesUntilNulError| String::new())
    };
    let v = properties.api_version;
    let heaps = &memory.memory_heaps[..memory.memory_heap_count as usize];
    DeviceDescription {
        index,
        name: text(properties.device_name_as_c_str()),
        kind: match properties.device_type {
            vk::PhysicalDeviceType::DISCRETE_GPU => "discrete GPU",
            vk::PhysicalDeviceType::INTEGRATED_GPU => "integrated GPU",
            vk::PhysicalDeviceType::VIRTUAL_GPU => "virtual GPU",
            vk::PhysicalDeviceType::CPU => "CPU",
            _ => "other",
        },
        driver: format!("{} {}", text(driver.driver_name_as_c_str()), text(driver.driver_info_as_c_str()))
            .trim()
            .to_owned(),
        api: format!(
            "{}.{}.{}",
            vk::api_version_major(v),
            vk::api_version_minor(v),
            vk::api_version_patch(v)
        ),
        memory_bytes: heaps
            .iter()
            .filter(|h| h.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL))
            .map(|h| h.size)
            .sum(),
        subgroup_size: subgroup.subgroup_size,
        max_storage_range: u64::from(properties.limits.max_storage_buffer_range),
        missing,
    }
}

/// Whether a device has an extension.
fn offers(instance: &ash::Instance, physical: vk::PhysicalDevice, extension: &CStr) -> bool {
    // SAFETY: plain enumeration.
    let offered = unsafe { instance.enumerate_device_extension_properties(physical) }.unwrap_or_default();
    offered.iter().any(|e| e.extension_name_as_c_str() == Ok(extension))
}

/// A family that has both compute and graphics: the fit and the renderer share one queue.
fn queue_family(instance: &ash::Instance, physical: vk::PhysicalDevice) -> Option<u32> {
    // SAFETY: plain query.
    let families = unsafe { instance.get_physical_device_queue_family_properties(physical) };
    let wanted = vk::QueueFlags::COMPUTE | vk::QueueFlags::GRAPHICS;
    families.iter().position(|f| f.queue_flags.contains(wanted)).and_then(|i| u32::try_from(i).ok())
}

/// All Vulkan devices of this machine, usable or not.
pub fn devices() -> Result<Vec<DeviceDescription>> {
    let instance = Instance::new(&Own, false, None)?;
    let list = instance
        .physical_devices()
        .map(|found| found.iter().enumerate().map(|(i, &p)| describe(&instance.handle, i, p)).collect());
    // SAFETY: no device was made from this instance.
    unsafe { instance.destroy() };
    list
}

/// Picks by index or part of the name where the user said so, else the fastest kind that can be used.
fn choose<'a>(list: &'a [DeviceDescription], wanted: Option<&str>) -> Result<&'a DeviceDescription> {
    let listing = || {
        list.iter()
            .map(|d| {
                let state = if d.missing.is_empty() {
                    "usable".to_owned()
                } else {
                    format!("lacks {}", d.missing.join(", "))
                };
                format!("\n    {}: {} ({}; {}): {state}", d.index, d.name, d.kind, d.driver)
            })
            .collect::<String>()
    };
    if list.is_empty() {
        return Err(Error::new(Kind::Unavailable, "VGS-GPU-004", "no Vulkan device was found")
            .help("run through tools/vgs, which brings a software driver, or install a GPU driver"));
    }
    let chosen = match wanted {
        Some(text) => list
            .iter()
            .find(|d| text.parse() == Ok(d.index) || d.name.to_lowercase().contains(&text.to_lowercase())),
        None => list.iter().filter(|d| d.missing.is_empty()).min_by_key(|d| {
            ["discrete GPU", "integrated GPU", "virtual GPU", "CPU"]
                .iter()
                .position(|k| *k == d.kind)
                .unwrap_or(usize::MAX)
        }),
    };
    match chosen {
        Some(d) if d.missing.is_empty() => Ok(d),
        Some(d) => Err(Error::new(
            Kind::Unavailable,
            "VGS-GPU-005",
            format!("{} lacks {}", d.name, d.missing.join(", ")),
        )
        .help(format!("choose another device with --device:{}", listing()))),
        None => Err(Error::new(
            Kind::Unavailable,
            "VGS-GPU-006",
            match wanted {
                Some(text) => format!("no Vulkan device matches {text:?}"),
                None => "no Vulkan device has what is needed".to_owned(),
            },
        )
        .help(format!("found:{}", listing()))),
    }
}

impl Gpu {
    /// Boots with instance and device made by `boot`.
    pub fn with_boot(boot: &dyn Boot, options: &GpuOptions) -> Result<Self> {
        let instance = Instance::new(boot, options.validation, options.windows.as_ref())?;
        match Self::on_instance(boot, options, &instance) {
            Ok(parts) => {
                let context = parts.with(instance);
                super::lock(&context.queue).lost_at = options.lost_at;
                Ok(Gpu(Arc::new(context)))
            }
            Err(e) => {
                // SAFETY: the device was not made, or was destroyed on the way out.
                unsafe { instance.destroy() };
                Err(e)
            }
        }
    }

    fn on_instance(boot: &dyn Boot, options: &GpuOptions, instance: &Instance) -> Result<Parts> {
        let physicals = instance.physical_devices()?;
        let list: Vec<_> =
            physicals.iter().enumerate().map(|(i, &p)| describe(&instance.handle, i, p)).collect();
        let description = match boot.required_device(&instance.handle)? {
            Some(p) => {
                let index = physicals.iter().position(|&q| q == p).map(|i| i.to_string());
                choose(&list, index.as_deref())?
            }
            None => choose(&list, options.device.as_deref())?,
        }
        .clone();
        let physical = physicals[description.index];
        if options.windows.is_some() && !offers(&instance.handle, physical, ash::khr::swapchain::NAME) {
            return Err(Error::new(
                Kind::Unavailable,
                "VGS-GPU-008",
                format!("{} cannot show pictures in a window (VK_KHR_swapchain)", description.name),
            )
            .help("choose another --device, or write pictures to files with `vgs render`"));
        }
        let family = queue_family(&instance.handle, physical).unwrap_or_default();

        let priorities = [1.0];
        let queues =
            [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&priorities)];
        let mut extensions: Vec<_> = EXTENSIONS.iter().map(|e| e.as_ptr()).collect();
        if options.windows.is_some() {
            extensions.push(ash::khr::swapchain::NAME.as_ptr());
        }
        // Single feature structs, not Vulkan12Features: an OpenXR runtime may chain its own timeline struct.
        let mut timeline = vk::PhysicalDeviceTimelineSemaphoreFeatures::default().timeline_semaphore(true);
        let mut scalar = vk::PhysicalDeviceScalarBlockLayoutFeatures::default().scalar_block_layout(true);
        let mut multiview = vk::PhysicalDeviceMultiviewFeatures::default().multiview(true);
        let mut v13 = vk::PhysicalDeviceVulkan13Features::default()
            .synchronization2(true)
            .maintenance4(true)
            .dynamic_rendering(true);
        let basic = vk::PhysicalDeviceFeatures::default().shader_storage_image_write_without_format(true);
        let info = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_extension_names(&extensions)
            .enabled_features(&basic)
            .push_next(&mut multiview)
            .push_next(&mut timeline)
            .push_next(&mut scalar)
            .push_next(&mut v13);
        let device = boot.create_device(&instance.handle, physical, &info)?;
        Parts::new(instance, physical, device, family, description, options.storage_range_limit)
    }
}

/// The device half of a [`Context`], before it takes the instance.
struct Parts {
    physical: vk::PhysicalDevice,
    description: DeviceDescription,
    limits: Limits,
    device: ash::Device,
    push_descriptor: ash::khr::push_descriptor::Device,
    debug_utils: Option<ash::ext::debug_utils::Device>,
    queue_family: u32,
    timeline: vk::Semaphore,
    pipeline_cache: vk::PipelineCache,
    sampler: vk::Sampler,
    queue: vk::Queue,
    memory: memory::Memory,
}

impl Parts {
    fn new(
        instance: &Instance,
        physical: vk::PhysicalDevice,
        device: ash::Device,
        queue_family: u32,
        description: DeviceDescription,
        range_limit: Option<u64>,
    ) -> Result<Self> {
        let handle = &instance.handle;
        // SAFETY: plain queries on a live device.
        let (properties, families, queue) = unsafe {
            (
                handle.get_physical_device_properties(physical),
                handle.get_physical_device_queue_family_properties(physical),
                device.get_device_queue(queue_family, 0),
            )
        };
        let range = u64::from(properties.limits.max_storage_buffer_range);
        let has_timestamps = families.get(queue_family as usize).is_some_and(|f| f.timestamp_valid_bits > 0);
        let limits = Limits {
            storage_range: range_limit.map_or(range, |limit| limit.min(range)),
            timestamp_period: if has_timestamps { properties.limits.timestamp_period } else { 0.0 },
            workgroups: properties.limits.max_compute_work_group_count[0],
            volume_edge: properties.limits.max_image_dimension3_d,
            picture_edge: properties.limits.max_image_dimension2_d,
            filters_fractions: [vk::Format::R16_UNORM, vk::Format::R16G16_UNORM].iter().all(|&format| {
                // SAFETY: plain query.
                let found = unsafe { handle.get_physical_device_format_properties(physical, format) };
                found.optimal_tiling_features.contains(vk::FormatFeatureFlags::SAMPLED_IMAGE_FILTER_LINEAR)
            }),
        };
        let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
        let semaphore_info = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
        // SAFETY: the device is live and has the timeline feature on.
        let timeline =
            check("creating the timeline", unsafe { device.create_semaphore(&semaphore_info, None) })?;
        let cached =
            pipeline_cache_path(&description).and_then(|p| std::fs::read(p).ok()).unwrap_or_default();
        let cache_info = vk::PipelineCacheCreateInfo::default().initial_data(&cached);
        // SAFETY: Vulkan checks the header of cached data and ignores what it does not know.
        let pipeline_cache =
            check("creating the pipeline cache", unsafe { device.create_pipeline_cache(&cache_info, None) })?;
        let edge = vk::SamplerAddressMode::CLAMP_TO_EDGE;
        let sampler_info = vk::SamplerCreateInfo::default()
            .mag_filter(vk::Filter::LINEAR)
            .min_filter(vk::Filter::LINEAR)
            .address_mode_u(edge)
            .address_mode_v(edge)
            .address_mode_w(edge);
        // SAFETY: the device is live.
        let sampler = check("creating the sampler", unsafe { device.create_sampler(&sampler_info, None) })?;
        let memory = memory::Memory::new(handle.clone(), physical, device.clone())?;
        Ok(Parts {
            push_descriptor: ash::khr::push_descriptor::Device::new(handle, &device),
            debug_utils: instance
                .messenger
                .is_some()
                .then(|| ash::ext::debug_utils::Device::new(handle, &device)),
            physical,
            description,
            limits,
            device,
            queue_family,
            timeline,
            pipeline_cache,
            sampler,
            queue,
            memory,
        })
    }

    fn with(self, instance: Instance) -> Context {
        Context {
            instance,
            physical: self.physical,
            description: self.description,
            limits: self.limits,
            device: self.device,
            push_descriptor: self.push_descriptor,
            debug_utils: self.debug_utils,
            queue_family: self.queue_family,
            timeline: self.timeline,
            pipeline_cache: self.pipeline_cache,
            sampler: self.sampler,
            queue: Mutex::new(submissions::Submissions::new(self.queue)),
            memory: Mutex::new(self.memory),
            times: Mutex::default(),
            counters: Counters::default(),
            pipelines: Mutex::default(),
        }
    }
}

/// Where compiled pipelines are kept between runs: the user's cache folder, one file per device and driver.
fn pipeline_cache_path(description: &DeviceDescription) -> Option<PathBuf> {
    let folder = std::env::var_os("XDG_CACHE_HOME")
        .map(PathBuf::from)
        .or_else(|| std::env::var_os("HOME").map(|h| PathBuf::from(h).join(".cache")))?;
    let key: String = format!("{}-{}", description.name, description.driver)
        .chars()
        .map(|c| if c.is_ascii_alphanumeric() { c } else { '_' })
        .collect();
    Some(folder.join("vgs").join("pipelines").join(key))
}

/// Best effort: a cache that cannot be written costs compile time at the next start, nothing else.
///
/// # Safety
/// `cache` must be a live pipeline cache of `device`.
pub(super) unsafe fn save_pipeline_cache(
    device: &ash::Device,
    cache: vk::PipelineCache,
    description: &DeviceDescription,
) {
    // SAFETY: as the caller promises.
    let Ok(data) = (unsafe { device.get_pipeline_cache_data(cache) }) else { return };
    let Some(path) = pipeline_cache_path(description) else { return };
    let Some(folder) = path.parent() else { return };
    if std::fs::read(&path).is_ok_and(|old| old == data) || std::fs::create_dir_all(folder).is_err() {
        return;
    }
    // Written aside and renamed, so that a process that starts meanwhile never reads half a file.
    if let Ok(mut file) = tempfile::NamedTempFile::new_in(folder)
        && std::io::Write::write_all(&mut file, &data).is_ok()
    {
        let _ = file.persist(path);
    }
}

/// A `CString` from a name of ours; a name with a NUL inside loses what follows it.
pub(super) fn c_name(name: &str) -> CString {
    CString::new(name.split('\0').next().unwrap_or_default()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn device(index: usize, name: &str, kind: &'static str, missing: &[&str]) -> DeviceDescription {
        DeviceDescription {
            index,
            name: name.into(),
            kind,
            driver: "test".into(),
            api: "1.3.0".into(),
            memory_bytes: 0,
            subgroup_size: 8,
            max_storage_range: 1 << 27,
            missing: missing.iter().map(|&m| m.into()).collect(),
        }
    }

    #[test]
    fn the_fastest_usable_device_is_chosen_unless_the_user_says_otherwise() {
        let list = [
            device(0, "llvmpipe", "CPU", &[]),
            device(1, "Big GPU", "discrete GPU", &["feature scalarBlockLayout"]),
            device(2, "Small GPU", "integrated GPU", &[]),
        ];
        for (wanted, expect) in [(None, 2), (Some("0"), 0), (Some("pipe"), 0), (Some("small"), 2)] {
            assert_eq!(choose(&list, wanted).unwrap().index, expect, "{wanted:?}");
        }
        for wanted in ["1", "big", "none such"] {
            let e = choose(&list, Some(wanted)).unwrap_err();
            assert_eq!(e.kind, Kind::Unavailable);
            assert!(e.help.contains("llvmpipe"), "the help lists the devices: {}", e.help);
        }
        assert!(choose(&[], None).is_err());
    }
}
