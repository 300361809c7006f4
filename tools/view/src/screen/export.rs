//! Writes pictures and turntables of what the viewer shows, at any size, beside the window.

use std::path::Path;

use engine::Result;
use engine::gpu::Gpu;
use engine::image::file::{self, Animation, write_animation};
use engine::image::{self, Image, WriteOptions};
use engine::render::{Renderer, Scene, Settings};

use crate::io::loaded_data::LoadedData;
use crate::model::orbit::Orbit;
use crate::model::picture_options::PictureOptions;
use crate::model::state::{DECODED, Subject, ViewState, mode_row};
use crate::panels::annotations::{Ink, Told};
use crate::screen::overlay_image::{OverlayImage, put_over};

/// Frames per second of a turntable.
const FRAMES_PER_SECOND: u16 = 15;

/// Picture or turntable to write: a copy of the state when it was asked for, so that the window may go on.
pub struct Export {
    gpu: Gpu,
    data: LoadedData,
    state: ViewState,
    options: PictureOptions,
    /// Width and height of the picture in the window, points.
    points: [f32; 2],
    /// Least and greatest intensity of the data.
    range: [f64; 2],
}

/// Scene with its renderer.
struct Side {
    scene: Scene,
    renderer: Renderer,
}

/// What renders the frames.
struct Stage {
    sides: Vec<Side>,
    overlay: Option<OverlayImage>,
}

impl Export {
    /// Creates an export of what is shown now. `points` are width and height of the picture in the window, `range` that
    /// of the intensities.
    pub fn new(
        gpu: &Gpu,
        (state, data): (&ViewState, &LoadedData),
        options: PictureOptions,
        points: [f32; 2],
        range: [f64; 2],
    ) -> Self {
        Export { gpu: gpu.clone(), data: data.sources(), state: state.clone(), options, points, range }
    }

    /// Writes a picture; the extension of `path` chooses the format.
    pub fn still(&self, path: &Path, force: bool) -> Result<()> {
        let picture = self.frame(&mut self.stage()?, self.state.orbit)?;
        image::write(path, &picture, None, &self.write_options(path, force)?)
    }

    /// Writes a full turn about the patient's long axis through the pivot as an animated PNG. `progress` is
    /// called with the part that is done.
    pub fn turntable(
        &self,
        path: &Path,
        frames: u32,
        force: bool,
        progress: &mut dyn FnMut(f32),
    ) -> Result<()> {
        let mut stage = self.stage()?;
        let size = self.options.size.map(|n| n as usize);
        let animation = Animation { size, frames, frames_per_second: FRAMES_PER_SECOND, loops: 0 };
        write_animation(path, &animation, &self.write_options(path, force)?, |index| {
            let share = f64::from(index) / f64::from(frames);
            progress(share as f32);
            let Orbit { azimuth_deg, .. } = self.state.orbit;
            self.frame(&mut stage, Orbit { azimuth_deg: azimuth_deg - 360.0 * share, ..self.state.orbit })
        })
    }

    fn write_options(&self, path: &Path, force: bool) -> Result<WriteOptions> {
        let dpi = file::of_extension(path)?.dpi.then_some(f64::from(self.options.dpi));
        Ok(WriteOptions { background: self.background(), dpi, force })
    }

    /// Returns the colour behind the picture; `None` if it is transparent.
    fn background(&self) -> Option<[f32; 3]> {
        self.options.backing.colour(self.state.background).map(|colour| colour.as_vec3().into())
    }

    /// Returns what renders the frames: one scene, or two with a split between them, and what is told.
    fn stage(&self) -> Result<Stage> {
        let subjects = self.state.subjects(|subject| self.data.has(subject));
        let settings =
            Settings { precise: true, decoding: self.state.decoding(), ..Settings::new(self.options.size) };
        let mut sides = Vec::new();
        for subject in subjects {
            let error = (subject == Subject::Splats && self.data.shows_error(&self.state))
                .then(|| self.data.error_scene(&self.gpu, &self.state, settings.decoding))
                .transpose()?
                .flatten();
            let (scene, mode) = match error {
                Some((scene, decoding)) => {
                    decoding(&mut |_| ())?;
                    (Some(scene), DECODED)
                }
                None => {
                    let mode = self.data.mode_of(subject, &self.state);
                    (self.data.scene(&self.gpu, subject, &self.state)?, mode)
                }
            };
            if let Some(scene) = scene {
                let mode = mode_row(mode);
                let step = self.state.quality.step.unwrap_or(mode.step);
                let renderer =
                    Renderer::new(&self.gpu, mode, &scene, &Settings { step, ..settings.clone() })?;
                sides.push(Side { scene, renderer });
            }
        }
        let overlay = || OverlayImage::new(&self.gpu, self.options.size, self.points);
        Ok(Stage { sides, overlay: self.options.told.then(overlay).transpose()? })
    }

    fn frame(&self, stage: &mut Stage, orbit: Orbit) -> Result<Image> {
        let size = self.options.size.map(|n| n as usize);
        let camera = orbit.camera(size[0] as f64 / size[1] as f64);
        let mut picture = Image { size, pixels: vec![[0.0; 4]; size[0] * size[1]] };
        let split = self.state.split.filter(|_| stage.sides.len() > 1).unwrap_or(1.0);
        let column = (split * size[0] as f64).round() as usize;
        for (side, columns) in stage.sides.iter_mut().zip([0..column, column..size[0]]) {
            side.renderer.render(&side.scene, &[camera])?;
            let pixels = side.renderer.target.read_colour(0)?;
            for (to, from) in picture.pixels.chunks_mut(size[0]).zip(pixels.chunks(size[0])) {
                to[columns.clone()].copy_from_slice(&from[columns.clone()]);
            }
        }
        if let Some(background) = self.background() {
            picture = picture.over(background);
        }
        if let Some(overlay) = &mut stage.overlay {
            let state = ViewState { orbit, ..self.state.clone() };
            let subjects = state.subjects(|subject| self.data.has(subject));
            let told = Told {
                oriented: self.data.oriented(),
                range: self.range,
                unit: self.data.unit().text(),
                subjects: &subjects,
                fitted: self.data.fitted.is_some(),
                error: (self.data.error_found().filter(|_| self.data.shows_error(&state)))
                    .map(|error| state.errors.range(error)),
            };
            let ink = Ink::on(self.options.backing.colour(state.background));
            put_over(&mut picture, &overlay.paint(&state, &told, ink)?);
        }
        Ok(picture)
    }
}
