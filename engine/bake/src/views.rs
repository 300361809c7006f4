//! Cameras all around a scene, and the pictures that are wanted from there.

use std::f64::consts::PI;

use glam::DVec3;

use base::error::Result;
use gpu::{Buffer, Gpu};
use image::Image;
use render::{Camera, FOV_DEGREES, Fov, Renderer, Scene, Settings, mode};

/// Cameras and the wanted pictures of each, on the device.
pub struct Views {
    /// Cameras in the world, mm RAS.
    pub cameras: Vec<Camera>,
    /// The ball that they look at: its centre, mm RAS, and its radius, mm.
    pub ball: (DVec3, f64),
    /// Width and height of the pictures, pixels.
    pub size: [u32; 2],
    /// A word a pixel for each picture: red lowest, colours times opacity, opacity.
    pub wanted: Vec<Buffer<u32>>,
}

/// Returns `count` cameras at equal distances from each other on a sphere around a ball, which fills their pictures. With
/// `shift` 0 and ½ none is where another is.
fn around(centre: DVec3, radius: f64, count: usize, shift: f64) -> Result<Vec<Camera>> {
    let half = (FOV_DEGREES.to_radians() * 0.5).tan();
    let distance = radius * (1.0 + half.powi(-2)).sqrt();
    let camera = |i: usize| {
        // A spiral of equal areas.
        let z = 1.0 - (2.0 * i as f64 + 1.0) / count as f64;
        let angle = (i as f64 + shift) * PI * (5f64.sqrt() - 1.0);
        let side = (1.0 - z * z).sqrt();
        let towards = DVec3::new(side * angle.cos(), side * angle.sin(), z);
        let up = if side < 1e-3 { DVec3::Y } else { DVec3::Z };
        Camera::looking(centre + towards * distance, centre, up, Fov::symmetric(FOV_DEGREES, 1.0))
    };
    (0..count).map(camera).collect()
}

impl Views {
    /// Renders a scene from `count` places all around the whole of it, what is hidden or cut away included, in the mode
    /// called `mode_name` and as finely as that is meant for pictures. `going` is told the number of pictures that are
    /// done, and ends the work by false; the result is `None` then.
    ///
    /// # Errors
    /// Those of [`mode`] and of the device.
    pub fn of_scene(
        gpu: &Gpu,
        scene: &Scene,
        mode_name: &str,
        (count, shift): (usize, f64),
        pixels: u32,
        going: &mut dyn FnMut(usize) -> bool,
    ) -> Result<Option<Self>> {
        let [low, high] = scene.bounds();
        let ball = ((low + high) * 0.5, ((high - low).length() * 0.5).max(1e-3));
        let cameras = around(ball.0, ball.1, count, shift)?;
        let empty = Views { cameras, ball, size: [pixels; 2], wanted: Vec::new() };
        empty.rendered(gpu, scene, mode_name, going)
    }

    /// Renders another scene, or the same one in another mode, from the places of these views.
    ///
    /// # Errors
    /// Those of [`mode`] and of the device.
    pub fn of_same_cameras(&self, gpu: &Gpu, scene: &Scene, mode_name: &str) -> Result<Option<Self>> {
        let empty = Views { cameras: self.cameras.clone(), wanted: Vec::new(), ..*self };
        empty.rendered(gpu, scene, mode_name, &mut |_| true)
    }

    fn rendered(
        mut self,
        gpu: &Gpu,
        scene: &Scene,
        mode_name: &str,
        going: &mut dyn FnMut(usize) -> bool,
    ) -> Result<Option<Self>> {
        let row = mode(mode_name)?;
        let settings = Settings { step: row.step, ..Settings::new(self.size) };
        let mut renderer = Renderer::new(gpu, row, scene, &settings)?;
        for (i, camera) in self.cameras.iter().enumerate() {
            if !going(i) {
                return Ok(None);
            }
            renderer.render(scene, std::slice::from_ref(camera))?;
            let words: Vec<u32> = renderer.target.read_colour(0)?.iter().map(word).collect();
            self.wanted.push(gpu.upload("wanted picture", "pictures", &words)?);
        }
        Ok(Some(self))
    }

    /// Returns the wanted pictures over black. Waits for the device.
    ///
    /// # Errors
    /// Those of the device.
    pub fn pictures(&self) -> Result<Vec<Image>> {
        self.wanted.iter().map(|wanted| picture(wanted, self.size)).collect()
    }
}

/// Returns a wanted picture over black.
fn picture(wanted: &Buffer<u32>, size: [u32; 2]) -> Result<Image> {
    let pixels = wanted.read()?.iter().map(|word| word.to_le_bytes().map(|v| f32::from(v) / 255.0)).collect();
    Ok(Image { size: size.map(|edge| edge as usize), pixels })
}

/// Returns a pixel in a byte a channel. No colour is brighter than its opacity.
fn word(pixel: &[f32; 4]) -> u32 {
    let opacity = pixel[3].clamp(0.0, 1.0);
    let byte = |v: f32| (v * 255.0).round() as u32;
    let [r, g, b] = [0, 1, 2].map(|c| byte(pixel[c].clamp(0.0, opacity)));
    r | g << 8 | b << 16 | byte(opacity) << 24
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cameras_are_all_around_and_see_the_ball() {
        let centre = DVec3::new(10.0, -20.0, 300.0);
        let first = around(centre, 50.0, 40, 0.0).expect("cameras");
        let second = around(centre, 50.0, 8, 0.5).expect("cameras");
        let mean: DVec3 = first.iter().map(|c| (c.eye - centre).normalize()).sum::<DVec3>() / 40.0;
        assert!(mean.length() < 0.05, "{mean}");
        let half = 15f64.to_radians();
        for camera in first.iter().chain(&second) {
            let distance = camera.eye.distance(centre);
            assert!((distance * half.sin() - 50.0).abs() < 1e-9, "the ball touches the cone of the picture");
            assert!((camera.forward().dot((centre - camera.eye) / distance) - 1.0).abs() < 1e-12);
        }
        let apart = first.iter().flat_map(|a| second.iter().map(|b| a.eye.distance(b.eye)));
        assert!(apart.fold(f64::INFINITY, f64::min) > 1.0, "no view that is held out is trained");
    }

    #[test]
    fn words_are_premultiplied_and_within_their_opacity() {
        assert_eq!(word(&[0.0; 4]), 0);
        assert_eq!(word(&[1.0, 0.5, 0.0, 1.0]), 0xff00_80ff);
        assert_eq!(word(&[9.0, f32::NAN, -1.0, 0.2]), 51 << 24 | 51);
    }
}
