//! A simulated headset: poses, hands and the clock follow a script, and pictures stay on the device.

use std::time::{Duration, Instant};

use engine::Result;
use engine::gpu::{Format, Gpu, Image, Recorder};
use engine::render::{Fov, Triangle};
use glam::{DQuat, DVec2, DVec3};

use super::hands::{Hand, Hands, Pulse};
use super::headset::{FrameImages, Headset};
use super::pose::{Eye, Eyes, Pose};
use super::session::{Blend, Description, Event, SessionState, Timing};

/// Number of pictures that are used in turn, as in the swapchains of runtimes.
const PICTURES: usize = 3;
/// Distance of the eyes, metres.
const EYES_APART: f64 = 0.063;
/// Number of straight pieces of a quarter of a lens's rim.
const RIM: usize = 12;

/// What a simulated headset offers behind the picture, its first choice first.
pub const OFFERED: [Blend; 3] = [Blend::Opaque, Blend::Additive, Blend::Alpha];

/// Script of a simulated headset.
pub struct Script {
    /// Width and height of the pictures of an eye, pixels.
    pub eye_size: [u32; 2],
    /// Frames a second.
    pub rate_hz: f64,
    /// Background behind the picture.
    pub blend: Blend,
    /// True if depth is taken.
    pub depth: bool,
    /// Frame from which on lenses are known to be round, so that corners of the pictures are hidden; `None`
    /// for never.
    pub round_from: Option<u64>,
    /// True if frames come at this rate; otherwise they come as fast as they are ended, on a clock that
    /// jumps.
    pub real_time: bool,
    /// Number of frames after which the headset asks to end, if it does.
    pub frames: Option<u64>,
    /// Field of view of the left eye; that of the right eye is its mirror image.
    pub left_fov: Fov,
    /// Pose of the head, by the seconds since the start; true if it is tracked.
    pub head: fn(f64) -> (Pose, bool),
    /// State of the hands, by the seconds since the start.
    pub hands: fn(f64) -> Hands,
    /// Event of a frame, by its number, besides start and end.
    pub events: fn(u64) -> Option<Event>,
}

impl Default for Script {
    fn default() -> Self {
        Script {
            eye_size: [640, 720],
            rate_hz: 72.0,
            blend: Blend::Opaque,
            depth: false,
            round_from: None,
            real_time: true,
            frames: None,
            left_fov: Fov { left: -1.0, right: 0.84, up: 0.9, down: -1.0 },
            head: |seconds| (sway(seconds), true),
            hands: |_| Hands::default(),
            events: |_| None,
        }
    }
}

/// Returns the pose of a head that sways about the room's middle, looking at a point half a metre ahead.
pub fn sway(seconds: f64) -> Pose {
    let angle = 0.4 * (0.7 * seconds).sin();
    let height = 0.1 * (0.45 * seconds).sin();
    let target = DVec3::new(0.0, 0.0, -0.6);
    let position = target + 0.6 * DVec3::new(angle.sin(), height, angle.cos());
    Pose { position, orientation: DQuat::from_rotation_y(angle) * DQuat::from_rotation_x(-height) }
}

/// Returns hands that rest before the viewer with their controllers, and point ahead.
pub fn rest(_: f64) -> Hands {
    [-1.0, 1.0].map(|side| {
        let turned = |up: f64| DQuat::from_rotation_y(0.3 * side) * DQuat::from_rotation_x(up);
        let position = DVec3::new(0.17 * side, -0.24, -0.4);
        let grip = Pose { position, orientation: turned(0.9) };
        let aim = Pose { position: grip.place(DVec3::NEG_Z * 0.05), orientation: turned(0.2) };
        Hand { grip: Some(grip), aim: Some(aim), ..Hand::default() }
    })
}

/// Returns the part of a field of view that a round lens hides: everything outside of the ellipse that
/// touches its edges.
fn corners(fov: &Fov) -> Vec<Triangle> {
    let middle = DVec2::new(fov.left + fov.right, fov.down + fov.up) * 0.5;
    let half = DVec2::new(fov.right - fov.left, fov.up - fov.down) * 0.5;
    let rim = |k: usize| {
        let angle = k as f64 / RIM as f64 * std::f64::consts::FRAC_PI_2;
        DVec2::new(angle.cos(), angle.sin())
    };
    let quarters = [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]].map(DVec2::from_array);
    let triangle =
        |quarter: DVec2, k: usize| [rim(k), rim(k + 1), DVec2::ONE].map(|p| middle + half * quarter * p);
    quarters.into_iter().flat_map(|quarter| (0..RIM).map(move |k| triangle(quarter, k))).collect()
}

/// A simulated headset.
pub struct Simulated {
    script: Script,
    description: Description,
    pictures: Vec<Image>,
    depths: Vec<Image>,
    lenses: [Vec<Triangle>; 2],
    start: Instant,
    frame: u64,
    /// Index of the display's period for the next frame.
    tick: u64,
    begun: bool,
    leaving: bool,
    over: bool,
    /// Eyes of the picture that was shown last.
    pub shown: Option<[Eye; 2]>,
    /// Pulses of the hands: the number of the frame, the hand, the pulse.
    pub pulses: Vec<(u64, usize, Pulse)>,
}

impl Simulated {
    /// Creates a headset that follows the script.
    pub fn new(gpu: &Gpu, script: Script) -> Result<Self> {
        let make = |name: &str, format| {
            let picture = |n| gpu.picture(&format!("{name} {n}"), "eyes", format, script.eye_size, 2);
            (0..PICTURES).map(picture).collect::<Result<Vec<_>>>()
        };
        let pictures = make("eyes", Format::Rgba8)?;
        let depths = if script.depth { make("depth of eyes", Format::D32f)? } else { Vec::new() };
        let description = Description {
            runtime: "simulated".to_owned(),
            system: "simulated headset".to_owned(),
            eye_size: script.eye_size,
            format: Format::Rgba8,
            blend: script.blend,
            rate_hz: Some(script.rate_hz),
            depth: script.depth,
            lenses: script.round_from.is_some(),
            extensions: Vec::new(),
        };
        Ok(Simulated {
            script,
            description,
            pictures,
            depths,
            lenses: Default::default(),
            start: Instant::now(),
            frame: 0,
            tick: 0,
            begun: false,
            leaving: false,
            over: false,
            shown: None,
            pulses: Vec::new(),
        })
    }

    /// Returns the picture that was shown last.
    pub fn picture(&self) -> &Image {
        &self.pictures[(self.frame as usize + PICTURES - 1) % PICTURES]
    }

    /// Returns the depth that was shown with the last picture, if depth is taken.
    pub fn depth(&self) -> Option<&Image> {
        self.depths.get((self.frame as usize + PICTURES - 1) % PICTURES)
    }

    fn period(&self) -> Duration {
        Duration::from_secs_f64(1.0 / self.script.rate_hz)
    }

    /// Returns the field of view of each eye.
    fn fovs(&self) -> [Fov; 2] {
        let left = self.script.left_fov;
        [left, Fov { left: -left.right, right: -left.left, ..left }]
    }

    fn index(&self) -> usize {
        self.frame as usize % PICTURES
    }
}

impl Headset for Simulated {
    fn description(&self) -> &Description {
        &self.description
    }

    fn lenses(&self) -> &[Vec<Triangle>; 2] {
        &self.lenses
    }

    fn poll(&mut self) -> Result<Vec<Event>> {
        let mut events = Vec::new();
        if !self.begun {
            self.begun = true;
            self.start = Instant::now();
            events.extend(
                [SessionState::Synchronized, SessionState::Visible, SessionState::Focused].map(Event::State),
            );
        }
        events.extend((self.script.events)(self.frame));
        if self.script.round_from.is_some_and(|frame| frame <= self.frame) && self.lenses[0].is_empty() {
            self.lenses = self.fovs().map(|fov| corners(&fov));
            events.push(Event::Lenses);
        }
        if !self.over && (self.leaving || self.script.frames.is_some_and(|n| self.frame >= n)) {
            self.over = true;
            events.extend([SessionState::Stopping, SessionState::Over].map(Event::State));
        }
        Ok(events)
    }

    fn running(&self) -> bool {
        self.begun && !self.over && !self.leaving
    }

    fn wait(&mut self) -> Result<Timing> {
        let period = self.period();
        if self.script.real_time {
            // A frame that comes late gets the next period that has not begun.
            let now = self.start.elapsed();
            self.tick = self.tick.max((now.as_nanos().div_ceil(period.as_nanos())) as u64);
            std::thread::sleep((period * self.tick as u32).saturating_sub(now));
        }
        self.tick += 1;
        let period_ns = period.as_nanos() as i64;
        // The frame is seen a period after it is due, as on a display that shows one picture while the next
        // is drawn.
        Ok(Timing { display_ns: self.tick as i64 * period_ns, period_ns, visible: true })
    }

    fn hands(&mut self, timing: &Timing) -> Result<Hands> {
        Ok((self.script.hands)(timing.display_ns as f64 * 1e-9))
    }

    fn pulse(&mut self, side: usize, pulse: &Pulse) -> Result<()> {
        self.pulses.push((self.frame, side, *pulse));
        Ok(())
    }

    fn acquire_images(&mut self, _: &mut Recorder) -> Result<FrameImages<'_>> {
        let index = self.index();
        Ok(FrameImages { colour: &mut self.pictures[index], depth: self.depths.get_mut(index) })
    }

    fn release_images(&mut self, _: &mut Recorder) -> Result<()> {
        Ok(())
    }

    fn eyes(&mut self, timing: &Timing) -> Result<Eyes> {
        let (head, tracked) = (self.script.head)(timing.display_ns as f64 * 1e-9);
        let [left, right] = self.fovs();
        let eye = |side: f64, fov| Eye {
            pose: Pose { position: head.place(DVec3::X * (side * EYES_APART)), ..head },
            fov,
        };
        let asked_ns = self.script.real_time.then(|| self.start.elapsed().as_nanos() as i64);
        Ok(Eyes { eyes: [eye(-0.5, left), eye(0.5, right)], tracked, asked_ns })
    }

    fn end(&mut self, _: &Timing, seen: Option<&[Eye; 2]>) -> Result<()> {
        self.shown = seen.copied();
        self.frame += 1;
        Ok(())
    }

    fn request_exit(&mut self) -> Result<()> {
        self.leaving = true;
        Ok(())
    }
}
