//! What a session says: how far it has come, what happened, when a frame is shown and on what.

use engine::gpu::Format;

/// A frame to come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timing {
    /// When it will be seen.
    pub display_ns: i64,
    /// From it to the next.
    pub period_ns: i64,
    /// True if anybody will see it.
    pub visible: bool,
}

/// How far a session has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SessionState {
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
    State(SessionState),
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
    /// True if it takes the depth of what an eye sees, to move the picture with the head.
    pub depth: bool,
    /// True if it says what its lenses hide.
    pub lenses: bool,
    /// Extensions in use.
    pub extensions: Vec<&'static str>,
}
