//! What the loop asks of a headset.

use engine::Result;
use engine::gpu::{Image, Recorder};
use engine::render::Triangle;

use super::hands::Hands;
use super::pose::{Eye, Eyes};
use super::session::{Description, Event, Timing};

/// Distances along the viewing direction that depths 0 and 1 stand for, metres: depth = far (z - near) / (z
/// (far - near)).
pub const DEPTH_RANGE: [f64; 2] = [0.05, 100.0];

/// The images of a frame, with a layer for each eye; they belong to the headset.
pub struct FrameImages<'a> {
    /// The picture.
    pub colour: &'a mut Image,
    /// Its depth, where the headset takes that.
    pub depth: Option<&'a mut Image>,
}

impl FrameImages<'_> {
    /// Returns all of it, to be drawn over.
    pub fn pictures(&mut self) -> Vec<&mut Image> {
        std::iter::once(&mut *self.colour).chain(self.depth.as_deref_mut()).collect()
    }
}

/// A headset with a session. A frame is [`wait`](Headset::wait), [`acquire_images`](Headset::acquire_images),
/// [`release_images`](Headset::release_images), [`eyes`](Headset::eyes), the submission, and
/// [`end`](Headset::end), in this order; one that nobody sees is `wait` and `end`.
pub trait Headset {
    /// Returns what does not change.
    fn description(&self) -> &Description;
    /// Returns what lenses hide of the pictures of each eye, in tangents; nothing where the headset does not
    /// say so. It changes with [`Event::Lenses`].
    fn lenses(&self) -> &[Vec<Triangle>; 2];
    /// Takes note of what happened, and starts and ends the session as the runtime wants it.
    fn poll(&mut self) -> Result<Vec<Event>>;
    /// Returns true if frames are wanted.
    fn running(&self) -> bool;
    /// Waits until it is time for the next frame.
    fn wait(&mut self) -> Result<Timing>;
    /// Returns what the hands will do when a frame is seen.
    fn hands(&mut self, timing: &Timing) -> Result<Hands>;
    /// Acquires the images of the frame. What they hold is not defined.
    fn acquire_images(&mut self, recorder: &mut Recorder) -> Result<FrameImages<'_>>;
    /// Releases the images, as far as recording goes, and waits until the device may draw into them.
    fn release_images(&mut self, recorder: &mut Recorder) -> Result<()>;
    /// Returns where the eyes will be when a frame is seen: to be asked as late as possible.
    fn eyes(&mut self, timing: &Timing) -> Result<Eyes>;
    /// Ends a frame. With eyes, shows the images, as these eyes saw them.
    fn end(&mut self, timing: &Timing, seen: Option<&[Eye; 2]>) -> Result<()>;
    /// Asks for the end of the session, which comes as an event.
    fn request_exit(&mut self) -> Result<()>;
}
