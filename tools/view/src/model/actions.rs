//! Actions of the viewer, asked for by a key, a menu or a script.

use std::path::PathBuf;

use egui::{Key, KeyboardShortcut, Modifiers};

use crate::model::deletions::Target;
use crate::model::orbit::Side;
use crate::model::picture_options::PictureOptions;
use crate::model::region::Region;

/// One action. [`crate::App::act`] carries out what concerns the state, and hands on what concerns files and
/// the window.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// Asks for a file to open.
    AskOpen,
    /// Asks for a folder of DICOM slices to open.
    AskOpenFolder,
    /// Opens splats, a volume, a mask or a session; carried out by the window.
    Open(Vec<PathBuf>),
    /// Asks for splats to open beside the others.
    AskBeside,
    /// Opens splats beside the others; carried out by the window.
    Beside(PathBuf),
    /// Closes the splats beside the others; carried out by the window.
    CloseBeside,
    /// Asks which series of the volume's folder is meant; carried out by the window, which lists them first.
    AskSeries,
    /// Takes a series of those that were listed, by its number.
    Series(usize),
    /// Reads the files of the state that are not open yet; carried out by the window.
    ReadFiles,
    /// Asks for the path of the session file.
    AskSave,
    /// Writes the session file.
    Save {
        /// Path, which ends in `.toml`.
        path: PathBuf,
        /// True if an existing file is replaced.
        force: bool,
    },
    /// Asks for the zip of the session and its files.
    AskPack,
    /// Writes the session and its files into a zip; carried out by the window.
    Pack {
        /// Path, which ends in `.zip`.
        path: PathBuf,
        /// True if an existing file is replaced.
        force: bool,
    },
    /// Asks where a missing file of a session is.
    AskFound(PathBuf),
    /// Takes a file for the one that is missing.
    Found(PathBuf),
    /// Opens the session without the files that are missing.
    LeaveOutMissing,
    /// Opens the session whose missing files were found or left out; carried out by the window.
    BeginSession,
    /// Asks for the file of the splats that are shown.
    AskSaveSplats,
    /// Asks for the file of the splats of one object.
    AskSaveObject(Target),
    /// Writes the splats that are shown; carried out by the window.
    SaveSplats {
        /// Path, whose extension chooses the format.
        path: PathBuf,
        /// The object that is written alone; `None` for all that are shown.
        object: Option<Target>,
        /// True if an existing file is replaced.
        force: bool,
    },
    /// Asks for title and file of a page of what is shown.
    AskShare,
    /// Writes what is shown as a page; carried out by the window.
    Share {
        /// Path, which ends in `.html`.
        path: PathBuf,
        /// Title of the page; empty for one that its objects name.
        title: String,
        /// True if an existing file is replaced.
        force: bool,
    },
    /// Asks for size and name of a picture.
    AskScreenshot,
    /// Renders and writes a picture; carried out by the window.
    Screenshot {
        /// Path, whose extension chooses the format.
        path: PathBuf,
        /// Size, background, and whether it tells what the window does.
        options: PictureOptions,
        /// True if an existing file is replaced.
        force: bool,
    },
    /// Asks for size, frames and name of a turntable.
    AskRecord,
    /// Renders and writes a full turn about the body's axis through the pivot; carried out by the window.
    Record {
        /// Path of the animated PNG.
        path: PathBuf,
        /// Size, background, and whether it tells what the window does.
        options: PictureOptions,
        /// Number of frames of the turn.
        frames: u32,
        /// True if an existing file is replaced.
        force: bool,
    },
    /// Asks for a transfer function's file.
    AskTransfer,
    /// Takes a transfer function: a preset, a window or a file, as `--tf` takes it.
    Transfer(String),
    /// Asks for the thumbnails of presets, of which a list is open; carried out by the window, one a frame.
    WantThumbnails,
    /// Asks for the path of the transfer function's file.
    AskSaveTransfer,
    /// Writes the transfer function.
    SaveTransfer {
        /// Path, which ends in `.vp.json`.
        path: PathBuf,
        /// True if an existing file is replaced.
        force: bool,
    },
    /// Opens or closes the panel of fits.
    ToggleFit,
    /// Asks for the mask of the region.
    AskMask,
    /// Takes a mask for the region in the panel of fits.
    Mask(PathBuf),
    /// Replaces the region of the volume; carried out by the window.
    Region(Option<Region>),
    /// Begins a fit of the volume's region; carried out by the window.
    StartFit {
        /// Name of the profile.
        profile: &'static str,
        /// Name of the quality.
        quality: &'static str,
    },
    /// Stops the fit, and keeps the splats so far; carried out by the window.
    StopFit,
    /// Asks for the file of the fitted splats.
    AskKeep,
    /// Writes the fitted splats and opens their file; carried out by the window.
    Keep {
        /// Path, whose extension chooses the format.
        path: PathBuf,
        /// True if an existing file is replaced.
        force: bool,
    },
    /// Drops the fitted splats; carried out by the window.
    DiscardFit,
    /// Ends the program, unless a fit or changes of the session would be lost, which is asked about first;
    /// carried out by the window.
    Quit,
    /// Goes undo the last step.
    Undo,
    /// Goes redo the last step.
    Redo,
    /// Shows the next of the subjects that are there: splats, those beside them, the volume.
    Flip,
    /// Shows both side by side, or one alone again.
    Split,
    /// Shows or hides the slices beside the picture.
    ToggleSlices,
    /// Chooses the next mode of splats.
    NextMode,
    /// Chooses the next preset of the transfer function.
    NextPreset,
    /// Chooses the previous preset of the transfer function.
    PreviousPreset,
    /// Moves the camera so that it sees all of the scene.
    SeeAll,
    /// Turns the camera to look from a side.
    View(Side),
    /// Turns the camera by azimuth and elevation, degrees.
    Turn([f64; 2]),
    /// Starts or ends the tool that measures distances.
    Measure,
    /// Switches the clip plane on or off; the first time adds one that halves the scene across the view.
    Clip,
    /// Switches the crop box on or off; the first time adds the box around the scene.
    Crop,
    /// Deletes the splats inside of the crop box.
    DeleteInside,
    /// Deletes the splats outside of the crop box.
    DeleteOutside,
    /// Ends the tool and closes what is open.
    Cancel,
    /// Shows or hides the panels.
    TogglePanels,
    /// Shows or hides frame times.
    ToggleOverlay,
    /// Shows or hides letters and scale bar.
    ToggleAnnotations,
    /// Shows or hides the handles of clip planes and crop box.
    ToggleHandles,
    /// Opens or closes the list of keys.
    ToggleKeys,
    /// Opens or closes the list of messages.
    ToggleMessages,
}

/// Row of [`KEYS`].
pub struct Binding {
    /// The key with its modifiers; the command key is Ctrl except on a Mac.
    pub key: KeyboardShortcut,
    /// Name in menus.
    pub name: &'static str,
    /// Explanation for the list of keys.
    pub help: &'static str,
    /// Action of the key.
    pub action: Action,
}

const fn row(
    modifiers: Modifiers,
    key: Key,
    name: &'static str,
    help: &'static str,
    action: Action,
) -> Binding {
    Binding { key: KeyboardShortcut::new(modifiers, key), name, help, action }
}

const NONE: Modifiers = Modifiers::NONE;
const COMMAND: Modifiers = Modifiers::COMMAND;
const COMMAND_SHIFT: Modifiers = Modifiers::COMMAND.plus(Modifiers::SHIFT);
/// Angle by which a press of an arrow key turns, degrees.
const TURN: f64 = 5.0;

/// All keys. Of two rows with the same key the one with more modifiers comes first.
pub static KEYS: &[Binding] = &[
    row(
        COMMAND_SHIFT,
        Key::O,
        "Open folder…",
        "open a folder of DICOM slices as a scan",
        Action::AskOpenFolder,
    ),
    row(COMMAND, Key::O, "Open…", "open splats, a volume, a mask or a session", Action::AskOpen),
    row(COMMAND_SHIFT, Key::B, "Close beside", "close the splats being compared", Action::CloseBeside),
    row(
        COMMAND,
        Key::B,
        "Open beside…",
        "open splats to compare with those that are open",
        Action::AskBeside,
    ),
    row(COMMAND, Key::D, "Choose series…", "another series of the volume's DICOM folder", Action::AskSeries),
    row(
        COMMAND_SHIFT,
        Key::S,
        "Pack session…",
        "write the session and all its files into one zip, to send",
        Action::AskPack,
    ),
    row(COMMAND, Key::S, "Save session…", "write all settings of this window to a file", Action::AskSave),
    row(
        COMMAND_SHIFT,
        Key::E,
        "Share as a page…",
        "write what is shown as a page that any browser opens",
        Action::AskShare,
    ),
    row(COMMAND, Key::E, "Save splats…", "write the splats that are shown to a file", Action::AskSaveSplats),
    row(COMMAND, Key::P, "Screenshot…", "write a picture of any size", Action::AskScreenshot),
    row(COMMAND, Key::R, "Record turntable…", "write a full turn as an animation", Action::AskRecord),
    row(
        COMMAND,
        Key::T,
        "Open transfer function…",
        "load colours and opacities from a file",
        Action::AskTransfer,
    ),
    row(COMMAND, Key::Q, "Quit", "end the program", Action::Quit),
    row(NONE, Key::G, "Fit splats", "choose a region of the volume and fit splats to it", Action::ToggleFit),
    row(COMMAND_SHIFT, Key::Z, "Redo", "redo the last step", Action::Redo),
    row(COMMAND, Key::Z, "Undo", "undo the last step", Action::Undo),
    row(COMMAND, Key::Y, "Redo", "redo the last step", Action::Redo),
    row(
        NONE,
        Key::Space,
        "Flip",
        "switch between the splats, those beside them and the volume",
        Action::Flip,
    ),
    row(
        NONE,
        Key::B,
        "Both",
        "splats side by side with those beside them, or with the volume",
        Action::Split,
    ),
    row(NONE, Key::V, "Slices", "axial, coronal and sagittal slices on or off", Action::ToggleSlices),
    row(NONE, Key::M, "Next mode", "next render mode", Action::NextMode),
    row(NONE, Key::PageDown, "Next preset", "next transfer function", Action::NextPreset),
    row(NONE, Key::PageUp, "Previous preset", "previous transfer function", Action::PreviousPreset),
    row(NONE, Key::F, "Whole scene", "show all of the scene", Action::SeeAll),
    row(NONE, Key::A, "Anterior", "look from the front", Action::View(Side::Anterior)),
    row(NONE, Key::P, "Posterior", "look from the back", Action::View(Side::Posterior)),
    row(NONE, Key::L, "Left", "look from the patient's left", Action::View(Side::Left)),
    row(NONE, Key::R, "Right", "look from the patient's right", Action::View(Side::Right)),
    row(NONE, Key::S, "Superior", "look from the head", Action::View(Side::Superior)),
    row(NONE, Key::I, "Inferior", "look from the feet", Action::View(Side::Inferior)),
    row(NONE, Key::ArrowLeft, "Turn left", "turn the camera", Action::Turn([-TURN, 0.0])),
    row(NONE, Key::ArrowRight, "Turn right", "turn the camera", Action::Turn([TURN, 0.0])),
    row(NONE, Key::ArrowUp, "Turn up", "turn the camera", Action::Turn([0.0, TURN])),
    row(NONE, Key::ArrowDown, "Turn down", "turn the camera", Action::Turn([0.0, -TURN])),
    row(NONE, Key::D, "Measure", "distance between two points", Action::Measure),
    row(NONE, Key::C, "Clip plane", "clip plane on or off", Action::Clip),
    row(NONE, Key::X, "Crop box", "crop box on or off", Action::Crop),
    row(
        COMMAND,
        Key::Delete,
        "Delete outside",
        "delete the splats outside of the crop box",
        Action::DeleteOutside,
    ),
    row(NONE, Key::Delete, "Delete inside", "delete the splats inside of the crop box", Action::DeleteInside),
    row(NONE, Key::H, "Handles", "handles of plane and box on or off", Action::ToggleHandles),
    row(
        NONE,
        Key::T,
        "Annotations",
        "orientation letters, scale bar, colour bar and cube on or off",
        Action::ToggleAnnotations,
    ),
    row(NONE, Key::O, "Frame times", "frame times, passes and memory", Action::ToggleOverlay),
    row(NONE, Key::F2, "Panels", "panels on or off", Action::TogglePanels),
    row(NONE, Key::Escape, "Cancel", "put the tool away, close what is open", Action::Cancel),
    row(NONE, Key::N, "Messages", "the messages of this session", Action::ToggleMessages),
    row(NONE, Key::Questionmark, "Keys", "this list", Action::ToggleKeys),
    row(NONE, Key::F1, "Keys", "this list", Action::ToggleKeys),
];

/// Returns the first row with this action.
pub fn binding(action: &Action) -> Option<&'static Binding> {
    KEYS.iter().find(|row| row.action == *action)
}

/// Takes the keys in [`KEYS`] that were pressed out of the input and returns their actions in order. If a
/// widget has the `focus`, arrows, the space bar and Delete are left to it.
pub fn pressed(input: &mut egui::InputState, focus: bool) -> Vec<Action> {
    let own = [Key::ArrowLeft, Key::ArrowRight, Key::ArrowUp, Key::ArrowDown, Key::Space, Key::Delete];
    let mut actions = Vec::new();
    input.events.retain(|event| {
        let egui::Event::Key { key, modifiers, pressed: true, .. } = event else { return true };
        let is_pressed =
            |row: &&Binding| row.key.logical_key == *key && modifiers.matches_logically(row.key.modifiers);
        let row = KEYS.iter().find(is_pressed).filter(|_| !(focus && own.contains(key)));
        actions.extend(row.map(|row| row.action.clone()));
        row.is_none()
    });
    actions
}

#[cfg(test)]
mod tests {
    use egui::{Context, Event, RawInput};

    use super::*;

    fn press(modifiers: Modifiers, key: Key, focus: bool) -> Vec<Action> {
        press_all(&[(modifiers, key)], focus)
    }

    /// Returns all between two frames.
    fn press_all(keys: &[(Modifiers, Key)], focus: bool) -> Vec<Action> {
        let events = keys.iter().flat_map(|&(modifiers, key)| {
            let event = Event::Key { key, physical_key: None, pressed: true, repeat: false, modifiers };
            [Event::ModifiersChanged(modifiers), event]
        });
        let input = RawInput { events: events.collect(), ..RawInput::default() };
        let mut found = Vec::new();
        let context = Context::default();
        let output = context.run_ui(input, |ui| found.extend(ui.input_mut(|i| pressed(i, focus))));
        output.drop_without_applying_deltas();
        found
    }

    #[test]
    fn each_key_does_what_its_row_says() {
        for row in KEYS {
            let found = press(row.key.modifiers, row.key.logical_key, false);
            assert!(found.len() == 1 && found[0] == row.action, "{}: {found:?}", row.name);
        }
        assert_eq!(press(NONE, Key::F35, false), []);
        assert_eq!(
            press(Modifiers::SHIFT, Key::Questionmark, false),
            [Action::ToggleKeys],
            "as on most keyboards"
        );
        assert_eq!(press(NONE, Key::Space, true), []);
        assert_eq!(press(NONE, Key::Delete, true), [], "a point of the editor may be meant");
        assert_eq!(press(NONE, Key::F, true), [Action::SeeAll]);
        let both = [(NONE, Key::Escape), (COMMAND, Key::S)];
        assert_eq!(press_all(&both, false), [Action::Cancel, Action::AskSave], "in their order");
    }

    #[test]
    fn no_key_is_given_twice() {
        for (i, a) in KEYS.iter().enumerate() {
            for b in &KEYS[i + 1..] {
                assert!(a.key != b.key, "{} and {}", a.name, b.name);
            }
        }
    }
}
