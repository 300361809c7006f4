//! What eyes see while the scene is made ready: a few words, at once, instead of seconds of black.

use engine::gpu::Gpu;
use engine::render::{Look, Quality, QualityLevel, Scene, mode};
use engine::splat::{Activations as _, Splat, SplatSet};
use engine::{Result, transfer};

use crate::headset::Headset;
use crate::viewer::{Options, Viewer};

/// The words.
const WORDS: &str = "Loading …";

/// Shows the words, which stay while the scene is made: a runtime shows the last frame until the next one. (Frames
/// meanwhile would use the device's queue beside what is made, which Vulkan forbids.) Returns true if the session has
/// ended.
///
/// # Errors
/// Returns the errors of the headset and of the device.
pub fn show(gpu: &Gpu, headset: &mut dyn Headset, background: [f32; 3]) -> Result<bool> {
    let mut nothing = Splat { rotation: [1.0, 0.0, 0.0, 0.0], intensity: -1000.0, ..Splat::default() };
    nothing.set_scale([1.0; 3]);
    let set = SplatSet { splats: vec![nothing], ..SplatSet::default() };
    let look = Look::new(transfer::load(transfer::FIRST, [-1000.0, 1000.0])?);
    let scene = Scene::new(gpu, Some(&set), None, &look)?;
    let quality = Quality { resolution: 0.1, ..Quality::FULL };
    let levels = vec![QualityLevel { mode: mode("alpha")?.name, quality, cost: 1.0 }];
    let options = Options { level: Some(0), background, ..Options::of_levels(levels) };
    Viewer::new(gpu, scene, headset, options)?.show_words(headset, WORDS)
}
