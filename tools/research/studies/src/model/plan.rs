//! Plan of the frames that are rendered: scenes, looks, cameras and ways to render.

use std::path::Path;

use engine::render::{Camera, Classification, FOV_DEGREES, Look, Quality, Rays, Scene, Settings};
use engine::{Result, transfer};
use serde::{Deserialize, Serialize};

use bench::store::hash;

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
    /// True if the transfer function is integrated from plane to plane.
    pub integrated: bool,
}

impl Sight {
    /// Returns the look for a scene whose intensities span `range`.
    pub fn look(&self, range: [f64; 2]) -> Result<Look> {
        let mut function = transfer::load(&self.transfer, range)?;
        function.material.shade &= self.lit;
        Ok(Look::new(function))
    }
}

/// Position of the viewer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Place {
    /// View from the left front, in which the scene fills the picture.
    Filling,
    /// View in real size through a headset, at this share of the distance that it begins at.
    Before(f64),
}

impl Place {
    /// Returns one camera, or one for each eye if there are two `views`, for pictures of `size` pixels.
    pub fn cameras(self, scene: &Scene, size: [u32; 2], views: u32) -> Result<Vec<Camera>> {
        let [low, high] = scene.bounds();
        let (centre, radius) = ((low + high) * 0.5, (high - low).length() * 0.5);
        let aspect = f64::from(size[0]) / f64::from(size[1]);
        let head = match self {
            Place::Filling => Camera::from_side("anterior-left", centre, radius, FOV_DEGREES, aspect)?,
            Place::Before(share) => {
                let camera = Camera::from_side("anterior", centre, radius, HEADSET_DEGREES, aspect)?;
                let distance = share * REACH_MM.max(1.5 * radius);
                Camera { eye: centre - camera.forward() * distance, ..camera }
            }
        };
        Ok(if views > 1 { head.eyes(EYES_MM).into() } else { vec![head] })
    }

    /// Describes the place in a few words.
    pub fn name(self) -> String {
        match self {
            Place::Filling => "filling the picture".into(),
            Place::Before(1.0) => "as placed".into(),
            Place::Before(share) => format!("at {share} of the distance"),
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
    /// Creates a shot of square pictures of `edge` pixels in the full quality of a mode, without depth.
    pub fn whole(mode: &str, edge: u32, views: u32) -> Self {
        Shot { mode: mode.into(), size: [edge; 2], views, depth: false, resolution: 1.0, coarseness: 1.0 }
    }

    /// Returns the quality of the pictures.
    pub fn quality(&self) -> Quality {
        Quality { resolution: self.resolution, coarseness: self.coarseness, ..Quality::FULL }
    }

    /// Returns the settings of a renderer for this shot and `sight`.
    pub fn settings(&self, sight: &Sight) -> Settings {
        let classification =
            if sight.integrated { Classification::PreIntegrated } else { Classification::Point };
        Settings {
            views: self.views,
            depth: self.depth,
            classification: Some(classification),
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
    /// Number of the most important splats that are kept; `None` keeps all.
    pub splats: Option<usize>,
    /// Ways in which it is seen.
    pub sights: Vec<Sight>,
    /// Positions of the viewer.
    pub places: Vec<Place>,
    /// Ways in which it is rendered, each with every sight from every place.
    pub shots: Vec<Shot>,
    /// Number of times that each frame is timed.
    pub frames: usize,
    /// Name, kind and driver of the device.
    pub device: String,
}

impl Unit {
    /// Returns the name of its file of results, without the extension.
    pub fn key(&self) -> String {
        format!("{}-{}", self.title().replace(|c: char| !c.is_ascii_alphanumeric(), "-"), hash(self))
    }

    /// Returns a title for people.
    pub fn title(&self) -> String {
        self.splats.map_or_else(|| self.file.clone(), |n| format!("{}, {n} splats", self.file))
    }

    /// Returns the case, all fits of which are held out together: the name of the file up to the last '-', so
    /// that `bones-100k` and `bones-250k` are fits of one case.
    pub fn case(&self) -> &str {
        self.file.rsplit_once('-').map_or(self.file.as_str(), |(case, _)| case)
    }

    /// Returns roughly how long the unit takes on two CPU cores, seconds: its pixels, each rendered once to
    /// warm up, `frames` times to be timed, and once to count.
    pub fn seconds(&self) -> f64 {
        let pixels = |s: &Shot| s.size.map(f64::from).iter().product::<f64>() * f64::from(s.views);
        let rendered = self.sights.len() * self.places.len() * (self.frames + 2);
        self.shots.iter().map(pixels).sum::<f64>() * rendered as f64 / PIXELS_A_SECOND
    }
}

/// Returns the shots that rates are found from: all modes, edges of `sizes` pixels, one and two views, and
/// slabs twice as thick.
///
/// # Panics
/// Panics if `sizes` is empty.
pub fn shots(sizes: &[u32]) -> Vec<Shot> {
    let middle = sizes[sizes.len() / 2];
    let mut all = Vec::new();
    for mode in ["slab", "alpha", "decoded"] {
        all.extend(sizes.iter().map(|&edge| Shot::whole(mode, edge, 1)));
        all.push(Shot::whole(mode, middle, 2));
    }
    all.push(Shot { coarseness: 2.0, ..Shot::whole("slab", middle, 1) });
    all
}

/// Returns each transfer function lit, and not lit; every second one of the latter is integrated.
pub fn sights(transfers: &[String]) -> Vec<Sight> {
    let mut all = Vec::new();
    for (n, transfer) in transfers.iter().enumerate() {
        all.push(Sight { transfer: transfer.clone(), lit: true, integrated: false });
        all.push(Sight { transfer: transfer.clone(), lit: false, integrated: n % 2 == 1 });
    }
    all
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

    fn unit(file: &str, splats: Option<usize>) -> Unit {
        Unit {
            file: file.into(),
            contents: "0".into(),
            splats,
            sights: sights(&["CT-Bone".into(), "CT-Skin".into()]),
            places: vec![Place::Filling, Place::Before(1.0)],
            shots: shots(&[64, 128, 256]),
            frames: 3,
            device: "none".into(),
        }
    }

    #[test]
    fn fits_of_one_case_are_held_out_together() {
        for (file, case) in [("bones-100k", "bones"), ("left-knee-1000k", "left-knee"), ("skull", "skull")] {
            assert_eq!(unit(file, None).case(), case);
        }
        let [all, some] = [None, Some(30_000)].map(|n| unit("bones-100k", n));
        assert!(all.key() != some.key() && some.key().starts_with("bones-100k--30000-splats"));
        assert_eq!(some.title(), "bones-100k, 30000 splats");
    }

    #[test]
    fn every_term_of_a_frame_is_turned() {
        let unit = unit("bones-100k", None);
        let any = |shot: &dyn Fn(&Shot) -> bool| unit.shots.iter().any(shot);
        assert!(any(&|s| s.views == 2 && s.mode == "slab") && any(&|s| s.coarseness > 1.0));
        assert!(any(&|s| s.views == 2 && s.mode == "alpha") && any(&|s| s.size == [256; 2]));
        let sight = |lit: bool, integrated: bool| {
            unit.sights.iter().any(|s| s.lit == lit && s.integrated == integrated)
        };
        assert!(sight(true, false) && sight(false, false) && sight(false, true));
        assert!(!unit.sights[1].look([-1000.0, 2000.0]).expect("a look").transfer.material.shade);
        assert!(unit.sights[0].look([-1000.0, 2000.0]).expect("a look").transfer.material.shade);
    }
}
