//! A headset through OpenXR (XR_KHR_vulkan_enable2): the runtime creates instance and device of Vulkan, lends
//! pictures of a swapchain with a layer for each eye, and says when and from where to draw.
//!
//! This is the only file of the program with `unsafe` code, besides the entry of `android`: handles of Vulkan
//! go to the runtime and come back.
#![allow(unsafe_code, reason = "handles of Vulkan pass between the engine and the runtime")]

use std::cell::Cell;

use ash::vk;
use ash::vk::Handle as _;
use engine::gpu::{Boot, Format, Gpu, GpuOptions, Image, Recorder};
use engine::render::Triangle;
use engine::{Error, Kind, Result};
use glam::DVec2;
use openxr as xr;
use openxr::sys::Handle as _;

use super::actions::Actions;
use super::convert::{fov_of, fov_to, pose_of, pose_to, time};
use super::error::runtime_error;
use super::hands::{Hands, Pulse};
use super::headset::{DEPTH_RANGE, FrameImages, Headset};
use super::pose::{Eye, Eyes};
use super::session::{Backdrop, Background, Blend, Description, Event, SessionState, Timing};

const STEREO: xr::ViewConfigurationType = xr::ViewConfigurationType::PRIMARY_STEREO;

/// Choices of the user about a headset.
#[derive(Clone, Debug, Default)]
pub struct OpenXrOptions {
    /// What is behind the picture.
    pub background: Background,
    /// Frames a second, if the runtime lets programs choose.
    pub rate_hz: Option<f64>,
    /// Edges of the pictures as a part of the recommended ones.
    pub resolution: Option<f64>,
}

/// A headset with a session of OpenXR. Fields are dropped in their order: pictures before the swapchain that
/// owns their images, and the device last of all.
pub struct OpenXr {
    description: Description,
    colour: Chain,
    depth: Option<Chain>,
    lenses: [Vec<Triangle>; 2],
    actions: Actions,
    room: xr::Space,
    /// The room as a layer, where it is one.
    passthrough: Option<Passthrough>,
    frames: xr::FrameStream<xr::Vulkan>,
    waiter: xr::FrameWaiter,
    session: xr::Session<xr::Vulkan>,
    instance: xr::Instance,
    events: Box<xr::EventDataBuffer>,
    running: bool,
    /// The last poses that were known.
    last: Option<[Eye; 2]>,
    gpu: Gpu,
}

/// The room that cameras see (XR_FB_passthrough), as a layer below the picture.
struct Passthrough {
    layer: xr::PassthroughLayerFB,
    /// Kept as long as its layer.
    _feature: xr::Passthrough,
}

impl Passthrough {
    /// Starts to show the room; `None` if the headset does not have it.
    fn start(session: &xr::Session<xr::Vulkan>) -> Result<Option<Self>> {
        // Both run from the start: `xr::Passthrough::start` of openxr 0.22 pauses instead.
        let running = xr::PassthroughFlagsFB::IS_RUNNING_AT_CREATION;
        let start = || {
            let feature = session.create_passthrough(running)?;
            let purpose = xr::PassthroughLayerPurposeFB::RECONSTRUCTION;
            let layer = session.create_passthrough_layer(&feature, running, purpose)?;
            Ok(Passthrough { layer, _feature: feature })
        };
        match start() {
            Ok(started) => Ok(Some(started)),
            Err(xr::sys::Result::ERROR_FEATURE_UNSUPPORTED) => Ok(None),
            Err(e) => Err(runtime_error("asking for the room behind the picture", e)),
        }
    }
}

fn unavailable(code: &'static str, what: String) -> Error {
    Error::new(Kind::Unavailable, code, what).help(
        "install the headset's runtime and an OpenXR loader (Debian, Ubuntu: apt install libopenxr-loader1), start the \
         runtime and connect the headset; `--simulated` needs none of them",
    )
}

/// Returns the information about the system for loader and instance: none.
#[cfg(not(target_os = "android"))]
fn platform() -> Result<impl xr::PlatformInfo> {
    Ok(())
}

/// Returns the information about the system for loader and instance: the activity, if it has begun.
#[cfg(target_os = "android")]
fn platform() -> Result<xr::AndroidPlatformInfo> {
    let app = ACTIVITY.lock().expect("nothing panics with it").clone();
    let app = app.ok_or_else(|| Error::new(Kind::Internal, "VGS-XR-014", "the activity has not begun"))?;
    // SAFETY: both are those of the activity, and valid as long as an `AndroidApp` of it: `android_main` has
    // one until the session has ended.
    Ok(unsafe { xr::AndroidPlatformInfo::new(app.vm_as_ptr(), app.activity_as_ptr()) })
}

#[cfg(target_os = "android")]
static ACTIVITY: std::sync::Mutex<Option<android_activity::AndroidApp>> = std::sync::Mutex::new(None);

/// Keeps the program's activity, for the loader and the instance.
#[cfg(target_os = "android")]
pub(crate) fn set_activity(app: &android_activity::AndroidApp) {
    *ACTIVITY.lock().expect("nothing panics with it") = Some(app.clone());
}

/// The runtime with its headset, before Vulkan exists.
struct Runtime {
    instance: xr::Instance,
    system: xr::SystemId,
    extensions: xr::ExtensionSet,
    /// Vulkan handles that the session is bound to; known when the device exists.
    binding: Cell<Option<xr::vulkan::SessionCreateInfo>>,
}

impl Runtime {
    /// Asks for the runtime; with `room`, for the room behind the picture, too.
    fn new(room: bool) -> Result<Self> {
        let platform = platform()?;
        // SAFETY: loading the OpenXR loader runs its initialisers; it is the system's own library.
        let entry = unsafe { xr::Entry::load(&platform) }
            .map_err(|e| unavailable("VGS-XR-001", format!("no OpenXR loader: {e}")))?;
        let offered = entry
            .enumerate_extensions()
            .map_err(|e| unavailable("VGS-XR-002", format!("no OpenXR runtime is installed ({e})")))?;
        if !offered.khr_vulkan_enable2 {
            return Err(unavailable(
                "VGS-XR-003",
                "the OpenXR runtime does not know XR_KHR_vulkan_enable2".into(),
            ));
        }
        let mut extensions = xr::ExtensionSet::default();
        extensions.khr_vulkan_enable2 = true;
        extensions.khr_convert_timespec_time = offered.khr_convert_timespec_time;
        extensions.fb_display_refresh_rate = offered.fb_display_refresh_rate;
        extensions.ext_hand_interaction = offered.ext_hand_interaction;
        extensions.ext_hand_tracking = offered.ext_hand_tracking;
        extensions.fb_passthrough = room && offered.fb_passthrough;
        extensions.khr_composition_layer_depth = offered.khr_composition_layer_depth;
        extensions.khr_visibility_mask = offered.khr_visibility_mask;
        #[cfg(target_os = "android")]
        {
            extensions.khr_android_create_instance = true;
        }
        let about = xr::ApplicationInfo {
            application_name: "vgs-xr",
            application_version: 1,
            engine_name: "vgs",
            engine_version: 1,
            api_version: xr::Version::new(1, 0, 0),
        };
        let instance = entry
            .create_instance(&about, &extensions, &[], &platform)
            .map_err(|e| unavailable("VGS-XR-002", format!("no OpenXR runtime answers ({e})")))?;
        let system = instance
            .system(xr::FormFactor::HEAD_MOUNTED_DISPLAY)
            .map_err(|e| unavailable("VGS-XR-004", format!("the OpenXR runtime has no headset ({e})")))?;
        // This must be asked before Vulkan is created.
        instance
            .graphics_requirements::<xr::Vulkan>(system)
            .map_err(|e| runtime_error("asking for Vulkan", e))?;
        Ok(Runtime { instance, system, extensions, binding: Cell::new(None) })
    }

    /// Returns the names of the extensions in use.
    fn names(&self) -> Vec<&'static str> {
        [
            (self.extensions.khr_vulkan_enable2, "XR_KHR_vulkan_enable2"),
            (self.extensions.khr_convert_timespec_time, "XR_KHR_convert_timespec_time"),
            (self.extensions.fb_display_refresh_rate, "XR_FB_display_refresh_rate"),
            (self.extensions.ext_hand_interaction, "XR_EXT_hand_interaction"),
            (self.extensions.ext_hand_tracking, "XR_EXT_hand_tracking"),
            (self.extensions.fb_passthrough, "XR_FB_passthrough"),
            (self.extensions.khr_composition_layer_depth, "XR_KHR_composition_layer_depth"),
            (self.extensions.khr_visibility_mask, "XR_KHR_visibility_mask"),
        ]
        .into_iter()
        .filter_map(|(used, name)| used.then_some(name))
        .collect()
    }
}

/// Converts a result of Vulkan that came through the runtime.
fn made<T>(doing: &str, result: xr::Result<std::result::Result<T, i32>>) -> Result<T> {
    result.map_err(|e| runtime_error(doing, e))?.map_err(|code| {
        let e = vk::Result::from_raw(code);
        Error::new(
            Kind::Unavailable,
            "VGS-XR-005",
            format!("{doing} through the OpenXR runtime: Vulkan said {e}"),
        )
    })
}

impl Boot for Runtime {
    fn create_instance(
        &self,
        entry: &ash::Entry,
        info: &vk::InstanceCreateInfo<'_>,
    ) -> Result<ash::Instance> {
        // SAFETY: both function types are vkGetInstanceProcAddr; the create-info lives until the call
        // returns.
        let handle = unsafe {
            let loader = std::mem::transmute::<
                vk::PFN_vkGetInstanceProcAddr,
                xr::sys::platform::VkGetInstanceProcAddr,
            >(entry.static_fn().get_instance_proc_addr);
            self.instance.create_vulkan_instance(self.system, loader, std::ptr::from_ref(info).cast())
        };
        let handle = vk::Instance::from_raw(made("creating the Vulkan instance", handle)? as u64);
        // SAFETY: the runtime made it just now, with this loader.
        Ok(unsafe { ash::Instance::load(entry.static_fn(), handle) })
    }

    fn required_device(&self, instance: &ash::Instance) -> Result<Option<vk::PhysicalDevice>> {
        // SAFETY: the instance was made by the runtime.
        let found = unsafe {
            self.instance.vulkan_graphics_device(self.system, instance.handle().as_raw() as *const _)
        };
        let found = found.map_err(|e| runtime_error("asking for the headset's GPU", e))?;
        Ok(Some(vk::PhysicalDevice::from_raw(found as u64)))
    }

    fn create_device(
        &self,
        instance: &ash::Instance,
        physical: vk::PhysicalDevice,
        info: &vk::DeviceCreateInfo<'_>,
    ) -> Result<ash::Device> {
        // SAFETY: `info` has at least one queue; the function type is as above, and the loader of the
        // instance is the one that gave it.
        let (handle, queue_family_index) = unsafe {
            let entry = ash::Entry::load()
                .map_err(|e| unavailable("VGS-XR-006", format!("no Vulkan loader: {e}")))?;
            let loader = std::mem::transmute::<
                vk::PFN_vkGetInstanceProcAddr,
                xr::sys::platform::VkGetInstanceProcAddr,
            >(entry.static_fn().get_instance_proc_addr);
            let family = (*info.p_queue_create_infos).queue_family_index;
            let raw = physical.as_raw() as *const _;
            (
                self.instance.create_vulkan_device(self.system, loader, raw, std::ptr::from_ref(info).cast()),
                family,
            )
        };
        let handle = vk::Device::from_raw(made("creating the Vulkan device", handle)? as u64);
        self.binding.set(Some(xr::vulkan::SessionCreateInfo {
            instance: instance.handle().as_raw() as *const _,
            physical_device: physical.as_raw() as *const _,
            device: handle.as_raw() as *const _,
            queue_family_index,
            queue_index: 0,
        }));
        // SAFETY: the runtime made it just now, from this instance.
        Ok(unsafe { ash::Device::load(instance.fp_v1_0(), handle) })
    }
}

/// Pictures of the runtime, with a layer for each eye, that it lends one at a time. They are dropped before
/// the swapchain that owns their images.
struct Chain {
    pictures: Vec<Image>,
    acquired: Option<usize>,
    swapchain: xr::Swapchain<xr::Vulkan>,
}

impl Chain {
    fn new(gpu: &Gpu, session: &xr::Session<xr::Vulkan>, format: Format, size: [u32; 2]) -> Result<Self> {
        let (attachment, layout) = match format.is_depth() {
            true => (
                xr::SwapchainUsageFlags::DEPTH_STENCIL_ATTACHMENT,
                vk::ImageLayout::DEPTH_STENCIL_ATTACHMENT_OPTIMAL,
            ),
            false => (xr::SwapchainUsageFlags::COLOR_ATTACHMENT, vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL),
        };
        let [width, height] = size;
        let swapchain = session
            .create_swapchain(&xr::SwapchainCreateInfo {
                create_flags: xr::SwapchainCreateFlags::EMPTY,
                usage_flags: attachment
                    | xr::SwapchainUsageFlags::SAMPLED
                    | xr::SwapchainUsageFlags::TRANSFER_SRC
                    | xr::SwapchainUsageFlags::TRANSFER_DST,
                format: vulkan_format(format),
                sample_count: 1,
                width,
                height,
                face_count: 1,
                array_size: 2,
                mip_count: 1,
            })
            .map_err(|e| runtime_error("making pictures for the eyes", e))?;
        let images = swapchain.enumerate_images().map_err(|e| runtime_error("asking for pictures", e))?;
        let picture = |&image: &u64| {
            // SAFETY: the image belongs to the swapchain, which outlives the pictures; it was asked for with
            // two layers, this size and format, and OpenXR wants images back as attachments of their kind.
            unsafe { gpu.external_image("eyes", vk::Image::from_raw(image), format, size, 2, layout) }
        };
        let pictures = images.iter().map(picture).collect::<Result<_>>()?;
        Ok(Chain { pictures, acquired: None, swapchain })
    }

    fn acquire_images(&mut self, recorder: &mut Recorder) -> Result<&mut Image> {
        let index =
            self.swapchain.acquire_image().map_err(|e| runtime_error("asking for a picture", e))? as usize;
        self.acquired = Some(index);
        recorder.acquire_image(&self.pictures[index]);
        Ok(&mut self.pictures[index])
    }

    fn release_images(&mut self, recorder: &mut Recorder) -> Result<()> {
        let index = self.acquired.expect("a picture was lent");
        recorder.release_image(&self.pictures[index]);
        // The compositor may still read the picture; the device needs it only from now on.
        self.swapchain
            .wait_image(xr::Duration::INFINITE)
            .map_err(|e| runtime_error("waiting for a picture", e))
    }

    fn release(&mut self) -> Result<()> {
        match self.acquired.take() {
            Some(_) => self.swapchain.release_image().map_err(|e| runtime_error("showing a frame", e)),
            None => Ok(()),
        }
    }

    /// Returns the layer of an eye.
    fn part(&self, eye: usize, [width, height]: [u32; 2]) -> xr::SwapchainSubImage<'_, xr::Vulkan> {
        let extent = xr::Extent2Di { width: width as i32, height: height as i32 };
        xr::SwapchainSubImage::new()
            .swapchain(&self.swapchain)
            .image_array_index(eye as u32)
            .image_rect(xr::Rect2Di { offset: xr::Offset2Di { x: 0, y: 0 }, extent })
    }
}

impl OpenXr {
    /// Boots Vulkan through the runtime and opens a session on its headset.
    pub fn start(gpu_options: &GpuOptions, options: &OpenXrOptions) -> Result<(Gpu, Self)> {
        let runtime = Runtime::new(options.background == Background::Room)?;
        let gpu = Gpu::with_boot(&runtime, gpu_options)?;
        let Runtime { ref instance, system, .. } = runtime;
        let Some(binding) = runtime.binding.take() else {
            return Err(Error::new(Kind::Internal, "VGS-XR-012", "no device was made"));
        };
        // SAFETY: the handles are those of `gpu`, which is kept until the session has gone; its queue is used
        // from the thread that uses the session, and only from there.
        let opened = unsafe {
            instance.create_session_with_guard::<xr::Vulkan>(system, &binding, Box::new(gpu.clone()))
        };
        let (session, waiter, frames) = opened.map_err(|e| runtime_error("opening a session", e))?;
        let offered = blends(&runtime)?;
        let wants_layer = runtime.extensions.fb_passthrough && !offered.contains(&Blend::Alpha);
        let passthrough = if wants_layer { Passthrough::start(&session)? } else { None };
        let behind = options.background.choose(&offered, passthrough.is_some())?;
        let description = describe(&runtime, &session, options, behind)?;
        let chain = |format| Chain::new(&gpu, &session, format, description.eye_size);
        let colour = chain(description.format)?;
        let depth = description.depth.then(|| chain(Format::D32f)).transpose()?;
        let room = session
            .create_reference_space(xr::ReferenceSpaceType::LOCAL, xr::Posef::IDENTITY)
            .map_err(|e| runtime_error("asking for the room", e))?;
        let tracking =
            runtime.extensions.ext_hand_tracking && instance.supports_hand_tracking(system).unwrap_or(false);
        let actions = Actions::new(instance, &session, runtime.extensions.ext_hand_interaction, tracking)?;
        let lenses = match description.lenses {
            true => [0, 1].map(|eye| hidden(&session, eye)),
            false => Default::default(),
        };
        let headset = OpenXr {
            description,
            colour,
            depth,
            lenses,
            actions,
            room,
            passthrough: passthrough.filter(|_| behind.layer),
            frames,
            waiter,
            session,
            instance: runtime.instance.clone(),
            events: Box::new(xr::EventDataBuffer::new()),
            running: false,
            last: None,
            gpu: gpu.clone(),
        };
        Ok((gpu, headset))
    }

    /// Returns the time on the runtime's clock, if it can be read.
    fn now_ns(&self) -> Option<i64> {
        self.instance.exts().khr_convert_timespec_time.as_ref()?;
        self.instance.now().ok().map(xr::Time::as_nanos)
    }
}

/// Returns what the runtime offers behind the picture, its first choice first.
fn blends(runtime: &Runtime) -> Result<Vec<Blend>> {
    let modes = runtime.instance.enumerate_environment_blend_modes(runtime.system, STEREO);
    let modes = modes.map_err(|e| runtime_error("asking about the headset", e))?;
    Ok(modes.into_iter().map(blend_from).collect())
}

/// Asks the runtime about itself and its headset, and chooses format and rate.
fn describe(
    runtime: &Runtime,
    session: &xr::Session<xr::Vulkan>,
    options: &OpenXrOptions,
    behind: Backdrop,
) -> Result<Description> {
    let Runtime { instance, system, .. } = runtime;
    let asked = |e| runtime_error("asking about the headset", e);
    let about = instance.properties().map_err(asked)?;
    let device = instance.system_properties(*system).map_err(asked)?;
    let views = instance.enumerate_view_configuration_views(*system, STEREO).map_err(asked)?;
    let Some(view) = views.first().filter(|_| views.len() == 2) else {
        return Err(unavailable("VGS-XR-007", format!("{} eyes; stereo needs 2", views.len())));
    };
    let part = options.resolution.unwrap_or(1.0);
    let edge = |recommended: u32, most: u32| ((f64::from(recommended) * part).round() as u32).clamp(1, most);
    let offered = session.enumerate_swapchain_formats().map_err(asked)?;
    let wanted = [Format::Srgba8, Format::Sbgra8, Format::Rgba8, Format::Bgra8];
    let Some(format) = wanted.into_iter().find(|&f| offered.contains(&vulkan_format(f))) else {
        return Err(unavailable("VGS-XR-008", "the runtime takes no pictures of 8 bits a channel".into()));
    };
    let mut rate_hz = None;
    if runtime.extensions.fb_display_refresh_rate {
        if let Some(wanted) = options.rate_hz {
            let rates = session.enumerate_display_refresh_rates().map_err(asked)?;
            let Some(&rate) = rates.iter().find(|&&r| (f64::from(r) - wanted).abs() < 0.5) else {
                let rates: Vec<_> = rates.iter().map(|r| format!("{r:.0}")).collect();
                return Err(Error::new(Kind::Usage, "VGS-XR-013", format!("no display rate of {wanted} Hz"))
                    .help(format!("this headset has {} Hz", rates.join(", "))));
            };
            session.request_display_refresh_rate(rate).map_err(asked)?;
        }
        rate_hz = session.get_display_refresh_rate().ok().map(f64::from).filter(|&r| r > 0.0);
    }
    Ok(Description {
        runtime: format!("{} {}", about.runtime_name, about.runtime_version),
        system: device.system_name,
        eye_size: [
            edge(view.recommended_image_rect_width, view.max_image_rect_width),
            edge(view.recommended_image_rect_height, view.max_image_rect_height),
        ],
        format,
        blend: behind.blend,
        rate_hz,
        depth: runtime.extensions.khr_composition_layer_depth
            && offered.contains(&vulkan_format(Format::D32f)),
        lenses: runtime.extensions.khr_visibility_mask,
        extensions: runtime.names(),
    })
}

/// Returns the triangles of an eye's picture that the lens hides. If the runtime cannot tell them, there are
/// none.
fn hidden(session: &xr::Session<xr::Vulkan>, eye: u32) -> Vec<Triangle> {
    let hidden = xr::VisibilityMaskTypeKHR::HIDDEN_TRIANGLE_MESH;
    let mesh = session.get_visibility_mask_khr(STEREO, eye, hidden).unwrap_or_default();
    let corner =
        |&index: &u32| mesh.vertices.get(index as usize).map(|v| DVec2::new(f64::from(v.x), f64::from(v.y)));
    let triangle = |[a, b, c]: &[u32; 3]| Some([corner(a)?, corner(b)?, corner(c)?]);
    mesh.indices.as_chunks().0.iter().filter_map(triangle).collect()
}

fn vulkan_format(format: Format) -> u32 {
    let format = match format {
        Format::Srgba8 => vk::Format::R8G8B8A8_SRGB,
        Format::Sbgra8 => vk::Format::B8G8R8A8_SRGB,
        Format::Bgra8 => vk::Format::B8G8R8A8_UNORM,
        Format::D32f => vk::Format::D32_SFLOAT,
        _ => vk::Format::R8G8B8A8_UNORM,
    };
    format.as_raw() as u32
}

fn blend_mode(blend: Blend) -> xr::EnvironmentBlendMode {
    match blend {
        Blend::Opaque => xr::EnvironmentBlendMode::OPAQUE,
        Blend::Additive => xr::EnvironmentBlendMode::ADDITIVE,
        Blend::Alpha => xr::EnvironmentBlendMode::ALPHA_BLEND,
    }
}

fn blend_from(mode: xr::EnvironmentBlendMode) -> Blend {
    match mode {
        xr::EnvironmentBlendMode::ADDITIVE => Blend::Additive,
        xr::EnvironmentBlendMode::ALPHA_BLEND => Blend::Alpha,
        _ => Blend::Opaque,
    }
}

impl Headset for OpenXr {
    fn description(&self) -> &Description {
        &self.description
    }

    fn lenses(&self) -> &[Vec<Triangle>; 2] {
        &self.lenses
    }

    fn poll(&mut self) -> Result<Vec<Event>> {
        let mut out = Vec::new();
        loop {
            let event = self
                .instance
                .poll_event(&mut self.events)
                .map_err(|e| runtime_error("asking what happened", e))?;
            let Some(event) = event else { return Ok(out) };
            match event {
                xr::Event::SessionStateChanged(e) => match e.state() {
                    xr::SessionState::IDLE => out.push(Event::State(SessionState::Idle)),
                    xr::SessionState::READY => {
                        self.session.begin(STEREO).map_err(|e| runtime_error("beginning the session", e))?;
                        self.running = true;
                    }
                    xr::SessionState::SYNCHRONIZED => out.push(Event::State(SessionState::Synchronized)),
                    xr::SessionState::VISIBLE => out.push(Event::State(SessionState::Visible)),
                    xr::SessionState::FOCUSED => out.push(Event::State(SessionState::Focused)),
                    xr::SessionState::STOPPING => {
                        self.session.end().map_err(|e| runtime_error("ending the session", e))?;
                        self.running = false;
                        out.push(Event::State(SessionState::Stopping));
                    }
                    xr::SessionState::EXITING => out.push(Event::State(SessionState::Over)),
                    xr::SessionState::LOSS_PENDING => out.push(Event::State(SessionState::Lost)),
                    _ => {}
                },
                xr::Event::InstanceLossPending(_) => out.push(Event::State(SessionState::Lost)),
                xr::Event::ReferenceSpaceChangePending(_) => out.push(Event::Recentred),
                xr::Event::DisplayRefreshRateChangedFB(e) => {
                    out.push(Event::Rate(f64::from(e.to_display_refresh_rate())));
                }
                xr::Event::VisibilityMaskChangedKHR(e) if e.view_configuration_type() == STEREO => {
                    let eye = e.view_index();
                    if let Some(lens) = self.lenses.get_mut(eye as usize) {
                        *lens = hidden(&self.session, eye);
                        out.push(Event::Lenses);
                    }
                }
                _ => {}
            }
        }
    }

    fn running(&self) -> bool {
        self.running
    }

    fn wait(&mut self) -> Result<Timing> {
        let state = self.waiter.wait().map_err(|e| runtime_error("waiting for a frame", e))?;
        self.frames.begin().map_err(|e| runtime_error("beginning a frame", e))?;
        Ok(Timing {
            display_ns: state.predicted_display_time.as_nanos(),
            period_ns: state.predicted_display_period.as_nanos(),
            visible: state.should_render,
        })
    }

    fn hands(&mut self, timing: &Timing) -> Result<Hands> {
        self.actions.hands(&self.session, &self.room, time(timing.display_ns))
    }

    fn pulse(&mut self, side: usize, pulse: &Pulse) -> Result<()> {
        self.actions.pulse(&self.session, side, pulse)
    }

    fn acquire_images(&mut self, recorder: &mut Recorder) -> Result<FrameImages<'_>> {
        let colour = self.colour.acquire_images(recorder)?;
        let depth = self.depth.as_mut().map(|depth| depth.acquire_images(recorder)).transpose()?;
        Ok(FrameImages { colour, depth })
    }

    fn release_images(&mut self, recorder: &mut Recorder) -> Result<()> {
        self.colour.release_images(recorder)?;
        self.depth.as_mut().map_or(Ok(()), |depth| depth.release_images(recorder))
    }

    fn eyes(&mut self, timing: &Timing) -> Result<Eyes> {
        let asked_ns = self.now_ns();
        let (flags, views) = self
            .session
            .locate_views(STEREO, time(timing.display_ns), &self.room)
            .map_err(|e| runtime_error("asking where the eyes are", e))?;
        let tracked = flags.contains(xr::ViewStateFlags::ORIENTATION_VALID);
        let found = [0, 1].map(|eye| Eye { pose: pose_of(&views[eye].pose), fov: fov_of(&views[eye].fov) });
        let eyes = match self.last {
            Some(last) if !tracked => last,
            _ => found,
        };
        self.last = Some(eyes);
        Ok(Eyes { eyes, tracked, asked_ns })
    }

    fn end(&mut self, timing: &Timing, seen: Option<&[Eye; 2]>) -> Result<()> {
        let ended = |e| runtime_error("showing a frame", e);
        self.colour.release()?;
        self.depth.as_mut().map_or(Ok(()), Chain::release)?;
        // Over a layer of the room the runtime needs to mix nothing in by itself.
        let blend = match self.passthrough {
            Some(_) => xr::EnvironmentBlendMode::OPAQUE,
            None => blend_mode(self.description.blend),
        };
        let Some(eyes) = seen else {
            return self.frames.end(time(timing.display_ns), blend, &[]).map_err(ended);
        };
        let size = self.description.eye_size;
        let [near_z, far_z] = DEPTH_RANGE.map(|metres| metres as f32);
        let depths = self.depth.as_ref().map(|depth| {
            [0, 1].map(|eye| xr::sys::CompositionLayerDepthInfoKHR {
                ty: xr::sys::CompositionLayerDepthInfoKHR::TYPE,
                next: std::ptr::null(),
                sub_image: depth.part(eye, size).into_raw(),
                min_depth: 0.0,
                max_depth: 1.0,
                near_z,
                far_z,
            })
        });
        let views = [0, 1].map(|eye| {
            let view = xr::CompositionLayerProjectionView::new()
                .pose(pose_to(&eyes[eye].pose))
                .fov(fov_to(&eyes[eye].fov))
                .sub_image(self.colour.part(eye, size));
            let Some(depths) = &depths else { return view };
            let next = std::ptr::from_ref(&depths[eye]).cast();
            // SAFETY: what the chain points to lives until the frame has ended, as does all else of the view.
            unsafe {
                xr::CompositionLayerProjectionView::from_raw(xr::sys::CompositionLayerProjectionView {
                    next,
                    ..view.into_raw()
                })
            }
        });
        let mut layer = xr::CompositionLayerProjection::new().space(&self.room).views(&views);
        if self.description.blend == Blend::Alpha {
            layer = layer.layer_flags(xr::CompositionLayerFlags::BLEND_TEXTURE_SOURCE_ALPHA);
        }
        let below = self.passthrough.as_ref().map(|room| xr::sys::CompositionLayerPassthroughFB {
            ty: xr::sys::CompositionLayerPassthroughFB::TYPE,
            next: std::ptr::null(),
            flags: xr::CompositionLayerFlags::BLEND_TEXTURE_SOURCE_ALPHA,
            // The room is everywhere.
            space: xr::sys::Space::from_raw(0),
            layer_handle: room.layer.as_raw(),
        });
        let mut layers: Vec<&xr::CompositionLayerBase<'_, xr::Vulkan>> = Vec::with_capacity(2);
        if let Some(below) = &below {
            // SAFETY: every layer begins with the fields of its base, and the runtime knows by its type what
            // follows; it lives until the frame has ended.
            layers.push(unsafe { &*std::ptr::from_ref(below).cast() });
        }
        layers.push(&layer);
        self.frames.end(time(timing.display_ns), blend, &layers).map_err(ended)
    }

    fn request_exit(&mut self) -> Result<()> {
        match self.session.request_exit() {
            Ok(()) => Ok(()),
            // The session was not running: there is nothing to end.
            Err(xr::sys::Result::ERROR_SESSION_NOT_RUNNING) => Ok(()),
            Err(e) => Err(runtime_error("ending the session", e)),
        }
    }
}

impl Drop for OpenXr {
    fn drop(&mut self) {
        // The views of the pictures are deleted before the images that the swapchain owns.
        self.colour.pictures.clear();
        self.depth.iter_mut().for_each(|depth| depth.pictures.clear());
        let _ = self.gpu.wait_idle();
    }
}
