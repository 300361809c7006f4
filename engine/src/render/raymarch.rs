//! The mode `volume`: the CT itself, its rays marched through the voxels. What the splats' modes are measured against.

use shaders_glsl as glsl;
use shaders_glsl::types::RaymarchParams;

use super::{Classification, Mode, Quality, Scene, Settings, Target, Variants};
use crate::error::{Error, Kind, Result};
use crate::gpu::{Format, Gpu, Kernel, Recorder};
use crate::passes::{Shape, Views};

/// Samples nearer to each other than this, in voxels, would change nothing but the time.
const LEAST_STEP: f64 = 0.01;

/// The mode `volume`.
pub struct Raymarch {
    gpu: Gpu,
    /// For each way to classify and with or without light, made when it is first needed.
    kernels: Variants<(Classification, bool)>,
    settings: Settings,
}

impl Raymarch {
    /// Samples `settings.step` of the shortest voxel edge apart.
    pub fn new(gpu: &Gpu, scene: &Scene, settings: &Settings) -> Result<Self> {
        if !(settings.step >= LEAST_STEP && settings.step.is_finite()) {
            return Err(Error::new(
                Kind::Usage,
                "VGS-RENDER-023",
                format!("samples {} voxels apart; the least is {LEAST_STEP}", settings.step),
            )
            .help("choose another --step; 0.5 is fine for pictures, 0.25 for measuring"));
        }
        let mut mode = Raymarch { gpu: gpu.clone(), kernels: Variants::new(), settings: settings.clone() };
        mode.kernel(scene)?;
        Ok(mode)
    }

    /// The kernel for a way to classify, made if it is not there yet.
    fn kernel(&mut self, scene: &Scene) -> Result<usize> {
        let (gpu, settings) = (&self.gpu, &self.settings);
        self.kernels.find(settings.variant(scene), |(classification, shaded)| {
            let constants = [
                Shape::of(gpu) as u32,
                u32::from(scene.volume().image().format() == Format::Rg16),
                u32::from(*classification == Classification::PreIntegrated),
                u32::from(*shaded),
                u32::from(settings.depth),
                u32::from(settings.jitter),
            ];
            Kernel::new(gpu, &glsl::RAYMARCH, &constants)
        })
    }
}

impl Mode for Raymarch {
    fn record(
        &mut self,
        recorder: &mut Recorder,
        scene: &Scene,
        views: &Views,
        target: &mut Target,
        quality: &Quality,
    ) -> Result<()> {
        let kernel = self.kernel(scene)?;
        let (medium, look) = (scene.volume(), scene.look_buffers());
        // Pixels of a workgroup; see the kernel.
        let group = match Shape::of(&self.gpu) {
            Shape::OneByOne => [4, 2],
            Shape::SideBySide => [8, 8],
        };
        let size @ [width, height] = quality.size(self.settings.size);
        recorder
            .pass(&self.kernels[kernel])
            .read(&views.rows)
            .read(&look.rows)
            .read(&look.points)
            .read(&look.integrals)
            .sample(medium.image())
            .read(medium.distances())
            .write_image(&mut target.colour)
            .write_image(&mut target.depth)
            .push(&RaymarchParams {
                grid: medium.grid(),
                voxel_from_scene: medium.voxel_from_scene(),
                first: medium.scale().first as f32,
                span: medium.scale().span as f32,
                size,
                step: (self.settings.step * quality.coarseness * medium.spacing_mm) as f32,
                dark: self.settings.dark,
            })
            .dispatch_3d([width.div_ceil(group[0]), height.div_ceil(group[1]), self.settings.views]);
        Ok(())
    }
}
