//! The viewer without its window: state, panels, and what the mouse and the keys do.
//!
//! Each frame the window calls [`App::ui`] within egui's pass and carries out the actions that it returns.
//! Then it asks [`App::take_changes`] what has to be rendered anew, for [`App::picture`], with
//! [`App::camera`] and the state's look.

use std::path::PathBuf;

use egui::{CentralPanel, CollapsingHeader, Panel, Rect, ScrollArea, Ui};
use engine::error::{Error, Result};
use engine::render::{Camera, UsualLook};
use engine::transfer::PRESETS;
use glam::DVec3;

use super::drag::Drag;
use super::held_keys::HeldKeys;
use crate::model::actions::{Action, pressed};
use crate::model::history::History;
use crate::model::panel_info::{Measured, PanelInfo};
use crate::model::series::Series;
use crate::model::settings::Settings;
use crate::model::state::{Bookmark, Edited, Object, ViewState, is_session};
use crate::model::system_dialog::SystemDialog;
use crate::model::transfer::Transfer;
use crate::panels::editor::Editor;
use crate::panels::messages::{Message, Messages};
use crate::panels::missing::{self, Missing};
use crate::panels::notice::{Leaving, Loss};
use crate::panels::prompt::{Asked, Prompt, Purpose};
use crate::panels::series::{Choice, SeriesPictures};
use crate::panels::status::Reading;
use crate::panels::{self, fit::FitForm, menu::Menus, slices::SliceImages};

/// Least and greatest width of the panels at the side, points of the screen.
const PANEL: [f32; 2] = [384.0, 640.0];

/// Least and greatest width of the slices, points of the screen.
const SLICES: [f32; 2] = [240.0, 720.0];

/// Parts of the state that have changed since the last call of [`App::take_changes`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Changes {
    /// True if the camera has changed.
    pub camera: bool,
    /// True if the look has changed ([`ViewState::look`]): transfer function, objects or clip planes.
    pub look: bool,
    /// True if the mode, what is shown, the split, the background or the quality has changed.
    pub rendering: bool,
}

impl Changes {
    /// Returns true if the picture must be rendered anew.
    pub fn any(self) -> bool {
        self.camera || self.look || self.rendering
    }
}

/// The viewer without its window.
pub struct App {
    /// Everything that is shown; the session.
    pub state: ViewState,
    /// Settings that are kept from start to start.
    pub settings: Settings,
    pub(super) editor: Editor,
    pub(super) slice_images: SliceImages,
    pub(super) fit_form: FitForm,
    pub(super) history: History<Edited>,
    /// State when the changes were last taken.
    pub(super) taken: ViewState,
    /// True if the camera is to see the whole scene as soon as there is one.
    pub(super) frame_all: bool,
    /// `Some` while distances are measured; within it the first point of a distance, mm RAS, if it was
    /// clicked.
    pub(super) measuring: Option<Option<DVec3>>,
    pub(super) keys: bool,
    /// What would lose something, while the user is asked whether to do it.
    pub(super) leaving: Option<Action>,
    /// What is done once the session is saved, while the user is asked for its file.
    pub(super) saves_to_leave: Option<Action>,
    /// File of the session that was opened or saved last.
    pub(super) session: Option<PathBuf>,
    /// What the session file has of what the user changes, as it was last opened or saved.
    pub(super) saved: (Edited, Vec<Bookmark>),
    /// Transfer function and objects as the program has given them; `None` once a user has said how things look.
    pub(super) given: Option<(Transfer, Vec<Object>)>,
    /// Series of which one is to be chosen.
    pub(super) series: Option<Series>,
    /// Pictures of their slices.
    pub(super) series_pictures: SeriesPictures,
    /// Session that is opened once its missing files are found or left out.
    pub(super) missing: Option<Missing>,
    pub(super) messages: Messages,
    /// Question that our own dialog shows.
    pub(super) prompt: Option<Prompt>,
    /// Dialog of the desktop; `None` where there is none.
    pub system_dialog: Option<SystemDialog>,
    /// Question that the dialog of the desktop shows.
    pub(super) asked: Option<Asked>,
    /// Target that is dragged while a button is down.
    pub(super) grip: Option<Drag>,
    pub(super) picture: Rect,
    pub(super) pixels_per_point: f32,
    pub(super) held: bool,
    pub(super) held_keys: HeldKeys,
    pub(super) reading: Option<Reading>,
}

impl App {
    /// Creates a viewer of this state, which may be that of the file `session`. The camera of a session stays;
    /// without a session the scene is fitted once it is there.
    pub fn new(state: ViewState, session: Option<PathBuf>, settings: Settings) -> Self {
        App {
            editor: Editor::default(),
            slice_images: SliceImages::default(),
            fit_form: FitForm::default(),
            history: History::new(state.edited()),
            taken: state.clone(),
            frame_all: false,
            saved: (state.edited(), state.bookmarks.clone()),
            given: session.is_none().then(|| (state.transfer.clone(), state.objects.clone())),
            state,
            settings,
            measuring: None,
            keys: false,
            leaving: None,
            saves_to_leave: None,
            session,
            series: None,
            series_pictures: SeriesPictures::default(),
            missing: None,
            messages: Messages::default(),
            prompt: None,
            system_dialog: None,
            asked: None,
            grip: None,
            picture: Rect::NOTHING,
            pixels_per_point: 1.0,
            held: false,
            held_keys: HeldKeys::default(),
            reading: None,
        }
    }

    /// Replaces the state by that of a session file. Undo does not lead back.
    pub fn begin(&mut self, state: ViewState, session: Option<PathBuf>) {
        self.session = session;
        self.history.restart(state.edited());
        self.state = state;
        self.frame_all = false;
        self.given = None;
        self.note_saved();
    }

    /// Keeps the transfer function and the objects as they are, since a user has asked for them.
    pub fn keep_look(&mut self) {
        self.given = None;
    }

    /// Changes the state unasked, as after files were read. `change` is told whether transfer function and objects are
    /// still as the program has given them; if they are, those that it makes count as given, too.
    pub fn change_given(&mut self, change: impl FnOnce(&mut ViewState, bool)) {
        let look = |state: &ViewState| (state.transfer.clone(), state.objects.clone());
        let untouched = self.given.as_ref().is_some_and(|given| *given == look(&self.state));
        self.change_unasked(|state| change(state, untouched));
        self.given = untouched.then(|| look(&self.state));
    }

    /// Takes the list of objects that files have, with the usual look of them and of the scene as long as nobody has said
    /// how they look; `more` is changed with them.
    pub fn take_objects(
        &mut self,
        found: Vec<Object>,
        usual: Option<&UsualLook>,
        more: impl FnOnce(&mut ViewState),
    ) {
        self.change_given(|state, untouched| {
            let others = state.set_objects(found);
            let fits = |usual: &&UsualLook| untouched && others && usual.objects.len() == state.objects.len();
            if let Some(usual) = usual.filter(fits) {
                state.take_usual_look(usual);
            }
            more(state);
        });
    }

    pub(super) fn note_saved(&mut self) {
        self.saved = (self.state.edited(), self.state.bookmarks.clone());
    }

    /// Returns true if the user has changed the session since it was opened or saved; the camera does not count.
    pub fn is_changed(&self) -> bool {
        let (edited, bookmarks) = &self.saved;
        !self.state.is_edited_as(edited) || self.state.bookmarks != *bookmarks
    }

    /// Changes the state without the user, as when files were read: that alone need not be saved.
    pub fn change_unasked(&mut self, change: impl FnOnce(&mut ViewState)) {
        let was_changed = self.is_changed();
        change(&mut self.state);
        if !was_changed {
            self.note_saved();
        }
    }

    /// Forgets the textures of a device that is gone; they are made anew for the next one.
    pub fn forget_textures(&mut self) {
        self.slice_images = SliceImages::default();
        self.series_pictures.clear();
    }

    /// Moves the camera to see the whole scene in the next frame that knows its bounds.
    pub fn frame_all_soon(&mut self) {
        self.frame_all = true;
    }

    /// Returns the place of the picture, in points of the screen.
    pub fn picture(&self) -> Rect {
        self.picture
    }

    /// Returns the width over height of the picture.
    pub fn aspect(&self) -> f64 {
        let size = self.picture.size();
        let aspect = f64::from(size.x) / f64::from(size.y);
        if aspect.is_finite() && aspect > 0.0 { aspect } else { 1.0 }
    }

    /// Returns the camera of the picture.
    pub fn camera(&self) -> Camera {
        self.state.orbit.camera(self.aspect())
    }

    /// Returns true if a button or key is held, so that changes will go on.
    pub fn held(&self) -> bool {
        self.held
    }

    /// Returns true if a button is held and no key.
    pub fn drags(&self) -> bool {
        self.held && !self.held_keys.any()
    }

    /// Returns what has changed since the last call, whatever changed it.
    pub fn take_changes(&mut self) -> Changes {
        let (new, old) = (&self.state, &self.taken);
        let changes = Changes {
            camera: new.orbit != old.orbit,
            look: (&new.transfer, new.light, &new.clip, &new.objects, new.errors)
                != (&old.transfer, old.light, &old.clip, &old.objects, old.errors),
            rendering: (new.shown, new.mode, new.split, new.background, new.edges, new.quality)
                != (old.shown, old.mode, old.split, old.background, old.edges, old.quality),
        };
        if changes.any() {
            self.taken = self.state.clone();
        }
        changes
    }

    /// Asks whether to end although something would be lost.
    pub fn ask_to_leave(&mut self) {
        self.end_questions();
        self.leaving = Some(Action::Quit);
    }

    /// Asks which of several series is meant.
    pub fn ask_series(&mut self, series: Series) {
        self.end_questions();
        self.series = Some(series);
        self.series_pictures.clear();
    }

    /// Asks where files of a session are that are not where it says.
    pub fn ask_missing(&mut self, state: ViewState, session: PathBuf) {
        self.end_questions();
        self.missing = Some(Missing::new(state, session));
    }

    /// Takes the session, with its file, whose missing files were found or left out.
    pub fn take_found(&mut self) -> Option<(ViewState, PathBuf)> {
        self.missing.take().map(|missing| (missing.state, missing.session))
    }

    /// Reports an error to the user.
    pub fn report(&mut self, error: &Error) {
        tracing::warn!("{error} [{}]", error.code);
        self.messages.tell(error.into());
    }

    /// Tells the user that something is done.
    pub fn done(&mut self, text: impl Into<String>) {
        self.messages.tell(Message { text: text.into(), help: String::new(), bad: false });
    }

    /// Lays out a frame and does what the user asks; returns the actions that only the window can carry out.
    pub fn ui(&mut self, ui: &mut Ui, info: &PanelInfo<'_>) -> Vec<Action> {
        let mut actions = Vec::new();
        let dropped: Vec<_> = ui.input(|i| i.raw.dropped_files.iter().map(|f| f.path().to_owned()).collect());
        if !dropped.is_empty() {
            actions.push(Action::Open(dropped));
        }
        self.frame(ui, info, &mut actions);
        let context = ui.ctx().clone();
        self.windows(&context, info, &mut actions);
        // By now widgets have taken their input. An open question has to be answered first.
        let asks = self.prompt.is_some()
            || self.series.is_some()
            || self.missing.is_some()
            || self.leaving.is_some()
            || !self.settings.notice_seen;
        if !asks && !context.text_edit_focused() {
            let focus = context.egui_wants_keyboard_input();
            actions.extend(context.input_mut(|i| pressed(i, focus)));
        }
        let left = actions.into_iter().filter_map(|action| self.act(action, info)).collect();
        self.held = context.input(|i| {
            self.held_keys.follow(&i.raw);
            i.pointer.any_down() || self.held_keys.any()
        });
        self.remember(self.held || context.text_edit_focused());
        left
    }

    /// Records changes as a step of the history, unless something is held. Opened files begin a new history.
    fn remember(&mut self, held: bool) {
        let edited = self.state.edited();
        if edited.has_objects_of(self.history.now()) {
            self.history.observe(&edited, held);
        } else {
            self.history.restart(edited);
        }
    }

    /// Returns what would be lost by an action.
    pub(super) fn loss(&self, action: &Action, info: &PanelInfo<'_>) -> Loss {
        let ends = *action == Action::Quit;
        let begins = matches!(action, Action::Open(paths) if paths.iter().any(|path| is_session(path)));
        Loss { fit: ends && info.fit.is_some(), session: (ends || begins) && self.is_changed() }
    }

    pub(super) fn report_outcome(&mut self, result: Result<()>, what: impl FnOnce() -> String) {
        match result {
            Ok(()) => self.done(what()),
            Err(error) => self.report(&error),
        }
    }

    pub(super) fn take_transfer(&mut self, name: &str, info: &PanelInfo<'_>) {
        match engine::transfer::load(name, info.range) {
            Ok(function) => self.state.edit_transfer(|state| state.transfer = Transfer::new(&function)),
            Err(error) => self.report(&error),
        }
    }

    pub(super) fn step_preset(&mut self, by: usize, info: &PanelInfo<'_>) {
        let at = PRESETS.iter().position(|p| p.name == self.state.transfer.name);
        let next = at.map_or(0, |at| (at + by) % PRESETS.len());
        let next = Transfer::new(&PRESETS[next].over(info.range));
        self.state.edit_transfer(|state| state.transfer = next);
    }

    /// Lays out menus, panels, status line and the picture between them.
    fn frame(&mut self, ui: &mut Ui, info: &PanelInfo<'_>, actions: &mut Vec<Action>) {
        if self.state.show.panels {
            Panel::top("menus").show(ui, |ui| {
                let menus = Menus {
                    recent: &self.settings.recent,
                    can_undo: self.history.can_undo(),
                    can_redo: self.history.can_redo(),
                    can_fit: info.volume,
                    has_data: self.state.files.all().next().is_some(),
                    has_files: !self.state.files.splats.is_empty(),
                    has_beside: self.state.files.beside.is_some(),
                    has_series: self.state.files.may_have_series(),
                    has_splats: info.splats.is_some_and(|count| count > 0) && !info.fitted,
                };
                panels::menu::show(ui, &menus, actions);
            });
            Panel::bottom("status").show(ui, |ui| {
                let pixels = f64::from(self.picture.height() * ui.pixels_per_point());
                let scale = info.bounds.map(|_| self.state.orbit.height_mm() / pixels);
                let told = self.messages.count();
                panels::status::show(ui, &self.state, info, self.reading.as_ref(), scale, told, actions);
            });
            // In a narrow window the panels would leave no room for the picture.
            if ui.available_width() >= 1.5 * PANEL[0] {
                Panel::right("panels").default_size(PANEL[0]).size_range(PANEL[0]..=PANEL[1]).show(
                    ui,
                    |ui| {
                        ScrollArea::vertical()
                            .auto_shrink(false)
                            .show(ui, |ui| self.sections(ui, info, actions));
                    },
                );
            }
        }
        if self.state.slices.shown && ui.available_width() >= 1.5 * SLICES[0] {
            let shade = self.fit_form.shade(&self.state.files, info);
            let (errors, slices, images) =
                (self.state.errors, &mut self.state.slices, &mut self.slice_images);
            Panel::left("slices")
                .default_size(SLICES[0])
                .size_range(SLICES[0]..=SLICES[1])
                .show(ui, |ui| panels::slices::show(ui, slices, images, info, shade, errors));
        }
        CentralPanel::no_frame().show(ui, |ui| self.central(ui, info, actions));
    }

    fn sections(&mut self, ui: &mut Ui, info: &PanelInfo<'_>, actions: &mut Vec<Action>) {
        let state = &mut self.state;
        let section = |name: &str, open: bool| CollapsingHeader::new(name).default_open(open);
        let form = &mut self.fit_form;
        form.follow(&state.files);
        if info.volume || info.fit.is_some() {
            let settings = &self.settings;
            let times =
                |profile: &str, quality: &str, voxels| settings.seconds_of_fit(profile, quality, voxels);
            let header = CollapsingHeader::new("Fit")
                .open(Some(form.open))
                .show_unindented(ui, |ui| panels::fit::show(ui, form, &state.files, info, &times, actions));
            if header.header_response.clicked() {
                actions.push(Action::ToggleFit);
            }
        }
        section("Objects", true)
            .show_unindented(ui, |ui| panels::objects::show(ui, state, info, Some(&mut *actions)));
        if !matches!(info.error, Measured::Nothing) {
            section("Error", true).show_unindented(ui, |ui| panels::error::show(ui, state, info));
        }
        section("Transfer function", true)
            .show_unindented(ui, |ui| panels::transfer::show(ui, state, &mut self.editor, info, actions));
        section("Quality", true).show_unindented(ui, |ui| panels::quality::show(ui, state, info, actions));
        section("Camera", false).show_unindented(ui, |ui| panels::camera::show(ui, state, actions));
        section("Clipping", false).show_unindented(ui, |ui| panels::clip::show(ui, state, info, actions));
        let measuring = self.measuring.is_some();
        section("Distances", false)
            .show_unindented(ui, |ui| panels::measure::show(ui, state, measuring, actions));
    }

    /// Shows the windows over everything else.
    fn windows(&mut self, context: &egui::Context, info: &PanelInfo<'_>, actions: &mut Vec<Action>) {
        self.show_question(context, actions);
        let pictures = &mut self.series_pictures;
        match self.series.as_ref().and_then(|series| panels::series::show(context, series, pictures)) {
            None => {}
            Some(Choice::Number(number)) => actions.push(Action::Series(number)),
            Some(Choice::Cancel) => self.series = None,
        }
        let asked = self.missing.as_ref().filter(|_| self.prompt.is_none() && self.asked.is_none());
        match asked.and_then(|asked| missing::show(context, asked)) {
            None => {}
            Some(missing::Choice::Find(path)) => actions.push(Action::AskFound(path)),
            Some(missing::Choice::LeaveOut) => actions.push(Action::LeaveOutMissing),
            Some(missing::Choice::Cancel) => self.missing = None,
        }
        if context.input(|i| !i.raw.hovered_files.is_empty()) {
            panels::welcome::hovered(context, self.picture);
        }
        if self.state.show.overlay {
            panels::overlay::show(context, self.picture, info, self.state.quality.target_frame_ms);
        }
        if self.keys {
            panels::keys::show(context, &mut self.keys);
        }
        if let Some(action) = self.leaving.take() {
            let loss = self.loss(&action, info);
            let ends = action == Action::Quit;
            // What is no longer lost is no longer asked about.
            let answer =
                if loss.any() { panels::notice::leave(context, loss, ends) } else { Some(Leaving::Stay) };
            match answer {
                Some(Leaving::Stay) => {}
                Some(Leaving::Save) => {
                    self.end_questions();
                    self.ask(Purpose::Save);
                    self.saves_to_leave = Some(action);
                }
                answer => {
                    // The question was asked, so that the action is carried out.
                    if answer == Some(Leaving::Go) {
                        actions.push(action.clone());
                    }
                    self.leaving = Some(action);
                }
            }
        }
        self.messages.show(context, self.picture);
        if !self.settings.notice_seen && panels::notice::show(context) {
            self.settings.notice_seen = true;
            if let Err(error) = self.settings.write() {
                self.report(&error);
            }
        }
    }
}

#[cfg(test)]
#[path = "tests/app.rs"]
mod tests;
