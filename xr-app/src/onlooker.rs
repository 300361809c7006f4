//! Who is shown what the eyes see, beside the headset.

use engine::Result;
use engine::gpu::{Image, Recorder};

/// Somebody beside the headset. A frame is [`take`](Onlooker::take), its submission, and
/// [`show`](Onlooker::show).
pub trait Onlooker {
    /// Returns true if nobody looks any more, which ends the session.
    fn gone(&self) -> bool;
    /// Frames that were shown, and frames for which there was no picture.
    fn counts(&self) -> [u64; 2];
    /// Records a copy of what the eyes see, with a layer for each, if that holds nobody up.
    fn take(&mut self, recorder: &mut Recorder, eyes: &Image) -> Result<()>;
    /// Shows the copy, once the frame has been handed over in which it was recorded.
    fn show(&mut self) -> Result<()>;
}
