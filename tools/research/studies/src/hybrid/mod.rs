//! `studies hybrid`: does a fit to the voxels gain in pictures if pictures of several transfer functions are fitted as well,
//! and what does that cost in HU?
//!
//! The loss is `½ Σ (V̂ − V)² + μ Σ ½ (C(V̂) − C(V))²`, over the voxels of the region and the pixels of views all around it
//! in each function. Its derivative by V̂ is that of the first term towards the targets `V − μ g`, with `g` the derivative
//! of the second: so iterations towards such targets, which follow V̂ round by round, lower both.

mod rays;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use engine::bake::Views;
use engine::fit::evaluate::{Protocol, evaluate};
use engine::fit::{FitConfig, Fitter, Schedule, to_the_end};
use engine::gpu::Gpu;
use engine::image::psnr;
use engine::rasterize::{Quantity, rasterize};
use engine::render::{Look, OF_VOLUMES, Scene, VolumeSource};
use engine::splat::{self, Splat};
use engine::volume::edges::Edges;
use engine::volume::{self, BetweenSlices, LabelChoice, Roi, Volume};
use engine::{Error, Kind, Result, output, transfer};
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64;
use rays::{Rays, Table};

use crate::images::{given_up, views_of};

/// Learning rates, as a share of those of a fit from nothing: the splats are where they belong.
const RATES: f32 = 0.35;
/// Share of a round in the derivative that is followed: the mean of many views moves less.
const NEW: f64 = 0.25;
/// Largest change of a target, in the error of the fit: single rays have large derivatives.
const MOST: f64 = 4.0;

/// A fit to voxels, sharpened by pictures of several transfer functions.
#[derive(Args)]
#[command(after_help = "\
Example:
  vgs fit ct.nii.gz --roi bones.nii.gz -o bones.ply
  studies hybrid ct.nii.gz --roi bones.nii.gz --fit bones.ply")]
pub struct HybridArguments {
    /// The volume.
    volume: PathBuf,
    /// The mask of the region.
    #[arg(long)]
    roi: PathBuf,
    /// A fit of both with which all begin.
    #[arg(long)]
    fit: PathBuf,
    /// How far pictures move the targets of the first round, in the error of the fit (root of the mean square); 0: voxels
    /// alone, for as many iterations.
    #[arg(long, value_delimiter = ',', default_value = "0,0.3,1,3")]
    weights: Vec<f64>,
    /// Transfer functions of the pictures.
    #[arg(long, value_delimiter = ',', default_value = "CT-Bone,CT-Bones-Steep,CT-Soft-Tissue")]
    functions: Vec<String>,
    /// Functions that no picture is fitted for.
    #[arg(long, value_delimiter = ',', default_value = "CT-Muscle,CT-Angio")]
    unseen: Vec<String>,
    /// Rounds, each with new pictures.
    #[arg(long, default_value_t = 5)]
    rounds: u32,
    /// Iterations of a round.
    #[arg(long, default_value_t = 60)]
    iterations: u32,
    /// Views of a round in each function, of four times as many.
    #[arg(long, default_value_t = 16)]
    views: usize,
    /// Width and height of their pictures, pixels.
    #[arg(long, default_value_t = 128)]
    size: u32,
    /// Views that only tell how good the splats are, 256×256.
    #[arg(long, default_value_t = 16)]
    held_out: usize,
    /// File for the rows (CSV).
    #[arg(long, default_value = "hybrid.csv")]
    out: PathBuf,
    /// Replaces it.
    #[arg(long)]
    force: bool,
}

/// What all ways to fit have in common.
struct Case<'a> {
    gpu: &'a Gpu,
    volume: &'a Volume,
    roi: &'a Roi,
    config: FitConfig,
    /// Volume and region as they are shown, and the first voxel of their box.
    shown: (&'a Volume, &'a Roi, [usize; 3]),
    tables: Vec<Table>,
    views: Views,
}

/// Fits, renders and measures.
///
/// # Errors
/// Those of reading, fitting and writing.
pub fn run(gpu: &Gpu, arguments: &HybridArguments) -> Result<()> {
    output::check_writable(&arguments.out, arguments.force)?;
    let volume = Volume::read(&arguments.volume, &volume::ReadOptions::default())?;
    let mask = Volume::read(&arguments.roi, &volume::ReadOptions::default())?;
    let roi = Roi::from_mask(&mask, &LabelChoice::Whole, &volume)?;
    let fit = splat::read(&arguments.fit, &splat::ReadOptions::default())?;
    let first = fit.to_voxel(&volume.world_from_voxel);
    let range = volume.min_max().map_or([0.0, 1.0], |(low, high)| [low, high].map(f64::from));
    let mut looks = Vec::new();
    for name in arguments.functions.iter().chain(&arguments.unseen) {
        let mut function = transfer::load(name, range)?;
        function.material.shade = false;
        looks.push(Look::new(function));
    }
    let of_pictures = arguments.functions.len();
    let shown = shown(&volume, &roi)?;
    let source = VolumeSource { volume: &shown.0, roi: Some(&shown.1) };
    let mut scene = Scene::new(gpu, None, Some(&source), &looks[0])?;
    let views = |count, shift, size| views_of(gpu, &scene, OF_VOLUMES, (count, shift), size);
    let case = Case {
        gpu,
        volume: &volume,
        roi: &roi,
        config: after(&first),
        shown: (&shown.0, &shown.1, shown.2),
        tables: looks[..of_pictures].iter().map(|look| Table::new(&look.transfer, range)).collect(),
        views: views(4 * arguments.views, 0.0, 16)?,
    };
    let held_out = views(arguments.held_out, 0.5, 256)?;
    let mut truth = Vec::new();
    for look in &looks {
        scene.set_look(look)?;
        truth.push(held_out.of_same_cameras(gpu, &scene, OF_VOLUMES)?.ok_or_else(given_up)?.pictures()?);
    }

    let name = arguments.fit.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let mut table =
        "case,weight,splats,bytes,rmse_hu,psnr_voxels_db,function,fitted_by_pictures,psnr_db,worst_psnr_db\n"
            .to_owned();
    for &weight in &arguments.weights {
        let begun = std::time::Instant::now();
        let set = case.sharpened(&first, weight, arguments)?;
        let splats = set.to_voxel(&volume.world_from_voxel);
        let protocol =
            Protocol { offsets: Vec::new(), range: range.map(|v| v as f32), shell: 0, threshold: 0.0 };
        let found = evaluate(gpu, &splats, &set.field, &volume, &roi, &protocol)?.on_grid;
        let bytes = splat::file_bytes(Path::new("x.vgs"), &set, &splat::WriteOptions::default())?;
        for (i, look) in looks.iter().enumerate() {
            let scene = Scene::new(gpu, Some(&set), None, look)?;
            let drawn = held_out.of_same_cameras(gpu, &scene, "decoded")?.ok_or_else(given_up)?.pictures()?;
            let each: Vec<f64> =
                drawn.iter().zip(&truth[i]).map(|(a, b)| psnr(a, b)).collect::<Result<_>>()?;
            let row = format!(
                "{name},{weight},{},{bytes},{:.2},{:.2},{},{},{:.2},{:.2}",
                splats.len(),
                found.rmse_hu,
                found.psnr_db,
                look.transfer.name,
                i < of_pictures,
                each.iter().sum::<f64>() / each.len().max(1) as f64,
                each.iter().copied().fold(f64::INFINITY, f64::min),
            );
            println!("{row}");
            let _ = writeln!(table, "{row}");
        }
        eprintln!("weight {weight}: {:.0} s", begun.elapsed().as_secs_f64());
    }
    output::write_atomic(&arguments.out, arguments.force, |file| file.write_all(table.as_bytes()))
}

/// Returns a volume and its region as programs show them, and where their box begins, voxels.
fn shown(volume: &Volume, roi: &Roi) -> Result<(Volume, Roi, [usize; 3])> {
    let (shown, region) = volume::shown(volume, Some(roi), BetweenSlices::Linear, Edges::default());
    let Some(region) = region else {
        return Err(Error::new(Kind::Internal, "VGS-BEN-067", "a region that is not shown"));
    };
    let corner = volume.voxel_from_world().transform_point3(shown.world_from_voxel.translation);
    // The box may begin before the volume does: then it is counted from below.
    let first = corner.round().to_array().map(|at| at as isize as usize);
    Ok((shown.into_owned(), region.into_owned(), first))
}

/// Returns the configuration of iterations that go on from these splats (voxel space).
fn after(splats: &[Splat]) -> FitConfig {
    let scales = || splats.iter().flat_map(|splat| splat.log_scale).map(f32::exp);
    FitConfig::default().with(|c| {
        for rate in [
            &mut c.rates.rotation,
            &mut c.rates.log_scale,
            &mut c.rates.mean,
            &mut c.rates.opacity,
            &mut c.rates.intensity,
        ] {
            *rate *= RATES;
        }
        c.init.unit = engine::fit::ScaleUnit::Voxel;
        c.scales.growth = 0.0;
        c.scales.min = scales().fold(f32::INFINITY, f32::min) * 0.9;
        c.scales.max = scales().fold(0.0, f32::max) * 1.1;
    })
}

impl Case<'_> {
    /// Returns the splats after all rounds, rounded for a `.vgs` towards the last targets.
    fn sharpened(
        &self,
        first: &[Splat],
        weight: f64,
        arguments: &HybridArguments,
    ) -> Result<splat::SplatSet> {
        let Case { gpu, volume, roi, config, .. } = self;
        let mut random = Pcg64::seed_from_u64(0);
        let mut splats = first.to_vec();
        let mut targets = (*volume).clone();
        let mut factor = None;
        let mut pull = vec![0.0; volume.len()];
        let whole = engine::fit::Problem::new(volume, roi, config)?;
        for round in 0..arguments.rounds {
            if weight > 0.0 {
                let mut field = (*volume).clone();
                rasterize(gpu, &whole.splat_set(&splats, 1), Quantity::Field, &mut field)?;
                let error =
                    root_mean_square(roi.members().map(|i| f64::from(field.samples[i] - volume.samples[i])));
                let (gradient, db) = self.gradient(&field, arguments, &mut random)?;
                let share = if round == 0 { 1.0 } else { NEW };
                pull.iter_mut().zip(&gradient).for_each(|(pull, g)| *pull += share * (g - *pull));
                let of_region = root_mean_square(roi.members().map(|i| pull[i]));
                // The first round says what the weight is; the others keep it.
                let factor = *factor.get_or_insert(weight * error / of_region.max(1e-300));
                for i in roi.members() {
                    let by = (factor * pull[i]).clamp(-MOST * error, MOST * error);
                    targets.samples[i] = volume.samples[i] - by as f32;
                }
                eprintln!("weight {weight}, round {round}: {error:.1} HU, pictures {db:.2} dB");
            }
            let mut fitter = Fitter::new(gpu, &targets, roi, &splats, config)?;
            let schedule = Schedule { iterations: arguments.iterations, time: None };
            fitter.run_to(arguments.iterations, schedule)?;
            splats = fitter.splats()?;
        }
        let last = engine::fit::Problem::new(&targets, roi, config)?;
        last.rounded_set(gpu, &splats, 1, &mut to_the_end)
    }

    /// Returns the derivative by the region's voxels of pictures of the field against those of the volume, and their PSNR.
    fn gradient(
        &self,
        field: &Volume,
        arguments: &HybridArguments,
        random: &mut Pcg64,
    ) -> Result<(Vec<f64>, f64)> {
        let pixels = arguments.size as usize;
        let (of_field, _, _) = shown(field, self.roi)?;
        let (wanted, region, first) = self.shown;
        let rays = Rays::new(wanted, region);
        let mut gradient = vec![0.0; wanted.len()];
        let (mut sum, mut count) = (0.0, 0.0);
        for table in &self.tables {
            let mut cameras: Vec<_> = self.views.cameras.iter().collect();
            cameras.shuffle(random);
            for camera in cameras.into_iter().take(arguments.views) {
                let wanted = rays.picture(&wanted.samples, table, camera, pixels);
                sum += rays.difference(&of_field.samples, table, camera, &wanted, &mut gradient);
                count += 1.5 * wanted.len() as f64;
            }
        }
        let [nx, ny, _] = field.size;
        let own = |i: usize| {
            let at = [i % nx, i / nx % ny, i / (nx * ny)];
            let [x, y, z] = std::array::from_fn(|k| at[k].wrapping_sub(first[k]));
            gradient[wanted.index(x, y, z)]
        };
        let mut of_region = vec![0.0; field.len()];
        self.roi.members().for_each(|i| of_region[i] = own(i));
        Ok((of_region, -10.0 * (sum / count).log10()))
    }
}

/// Returns the root of the mean square.
fn root_mean_square(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0usize), |(sum, count), v| (sum + v * v, count + 1));
    (sum / count.max(1) as f64).sqrt()
}
