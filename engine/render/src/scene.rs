//! The scene that is rendered, on the device: splats, a volume or both, and how they are seen.

use glam::DVec3;

use super::gpu_splats::{GpuSplats, Precision};
use super::gpu_volume::{GpuVolume, VolumeSource};
use super::look::{Look, LookBuffers};
use base::error::{Error, Kind, Result};
use gpu::Gpu;
use splat::{Object, SplatSet};

/// The scene that is rendered, on the device.
pub struct Scene {
    gpu: Gpu,
    /// Origin of the scene's space in the world, mm RAS.
    pub origin: DVec3,
    /// The splats, if there are any.
    pub splats: Option<GpuSplats>,
    /// The volume, if there is one.
    pub volume: Option<GpuVolume>,
    look: Look,
    buffers: LookBuffers,
}

impl Scene {
    /// Creates a scene of splats, of a volume, or of both, at first seen as `look` says.
    pub fn new(
        gpu: &Gpu,
        splats: Option<&SplatSet>,
        volume: Option<&VolumeSource<'_>>,
        look: &Look,
    ) -> Result<Self> {
        Self::with_precision(gpu, splats, volume, look, Precision::Full)
    }

    /// Creates a scene like [`Self::new`], with splats kept in `precision`.
    pub fn with_precision(
        gpu: &Gpu,
        splats: Option<&SplatSet>,
        volume: Option<&VolumeSource<'_>>,
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
        let splats = splats.map(|set| GpuSplats::new(gpu, set, precision)).transpose()?;
        let volume = volume.map(|source| GpuVolume::new(gpu, source, origin)).transpose()?;
        let range = range_of(splats.as_ref(), volume.as_ref());
        let buffers = LookBuffers::new(gpu, look, range, origin)?;
        let mut scene = Scene { gpu: gpu.clone(), origin, splats, volume, look: look.clone(), buffers };
        scene.list_active()?;
        Ok(scene)
    }

    /// Shows another volume, which lies where that before did, from the next frame on.
    pub fn set_volume(&mut self, volume: &VolumeSource<'_>) -> Result<()> {
        self.volume = Some(GpuVolume::new(&self.gpu, volume, self.origin)?);
        Ok(())
    }

    /// Changes how the scene is seen, from the next frame on: what is in flight shows the look that it was begun with.
    /// Nothing is waited for, and memory is allocated only if more functions are shown than ever before.
    pub fn set_look(&mut self, look: &Look) -> Result<()> {
        if *look == self.look {
            return Ok(());
        }
        let splats = &mut self.splats;
        self.buffers.set(look, |recorder, buffers| {
            if let Some(splats) = splats {
                splats.record_activity(recorder, buffers);
            }
        })?;
        self.look = look.clone();
        Ok(())
    }

    /// Renders at most `budget` splats from now on: the most important of those that the look can show, by
    /// opacity times volume. Viewers use it to trade splats for time; the first budget takes as long as
    /// sorting all splats.
    pub fn set_splat_budget(&mut self, budget: Option<usize>) -> Result<()> {
        if let Some(splats) = &mut self.splats {
            splats.set_budget(&self.gpu, budget)?;
        }
        self.list_active()
    }

    /// Lists also splats that no look can show, from now on: a measurement of what leaving them out saves.
    pub fn list_all(&mut self) -> Result<()> {
        if let Some(splats) = &mut self.splats {
            splats.list_all(&self.gpu)?;
        }
        self.list_active()
    }

    /// Returns how the scene is seen.
    pub fn look(&self) -> &Look {
        &self.look
    }

    /// Returns the splats, for a mode of splats: such a mode is created only if there are some.
    pub(super) fn expect_splats(&self) -> &GpuSplats {
        self.splats.as_ref().expect("a scene with splats")
    }

    /// Returns the volume, for a mode of volumes: such a mode is created only if there is one.
    pub(super) fn expect_volume(&self) -> &GpuVolume {
        self.volume.as_ref().expect("a scene with a volume")
    }

    /// Returns the objects that a look can show, hide and colour separately, by ascending number; empty
    /// without splats.
    pub fn objects(&self) -> &[Object] {
        self.splats.as_ref().map_or(&[], |splats| &splats.objects)
    }

    pub(super) fn look_buffers(&self) -> &LookBuffers {
        &self.buffers
    }

    /// Returns the corners of the box around what there is to see, mm RAS: around the volume's region, and
    /// around the splats without their tails, so that both are framed alike.
    pub fn bounds(&self) -> [DVec3; 2] {
        let splats = self.splats.as_ref().map(|s| s.cores);
        let volume = self.volume.as_ref().map(|v| v.bounds);
        let [low, high] = match (splats, volume) {
            (Some(a), Some(b)) => [a[0].min(b[0]), a[1].max(b[1])],
            (a, b) => a.or(b).unwrap_or_default(),
        };
        [low + self.origin, high + self.origin]
    }

    fn list_active(&mut self) -> Result<()> {
        let mut recorder = self.gpu.record()?;
        if let Some(splats) = &mut self.splats {
            splats.record_activity(&mut recorder, &self.buffers);
        }
        recorder.submit()?;
        Ok(())
    }
}

/// Returns the least and greatest intensity of the splats and the volume.
fn range_of(splats: Option<&GpuSplats>, volume: Option<&GpuVolume>) -> [f64; 2] {
    match (splats.map(|s| s.range), volume.map(|v| v.range)) {
        (Some(a), Some(b)) => [a[0].min(b[0]), a[1].max(b[1])],
        (a, b) => a.or(b).unwrap_or([0.0, 1.0]),
    }
}
