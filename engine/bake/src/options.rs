//! How splats are baked.

use std::time::Duration;

use base::error::{Error, Kind, Result};
use passes::picture::LONGEST;
use splat::harmonics::MAX_DEGREE;

/// A rate of the means.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MeanRate {
    /// In mean standard deviations of all splats.
    Sigmas(f64),
    /// In radii of the ball that the cameras look at.
    Radii(f64),
}

impl MeanRate {
    /// Returns the rate in mm.
    pub(super) fn mm(self, sigma_mm: f64, radius_mm: f64) -> f64 {
        match self {
            MeanRate::Sigmas(rate) => rate * sigma_mm,
            MeanRate::Radii(rate) => rate * radius_mm,
        }
    }
}

/// Rates of Adam in the first step, in the units of the parameters but for the means, and what becomes of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rates {
    /// β₁ and β₂ (Kingma & Ba 2015).
    pub betas: [f64; 2],
    /// Of the means.
    pub mean: MeanRate,
    /// Of the rotations.
    pub rotation: f64,
    /// Of ln σ.
    pub scale: f64,
    /// Of the opacity logits.
    pub opacity: f64,
    /// Of the colours, as coefficients of degree 0.
    pub colour: f64,
    /// Of the coefficients of higher degree.
    pub rest: f64,
    /// The means' rate in the last step, in that of the first.
    pub last_mean: f64,
    /// That of all others.
    pub last: f64,
}

impl Rates {
    /// For few steps from splats that are nearly right.
    pub const SHORT: Rates = Rates {
        betas: [0.8, 0.99],
        mean: MeanRate::Sigmas(0.035),
        rotation: 0.03,
        scale: 0.14,
        opacity: 0.15,
        colour: 0.02,
        rest: 0.01,
        last_mean: 0.1,
        last: 0.1,
    };
    /// Those of Kerbl et al., "3D Gaussian Splatting" (2023), as their code has them. The extent of a scene is there
    /// 1.1 times the distance of cameras all around it, which is 3.86 radii here.
    pub const PUBLISHED: Rates = Rates {
        betas: [0.9, 0.999],
        mean: MeanRate::Radii(1.6e-4 * 1.1 * 3.86),
        rotation: 0.001,
        scale: 0.005,
        opacity: 0.05,
        colour: 0.0025,
        rest: 0.0025 / 20.0,
        last_mean: 0.01,
        last: 1.0,
    };
}

/// How splats are baked.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Pictures that the splats are trained with.
    pub views: usize,
    /// Pictures between these that only tell how good they are.
    pub held_out: usize,
    /// Width and height of the pictures, pixels, 16 to 1920.
    pub size: u32,
    /// Width and height of the pictures that the splats are made for, pixels: viewers widen splats by as many pixels on
    /// large pictures as on small ones, which is less of the scene.
    pub shown: u32,
    /// Steps of the optimiser, a picture each; 0 keeps the splats as they begin.
    pub iterations: u32,
    /// Most time for the steps; `None` takes as long as they need. The rates of the steps follow the share of the time.
    pub time_budget: Option<Duration>,
    /// Most splats: of more the most important are kept, and fewer grow to as many, to 16 times as many at most; `None`
    /// for twice as many as there are.
    pub max_splats: Option<usize>,
    /// Highest degree of the harmonics; `None` for 3 with a light that turns with the camera, 2 with one of the patient, 0
    /// without light.
    pub degree: Option<u8>,
    /// Rates of the optimiser.
    pub rates: Rates,
    /// Weight of 1 - SSIM in the loss; that of the absolute error is the rest of 1.
    pub ssim_weight: f64,
    /// Seed of the order of the pictures and of the backgrounds. Without a time budget it decides on every bit.
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            views: 96,
            held_out: 8,
            size: 256,
            shown: 1024,
            iterations: 240,
            time_budget: None,
            max_splats: None,
            degree: None,
            rates: Rates::SHORT,
            ssim_weight: 0.2,
            seed: 0,
        }
    }
}

impl Options {
    /// Fails for values that cannot be used.
    ///
    /// # Errors
    /// [`Kind::Usage`].
    pub fn check(&self) -> Result<()> {
        let bad = |what: String, help: &str| {
            Err(Error::new(Kind::Usage, "VGS-BAKE-003", format!("baking with {what}")).help(help))
        };
        if !(1..=10_000).contains(&self.views) {
            return bad(format!("{} views", self.views), "give 1 to 10000");
        }
        if self.held_out > 10_000 {
            return bad(format!("{} held-out views", self.held_out), "give 0 to 10000");
        }
        if !(16..=LONGEST).contains(&self.size) {
            return bad(format!("pictures of {0} x {0} pixels", self.size), "give 16 to 1920");
        }
        if self.shown == 0 {
            return bad("splats for pictures without pixels".to_owned(), "give at least 1");
        }
        if self.max_splats == Some(0) {
            return bad("no splats".to_owned(), "give at least 1");
        }
        if self.degree.is_some_and(|degree| degree > MAX_DEGREE) {
            return bad(format!("harmonics of degree {}", self.degree.unwrap_or_default()), "give 0 to 3");
        }
        if !(0.0..=1.0).contains(&self.ssim_weight) {
            return bad(format!("a weight of {} for SSIM", self.ssim_weight), "give 0 to 1");
        }
        Ok(())
    }
}
