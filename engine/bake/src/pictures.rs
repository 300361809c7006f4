//! The objective of training: pictures of splats, held against those that are wanted.

use glam::DVec3;
use rand::RngExt;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64;
use shaders_glsl::types::SplatGrad;

use super::options::Options;
use super::views::Views;
use base::error::Result;
use gpu::{Buffer, Gpu, Recorder};
use passes::Objective;
use passes::picture::{Picture, Shot, Splats};
use render::Camera;

/// What other viewers widen the variances of splats by on pictures of any size, pixels².
const WIDENING: f64 = 0.3;

/// The error of pictures from one of several views in each step.
pub struct PictureObjective<'a> {
    pub picture: Picture,
    views: &'a Views,
    /// World position of the space of the splats, mm RAS.
    corner: DVec3,
    /// That of splats on these pictures, pixels².
    widening: f32,
    ssim_weight: f32,
    rng: Pcg64,
    /// Views that still have their turn, the next one last.
    order: Vec<usize>,
    /// The step whose view was chosen last, with its view and background.
    chosen: Option<(u32, usize, [f32; 3])>,
}

impl<'a> PictureObjective<'a> {
    /// Makes room for pictures of `splat_count` splats with `coefficients` each, which lie in a space with its origin at
    /// `corner`, mm RAS.
    ///
    /// # Errors
    /// Those of [`Picture::new`].
    pub fn new(
        gpu: &Gpu,
        views: &'a Views,
        corner: DVec3,
        (splat_count, coefficients): (usize, usize),
        options: &Options,
    ) -> Result<Self> {
        // As wide in the scene as on pictures of the size that they are shown in.
        let widening = WIDENING * (f64::from(views.size[0]) / f64::from(options.shown)).powi(2);
        Ok(PictureObjective {
            picture: Picture::new(gpu, splat_count, coefficients, views.size)?,
            views,
            corner,
            widening: widening as f32,
            ssim_weight: options.ssim_weight as f32,
            rng: Pcg64::new(u128::from(options.seed), 0xa02_bdbf_7bb3_c0a7),
            order: Vec::new(),
            chosen: None,
        })
    }

    /// Returns the width and height of the pictures, pixels.
    pub fn size(&self) -> [u32; 2] {
        self.views.size
    }

    /// Returns the radius of the ball that the cameras look at, mm.
    pub fn radius_mm(&self) -> f64 {
        self.views.ball.1
    }

    /// Returns how a picture of a camera is drawn.
    pub fn shot(&self, camera: &Camera, background: [f32; 3]) -> Shot {
        let (centre, radius) = self.views.ball;
        let middle = camera.forward().dot(centre - camera.eye);
        let depths = [(middle - 1.5 * radius).max(0.0) as f32, (middle + 1.5 * radius) as f32];
        Shot { view: camera.view(self.corner), depths, widening: self.widening, background }
    }

    /// Leaves out the views of the first `turns` steps.
    pub fn skip(&mut self, turns: u32) {
        for turn in 1..=turns {
            self.choose(turn);
        }
    }

    /// Returns the view of a step, and the background of its picture. A step that is done again has the same.
    fn choose(&mut self, turn: u32) -> (usize, [f32; 3]) {
        if let Some((chosen, view, background)) = self.chosen
            && chosen == turn
        {
            return (view, background);
        }
        if self.order.is_empty() {
            self.order = (0..self.views.wanted.len()).collect();
            self.order.shuffle(&mut self.rng);
        }
        let view = self.order.pop().unwrap_or_default();
        // Before other backgrounds, splats that paint the background themselves are wrong.
        let background = [self.rng.random_range(0.0f32..=1.0); 3];
        self.chosen = Some((turn, view, background));
        (view, background)
    }
}

impl Objective for PictureObjective<'_> {
    type Splats<'a> = Splats<'a>;

    fn record(&mut self, recorder: &mut Recorder, splats: &Splats<'_>, turn: u32) -> Result<()> {
        let (view, background) = self.choose(turn);
        let shot = self.shot(&self.views.cameras[view], background);
        self.picture.draw(recorder, splats, &shot);
        self.picture.compare(recorder, &self.views.wanted[view], background, self.ssim_weight);
        self.picture.differentiate(recorder, splats, &shot);
        Ok(())
    }

    fn gradients(&self) -> &Buffer<SplatGrad> {
        &self.picture.rows
    }

    fn pair_totals(&self) -> &Buffer<u32> {
        &self.picture.pair_totals
    }

    fn capacity(&self) -> usize {
        self.picture.capacity()
    }

    fn grow(&mut self, pairs: usize) -> Result<()> {
        self.picture.grow(pairs)
    }
}
