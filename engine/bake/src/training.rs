//! Splats on the device, moved by the derivatives of pictures.

use glam::{DVec3, Vec3};
use shaders_glsl::types::{AdamHarmonicsParams, AdamParams};

use super::options::{Options, Rates};
use super::pictures::PictureObjective;
use super::splitting::{Split, split};
use super::state::{BakeState, Trainees};
use super::views::Views;
use base::error::{Error, Kind, Result};
use gpu::Gpu;
use image::{Image, psnr};
use passes::Objective;
use passes::adam::{Adam, AdamState, NO_CAP};
use passes::picture::{HarmonicsState, Picture, Splats};
use render::Camera;
use shaders_glsl::types::History;
use splat::harmonics::basis_count;
use splat::{Harmonics, Splat, SplatSet};

/// ε of Adam.
const EPSILON: f32 = 1e-15;
/// Range of the standard deviations, in the mean one of all splats at the beginning.
const SCALES: [f64; 2] = [0.02, 20.0];
/// Greatest magnitude of an opacity logit.
const MOST_LOGIT: f32 = 8.0;

/// Splats that are trained.
pub struct Training<'a> {
    gpu: Gpu,
    objective: PictureObjective<'a>,
    adam: Adam,
    state: AdamState,
    colours: HarmonicsState,
    coefficients: usize,
    /// World position of the space in which the splats are here: all coordinates are positive in it, mm.
    corner: DVec3,
    extent: Vec3,
    /// Geometric mean of all standard deviations, mm.
    sigma: f64,
    rates: Rates,
    /// Row of each splat in the set of the beginning.
    rows: Vec<usize>,
    step: u32,
    /// Steps since Adam began.
    adam_steps: u32,
}

impl<'a> Training<'a> {
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
        let size = self.objective.size();
        let picture = Picture::new(&self.gpu, splats.len(), self.coefficients, size)?;
        self.begin(&splats, &colours)?;
        self.objective.picture = picture;
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

    /// Returns the splats with what Adam keeps of them. Waits for the device.
    ///
    /// # Errors
    /// Those of the device.
    pub fn trainees(&self) -> Result<Trainees> {
        let AdamState { splats, first, second, histories } = &self.state;
        let HarmonicsState { harmonics, first: mean, second: square } = &self.colours;
        Ok(Trainees {
            rows: self.rows.iter().map(|&row| row as u32).collect(),
            splats: splats.read()?,
            first: first.read()?,
            second: second.read()?,
            histories: histories.read()?,
            harmonics: [harmonics.read()?, mean.read()?, square.read()?],
        })
    }

    /// Goes on from a state of this training.
    ///
    /// # Errors
    /// [`Kind::BadData`] for the state of another one; those of the device.
    pub fn resume(&mut self, state: &BakeState) -> Result<()> {
        let own = &state.splats;
        if !own.belong_to(self.rows.len(), self.coefficients) {
            let message = "this is the state of baking other splats, or with harmonics of another degree";
            return Err(
                Error::new(Kind::BadData, "VGS-BAKE-006", message).help("bake anew, without --resume")
            );
        }
        let picture = Picture::new(&self.gpu, own.splats.len(), self.coefficients, self.objective.size())?;
        self.begin(&own.splats, &own.harmonics[0])?;
        self.state.first.write_range(0, &own.first)?;
        self.state.second.write_range(0, &own.second)?;
        self.state.histories.write_range(0, &own.histories)?;
        self.colours.first.write_range(0, &own.harmonics[1])?;
        self.colours.second.write_range(0, &own.harmonics[2])?;
        self.objective.picture = picture;
        self.objective.skip(state.steps);
        self.rows = own.rows.iter().map(|&row| row as usize).collect();
        (self.step, self.adam_steps) = (state.steps, state.adam_steps);
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
    pub fn new(gpu: &Gpu, set: &SplatSet, degree: u8, views: &'a Views, options: &Options) -> Result<Self> {
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
        let room = (count, coefficients);
        let mut training = Training {
            gpu: gpu.clone(),
            objective: PictureObjective::new(gpu, views, corner, room, options)?,
            adam: Adam::new(gpu)?,
            state: AdamState::zeroed(gpu, count)?,
            colours: HarmonicsState::new(gpu, &rows)?,
            coefficients,
            corner,
            extent: extent.as_vec3(),
            sigma,
            rates: options.rates,
            rows: (0..count).collect(),
            step: 0,
            adam_steps: 0,
        };
        training.begin(&splats, &rows)?;
        Ok(training)
    }

    /// Returns the number of steps that are done.
    pub fn steps(&self) -> u32 {
        self.step
    }

    /// Returns the number of steps since Adam began.
    pub fn adam_steps(&self) -> u32 {
        self.adam_steps
    }

    /// Does one step with the next picture, when the share `done` of all steps is behind, 0 to 1. Waits for the device.
    pub fn step(&mut self, done: f64) -> Result<()> {
        self.step += 1;
        self.adam_steps += 1;
        loop {
            let (adam, harmonics) = self.params(done);
            let mut recorder = self.gpu.record()?;
            let of = Splats { splats: &self.state.splats, harmonics: &self.colours.harmonics };
            self.objective.record(&mut recorder, &of, self.step)?;
            let (gradients, totals) = (self.objective.gradients(), self.objective.pair_totals());
            self.adam.record(&mut recorder, gradients, &mut self.state, totals, &adam);
            self.objective.picture.step_harmonics(&mut recorder, &mut self.colours, &harmonics);
            self.gpu.wait(recorder.submit()?)?;
            if !self.grow_to_need()? {
                return Ok(());
            }
            // The step was void.
        }
    }

    /// Makes room if the last picture had too little, and returns whether it had.
    fn grow_to_need(&mut self) -> Result<bool> {
        let needed = self.objective.picture.needed()?;
        let lacked = needed > self.objective.capacity();
        if lacked {
            self.objective.grow(needed)?;
        }
        Ok(lacked)
    }

    fn params(&self, done: f64) -> (AdamParams, AdamHarmonicsParams) {
        let done = done.clamp(0.0, 1.0);
        let Rates { betas, last_mean, last, .. } = self.rates;
        let rate = |first: f64| (first * last.powf(done)) as f32;
        let mean = self.rates.mean.mm(self.sigma, self.objective.radius_mm()) * last_mean.powf(done);
        let [beta1, beta2] = betas.map(|beta| beta as f32);
        let [correction1, correction2] =
            betas.map(|beta| (1.0 / (1.0 - beta.powi(self.adam_steps.min(1 << 20) as i32))) as f32);
        let capacity = self.objective.capacity() as u32;
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
            rate_mean: [mean as f32; 3],
            rate_rotation: rate(self.rates.rotation),
            rate_log_scale: rate(self.rates.scale),
            rate_opacity: rate(self.rates.opacity),
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
            rate: rate(self.rates.colour),
            rate_rest: rate(self.rates.rest),
        };
        (adam, harmonics)
    }

    /// Returns the PSNR of each picture of `views` over black, dB, peak 1. Waits for the device.
    pub fn psnr(&mut self, views: &Views) -> Result<Vec<f64>> {
        let wanted = views.pictures()?;
        views
            .cameras
            .iter()
            .zip(&wanted)
            .map(|(camera, wanted)| psnr(&self.picture(camera)?, wanted))
            .collect()
    }

    /// Returns the picture from a camera over black, in bytes as it is shown. Waits for the device.
    pub fn picture(&mut self, camera: &Camera) -> Result<Image> {
        let shot = self.objective.shot(camera, [0.0; 3]);
        loop {
            let mut recorder = self.gpu.record()?;
            let of = Splats { splats: &self.state.splats, harmonics: &self.colours.harmonics };
            self.objective.picture.draw(&mut recorder, &of, &shot);
            self.gpu.wait(recorder.submit()?)?;
            if !self.grow_to_need()? {
                let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() / 255.0;
                let drawn = self.objective.picture.colours.read()?;
                let pixels = drawn.iter().map(|&[r, g, b, _]| [byte(r), byte(g), byte(b), 1.0]).collect();
                return Ok(Image { size: self.objective.size().map(|edge| edge as usize), pixels });
            }
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
