//! Scene on the device, with the renderers and setups that it was rendered with last.

use std::cell::OnceCell;
use std::time::Instant;

use engine::Result;
use engine::gpu::Gpu;
use engine::render::{Camera, Look, ModeRow, Quality, Renderer, Scene, Settings};
use glam::DVec2;

use crate::composer::Layer;

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
    /// Mean depths of the picture, mm along the viewing direction; read when they are first asked for.
    depth: OnceCell<Vec<f32>>,
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

    /// Renders with a setup and waits. Returns the time that it took, ms.
    pub fn render(&mut self, setup: &RenderSetup, camera: Camera) -> Result<f64> {
        let mut picture = match self.made.iter().position(|(made, _)| made.shares_renderer(setup)) {
            Some(at) => self.made.remove(at).1,
            None => {
                let renderer = Renderer::new(&self.gpu, setup.mode, &self.scene, &setup.settings)?;
                Picture { renderer, depth: OnceCell::new() }
            }
        };
        let start = Instant::now();
        picture.renderer.render_at(&self.scene, &[camera], &setup.quality)?;
        let ms = start.elapsed().as_secs_f64() * 1e3;
        picture.depth = OnceCell::new();
        self.made.push((setup.clone(), picture));
        if self.made.len() > KEPT {
            self.made.remove(0);
        }
        Ok(ms)
    }

    /// Renders with a setup and returns the picture, premultiplied colours in rows from the top.
    pub fn picture_of(&mut self, setup: &RenderSetup, camera: Camera) -> Result<Vec<[f32; 4]>> {
        self.render(setup, camera)?;
        self.picture(setup).map_or_else(|| Ok(Vec::new()), |picture| picture.renderer.target.read_colour(0))
    }

    fn picture(&self, setup: &RenderSetup) -> Option<&Picture> {
        self.made.iter().find(|(made, _)| made.shares_renderer(setup)).map(|(_, picture)| picture)
    }

    /// Returns the last picture of a setup.
    pub fn layer(&self, setup: &RenderSetup) -> Option<Layer<'_>> {
        let target = &self.picture(setup)?.renderer.target;
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
                let read = picture.renderer.target.read_depth(0).ok()?;
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
