//! A window on the desktop that shows what the eyes see. It never delays the headset: a frame is not mirrored
//! if the window has no picture for it at once, and the picture is presented after the headset has its own.

use std::sync::Arc;
use std::time::Duration;

use clap::ValueEnum;
use engine::gpu::{Acquired, Drawing, Format, Gpu, Image, Recorder, Surface, Windows};
use engine::{Error, Kind, Result};
use shaders_glsl as glsl;
use shaders_glsl::types::MirrorParams;
use view::screen::composer::{Composer, Composition, Layer};
use winit::application::ApplicationHandler;
use winit::dpi::PhysicalSize;
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, EventLoop};
use winit::platform::pump_events::EventLoopExtPumpEvents as _;
use winit::window::{Window, WindowId};

use crate::onlooker::Onlooker;

/// Height of the window at the start, and width for each eye, pixels.
const HEIGHT: u32 = 480;

/// What the window shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Shown {
    /// The left eye
    Left,
    /// The right eye
    Right,
    /// Both, side by side
    Both,
}

impl Shown {
    /// Returns the index of the first layer, and the number of layers.
    fn layers(self) -> [u32; 2] {
        match self {
            Shown::Left => [0, 1],
            Shown::Right => [1, 1],
            Shown::Both => [0, 2],
        }
    }
}

/// State that winit's events have set.
#[derive(Default)]
struct MirrorWindow {
    eyes: u32,
    window: Option<Arc<Window>>,
    failure: Option<String>,
    closed: bool,
    resized: Option<[u32; 2]>,
}

impl ApplicationHandler for MirrorWindow {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        if self.window.is_some() {
            return;
        }
        let size = PhysicalSize::new(self.eyes * HEIGHT, HEIGHT);
        let attributes = Window::default_attributes().with_title("vgs-xr").with_inner_size(size);
        match events.create_window(attributes) {
            Ok(window) => self.window = Some(Arc::new(window)),
            Err(e) => self.failure = Some(e.to_string()),
        }
    }

    fn window_event(&mut self, _: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        match event {
            WindowEvent::CloseRequested => self.closed = true,
            WindowEvent::Resized(size) => self.resized = Some([size.width, size.height]),
            _ => {}
        }
    }
}

/// The window, before there is a device.
pub struct Opened {
    events: EventLoop<()>,
    mirror_window: MirrorWindow,
    window: Arc<Window>,
    shown: Shown,
}

impl Opened {
    /// Opens a window for the eyes in `shown`; must be called on the main thread.
    ///
    /// # Errors
    /// [`Kind::Unavailable`] without a display.
    pub fn new(shown: Shown) -> Result<Self> {
        let mut events = EventLoop::new().map_err(|e| no_window(&e.to_string()))?;
        let mut mirror_window = MirrorWindow { eyes: shown.layers()[1], ..MirrorWindow::default() };
        events.pump_app_events(Some(Duration::ZERO), &mut mirror_window);
        match &mirror_window.window {
            Some(window) => Ok(Opened { window: Arc::clone(window), shown, events, mirror_window }),
            None => Err(no_window(mirror_window.failure.as_deref().unwrap_or("it does not appear"))),
        }
    }

    /// Returns the windows with which the device must be booted to draw in this one.
    pub fn windows(&self) -> Result<Windows> {
        Windows::of(&*self.window)
    }

    /// Creates the mirror of pictures of a format with this width and height, a layer for each eye.
    pub fn show(self, gpu: &Gpu, format: Format, eye: [u32; 2]) -> Result<Mirror> {
        let PhysicalSize { width, height } = self.window.inner_size();
        let size = [width, height];
        let surface = Surface::new(gpu, Arc::clone(&self.window), size)?;
        let linear = [u32::from(format.is_srgb())];
        Ok(Mirror {
            drawing: Drawing::new(gpu, &glsl::MIRROR_VERT, &glsl::MIRROR_FRAG, &linear, &[Format::Rgba8], 1)?,
            composer: Composer::new(gpu, surface.format())?,
            copy: copy(gpu, size)?,
            acquired: None,
            surface,
            layers: self.shown.layers(),
            eye,
            skipped: 0,
            shown: 0,
            opened: self,
            gpu: gpu.clone(),
        })
    }
}

fn no_window(why: &str) -> Error {
    Error::new(Kind::Unavailable, "VGS-XR-025", format!("no window can be opened: {why}"))
        .help("a display is needed (DISPLAY or WAYLAND_DISPLAY); leave --mirror out where there is none")
}

fn copy(gpu: &Gpu, size: [u32; 2]) -> Result<Image> {
    gpu.picture("mirror", "pictures", Format::Rgba8, size.map(|n| n.max(1)), 1)
}

/// A window that shows what the eyes see. Fields are dropped in their order: drawings before the surface.
pub struct Mirror {
    drawing: Drawing,
    composer: Composer,
    /// Picture that is shown next, as large as the window.
    copy: Image,
    /// The window's picture for this frame.
    acquired: Option<Acquired>,
    surface: Surface,
    layers: [u32; 2],
    eye: [u32; 2],
    skipped: u64,
    shown: u64,
    opened: Opened,
    gpu: Gpu,
}

impl Onlooker for Mirror {
    /// Returns true if the user has closed the window.
    fn gone(&self) -> bool {
        self.opened.mirror_window.closed
    }

    fn counts(&self) -> [u64; 2] {
        [self.shown, self.skipped]
    }

    fn take(&mut self, recorder: &mut Recorder, eyes: &Image) -> Result<()> {
        let Opened { events, mirror_window, .. } = &mut self.opened;
        events.pump_app_events(Some(Duration::ZERO), mirror_window);
        if let Some(size) = mirror_window.resized.take() {
            self.surface.resize(size);
        }
        self.acquired = self.surface.acquire_at_once()?;
        if self.acquired.is_none() {
            self.skipped += 1;
            return Ok(());
        }
        let size = self.surface.size();
        if self.copy.size()[..2] != size {
            self.copy = copy(&self.gpu, size)?;
        }
        recorder
            .draw(&self.drawing)
            .sample("eyes", eyes)
            .push(&MirrorParams {
                window: size.map(|n| n as f32),
                eye: self.eye.map(|n| n as f32),
                first: self.layers[0],
                count: self.layers[1],
            })
            .vertices_over(&mut [&mut self.copy], 0..3);
        Ok(())
    }

    fn show(&mut self) -> Result<()> {
        let Some(acquired) = self.acquired.take() else { return Ok(()) };
        let mut recorder = self.gpu.record()?;
        let size = self.surface.size().map(|n| n as f32);
        let window = self.surface.image(&mut recorder, &acquired);
        let area = [0.0, 0.0, size[0], size[1]];
        let what = Composition {
            first: Layer { picture: &self.copy, layer: 0, part: [1.0, 1.0] },
            second: None,
            split: size[0],
            area,
            place: area,
            background: [0.0; 3],
        };
        self.composer.compose(&mut recorder, &what, window);
        self.surface.present(recorder, acquired)?;
        self.shown += 1;
        Ok(())
    }
}
