//! Splats in a headset: stereo through OpenXR, within the frame budget.
//!
//! The map, with the arrows that are allowed ("A -> B": A may use B; `tests/tests/arrows` checks them):
//!
//! ```text
//! android -> program -> arguments -> mirror -> onlooker          arguments, android -> headset
//! program -> viewer -> placement -> headset          program -> memory, pointing, statistics
//! program -> loading -> viewer, headset          viewer -> keeping          program -> keeping
//! program, arguments -> inputs -> start          program, viewer, controls -> start
//! viewer -> bodies, controls, pointing, sight, composer, statistics, onlooker          viewer, bodies -> rods          bodies -> headset
//! pointing -> controls -> placement -> headset          pointing -> outline, palm          pointing -> marks -> panel, sheets
//! viewer, pointing, controls -> feedback -> headset          panel -> card
//! composer -> sight, sheets, rods -> placement -> headset          sheets, rods -> eye_drawing -> headset
//! statistics -> placement -> headset          palm -> headset
//! program    reads what is shown, starts a headset, shows it until the session ends
//! inputs     what is shown: splats, a volume or a session; `start` is the view to begin with
//! android    the same as an activity of a standalone headset
//! viewer     the loop: a frame of the headset, from its hands to its pictures
//! headset    a clock, eyes, hands and pictures, of OpenXR or simulated
//! controls   what hands do to the patient, who is where `placement` says
//! pointing   what hands point at: egui's panel, readings, distances; `palm` is how bare hands call the panel
//! feedback   what the user is told beside the picture: pulses, words
//! panel, marks   what egui draws in the room; `card` says what hands do, `outline` where a plane cuts
//! bodies     what the hands look like: `rods` of controllers and gloves
//! sight      which views are rendered, and what of them no eye sees
//! composer   what was rendered, into the pictures of the eyes
//! onlooker   who is shown the same: `mirror` is a window of the desktop, where there are any
//! statistics what is reported
//! memory     what fits on the device
//! loading    what eyes see until the scene is ready
//! keeping    the session file of what was made
//! ```
//!
//! Unsafe code is only in `headset::openxr` and in the entry of `android`; everything else runs and is tested
//! without a runtime.
#![deny(unsafe_code)]

#[cfg(target_os = "android")]
mod android;
pub mod arguments;
pub mod bodies;
pub mod card;
pub mod composer;
pub mod controls;
pub mod eye_drawing;
pub mod feedback;
pub mod headset;
pub mod inputs;
pub mod keeping;
pub mod loading;
pub mod marks;
pub mod memory;
#[cfg(not(target_os = "android"))]
pub mod mirror;
pub mod onlooker;
pub mod outline;
pub mod palm;
pub mod panel;
pub mod placement;
pub mod pointing;
mod program;
pub mod rods;
pub mod sheets;
pub mod sight;
pub mod start;
pub mod statistics;
pub mod viewer;

pub use arguments::HeadsetArguments;
#[cfg(not(target_os = "android"))]
pub use program::run;
