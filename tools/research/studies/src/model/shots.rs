//! Renders frames, counts their work, and times their passes.

use std::collections::BTreeMap;
use std::path::Path;

use engine::Result;
use engine::gpu::Gpu;
use engine::render::{Camera, Renderer, Scene, Settings, mode};
use serde::{Deserialize, Serialize};

use super::plan::{Place, Shot, Sight, Unit};
use super::work::Work;
use bench::scene::splats_by_importance;
use bench::store::Keep;

/// Frame that was rendered.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Frame {
    /// Way in which the scene was seen.
    pub sight: Sight,
    /// Position of the viewer.
    pub place: Place,
    /// Way in which it was rendered.
    pub shot: Shot,
    /// Work of the frame.
    pub work: Work,
    /// Device time of each pass, ms, by name.
    pub passes: BTreeMap<String, f64>,
}

/// Results of a unit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Unit that was rendered.
    pub unit: Unit,
    /// Number of splats of the scene.
    pub splats: usize,
    /// All frames in which something is drawn.
    pub frames: Vec<Frame>,
}

impl Keep for Record {
    fn key(&self) -> String {
        self.unit.key()
    }
}

/// Renders all frames of a unit, whose splats are in the file `path`, counts their work and times their
/// passes.
pub fn measure(unit: &Unit, path: &Path, gpu: &Gpu) -> Result<Record> {
    let set = splats_by_importance(path)?;
    let range = set.intensity_range().unwrap_or_default();
    let looks = unit.sights.iter().map(|s| s.look(range)).collect::<Result<Vec<_>>>()?;
    let Some(first) = looks.first() else {
        return Ok(Record { unit: unit.clone(), splats: 0, frames: Vec::new() });
    };
    let mut scene = Scene::new(gpu, Some(&set), None, first)?;
    let mut frames = Vec::new();
    for (sight, look) in unit.sights.iter().zip(&looks) {
        scene.set_look(look)?;
        for shot in &unit.shots {
            // One renderer at a time: their buffers are the largest there are.
            let mut timed = Vec::new();
            let mut renderer = Renderer::new(gpu, mode(&shot.mode)?, &scene, &shot.settings())?;
            for &place in &unit.places {
                let cameras = place.cameras(&scene, shot.size, shot.views)?;
                let passes = time(gpu, &mut renderer, &scene, &cameras, shot)?;
                let mut work = begin(&scene, shot);
                work.add_lists(renderer.work()?);
                timed.push((place, cameras, passes, work));
            }
            drop(renderer);
            let settings = Settings { counting: true, precise: true, depth: false, ..shot.settings() };
            let mut counting = Renderer::new(gpu, mode(&shot.mode)?, &scene, &settings)?;
            for (place, cameras, passes, mut work) in timed {
                counting.render_at(&scene, &cameras, &shot.quality())?;
                work.add_pixels(&counting, shot.quality().size(shot.size))?;
                if work.shows_something() {
                    frames.push(Frame { sight: sight.clone(), place, shot: shot.clone(), work, passes });
                }
            }
        }
    }
    Ok(Record { unit: unit.clone(), splats: set.splats.len(), frames })
}

/// Returns the part of a frame's work that is known without counting.
fn begin(scene: &Scene, shot: &Shot) -> Work {
    let [width, height] = shot.quality().size(shot.size).map(f64::from);
    Work {
        mode: shot.mode.clone(),
        views: f64::from(shot.views),
        pixels: width * height * f64::from(shot.views),
        // Four halves, and a float of depth.
        pixel_bytes: if shot.depth { 12.0 } else { 8.0 },
        lit: scene.look().transfer.material.shade,
        integrated: false,
        ..Work::default()
    }
}

/// Renders a frame and returns the device time of each pass, ms.
fn time(
    gpu: &Gpu,
    renderer: &mut Renderer,
    scene: &Scene,
    cameras: &[Camera],
    shot: &Shot,
) -> Result<BTreeMap<String, f64>> {
    // The first frame, which is not timed, creates kernels and makes room in buffers.
    renderer.render_at(scene, cameras, &shot.quality())?;
    gpu.take_profile();
    renderer.render_at(scene, cameras, &shot.quality())?;
    Ok(gpu.take_profile().into_iter().map(|(name, time)| (name, time.total_ms)).collect())
}
