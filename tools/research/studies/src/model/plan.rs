//! Plan of the frames that are rendered: scenes, looks, cameras and ways to render.

use std::path::Path;

use engine::render::{Camera, Classification, Look, Quality, Rays, Scene, Settings};
use engine::{Result, transfer};
use serde::{Deserialize, Serialize};

use bench::store::hash;

/// Times that a frame is rendered.
const FRAMES: usize = 3;
/// Pixels that two CPU cores render in a second, over all modes.
const PIXELS_A_SECOND: f64 = 1.5e6;
/// Distance between the eyes, mm.
const EYES_MM: f64 = 64.0;
/// Distance from the head to the middle of the patient, mm, as `vgs-xr` places it. It is greater for large
/// patients.
const REACH_MM: f64 = 600.0;
/// Vertical field of view of a headset's eye, degrees: 96 as on a Quest 3 (Meta, 2023), whose pictures are
/// nearly square.
const HEADSET_DEGREES: f64 = 96.0;

/// How a scene is seen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sight {
    /// Name of the transfer function.
    pub transfer: String,
    /// True if surfaces are lit, provided that the transfer function says so.
    pub lit: bool,
}

impl Sight {
    /// Returns the look for a scene whose intensities span `range`.
    pub fn look(&self, range: [f64; 2]) -> Result<Look> {
        let mut function = transfer::load(&self.transfer, range)?;
        function.material.shade &= self.lit;
        Ok(Look::new(function))
    }
}

/// Position of the viewer, who sees the scene in real size through a headset: the share of the distance that it begins at.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Place(pub f64);

impl Place {
    /// Returns one camera, or one for each eye if there are two `views`, for pictures of `size` pixels.
    pub fn cameras(self, scene: &Scene, size: [u32; 2], views: u32) -> Result<Vec<Camera>> {
        let [low, high] = scene.bounds();
        let (centre, radius) = ((low + high) * 0.5, (high - low).length() * 0.5);
        let aspect = f64::from(size[0]) / f64::from(size[1]);
        let camera = Camera::from_side("anterior", centre, radius, HEADSET_DEGREES, aspect)?;
        let distance = self.0 * REACH_MM.max(1.5 * radius);
        let head = Camera { eye: centre - camera.forward() * distance, ..camera };
        Ok(if views > 1 { head.eyes(EYES_MM).into() } else { vec![head] })
    }

    /// Describes the place in a few words.
    pub fn name(self) -> String {
        match self.0 {
            1.0 => "as placed".into(),
            share => format!("at {share} of the distance"),
        }
    }
}

/// Way to render a frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Shot {
    /// Name of the mode.
    pub mode: String,
    /// Width and height of the target, pixels.
    pub size: [u32; 2],
    /// Number of pictures that are rendered at once.
    pub views: u32,
    /// True if depth is kept.
    pub depth: bool,
    /// Edges of the picture as a part of those of the target.
    pub resolution: f64,
    /// Distance of slabs, standard deviations, 1 or more.
    pub coarseness: f64,
}

impl Shot {
    /// Returns the quality of the pictures.
    pub fn quality(&self) -> Quality {
        Quality { resolution: self.resolution, coarseness: self.coarseness, ..Quality::FULL }
    }

    /// Returns the settings of a renderer for this shot.
    pub fn settings(&self) -> Settings {
        Settings {
            views: self.views,
            depth: self.depth,
            classification: Some(Classification::Point),
            // The counts are those of the kernel.
            rays: Rays::Computed,
            ..Settings::new(self.size)
        }
    }
}

/// The frames of one file of splats.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Unit {
    /// Name of the file, without its extension.
    pub file: String,
    /// Hash of the bytes of the file.
    pub contents: String,
    /// Ways in which it is seen.
    pub sights: Vec<Sight>,
    /// Positions of the viewer.
    pub places: Vec<Place>,
    /// Ways in which it is rendered, each with every sight from every place.
    pub shots: Vec<Shot>,
    /// Name, kind and driver of the device.
    pub device: String,
}

impl Unit {
    /// Returns the name of its file of results, without the extension.
    pub fn key(&self) -> String {
        format!("{}-{}", self.file.replace(|c: char| !c.is_ascii_alphanumeric(), "-"), hash(self))
    }

    /// Returns roughly how long the unit takes on two CPU cores, seconds: its pixels, each rendered once to warm up, once to
    /// be timed, and once to count.
    pub fn seconds(&self) -> f64 {
        let pixels = |s: &Shot| s.size.map(f64::from).iter().product::<f64>() * f64::from(s.views);
        let rendered = self.sights.len() * self.places.len() * FRAMES;
        self.shots.iter().map(pixels).sum::<f64>() * rendered as f64 / PIXELS_A_SECOND
    }
}

/// Returns the name of a file of splats without its extension, and a hash of its contents.
pub fn identity(path: &Path) -> Result<(String, String)> {
    let bytes = std::fs::read(path).map_err(|e| engine::Error::io(path, "reading", &e))?;
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    Ok((name, bench::store::hash_bytes(&bytes)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_is_named_by_its_file_and_all_that_it_is_of() {
        let sight = Sight { transfer: "CT-Bone".into(), lit: true };
        let unit = |file: &str, device: &str| Unit {
            file: file.into(),
            contents: "0".into(),
            sights: vec![sight.clone()],
            places: vec![Place(1.0)],
            shots: Vec::new(),
            device: device.into(),
        };
        let [one, other] = ["a", "b"].map(|device| unit("bones-100k", device));
        assert!(one.key() != other.key() && one.key().starts_with("bones-100k-"));
        let shade = |lit| {
            let sight = Sight { lit, ..sight.clone() };
            sight.look([-1000.0, 2000.0]).expect("a look").transfer.material.shade
        };
        assert!(shade(true) && !shade(false));
    }
}
