//! All of baking.

use std::ops::ControlFlow;
use std::time::Instant;

use super::options::Options;
use super::state::{BakeState, CurvePoint};
use super::training::Training;
use super::views::Views;
use base::error::{Error, Kind, Result};
use base::unit::Unit;
use gpu::Gpu;
use image::Image;
use render::{Look, Scene};
use splat::harmonics::luminance;
use splat::{SplatSet, by_importance};
use transfer::FixedTo;

/// Mode whose pictures are wanted.
const WANTED: &str = "decoded";

/// Degree of the harmonics under a light that turns with the camera.
const LIT_DEGREE: u8 = 3;

/// Shares of the steps after which splats are split.
const GROWTHS: [f64; 4] = [0.1, 0.2, 0.3, 0.4];
/// Most splats for one of the beginning, where nothing else is said.
const GROWTH: usize = 2;

/// Number of parts of the steps, or of the time, after each of which the curve has a point.
const PARTS: f64 = 5.0;

/// What baking is at.
#[derive(Clone, Debug, PartialEq)]
pub enum Progress {
    /// Wanted pictures are rendered: so many of so many.
    Rendering(usize, usize),
    /// Splats are trained: steps that are done, and the share of all, 0 to 1.
    Training(u32, f64),
}

/// How near the pictures of the splats come to those that are wanted, on views that were not trained: PSNR over black, dB,
/// of pictures as large as [`Options::shown`], of which those of the views have some of the pixels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    /// Of the splats at the beginning, view by view.
    pub before: Vec<f64>,
    /// Of the splats that were baked.
    pub after: Vec<f64>,
    /// From the beginning to the end.
    pub curve: Vec<CurvePoint>,
    /// Steps of the optimiser.
    pub steps: u32,
    /// Time until the wanted pictures were there, s.
    pub rendering_s: f64,
    /// Time that the steps took, s.
    pub training_s: f64,
}

/// Returns the point of the curve after `seconds` of steps, by the PSNR of the views that are not trained.
fn curve_point(training: &Training<'_>, seconds: f64, views: &[f64]) -> CurvePoint {
    CurvePoint {
        step: training.steps(),
        seconds,
        splats: training.rows().len(),
        psnr_db: views.iter().sum::<f64>() / views.len() as f64,
        worst_psnr_db: views.iter().copied().fold(f64::INFINITY, f64::min),
    }
}

/// Splats that were baked.
pub struct Baked {
    /// The splats, as of ordinary 3D Gaussian splatting.
    pub set: SplatSet,
    /// Their rows in the set that they were made of.
    pub rows: Vec<usize>,
    /// Number of splats that the look shows, and of which its transfer function shows nothing; they are left out.
    pub hidden: usize,
    /// How near they come.
    pub report: Report,
    /// Where to go on, if `going` broke off the training.
    pub unfinished: Option<BakeState>,
}

/// Splats that were trained.
pub struct Trained {
    /// The splats, as of ordinary 3D Gaussian splatting.
    pub set: SplatSet,
    /// Their rows in the set of the beginning.
    pub rows: Vec<usize>,
    /// How near they come.
    pub report: Report,
    /// Where to go on, if `going` broke off.
    pub unfinished: Option<BakeState>,
}

/// Fails for a set that cannot be baked.
///
/// # Errors
/// [`Kind::Usage`] for splats with colours and for coded voxels.
pub fn check(set: &SplatSet) -> Result<()> {
    if set.colours.is_some() {
        return Err(Error::new(Kind::Usage, "VGS-BAKE-007", "these splats have colours already")
            .help("give the splats with HU that they are made of; another format of these: vgs convert"));
    }
    if !set.voxels.is_empty() {
        return Err(Error::new(Kind::Usage, "VGS-BAKE-008", "coded voxels, and splats are baked")
            .help("fit splats to the volume: vgs fit"));
    }
    Ok(())
}

/// Returns `set` with colours and opacities with which alpha blending shows what mode decoded shows with `look`. `going`
/// is told what is done, and may break off: the splats are then as far as they have come, and the state that they leave can be
/// given as `resumed`, with the same set, look and options, for the splats of baking that never stopped, bit for bit.
///
/// # Errors
/// Those of [`check`], [`render::baked`](fn@render::baked) and [`Options::check`]; [`Kind::NothingToDo`] where the look
/// shows none of the splats; of the state of something else ([`Kind::BadData`]); and those of the device, as of too many
/// splats for its buffers ([`Kind::Temporary`]).
pub fn bake(
    gpu: &Gpu,
    set: &SplatSet,
    look: &Look,
    options: &Options,
    resumed: Option<&BakeState>,
    going: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Baked> {
    options.check()?;
    check(set)?;
    let begun = Instant::now();
    let mut first = render::baked(gpu, set, look)?;
    if let Some(most) = options.max_splats.filter(|&most| most < first.set.splats.len()) {
        keep_most_important(&mut first, most);
    }
    let render::Baked { set: out, rows, hidden } = first;
    // Without steps, pictures only tell how near they come.
    let moving = if options.iterations > 0 || options.held_out == 0 { options.views } else { 0 };
    let total = moving + options.held_out;
    let unfinished = |out, rows| {
        let rendering_s = begun.elapsed().as_secs_f64();
        let report = Report { rendering_s, ..Report::default() };
        // What was done before is not lost.
        Ok(Baked { set: out, rows, hidden, report, unfinished: resumed.cloned() })
    };
    if out.splats.is_empty() {
        let message = format!("{} shows none of these splats", look.transfer.name);
        return Err(Error::new(Kind::NothingToDo, "VGS-BAKE-009", message)
            .help("choose another --tf, show an object, or leave out --clip"));
    }
    let scene = Scene::new(gpu, Some(set), None, look)?;
    let mut views = |count, shift, before: usize| {
        Views::of_scene(gpu, &scene, WANTED, (count, shift), options.size, &mut |i| {
            going(&Progress::Rendering(before + i, total)).is_continue()
        })
    };
    let Some(held_out) = views(options.held_out, 0.5, 0)? else { return unfinished(out, rows) };
    let mut trained = None;
    if moving > 0 {
        trained = views(moving, 0.0, options.held_out)?;
        if trained.is_none() {
            return unfinished(out, rows);
        }
    }
    let rendering_s = begun.elapsed().as_secs_f64();
    let degree = options.degree.unwrap_or(match out.colours.as_ref().map_or(0, |colours| colours.degree) {
        // A light that turns with the camera changes more from view to view than these hold.
        lit @ 1.. if look.light.fixed_to == FixedTo::Camera => LIT_DEGREE.max(lit),
        lit => lit,
    });
    let Trained { set, rows: origins, report, unfinished } = train(
        gpu,
        out,
        degree,
        [trained.as_ref().unwrap_or(&held_out), &held_out],
        options,
        resumed,
        &mut |step, share| going(&Progress::Training(step, share)),
    )?;
    let rows = origins.iter().map(|&row| rows[row]).collect();
    Ok(Baked { set, rows, hidden, report: Report { rendering_s, ..report }, unfinished })
}

/// Trains the splats of a set with colours by pictures of `views`: first those that they are moved by, then those that only
/// tell how good they are. Their harmonics get this degree. They grow, each to 16 at most, until there are as many as
/// [`Options::max_splats`]. `going` is told steps and share, and may break off; training goes on from the state `resumed`.
///
/// # Errors
/// Those of the device, as of too many splats for its buffers ([`Kind::Temporary`]); [`Kind::Internal`] for a set without
/// splats or colours; [`Kind::BadData`] for the state of another training.
pub fn train(
    gpu: &Gpu,
    first: SplatSet,
    degree: u8,
    [views, held_out]: [&Views; 2],
    options: &Options,
    resumed: Option<&BakeState>,
    going: &mut dyn FnMut(u32, f64) -> ControlFlow<()>,
) -> Result<Trained> {
    let mut training = Training::new(gpu, &first, degree, views, options)?;
    let mut report = Report::default();
    let mut grown = 0;
    let mut behind = 0.0;
    match resumed {
        Some(state) => {
            training.resume(state)?;
            (report.before, report.curve) = (state.before.clone(), state.curve.clone());
            (grown, behind) = (state.grown as usize, state.seconds);
        }
        None => {
            report.before = training.psnr(held_out)?;
            report.curve.push(curve_point(&training, 0.0, &report.before));
        }
    }
    let begun = Instant::now();
    let seconds = || behind + begun.elapsed().as_secs_f64();
    let count = first.splats.len();
    let most = options.max_splats.unwrap_or(GROWTH * count).max(count);
    let mut unfinished = None;
    loop {
        let steps = f64::from(training.steps()) / f64::from(options.iterations.max(1));
        let time = options.time_budget.map_or(0.0, |most| seconds() / most.as_secs_f64());
        let done = steps.max(time);
        let told = going(training.steps(), done.min(1.0));
        if training.steps() >= options.iterations || time >= 1.0 || time.is_nan() {
            break;
        }
        if told.is_break() {
            unfinished = Some(BakeState {
                steps: training.steps(),
                adam_steps: training.adam_steps(),
                grown: grown as u32,
                seconds: seconds(),
                before: report.before.clone(),
                curve: report.curve.clone(),
                splats: training.trainees()?,
            });
            break;
        }
        if PARTS * done >= report.curve.len() as f64 {
            let views = training.psnr(held_out)?;
            report.curve.push(curve_point(&training, seconds(), &views));
        }
        // Splats come in equal factors, while the rates are high.
        let due = GROWTHS.iter().filter(|&&at| at <= done).count();
        if due > grown {
            grown = due;
            let share = due as f64 / GROWTHS.len() as f64;
            let count = (count as f64 * (most as f64 / count as f64).powf(share)).round() as usize;
            match training.grow(count) {
                // Where there is no room for more, these have to do.
                Err(error) if error.kind == Kind::Temporary => grown = GROWTHS.len(),
                other => other?,
            }
        }
        training.step(done)?;
    }
    report.training_s = seconds();
    report.steps = training.steps();
    report.after = training.psnr(held_out)?;
    if report.steps > 0 {
        report.curve.push(curve_point(&training, report.training_s, &report.after));
    }
    let (splats, colours) = training.splats(first.origin_mm)?;
    let rows = training.rows().to_vec();
    let mut set = first.of_rows(&rows);
    set.splats = splats;
    for (i, splat) in set.splats.iter_mut().enumerate() {
        splat.intensity = luminance(colours.of(i));
    }
    set.colours = Some(colours);
    set.unit = Unit::Luminance;
    Ok(Trained { set, rows, report, unfinished })
}

/// Returns the pictures of a set with colours from the cameras of `views`, over black, as other viewers draw them.
///
/// # Errors
/// Those of the device; [`Kind::Internal`] for a set without splats or colours.
pub fn pictures(gpu: &Gpu, set: &SplatSet, views: &Views) -> Result<Vec<Image>> {
    let degree = set.colours.as_ref().map_or(0, |colours| colours.degree);
    let mut drawn =
        Training::new(gpu, set, degree, views, &Options { shown: views.size[0], ..Options::default() })?;
    views.cameras.iter().map(|camera| drawn.picture(camera)).collect()
}

/// Keeps the most important splats, in the order in which they are.
fn keep_most_important(baked: &mut render::Baked, most: usize) {
    let importance = by_importance(&baked.set.splats, &baked.set.field);
    let mut order: Vec<usize> = importance.into_iter().map(|row| row as usize).collect();
    order.truncate(most);
    order.sort_unstable();
    baked.rows = order.iter().map(|&i| baked.rows[i]).collect();
    baked.set = baked.set.of_rows(&order);
}
