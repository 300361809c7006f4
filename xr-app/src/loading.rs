//! What eyes see while the scene is made ready: a few words, at once, instead of seconds of black.

use engine::gpu::Gpu;
use engine::render::{Look, Quality, QualityLevel, Scene, mode};
use engine::splat::{Activations as _, Splat, SplatSet};
use engine::{Result, transfer};

use crate::headset::Headset;
use crate::viewer::{Options, Viewer};

/// The words.
const WORDS: &str = "Loading the patient …";

/// Makes something of the device after the headset has shown the words, which stay: a runtime shows the last frame
/// until the next one. Frames meanwhile would use the device's queue beside what is made, which Vulkan forbids. Returns
/// it, and true if the session has ended.
///
/// # Errors
/// Returns the errors of the headset, then those of `make`.
pub fn while_loading<T>(
    gpu: &Gpu,
    headset: &mut dyn Headset,
    background: [f32; 3],
    make: impl FnOnce() -> Result<T>,
) -> Result<(T, bool)> {
    let over = show(gpu, headset, background)?;
    Ok((make()?, over))
}

/// Shows the words over a scene in which nothing is seen. Returns true if the session has ended.
fn show(gpu: &Gpu, headset: &mut dyn Headset, background: [f32; 3]) -> Result<bool> {
    let mut nothing = Splat { rotation: [1.0, 0.0, 0.0, 0.0], intensity: -1000.0, ..Splat::default() };
    nothing.set_scale([1.0; 3]);
    let set = SplatSet { splats: vec![nothing], ..SplatSet::default() };
    let look = Look::new(transfer::load(transfer::FIRST, [-1000.0, 1000.0])?);
    let scene = Scene::new(gpu, Some(&set), None, &look)?;
    let quality = Quality { resolution: 0.1, ..Quality::FULL };
    let options = Options {
        levels: vec![QualityLevel { mode: mode("alpha")?.name, quality, cost: 1.0 }],
        budget_ms: None,
        level: Some(0),
        background,
        frames: None,
        panel: false,
        foveation: None,
        pitch: 1.0,
        given_up: None,
        card: false,
        start: None,
    };
    Viewer::of(gpu, scene, &headset.description().clone(), options)?.show_words(headset, WORDS)
}
