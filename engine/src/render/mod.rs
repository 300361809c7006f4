//! Rendering: a scene of splats or of a volume, seen through a transfer function.
//!
//! A [`Scene`] holds splats, a volume or both, in one space: world mm RAS less the scene's origin. A [`Look`] says what is
//! seen of it and may change at any time. A [`Mode`] turns it into pictures; [`MODES`] lists them. All modes see the same
//! medium, of opacity O(x) α(V(x)) per mm and colour C(V(x)), by emission and absorption (Max 1995), use the
//! same light, and give the same depth; they differ in what stands for V and O and in how the integral is taken.
//!
//! Colours are display-referred: numbers of an sRGB picture, added up as they are, as VTK and Slicer do.

mod alpha;
mod blind;
mod camera;
mod centres;
mod cloud;
mod decoded;
mod frames;
mod ladder;
mod least_squares;
mod look;
mod medium;
mod raymarch;
mod slab;
mod target;
mod variants;

pub use blind::{Blind, Triangle};
pub use camera::{Camera, CameraFile, FOV_DEGREES, Fov};
pub use cloud::{Cloud, Precision};
pub use decoded::{Decoded, decode};
pub use frames::{Finished, Frame, Frames, IN_FLIGHT};
pub use ladder::{Quality, Rung, SplatKind, ladder, rungs};
pub use look::{Appearance, Classification, ClipPlane, Look, LookBuffers, PLANES};
pub use medium::{Medium, MediumSource};
pub use target::Target;

pub use crate::passes::Work;
use variants::Variants;

use glam::DVec3;

use crate::error::{Error, Kind, Result};
use crate::gpu::{Gpu, Recorder};
use crate::passes::Views;
use crate::splat::{Object, SplatSet};

/// What is rendered, on the device.
pub struct Scene {
    gpu: Gpu,
    /// Zero of the scene's space in the world, mm RAS.
    pub origin: DVec3,
    /// The splats, if there are any.
    pub cloud: Option<Cloud>,
    /// The volume, if there is one.
    pub medium: Option<Medium>,
    look: Look,
    buffers: LookBuffers,
}

impl Scene {
    /// Of splats, of a volume, or of both, at first seen as `look` says.
    pub fn new(
        gpu: &Gpu,
        splats: Option<&SplatSet>,
        volume: Option<&MediumSource<'_>>,
        look: &Look,
    ) -> Result<Self> {
        Self::with_precision(gpu, splats, volume, look, Precision::Full)
    }

    /// The same with splats kept in a precision of the caller's choice.
    pub fn with_precision(
        gpu: &Gpu,
        splats: Option<&SplatSet>,
        volume: Option<&MediumSource<'_>>,
        look: &Look,
        precision: Precision,
    ) -> Result<Self> {
        let origin = match (splats, volume) {
            (Some(set), _) => set.origin_mm,
            (None, Some(source)) => source.centre(),
            (None, None) => {
                return Err(Error::new(Kind::NothingToDo, "VGS-RENDER-001", "a scene of nothing")
                    .help("give splats, a volume, or both"));
            }
        };
        let cloud = splats.map(|set| Cloud::new(gpu, set, precision)).transpose()?;
        let medium = volume.map(|source| Medium::new(gpu, source, origin)).transpose()?;
        let range = range_of(cloud.as_ref(), medium.as_ref());
        let buffers = LookBuffers::new(gpu, look, range, origin)?;
        let mut scene = Scene { gpu: gpu.clone(), origin, cloud, medium, look: look.clone(), buffers };
        scene.list_active()?;
        Ok(scene)
    }

    /// Changes how the scene is seen. Nothing that is in flight is disturbed.
    pub fn set_look(&mut self, look: &Look) -> Result<()> {
        let range = range_of(self.cloud.as_ref(), self.medium.as_ref());
        self.buffers = LookBuffers::new(&self.gpu, look, range, self.origin)?;
        self.look = look.clone();
        self.list_active()
    }

    /// Renders at most so many splats from now on: of those that the look can show the most important ones, by opacity
    /// times volume. For viewers that trade splats for time; the first budget takes as long as sorting all splats.
    pub fn set_splat_budget(&mut self, budget: Option<usize>) -> Result<()> {
        if let Some(cloud) = &mut self.cloud {
            cloud.set_budget(&self.gpu, budget)?;
        }
        self.list_active()
    }

    /// Lists splats from now on that no look can show any of, as well: to see what leaving them out saves.
    pub fn list_all(&mut self) -> Result<()> {
        if let Some(cloud) = &mut self.cloud {
            cloud.list_all(&self.gpu)?;
        }
        self.list_active()
    }

    /// How the scene is seen.
    pub fn look(&self) -> &Look {
        &self.look
    }

    /// The splats, for a mode of splats: a renderer makes one only where there are some.
    fn splats(&self) -> &Cloud {
        self.cloud.as_ref().expect("a scene with splats")
    }

    /// The volume, for a mode of volumes: a renderer makes one only where there is one.
    fn volume(&self) -> &Medium {
        self.medium.as_ref().expect("a scene with a volume")
    }

    /// What of the scene a look can show, hide and colour apart, by ascending number; nothing where there are no splats.
    pub fn objects(&self) -> &[Object] {
        self.cloud.as_ref().map_or(&[], |cloud| &cloud.objects)
    }

    pub(crate) fn look_buffers(&self) -> &LookBuffers {
        &self.buffers
    }

    /// Corners of the box around all there is, mm RAS.
    pub fn bounds(&self) -> [DVec3; 2] {
        let cloud = self.cloud.as_ref().map(|c| c.bounds);
        let medium = self.medium.as_ref().map(|m| m.bounds);
        let [low, high] = match (cloud, medium) {
            (Some(a), Some(b)) => [a[0].min(b[0]), a[1].max(b[1])],
            (a, b) => a.or(b).unwrap_or_default(),
        };
        [low + self.origin, high + self.origin]
    }

    fn list_active(&mut self) -> Result<()> {
        let mut recorder = self.gpu.record()?;
        if let Some(cloud) = &mut self.cloud {
            cloud.record_activity(&mut recorder, &self.buffers);
        }
        recorder.submit()?;
        Ok(())
    }
}

/// Least and greatest intensity of all there is.
fn range_of(cloud: Option<&Cloud>, medium: Option<&Medium>) -> [f64; 2] {
    match (cloud.map(|c| c.range), medium.map(|m| m.range)) {
        (Some(a), Some(b)) => [a[0].min(b[0]), a[1].max(b[1])],
        (a, b) => a.or(b).unwrap_or([0.0, 1.0]),
    }
}

/// What a mode is made for; to change one of these is to make the mode anew.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Width and height of the pictures, pixels.
    pub size: [u32; 2],
    /// Views that are rendered at once: 1, or 2 or 4 for a headset.
    pub views: u32,
    /// Whether colour is kept in floats rather than in halves.
    pub precise: bool,
    /// Whether depth is kept.
    pub depth: bool,
    /// Whether it is said what of the pictures no eye sees ([`Blind`]), which modes of splats then leave transparent.
    pub blind: bool,
    /// Distance of the slabs in units of [`Cloud::sigma_mm`]; of the samples of a volume or a decoded field in units of the
    /// shortest edge of its voxels. A volume takes 1 where speed counts, 0.5 where looks do, and 0.25 where others are measured against it.
    pub step: f64,
    /// Distance of the voxels that splats are decoded to in mode decoded, in voxels of the grid that they were fitted on.
    pub pitch: f64,
    /// Whether the samples of a volume begin at a random part of a step in each pixel, which turns the rings of a coarse
    /// step into noise. Not where pictures are measured.
    pub jitter: bool,
    /// How the transfer function is applied; by the look's own choice where nothing is said.
    pub classification: Option<Classification>,
    /// Rays end where less light than this would pass.
    pub dark: f32,
    /// Whether pictures show the work of each pixel instead of its colour, for benchmarks, with `precise`. In mode slab its
    /// channels are, alike for the 4 × 8 pixels of a part of a tile: planes at which splats were evaluated, summed over the
    /// splats; the same over all splats of the tile's lists, which is what a group as wide as a tile goes through; planes
    /// classified; pairs looked at. In mode alpha: fragments, and those of them that were blended.
    pub counting: bool,
}

impl Settings {
    /// One view of this size, at full quality.
    pub fn new(size: [u32; 2]) -> Self {
        Settings {
            size,
            views: 1,
            precise: false,
            depth: false,
            blind: false,
            step: 1.0,
            pitch: 1.0,
            jitter: false,
            classification: None,
            dark: 1.0 / 512.0,
            counting: false,
        }
    }
}

impl Settings {
    /// How a scene is classified, and whether it is lit: what kernels are made for.
    fn variant(&self, scene: &Scene) -> (Classification, bool) {
        let classification = self.classification.unwrap_or_else(|| scene.look().classification());
        (classification, scene.look_buffers().shaded)
    }
}

/// A way to render a scene.
pub trait Mode {
    /// Records the rendering of `views`, one for each layer of the target. The part of the target that the quality takes is
    /// overwritten.
    fn record(
        &mut self,
        recorder: &mut Recorder,
        scene: &Scene,
        views: &Views,
        target: &mut Target,
        quality: &Quality,
    ) -> Result<()>;

    /// Looks at what a frame that has finished needed, and makes room where that was more than there was. Whether the
    /// frame must be rendered again.
    fn settle(&mut self) -> Result<bool> {
        Ok(false)
    }

    /// What the last frame was made of; all 0 for a mode without splats. Waits for the device.
    fn work(&self) -> Result<Work> {
        Ok(Work::default())
    }
}

/// A row of [`MODES`].
pub struct ModeRow {
    /// Name on the command line and in tables.
    pub name: &'static str,
    /// What it is, in a line.
    pub about: &'static str,
    /// Whether it renders splats rather than the volume.
    pub of_splats: bool,
    make: fn(&Gpu, &Scene, &Settings) -> Result<Box<dyn Mode>>,
}

impl ModeRow {
    /// Fails where the scene has not what the mode renders.
    fn make(&self, gpu: &Gpu, scene: &Scene, settings: &Settings) -> Result<Box<dyn Mode>> {
        let there = if self.of_splats { scene.cloud.is_some() } else { scene.medium.is_some() };
        if !there {
            let needed = if self.of_splats { "splats" } else { "a volume" };
            return Err(Error::new(
                Kind::Usage,
                "VGS-RENDER-003",
                format!("mode {} needs {needed}, and the scene has none", self.name),
            )
            .help("choose another --mode, or give what is missing"));
        }
        (self.make)(gpu, scene, settings)
    }
}

/// The modes, from the most accurate to the fastest.
pub static MODES: [ModeRow; 5] = [
    ModeRow {
        name: "volume",
        about: "the CT itself, ray-marched with trilinear sampling: the reference",
        of_splats: false,
        make: |gpu, scene, settings| Ok(Box::new(raymarch::Raymarch::new(gpu, scene, settings)?)),
    },
    ModeRow {
        name: "exact",
        about: "the splats' field in steps of a tenth of a standard deviation",
        of_splats: true,
        make: |gpu, scene, settings| Ok(Box::new(slab::Slab::exact(gpu, scene, settings)?)),
    },
    ModeRow {
        name: "slab",
        about: "the splats' field in slabs, classified after it is added up",
        of_splats: true,
        make: |gpu, scene, settings| Ok(Box::new(slab::Slab::new(gpu, scene, settings)?)),
    },
    ModeRow {
        name: "decoded",
        about: "the splats' field on the CT's own voxels, put there once, and ray-marched as those",
        of_splats: true,
        make: |gpu, scene, settings| Ok(Box::new(raymarch::Raymarch::decoded(gpu, scene, settings)?)),
    },
    ModeRow {
        name: "alpha",
        about: "sorted splats, each of one colour, blended: the fastest",
        of_splats: true,
        make: |gpu, scene, settings| Ok(Box::new(alpha::Alpha::new(gpu, scene, settings)?)),
    },
];

/// The row of a mode.
pub fn mode(name: &str) -> Result<&'static ModeRow> {
    MODES.iter().find(|m| m.name == name).ok_or_else(|| {
        let names: Vec<_> = MODES.iter().map(|m| m.name).collect();
        Error::new(Kind::Usage, "VGS-RENDER-002", format!("there is no mode {name:?}"))
            .help(format!("modes are {}", names.join(", ")))
    })
}

/// A mode with its target and its views: what renders a scene offscreen.
pub struct Renderer {
    gpu: Gpu,
    mode: Box<dyn Mode>,
    views: Views,
    /// What is blind of the pictures; nothing where the settings do not ask for it.
    blind: Vec<Blind>,
    /// What was rendered last.
    pub target: Target,
}

impl Renderer {
    /// Fails where the scene has not what the mode renders.
    pub fn new(gpu: &Gpu, mode: &ModeRow, scene: &Scene, settings: &Settings) -> Result<Self> {
        Ok(Renderer {
            gpu: gpu.clone(),
            mode: mode.make(gpu, scene, settings)?,
            views: Views::new(gpu, "views", settings.views, settings.blind)?,
            blind: vec![Blind::default(); if settings.blind { settings.views as usize } else { 0 }],
            target: Target::new(gpu, settings.size, settings.views, settings.precise, settings.depth)?,
        })
    }

    /// Says what is blind of the pictures from now on.
    ///
    /// # Panics
    /// If the settings did not ask for it, or had another number of views.
    pub fn set_blind(&mut self, blind: &[Blind]) {
        self.blind.clone_from_slice(blind);
    }

    /// Renders one picture for each camera and waits for them.
    ///
    /// # Panics
    /// If there are not as many cameras as the settings had views.
    pub fn render(&mut self, scene: &Scene, cameras: &[Camera]) -> Result<()> {
        self.render_at(scene, cameras, &Quality::FULL)
    }

    /// As [`Self::render`], with something given up: the pictures lie in the upper left corner of the target, as large as
    /// [`Quality::size`] says.
    ///
    /// # Panics
    /// If there are not as many cameras as the settings had views.
    pub fn render_at(&mut self, scene: &Scene, cameras: &[Camera], quality: &Quality) -> Result<()> {
        let rows = cameras.iter().map(|camera| camera.view(scene.origin));
        self.views.write(rows, self.blind.iter().map(|blind| blind.words))?;
        loop {
            let mut recorder = self.gpu.record()?;
            self.mode.record(&mut recorder, scene, &self.views, &mut self.target, quality)?;
            let ticket = recorder.submit()?;
            self.gpu.wait(ticket)?;
            if !self.mode.settle()? {
                return Ok(());
            }
        }
    }

    /// What the last frame was made of; all 0 for a mode without splats.
    pub fn work(&self) -> Result<Work> {
        self.mode.work()
    }
}
