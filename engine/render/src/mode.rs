//! The trait that every way to render a scene implements.

use super::part::Part;
use super::quality::Quality;
use super::scene::Scene;
use super::target::Target;
use base::error::Result;
use gpu::Recorder;
use passes::{Views, Work};

/// A way to render a scene.
pub trait Mode {
    /// Records the rendering of a part of `views`, one for each layer of the target. The parts of a picture, in their
    /// order, overwrite the corner of the target that `quality` says.
    fn record(
        &mut self,
        recorder: &mut Recorder,
        scene: &Scene,
        views: &Views,
        target: &mut Target,
        quality: &Quality,
        part: Part,
    ) -> Result<()>;

    /// Creates the pipelines that a change of the transfer function may ask for, so that no frame of a drag does.
    fn warm_up(&mut self, _scene: &Scene) -> Result<()> {
        Ok(())
    }

    /// Takes what the scene's splats were decoded to last in place of what they were before, from the next frame on.
    fn renew(&mut self, _scene: &Scene) {}

    /// Grows the buffers that the last finished frame found too small. Returns true if the frame must be
    /// rendered again.
    fn settle(&mut self) -> Result<bool> {
        Ok(false)
    }

    /// Returns the work of the last frame; all 0 for a mode without splats. Waits for the device.
    fn work(&self) -> Result<Work> {
        Ok(Work::default())
    }
}
