//! Which frames are made: scenes, looks, cameras, and ways to render.

use std::path::Path;

use engine::render::{Camera, Classification, FOV_DEGREES, Look, Quality, Scene, Settings};
use engine::{Result, transfer};
use serde::{Deserialize, Serialize};

use bench::store::hash;

/// From eye to eye, mm.
const EYES_MM: f64 = 64.0;
/// From the head to the middle of the patient, mm, as `vgs-xr` places it; further where the patient is large.
const REACH_MM: f64 = 600.0;
/// Of a headset's eye from the upper to the lower edge, degrees: Quest 3's 96 (Meta, 2023), its pictures square or so.
const HEADSET_DEGREES: f64 = 96.0;

/// How a scene is seen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sight {
    /// Transfer function.
    pub transfer: String,
    /// Whether surfaces are lit, where the function says so.
    pub lit: bool,
    /// Whether the function is integrated from plane to plane.
    pub integrated: bool,
}

impl Sight {
    /// On the intensities of a scene.
    pub fn look(&self, range: [f64; 2]) -> Result<Look> {
        let mut function = transfer::load(&self.transfer, range)?;
        function.material.shade &= self.lit;
        Ok(Look::new(function))
    }
}

/// From where.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Place {
    /// From the left front, so that the scene fills the picture.
    Filling,
    /// In real size before a headset: this share of the distance that it begins at.
    Before(f64),
}

impl Place {
    /// One camera for each view.
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

    /// In a few words.
    pub fn name(self) -> String {
        match self {
            Place::Filling => "filling the picture".into(),
            Place::Before(1.0) => "as placed".into(),
            Place::Before(share) => format!("at {share} of the distance"),
        }
    }
}

/// A way to render.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Shot {
    /// Name of the mode.
    pub mode: String,
    /// Of the target, pixels.
    pub size: [u32; 2],
    /// Pictures at once.
    pub views: u32,
    /// Whether depth is kept.
    pub depth: bool,
    /// Part of the target's edges.
    pub resolution: f64,
    /// Distance of slabs, standard deviations.
    pub coarseness: f64,
}

impl Shot {
    /// All that a mode gives, without depth.
    pub fn whole(mode: &str, edge: u32, views: u32) -> Self {
        Shot { mode: mode.into(), size: [edge; 2], views, depth: false, resolution: 1.0, coarseness: 1.0 }
    }

    /// What is given up.
    pub fn quality(&self) -> Quality {
        Quality { resolution: self.resolution, coarseness: self.coarseness }
    }

    /// What its renderer is made for.
    pub fn settings(&self, sight: &Sight) -> Settings {
        let classification =
            if sight.integrated { Classification::PreIntegrated } else { Classification::Point };
        Settings {
            views: self.views,
            depth: self.depth,
            classification: Some(classification),
            ..Settings::new(self.size)
        }
    }
}

/// The frames of one file of splats.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Unit {
    /// Name of the file, without its ending.
    pub file: String,
    /// Of its bytes.
    pub contents: String,
    /// The most important splats that are kept; all where nothing is said.
    pub splats: Option<usize>,
    /// How it is seen.
    pub sights: Vec<Sight>,
    /// From where.
    pub places: Vec<Place>,
    /// How it is rendered, each through every sight from every place.
    pub shots: Vec<Shot>,
    /// Frames that are timed of each.
    pub frames: usize,
    /// Device and driver.
    pub device: String,
}

impl Unit {
    /// Name of its file of results.
    pub fn key(&self) -> String {
        format!("{}-{}", self.title().replace(|c: char| !c.is_ascii_alphanumeric(), "-"), hash(self))
    }

    /// For people.
    pub fn title(&self) -> String {
        self.splats.map_or_else(|| self.file.clone(), |n| format!("{}, {n} splats", self.file))
    }

    /// What is held out together: files whose names begin alike up to the last '-', as `bones-100k` and `bones-250k`, are fits of
    /// one case.
    pub fn case(&self) -> &str {
        self.file.rsplit_once('-').map_or(self.file.as_str(), |(case, _)| case)
    }

    /// About how long it takes, in units of its own: pixels that are rendered.
    pub fn cost(&self) -> f64 {
        let pixels = |s: &Shot| s.size.map(f64::from).iter().product::<f64>() * f64::from(s.views);
        self.shots.iter().map(pixels).sum::<f64>() * (self.sights.len() * self.places.len()) as f64
    }
}

/// The frames that rates are found from: both modes, edges of `sizes` pixels, one and two views, and slabs twice as thick.
pub fn shots(sizes: &[u32]) -> Vec<Shot> {
    let middle = sizes[sizes.len() / 2];
    let mut all = Vec::new();
    for mode in ["slab", "alpha"] {
        all.extend(sizes.iter().map(|&edge| Shot::whole(mode, edge, 1)));
        all.push(Shot::whole(mode, middle, 2));
    }
    all.push(Shot { coarseness: 2.0, ..Shot::whole("slab", middle, 1) });
    all
}

/// Each transfer function lit, and not lit; every other one of the latter integrated.
pub fn sights(transfers: &[String]) -> Vec<Sight> {
    let mut all = Vec::new();
    for (n, transfer) in transfers.iter().enumerate() {
        all.push(Sight { transfer: transfer.clone(), lit: true, integrated: false });
        all.push(Sight { transfer: transfer.clone(), lit: false, integrated: n % 2 == 1 });
    }
    all
}

/// Name of a file of splats without its ending, and what its contents are known by.
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
