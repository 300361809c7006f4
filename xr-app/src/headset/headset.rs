//! The trait of a headset, as the loop uses it.

use engine::Result;
use engine::gpu::{Image, Recorder};
use engine::render::Triangle;

use super::hands::{Hands, Pulse};
use super::pose::{Eye, Eyes};
use super::session::{Description, Event, Timing};

/// Distances along the viewing direction of depths 0 and 1, metres: depth = far (z - near) / (z (far -
/// near)).
pub const DEPTH_RANGE: [f64; 2] = [0.05, 100.0];

/// The images of a frame, with a layer for each eye; they belong to the headset.
pub struct FrameImages<'a> {
    /// Colour of the picture.
    pub colour: &'a mut Image,
    /// Depth of the picture, if the headset takes it.
    pub depth: Option<&'a mut Image>,
}

impl FrameImages<'_> {
    /// Returns colour and depth, to be drawn over.
    pub fn pictures(&mut self) -> Vec<&mut Image> {
        std::iter::once(&mut *self.colour).chain(self.depth.as_deref_mut()).collect()
    }
}

/// A headset with a session. A frame consists of [`wait`](Headset::wait),
/// [`acquire_images`](Headset::acquire_images), [`release_images`](Headset::release_images),
/// [`eyes`](Headset::eyes), the submission, and [`end`](Headset::end), in this order; a frame that nobody
/// sees, of `wait` and `end`.
pub trait Headset {
    /// Returns the properties that do not change.
    fn description(&self) -> &Description;
    /// Returns the areas of each eye's picture that the lenses hide, in tangents; empty if the headset does
    /// not tell them. They change with [`Event::Lenses`].
    fn lenses(&self) -> &[Vec<Triangle>; 2];
    /// Returns the events since the last call. Starts and ends the session when the runtime wants it.
    fn poll(&mut self) -> Result<Vec<Event>>;
    /// Returns true if frames are wanted.
    fn running(&self) -> bool;
    /// Waits until it is time for the next frame.
    fn wait(&mut self) -> Result<Timing>;
    /// Returns what the hands will do when the frame is seen.
    fn hands(&mut self, timing: &Timing) -> Result<Hands>;
    /// Lets the controller in the left (0) or the right (1) hand vibrate, if it can.
    fn pulse(&mut self, side: usize, pulse: &Pulse) -> Result<()>;
    /// Acquires the images of the frame. Their content is undefined.
    fn acquire_images(&mut self, recorder: &mut Recorder) -> Result<FrameImages<'_>>;
    /// Records the release of the images, and waits until the device may draw into them.
    fn release_images(&mut self, recorder: &mut Recorder) -> Result<()>;
    /// Returns the poses of the eyes when the frame is seen. It should be called as late as possible.
    fn eyes(&mut self, timing: &Timing) -> Result<Eyes>;
    /// Ends a frame. With `seen` it shows the images, rendered for these eyes.
    fn end(&mut self, timing: &Timing, seen: Option<&[Eye; 2]>) -> Result<()>;
    /// Asks for the end of the session, which comes as an event.
    fn request_exit(&mut self) -> Result<()>;
}
