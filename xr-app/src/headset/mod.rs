//! What a headset is to the loop: a clock, eyes, hands, and pictures to draw into.
//!
//! Poses are in metres in a room whose y points up and whose -z points away from where the viewer stood at the start,
//! as OpenXR has it. Times are nanoseconds of a clock of the headset's own.

mod actions;
mod convert;
pub mod openxr;
pub mod simulated;

use engine::Result;
use engine::gpu::{Format, Image, Recorder};
use engine::render::{Fov, Triangle};
use glam::{DQuat, DVec2, DVec3};

/// A place and a direction in the room.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Metres.
    pub position: DVec3,
    /// Turns +x to the right of whoever has this pose, +y to its top and -z to where it looks.
    pub orientation: DQuat,
}

impl Pose {
    /// In the room's middle, looking ahead.
    pub const IDENTITY: Self = Pose { position: DVec3::ZERO, orientation: DQuat::IDENTITY };

    /// What is at `local`, as seen from here, is there in the room.
    pub fn place(&self, local: DVec3) -> DVec3 {
        self.position + self.orientation * local
    }

    /// Where it looks or points to.
    pub fn forward(&self) -> DVec3 {
        self.orientation * DVec3::NEG_Z
    }
}

/// An eye in the room.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eye {
    /// Where it is and where it looks.
    pub pose: Pose,
    /// What it sees.
    pub fov: Fov,
}

/// Both eyes at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eyes {
    /// Left and right.
    pub eyes: [Eye; 2],
    /// Whether the headset knows where it looks; otherwise these are its last poses.
    pub tracked: bool,
    /// When this was asked, on the clock of [`Timing`], if the headset has one that the host can read.
    pub asked_ns: Option<i64>,
}

/// A frame to come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timing {
    /// When it will be seen.
    pub display_ns: i64,
    /// From it to the next.
    pub period_ns: i64,
    /// Whether anybody will see it.
    pub visible: bool,
}

/// What a hand does.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Hand {
    /// Where it holds things, if that is known.
    pub grip: Option<Pose>,
    /// Where it points from, and to.
    pub aim: Option<Pose>,
    /// How firmly it grabs, 0 to 1.
    pub squeeze: f64,
    /// Whether the trigger or its like is pulled.
    pub select: bool,
    /// The thumbstick: to the right and up, -1 to 1.
    pub stick: DVec2,
    /// The first button: the next preset with the right hand, the last one with the left.
    pub next: bool,
    /// The second button: clip plane on and off with the right hand, reset with the left.
    pub other: bool,
    /// The button that shows and hides the panel.
    pub panel: bool,
    /// Whether there is no controller in it, and with it no such button.
    pub bare: bool,
}

impl Hand {
    /// The ray that it points with, if it is known where it is.
    pub fn ray(&self) -> Option<Pose> {
        self.aim.or(self.grip)
    }
}

/// Left and right.
pub type Hands = [Hand; 2];

/// How far a session has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// The headset is not used, or by others.
    Idle,
    /// Frames are wanted, though nobody sees them yet.
    Synchronized,
    /// Frames are seen.
    Visible,
    /// Frames are seen, and hands act on them.
    Focused,
    /// No frames are wanted any more.
    Stopping,
    /// The headset asks to end.
    Over,
    /// The headset is lost: the runtime ends or is replaced.
    Lost,
}

/// What happened since the last time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// The session has come to another state.
    State(State),
    /// The viewer has chosen a new middle of the room.
    Recentred,
    /// The display shows another number of frames a second.
    Rate(f64),
    /// Lenses hide another part of the pictures.
    Lenses,
}

/// What is behind the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Blend {
    /// Nothing; the picture has a background of its own.
    Opaque,
    /// The room, to which the picture is added.
    Additive,
    /// The room, where the picture is transparent.
    Alpha,
}

/// What does not change as long as a session lasts.
#[derive(Clone, Debug)]
pub struct Description {
    /// Name and version of the runtime.
    pub runtime: String,
    /// Name of the device.
    pub system: String,
    /// Width and height of the pictures of an eye, pixels.
    pub eye_size: [u32; 2],
    /// What its pictures are made of.
    pub format: Format,
    /// What is behind the picture.
    pub blend: Blend,
    /// Frames a second, where the runtime says so before the first frame.
    pub rate_hz: Option<f64>,
    /// Whether it takes the depth of what an eye sees, to move the picture with the head.
    pub depth: bool,
    /// Whether it says what its lenses hide.
    pub lenses: bool,
    /// Extensions in use.
    pub extensions: Vec<&'static str>,
}

/// Distances along the viewing direction that depths 0 and 1 stand for, metres: depth = far (z - near) / (z (far - near)).
pub const DEPTH_RANGE: [f64; 2] = [0.05, 100.0];

/// What a headset lends for a frame, with a layer for each eye.
pub struct Lent<'a> {
    /// The picture.
    pub colour: &'a mut Image,
    /// Its depth, where the headset takes that.
    pub depth: Option<&'a mut Image>,
}

impl Lent<'_> {
    /// All of it, to be drawn over.
    pub fn pictures(&mut self) -> Vec<&mut Image> {
        std::iter::once(&mut *self.colour).chain(self.depth.as_deref_mut()).collect()
    }
}

/// A headset with a session. A frame is [`wait`](Headset::wait), [`lend`](Headset::lend), [`give_back`](Headset::give_back),
/// [`eyes`](Headset::eyes), the submission, and [`end`](Headset::end), in this order; one that nobody sees is `wait` and `end`.
pub trait Headset {
    /// What does not change.
    fn description(&self) -> &Description;
    /// What lenses hide of the pictures of each eye, in tangents; nothing where the headset does not say so. It changes
    /// with [`Event::Lenses`].
    fn lenses(&self) -> &[Vec<Triangle>; 2];
    /// Takes note of what happened, and starts and ends the session as the runtime wants it.
    fn poll(&mut self) -> Result<Vec<Event>>;
    /// Whether frames are wanted.
    fn running(&self) -> bool;
    /// Waits until it is time for the next frame.
    fn wait(&mut self) -> Result<Timing>;
    /// What the hands will do when a frame is seen.
    fn hands(&mut self, timing: &Timing) -> Result<Hands>;
    /// The pictures of the frame. What they hold is not defined.
    fn lend(&mut self, recorder: &mut Recorder) -> Result<Lent<'_>>;
    /// Gives them back, as far as recording goes, and waits until the device may draw into them.
    fn give_back(&mut self, recorder: &mut Recorder) -> Result<()>;
    /// Where the eyes will be when a frame is seen: to be asked as late as possible.
    fn eyes(&mut self, timing: &Timing) -> Result<Eyes>;
    /// Ends a frame. With eyes, shows what was lent, as these eyes saw it.
    fn end(&mut self, timing: &Timing, seen: Option<&[Eye; 2]>) -> Result<()>;
    /// Asks for the end of the session, which comes as an event.
    fn request_exit(&mut self) -> Result<()>;
}
