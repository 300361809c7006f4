//! Renders the pictures: one, or a turntable as an animation or as a sequence of files.

use std::f64::consts::TAU;

use engine::Result;
use engine::image::file::{Animation, write_animation};
use engine::image::{self, Annotation, ColourBar, Image, Ink, WriteOptions, annotate, orientation_labels};
use engine::render::{Camera, Renderer, Scene};
use glam::DVec3;

use super::arguments::RenderArguments;
use crate::shared::console::Console;
use crate::shared::progress::Steps;

/// What is told on all frames.
pub struct Told {
    /// True if the orientation of the patient is known.
    pub oriented: bool,
    /// Bar of colours, if it was asked for.
    pub colours: Option<ColourBar>,
}

/// Renders and writes all frames; returns their number.
pub fn render(
    arguments: &RenderArguments,
    console: &Console,
    renderer: &mut Renderer,
    scene: &Scene,
    camera: Camera,
    told: &Told,
) -> Result<u32> {
    let count = arguments.turntable.turntable.unwrap_or(1);
    let [low, high] = scene.bounds();
    let centre = (low + high) * 0.5;
    let options = WriteOptions {
        background: arguments.background.0,
        dpi: arguments.size.printed(arguments.dpi),
        force: arguments.output.force,
    };
    let size = arguments.size.pixels(arguments.dpi).map(|n| n as usize);
    let mut steps = Steps::new(console, "frame", u64::from(count));
    let mut frame = |index: u32, renderer: &mut Renderer| -> Result<Image> {
        let turned = camera.turned(centre, DVec3::Z, -TAU * f64::from(index) / f64::from(count));
        renderer.render(scene, &[turned])?;
        let mut picture = Image { size, pixels: renderer.target.read_colour(0)? };
        if let Some(background) = arguments.background.0 {
            picture = picture.over(background);
        }
        annotate(&mut picture, &annotation(arguments, &turned, centre, told));
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

/// Returns letters and bars, as asked for. The bar is true in the plane through `centre`.
fn annotation(arguments: &RenderArguments, camera: &Camera, centre: DVec3, told: &Told) -> Annotation {
    let labels =
        (arguments.orientation && told.oriented).then(|| orientation_labels(camera.right, camera.up));
    let mm_per_pixel = arguments.scale_bar.then(|| {
        let distance = (centre - camera.eye).dot(camera.forward());
        distance * (camera.fov.right - camera.fov.left) / f64::from(arguments.size.pixels(arguments.dpi)[0])
    });
    let (colours, ink) = (told.colours.clone(), Ink::on(arguments.background.0));
    Annotation { labels, mm_per_pixel: mm_per_pixel.filter(|&mm| mm > 0.0), colours, ink }
}
