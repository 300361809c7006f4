//! Asks for a file, with a list of its folder and settings for what is written.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use egui::{Context, DragValue, Id, Key, Modal, ScrollArea, TextEdit, Ui};

use crate::actions::Action;
use crate::deletions::Target;
use crate::panels::widgets::row;
use crate::state::Files;

/// Greatest number of entries of a folder that are listed.
const MOST: usize = 500;
/// Greatest width or height of a picture, pixels; every device can render it.
const WIDEST: u32 = 8192;

/// Purpose of a file that is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// The file is opened.
    Open,
    /// Splats are opened from it beside the others.
    Beside,
    /// The session is written to it.
    Save,
    /// A picture is written to it.
    Screenshot,
    /// A turntable is written to it.
    Record,
    /// A transfer function is read from it.
    Transfer,
    /// The transfer function is written to it.
    SaveTransfer,
    /// The mask of the region is read from it.
    Mask,
    /// The fitted splats are written to it.
    Keep,
    /// The splats that are shown are written to it.
    SaveSplats,
    /// The splats of one object are written to it.
    SaveObject(Target),
}

impl Purpose {
    /// Returns the title, the name of the button that confirms, and the extensions that are listed.
    fn words(self) -> (&'static str, &'static str, &'static [&'static str]) {
        const SPLATS: [&str; 4] = [".ply", ".vgs", ".spz", ".glb"];
        static DATA: LazyLock<Vec<&str>> =
            LazyLock::new(|| SPLATS.iter().chain(&[".toml"]).chain(VOLUMES.iter()).copied().collect());
        static VOLUMES: LazyLock<Vec<&str>> = LazyLock::new(|| {
            engine::volume::FORMATS.iter().flat_map(|format| format.extensions).copied().collect()
        });
        match self {
            Purpose::Open => ("Open splats, a volume, a mask or a session", "Open", DATA.as_slice()),
            Purpose::Beside => ("Open splats beside the others", "Open", SPLATS.as_slice()),
            Purpose::Save => ("Save the session", "Save", &[".toml"]),
            Purpose::Screenshot => ("Screenshot", "Write", &[".png", ".exr"]),
            Purpose::Record => ("Record a turntable", "Record", &[".png"]),
            Purpose::Transfer => {
                ("Open a transfer function", "Open", &[".vp.json", ".json", ".xml", ".mrml", ".vp"])
            }
            Purpose::SaveTransfer => ("Save the transfer function", "Save", &[".vp.json"]),
            Purpose::Mask => ("Open a mask or a label map", "Open", VOLUMES.as_slice()),
            Purpose::Keep => ("Keep the splats: .ply, or .vgs for a small file", "Keep", &[".ply", ".vgs"]),
            Purpose::SaveSplats => (
                "Save the splats that are shown: .ply, .vgs for a small file, .spz or .glb for viewers of colours",
                "Save",
                &SPLATS,
            ),
            Purpose::SaveObject(_) => (
                "Save this object: .ply, .vgs for a small file, .spz or .glb for viewers of colours",
                "Save",
                &SPLATS,
            ),
        }
    }

    /// Returns true if the file is written.
    fn writes(self) -> bool {
        !matches!(self, Purpose::Open | Purpose::Beside | Purpose::Transfer | Purpose::Mask)
    }

    /// Returns the suggested name of a new file.
    fn suggestion(self) -> &'static str {
        match self {
            Purpose::Open | Purpose::Beside | Purpose::Transfer | Purpose::Mask => "",
            Purpose::Save => "session.toml",
            Purpose::Screenshot => "picture.png",
            Purpose::Record => "turntable.png",
            Purpose::SaveTransfer => "transfer.vp.json",
            Purpose::Keep => "fit.ply",
            Purpose::SaveSplats => "splats.ply",
            Purpose::SaveObject(_) => "object.ply",
        }
    }
}

/// Open question for a file.
#[derive(Clone, Debug)]
pub struct Prompt {
    /// Purpose of the file.
    purpose: Purpose,
    path: String,
    size: [u32; 2],
    frames: u32,
    /// Folder that was listed last, and its entries; names of folders end in a slash.
    listed: Option<(PathBuf, Vec<String>)>,
    /// True until it was shown; then the path takes the keyboard focus.
    fresh: bool,
}

/// Result of showing a question.
#[derive(Clone, Debug, PartialEq)]
pub enum Answer {
    /// The question is still open.
    Open,
    /// The question was cancelled.
    Cancelled,
    /// The question was answered: this is to be done.
    Do(Action),
}

impl Prompt {
    /// Asks for a file, first in the folder of the files that are open; or for the file `known`, which it may be again.
    /// `size` is the suggested size of a picture, pixels.
    pub fn new(purpose: Purpose, files: &Files, known: Option<&Path>, size: [u32; 2]) -> Self {
        let near = files.splats.first().or(files.volume.as_ref()).and_then(|p| p.parent());
        let folder = near.filter(|p| p.is_dir()).map_or_else(std::env::current_dir, |p| Ok(p.to_owned()));
        let new = || folder.unwrap_or_default().join(purpose.suggestion());
        let path = known.map_or_else(new, Path::to_owned).to_string_lossy().into_owned();
        Prompt { purpose, path, size, frames: 120, listed: None, fresh: true }
    }

    /// Shows the question and returns the answer.
    pub fn show(&mut self, context: &Context) -> Answer {
        let modal = Modal::new(Id::new("prompt")).show(context, |ui| {
            ui.set_width(560.0);
            self.content(ui)
        });
        if modal.inner == Answer::Open && modal.should_close() { Answer::Cancelled } else { modal.inner }
    }

    fn content(&mut self, ui: &mut Ui) -> Answer {
        let (title, word, endings) = self.purpose.words();
        ui.heading(title);
        let id = ui.make_persistent_id("path");
        let field = ui.add(TextEdit::singleline(&mut self.path).id(id).desired_width(f32::INFINITY));
        if std::mem::take(&mut self.fresh) {
            field.request_focus();
        }
        let entered = field.lost_focus() && ui.input(|i| i.key_pressed(Key::Enter));
        let double = self.list(ui, endings);
        if matches!(self.purpose, Purpose::Screenshot | Purpose::Record) {
            self.sizes(ui);
        }
        let path = PathBuf::from(&self.path);
        let there = path.is_file();
        let force = there && self.purpose.writes();
        let good = if self.purpose.writes() { path.file_name().is_some() && !path.is_dir() } else { there };
        let mut answer = Answer::Open;
        ui.horizontal(|ui| {
            let word = if force { "Replace" } else { word };
            let done = ui.add_enabled(good, egui::Button::new(word)).clicked();
            // An existing file is replaced only by a click.
            if done || (good && !force && (entered || double)) {
                answer = Answer::Do(self.action(path.clone(), force));
            }
            if self.purpose == Purpose::Open && path.is_dir() {
                let button = ui.button("Open the folder");
                if button.on_hover_text("as a scan: all DICOM slices in it are one volume").clicked() {
                    answer = Answer::Do(self.action(path.clone(), false));
                }
            }
            if ui.button("Cancel").clicked() {
                answer = Answer::Cancelled;
            }
            if force {
                ui.colored_label(crate::theme::SIGNAL, "the file exists");
            } else if !good && !self.path.is_empty() && !path.is_dir() {
                ui.weak("there is no such file");
            }
        });
        answer
    }

    /// Lists the folder. Returns true if a file was double clicked.
    fn list(&mut self, ui: &mut Ui, endings: &[&str]) -> bool {
        let path = PathBuf::from(&self.path);
        let folder =
            if path.is_dir() { path.clone() } else { path.parent().map(Path::to_owned).unwrap_or_default() };
        if self.listed.as_ref().is_none_or(|(listed, _)| *listed != folder) {
            self.listed = Some((folder.clone(), entries(&folder, endings)));
        }
        let Some((_, names)) = &self.listed else { return false };
        let (mut chosen, mut double) = (None, false);
        ScrollArea::vertical().max_height(220.0).auto_shrink([false, true]).show(ui, |ui| {
            for name in std::iter::once("../").chain(names.iter().map(String::as_str)) {
                let here = path.file_name().is_some_and(|own| own.to_string_lossy() == name);
                let entry = ui.selectable_label(here, name);
                if entry.clicked() || entry.double_clicked() {
                    chosen = Some(name.to_owned());
                    double = entry.double_clicked() && !name.ends_with('/');
                }
            }
        });
        if let Some(name) = chosen {
            let next = match name.as_str() {
                "../" => folder.parent().map_or(folder.clone(), Path::to_owned),
                _ => folder.join(name.trim_end_matches('/')),
            };
            let keep = self.purpose.writes() && name.ends_with('/');
            let next = if keep { next.join(path.file_name().unwrap_or_default()) } else { next };
            self.path = next.to_string_lossy().into_owned();
        }
        double
    }

    fn sizes(&mut self, ui: &mut Ui) {
        row(ui, "Size", "width and height of the picture", |ui| {
            for side in &mut self.size {
                ui.add(DragValue::new(side).range(16..=WIDEST).suffix(" px"));
            }
            for (text, size) in [("1080p", [1920, 1080]), ("4K", [3840, 2160]), ("square", [2048, 2048])] {
                if ui.small_button(text).on_hover_text(format!("{} × {}", size[0], size[1])).clicked() {
                    self.size = size;
                }
            }
        });
        if self.purpose == Purpose::Record {
            row(ui, "Frames", "of the full turn", |ui| {
                ui.add(DragValue::new(&mut self.frames).range(2..=3600))
            });
        }
    }

    fn action(&self, path: PathBuf, force: bool) -> Action {
        let Prompt { size, frames, .. } = *self;
        match self.purpose {
            Purpose::Open => Action::Open(vec![path]),
            Purpose::Beside => Action::Beside(path),
            Purpose::Save => Action::Save { path, force },
            Purpose::Screenshot => Action::Screenshot { path, size, force },
            Purpose::Record => Action::Record { path, size, frames, force },
            Purpose::Transfer => Action::Transfer(path.to_string_lossy().into_owned()),
            Purpose::SaveTransfer => Action::SaveTransfer { path, force },
            Purpose::Mask => Action::Mask(path),
            Purpose::Keep => Action::Keep { path, force },
            Purpose::SaveSplats => Action::SaveSplats { path, object: None, force },
            Purpose::SaveObject(object) => Action::SaveSplats { path, object: Some(object), force },
        }
    }
}

/// Returns folders, with a slash, and files with one of these endings, in order. Hidden entries and what
/// cannot be read are left out.
fn entries(folder: &Path, endings: &[&str]) -> Vec<String> {
    let Ok(found) = std::fs::read_dir(folder) else { return Vec::new() };
    let name = |entry: std::fs::DirEntry| {
        let name = entry.file_name().into_string().ok().filter(|name| !name.starts_with('.'))?;
        let lower = name.to_lowercase();
        // Links are followed.
        if entry.path().is_dir() {
            Some((0, format!("{name}/")))
        } else {
            endings.iter().any(|end| lower.ends_with(end)).then_some((1, name))
        }
    };
    let mut names: Vec<_> = found.flatten().filter_map(name).collect();
    names.sort();
    names.into_iter().take(MOST).map(|(_, name)| name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_come_first_and_only_what_can_be_opened() {
        let folder = tempfile::tempdir().expect("a folder");
        for name in ["b.PLY", "a.nii.gz", "notes.txt", ".hidden.ply"] {
            std::fs::write(folder.path().join(name), "").expect("a file");
        }
        std::fs::create_dir(folder.path().join("z")).expect("a folder");
        let (_, _, endings) = Purpose::Open.words();
        assert_eq!(entries(folder.path(), endings), ["z/", "a.nii.gz", "b.PLY"]);
        assert!(entries(&folder.path().join("none"), endings).is_empty());
    }

    #[test]
    fn an_answer_is_the_action_of_its_purpose() {
        let prompt = |purpose| Prompt::new(purpose, &Files::default(), None, [640, 480]);
        let path = PathBuf::from("x");
        let size = [640, 480];
        let liver = Target { file: 0, label: Some(5) };
        for (purpose, expected) in [
            (Purpose::Open, Action::Open(vec![path.clone()])),
            (Purpose::Beside, Action::Beside(path.clone())),
            (Purpose::Save, Action::Save { path: path.clone(), force: true }),
            (Purpose::Screenshot, Action::Screenshot { path: path.clone(), size, force: true }),
            (Purpose::Record, Action::Record { path: path.clone(), size, frames: 120, force: true }),
            (Purpose::Transfer, Action::Transfer("x".into())),
            (Purpose::SaveTransfer, Action::SaveTransfer { path: path.clone(), force: true }),
            (Purpose::Mask, Action::Mask(path.clone())),
            (Purpose::Keep, Action::Keep { path: path.clone(), force: true }),
            (Purpose::SaveSplats, Action::SaveSplats { path: path.clone(), object: None, force: true }),
            (
                Purpose::SaveObject(liver),
                Action::SaveSplats { path: path.clone(), object: Some(liver), force: true },
            ),
        ] {
            assert_eq!(prompt(purpose).action(path.clone(), true), expected);
        }
        assert!(prompt(Purpose::Save).path.ends_with("session.toml"));
    }

    #[test]
    fn splats_are_saved_in_every_format_that_is_written() {
        let formats = engine::splat::FORMATS.iter().map(|format| format!(".{}", format.name));
        assert!(formats.eq(Purpose::SaveSplats.words().2.iter().copied()));
    }
}
