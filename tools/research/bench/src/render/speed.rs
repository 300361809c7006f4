//! Times frames, after their pictures have been checked.
//!
//! Each rendering has a device object, a scene and buffers of its own, so that its memory is its own, too.
//! Frames are rendered in rounds, one of each rendering from the same camera, so that a noisy machine affects
//! all alike.

use engine::Result;
use engine::gpu::{Gpu, GpuOptions};
use engine::image::Image;
use engine::render::{Camera, Look, Scene, VolumeSource};
use engine::splat::SplatSet;
use engine::volume::edges::Edges;
use engine::volume::{self, BetweenSlices};

use super::accuracy::{checked, mse};
use super::config::{Classify, Part, Rendering};
use super::plan::{Unit, mode_row};
use super::record::{Record, Timing};
use super::scenes::{Place, TimedRenderer, check_validation, shows_something};
use crate::cost::Passes;

/// Least PSNR against the most accurate picture, dB: below it the picture is another one, and its time means
/// nothing.
const LEAST_PSNR: f64 = 15.0;

/// Mode that renders splats with colours of their own.
const COLOURED: &str = "alpha";

/// Returns the rendering that others are checked against: of splats or of a volume.
fn judge(of_splats: bool) -> Rendering {
    let mode = if of_splats { "exact" } else { "volume" };
    let name = format!("the most accurate {mode}");
    Rendering { name, mode: mode.into(), step: 0.25, classification: Some(Classify::Point), computed: false }
}

/// Rendering with its device, scene and renderer.
struct Contestant {
    rendering: Rendering,
    name: String,
    /// True if the volume is rendered without its mask.
    whole: bool,
    of_splats: bool,
    gpu: Gpu,
    scene: Scene,
    renderer: TimedRenderer,
}

/// Times all renderings of a unit of `speed` or `table5`. `saw` is called with the frames of each rendering
/// and transfer function.
pub fn measure(
    unit: &Unit,
    place: &Place,
    set: &SplatSet,
    options: &GpuOptions,
    saw: &mut dyn FnMut(&Timing),
) -> Result<Record> {
    let mut record = Record {
        key: unit.key(),
        splats: set.splats.len(),
        of_colours: set.colours.is_some(),
        roi_voxels: place.roi.weight_sum(),
        ..Record::default()
    };
    let views = unit.views();
    let cameras = place.cameras(&unit.orbit, &views)?;
    let first = Look::new(place.transfer(&unit.transfers[0])?);
    let mut contestants = Vec::new();
    for rendering in &unit.renderings {
        let of_splats = mode_row(rendering).is_some_and(|row| row.of_splats);
        if of_splats && record.of_colours && rendering.mode != COLOURED {
            let why = "these splats have colours and no intensity";
            record.left_out.push(format!("{} is left out: {why}", rendering.name));
            continue;
        }
        for whole in [false, true] {
            if !whole || unit.part.whole && !of_splats {
                contestants.push(Contestant::new(unit, rendering, whole, place, set, options, &first)?);
            }
        }
    }
    for transfer in &unit.transfers {
        let look = Look::new(place.transfer(transfer)?);
        contestants.iter_mut().try_for_each(|c| c.scene.set_look(&look))?;
        let mut judged = None;
        let mut racing = Vec::new();
        for contestant in &mut contestants {
            match contestant.verify(unit.part.size, cameras[0], record.of_colours, &mut judged)? {
                Verdict::Right(mse) => racing.push((contestant, mse)),
                Verdict::Wrong(why) => {
                    record
                        .left_out
                        .push(format!("{}: {} is not timed: {why}", transfer.name, contestant.name));
                }
            }
        }
        for timing in race(&transfer.name, &look, racing, &views, &cameras, &unit.part)? {
            saw(&timing);
            record.timings.push(timing);
        }
    }
    contestants.iter().try_for_each(|contestant| check_validation(&contestant.gpu))?;
    Ok(record)
}

/// Result of checking a contestant's picture.
enum Verdict {
    /// The picture is right; its mean squared error, if there was something to compare it with.
    Right(Option<f64>),
    Wrong(String),
}

impl Contestant {
    fn new(
        unit: &Unit,
        rendering: &Rendering,
        whole: bool,
        place: &Place,
        set: &SplatSet,
        options: &GpuOptions,
        look: &Look,
    ) -> Result<Self> {
        let of_splats = mode_row(rendering).is_some_and(|row| row.of_splats);
        let gpu = Gpu::new(options)?;
        let (volume, roi) = volume::shown(
            &place.volume,
            (!whole).then_some(&place.roi),
            BetweenSlices::default(),
            Edges::default(),
        );
        let ct = VolumeSource { volume: &volume, roi: roi.as_deref() };
        let scene = match of_splats {
            true => Scene::new(&gpu, Some(set), None, look)?,
            false => Scene::new(&gpu, None, Some(&ct), look)?,
        };
        let renderer = TimedRenderer::new(&gpu, &scene, rendering, unit.part.size, 1, false)?;
        let name = if whole { format!("{}, whole CT", rendering.name) } else { rendering.name.clone() };
        Ok(Contestant { rendering: rendering.clone(), name, whole, of_splats, gpu, scene, renderer })
    }

    /// Compares the contestant's first picture with the most accurate one. That of the splats, which takes
    /// longest, is the same for all and is rendered once and kept in `judged`.
    fn verify(
        &mut self,
        size: u32,
        camera: Camera,
        of_colours: bool,
        judged: &mut Option<Image>,
    ) -> Result<Verdict> {
        self.renderer.frame(&self.scene, &[camera])?;
        let picture = checked(self.renderer.picture(0)?, &self.rendering)?;
        if !shows_something(&picture) {
            return Ok(Verdict::Wrong("nothing is seen in its picture".into()));
        }
        if self.of_splats && of_colours {
            return Ok(Verdict::Right(None));
        }
        let kept = if self.of_splats { judged.take() } else { None };
        let wanted = match kept {
            Some(wanted) => wanted,
            None => self.most_accurate(size, camera)?,
        };
        let error = mse(&wanted, &picture)?;
        if self.of_splats {
            *judged = Some(wanted);
        }
        Ok(verdict(error))
    }

    fn most_accurate(&self, size: u32, camera: Camera) -> Result<Image> {
        let rendering = judge(self.of_splats);
        let mut renderer = TimedRenderer::new(&self.gpu, &self.scene, &rendering, size, 1, true)?;
        renderer.frame(&self.scene, &[camera])?;
        checked(renderer.picture(0)?, &rendering)
    }
}

fn verdict(mse: f64) -> Verdict {
    let psnr = -10.0 * mse.log10();
    if psnr >= LEAST_PSNR {
        return Verdict::Right(Some(mse));
    }
    Verdict::Wrong(format!(
        "its picture is {psnr:.1} dB from the most accurate one, and {LEAST_PSNR} are needed"
    ))
}

/// Renders in rounds and returns the times of each contestant: warm-up from every camera first, then frame i
/// from camera i, i + 1, and so on, at last a frame from each after the look was given again, which is as
/// much work as another look.
fn race(
    transfer: &str,
    look: &Look,
    mut racing: Vec<(&mut Contestant, Option<f64>)>,
    views: &[usize],
    cameras: &[Camera],
    part: &Part,
) -> Result<Vec<Timing>> {
    for _ in 0..part.warm_up {
        for camera in cameras {
            for (contestant, _) in &mut racing {
                contestant.renderer.frame(&contestant.scene, &[*camera])?;
            }
        }
    }
    let mut timings: Vec<Timing> = racing
        .iter()
        .map(|(contestant, mse)| Timing {
            transfer: transfer.to_owned(),
            rendering: contestant.name.clone(),
            mode: contestant.rendering.mode.clone(),
            whole: contestant.whole,
            mse: *mse,
            frames: Vec::new(),
            changes: Vec::new(),
            passes: Passes::default(),
            memory: Default::default(),
        })
        .collect();
    for (&view, camera) in views.iter().zip(cameras).cycle().take(part.frames) {
        for ((contestant, _), timing) in racing.iter_mut().zip(&mut timings) {
            let (cost, passes) = contestant.renderer.frame(&contestant.scene, &[*camera])?;
            timing.frames.push((view, cost));
            timing.passes.add(passes);
        }
    }
    for camera in cameras {
        for ((contestant, _), timing) in racing.iter_mut().zip(&mut timings) {
            let Contestant { scene, renderer, .. } = &mut **contestant;
            timing.changes.push(renderer.change(scene, look, *camera)?);
        }
    }
    for ((contestant, _), timing) in racing.iter().zip(&mut timings) {
        let memory = contestant.gpu.memory_by_purpose();
        timing.memory =
            memory.into_iter().filter(|&(_, bytes)| bytes > 0).map(|(p, b)| (p.to_owned(), b)).collect();
    }
    Ok(timings)
}
