//! The session of a headset: its state, its events, its frames, and its description.

use engine::gpu::Format;

/// A frame to come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timing {
    /// Time at which it will be seen.
    pub display_ns: i64,
    /// Time from this frame to the next.
    pub period_ns: i64,
    /// True if anybody will see it.
    pub visible: bool,
}

/// State of a session.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SessionState {
    /// The headset is not used, or another program uses it.
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

/// An event of a session.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// The session has reached another state.
    State(SessionState),
    /// The viewer has chosen a new middle of the room.
    Recentred,
    /// The display has changed to this number of frames a second.
    Rate(f64),
    /// Lenses now hide another part of the pictures.
    Lenses,
}

/// Background behind the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Blend {
    /// No background of the headset; the picture has one of its own.
    Opaque,
    /// The room, to which the picture is added.
    Additive,
    /// The room, where the picture is transparent.
    Alpha,
}

/// Properties that do not change as long as a session lasts.
#[derive(Clone, Debug)]
pub struct Description {
    /// Name and version of the runtime.
    pub runtime: String,
    /// Name of the device.
    pub system: String,
    /// Width and height of the pictures of an eye, pixels.
    pub eye_size: [u32; 2],
    /// Format of the pictures.
    pub format: Format,
    /// Background behind the picture.
    pub blend: Blend,
    /// Frames a second, if the runtime tells it before the first frame.
    pub rate_hz: Option<f64>,
    /// True if it takes the depth of an eye's picture, to move the picture with the head.
    pub depth: bool,
    /// True if it tells what its lenses hide.
    pub lenses: bool,
    /// Extensions in use.
    pub extensions: Vec<&'static str>,
}
