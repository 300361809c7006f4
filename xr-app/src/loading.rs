//! What eyes see while the scene is made ready: a few words, at once, instead of seconds of black.

use std::sync::atomic::{AtomicBool, Ordering};

use engine::gpu::Gpu;
use engine::render::{Look, Quality, QualityLevel, Scene, mode};
use engine::splat::{Activations as _, Splat, SplatSet};
use engine::{Error, Kind, Result, transfer};

use crate::headset::Headset;
use crate::viewer::{Options, Viewer};

/// The words.
const WORDS: &str = "Loading the patient …";

/// Makes something of the device while the headset shows that it is being made. Returns it, and true if the session has
/// ended meanwhile.
///
/// # Errors
/// Returns the errors of `make` before those of the headset.
pub fn while_loading<T>(
    gpu: &Gpu,
    headset: &mut dyn Headset,
    background: [f32; 3],
    make: impl FnOnce() -> Result<T>,
) -> Result<(T, bool)> {
    let done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let shown = scope.spawn(|| show(gpu, headset, background, &done));
        let made = make();
        done.store(true, Ordering::Relaxed);
        let shown = shown.join().unwrap_or_else(|_| {
            Err(Error::new(Kind::Internal, "VGS-XR-034", "what shows that the patient is loaded has failed"))
        });
        Ok((made?, shown?))
    })
}

/// Shows the words over a scene in which nothing is seen. Returns true if the session has ended.
fn show(gpu: &Gpu, headset: &mut dyn Headset, background: [f32; 3], done: &AtomicBool) -> Result<bool> {
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
    Viewer::of(gpu, scene, &headset.description().clone(), options)?.show_words(headset, WORDS, done)
}
