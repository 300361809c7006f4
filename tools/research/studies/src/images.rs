//! `studies images`: splats trained from nothing by rendered pictures, as 3D Gaussian splatting is (Kerbl et al. 2023),
//! beside a fit of as many splats to the voxels.
//!
//! All are held against mode `volume` on views that none was trained with, by the function that the pictures had and by
//! another, which splats of fixed colours cannot follow.

use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use engine::bake::{Options, Rates, Views, bake, pictures, train};
use engine::gpu::Gpu;
use engine::image::{Align, Image, WriteOptions, flip, line_height, psnr, ssim, write};
use engine::render::{Look, OF_VOLUMES, Scene, VolumeSource};
use engine::splat::harmonics::SH0;
use engine::splat::{self, Harmonics, Splat, SplatSet};
use engine::unit::Unit;
use engine::volume::edges::Edges;
use engine::volume::{self, BetweenSlices, LabelChoice, Roi, Volume};
use engine::{Error, Kind, Result, output, transfer};
use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Opacity of first splats (Kerbl et al. 2023).
const FIRST_OPACITY: f32 = 0.1;
/// Gap around the pictures of the figure, pixels, and size of its letters.
const GAP: usize = 8;
const LETTERS: f32 = 18.0;

/// Splats trained from nothing by rendered pictures, beside a fit to the voxels.
#[derive(Args)]
#[command(after_help = "\
Example:
  vgs fit ct.nii.gz --roi bones.nii.gz -o bones.ply
  studies images ct.nii.gz --roi bones.nii.gz --fit bones.ply --steps 7000 --figure images.png")]
pub struct ImagesArguments {
    /// The volume.
    volume: PathBuf,
    /// The mask of the region.
    #[arg(long)]
    roi: PathBuf,
    /// A fit of both, as many splats as which are trained, with the record that `vgs fit` writes beside it: rows of equal
    /// time are trained as long as it took.
    #[arg(long)]
    fit: PathBuf,
    /// Transfer function of the pictures.
    #[arg(long, default_value = "CT-Bone")]
    function: String,
    /// The other one.
    #[arg(long, default_value = "CT-Soft-Tissue")]
    other: String,
    /// Pictures to train with (the paper: 500).
    #[arg(long, default_value_t = 500)]
    views: usize,
    /// Pictures that only tell how good the splats are.
    #[arg(long, default_value_t = 16)]
    held_out: usize,
    /// Width and height of all of them, pixels.
    #[arg(long, default_value_t = 256)]
    size: u32,
    /// Steps of the rows that take more time.
    #[arg(long, default_value_t = 7000)]
    steps: u32,
    /// File for the rows (CSV).
    #[arg(long, default_value = "images.csv")]
    out: PathBuf,
    /// Picture of one view by both functions (PNG).
    #[arg(long)]
    figure: Option<PathBuf>,
    /// Replaces both.
    #[arg(long)]
    force: bool,
}

/// Returns the pictures of a scene from places all around.
///
/// # Errors
/// Those of the renderer.
pub fn views_of(
    gpu: &Gpu,
    scene: &Scene,
    mode: &str,
    (count, shift): (usize, f64),
    size: u32,
) -> Result<Views> {
    Views::of_scene(gpu, scene, mode, (count, shift), size, &mut |_| true)?.ok_or_else(given_up)
}

/// Returns the error of pictures that nobody gives up.
pub fn given_up() -> Error {
    Error::new(Kind::Internal, "VGS-BEN-064", "pictures that were given up")
}

/// Pictures of a way to show the volume, by its function and by the other one.
struct Shown {
    name: &'static str,
    pictures: [Vec<Image>; 2],
}

/// What a method takes.
#[derive(Clone, Copy)]
struct Cost {
    /// Time, s.
    seconds: f64,
    /// Most device memory, with the pictures that are trained.
    bytes: u64,
}

impl Cost {
    /// Returns that of a fit, from its record.
    fn of_record(path: &Path) -> Result<Self> {
        let text = std::fs::read(path).map_err(|e| Error::io(path, "reading", &e))?;
        let record: serde_json::Value = serde_json::from_slice(&text).unwrap_or_default();
        let results = &record["results"];
        let Some((seconds, bytes)) = results["seconds"].as_f64().zip(results["device_peak_bytes"].as_u64())
        else {
            let message = "no record of a finished fit";
            return Err(Error::new(Kind::BadData, "VGS-BEN-068", message)
                .file(path)
                .help("fit anew: vgs fit"));
        };
        Ok(Cost { seconds, bytes })
    }
}

/// Trains, renders and measures.
///
/// # Errors
/// Those of reading, training and writing.
pub fn run(gpu: &Gpu, arguments: &ImagesArguments) -> Result<()> {
    output::check_writable(&arguments.out, arguments.force)?;
    let volume = Volume::read(&arguments.volume, &volume::ReadOptions::default())?;
    let mask = Volume::read(&arguments.roi, &volume::ReadOptions::default())?;
    let roi = Roi::from_mask(&mask, &LabelChoice::Whole, &volume)?;
    let fit = splat::read(&arguments.fit, &splat::ReadOptions::default())?;
    let of_fit = Cost::of_record(&arguments.fit.with_extension("run.json"))?;
    let range = fit.intensity_range().unwrap_or([0.0, 1.0]);
    let mut looks = Vec::new();
    for name in [&arguments.function, &arguments.other] {
        let mut function = transfer::load(name, range)?;
        function.material.shade = false;
        looks.push(Look::new(function));
    }
    // As programs show it: against the bare mask a fit would be wrong at every edge.
    let (as_shown, region) = volume::shown(&volume, Some(&roi), BetweenSlices::default(), Edges::default());
    let source = VolumeSource { volume: &as_shown, roi: region.as_deref() };
    let mut scene = Scene::new(gpu, None, Some(&source), &looks[0])?;
    let views =
        |scene: &Scene, count, shift| views_of(gpu, scene, OF_VOLUMES, (count, shift), arguments.size);
    let begun = std::time::Instant::now();
    let trained = views(&scene, arguments.views, 0.0)?;
    let pictures_s = begun.elapsed().as_secs_f64();
    eprintln!("{} pictures of {1}x{1} in {pictures_s:.0} s", arguments.views, arguments.size);
    let pictures_bytes = trained.wanted.iter().map(|wanted| wanted.bytes()).sum::<u64>();
    let held_out = views(&scene, arguments.held_out, 0.5)?;
    scene.set_look(&looks[1])?;
    let changed = views(&scene, arguments.held_out, 0.5)?;
    let truth = [held_out.pictures()?, changed.pictures()?];

    let case = arguments.fit.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let mut table =
        "case,function,method,splats,bytes,steps,training_s,pictures,pictures_s,psnr_db,ssim,flip,\
                     device_bytes,other_function,other_psnr_db\n"
            .to_owned();
    let mut shown = vec![Shown { name: "volume", pictures: truth.clone() }];
    let mut row = |name: &'static str, set: &SplatSet, steps: u32, cost: Cost, both: [Vec<Image>; 2]| {
        let pictures = if steps > 0 { arguments.views } else { 0 };
        let [db, other_db] = [mean(psnr, &truth[0], &both[0])?, mean(psnr, &truth[1], &both[1])?];
        let ssim = mean(ssim, &truth[0], &both[0])?;
        let flip = mean(|a, b| Ok(flip(a, b)?.mean), &truth[0], &both[0])?;
        let row = format!(
            "{case},{},{name},{},{},{steps},{:.0},{pictures},{:.0},{db:.2},{ssim:.3},{flip:.3},{},{},{other_db:.2}",
            arguments.function,
            set.splats.len(),
            bytes(set)?,
            cost.seconds,
            if steps > 0 { pictures_s } else { 0.0 },
            cost.bytes,
            arguments.other,
        );
        println!("{row}");
        let _ = writeln!(table, "{row}");
        shown.push(Shown { name, pictures: both });
        Result::Ok(())
    };

    let decoded = |i: usize| -> Result<Vec<Image>> {
        let scene = Scene::new(gpu, Some(&fit), None, &looks[i])?;
        held_out.of_same_cameras(gpu, &scene, "decoded")?.ok_or_else(given_up)?.pictures()
    };
    row("fit", &fit, 0, of_fit, [decoded(0)?, decoded(1)?])?;

    let most = fit.splats.len();
    let long = Options {
        views: arguments.views,
        iterations: arguments.steps,
        shown: arguments.size,
        max_splats: Some(most),
        rates: Rates::PUBLISHED,
        ..Options::default()
    };
    let short = Options {
        iterations: u32::MAX,
        time_budget: Some(Duration::from_secs_f64(of_fit.seconds)),
        ..long.clone()
    };
    let random = start(held_out.ball, None, &looks[0], most)?;
    let sampled = start(held_out.ball, Some((&volume, &roi)), &looks[0], most)?;
    let ways = [
        ("3DGS, random start", &random, long.clone()),
        ("3DGS, start in the region", &sampled, long.clone()),
        ("3DGS, start in the region, equal time", &sampled, short.clone()),
        (
            "rates of bake, start in the region, equal time",
            &sampled,
            Options { rates: Rates::SHORT, ..short },
        ),
    ];
    let used = || gpu.memory_by_purpose().values().sum::<u64>();
    let others = used() - pictures_bytes;
    for (name, first, options) in ways {
        let mut most = 0;
        let done =
            train(gpu, first.clone(), 0, [&trained, &held_out], &options, None, &mut |step, share| {
                most = most.max(used());
                if step.is_multiple_of(500) {
                    eprintln!("{name}: {step} steps, {:.0} %", 100.0 * share);
                }
                ControlFlow::Continue(())
            })?;
        // Its colours are what they are.
        let drawn = pictures(gpu, &done.set, &held_out)?;
        let cost = Cost { seconds: done.report.training_s, bytes: most - others };
        row(name, &done.set, done.report.steps, cost, [drawn.clone(), drawn])?;
    }
    let options = Options { shown: arguments.size, max_splats: Some(most), ..Options::default() };
    let (others, mut most) = (used(), 0);
    let baked = bake(gpu, &fit, &looks[0], &options, None, &mut |_| {
        most = most.max(used());
        ControlFlow::Continue(())
    })?;
    let drawn = pictures(gpu, &baked.set, &held_out)?;
    let cost = Cost {
        seconds: of_fit.seconds + baked.report.rendering_s + baked.report.training_s,
        bytes: (most - others).max(of_fit.bytes),
    };
    row("fit, then bake", &baked.set, baked.report.steps, cost, [drawn.clone(), drawn])?;

    output::write_atomic(&arguments.out, arguments.force, |file| file.write_all(table.as_bytes()))?;
    if let Some(path) = &arguments.figure {
        let options = WriteOptions { force: arguments.force, ..WriteOptions::default() };
        write(path, &figure(&shown, [&arguments.function, &arguments.other]), None, &options)?;
    }
    Ok(())
}

/// Returns the mean of a measure over pairs of pictures.
fn mean(measure: impl Fn(&Image, &Image) -> Result<f64>, a: &[Image], b: &[Image]) -> Result<f64> {
    let found: Result<Vec<f64>> = a.iter().zip(b).map(|(a, b)| measure(a, b)).collect();
    found.map(|found| found.iter().sum::<f64>() / found.len().max(1) as f64)
}

/// Returns the bytes of the smallest file that holds a set: `.vgs` with HU, `.spz` with colours.
fn bytes(set: &SplatSet) -> Result<u64> {
    let name = if set.colours.is_some() { "x.spz" } else { "x.vgs" };
    splat::file_bytes(std::path::Path::new(name), set, &splat::WriteOptions::default())
}

/// Returns `count` first splats: at places of the region that the function shows, in its colours, or grey ones anywhere
/// in the ball that the cameras look at.
fn start(
    (centre, radius): (DVec3, f64),
    region: Option<(&Volume, &Roi)>,
    look: &Look,
    count: usize,
) -> Result<SplatSet> {
    let mut random = Pcg64::seed_from_u64(0);
    let mut places: Vec<(DVec3, DVec3)> = Vec::new();
    // Cubic mm that the places are drawn from.
    let room = match region {
        Some((volume, roi)) => {
            let [nx, ny, _] = volume.size;
            let place = |i: usize| DVec3::new((i % nx) as f64, (i / nx % ny) as f64, (i / (nx * ny)) as f64);
            let shown =
                |&i: &usize| roi.weight[i] > 0.5 && look.transfer.at(f64::from(volume.samples[i])).1 > 0.0;
            let seen: Vec<usize> = (0..volume.len()).filter(shown).collect();
            if seen.is_empty() {
                return Err(Error::new(
                    Kind::NothingToDo,
                    "VGS-BEN-065",
                    "the function shows nothing of the region",
                ));
            }
            for _ in 0..count {
                let i = seen[random.random_range(0..seen.len())];
                let jitter = DVec3::from_array(std::array::from_fn(|_| random.random_range(-0.5..0.5)));
                let at = volume.world_from_voxel.transform_point3(place(i) + jitter);
                places.push((at, look.transfer.at(f64::from(volume.samples[i])).0));
            }
            seen.len() as f64 * volume.spacing_mm().element_product()
        }
        None => {
            while places.len() < count {
                let at = DVec3::from_array(std::array::from_fn(|_| random.random_range(-1.0..1.0)));
                if at.length() <= 1.0 {
                    places.push((centre + radius * at, DVec3::splat(0.5)));
                }
            }
            4.0 / 3.0 * std::f64::consts::PI * radius.powi(3)
        }
    };
    // The mean distance to the nearest other one of as many points (Hertz 1909), as good as that to the nearest three.
    let sigma = (0.554 * (room / count as f64).cbrt()).ln() as f32;
    let origin_mm = centre.round();
    let mut set = SplatSet { origin_mm, unit: Unit::Luminance, ..SplatSet::default() };
    let mut coefficients = Vec::new();
    for (at, colour) in places {
        let logit = (FIRST_OPACITY / (1.0 - FIRST_OPACITY)).ln();
        set.splats.push(Splat {
            mean: (at - origin_mm).as_vec3().to_array(),
            rotation: [1.0, 0.0, 0.0, 0.0],
            log_scale: [sigma; 3],
            opacity_logit: logit,
            ..Splat::default()
        });
        coefficients.extend(colour.to_array().map(|c| (c as f32 - 0.5) / SH0));
    }
    set.colours = Some(Harmonics { degree: 0, coefficients });
    Ok(set)
}

/// Returns the first view of the ways that are worth a look, in a row for each function.
fn figure(shown: &[Shown], functions: [&str; 2]) -> Image {
    const SEEN: [(&str, &str); 4] = [
        ("volume", "the CT"),
        ("fit", "splats fitted to voxels"),
        ("3DGS, start in the region", "3DGS by pictures"),
        ("3DGS, random start", "3DGS, random start"),
    ];
    let [width, height] = shown[0].pictures[0][0].size;
    let line = line_height(LETTERS);
    let size = [SEEN.len() * (width + GAP) + GAP, GAP + line + 2 * (height + line + GAP)];
    let mut out = Image::new(size, [1.0; 4]);
    for (column, (name, title)) in SEEN.into_iter().enumerate() {
        let left = GAP + column * (width + GAP);
        out.text([left + width / 2, GAP], LETTERS, Align::Middle, [0.0; 3], title);
        let Some(way) = shown.iter().find(|way| way.name == name) else { continue };
        for (row, pictures) in way.pictures.iter().enumerate() {
            let top = GAP + line + row * (height + line + GAP);
            if column == 0 {
                out.text([left, top], LETTERS, Align::Left, [0.3; 3], functions[row]);
            }
            for (i, &[r, g, b, _]) in pictures[0].pixels.iter().enumerate() {
                out.put(left + i % width, top + line + i / width, [r, g, b]);
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, Vec3};

    use super::*;

    #[test]
    fn first_splats_lie_in_the_region_that_is_shown_or_anywhere_in_the_ball() {
        let function = transfer::load("CT-Bone", [-1000.0, 1000.0]).expect("a preset");
        let look = Look::new(function);
        // Bone in the upper half of the region, which is the left half of the volume.
        let size = [8, 8, 8];
        let samples = (0..512).map(|i| if i / 64 >= 4 { 900.0 } else { -900.0 }).collect();
        let volume = Volume::new(size, DAffine3::IDENTITY, samples);
        let weight = (0..512).map(|i| f32::from(u8::from(i % 8 < 4))).collect();
        let roi = Roi::new(weight, &volume).expect("a region");
        let ball = (DVec3::splat(3.5), 7.0);
        let mean = |set: &SplatSet, splat: &Splat| Vec3::from_array(splat.mean).as_dvec3() + set.origin_mm;
        let of_region = start(ball, Some((&volume, &roi)), &look, 200).expect("splats");
        for splat in &of_region.splats {
            let at = mean(&of_region, splat);
            assert!(at.x <= 3.5 && at.z >= 3.5, "{at}");
        }
        let anywhere = start(ball, None, &look, 200).expect("splats");
        assert!(anywhere.splats.iter().all(|splat| mean(&anywhere, splat).distance(ball.0) < 7.5));
        let above = anywhere.splats.iter().filter(|splat| mean(&anywhere, splat).z > 3.5).count();
        assert!((60..140).contains(&above), "{above} of 200 in one half");
        assert_eq!(anywhere.colours.expect("colours").coefficients, [0.0; 600], "grey");
        let dark =
            Roi::new((0..512).map(|i| f32::from(u8::from(i < 64))).collect(), &volume).expect("a region");
        assert_eq!(start(ball, Some((&volume, &dark)), &look, 9).expect_err("nothing").code, "VGS-BEN-065");
    }
}
