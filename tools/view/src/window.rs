//! The window: takes winit's events and draws frames. A frame is drawn only when something has happened.

use std::sync::Arc;
use std::time::{Duration, Instant};

use egui::ViewportId;
use engine::gpu::{Gpu, GpuOptions, Windows};
use engine::{Error, Kind, Result};
use winit::application::ApplicationHandler;
use winit::dpi::{LogicalSize, PhysicalSize};
use winit::event::{StartCause, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop};
use winit::window::{Window, WindowId};

use crate::io::loader::Loader;
use crate::io::report::WindowReport;
use crate::panels::theme;
use crate::screen::canvas::Canvas;
use crate::viewer::{ActiveWindow, Between, Start, Viewer, is_lost};

/// Size of a new window on a screen that has room for it, points of the screen.
const SIZE: LogicalSize<f64> = LogicalSize::new(1280.0, 800.0);

/// Time after which the device is asked again whether it has finished a part of a picture.
const POLL: Duration = Duration::from_millis(1);

/// Event that wakes the loop: something was read or written.
#[derive(Debug)]
struct Woken;

/// Opens the window and runs until it is closed. Returns the measurements of the session.
///
/// # Errors
/// Returns [`Kind::Unavailable`] without a display, or without a device that can show pictures on it; errors
/// of the device, after one attempt to begin anew if it or the surface of the window was lost.
pub fn run(start: Start) -> Result<WindowReport> {
    let events = EventLoop::<Woken>::with_user_event().build().map_err(|e| no_window(&e))?;
    let proxy = events.create_proxy();
    let loader = Loader::new(move || {
        // The loop may have ended; then nobody needs the event.
        let _ = proxy.send_event(Woken);
    });
    let report = WindowReport::new(start.since);
    let gpu = start.gpu.clone();
    let viewer = Viewer::new(start, loader, report);
    let mut program = Program {
        viewer,
        options: gpu,
        active: None,
        wake_at: None,
        put_off: false,
        lost: false,
        failure: None,
    };
    events.run_app(&mut program).map_err(|e| no_window(&e))?;
    match program.failure {
        Some(error) => Err(error),
        None => Ok(program.viewer.report),
    }
}

fn no_window(why: &dyn std::fmt::Display) -> Error {
    Error::new(Kind::Unavailable, "VGS-VIEW-030", format!("no window can be opened: {why}")).help(
        "a display is needed (DISPLAY or WAYLAND_DISPLAY), and the libraries of X11 or Wayland (Debian, Ubuntu: apt install \
         libx11-6 libx11-xcb1 libxcursor1 libxi6 libxrandr2 libxkbcommon-x11-0); without them, `vgs render` writes pictures \
         to files",
    )
}

struct Program {
    viewer: Viewer,
    options: GpuOptions,
    active: Option<ActiveWindow>,
    /// Time when egui wants another frame by itself, as for a tooltip.
    wake_at: Option<Instant>,
    /// True if a frame is to be drawn as soon as nothing is in its way.
    put_off: bool,
    /// True if the device or the surface was lost.
    lost: bool,
    failure: Option<Error>,
}

/// Opens the window and boots the device for it. If there is a window already, only boots the device.
fn open(
    event_loop: &ActiveEventLoop,
    options: &GpuOptions,
    title: String,
    window: Option<Arc<Window>>,
) -> Result<ActiveWindow> {
    let window = match window {
        Some(window) => window,
        None => {
            let attributes = Window::default_attributes()
                .with_title(title)
                .with_inner_size(first_size(event_loop))
                .with_min_inner_size(LogicalSize::new(320.0, 240.0));
            Arc::new(event_loop.create_window(attributes).map_err(|e| no_window(&e))?)
        }
    };
    let gpu = Gpu::new(&GpuOptions { windows: Some(Windows::of(&*window)?), ..options.clone() })?;
    let chosen = gpu.description();
    tracing::info!("device: {} ({}, {})", chosen.name, chosen.kind, chosen.driver);
    // Each device has a context of its own, since its textures have to be sent to the new device.
    let context = egui::Context::default();
    theme::apply(&context);
    let input = egui_winit::State::new(
        context,
        ViewportId::ROOT,
        &*window,
        Some(window.scale_factor() as f32),
        None,
        Some(gpu.limits().picture_edge as usize),
    );
    let canvas = Canvas::new(&gpu, Arc::clone(&window), pixels(window.inner_size()))?;
    Ok(ActiveWindow { canvas, input, window })
}

/// Returns the size of a new window, points of the screen: of what the screen has room for.
fn first_size(event_loop: &ActiveEventLoop) -> LogicalSize<f64> {
    let monitor = event_loop.primary_monitor().or_else(|| event_loop.available_monitors().next());
    let room = monitor.map(|monitor| monitor.size().to_logical::<f64>(monitor.scale_factor()));
    let room = room.filter(|room| room.width > 0.0 && room.height > 0.0).unwrap_or(SIZE);
    LogicalSize::new(SIZE.width.min(room.width), SIZE.height.min(room.height))
}

fn pixels(size: PhysicalSize<u32>) -> [u32; 2] {
    [size.width, size.height]
}

/// Has the viewer ask for files by the dialog of the desktop, above this window.
#[cfg(all(unix, not(target_os = "macos"), not(target_os = "android")))]
fn use_system_dialog(viewer: &mut Viewer, window: &Window) {
    use raw_window_handle::{HasWindowHandle, RawWindowHandle};
    let parent = match window.window_handle().map(|handle| handle.as_raw()) {
        Ok(RawWindowHandle::Xlib(handle)) => format!("x11:{:x}", handle.window),
        Ok(RawWindowHandle::Xcb(handle)) => format!("x11:{:x}", handle.window),
        // Wayland names windows for other programs by a protocol of its own.
        _ => String::new(),
    };
    let wake = viewer.waker();
    viewer.use_system_dialog(Box::new(move |question| {
        let wake = Arc::clone(&wake);
        crate::io::portal::ask(question, parent.clone(), move || wake())
    }));
}

#[cfg(not(all(unix, not(target_os = "macos"), not(target_os = "android"))))]
fn use_system_dialog(_: &mut Viewer, _: &Window) {}

impl Program {
    fn begin(&mut self, event_loop: &ActiveEventLoop, window: Option<Arc<Window>>) {
        let is_first = window.is_none();
        match open(event_loop, &self.options, self.viewer.title(), window) {
            Ok(mut active) => {
                if is_first {
                    use_system_dialog(&mut self.viewer, &active.window);
                }
                active.window.request_redraw();
                if let Err(error) = self.viewer.set_device(&mut active.canvas) {
                    return self.fail(event_loop, error);
                }
                self.active = Some(active);
            }
            Err(error) => self.fail(event_loop, error),
        }
    }

    /// Draws a frame, or puts it off.
    fn draw(&mut self, event_loop: &ActiveEventLoop) {
        let Some(active) = &mut self.active else { return };
        match self.viewer.puts_off(&active.canvas) {
            Ok(puts_off) => self.put_off = puts_off,
            Err(error) => return self.fail(event_loop, error),
        }
        if self.put_off {
            return;
        }
        let (begun, before) = (Instant::now(), active.canvas.gpu().hitches());
        match self.viewer.draw(active) {
            Ok(next) => {
                self.viewer.note_busy(begun);
                if next.dragged {
                    self.viewer.report.dragged(before, active.canvas.gpu().hitches());
                }
                self.wake_at = next.again.map(|after| Instant::now() + after);
                if next.quit {
                    event_loop.exit();
                }
            }
            Err(error) => self.fail(event_loop, error),
        }
    }

    /// Begins anew if the device or the surface was lost for the first time; otherwise ends the program with the error.
    fn fail(&mut self, event_loop: &ActiveEventLoop, error: Error) {
        if is_lost(&error) && !self.lost {
            tracing::warn!("{error}; starting over");
            self.lost = true;
            // The old device is dropped completely before there is a new one.
            let window = self.active.take().map(|active| active.window);
            return self.begin(event_loop, window);
        }
        self.failure.get_or_insert(error);
        event_loop.exit();
    }
}

impl ApplicationHandler<Woken> for Program {
    fn new_events(&mut self, _: &ActiveEventLoop, cause: StartCause) {
        let due = self.wake_at.is_some_and(|at| at <= Instant::now());
        if let (StartCause::ResumeTimeReached { .. }, Some(active), true) = (cause, &self.active, due) {
            self.wake_at = None;
            active.window.request_redraw();
        }
    }

    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        if self.active.is_none() {
            self.begin(event_loop, None);
        }
    }

    fn user_event(&mut self, event_loop: &ActiveEventLoop, _: Woken) {
        let Some(active) = &mut self.active else { return };
        match self.viewer.take_loaded(&mut active.canvas) {
            Ok(()) => active.window.request_redraw(),
            Err(error) => self.fail(event_loop, error),
        }
        if let Some(active) = &self.active {
            active.window.set_title(&self.viewer.title());
        }
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(active) = &mut self.active else { return };
        match &event {
            WindowEvent::RedrawRequested => return self.draw(event_loop),
            WindowEvent::CloseRequested if self.viewer.may_close() => return event_loop.exit(),
            WindowEvent::CloseRequested => active.window.request_redraw(),
            WindowEvent::Resized(size) => {
                active.canvas.resize(pixels(*size));
                active.window.request_redraw();
            }
            _ => {}
        }
        if active.input.on_window_event(&active.window, &event).repaint {
            self.viewer.note_event();
            active.window.request_redraw();
        }
    }

    fn about_to_wait(&mut self, event_loop: &ActiveEventLoop) {
        if self.put_off {
            self.draw(event_loop);
        }
        let mut wake_at = self.wake_at;
        if let Some(active) = &mut self.active {
            let (begun, goes_on) = (Instant::now(), active.canvas.is_rendering());
            let between = self.viewer.go_on(&mut active.canvas);
            if goes_on && begun.elapsed() > POLL {
                self.viewer.note_busy(begun);
            }
            match between {
                Ok(Between::Nothing) => {}
                Ok(Between::Waiting) => {
                    let soon = Instant::now() + POLL;
                    wake_at = Some(wake_at.map_or(soon, |at| at.min(soon)));
                }
                Ok(Between::Draw) => active.window.request_redraw(),
                Err(error) => self.fail(event_loop, error),
            }
        }
        event_loop.set_control_flow(match wake_at {
            Some(at) => ControlFlow::WaitUntil(at),
            None => ControlFlow::Wait,
        });
    }

    fn exiting(&mut self, _: &ActiveEventLoop) {
        // The device is dropped before the connection to the display.
        self.active = None;
    }
}
