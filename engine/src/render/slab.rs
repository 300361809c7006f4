//! Slabs: the splats' field added up at planes across the view, classified after that. With planes a tenth as
//! far apart the same is the oracle of the other modes, `exact`.

use glam::DVec3;
use shaders_glsl as glsl;
use shaders_glsl::tiles::{PARTS, PLANES, TILE};
use shaders_glsl::types::{SlabParams, TileGrid};

use super::gpu_splats::GpuSplats;
use super::look::Classification;
use super::mode::Mode;
use super::quality::Quality;
use super::scene::Scene;
use super::settings::Settings;
use super::target::Target;
use super::variants::Variants;
use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Kernel, Recorder};
use crate::passes::{TileBinner, Views, Work, WorkgroupShape};

/// Planes of `exact` for one of `slab`.
const EXACT: u32 = 10;
/// Most blocks along the depth: slabs become thicker beyond that.
const MOST_BLOCKS: u32 = 512;

/// The mode `slab`, and with a refinement `exact`.
pub struct Slab {
    gpu: Gpu,
    /// For each way to classify, with or without light and appearances of objects, made when it is first
    /// needed.
    kernels: Variants<(Classification, bool, bool)>,
    bins: TileBinner,
    /// Splats of the frame that the look can show.
    count: Buffer<u32>,
    settings: Settings,
    /// Planes for one of `slab`.
    refinement: u32,
}

impl Slab {
    /// Slabs of `settings.step` standard deviations.
    pub fn new(gpu: &Gpu, scene: &Scene, settings: &Settings) -> Result<Self> {
        Self::with_refinement(gpu, scene, settings, false)
    }

    /// Planes a tenth of a standard deviation apart, whatever the settings say, each classified at a point.
    pub fn exact(gpu: &Gpu, scene: &Scene, settings: &Settings) -> Result<Self> {
        let settings = Settings {
            step: 1.0,
            classification: Some(Classification::Point),
            dark: settings.dark.min(1e-4),
            ..settings.clone()
        };
        Self::with_refinement(gpu, scene, &settings, true)
    }

    fn with_refinement(gpu: &Gpu, scene: &Scene, settings: &Settings, exact: bool) -> Result<Self> {
        let splats = scene.expect_splats();
        let refinement = if exact { EXACT } else { 1 };
        let grid = tile_grid(splats, settings, &Quality::FULL, refinement);
        Ok(Slab {
            gpu: gpu.clone(),
            kernels: Variants::new(),
            bins: TileBinner::new(
                gpu,
                splats.field.kernel,
                splats.rows().packed,
                &grid,
                settings.views,
                splats.count,
                settings.masked,
            )?,
            count: gpu.buffer("splats of the frame", "views", 1)?,
            settings: settings.clone(),
            refinement,
        })
    }

    /// Returns the kernel for a way to classify, made if it is not there yet.
    fn kernel(&mut self, scene: &Scene) -> Result<usize> {
        let (gpu, settings) = (&self.gpu, &self.settings);
        let (classification, shaded) = settings.variant(scene);
        let objects = scene.look_buffers().objects_differ;
        self.kernels.find((classification, shaded, objects), |(classification, shaded, objects)| {
            let constants = [
                scene.expect_splats().field.kernel.id(),
                WorkgroupShape::of(gpu) as u32,
                u32::from(*classification == Classification::PreIntegrated),
                u32::from(*shaded),
                u32::from(settings.depth),
                u32::from(*objects),
                u32::from(settings.masked),
                u32::from(settings.counting),
            ];
            Kernel::new(gpu, &glsl::SLAB, &constants)
        })
    }
}

/// Tiles for the picture, blocks for a ball around all splats.
fn tile_grid(splats: &GpuSplats, settings: &Settings, quality: &Quality, refinement: u32) -> TileGrid {
    let [low, high] = splats.bounds;
    let centre: DVec3 = (low + high) * 0.5;
    let radius = (high - low).length() * 0.5;
    let slab = settings.step * quality.coarseness * splats.sigma_mm;
    let blocks = (2.0 * radius / (slab * f64::from(PLANES))).ceil().clamp(1.0, f64::from(MOST_BLOCKS));
    let spacing = slab.max(2.0 * radius / (blocks * f64::from(PLANES)));
    let size = quality.size(settings.size);
    TileGrid {
        size,
        tiles: size.map(|n| n.div_ceil(TILE)),
        centre: centre.as_vec3().to_array(),
        radius: radius as f32,
        spacing: (spacing / f64::from(refinement)) as f32,
        planes: PLANES * refinement,
        blocks: blocks as u32,
        splat_count: splats.count as u32,
        capacity: 0,
    }
}

impl Mode for Slab {
    fn record(
        &mut self,
        recorder: &mut Recorder,
        scene: &Scene,
        views: &Views,
        target: &mut Target,
        quality: &Quality,
    ) -> Result<()> {
        let kernel = self.kernel(scene)?;
        let (splats, look) = (scene.expect_splats(), scene.look_buffers());
        let grid = TileGrid {
            capacity: self.bins.capacity() as u32,
            ..tile_grid(splats, &self.settings, quality, self.refinement)
        };
        let field = splats.field;
        splats.count_active(recorder, &mut self.count);
        let active = (splats.active(), &self.count);
        self.bins.record(recorder, &grid, field.background, views, splats.rows(), active);
        let columns = match WorkgroupShape::of(&self.gpu) {
            WorkgroupShape::OneByOne => grid.tiles[0] * PARTS,
            WorkgroupShape::SideBySide => grid.tiles[0],
        };
        recorder
            .pass(&self.kernels[kernel])
            .read("views", &views.rows)
            .read("look_rows", &look.rows)
            .read("look_points", &look.points)
            .read("look_integrals", &look.integrals)
            .read("starts", self.bins.starts())
            .read("pairs", self.bins.pairs())
            .read("projected", &self.bins.projected)
            .write_image("colour_image", &mut target.colour)
            .write_image("depth_image", &mut target.depth)
            .read("active_objects", splats.active_objects())
            .read("appearances", &look.appearances)
            .read("blind_parts", &self.bins.blind_parts)
            .push(&SlabParams {
                grid,
                background: field.background,
                epsilon: field.epsilon,
                occupancy_w0: field.occupancy_w0,
                dark: self.settings.dark,
            })
            .dispatch_3d([columns, grid.tiles[1], self.settings.views]);
        Ok(())
    }

    fn settle(&mut self) -> Result<bool> {
        let needed = self.bins.needed()?;
        let again = needed > self.bins.capacity();
        if again {
            self.bins.grow(needed)?;
        }
        Ok(again)
    }

    fn work(&self) -> Result<Work> {
        let shown = u64::from(self.count.read()?[0]) * u64::from(self.settings.views);
        Ok(Work { shown, ..self.bins.work()? })
    }
}
