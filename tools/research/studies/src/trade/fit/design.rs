//! Plans the fits: a grid of density and iterations, a few fits that differ from its middle in one thing, and
//! the qualities.

use clap::ValueEnum;
use engine::Result;
use engine::fit::{FitConfig, FitForm, Profile, QUALITIES, Storage};
use engine::splat::Kernel;

use crate::paper::job::{Job, Range};

/// Number of held-out offsets at which the fits are measured.
const HELD_OUT: usize = 8;

/// Parts of the design that `--only` can choose.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Part {
    /// Density by iterations
    Grid,
    /// One thing other than in the middle: kernel, storage, lattice of offsets
    Spokes,
    /// The rows of --quality
    Qualities,
}

/// One fit of the design.
#[derive(Clone, Debug)]
pub struct FitRow {
    /// Part that it belongs to.
    pub part: Part,
    /// Name of the series in the plot, or of the quality.
    pub name: String,
    /// Factor on the profile's number of splats.
    pub density_times: f64,
    /// The run.
    pub job: Job,
}

/// Extent of the grid.
#[derive(Clone, Debug)]
pub struct Extent {
    /// Factors on the profile's density.
    pub densities: Vec<f64>,
    /// Iterations.
    pub iterations: Vec<u32>,
}

impl Extent {
    /// Returns the middle of the grid, around which the spokes are: density factor and iterations.
    fn middle(&self) -> (f64, u32) {
        (self.densities[self.densities.len() / 2], self.iterations[self.iterations.len() / 2])
    }
}

/// Fit that differs from the middle of the grid in one thing.
struct Spoke {
    name: &'static str,
    /// Form of the fits that it is for; `None` for both forms.
    form: Option<FitForm>,
    change: fn(&mut FitConfig),
}

const fn spoke(name: &'static str, form: Option<FitForm>, change: fn(&mut FitConfig)) -> Spoke {
    Spoke { name, form, change }
}

/// All spokes. Their offsets are those at which targets are sampled: 1 is the voxel grid alone.
const SPOKES: [Spoke; 8] = [
    spoke("Gaussian kernel", None, |c| c.kernel = Kernel::Gaussian),
    spoke("mixed storage", None, |c| c.storage = Storage::Mixed),
    spoke("no rim", Some(FitForm::Grid), |c| c.loss.rim_weight = 0.0),
    spoke("rim × 3", Some(FitForm::Grid), |c| c.loss.rim_weight *= 3.0),
    spoke("on the grid only", Some(FitForm::Field), |c| c.samples.offsets = 1),
    spoke("2 offsets", Some(FitForm::Field), |c| c.samples.offsets = 2),
    spoke("4 offsets", Some(FitForm::Field), |c| c.samples.offsets = 4),
    spoke("8 offsets", Some(FitForm::Field), |c| c.samples.offsets = 8),
];

/// Case and device of the fits.
pub struct FitPlace<'a> {
    /// Name of the case.
    pub case: &'a str,
    /// Name of its mask.
    pub mask: &'a str,
    /// Sum of the mask.
    pub voxels: f64,
    /// Tells how many splats a configuration with a target takes.
    pub needed: &'a dyn Fn(&FitConfig) -> Result<usize>,
    /// Name of the device.
    pub device: &'a str,
}

/// Returns all fits of these parts, each once: a quality that is a point of the grid is listed as a quality.
pub fn rows(place: &FitPlace<'_>, profile: &Profile, extent: &Extent, parts: &[Part]) -> Result<Vec<FitRow>> {
    let plain = profile.config()?;
    let row = |part: Part, name: String, density_times: f64, config: FitConfig| {
        let splats = match config.has_goal() {
            true => (place.needed)(&config)?,
            false => config.splat_count(place.voxels),
        };
        let density_times = if config.has_goal() {
            // Of what was found out, in place of what was asked.
            splats as f64 / plain.splat_count(place.voxels) as f64
        } else {
            density_times
        };
        let job = Job {
            folder: place.case.into(),
            mask: place.mask.into(),
            profile: profile.name.into(),
            config: config.without_goal().with(|c| c.count.splats = splats),
            range: Range::MinMax,
            held_out: HELD_OUT,
            measure_every: u32::MAX,
            device: place.device.into(),
        };
        job.check().map(|()| FitRow { part, name, density_times, job })
    };
    let scaled = |times: f64, iterations: u32| {
        plain.clone().with(|c| {
            c.count.density = plain.count.density * times;
            c.iterations = iterations;
        })
    };
    let mut rows = Vec::new();
    if parts.contains(&Part::Qualities) {
        for quality in QUALITIES {
            let config = quality.of(&plain)?;
            let times = config.count.density / plain.count.density;
            rows.push(row(Part::Qualities, quality.name.into(), times, config)?);
        }
    }
    if parts.contains(&Part::Spokes) {
        let (times, iterations) = extent.middle();
        for spoke in SPOKES.iter().filter(|s| s.form.is_none_or(|form| form == plain.samples.form)) {
            let mut config = scaled(times, iterations);
            (spoke.change)(&mut config);
            rows.push(row(Part::Spokes, spoke.name.into(), times, config)?);
        }
    }
    if parts.contains(&Part::Grid) {
        for &iterations in &extent.iterations {
            for &times in &extent.densities {
                let name = format!("{iterations} iterations");
                rows.push(row(Part::Grid, name, times, scaled(times, iterations))?);
            }
        }
    }
    let mut seen = std::collections::BTreeSet::new();
    rows.retain(|row| seen.insert(row.job.key()));
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_design_has_every_fit_once_and_the_qualities_by_name() {
        let needed = |config: &FitConfig| Ok((6000.0 / config.count.target_hu) as usize);
        let place = FitPlace { case: "c", mask: "m", voxels: 1000.0, needed: &needed, device: "none" };
        let extent = Extent { densities: vec![0.5, 1.0, 2.0], iterations: vec![50, 100] };
        let profile = Profile::named("bones").expect("a profile");
        let all = [Part::Grid, Part::Spokes, Part::Qualities];
        let rows = rows(&place, profile, &extent, &all).expect("a design");
        let of = |part: Part| rows.iter().filter(|r| r.part == part).collect::<Vec<_>>();
        assert_eq!(of(Part::Qualities).len(), QUALITIES.len());
        assert_eq!(of(Part::Spokes).len(), 4, "those of a fit for the grid");
        assert!(rows.iter().all(|r| r.job.config.count.splats == (150.0 * r.density_times).round() as usize));
        let counts: Vec<usize> = of(Part::Qualities).iter().map(|r| r.job.config.count.splats).collect();
        assert_eq!(counts, [150, 200, 400, 1000], "as many as targets take");
        let keys: std::collections::BTreeSet<String> = rows.iter().map(|r| r.job.key()).collect();
        assert_eq!(keys.len(), rows.len());
        // Each spoke differs from the middle in one key.
        let rows = super::rows(&place, profile, &extent, &[Part::Grid, Part::Spokes]).expect("a design");
        let of = |part: Part| rows.iter().filter(|r| r.part == part).collect::<Vec<_>>();
        let is_middle = |r: &&FitRow| r.density_times == 1.0 && r.job.config.iterations == 100;
        let middle = of(Part::Grid).into_iter().find(is_middle).expect("the middle");
        let value = |c: &FitConfig| serde_json::to_value(c).expect("JSON");
        let middle = value(&middle.job.config);
        for spoke in of(Part::Spokes) {
            let it = value(&spoke.job.config);
            let differing = FitConfig::FIELDS.iter().filter(|f| it[f.key] != middle[f.key]).count();
            assert_eq!(differing, 1, "{}", spoke.name);
        }
    }
}
