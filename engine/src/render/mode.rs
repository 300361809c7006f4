//! What every way to render a scene can do.

use super::quality::Quality;
use super::scene::Scene;
use super::target::Target;
use crate::error::Result;
use crate::gpu::Recorder;
use crate::passes::{Views, Work};

/// A way to render a scene.
pub trait Mode {
    /// Records the rendering of `views`, one for each layer of the target. The part of the target that the quality takes is
    /// overwritten.
    fn record(
        &mut self,
        recorder: &mut Recorder,
        scene: &Scene,
        views: &Views,
        target: &mut Target,
        quality: &Quality,
    ) -> Result<()>;

    /// Looks at what a frame that has finished needed, and makes room where that was more than there was. Whether the
    /// frame must be rendered again.
    fn settle(&mut self) -> Result<bool> {
        Ok(false)
    }

    /// What the last frame was made of; all 0 for a mode without splats. Waits for the device.
    fn work(&self) -> Result<Work> {
        Ok(Work::default())
    }
}
