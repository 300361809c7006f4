//! Plans the runs that the tables need: the paper's rows scaled to the cases here, the ablations, sweeps and
//! findings.

use engine::Result;
use engine::fit::{FitConfig, Profile};
use engine::splat::Kernel;

use super::count::Count;
use super::job::{HELD_OUT, Job, MEASURE_BATCHES_EVERY, MEASURE_EVERY, Range};
use super::library::Library;
use super::peer;
use super::prototype::{self, FIDELITY, FINDINGS, SUBSET_SHARE, SWEEPS, Variant};
use super::published::{self, CASES, Loss, TABLE_4, TABLE_4_ROW, Training};
use super::section::Section;

/// Amount of work in a report.
pub struct Effort {
    /// True if it is the short one; the tables say so.
    pub quick: bool,
    /// Iterations of `--profile paper` in Tables 2, 4 and 6.
    pub paper_iterations: u32,
    /// Iterations of the default profile.
    pub default_iterations: u32,
    /// Iterations of the findings, except those of the fidelity rows, which are the prototype's.
    pub finding_iterations: u32,
    /// Greatest number of iterations of `--profile paper` in the sweep of densities.
    pub sweep_iterations: u32,
}

impl Effort {
    /// All rows, with the paper's number of iterations.
    pub const FULL: Effort = Effort {
        quick: false,
        paper_iterations: 1000,
        default_iterations: 300,
        finding_iterations: 1000,
        sweep_iterations: 1000,
    };
    /// The short report: a quarter of an hour on two cores.
    pub const QUICK: Effort = Effort {
        quick: true,
        paper_iterations: 200,
        default_iterations: 100,
        finding_iterations: 200,
        sweep_iterations: 100,
    };

    /// Returns true if a row of Tables 2 and 6 is run: in a short report one of each case.
    fn row(&self, case: usize, splats: usize) -> bool {
        !self.quick || [(0, 100_000), (1, 250_000), (2, 100_000), TABLE_4_ROW].contains(&(case, splats))
    }

    /// Returns true if a density of the sweep is run.
    fn density(&self, density: f64) -> bool {
        !self.quick || [0.01, 0.05].contains(&density)
    }

    /// Returns true if a finding is run.
    fn finding(&self, density: f64) -> bool {
        !self.quick || density == 0.02
    }
}

/// Row of Tables 2 and 6.
pub struct TableRow {
    /// Index of the case.
    pub case: usize,
    /// Sum of the mask here.
    pub voxels: f64,
    /// Splats at the start.
    pub splats: Count,
    /// Splats of a mini-batch.
    pub subset: Count,
    /// Row of Table 6 for this number of splats, or the nearest.
    pub training: &'static Training,
    /// Run with `--profile paper`.
    pub paper: Job,
    /// Run with `--profile reference`, over the range of the region.
    pub reference: Job,
    /// Run with the default profile.
    pub ours: Job,
}

/// Column pair of Table 4.
pub struct LossRow {
    /// The paper's loss.
    pub loss: &'static Loss,
    /// The loss of the default profile that comes nearest to it.
    pub what: &'static str,
    /// Run with `--profile paper`.
    pub paper: Job,
    /// Run with `--profile reference`, over the range of the region.
    pub reference: Job,
    /// Run with the default profile.
    pub ours: Job,
}

/// One density of a sweep.
pub struct SweepRow {
    /// Result of the prototype.
    pub known: &'static prototype::Density,
    /// Run with `--profile paper`, full batch.
    pub paper: Job,
    /// Run with the default profile.
    pub ours: Job,
}

/// All runs, by purpose; a list is empty if it was not asked for.
#[derive(Default)]
pub struct Plan {
    /// Tables 2 and 6.
    pub rows: Vec<TableRow>,
    /// Table 4 and the ablation of the default loss.
    pub losses: Vec<LossRow>,
    /// Sweeps of the density.
    pub sweeps: Vec<SweepRow>,
    /// Fidelity of `--profile paper`.
    pub fidelity: Vec<(&'static prototype::Fidelity, Job)>,
    /// Findings.
    pub findings: Vec<(&'static prototype::Finding, Job)>,
    /// `--profile reference` beside the authors' own code.
    pub peers: Vec<(&'static peer::Peer, Job)>,
    /// Runs that show what each difference between the authors' code and the paper's text is worth.
    pub differences: Vec<(&'static peer::Difference, Job)>,
}

/// Input that all jobs of a plan share.
struct Planner<'a> {
    library: &'a mut Library,
    effort: &'a Effort,
    device: &'a str,
}

impl Plan {
    /// Plans the runs for these sections. Reads the masks that it needs.
    pub fn new(sections: &[Section], effort: &Effort, library: &mut Library, device: &str) -> Result<Plan> {
        let wanted = |any: &[Section]| any.iter().any(|s| sections.contains(s));
        let mut planner = Planner { library, effort, device };
        let mut plan = Plan::default();
        if wanted(&[Section::Table2, Section::Table6]) {
            plan.rows = planner.rows()?;
        }
        if wanted(&[Section::Table4, Section::Ablation]) {
            plan.losses = planner.losses()?;
        }
        if wanted(&[Section::Density]) {
            plan.sweeps = planner.sweeps()?;
        }
        if wanted(&[Section::Findings]) {
            plan.fidelity = planner.fidelity()?;
            plan.findings = planner.findings()?;
        }
        if wanted(&[Section::Reference]) {
            plan.peers = planner.peers()?;
            plan.differences = planner.differences()?;
        }
        for job in plan.jobs(sections) {
            job.check()?;
        }
        Ok(plan)
    }

    /// Returns every run once, those that check `--profile paper` first.
    pub fn jobs(&self, sections: &[Section]) -> Vec<&Job> {
        let table_4 = sections.contains(&Section::Table4);
        let mut jobs: Vec<&Job> = Vec::new();
        jobs.extend(self.fidelity.iter().map(|(_, job)| job));
        jobs.extend(self.rows.iter().flat_map(|row| [&row.paper, &row.reference]));
        jobs.extend(self.losses.iter().filter(|_| table_4).flat_map(|row| [&row.paper, &row.reference]));
        jobs.extend(self.rows.iter().map(|row| &row.ours));
        jobs.extend(self.peers.iter().map(|(_, job)| job));
        jobs.extend(self.differences.iter().map(|(_, job)| job));
        jobs.extend(self.losses.iter().map(|row| &row.ours));
        jobs.extend(self.findings.iter().map(|(_, job)| job));
        jobs.extend(self.sweeps.iter().flat_map(|row| [&row.paper, &row.ours]));
        let mut seen = std::collections::BTreeSet::new();
        jobs.retain(|job| seen.insert(job.key()));
        jobs
    }
}

impl Planner<'_> {
    fn job(&self, folder: &str, mask: &str, profile: &Profile, config: FitConfig, range: Range) -> Job {
        Job {
            folder: folder.into(),
            mask: mask.into(),
            profile: profile.name.into(),
            config,
            range,
            held_out: if profile.name == "default" { HELD_OUT } else { 0 },
            measure_every: MEASURE_EVERY,
            device: self.device.into(),
        }
    }

    /// Creates a job of Tables 2, 4 and 6: the paper's method to the letter, with its mini-batches, and its
    /// number of splats at the end as the limit.
    fn paper_row(&self, case: usize, splats: Count, subset: Count, training: &Training) -> Result<Job> {
        let profile = Profile::named("paper")?;
        let config = profile.config()?.with(|c| {
            c.count.splats = splats.ours;
            c.subset.size = subset.ours;
            c.subset.alone = true;
            c.topology.limit = (training.end as f64 / training.start as f64) as f32;
            c.iterations = self.effort.paper_iterations;
        });
        let job = self.job(CASES[case].folder, CASES[case].file, profile, config, Range::MinMax);
        Ok(Job { measure_every: MEASURE_BATCHES_EVERY, ..job })
    }

    /// Creates the same job with `--profile reference`. The authors' reference command keeps the number of
    /// splats.
    fn reference_row(&self, case: usize, splats: Count, subset: Count) -> Result<Job> {
        let profile = Profile::named("reference")?;
        let config = profile.config()?.with(|c| {
            c.count.splats = splats.ours;
            c.subset.size = subset.ours;
            c.iterations = self.effort.paper_iterations;
        });
        let job = self.job(CASES[case].folder, CASES[case].file, profile, config, Range::Roi);
        Ok(Job { measure_every: MEASURE_BATCHES_EVERY, ..job })
    }

    /// Creates a job with `--profile reference` on the case of the authors' figures, over the range of its
    /// region.
    fn peer(&mut self, splats: usize, iterations: u32) -> Result<Job> {
        let profile = Profile::named("reference")?;
        let config = profile.config()?.with(|c| {
            c.count.splats = splats;
            c.iterations = iterations;
        });
        Ok(self.job(SWEEPS[0].folder, SWEEPS[0].mask, profile, config, Range::Roi))
    }

    fn peers(&mut self) -> Result<Vec<(&'static peer::Peer, Job)>> {
        let mut rows = Vec::new();
        for row in peer::PEERS
            .iter()
            .filter(|row| !self.effort.quick || row.iterations() <= 100 && row.splats < 5000)
        {
            let mut job = self.peer(row.splats, row.iterations())?;
            (row.change)(&mut job.config);
            rows.push((row, job));
        }
        Ok(rows)
    }

    fn differences(&mut self) -> Result<Vec<(&'static peer::Difference, Job)>> {
        let mut rows = Vec::new();
        for row in peer::DIFFERENCES.iter().filter(|_| !self.effort.quick) {
            let mut job = self.peer(peer::PEERS[0].splats, peer::DIFFERENCE_ITERATIONS)?;
            peer::learned(&mut job.config);
            (row.change)(&mut job.config);
            rows.push((row, job));
        }
        Ok(rows)
    }

    fn default_row(&self, case: usize, splats: Count) -> Result<Job> {
        let profile = Profile::named("default")?;
        let config = profile.config()?.with(|c| {
            c.count.splats = splats.ours;
            c.iterations = self.effort.default_iterations;
        });
        Ok(self.job(CASES[case].folder, CASES[case].file, profile, config, Range::MinMax))
    }

    fn row(&mut self, case: usize, splats: usize) -> Result<TableRow> {
        let published::Case { folder, file, estimated_voxels, .. } = CASES[case];
        let voxels = self.library.place(folder, file)?.voxels;
        let share = voxels / estimated_voxels;
        let training = published::training_of(case, splats);
        let splats = Count::scaled(splats, share);
        let subset = Count::scaled(training.subset, share);
        Ok(TableRow {
            case,
            voxels,
            splats,
            subset,
            training,
            paper: self.paper_row(case, splats, subset, training)?,
            reference: self.reference_row(case, splats, subset)?,
            ours: self.default_row(case, splats)?,
        })
    }

    fn rows(&mut self) -> Result<Vec<TableRow>> {
        let wanted = published::rows().into_iter().filter(|&(case, splats)| self.effort.row(case, splats));
        wanted.collect::<Vec<_>>().into_iter().map(|(case, splats)| self.row(case, splats)).collect()
    }

    fn losses(&mut self) -> Result<Vec<LossRow>> {
        let (case, splats) = TABLE_4_ROW;
        let TableRow { paper, reference, ours, .. } = self.row(case, splats)?;
        Ok(TABLE_4
            .iter()
            .map(|loss| {
                let mut row = LossRow {
                    loss,
                    what: "",
                    paper: paper.clone(),
                    reference: reference.clone(),
                    ours: ours.clone(),
                };
                for job in [&mut row.paper, &mut row.reference] {
                    job.config.loss.mask_weight = loss.mask;
                    job.config.loss.mse_weight = loss.ct;
                }
                match (loss.mask > 0.0, loss.ct > 0.0) {
                    (true, true) => row.what = "intensity and occupancy",
                    (false, _) => {
                        row.what = "intensity alone";
                        row.ours.config.loss.occupancy_weight = 0.0;
                    }
                    (true, false) => {
                        row.what = "occupancy alone";
                        row.ours.config.loss.mse_weight = 0.0;
                    }
                }
                row
            })
            .collect())
    }

    /// Creates a job with `--profile paper` with every splat in every step and a fixed number of splats, as
    /// the prototype was run.
    fn full_batch(&mut self, folder: &str, mask: &str, density: f64, iterations: u32) -> Result<Job> {
        let profile = Profile::named("paper")?;
        let splats = self.count(folder, mask, density)?;
        let config = profile.config()?.with(|c| {
            c.count.splats = splats;
            c.subset.size = 0;
            c.topology.name = "none".into();
            c.iterations = iterations;
        });
        Ok(self.job(folder, mask, profile, config, Range::Hu))
    }

    fn count(&mut self, folder: &str, mask: &str, density: f64) -> Result<usize> {
        Ok(((self.library.place(folder, mask)?.voxels * density).round() as usize).max(1))
    }

    fn sweeps(&mut self) -> Result<Vec<SweepRow>> {
        let mut rows = Vec::new();
        for sweep in &SWEEPS {
            for known in sweep.densities.iter().filter(|d| self.effort.density(d.density)) {
                let iterations = known.iterations.min(self.effort.sweep_iterations);
                let paper = self.full_batch(sweep.folder, sweep.mask, known.density, iterations)?;
                let profile = Profile::named("default")?;
                let config = profile.config()?.with(|c| {
                    c.count.splats = paper.config.count.splats;
                    c.iterations = self.effort.default_iterations;
                });
                let ours = self.job(sweep.folder, sweep.mask, profile, config, Range::Hu);
                rows.push(SweepRow { known, paper, ours });
            }
        }
        Ok(rows)
    }

    fn fidelity(&mut self) -> Result<Vec<(&'static prototype::Fidelity, Job)>> {
        FIDELITY
            .iter()
            .map(|row| Ok((row, self.full_batch(row.folder, row.mask, row.density, row.iterations)?)))
            .collect()
    }

    fn findings(&mut self) -> Result<Vec<(&'static prototype::Finding, Job)>> {
        let mut rows = Vec::new();
        for row in FINDINGS.iter().filter(|row| self.effort.finding(row.density)) {
            let (folder, mask) = (SWEEPS[0].folder, SWEEPS[0].mask);
            let mut job = self.full_batch(folder, mask, row.density, self.effort.finding_iterations)?;
            vary(&mut job.config, row.variant);
            rows.push((row, job));
        }
        Ok(rows)
    }
}

fn vary(config: &mut FitConfig, variant: Variant) {
    let subset = ((config.count.splats as f64 * SUBSET_SHARE).round() as usize).max(1);
    match variant {
        Variant::FullBatch => {}
        Variant::SubsetAlone => (config.subset.size, config.subset.alone) = (subset, true),
        Variant::SubsetOfAll => (config.subset.size, config.subset.alone) = (subset, false),
        Variant::Sampled => config.rates.learn_intensity = false,
        Variant::DensityKernel => config.kernel = Kernel::Density,
        Variant::NoMask => config.loss.mask_weight = 0.0,
        Variant::Densify => {
            config.count.splats /= 2;
            config.topology.name = "densify".into();
            config.topology.limit = 2.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::ValueEnum;

    use super::*;

    fn plan(sections: &[Section], effort: &Effort) -> Plan {
        let mut cases: Vec<_> = CASES.iter().map(|case| (case.folder, case.file)).collect();
        cases.extend(SWEEPS.iter().map(|sweep| (sweep.folder, sweep.mask)));
        Plan::new(sections, effort, &mut Library::phantom(&cases), "none").expect("a plan whose jobs can run")
    }

    #[test]
    fn counts_are_scaled_down_and_never_up() {
        assert_eq!(Count::scaled(100_000, 286_416.0 / 2.5e6), Count { paper: 100_000, ours: 11_457 });
        assert_eq!(Count::scaled(2000, 286_416.0 / 2.5e6).ours, 229);
        assert_eq!(Count::scaled(2000, 1.7).ours, 2000);
        assert_eq!(Count::scaled(2000, 1e-6).ours, 1, "a fit has a splat");
    }

    #[test]
    fn all_sections_share_their_runs() {
        let all = plan(Section::value_variants(), &Effort::FULL);
        assert_eq!((all.rows.len(), all.losses.len(), all.sweeps.len()), (14, 3, 12));
        assert_eq!((all.fidelity.len(), all.findings.len()), (3, 13));
        // The first column pair of Table 4 is a row of Table 2; the sweep contains the fidelity rows (3) and
        // the full batch of the findings at 0.02, which at 0.1 goes on for longer.
        let jobs = all.jobs(Section::value_variants());
        let peers = peer::PEERS.len() + peer::DIFFERENCES.len();
        // The authors' weight of the mask is 0.2, so no column pair of Table 4 is a row of Table 2 there; a
        // weight of 1 is both a peer and a difference.
        assert_eq!(jobs.len(), 3 * 14 + 3 * 2 + 1 + 2 * 12 + 13 - 1 + peers - 1, "no run twice");
        let of = |sections: &[Section]| plan(sections, &Effort::FULL).jobs(sections).len();
        assert_eq!((of(&[Section::Table2]), of(&[Section::Table6, Section::Table2])), (42, 42));
        assert_eq!((of(&[Section::Table4]), of(&[Section::Ablation]), of(&[Section::Table3])), (9, 3, 0));
        assert!(plan(Section::value_variants(), &Effort::QUICK).jobs(Section::value_variants()).len() < 40);
    }

    #[test]
    fn rows_have_the_paper_s_subsets_and_limits() {
        let plan = plan(&[Section::Table6], &Effort::FULL);
        let row = plan.rows.iter().find(|row| row.splats.paper == 200_000).expect("Table 6 has it");
        assert_eq!((row.subset.paper, row.paper.config.topology.limit), (8000, 1.875));
        for TableRow { paper, ours, .. } in &plan.rows {
            assert!(
                paper.config.subset.size > 0
                    && paper.config.subset.alone
                    && paper.config.topology.name == "densify"
            );
            assert_eq!((paper.profile.as_str(), paper.config.iterations, paper.held_out), ("paper", 1000, 0));
            assert_eq!((ours.profile.as_str(), ours.config.iterations, ours.held_out), ("default", 300, 8));
            assert_eq!(paper.config.count.splats, ours.config.count.splats);
        }
    }

    #[test]
    fn a_finding_departs_in_one_thing() {
        let plan = plan(&[Section::Findings], &Effort::FULL);
        let of = |variant| {
            plan.findings.iter().find(|(row, _)| row.variant == variant).map(|(_, job)| &job.config)
        };
        let full = of(Variant::FullBatch).expect("the reference");
        assert_eq!((full.subset.size, full.topology.name.as_str()), (0, "none"));
        for (variant, expected) in [
            (Variant::Sampled, full.clone().with(|c| c.rates.learn_intensity = false)),
            (Variant::NoMask, full.clone().with(|c| c.loss.mask_weight = 0.0)),
        ] {
            assert_eq!(of(variant), Some(&expected));
        }
        let [alone, all] = [Variant::SubsetAlone, Variant::SubsetOfAll].map(|v| of(v).expect("a subset"));
        assert_eq!(*all, alone.clone().with(|c| c.subset.alone = false));
        assert!(
            alone.subset.size > 0 && of(Variant::DensityKernel).is_some_and(|c| c.kernel == Kernel::Density)
        );
        assert_eq!(of(Variant::Densify).map(|c| c.topology.limit), Some(2.0));
    }
}
