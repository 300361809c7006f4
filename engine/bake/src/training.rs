//! Splats on the device, moved by the derivatives of pictures.

use glam::{DVec3, Vec3};
use rand::RngExt;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64;
use shaders_glsl::types::{AdamHarmonicsParams, AdamParams};

use super::options::Options;
use super::splitting::{Split, split};
use super::views::Views;
use base::error::{Error, Kind, Result};
use gpu::Gpu;
use image::{Image, psnr};
use passes::adam::{Adam, AdamState, NO_CAP};
use passes::picture::{HarmonicsState, Picture, Shot, Splats};
use render::Camera;
use shaders_glsl::types::History;
use splat::harmonics::basis_count;
use splat::{Harmonics, Splat, SplatSet};

/// β₁, β₂ and ε of Adam (Kingma & Ba 2015).
const BETAS: [f64; 2] = [0.9, 0.99];
const EPSILON: f32 = 1e-15;
/// Rates of the first step: means in mean standard deviations of all splats, the others in their own units. Those of
/// the last step are [`LAST_RATES`] of them.
const MEAN_RATE: f64 = 0.2;
const ROTATION_RATE: f64 = 0.07;
const SCALE_RATE: f64 = 0.07;
const OPACITY_RATE: f64 = 0.15;
const COLOUR_RATE: f64 = 0.04;
const REST_RATE: f64 = 0.015;
const LAST_RATES: f64 = 0.1;
/// Range of the standard deviations, in the mean one of all splats.
const SCALES: [f64; 2] = [0.02, 20.0];
/// Greatest magnitude of an opacity logit.
const MOST_LOGIT: f32 = 8.0;

/// Splats that are trained.
pub struct Training {
    gpu: Gpu,
    picture: Picture,
    adam: Adam,
    state: AdamState,
    colours: HarmonicsState,
    coefficients: usize,
    size: [u32; 2],
    /// World position of the space in which the splats are here: all coordinates are positive in it, mm.
    corner: DVec3,
    extent: Vec3,
    /// Geometric mean of all standard deviations, mm.
    sigma: f64,
    rng: Pcg64,
    order: Vec<usize>,
    /// Row of each splat in the set of the beginning.
    rows: Vec<usize>,
    step: u32,
    /// Steps since Adam began.
    adam_steps: u32,
    ssim_weight: f32,
}

impl Training {
    /// Drops splats that can hardly be seen, and splits others until there are `count`, each once at most, where the
    /// derivatives by their means were greatest since the last time. Adam begins anew. Waits for the device.
    ///
    /// # Errors
    /// Those of the device; the splats are then as they were.
    pub fn grow(&mut self, count: usize) -> Result<()> {
        let splats = self.state.splats.read()?;
        let weights: Vec<f32> = self.state.histories.read()?.iter().map(|row| row.gradient_norm).collect();
        let Split { splats, rows } = split(&splats, &weights, count);
        let colours = self.colours.harmonics.read()?;
        let own = |&row: &usize| colours[row * self.coefficients..][..self.coefficients].to_vec();
        let colours: Vec<[f32; 3]> = rows.iter().flat_map(own).collect();
        let picture = Picture::new(&self.gpu, splats.len(), self.coefficients, self.size)?;
        self.begin(&splats, &colours)?;
        self.picture = picture;
        self.rows = rows.iter().map(|&row| self.rows[row]).collect();
        Ok(())
    }

    /// Sets the splats and their coefficients; Adam knows nothing of them.
    fn begin(&mut self, splats: &[Splat], colours: &[[f32; 3]]) -> Result<()> {
        let mut state = AdamState::zeroed(&self.gpu, splats.len())?;
        state.splats.write_range(0, splats)?;
        let history = History { gradient_norm: 0.0, log_scale_cap: NO_CAP };
        state.histories.write_range(0, &vec![history; splats.len()])?;
        self.colours = HarmonicsState::new(&self.gpu, colours)?;
        self.state = state;
        self.adam_steps = 0;
        Ok(())
    }

    /// Returns the row of each splat in the set of the beginning.
    pub fn rows(&self) -> &[usize] {
        &self.rows
    }

    /// Begins with the splats of a set with colours, whose harmonics get this degree, for the pictures of `views`.
    ///
    /// # Errors
    /// [`Kind::Internal`] for a set without splats or colours.
    pub fn new(gpu: &Gpu, set: &SplatSet, degree: u8, views: &Views, options: &Options) -> Result<Self> {
        let Some(colours) = set.colours.as_ref().filter(|_| !set.splats.is_empty()) else {
            return Err(Error::new(Kind::Internal, "VGS-BAKE-004", "nothing to train"));
        };
        let count = set.splats.len();
        let logs = set.splats.iter().flat_map(|splat| splat.log_scale).map(f64::from);
        let sigma = (logs.sum::<f64>() / (3 * count) as f64).exp();
        let (centre, radius) = views.ball;
        // All means are inside, also those that lie far from all others: Adam keeps them in this box.
        let reach = DVec3::splat(2.0 * radius);
        let means = || set.splats.iter().map(|s| Vec3::from_array(s.mean).as_dvec3() + set.origin_mm);
        let corner = means().fold(centre - reach, DVec3::min);
        let extent = means().fold(centre + reach, DVec3::max) - corner;
        let shift = (set.origin_mm - corner).as_vec3();
        let moved = |splat: &Splat| {
            let mean = (Vec3::from_array(splat.mean) + shift).to_array();
            Splat { mean, intensity: 0.0, ..*splat }
        };
        let splats: Vec<Splat> = set.splats.iter().map(moved).collect();
        let coefficients = basis_count(degree);
        let rows: Vec<[f32; 3]> = (0..count).flat_map(|i| of_degree(colours.of(i), coefficients)).collect();
        let mut training = Training {
            gpu: gpu.clone(),
            picture: Picture::new(gpu, count, coefficients, views.size)?,
            adam: Adam::new(gpu)?,
            state: AdamState::zeroed(gpu, count)?,
            colours: HarmonicsState::new(gpu, &rows)?,
            coefficients,
            size: views.size,
            corner,
            extent: extent.as_vec3(),
            sigma,
            rng: Pcg64::new(u128::from(options.seed), 0xa02_bdbf_7bb3_c0a7),
            order: Vec::new(),
            rows: (0..count).collect(),
            step: 0,
            adam_steps: 0,
            ssim_weight: options.ssim_weight as f32,
        };
        training.begin(&splats, &rows)?;
        Ok(training)
    }

    /// Returns the number of steps that are done.
    pub fn steps(&self) -> u32 {
        self.step
    }

    fn shot(&self, camera: &Camera, ball: (DVec3, f64), background: [f32; 3]) -> Shot {
        let middle = camera.forward().dot(ball.0 - camera.eye);
        let depths = [(middle - 1.5 * ball.1).max(0.0) as f32, (middle + 1.5 * ball.1) as f32];
        Shot { view: camera.view(self.corner), depths, background }
    }

    /// Does one step with the next picture, when the share `done` of all steps is behind, 0 to 1. Waits for the device.
    pub fn step(&mut self, views: &Views, done: f64) -> Result<()> {
        if self.order.is_empty() {
            self.order = (0..views.wanted.len()).collect();
            self.order.shuffle(&mut self.rng);
        }
        let view = self.order.pop().unwrap_or_default();
        // Before other backgrounds, splats that paint the background themselves are wrong.
        let background = [self.rng.random_range(0.0f32..=1.0); 3];
        let shot = self.shot(&views.cameras[view], views.ball, background);
        let wanted = &views.wanted[view];
        self.step += 1;
        self.adam_steps += 1;
        loop {
            let (adam, harmonics) = self.params(done);
            let mut recorder = self.gpu.record()?;
            let of = Splats { splats: &self.state.splats, harmonics: &self.colours.harmonics };
            self.picture.draw(&mut recorder, &of, &shot);
            self.picture.compare(&mut recorder, wanted, background, self.ssim_weight);
            self.picture.differentiate(&mut recorder, &of, &shot.view);
            let totals = &self.picture.pair_totals;
            self.adam.record(&mut recorder, &self.picture.rows, &mut self.state, totals, &adam);
            self.picture.step_harmonics(&mut recorder, &mut self.colours, &harmonics);
            let ticket = recorder.submit()?;
            self.gpu.wait(ticket)?;
            let needed = self.picture.needed()?;
            if needed <= self.picture.capacity() {
                return Ok(());
            }
            // The step was void.
            self.picture.grow(needed)?;
        }
    }

    fn params(&self, done: f64) -> (AdamParams, AdamHarmonicsParams) {
        let decay = LAST_RATES.powf(done.clamp(0.0, 1.0));
        let rate = |first: f64| (first * decay) as f32;
        let [beta1, beta2] = BETAS.map(|beta| beta as f32);
        let [correction1, correction2] =
            BETAS.map(|beta| (1.0 / (1.0 - beta.powi(self.adam_steps.min(1 << 20) as i32))) as f32);
        let capacity = self.picture.capacity() as u32;
        let [least, most] = SCALES.map(|scale| [(scale * self.sigma).ln() as f32; 3]);
        let adam = AdamParams {
            splat_count: self.state.splats.len() as u32,
            chunk_count: 1,
            capacity,
            beta1,
            beta2,
            correction1,
            correction2,
            epsilon: EPSILON,
            rate_mean: [rate(MEAN_RATE * self.sigma); 3],
            rate_rotation: rate(ROTATION_RATE),
            rate_log_scale: rate(SCALE_RATE),
            rate_opacity: rate(OPACITY_RATE),
            rate_intensity: 0.0,
            min_log_scale: least,
            max_log_scale: most,
            scale_weight: 0.0,
            max_logit: MOST_LOGIT,
            min_intensity: 0.0,
            max_intensity: 0.0,
            max_mean: self.extent.to_array(),
        };
        let harmonics = AdamHarmonicsParams {
            splat_count: self.state.splats.len() as u32,
            coefficients: self.coefficients as u32,
            capacity,
            beta1,
            beta2,
            correction1,
            correction2,
            epsilon: EPSILON,
            rate: rate(COLOUR_RATE),
            rate_rest: rate(REST_RATE),
        };
        (adam, harmonics)
    }

    /// Returns the PSNR of each picture of `views` over black, dB, peak 1. Waits for the device.
    pub fn psnr(&mut self, views: &Views) -> Result<Vec<f64>> {
        let size = self.size.map(|edge| edge as usize);
        let mut found = Vec::new();
        for (camera, wanted) in views.cameras.iter().zip(&views.wanted) {
            // What is shown is in bytes, too.
            let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() / 255.0;
            let drawn = self.draw(camera, views.ball, [0.0; 3])?;
            let drawn = drawn.iter().map(|&[r, g, b, _]| [byte(r), byte(g), byte(b), 1.0]).collect();
            let wanted =
                wanted.read()?.iter().map(|word| word.to_le_bytes().map(|v| f32::from(v) / 255.0)).collect();
            found.push(psnr(&Image { size, pixels: drawn }, &Image { size, pixels: wanted })?);
        }
        Ok(found)
    }

    /// Returns the picture from a camera: colour over the background, and what passes. Waits for the device.
    pub fn draw(
        &mut self,
        camera: &Camera,
        ball: (DVec3, f64),
        background: [f32; 3],
    ) -> Result<Vec<[f32; 4]>> {
        let shot = self.shot(camera, ball, background);
        loop {
            let mut recorder = self.gpu.record()?;
            let of = Splats { splats: &self.state.splats, harmonics: &self.colours.harmonics };
            self.picture.draw(&mut recorder, &of, &shot);
            let ticket = recorder.submit()?;
            self.gpu.wait(ticket)?;
            let needed = self.picture.needed()?;
            if needed <= self.picture.capacity() {
                return self.picture.colours.read();
            }
            self.picture.grow(needed)?;
        }
    }

    /// Returns the splats and their colours, in the space of a set with this origin, mm RAS.
    pub fn splats(&self, origin_mm: DVec3) -> Result<(Vec<Splat>, Harmonics)> {
        let shift = (self.corner - origin_mm).as_vec3();
        let mut splats = self.state.splats.read()?;
        for splat in &mut splats {
            splat.mean = (Vec3::from_array(splat.mean) + shift).to_array();
        }
        let degree = (self.coefficients as f64).sqrt() as u8 - 1;
        let coefficients = self.colours.harmonics.read()?.into_iter().flatten().collect();
        Ok((splats, Harmonics { degree, coefficients }))
    }
}

/// Returns the first `count` coefficients of a splat, and 0 for those that it does not have.
fn of_degree(own: &[f32], count: usize) -> impl Iterator<Item = [f32; 3]> {
    (0..count).map(|k| own.as_chunks().0.get(k).copied().unwrap_or_default())
}
