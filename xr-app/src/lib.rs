//! Splats in a headset: stereo through OpenXR, within the frame budget.
//!
//! ```text
//! main ─► viewer ─► headset (openxr or simulated): clock, eyes, hands, pictures
//!                ─► controls ─► placement          what hands do to the patient
//!                ─► pointing ─► panel, sheets      what hands point at: egui's panel, readings, distances
//!                            ─► palm               how hands without controllers call the panel
//!                ─► sight                          which views are rendered, and what of them no eye sees
//!                ─► composer                       what was rendered, into the pictures of the eyes
//!                ─► onlooker (mirror)              who is shown the same: a window of the desktop, where there are any
//!                ─► statistics                     what is reported
//!      ─► memory                                   what fits on the device
//! android ─► arguments, viewer                      the same as an activity of a standalone headset
//! ```
//!
//! `headset::openxr` is the only file with unsafe code; everything else runs and is tested without a runtime.
#![deny(unsafe_code)]

#[cfg(target_os = "android")]
mod android;
pub mod arguments;
pub mod composer;
pub mod controls;
pub mod headset;
pub mod memory;
#[cfg(not(target_os = "android"))]
pub mod mirror;
pub mod onlooker;
pub mod palm;
pub mod panel;
pub mod placement;
pub mod pointing;
pub mod sheets;
pub mod sight;
pub mod statistics;
pub mod viewer;

pub use arguments::Arguments;
#[cfg(not(target_os = "android"))]
pub use arguments::run;
