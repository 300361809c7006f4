//! The modes `volume` and `decoded`: rays marched through the voxels of the CT itself, against which the
//! splats' modes are measured, or through those that the splats were decoded to. One kernel serves both; only
//! the image differs.

use std::sync::Arc;

use shaders_glsl as glsl;
use shaders_glsl::types::RaymarchParams;

use super::gpu_volume::GpuVolume;
use super::look::Classification;
use super::mode::Mode;
use super::quality::Quality;
use super::scene::Scene;
use super::settings::Settings;
use super::target::Target;
use super::variants::Variants;
use crate::error::{Error, Kind, Result};
use crate::gpu::{Format, Gpu, Kernel, Recorder};
use crate::passes::{Views, Work, WorkgroupShape};

/// Least distance of samples, in voxels. Nearer ones would change nothing but the time.
const LEAST_STEP: f64 = 0.01;

/// The mode `volume` or `decoded`.
pub struct Raymarch {
    gpu: Gpu,
    /// Kernels for each way to classify, with or without light and appearances of objects, each created when
    /// it is first needed.
    kernels: Variants<(Classification, bool, bool)>,
    settings: Settings,
    /// Bytes of the image that the last frame sampled.
    image_bytes: u64,
    /// The decoded field; `None` if the scene's volume is rendered.
    decoded: Option<Arc<GpuVolume>>,
}

impl Raymarch {
    /// Creates mode volume, with samples `settings.step` of the shortest voxel edge apart.
    pub fn new(gpu: &Gpu, scene: &Scene, settings: &Settings) -> Result<Self> {
        Self::of(gpu, scene, settings, None)
    }

    /// Creates mode decoded. Decodes the splats to voxels `settings.pitch` apart if necessary; samples are
    /// spaced as in mode volume.
    pub fn decoded(gpu: &Gpu, scene: &Scene, settings: &Settings) -> Result<Self> {
        let decoded = scene.expect_splats().decoded(gpu, settings.pitch)?;
        Self::of(gpu, scene, settings, Some(decoded))
    }

    fn of(gpu: &Gpu, scene: &Scene, settings: &Settings, decoded: Option<Arc<GpuVolume>>) -> Result<Self> {
        if !(settings.step >= LEAST_STEP && settings.step.is_finite()) {
            return Err(Error::new(
                Kind::Usage,
                "VGS-RENDER-023",
                format!("samples {} voxels apart; the least is {LEAST_STEP}", settings.step),
            )
            .help("choose another --step; 0.5 is fine for pictures, 0.25 for measuring"));
        }
        let mut mode = Raymarch {
            gpu: gpu.clone(),
            kernels: Variants::new(),
            settings: settings.clone(),
            image_bytes: 0,
            decoded,
        };
        mode.kernel(scene)?;
        Ok(mode)
    }

    /// Returns the index of the kernel for a way to classify; creates the kernel if necessary.
    fn kernel(&mut self, scene: &Scene) -> Result<usize> {
        let (gpu, settings) = (&self.gpu, &self.settings);
        let (volume, look) =
            (self.decoded.as_deref().unwrap_or_else(|| scene.expect_volume()), scene.look_buffers());
        let (classification, shaded) = settings.variant(scene);
        // Splats of a hidden object are still in the decoded field.
        let objects = volume.is_atlas() && (look.objects_differ || look.hides);
        self.kernels.find((classification, shaded, objects), |(classification, shaded, objects)| {
            let constants = [
                WorkgroupShape::of(gpu) as u32,
                u32::from(volume.image().format() == Format::Rg16),
                u32::from(*classification == Classification::PreIntegrated),
                u32::from(*shaded),
                u32::from(settings.depth),
                u32::from(settings.jitter),
                u32::from(volume.is_atlas()),
                u32::from(*objects),
                u32::from(settings.masked),
                u32::from(settings.counting),
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
        let volume = self.decoded.as_deref().unwrap_or_else(|| scene.expect_volume());
        self.image_bytes = volume.image_bytes();
        let look = scene.look_buffers();
        let marked = volume.marked(recorder, look);
        // Width and height of a workgroup, pixels; see the kernel.
        let group = match WorkgroupShape::of(&self.gpu) {
            WorkgroupShape::OneByOne => [4, 2],
            WorkgroupShape::SideBySide => [8, 8],
        };
        let size @ [width, height] = quality.size(self.settings.size);
        recorder
            .pass(&self.kernels[kernel])
            .read("views", &views.rows)
            .read("look_rows", &look.rows)
            .read("look_points", &look.points)
            .read("look_integrals", &look.integrals)
            .sample("medium", volume.image())
            .read("distances", marked.distances())
            .read("places", volume.places())
            .sample("labels", volume.labels())
            .read("appearances", &look.appearances)
            .write_image("colour_image", &mut target.colour)
            .write_image("depth_image", &mut target.depth)
            .read("patches", &views.patches)
            .push(&RaymarchParams {
                grid: volume.grid(),
                voxel_from_scene: volume.voxel_from_scene(),
                first: volume.scale().first as f32,
                span: volume.scale().span as f32,
                size,
                step: (self.settings.step * quality.coarseness * volume.spacing_mm) as f32,
                dark: self.settings.dark,
            })
            .dispatch_3d([width.div_ceil(group[0]), height.div_ceil(group[1]), self.settings.views]);
        Ok(())
    }

    fn work(&self) -> Result<Work> {
        Ok(Work { image_bytes: self.image_bytes, ..Work::default() })
    }
}
