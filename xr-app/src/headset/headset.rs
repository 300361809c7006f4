//! What the loop asks of a headset.

use engine::Result;
use engine::gpu::{Image, Recorder};
use engine::render::Triangle;

use super::hands::Hands;
use super::pose::{Eye, Eyes};
use super::session::{Description, Event, Timing};

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
