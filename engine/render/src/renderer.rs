//! A renderer of one picture after the other that waits for each.

use super::camera::Camera;
use super::mode::Mode;
use super::modes::ModeRow;
use super::part::Part;
use super::quality::Quality;
use super::scene::Scene;
use super::settings::Settings;
use super::target::Target;
use super::visibility_mask::VisibilityMask;
use base::error::Result;
use gpu::{Gpu, Ticket};
use passes::{Views, Work};

/// A mode with its target and its views; it renders a scene offscreen.
pub struct Renderer {
    gpu: Gpu,
    mode: Box<dyn Mode>,
    views: Views,
    /// Visibility masks of the pictures; empty if the settings do not ask for masks.
    masks: Vec<VisibilityMask>,
    /// Pictures that were rendered last.
    pub target: Target,
}

impl Renderer {
    /// Creates a renderer. Fails if the scene lacks what the mode renders.
    pub fn new(gpu: &Gpu, mode: &ModeRow, scene: &Scene, settings: &Settings) -> Result<Self> {
        Ok(Renderer {
            gpu: gpu.clone(),
            mode: mode.make(gpu, scene, settings)?,
            views: Views::new(gpu, "views", settings.views, settings.masked)?,
            masks: vec![VisibilityMask::default(); if settings.masked { settings.views as usize } else { 0 }],
            target: Target::new(gpu, settings.size, settings.views, settings.precise, settings.depth)?,
        })
    }

    /// Sets the visibility masks of the pictures from now on.
    ///
    /// # Panics
    /// If the settings did not ask for masks, or had another number of views.
    pub fn set_visibility_masks(&mut self, masks: &[VisibilityMask]) {
        self.masks.clone_from_slice(masks);
    }

    /// Renders one picture for each camera and waits for them.
    ///
    /// # Panics
    /// If there are not as many cameras as the settings had views.
    pub fn render(&mut self, scene: &Scene, cameras: &[Camera]) -> Result<()> {
        self.render_at(scene, cameras, &Quality::FULL)
    }

    /// Renders as [`Self::render`] does, at a lower quality: the pictures lie in the upper left corner of the
    /// target, as large as [`Quality::size`] says.
    ///
    /// # Panics
    /// If there are not as many cameras as the settings had views.
    pub fn render_at(&mut self, scene: &Scene, cameras: &[Camera], quality: &Quality) -> Result<()> {
        loop {
            let ticket = self.submit(scene, cameras, quality, Part::WHOLE)?;
            self.gpu.wait(ticket)?;
            if !self.settle()? {
                return Ok(());
            }
        }
    }

    /// Submits the rendering of a part of such pictures, and does not wait. The parts follow each other, with the
    /// same scene, cameras and quality; before the first one, what was submitted earlier has finished.
    ///
    /// # Panics
    /// If there are not as many cameras as the settings had views.
    pub fn submit(
        &mut self,
        scene: &Scene,
        cameras: &[Camera],
        quality: &Quality,
        part: Part,
    ) -> Result<Ticket> {
        if part.is_first() {
            let rows = cameras.iter().map(|camera| camera.view(scene.origin));
            self.views.write(rows, self.masks.iter().map(|mask| mask.words))?;
        }
        let mut recorder = self.gpu.record()?;
        self.mode.record(&mut recorder, scene, &self.views, &mut self.target, quality, part)?;
        recorder.submit()
    }

    /// Creates what a change of the transfer function may ask for beside what there is.
    pub fn warm_up(&mut self, scene: &Scene) -> Result<()> {
        self.mode.warm_up(scene)
    }

    /// Grows the buffers that were too small for the submitted pictures, which have finished. Returns true if these
    /// have to be rendered again.
    pub fn settle(&mut self) -> Result<bool> {
        self.mode.settle()
    }

    /// Returns the work of the last frame; all 0 for a mode without splats.
    pub fn work(&self) -> Result<Work> {
        self.mode.work()
    }
}
