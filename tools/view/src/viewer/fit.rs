//! A fit beside the window: it is begun, its splats are shown as they come, and kept or dropped at the end.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use engine::Result;
use engine::render::{Needs, Scene};

use super::shown_fit::{AskedFit, ShownFit};
use super::viewer::{Viewer, is_lost};
use crate::io::fitting::{FitOrder, Fitting, News};
use crate::io::loader::LoadedSplats;
use crate::model::actions::Action;
use crate::model::fit_plan::{Stage, config};
use crate::model::state::Subject;
use crate::screen::canvas::Canvas;

/// Work without which the splats of a fit cannot be shown decoded.
const DECODING: &str = "decoding the fit";
/// Least time from one picture of the fit to the next ...
const PICTURE_EVERY: Duration = Duration::from_secs(2);
/// ... which is also this many times that of rendering it: the window stays free, and the fit keeps the device.
const PICTURE_SHARE: f64 = 4.0;

impl Viewer {
    /// Carries out an action of the panel of fits.
    pub(super) fn act_on_fit(&mut self, action: Action, canvas: &mut Canvas) -> Result<()> {
        match (action, &mut self.fit) {
            (Action::StartFit { profile, quality }, None) => {
                if let Err(error) = self.start_fit(profile, quality) {
                    self.app.report(&error);
                }
            }
            (Action::StopFit, Some(shown)) => shown.fitting.stop(),
            (Action::Keep { path, force }, Some(shown)) => shown.fitting.keep(path, force),
            (Action::DiscardFit, Some(_)) => self.drop_fit(canvas)?,
            _ => {}
        }
        Ok(())
    }

    fn start_fit(&mut self, profile: &'static str, quality: &'static str) -> Result<()> {
        let Some(volume) = self.data.volume.clone() else { return Ok(()) };
        let config = config(profile, quality, volume.volume.is_ct())?;
        let voxels = volume.size.map_or(volume.volume.samples.len(), |size| size.voxels);
        let asked = AskedFit { profile, quality, voxels, begun: Some(Instant::now()) };
        let order = FitOrder { volume, config, gpu: self.gpu.clone() };
        let fitting = Fitting::start(order, self.loader.waker());
        self.fit =
            Some(ShownFit { fitting, asked, arrived: None, preparing: None, mode: self.app.state.mode });
        Ok(())
    }

    /// Takes what the fit has told.
    pub(super) fn take_fit(&mut self, canvas: &mut Canvas) -> Result<()> {
        self.note_time();
        let Some(shown) = &mut self.fit else { return Ok(()) };
        for news in shown.fitting.take() {
            match news {
                News::Splats(splats) => shown.arrived = Some(splats),
                News::Failed(error) => self.app.report(&error),
                News::Nothing => return self.drop_fit(canvas),
                News::Kept(path) => {
                    self.keep_fit(&path);
                    return Ok(());
                }
            }
        }
        Ok(())
    }

    /// Keeps how long the fit took, once it has ended by itself.
    fn note_time(&mut self) {
        let Some(ShownFit { fitting, asked, .. }) = &mut self.fit else { return };
        let status = fitting.status();
        if status.stage != Stage::Ended {
            return;
        }
        if let Some(begun) = asked.begun.take().filter(|_| !status.stopping) {
            let seconds = begun.elapsed().as_secs_f64();
            self.app.settings.fit_took(asked.profile, asked.quality, asked.voxels, seconds);
            if let Err(error) = self.app.settings.write() {
                self.app.report(&error);
            }
        }
    }

    /// Opens the file of the fit. Its splats stay in the picture until those of the file are read.
    fn keep_fit(&mut self, path: &PathBuf) {
        self.fit = None;
        self.app.done(format!("Written: {}", path.display()));
        if self.app.state.files.splats.contains(path) {
            // It is open, but what was read of it is no longer what it holds.
            self.open_files.forget(Subject::Splats);
        }
        if self.app.state.files.beside.as_ref() == Some(path) {
            self.open_files.forget(Subject::Beside);
        }
        if let Err(error) = self.open(std::slice::from_ref(path)) {
            self.app.report(&error);
        }
    }

    fn drop_fit(&mut self, canvas: &mut Canvas) -> Result<()> {
        if let Some(shown) = self.fit.take() {
            self.app.state.mode = shown.mode;
        }
        canvas.set_next(None);
        match self.data.fitted.take() {
            Some(_) => {
                self.data_number += 1;
                self.set_scene(canvas, Subject::Splats)
            }
            None => Ok(()),
        }
    }

    /// Drops what was on a device that is gone; what was being prepared is prepared again.
    pub(super) fn forget_device_of_fit(&mut self) {
        if let Some(shown) = &mut self.fit {
            shown.arrived = shown.arrived.take().or(shown.preparing.take());
        }
    }

    /// Shows the splats of the fit that have come, unless the user is moving the picture. Splats that are shown
    /// decoded come into the picture once they are.
    pub(super) fn show_fit(&mut self, canvas: &mut Canvas) -> Result<()> {
        let Some(shown) = &mut self.fit else { return Ok(()) };
        if self.app.held() {
            return Ok(());
        }
        if let Some(splats) = shown.preparing.take() {
            let decoded = canvas
                .next()
                .and_then(|s| s.splats.as_ref())
                .is_some_and(|s| s.has_decoded(self.app.state.decoding()));
            if !decoded && self.loader.is_doing(DECODING) {
                shown.preparing = Some(splats);
                return Ok(());
            }
            // What could not be decoded is shown as it is until it is.
            if let Some(scene) = canvas.take_next() {
                self.put_fit(canvas, splats, scene)?;
            }
            self.want_more();
        }
        let Some(shown) = &mut self.fit else { return Ok(()) };
        let Some(splats) = shown.arrived.take() else { return Ok(()) };
        let first = self.data.fitted.is_none();
        let scene = match self.data.scene_of_fit(canvas.gpu(), &splats, &self.app.state) {
            Ok(scene) => scene,
            Err(error) if is_lost(&error) => return Err(error),
            Err(error) => {
                // What the device has no room for is not shown; the fit goes on, without more pictures.
                self.app.report(&error);
                return Ok(());
            }
        };
        if first {
            self.choose_mode(&splats.set);
        }
        match &scene.splats {
            Some(on_device) if self.app.state.mode.needs == Needs::DecodedField => {
                self.loader.prepare(DECODING, on_device.decoding(canvas.gpu(), self.app.state.decoding())?);
                canvas.set_next(Some(scene));
                if let Some(shown) = &mut self.fit {
                    shown.preparing = Some(splats);
                }
            }
            _ => {
                self.put_fit(canvas, splats, scene)?;
                self.want_more();
            }
        }
        Ok(())
    }

    /// Puts splats of the fit in place of those that are shown.
    fn put_fit(&mut self, canvas: &mut Canvas, splats: Arc<LoadedSplats>, scene: Scene) -> Result<()> {
        let first = self.data.fitted.replace(splats).is_none();
        if first {
            self.app.state.shown = Subject::Splats;
        }
        canvas.set_scene(Subject::Splats, Some(scene));
        // The look may have changed since the scene was made.
        canvas.set_look(Subject::Splats, &self.data.look(Subject::Splats, &self.app.state)?)?;
        self.data_number += 1;
        self.range = self.data.range();
        // Splats that are soon replaced are not worth preparing to be moved.
        if self.fit.as_ref().is_some_and(|shown| shown.fitting.status().stage == Stage::Running) {
            self.prepared.insert(Subject::Splats);
        } else {
            self.prepared.remove(&Subject::Splats);
        }
        self.decoding.remove(&Subject::Splats);
        self.budget = self.app.state.quality.splat_budget;
        self.stale |= self.app.state.shown == Subject::Splats || self.app.state.split.is_some();
        Ok(())
    }

    fn want_more(&self) {
        let Some(shown) = self.fit.as_ref().filter(|shown| shown.fitting.status().stage == Stage::Running)
        else {
            return;
        };
        let picture = self.statistics.frames_ms().last().unwrap_or_default();
        shown.fitting.want_splats(PICTURE_EVERY.max(Duration::from_secs_f64(PICTURE_SHARE * picture / 1e3)));
    }
}
