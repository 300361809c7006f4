//! Writes pictures and turntables of what the viewer shows, at any size, beside the window.

use std::f64::consts::TAU;
use std::path::Path;

use engine::Result;
use engine::gpu::Gpu;
use engine::image::file::{Animation, write_animation};
use engine::image::{self, Annotation, Image, WriteOptions, annotate, orientation_labels};
use engine::render::{Camera, Renderer, Scene, Settings};
use glam::DVec3;

use crate::loaded_data::LoadedData;
use crate::state::{ViewState, mode_row};

/// Frames per second of a turntable.
const FRAMES_PER_SECOND: u16 = 15;

/// Picture or turntable to write: a copy of the state when it was asked for, so that the window may go on.
pub struct Export {
    gpu: Gpu,
    data: LoadedData,
    state: ViewState,
    size: [u32; 2],
}

/// Scene with its renderer.
struct Side {
    scene: Scene,
    renderer: Renderer,
}

impl Export {
    /// Creates an export of what is shown now, of `size` pixels.
    pub fn new(gpu: &Gpu, state: &ViewState, data: &LoadedData, size: [u32; 2]) -> Self {
        Export { gpu: gpu.clone(), data: data.sources(), state: state.clone(), size }
    }

    /// Writes a picture; the extension of `path` chooses the format.
    pub fn still(&self, path: &Path, force: bool) -> Result<()> {
        let mut sides = self.sides()?;
        let picture = self.frame(&mut sides, self.camera())?;
        image::write(path, &picture, None, &WriteOptions { background: Some(self.background()), force })
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
        let mut sides = self.sides()?;
        let size = self.size.map(|n| n as usize);
        let animation = Animation { size, frames, frames_per_second: FRAMES_PER_SECOND, loops: 0 };
        let options = WriteOptions { background: Some(self.background()), force };
        write_animation(path, &animation, &options, |index| {
            progress(index as f32 / frames as f32);
            let angle = -TAU * f64::from(index) / f64::from(frames);
            self.frame(&mut sides, self.camera().turned(self.state.orbit.pivot_mm, DVec3::Z, angle))
        })
    }

    fn background(&self) -> [f32; 3] {
        self.state.background.as_vec3().into()
    }

    fn camera(&self) -> Camera {
        self.state.orbit.camera(f64::from(self.size[0]) / f64::from(self.size[1]))
    }

    /// Returns the scenes that are shown: one, or two with a split between them.
    fn sides(&self) -> Result<Vec<Side>> {
        let subjects = self.state.subjects(|subject| self.data.has(subject));
        let settings = Settings { precise: true, step: self.state.quality.step, ..Settings::new(self.size) };
        let mut sides = Vec::new();
        for subject in subjects {
            if let Some(scene) = self.data.scene(&self.gpu, subject, &self.state)? {
                let mode = mode_row(self.data.mode_of(subject, &self.state));
                let renderer = Renderer::new(&self.gpu, mode, &scene, &settings)?;
                sides.push(Side { scene, renderer });
            }
        }
        Ok(sides)
    }

    fn frame(&self, sides: &mut [Side], camera: Camera) -> Result<Image> {
        let size = self.size.map(|n| n as usize);
        let mut picture = Image { size, pixels: vec![[0.0; 4]; size[0] * size[1]] };
        let split = self.state.split.filter(|_| sides.len() > 1).unwrap_or(1.0);
        let column = (split * size[0] as f64).round() as usize;
        for (side, columns) in sides.iter_mut().zip([0..column, column..size[0]]) {
            side.renderer.render(&side.scene, &[camera])?;
            let pixels = side.renderer.target.read_colour(0)?;
            for (to, from) in picture.pixels.chunks_mut(size[0]).zip(pixels.chunks(size[0])) {
                to[columns.clone()].copy_from_slice(&from[columns.clone()]);
            }
        }
        let mut picture = picture.over(self.background());
        annotate(&mut picture, &self.annotation(&camera));
        Ok(picture)
    }

    /// Returns letters and scale bar, as the window shows them.
    fn annotation(&self, camera: &Camera) -> Annotation {
        let show = &self.state.show;
        let labels =
            (show.orientation && self.data.oriented()).then(|| orientation_labels(camera.right, camera.up));
        let mm_per_pixel = show.scale_bar.then(|| self.state.orbit.height_mm() / f64::from(self.size[1]));
        Annotation { labels, mm_per_pixel }
    }
}
