//! Scene on the device, with the renderers and setups that it was rendered with last.

use std::cell::OnceCell;

use engine::Result;
use engine::gpu::{Gpu, Ticket};
use engine::render::{Camera, Look, ModeRow, Part, Quality, Renderer, Scene, Settings, Target};
use glam::DVec2;

use crate::screen::composer::Layer;

/// Number of renderers that are kept, so that a setup that comes back (after moving, after a flip) needs
/// nothing new.
const KEPT: usize = 6;

/// Setup with which a scene is rendered.
#[derive(Clone)]
pub struct RenderSetup {
    /// Render mode.
    pub mode: &'static ModeRow,
    /// Settings of the renderer.
    pub settings: Settings,
    /// Quality that the picture gives up.
    pub quality: Quality,
}

impl RenderSetup {
    /// Returns true if one renderer serves both setups.
    fn shares_renderer(&self, other: &Self) -> bool {
        self.mode.name == other.mode.name && self.settings == other.settings
    }
}

/// Scene and its pictures.
pub struct RenderedScene {
    gpu: Gpu,
    /// The scene.
    pub scene: Scene,
    /// Renderers by setup, the latest last.
    made: Vec<(RenderSetup, Picture)>,
}

/// Renderer of a setup with its last picture.
struct Picture {
    renderer: Renderer,
    /// Last picture, while the renderer fills another target part by part.
    shown: Option<Target>,
    /// Target that is filled next in this way.
    spare: Option<Target>,
    /// Mean depths of the picture, mm along the viewing direction; read when they are first asked for.
    depth: OnceCell<Vec<f32>>,
}

impl Picture {
    fn target(&self) -> &Target {
        self.shown.as_ref().unwrap_or(&self.renderer.target)
    }

    /// Takes the picture that the renderer has filled part by part for the last one.
    fn finish(&mut self) {
        self.spare = self.shown.take().or(self.spare.take());
        self.depth = OnceCell::new();
    }

    /// Gives up the picture that the renderer has begun to fill.
    fn give_up(&mut self) {
        if let Some(shown) = self.shown.take() {
            self.spare = Some(std::mem::replace(&mut self.renderer.target, shown));
        }
    }
}

impl RenderedScene {
    /// Creates a rendered scene without pictures.
    pub fn new(gpu: &Gpu, scene: Scene) -> Self {
        RenderedScene { gpu: gpu.clone(), scene, made: Vec::new() }
    }

    /// Changes the look of the scene.
    pub fn set_look(&mut self, look: &Look) -> Result<()> {
        self.scene.set_look(look)
    }

    /// Submits the rendering of a part of a picture with a setup, and does not wait. A whole picture takes the place of the
    /// last one at once, one in several parts when the last of them is submitted.
    pub fn submit(&mut self, setup: &RenderSetup, camera: Camera, part: Part) -> Result<Ticket> {
        let mut picture = match self.made.iter().position(|(made, _)| made.shares_renderer(setup)) {
            Some(at) => self.made.remove(at).1,
            None => {
                let renderer = Renderer::new(&self.gpu, setup.mode, &self.scene, &setup.settings)?;
                Picture { renderer, shown: None, spare: None, depth: OnceCell::new() }
            }
        };
        if part.is_first() {
            picture.give_up();
        }
        if part.is_first() && part != Part::WHOLE {
            let Settings { size, views, precise, depth, .. } = setup.settings;
            let target = match picture.spare.take() {
                Some(spare) => spare,
                None => Target::new(&self.gpu, size, views, precise, depth)?,
            };
            picture.shown = Some(std::mem::replace(&mut picture.renderer.target, target));
        }
        let ticket = picture.renderer.submit(&self.scene, &[camera], &setup.quality, part)?;
        if part.next(1).is_none() {
            picture.finish();
        }
        self.made.push((setup.clone(), picture));
        if self.made.len() > KEPT {
            self.made.remove(0);
        }
        Ok(ticket)
    }

    /// Returns true if the last picture of a setup, which has finished, has to be rendered again, with more room.
    pub fn settle(&mut self, setup: &RenderSetup) -> Result<bool> {
        let made = self.made.iter_mut().find(|(made, _)| made.shares_renderer(setup));
        made.map_or(Ok(false), |(_, picture)| picture.renderer.settle())
    }

    /// Creates what the next changes of the transfer function may ask for, so that they need not wait for it.
    pub fn warm_up(&mut self) -> Result<()> {
        let scene = &self.scene;
        self.made.iter_mut().try_for_each(|(_, picture)| picture.renderer.warm_up(scene))
    }

    /// Gives up the pictures that are not complete.
    pub fn give_up(&mut self) {
        self.made.iter_mut().for_each(|(_, picture)| picture.give_up());
    }

    /// Renders with a setup, waits, and returns the picture, premultiplied colours in rows from the top.
    pub fn picture_of(&mut self, setup: &RenderSetup, camera: Camera) -> Result<Vec<[f32; 4]>> {
        loop {
            let ticket = self.submit(setup, camera, Part::WHOLE)?;
            self.gpu.wait(ticket)?;
            if !self.settle(setup)? {
                break;
            }
        }
        self.picture(setup).map_or_else(|| Ok(Vec::new()), |picture| picture.target().read_colour(0))
    }

    fn picture(&self, setup: &RenderSetup) -> Option<&Picture> {
        self.made.iter().find(|(made, _)| made.shares_renderer(setup)).map(|(_, picture)| picture)
    }

    /// Returns the last picture of a setup.
    pub fn layer(&self, setup: &RenderSetup) -> Option<Layer<'_>> {
        let target = self.picture(setup)?.target();
        let (part, whole) = (setup.quality.size(target.size()), target.size());
        let part = std::array::from_fn(|axis| part[axis] as f32 / whole[axis] as f32);
        Some(Layer { picture: &target.colour, layer: 0, part })
    }

    /// Returns the mean depth at a place of the last picture of a setup (fractions from the upper left
    /// corner), mm along the viewing direction; `None` if nothing is seen there or depth was not kept.
    pub fn depth_at(&self, setup: &RenderSetup, place: DVec2) -> Option<f64> {
        let picture = self.picture(setup)?;
        let depth = match picture.depth.get() {
            Some(depth) => depth,
            None => {
                let read = picture.target().read_depth(0).ok()?;
                picture.depth.get_or_init(|| read)
            }
        };
        let [width, height] = setup.quality.size(setup.settings.size);
        let inside = place.cmpge(DVec2::ZERO).all() && place.cmplt(DVec2::ONE).all();
        let [x, y] = [(place.x * f64::from(width)) as usize, (place.y * f64::from(height)) as usize];
        let mm = inside.then(|| depth.get(y * setup.settings.size[0] as usize + x)).flatten()?;
        mm.is_finite().then(|| f64::from(*mm))
    }

    /// Drops all renderers, as when the scene has changed.
    pub fn forget(&mut self) {
        self.made.clear();
    }
}
