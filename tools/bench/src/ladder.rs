//! What the rungs of the renderer's ladder cost, relative to its first, and what they give up: the numbers of
//! `engine::render::LADDER`.

use std::path::PathBuf;

use clap::Args;
use engine::gpu::Gpu;
use engine::image::{Image, psnr};
use engine::render::{Camera, Frames, LADDER, Look, Scene, Settings};
use engine::splat::{self, ReadOptions};
use engine::{Result, transfer};
use glam::DVec3;

use crate::report::{Table, finish};

/// Directions from which a head looks, around the scene, degrees.
const ANGLES: [f64; 4] = [0.0, 30.0, 100.0, 215.0];
/// Distance of the eyes, mm.
const EYES_APART: f64 = 63.0;

/// Cost and loss of each rung, for two eyes at once
#[derive(Args)]
pub struct Arguments {
    /// The splats (PLY)
    splats: PathBuf,
    /// Width and height of an eye's picture, pixels
    #[arg(long, num_args = 2, value_names = ["WIDTH", "HEIGHT"], default_values_t = [320, 320])]
    size: Vec<u32>,
    /// Transfer function
    #[arg(long, default_value = "CT-Bone")]
    tf: String,
    /// Frames of each rung and direction, of which the median counts
    #[arg(long, default_value_t = 7)]
    frames: usize,
    /// Writes the table as Markdown
    #[arg(long, value_name = "FILE")]
    markdown: Option<PathBuf>,
    /// Writes it as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Replaces files
    #[arg(long)]
    force: bool,
}

/// Runs the benchmark.
pub fn run(gpu: &Gpu, arguments: &Arguments) -> Result<()> {
    let mut set = splat::read(&arguments.splats, &ReadOptions::default())?;
    set.order_by_importance();
    let range = set.splats.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], s| {
        [low.min(f64::from(s.intensity)), high.max(f64::from(s.intensity))]
    });
    let look = Look::new(transfer::load(&arguments.tf, range)?);
    let scene = Scene::new(gpu, Some(&set), None, &look)?;
    let settings = Settings { views: 2, ..Settings::new([arguments.size[0], arguments.size[1]]) };
    let mut frames = Frames::new(gpu, &scene, &settings, &LADDER)?;
    let heads = heads(&scene, &settings)?;
    for head in &heads {
        frames.warm_up(&scene, &head.eyes(EYES_APART))?;
    }
    let mut losses = Vec::new();
    let best = pictures(gpu, &scene, &mut frames, &heads, 0)?;
    for rung in 0..LADDER.len() {
        let found = pictures(gpu, &scene, &mut frames, &heads, rung)?;
        let mut worst = f64::INFINITY;
        for (a, b) in best.iter().zip(&found) {
            worst = psnr(a, b)?.min(worst);
        }
        losses.push(worst);
    }
    let times = median_ms(gpu, &scene, &mut frames, &heads, arguments.frames.max(1))?;
    let rows = LADDER.iter().enumerate().map(|(n, rung)| {
        vec![
            n.to_string(),
            rung.mode.to_owned(),
            format!("{:.2}", rung.quality.resolution),
            format!("{:.1}", rung.quality.coarseness),
            format!("{:.1}", rung.quality.splats),
            format!("{:.1}", times[n]),
            format!("{:.2}", times[n] / times[0]),
            format!("{:.2}", rung.cost),
            if n == 0 { "-".to_owned() } else { format!("{:.1}", losses[n]) },
        ]
    });
    let [width, height] = settings.size;
    let title = format!(
        "Rungs of the ladder: {} splats, {}, two eyes of {width}x{height}, median of {} directions and {} frames; {} ({})",
        set.splats.len(),
        arguments.tf,
        ANGLES.len(),
        arguments.frames,
        gpu.description().name,
        gpu.description().driver
    );
    let columns = vec![
        "rung",
        "mode",
        "resolution",
        "slabs",
        "splats",
        "ms",
        "cost",
        "cost in the ladder",
        "PSNR against rung 0 / dB",
    ];
    let table = Table { title, columns, rows: rows.collect() };
    finish(&[table], arguments.markdown.as_deref(), arguments.json.as_deref(), arguments.force)
}

/// Heads around the scene, which sees about as much of it as one does who stands before it.
fn heads(scene: &Scene, settings: &Settings) -> Result<Vec<Camera>> {
    let [low, high] = scene.bounds();
    let centre = (low + high) * 0.5;
    let aspect = f64::from(settings.size[0]) / f64::from(settings.size[1]);
    let front = Camera::from_side("anterior", centre, (high - low).length() * 0.5, 60.0, aspect)?;
    Ok(ANGLES.iter().map(|degrees| front.turned(centre, DVec3::Z, degrees.to_radians())).collect())
}

/// What the left eye sees on a rung, over black and in the size of the best one.
fn pictures(
    gpu: &Gpu,
    scene: &Scene,
    frames: &mut Frames,
    heads: &[Camera],
    rung: usize,
) -> Result<Vec<Image>> {
    heads
        .iter()
        .map(|head| {
            let frame = frames.begin(scene, rung)?;
            let size = frame.size;
            let ticket = frames.submit(frame, scene, &head.eyes(EYES_APART))?;
            gpu.wait(ticket)?;
            let pixels = frames.target.read_colour(0)?;
            let wide = frames.target.size().map(|n| n as usize);
            Ok(enlarged(&Image { size: wide, pixels }, size.map(|n| n as usize)).over([0.0; 3]))
        })
        .collect()
}

/// The upper left corner of a picture as large as the whole, as a sampler shows it.
fn enlarged(picture: &Image, part: [usize; 2]) -> Image {
    let [width, height] = picture.size;
    let at = |x: usize, y: usize| picture.pixels[y * width + x];
    let place = |i: usize, all: usize, part: usize| {
        let x = ((i as f64 + 0.5) * part as f64 / all as f64 - 0.5).clamp(0.0, part as f64 - 1.0);
        let low = x.floor() as usize;
        (low, (low + 1).min(part - 1), (x - x.floor()) as f32)
    };
    let pixels = (0..width * height)
        .map(|i| {
            let (x0, x1, u) = place(i % width, width, part[0]);
            let (y0, y1, v) = place(i / width, height, part[1]);
            std::array::from_fn(|c| {
                let upper = at(x0, y0)[c] * (1.0 - u) + at(x1, y0)[c] * u;
                let lower = at(x0, y1)[c] * (1.0 - u) + at(x1, y1)[c] * u;
                upper * (1.0 - v) + lower * v
            })
        })
        .collect();
    Image { size: picture.size, pixels }
}

/// Device time of each rung, ms. The rungs take turns, so that whatever else the machine does is shared by all, in another order
/// each time: what a frame costs depends on how hard the one before it was.
fn median_ms(
    gpu: &Gpu,
    scene: &Scene,
    frames: &mut Frames,
    heads: &[Camera],
    rounds: usize,
) -> Result<Vec<f64>> {
    let count = LADDER.len();
    let strides: Vec<usize> = (1..count).filter(|&stride| coprime(stride, count)).collect();
    let mut times = vec![Vec::new(); count];
    for (turn, head) in std::iter::repeat_n(heads, rounds).flatten().enumerate() {
        for place in 0..count {
            let rung = (place * strides[turn % strides.len()] + turn) % count;
            let frame = frames.begin(scene, rung)?;
            let ticket = frames.submit(frame, scene, &head.eyes(EYES_APART))?;
            gpu.wait(ticket)?;
            times[rung].extend(frames.finished()?.iter().map(|f| f.gpu_ms));
        }
    }
    Ok(times
        .into_iter()
        .map(|mut ms| {
            ms.sort_by(f64::total_cmp);
            ms[ms.len() / 2]
        })
        .collect())
}

fn coprime(a: usize, b: usize) -> bool {
    if b == 0 { a == 1 } else { coprime(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_coprime_strides_visit_all() {
        assert_eq!((1..9).filter(|&n| coprime(n, 9)).collect::<Vec<_>>(), [1, 2, 4, 5, 7, 8]);
    }

    #[test]
    fn a_corner_is_enlarged_as_a_sampler_does() {
        let row = [[0.0; 4], [1.0; 4], [9.0; 4], [9.0; 4]];
        let picture = Image { size: [4, 2], pixels: [row, row].concat() };
        let wide = enlarged(&picture, [2, 1]);
        let first: Vec<f32> = wide.pixels[..4].iter().map(|p| p[0]).collect();
        assert_eq!(first, [0.0, 0.25, 0.75, 1.0], "what lies beyond the corner does not bleed in");
        assert_eq!(enlarged(&picture, [4, 2]).pixels, picture.pixels);
    }
}
