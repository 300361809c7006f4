//! The frames, what is loaded, and what the user asks for.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use engine::budget::Controller;
use engine::gpu::GpuOptions;
use engine::render::{DecodeOptions, ObjectChange, SplatKind, UsualLook, level_costs, quality_levels};
use engine::splat::SplatSet;
use engine::unit::Unit;
use engine::{Error, Result, transfer};
use glam::DVec2;
use winit::window::Window;

use super::begun::{Begun, PictureTimes, REST};
use super::shown_fit::ShownFit;
use crate::app::App;
use crate::io::loaded_data::LoadedData;
use crate::io::loader::{Loaded, Loader};
use crate::io::open_files::OpenFiles;
use crate::io::report::WindowReport;
use crate::model::actions::Action;
use crate::model::fit_plan::Stage;
use crate::model::panel_info::{PanelInfo, Statistics};
use crate::model::settings::Settings;
use crate::model::state::{Clip, Files, SplatMode, Subject, ViewState};
use crate::model::system_dialog::SystemDialog;
use crate::model::thumbnails::Thumbnails;
use crate::model::transfer::Transfer;
use crate::screen::canvas::{Canvas, Overlay};
use crate::viewer::input_queue::InputQueue;

/// Error code of a lost device.
const LOST: &str = "VGS-GPU-012";
/// Error code of a lost surface of the window.
const SURFACE_LOST: &str = "VGS-GPU-034";

/// Returns true if the device or the window's surface is lost, so that the window has to begin anew.
pub fn is_lost(error: &Error) -> bool {
    error.code == LOST || error.code == SURFACE_LOST
}

/// The open window with what draws in it.
pub struct ActiveWindow {
    /// Scenes, pictures and surface on the device.
    pub canvas: Canvas,
    /// Converter from winit's events to egui's.
    pub input: egui_winit::State,
    /// The window.
    pub window: Arc<Window>,
}

/// Initial state of the viewer.
pub struct Start {
    /// State to show; its files are read.
    pub state: ViewState,
    /// File of the state, if it is a session; its camera is kept. Otherwise the camera is moved to see everything.
    pub session: Option<PathBuf>,
    /// True if the user has asked for the transfer function of the state.
    pub asked: bool,
    /// Changes of how objects are shown, for the first splats that are read.
    pub objects: Vec<ObjectChange>,
    /// Settings of the user.
    pub settings: Settings,
    /// Options of the device; `windows` is filled in.
    pub gpu: GpuOptions,
    /// Time when the program was started.
    pub since: Instant,
}

/// Gives what has no HU, as an MR, a function for such data, where the first function for CT stands untouched. Returns
/// true if it was given one.
fn choose_function(state: &mut ViewState, unit: Unit, range: [f64; 2]) -> bool {
    let first = |name| Some(Transfer::new(&transfer::load(name, range).ok()?));
    let is_first = unit == Unit::Arbitrary && first(transfer::FIRST).as_ref() == Some(&state.transfer);
    let other = first(transfer::FIRST_WITHOUT_HU).filter(|_| is_first);
    let chosen = other.is_some();
    state.transfer = other.unwrap_or_else(|| state.transfer.clone());
    chosen
}

/// Instructions to the event loop after a frame.
pub struct Next {
    /// Time after which to draw again, even if nothing happens.
    pub again: Option<Duration>,
    /// True if the user wants to end the program.
    pub quit: bool,
    /// True if a picture was begun of something that is being dragged.
    pub dragged: bool,
}

/// The viewer.
pub struct Viewer {
    pub(super) app: App,
    pub(super) data: LoadedData,
    /// Number of the data, another one whenever they change.
    pub(super) data_number: u64,
    pub(super) loader: Loader,
    pub(super) statistics: Statistics,
    /// Measurements of the session.
    pub report: WindowReport,
    /// Files that were read.
    pub(super) open_files: OpenFiles,
    /// Number of splats of each row of the list of objects.
    object_splats: Vec<usize>,
    /// Changes of how objects are shown, until the first splats are read.
    object_changes: Vec<ObjectChange>,
    pub(super) range: [f64; 2],
    pub(super) thumbnails: Thumbnails,
    pub(super) controller: Controller,
    /// Kind of splats whose quality levels the controller chooses from.
    pub(super) kind: SplatKind,
    /// True if the last picture has a lower quality than it will have at rest.
    pub(super) draft: bool,
    /// Time of the last movement; `None` once the picture was rendered in full.
    pub(super) moved: Option<Instant>,
    /// Size for which the pictures on the device were rendered.
    pub(super) size: Option<[u32; 2]>,
    /// True if pictures have to be rendered whatever the user does.
    pub(super) stale: bool,
    /// True if the user has changed something since the last picture was begun.
    pub(super) changed: bool,
    /// True if that is the look, among other things.
    pub(super) look_changed: bool,
    pub(super) times: PictureTimes,
    /// The picture on its way.
    pub(super) begun: Option<Begun>,
    input_queue: InputQueue,
    /// Time of the first event that no frame has answered yet.
    happened: Option<Instant>,
    /// Time of the first event behind an edit of the look that no picture was begun for.
    pub(super) edited: Option<Instant>,
    /// The same of the edit that the next frame shows.
    pub(super) answered: Option<Instant>,
    /// Splat budget of the scenes.
    pub(super) budget: Option<u64>,
    /// Splats for which the data with which they move faster are there or being made.
    pub(super) prepared: BTreeSet<Subject>,
    /// Splats whose field is being decoded for mode decoded, and how.
    pub(super) decoding: BTreeMap<Subject, DecodeOptions>,
    /// True while there is nothing better than a draft in slabs, because the field is still being decoded.
    pub(super) waits: bool,
    /// True if the camera is to see everything once something is there.
    pub(super) frame_all: bool,
    /// Options of the device of a fit.
    pub(super) gpu: GpuOptions,
    /// The fit beside the window.
    pub(super) fit: Option<ShownFit>,
    /// True while the splats that deletions leave are being found.
    pub(super) deleting: bool,
    /// True while the error of the splats is being measured.
    pub(super) measuring: bool,
    /// True if the picture has the colours of the error.
    pub(super) error_shown: bool,
}

impl Viewer {
    /// Creates a viewer and begins to read the files of the state.
    pub fn new(start: Start, mut loader: Loader, report: WindowReport) -> Self {
        let Start { state, session, asked, objects, settings, gpu, .. } = start;
        let frame_all = session.is_none();
        let budget_ms = state.quality.target_frame_ms;
        let mut app = match session {
            // Nothing is shown before the user has said where the rest is.
            Some(session) if !state.files.missing().is_empty() => {
                let files = Files::default();
                // What belongs to a patient who may not be opened does not stay for the next one.
                let nothing = ViewState {
                    files,
                    objects: Vec::new(),
                    deleted: Vec::new(),
                    distances: Vec::new(),
                    bookmarks: Vec::new(),
                    clip: Clip::default(),
                    headset: None,
                    ..state.clone()
                };
                let mut app = App::new(ViewState { shown: Subject::Splats, ..nothing }, None, settings);
                app.ask_missing(state, session);
                app
            }
            session => App::new(state, session, settings),
        };
        if asked {
            app.keep_look();
        }
        loader.open(&app.state.files, &Files::default(), None, app.state.edges);
        Viewer {
            app,
            data: LoadedData::default(),
            data_number: 0,
            loader,
            statistics: Statistics::new(),
            report,
            open_files: OpenFiles::default(),
            object_splats: Vec::new(),
            range: [0.0, 1.0],
            thumbnails: Thumbnails::default(),
            controller: Controller::new(level_costs(quality_levels(SplatKind::Field)), budget_ms),
            kind: SplatKind::Field,
            draft: false,
            moved: None,
            size: None,
            stale: true,
            changed: false,
            look_changed: false,
            times: PictureTimes::default(),
            begun: None,
            input_queue: InputQueue::default(),
            happened: None,
            edited: None,
            answered: None,
            budget: None,
            prepared: BTreeSet::new(),
            decoding: BTreeMap::new(),
            waits: false,
            object_changes: objects,
            frame_all,
            gpu,
            fit: None,
            deleting: false,
            measuring: false,
            error_shown: false,
        }
    }

    /// Returns the title of the window.
    pub fn title(&self) -> String {
        let files = &self.app.state.files;
        let names =
            files.splats.iter().chain(&files.beside).chain(&files.volume).filter_map(|p| p.file_name());
        let names: Vec<_> = names.map(|n| n.to_string_lossy()).collect();
        if names.is_empty() { "vgs".to_owned() } else { format!("{} - vgs", names.join(", ")) }
    }

    /// Asks for files by the dialog of the desktop, unless the user wants our own.
    pub fn use_system_dialog(&mut self, dialog: SystemDialog) {
        self.app.system_dialog = Some(dialog).filter(|_| !self.app.settings.own_file_dialog);
    }

    /// Returns a function that wakes the window, from any thread.
    pub fn waker(&self) -> Arc<dyn Fn() + Send + Sync> {
        self.loader.waker()
    }

    /// Notes an event that a frame may have to answer.
    pub fn note_event(&mut self) {
        self.happened.get_or_insert_with(Instant::now);
    }

    /// Notes for how long the window's thread was busy since `begun`.
    pub fn note_busy(&mut self, begun: Instant) {
        self.report.busy(begun, self.app.drags());
    }

    /// Creates the scenes on a new device.
    pub fn set_device(&mut self, canvas: &mut Canvas) -> Result<()> {
        let chosen = canvas.gpu().description();
        self.app.forget_textures();
        self.thumbnails = Thumbnails::default();
        self.forget_device_of_fit();
        self.statistics.device = format!("{} ({})", chosen.name, chosen.driver);
        Subject::ALL.into_iter().try_for_each(|subject| self.set_scene(canvas, subject))
    }

    /// Takes what was loaded and puts it on the device.
    pub fn take_loaded(&mut self, canvas: &mut Canvas) -> Result<()> {
        let (mut new, mut gone, mut edged) = (Vec::new(), Vec::new(), false);
        for loaded in self.loader.take() {
            self.data_number += 1;
            self.measuring &= !matches!(loaded, Loaded::Error(..));
            if let Loaded::Written(path, note) = &loaded {
                self.app.done(format!("Written: {}{note}", path.display()));
            }
            if let Loaded::Remaining(left) = loaded {
                new.extend(self.take_left(left));
                continue;
            }
            if let Loaded::Splats(_) = &loaded {
                // What is deleted is not shown until the rest is there.
                self.data.waits = !self.app.state.deleted.is_empty();
            }
            if let Loaded::Splats(splats) = &loaded
                && self.fit.is_none()
            {
                self.choose_mode(&splats.set);
                if splats.far > 0 {
                    self.app.done(format!(
                        "{} of {} splats lie far from all others, so the picture is framed without them. Remove them with a crop box and Delete outside.",
                        splats.far,
                        splats.set.splats.len()
                    ));
                }
                // Those of the fit that was kept.
                self.data.fitted = None;
            }
            if matches!(loaded, Loaded::Beside(_)) && self.app.state.files.beside.is_none() {
                // They were closed meanwhile, or what they were to stand beside could not be read.
                continue;
            }
            let unread = match &loaded {
                Loaded::Failed(subject, _) => *subject,
                Loaded::Several(series) => {
                    self.app.ask_series(series.clone());
                    Some(Subject::Volume)
                }
                _ => None,
            };
            if let Some(subject) = unread {
                let open_files = &mut self.open_files;
                self.app.change_unasked(|state| {
                    open_files.revert(subject, &mut state.files);
                    state.forget_missing_files();
                });
                if self.app.state.files.beside.is_none() && self.data.beside.is_some() {
                    gone.push(Subject::Beside);
                }
                if subject == Subject::Splats && self.fit.is_none() && self.data.fitted.take().is_some() {
                    new.push(Subject::Splats);
                }
            }
            if let Loaded::Volume(shown) = &loaded {
                // By its UID, whatever it was asked for by.
                self.app.change_unasked(|state| state.files.series.clone_from(&shown.series));
            }
            if let Loaded::Sorted(sorted, paths) = &loaded {
                match self.open_sorted((**sorted).clone(), paths) {
                    Ok(subjects) => gone.extend(subjects),
                    Err(error) => self.app.report(&error),
                }
            }
            if let Loaded::Edges(of) = &loaded {
                edged |= self.data.volume.as_ref().is_some_and(|volume| Arc::ptr_eq(volume, of));
                continue;
            }
            match self.data.take(loaded) {
                Ok(Some(subject)) => {
                    self.remember_files(subject);
                    new.push(subject);
                }
                Ok(None) => {}
                // The next picture finds the same loss, and the window begins anew; a device that has
                // replaced the lost one draws one picture more.
                Err(error) if is_lost(&error) => self.stale = true,
                Err(error) => self.app.report(&error),
            }
        }
        // What was loaded is kept whatever happens to the device.
        edged &= !new.contains(&Subject::Volume);
        new.into_iter().try_for_each(|subject| self.set_scene(canvas, subject))?;
        if edged {
            self.put_scene(canvas, Subject::Volume)?;
        }
        self.forget(canvas, gone)?;
        self.take_fit(canvas)
    }

    /// Returns true if the window may be closed at once. Otherwise the user is asked, since a fit or changes of
    /// the session would be lost.
    pub fn may_close(&mut self) -> bool {
        let loses = self.fit.is_some() || self.app.is_changed();
        if loses {
            self.app.ask_to_leave();
        }
        !loses
    }

    /// Chooses the only mode that shows these splats, if there is one.
    pub(super) fn choose_mode(&mut self, set: &SplatSet) {
        let kind = SplatKind::of(set);
        let Some(own) = kind.own_mode().and_then(SplatMode::named) else { return };
        if std::mem::replace(&mut self.app.state.mode, own) != own && kind == SplatKind::Coloured {
            self.app.done(format!("These splats have colours but no intensity: shown in mode {}", own.name));
        }
    }

    pub(super) fn set_scene(&mut self, canvas: &mut Canvas, subject: Subject) -> Result<()> {
        self.range = self.data.range();
        self.times = PictureTimes::default();
        self.prepared.remove(&subject);
        self.decoding.remove(&subject);
        let mut without_hu = false;
        if let (Subject::Splats, Some(splats)) = (subject, self.data.remaining_splats()) {
            let rows = splats.objects.iter().map(|(object, _, count)| (object.clone(), *count));
            let (rows, counts) = rows.unzip();
            let changes = std::mem::take(&mut self.object_changes);
            let numbers: Vec<u8> = splats.objects.iter().map(|(_, number, _)| *number).collect();
            let (there, range, unit) = (splats.set.objects(), self.range, self.data.unit());
            let mut changed = Ok(());
            self.app.take_objects(rows, UsualLook::of(&splats.set).as_ref(), |state| {
                changed = state.change_objects(&there, &numbers, range, &changes);
                without_hu = choose_function(state, unit, range);
            });
            if let Err(error) = changed {
                self.app.report(&error);
            }
            self.object_splats = counts;
        } else if subject != Subject::Beside
            && self.data.splats.is_none()
            && self.data.fitted.is_none()
            && self.data.has(Subject::Volume)
        {
            let (unit, range) = (self.data.unit(), self.range);
            self.app.change_given(|state, _| {
                state.shown = Subject::Volume;
                without_hu = choose_function(state, unit, range);
            });
        }
        if without_hu {
            self.app.done(format!("No Hounsfield units: using the preset {}", transfer::FIRST_WITHOUT_HU));
        }
        if subject == Subject::Splats && self.data.waits && self.data.fitted.is_none() {
            return Ok(());
        }
        self.put_scene(canvas, subject)?;
        if self.frame_all && self.data.has(subject) {
            self.app.frame_all_soon();
            self.frame_all = false;
        }
        self.budget = self.app.state.quality.splat_budget;
        Ok(())
    }

    /// Puts what there is of a subject on the device.
    fn put_scene(&mut self, canvas: &mut Canvas, subject: Subject) -> Result<()> {
        let start = Instant::now();
        match self.data.scene(canvas.gpu(), subject, &self.app.state) {
            Ok(scene) => canvas.set_scene(subject, scene),
            Err(error) if is_lost(&error) => return Err(error),
            // What the device has no room for is not shown; the rest goes on.
            Err(error) => self.app.report(&error),
        }
        tracing::debug!("{subject:?} on the device: {:.0} ms", start.elapsed().as_secs_f64() * 1e3);
        self.stale |= self.app.state.shown == subject || self.app.state.split.is_some();
        Ok(())
    }

    /// Draws a frame: panels, and the picture if it has changed.
    pub fn draw(&mut self, active: &mut ActiveWindow) -> Result<Next> {
        let happened = self.happened.take();
        self.show_fit(&mut active.canvas)?;
        let mut input = active.input.take_egui_input(&active.window);
        let more_input = self.input_queue.take(&mut input.events);
        let context = active.input.egui_ctx().clone();
        let (mut output, actions) = self.panels(input, &context, &active.canvas);
        active.canvas.take_textures(std::mem::take(&mut output.textures_delta));
        active.input.handle_platform_output(&active.window, std::mem::take(&mut output.platform_output));
        let mut quit = false;
        for action in actions {
            quit |= self.act(action, &mut active.canvas)?;
        }
        self.follow_deletions();
        self.follow_error(&mut active.canvas)?;
        let overlay = Overlay {
            primitives: context.tessellate(std::mem::take(&mut output.shapes), output.pixels_per_point),
            pixels_per_point: output.pixels_per_point,
            picture: self.app.picture(),
        };
        let was_draft = self.draft;
        self.edited = self.edited.or(happened);
        let dragged = self.render(&mut active.canvas, &overlay)?;
        let window = &active.window;
        let rests = !self.draft && self.begun.is_none();
        if rests && self.make_thumbnail(&mut active.canvas, &context)? {
            window.request_redraw();
        }
        if rests && !active.canvas.is_blank() {
            self.measure_error(&active.canvas);
        }
        if self.draft != was_draft || more_input {
            // The panels of this frame describe the previous picture.
            window.request_redraw();
        }
        let shown = active.canvas.present(&self.app.state, overlay, || window.pre_present_notify())?;
        if shown {
            let with_picture = !active.canvas.is_blank();
            self.report.shown(with_picture, self.draft, self.answered.take());
            tracing::debug!("frame shown");
        }
        let egui = output.viewport_output.values().map(|v| v.repaint_delay).min();
        let rest = self.moved.map(|at| REST.saturating_sub(at.elapsed()));
        let again = egui.into_iter().chain(rest).min().filter(|after| *after < Duration::from_secs(3600));
        if again.is_some_and(|after| after.is_zero()) {
            window.request_redraw();
        }
        Ok(Next { again: again.filter(|after| !after.is_zero()), quit, dragged })
    }

    /// Lays out the panels, and returns what the user asked for with them.
    fn panels(
        &mut self,
        input: egui::RawInput,
        context: &egui::Context,
        canvas: &Canvas,
    ) -> (egui::FullOutput, Vec<Action>) {
        let mut actions = Vec::new();
        let Viewer {
            app,
            data,
            data_number,
            loader,
            statistics,
            object_splats,
            range,
            draft,
            thumbnails,
            ..
        } = self;
        let fit = self.fit.as_ref().map(|shown| shown.fitting.status());
        let of_fit = fit
            .filter(|fit| fit.stage != Stage::Ended)
            .map(|fit| (if fit.stage == Stage::Running { "fitting" } else { fit.doing }, fit.share()));
        let read = self.open_files.read();
        let files = &app.state.files;
        // While another region is being found, the volume still has the one before.
        let is_read = read.has_volume_of(files) && read.region() == files.region();
        let split = app.state.split;
        let depth = |place: DVec2| canvas.depth_at(place, split);
        let sample = |at_mm| data.sample(Subject::Splats, at_mm);
        let sample_beside = |at_mm| data.sample(Subject::Beside, at_mm);
        let sample_whole = |at_mm| data.sample_whole(at_mm);
        let info = PanelInfo {
            bounds: canvas.bounds(),
            range: *range,
            unit: data.unit().text(),
            oriented: data.oriented(),
            splats: data.shown_splats().map(|splats| splats.set.count()),
            kind: data.set(Subject::Splats).map(SplatKind::of),
            has_region: data.set(Subject::Splats).is_some_and(|set| set.region.is_some()),
            sigma_mm: canvas.splats_of(Subject::Splats).map(|splats| splats.sigma_mm),
            deleted: data.deleted_count(),
            beside: data.has(Subject::Beside),
            volume: data.has(Subject::Volume),
            object_splats,
            object_intensities: data.remaining_splats().map_or(&[], |splats| &splats.intensities),
            splat_histogram: data.splat_histogram.as_ref().filter(|_| data.fitted.is_none()),
            volume_histogram: data.volume_histogram.as_ref(),
            error: data.error(),
            error_shown: self.error_shown,
            fitted: data.fitted.is_some(),
            fit,
            region: data.volume.as_ref().filter(|_| is_read).and_then(|volume| volume.size),
            volume_bounds: data.volume_bounds(),
            data: *data_number,
            draft: *draft,
            thumbnails: Some(thumbnails),
            statistics,
            progress: loader.doing().or(of_fit),
            depth: &depth,
            sample: &sample,
            sample_beside: &sample_beside,
            sample_whole: &sample_whole,
        };
        let output = context.run_ui(input, |ui| actions = app.ui(ui, &info));
        (output, actions)
    }

    /// Carries out what only the window can do. Returns true if the program is to end.
    fn act(&mut self, action: Action, canvas: &mut Canvas) -> Result<bool> {
        match action {
            Action::Quit => return Ok(true),
            Action::WantThumbnails => self.thumbnails.wanted = true,
            Action::Open(paths) => match self.open(&paths) {
                Ok(gone) => self.forget(canvas, gone)?,
                Err(error) => self.app.report(&error),
            },
            Action::Beside(path) => self.open_beside(path),
            Action::CloseBeside => self.forget(canvas, vec![Subject::Beside])?,
            Action::Region(region) => {
                self.app.state.files.set_region(region);
                self.read_files();
            }
            Action::AskSeries => self.loader.list_series(&self.app.state.files),
            Action::ReadFiles => {
                self.open_files.ask(self.app.state.files.volume.as_slice());
                self.read_files();
            }
            Action::Screenshot { path, options, force } => {
                self.export(canvas, path, options, move |export, path, _| export.still(path, force));
            }
            Action::Record { path, options, frames, force } => {
                self.export(canvas, path, options, move |export, path, progress| {
                    export.turntable(path, frames, force, progress)
                });
            }
            Action::SaveSplats { path, object, force } => self.save_splats(canvas, path, object, force),
            Action::Share { path, title, force } => self.share(canvas, path, title, force),
            Action::Pack { path, force } => self.pack(path, force),
            Action::BeginSession => {
                if let Some((state, session)) = self.app.take_found() {
                    let gone = self.begin_session(state, session);
                    self.forget(canvas, gone)?;
                }
            }
            other => self.act_on_fit(other, canvas)?,
        }
        Ok(false)
    }
}
