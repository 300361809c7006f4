//! The headset as the loop sees it: a clock, eyes, hands, and pictures to draw into.
//!
//! Poses are in metres in a room whose y points up and whose -z points away from where the viewer stood at
//! the start, as in OpenXR. Times are nanoseconds of the headset's own clock.
//!
//! | file | what is there |
//! |---|---|
//! | `headset` | [`Headset`]: the trait of a headset, and the order of its calls |
//! | `pose`, `hands`, `session` | poses and eyes, the state of hands, the state and events of a session |
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

pub use hands::{HOLDS, Hand, Hands, JOINTS, Joint, Pulse};
pub use headset::{DEPTH_RANGE, FrameImages, Headset};
pub use pose::{Eye, Eyes, Pose};
pub use session::{Backdrop, Background, Blend, Description, Event, SessionState, Timing};
