//! Onlookers: those who are shown what the eyes see, beside the headset.

use engine::Result;
use engine::gpu::{Image, Recorder};

/// An onlooker beside the headset. A frame consists of [`take`](Onlooker::take), its submission, and
/// [`show`](Onlooker::show).
pub trait Onlooker {
    /// Returns true if nobody looks any more; this ends the session.
    fn gone(&self) -> bool;
    /// Returns the number of frames that were shown, and of frames for which there was no picture.
    fn counts(&self) -> [u64; 2];
    /// Records a copy of what the eyes see, with a layer for each, if that delays nobody.
    fn take(&mut self, recorder: &mut Recorder, eyes: &Image) -> Result<()>;
    /// Shows the copy, after the frame in which it was recorded has been submitted.
    fn show(&mut self) -> Result<()>;
}
