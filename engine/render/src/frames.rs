//! Frames rendered without waiting for the device, each at a quality level.
//!
//! Recording comes first and the views last: [`Frames::submit`] writes them where the kernels will read them,
//! just before the device gets the frame. Nothing is allocated, created or waited for, unless a frame needs
//! more room than all before it: then it lacks some splats, and the next one has the room.

use shaders_glsl::types::View;

use super::camera::Camera;
use super::look;
use super::mode::Mode;
use super::modes::mode;
use super::part::Part;
use super::quality_levels::QualityLevel;
use super::scene::Scene;
use super::settings::Settings;
use super::target::Target;
use super::visibility_mask::VisibilityMask;
use base::error::Result;
use gpu::{Buffer, Gpu, Recorder, Ticket};
use passes::Views;

/// Frames that may be in flight at once: one on the device, one recorded behind it, and one that has finished
/// but not yet been reported.
pub const IN_FLIGHT: usize = 3;

// A look for each of them waits for no piece of memory.
const _: () = assert!(look::PIECES > IN_FLIGHT);

/// Renders frames of a scene.
pub struct Frames {
    gpu: Gpu,
    levels: Vec<QualityLevel>,
    /// Index in `modes` of the mode of each level.
    mode_of: Vec<usize>,
    modes: Vec<Box<dyn Mode>>,
    /// Views, written in turn; each may be written again when the frame that reads it has finished.
    views: Vec<Views>,
    /// Visibility masks of the pictures; empty if the settings do not ask for masks.
    masks: Vec<VisibilityMask>,
    readers: Vec<Option<Ticket>>,
    next: usize,
    /// Frames that have not been reported as finished, with their levels.
    flying: Vec<(Ticket, usize)>,
    /// Pictures of the frame that was recorded last; they fill the upper left corner as far as its level
    /// says.
    pub target: Target,
}

/// A frame being recorded.
pub struct Frame {
    /// Recorder of the frame; passes that show the picture are recorded here.
    pub recorder: Recorder,
    /// Quality level of the frame.
    pub level: usize,
    /// Width and height of the pictures, pixels.
    pub size: [u32; 2],
    /// Index of the frame's turn, below [`IN_FLIGHT`]. What the host wrote for the last frame of this turn is
    /// no longer read.
    pub slot: usize,
}

/// A frame that the device has finished.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Finished {
    /// Ticket of its submission.
    pub ticket: Ticket,
    /// Quality level of the frame.
    pub level: usize,
    /// Device time from its first pass to the end of its last one, ms.
    pub gpu_ms: f64,
}

impl Frames {
    /// Creates the frames of a scene, with the modes of all levels.
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

    /// Returns the views of a frame of turn `slot`, as kernels and drawings will read them.
    pub fn views(&self, slot: usize) -> &Buffer<View> {
        &self.views[slot].rows
    }

    /// Sets the visibility masks of the pictures, from the next submission on.
    ///
    /// # Panics
    /// If the settings did not ask for masks, or had another number of views.
    pub fn set_visibility_masks(&mut self, masks: &[VisibilityMask]) {
        self.masks.clone_from_slice(masks);
    }

    /// Returns the quality levels.
    pub fn levels(&self) -> &[QualityLevel] {
        &self.levels
    }

    /// Renders the scene once on every level as `cameras` see it, and waits. Afterwards all kernels exist,
    /// and all buffers hold what such frames need, with a margin.
    pub fn warm_up(&mut self, scene: &Scene, cameras: &[Camera]) -> Result<()> {
        self.modes.iter_mut().try_for_each(|mode| mode.warm_up(scene))?;
        for level in 0..self.levels.len() {
            let frame = self.begin(scene, level)?;
            let ticket = self.submit(frame, scene, cameras)?;
            self.gpu.wait(ticket)?;
            self.finished()?;
        }
        Ok(())
    }

    /// Shows what the scene's splats were decoded to last, from the next frame on.
    pub fn renew(&mut self, scene: &Scene) {
        self.modes.iter_mut().for_each(|mode| mode.renew(scene));
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
            Part::WHOLE,
        )?;
        Ok(Frame { recorder, level, size: quality.size(self.target.size()), slot })
    }

    /// Writes the views of the eyes and submits the frame to the device.
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

    /// Returns the frames that have finished since the last call of this. Grows buffers that were too small
    /// for one of them.
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
