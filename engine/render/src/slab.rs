//! Mode slab: the splats' field is added up at planes across the view and classified after that. With planes
//! a tenth as far apart it is mode exact, the reference of the other modes.

use glam::DVec3;
use shaders_glsl as glsl;
use shaders_glsl::tiles::{PARTS, PLANES, TILE};
use shaders_glsl::types::{SlabParams, TileGrid};

use super::gpu_splats::GpuSplats;
use super::look::Classification;
use super::mode::Mode;
use super::part::Part;
use super::quality::Quality;
use super::scene::Scene;
use super::settings::Settings;
use super::target::Target;
use super::variants::Variants;
use base::error::Result;
use gpu::{Buffer, Gpu, Kernel, Recorder};
use passes::{TileBinner, Views, Work, WorkgroupShape};

/// Planes of `exact` for each plane of `slab`.
const EXACT: u32 = 10;
/// Greatest number of blocks along the depth: slabs become thicker beyond that.
const MOST_BLOCKS: u32 = 512;

/// The mode `slab` or, with finer planes, `exact`.
pub struct Slab {
    gpu: Gpu,
    /// Kernels for each way to classify, with or without light and appearances of objects, each created when
    /// it is first needed.
    kernels: Variants<(Classification, bool, bool)>,
    bins: TileBinner,
    /// Number of splats that the look can show in the frame.
    count: Buffer<u32>,
    settings: Settings,
    /// Planes for each plane of `slab`.
    refinement: u32,
}

impl Slab {
    /// Creates mode slab, with slabs of `settings.step` standard deviations.
    pub fn new(gpu: &Gpu, scene: &Scene, settings: &Settings) -> Result<Self> {
        Self::with_refinement(gpu, scene, settings, false)
    }

    /// Creates mode exact: planes a tenth of a standard deviation apart, whatever the settings say, each
    /// classified at a point.
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

    /// Returns the index of the kernel for a way to classify; creates the kernel if necessary.
    fn kernel(&mut self, scene: &Scene, classification: Classification) -> Result<usize> {
        let (gpu, settings) = (&self.gpu, &self.settings);
        let (_, shaded) = settings.variant(scene);
        let objects = scene.look_buffers().facts.objects_differ;
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

/// Returns the grid of tiles for the picture and of blocks for a ball around all splats.
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
        part: Part,
    ) -> Result<()> {
        let (classification, _) = self.settings.variant(scene);
        let kernel = self.kernel(scene, classification)?;
        let (splats, look) = (scene.expect_splats(), scene.look_buffers());
        let grid = TileGrid {
            capacity: self.bins.capacity() as u32,
            ..tile_grid(splats, &self.settings, quality, self.refinement)
        };
        let field = splats.field;
        if part.is_first() {
            splats.count_active(recorder, &mut self.count);
            let active = (splats.active(), &self.count);
            self.bins.record(recorder, &grid, field.background, views, splats.rows(), active);
        }
        let rows = part.rows(grid.tiles[1]);
        if rows.is_empty() {
            return Ok(());
        }
        let columns = match WorkgroupShape::of(&self.gpu) {
            WorkgroupShape::OneByOne => grid.tiles[0] * PARTS,
            WorkgroupShape::SideBySide => grid.tiles[0] * (PARTS / 2),
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
            .read("hidden_parts", &self.bins.hidden_parts)
            .push(&SlabParams {
                grid,
                background: field.background,
                epsilon: field.epsilon,
                occupancy_w0: field.occupancy_w0,
                dark: self.settings.dark,
                first_row: rows.start,
            })
            .dispatch_3d([columns, rows.end - rows.start, self.settings.views]);
        Ok(())
    }

    fn warm_up(&mut self, scene: &Scene) -> Result<()> {
        for classification in self.settings.classifications() {
            self.kernel(scene, classification)?;
        }
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
