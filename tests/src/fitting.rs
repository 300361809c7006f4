//! Small fits of the phantom.

use engine::fit::evaluate::{Protocol, evaluate};
use engine::fit::{FitConfig, Fitter, Problem, Schedule};
use engine::gpu::Gpu;
use engine::splat::Splat;
use engine::volume::phantom::Phantom;
use engine::volume::{Roi, Volume};
use glam::{DAffine3, DVec3};

/// A volume, a region and how to fit it.
#[derive(Clone)]
pub struct Case {
    /// Volume that is fitted.
    pub volume: Volume,
    /// Region that is fitted.
    pub roi: Roi,
    /// Configuration of the fit.
    pub config: FitConfig,
}

impl Case {
    /// Creates a case of bone and vessels in a phantom of `size` voxels, with `iterations` iterations of the
    /// default configuration.
    pub fn phantom(size: [usize; 3], iterations: u32) -> Self {
        let phantom = Phantom::new(size, DVec3::new(1.0, 1.0, 1.2), 5);
        let (volume, roi) = (phantom.volume(), phantom.roi().expect("the phantom has bones"));
        Case { volume, roi, config: FitConfig { iterations, ..FitConfig::default() } }
    }

    /// Creates a case of a cube of side `n` whose values rise and fall, in a region that is a ball of
    /// `radius` voxels.
    pub fn ball(n: usize, radius: f64, config: FitConfig) -> Self {
        let centre = DVec3::splat((n as f64 - 1.0) / 2.0);
        let at = |i: usize| DVec3::new((i % n) as f64, (i / n % n) as f64, (i / (n * n)) as f64);
        let value = |p: DVec3| (100.0 * (0.4 * p.x).sin() + 80.0 * (0.3 * p.y + 0.2 * p.z).cos()) as f32;
        let count = n * n * n;
        let volume = Volume::new([n; 3], DAffine3::IDENTITY, (0..count).map(|i| value(at(i))).collect());
        let inside = |i: usize| f32::from(u8::from(at(i).distance(centre) <= radius));
        let roi = Roi::new((0..count).map(inside).collect(), &volume).expect("a ball");
        Case { volume, roi, config }
    }

    /// Returns the first splats.
    pub fn start(&self) -> Vec<Splat> {
        let problem =
            Problem::new(&self.volume, &self.roi, &self.config).expect("a configuration that can work");
        problem.first_splats().expect("a known initialiser")
    }

    /// Creates a fit that has not begun.
    pub fn fitter(&self, gpu: &Gpu, splats: &[Splat]) -> Fitter<'_> {
        self.config.check().expect("a configuration that can work");
        Fitter::new(gpu, &self.volume, &self.roi, splats, &self.config).expect("a fitter")
    }

    /// Runs steps until `end`, by the schedule of the configuration.
    pub fn run(&self, fitter: &mut Fitter, end: u32) {
        let schedule = Schedule { iterations: self.config.iterations, time: None };
        fitter.run_to(end, schedule).expect("steps");
    }

    /// Runs the whole fit from the first splats on.
    pub fn fit(&self, gpu: &Gpu) -> Fitter<'_> {
        let mut fitter = self.fitter(gpu, &self.start());
        self.run(&mut fitter, self.config.iterations);
        fitter
    }

    /// Returns the PSNR of all splats at the voxel centres over the fit's own range, dB.
    pub fn on_grid_db(&self, gpu: &Gpu, fitter: &mut Fitter) -> f64 {
        let splats = fitter.splats().expect("splats");
        let scaling = fitter.scaling();
        let field = self.config.field(scaling.background);
        let protocol = Protocol {
            offsets: vec![],
            range: scaling.range.into(),
            shell: self.config.loss.shell,
            threshold: 0.0,
        };
        let e = evaluate(gpu, &splats, &field, &self.volume, &self.roi, &protocol).expect("an evaluation");
        e.on_grid.psnr_db
    }
}
