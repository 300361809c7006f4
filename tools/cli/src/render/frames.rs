//! The pictures of `vgs render`: one, or a turntable as an animation or as a sequence of files.

use std::f64::consts::TAU;
use std::path::PathBuf;

use clap::Args;
use engine::image::file::{self, Animation, write_animation};
use engine::image::{self, Annotation, Image, WriteOptions, annotate, orientation_labels};
use engine::render::{Camera, Renderer, Scene};
use engine::{Error, Kind, Result};
use glam::DVec3;

use super::Arguments;
use crate::console::Console;
use crate::progress::Steps;

/// Where pictures go.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Output")]
pub struct Output {
    /// Where the picture goes: .png, or .exr for floats and depth
    #[arg(short, long, value_name = "FILE.png|FILE.exr")]
    pub output: PathBuf,
    /// Replaces outputs that exist
    #[arg(short, long)]
    pub force: bool,
}

/// A turn around the scene.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Turntable")]
pub struct Turntable {
    /// Turns once around the patient's long axis in so many frames: an animated PNG
    #[arg(long, value_name = "FRAMES", value_parser = clap::value_parser!(u32).range(2..=3600))]
    pub turntable: Option<u32>,
    /// Frames per second of the animation
    #[arg(long, value_name = "N", default_value_t = 15, value_parser = clap::value_parser!(u16).range(1..=120))]
    pub fps: u16,
    /// One file a frame (NAME-000.png ...) instead of an animation
    #[arg(long, requires = "turntable")]
    pub sequence: bool,
}

impl Output {
    /// The files that will be written.
    pub fn files(&self, turntable: &Turntable) -> Result<Vec<PathBuf>> {
        let format = file::of_extension(&self.output)?;
        match turntable.turntable {
            Some(count) if turntable.sequence => Ok((0..count).map(|i| self.numbered(i, count)).collect()),
            Some(_) if format.depth => Err(Error::new(Kind::Usage, "VGS-CLI-093", "an animation is a PNG")
                .file(&self.output)
                .help("choose a name that ends in .png, or --sequence for one file a frame")),
            _ => Ok(vec![self.output.clone()]),
        }
    }

    /// Whether the format has a place for depth.
    pub fn wants_depth(&self) -> bool {
        file::of_extension(&self.output).is_ok_and(|f| f.depth)
    }

    fn numbered(&self, index: u32, count: u32) -> PathBuf {
        let digits = (count - 1).to_string().len().max(3);
        let name = self.output.file_stem().unwrap_or_default().to_string_lossy();
        let ending = self.output.extension().unwrap_or_default().to_string_lossy();
        self.output.with_file_name(format!("{name}-{index:0digits$}.{ending}"))
    }
}

/// Renders and writes all frames; gives their number. `oriented` says whether it is known how the patient lies.
pub fn render(
    arguments: &Arguments,
    console: &Console,
    renderer: &mut Renderer,
    scene: &Scene,
    camera: Camera,
    oriented: bool,
) -> Result<u32> {
    let count = arguments.turntable.turntable.unwrap_or(1);
    let [low, high] = scene.bounds();
    let centre = (low + high) * 0.5;
    let options = WriteOptions { background: arguments.background.0, force: arguments.output.force };
    let size = arguments.size.0.map(|n| n as usize);
    let mut steps = Steps::new(console, "frame", u64::from(count));
    let mut frame = |index: u32, renderer: &mut Renderer| -> Result<Image> {
        let turned = camera.turned(centre, DVec3::Z, -TAU * f64::from(index) / f64::from(count));
        renderer.render(scene, &[turned])?;
        let mut picture = Image { size, pixels: renderer.target.read_colour(0)? };
        if let Some(background) = arguments.background.0 {
            picture = picture.over(background);
        }
        annotate(&mut picture, &arguments.annotation(&turned, centre, oriented));
        steps.done(u64::from(index) + 1);
        Ok(picture)
    };
    if count > 1 && !arguments.turntable.sequence {
        let animation =
            Animation { size, frames: count, frames_per_second: arguments.turntable.fps, loops: 0 };
        write_animation(&arguments.output.output, &animation, &options, |index| frame(index, renderer))?;
        return Ok(count);
    }
    for index in 0..count {
        let picture = frame(index, renderer)?;
        let output = &arguments.output;
        let path = if count > 1 { output.numbered(index, count) } else { output.output.clone() };
        let depth = output.wants_depth().then(|| renderer.target.read_depth(0)).transpose()?;
        image::write(&path, &picture, depth.as_deref(), &options)?;
    }
    Ok(count)
}

impl Arguments {
    /// Letters and scale bar, as asked for. The bar is true in the plane through `centre`.
    fn annotation(&self, camera: &Camera, centre: DVec3, oriented: bool) -> Annotation {
        let labels = (self.orientation && oriented).then(|| orientation_labels(camera.right, camera.up));
        let mm_per_pixel = self.scale_bar.then(|| {
            let distance = (centre - camera.eye).dot(camera.forward());
            distance * (camera.fov.right - camera.fov.left) / f64::from(self.size.0[0])
        });
        Annotation { labels, mm_per_pixel: mm_per_pixel.filter(|&mm| mm > 0.0) }
    }
}
