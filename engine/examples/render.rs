//! Renders splats through a transfer function, from four sides:
//! `cargo run --release --example render -- SPLATS.ply CT-Bone`. Writes `anterior.png` and so on.

use std::path::PathBuf;

use engine::gpu::{Gpu, GpuOptions};
use engine::image::{self, Image, WriteOptions};
use engine::render::{Camera, Look, Renderer, Scene, Settings, mode};
use engine::{splat, transfer};

fn main() -> engine::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let path: PathBuf = arguments.next().unwrap_or_else(|| "phantom.ply".to_owned()).into();
    let preset = arguments.next().unwrap_or_else(|| "CT-Bone".to_owned());

    let set = splat::read_all(&[path], || Ok(None))?;
    let transfer = transfer::load(&preset, set.intensity_range().unwrap_or_default())?;
    let gpu = Gpu::new(&GpuOptions::default())?;
    let scene = Scene::new(&gpu, Some(&set), None, &Look::new(transfer))?;
    let [low, high] = scene.bounds();
    let (middle, radius) = ((low + high) / 2.0, (high - low).length() / 2.0);

    let settings = Settings::new([480, 480]);
    let black = WriteOptions { background: Some([0.0; 3]), force: true, ..WriteOptions::default() };
    let mut renderer = Renderer::new(&gpu, mode("slab")?, &scene, &settings)?;
    for side in ["anterior", "left", "posterior", "right"] {
        let camera = Camera::from_side(side, middle, radius, 30.0, 1.0)?;
        renderer.render(&scene, &[camera])?;
        let picture = Image { size: [480, 480], pixels: renderer.target.read_colour(0)? };
        let file = format!("{side}.png");
        image::write(&file, &picture, None, &black)?;
        println!("{file}");
    }
    Ok(())
}
