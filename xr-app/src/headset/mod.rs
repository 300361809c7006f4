//! What a headset is to the loop: a clock, eyes, hands, and pictures to draw into.
//!
//! Poses are in metres in a room whose y points up and whose -z points away from where the viewer stood at
//! the start, as OpenXR has it. Times are nanoseconds of a clock of the headset's own.
//!
//! | file | what is there |
//! |---|---|
//! | `headset` | [`Headset`]: what the loop asks of a headset, and in which order |
//! | `pose`, `hands`, `session` | poses and eyes, what hands do, what a session says |
//! | `openxr` | a headset through OpenXR; `actions` are its controllers, `convert` its numbers, `error` its errors |
//! | `simulated` | a headset that follows a script |

mod actions;
mod convert;
mod error;
mod hands;
mod headset;
pub mod openxr;
mod pose;
mod session;
pub mod simulated;

pub use hands::{Hand, Hands};
pub use headset::{DEPTH_RANGE, FrameImages, Headset};
pub use pose::{Eye, Eyes, Pose};
pub use session::{Blend, Description, Event, SessionState, Timing};
