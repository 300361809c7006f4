//! Frame after frame without waiting for the device, each on a level of quality.
//!
//! Recording comes first and the views last: [`Frames::submit`] writes them where the kernels will read them,
//! just before the device gets to see the frame. Nothing is allocated, made or waited for, unless a frame
//! needs more room than all before it: then it lacks some splats, and the next one has the room.

use shaders_glsl::types::View;

use super::camera::Camera;
use super::mode::Mode;
use super::modes::mode;
use super::quality_levels::QualityLevel;
use super::scene::Scene;
use super::settings::Settings;
use super::target::Target;
use super::visibility_mask::VisibilityMask;
use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Recorder, Ticket};
use crate::passes::Views;

/// Frames that may be in flight at once: one on the device, one recorded behind it, one of which the news is
/// under way.
pub const IN_FLIGHT: usize = 3;

/// Renders frames of a scene.
pub struct Frames {
    gpu: Gpu,
    levels: Vec<QualityLevel>,
    /// The mode of each level, by its place in `modes`.
    mode_of: Vec<usize>,
    modes: Vec<Box<dyn Mode>>,
    /// Written in turn; each may be written again when the frame that reads it has finished.
    views: Vec<Views>,
    /// The hidden areas of the pictures; empty where the settings do not ask for masks.
    masks: Vec<VisibilityMask>,
    readers: Vec<Option<Ticket>>,
    next: usize,
    /// Frames that have not been reported as finished, with their levels.
    flying: Vec<(Ticket, usize)>,
    /// Pictures of the frame that was recorded last, in the upper left corner as large as its level says.
    pub target: Target,
}

/// A frame being recorded.
pub struct Frame {
    /// Where what shows the picture is recorded.
    pub recorder: Recorder,
    /// The level that it is rendered on.
    pub level: usize,
    /// Width and height of its pictures, pixels.
    pub size: [u32; 2],
    /// Which of [`IN_FLIGHT`] turns it takes: what the host has written for the last frame of this turn is no
    /// longer read.
    pub slot: usize,
}

/// A frame that the device has finished.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Finished {
    /// Its submission.
    pub ticket: Ticket,
    /// The level that it was rendered on.
    pub level: usize,
    /// Device time from its first pass to the end of its last one, ms.
    pub gpu_ms: f64,
}

impl Frames {
    /// For a scene, with the modes of all levels made.
    pub fn new(gpu: &Gpu, scene: &Scene, settings: &Settings, levels: &[QualityLevel]) -> Result<Self> {
        let mut names: Vec<&str> = levels.iter().map(|r| r.mode).collect();
        names.dedup();
        let modes = names.iter().map(|name| mode(name)?.make(gpu, scene, settings)).collect::<Result<_>>()?;
        let views = |slot| Views::new(gpu, &format!("views {slot}"), settings.views, settings.masked);
        let pictures = if settings.masked { settings.views as usize } else { 0 };
        Ok(Frames {
            gpu: gpu.clone(),
            mode_of: levels.iter().filter_map(|r| names.iter().position(|name| *name == r.mode)).collect(),
            levels: levels.to_vec(),
            modes,
            views: (0..IN_FLIGHT).map(views).collect::<Result<_>>()?,
            masks: vec![VisibilityMask::default(); pictures],
            readers: vec![None; IN_FLIGHT],
            next: 0,
            flying: Vec::with_capacity(2 * IN_FLIGHT),
            target: Target::new(gpu, settings.size, settings.views, settings.precise, settings.depth)?,
        })
    }

    /// Returns the views of a frame of this turn, as kernels and drawings will read them.
    pub fn views(&self, slot: usize) -> &Buffer<View> {
        &self.views[slot].rows
    }

    /// Sets the hidden areas of the pictures, from the next submission on.
    ///
    /// # Panics
    /// If the settings did not ask for it, or had another number of views.
    pub fn set_visibility_masks(&mut self, masks: &[VisibilityMask]) {
        self.masks.clone_from_slice(masks);
    }

    /// Returns the levels.
    pub fn levels(&self) -> &[QualityLevel] {
        &self.levels
    }

    /// Renders the scene once on every level as `cameras` see it, and waits: afterwards all kernels are made,
    /// and all buffers hold what such frames need, with a margin.
    pub fn warm_up(&mut self, scene: &Scene, cameras: &[Camera]) -> Result<()> {
        for level in 0..self.levels.len() {
            let frame = self.begin(scene, level)?;
            let ticket = self.submit(frame, scene, cameras)?;
            self.gpu.wait(ticket)?;
            self.finished()?;
        }
        Ok(())
    }

    /// Starts a frame and records its rendering.
    pub fn begin(&mut self, scene: &Scene, level: usize) -> Result<Frame> {
        let slot = self.next;
        if let Some(reader) = self.readers[slot].take()
            && !self.gpu.has_finished(reader)?
        {
            self.gpu.wait(reader)?;
        }
        self.next = (slot + 1) % IN_FLIGHT;
        let mut recorder = self.gpu.record()?;
        let QualityLevel { quality, .. } = &self.levels[level];
        self.modes[self.mode_of[level]].record(
            &mut recorder,
            scene,
            &self.views[slot],
            &mut self.target,
            quality,
        )?;
        Ok(Frame { recorder, level, size: quality.size(self.target.size()), slot })
    }

    /// Says where the eyes are and hands the frame to the device.
    ///
    /// # Panics
    /// If there are not as many cameras as the settings had views.
    pub fn submit(&mut self, frame: Frame, scene: &Scene, cameras: &[Camera]) -> Result<Ticket> {
        let rows = cameras.iter().map(|camera| camera.view(scene.origin));
        self.views[frame.slot].write(rows, self.masks.iter().map(|mask| mask.words))?;
        let ticket = frame.recorder.submit()?;
        self.readers[frame.slot] = Some(ticket);
        self.flying.push((ticket, frame.level));
        Ok(ticket)
    }

    /// Frames that have finished since the last call of this. Makes room where one of them lacked it.
    pub fn finished(&mut self) -> Result<Vec<Finished>> {
        let mut out = Vec::new();
        for (ticket, gpu_ms) in self.gpu.take_finished()? {
            if let Some(at) = self.flying.iter().position(|&(t, _)| t == ticket) {
                let (ticket, level) = self.flying.swap_remove(at);
                out.push(Finished { ticket, level, gpu_ms });
            }
        }
        for &Finished { level, .. } in &out {
            self.modes[self.mode_of[level]].settle()?;
        }
        Ok(out)
    }
}
