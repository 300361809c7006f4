//! What is shown, on the device: the scene, and renderers for the ways it was rendered last.

use std::cell::OnceCell;
use std::time::Instant;

use engine::Result;
use engine::gpu::Gpu;
use engine::render::{Camera, Look, ModeRow, Quality, Renderer, Scene, Settings};
use glam::DVec2;

use crate::composer::Layer;

/// Renderers that are kept, so that a way that comes back (after moving, after a flip) needs nothing made anew.
const KEPT: usize = 6;

/// A way to render.
#[derive(Clone)]
pub struct Way {
    /// The mode.
    pub mode: &'static ModeRow,
    /// What it is made for.
    pub settings: Settings,
    /// What is given up.
    pub quality: Quality,
}

impl Way {
    /// Whether what renders in one way can render in the other.
    fn shares_renderer(&self, other: &Self) -> bool {
        self.mode.name == other.mode.name && self.settings == other.settings
    }
}

/// A scene and the pictures of it.
pub struct Stage {
    gpu: Gpu,
    /// What is seen.
    pub scene: Scene,
    /// The latest last.
    made: Vec<(Way, Picture)>,
}

/// What was rendered in a way.
struct Picture {
    renderer: Renderer,
    /// Mean depths of the picture, mm along the viewing direction; read when somebody asks.
    depth: OnceCell<Vec<f32>>,
}

impl Stage {
    /// Shows a scene.
    pub fn new(gpu: &Gpu, scene: Scene) -> Self {
        Stage { gpu: gpu.clone(), scene, made: Vec::new() }
    }

    /// Changes how the scene is seen.
    pub fn set_look(&mut self, look: &Look) -> Result<()> {
        self.scene.set_look(look)
    }

    /// Renders in a way, and waits. Gives what it took, ms.
    pub fn render(&mut self, way: &Way, camera: Camera) -> Result<f64> {
        let mut picture = match self.made.iter().position(|(made, _)| made.shares_renderer(way)) {
            Some(at) => self.made.remove(at).1,
            None => {
                let renderer = Renderer::new(&self.gpu, way.mode, &self.scene, &way.settings)?;
                Picture { renderer, depth: OnceCell::new() }
            }
        };
        let start = Instant::now();
        picture.renderer.render_at(&self.scene, &[camera], &way.quality)?;
        let ms = start.elapsed().as_secs_f64() * 1e3;
        picture.depth = OnceCell::new();
        self.made.push((way.clone(), picture));
        if self.made.len() > KEPT {
            self.made.remove(0);
        }
        Ok(ms)
    }

    fn picture(&self, way: &Way) -> Option<&Picture> {
        self.made.iter().find(|(made, _)| made.shares_renderer(way)).map(|(_, picture)| picture)
    }

    /// What was rendered last in a way.
    pub fn layer(&self, way: &Way) -> Option<Layer<'_>> {
        let target = &self.picture(way)?.renderer.target;
        let (part, whole) = (way.quality.size(target.size()), target.size());
        let part = std::array::from_fn(|axis| part[axis] as f32 / whole[axis] as f32);
        Some(Layer { picture: &target.colour, layer: 0, part })
    }

    /// Mean depth at a place of what was rendered last in a way (fractions from the upper left corner), mm along the
    /// viewing direction; nothing where nothing is seen or depth was not kept.
    pub fn depth_at(&self, way: &Way, place: DVec2) -> Option<f64> {
        let picture = self.picture(way)?;
        let depth = match picture.depth.get() {
            Some(depth) => depth,
            None => {
                let read = picture.renderer.target.read_depth(0).ok()?;
                picture.depth.get_or_init(|| read)
            }
        };
        let [width, height] = way.quality.size(way.settings.size);
        let inside = place.cmpge(DVec2::ZERO).all() && place.cmplt(DVec2::ONE).all();
        let [x, y] = [(place.x * f64::from(width)) as usize, (place.y * f64::from(height)) as usize];
        let mm = inside.then(|| depth.get(y * way.settings.size[0] as usize + x)).flatten()?;
        mm.is_finite().then(|| f64::from(*mm))
    }

    /// Forgets all renderers, as when the scene has changed.
    pub fn forget(&mut self) {
        self.made.clear();
    }
}
