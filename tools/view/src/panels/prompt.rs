//! Questions for a file: what each purpose needs, and our own dialog, with a list of its folder and settings for what is
//! written.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use egui::{Context, DragValue, Id, Key, Modal, TextEdit, Ui};

use crate::model::actions::Action;
use crate::model::deletions::Target;
use crate::model::file_list::{FileList, as_folder, folder_of};
use crate::model::picture_options::{Backing, PictureOptions};
use crate::model::state::{Files, is_packed};
use crate::model::system_dialog::{Pending, Question, Wanted};
use crate::panels::widgets::{escaped, row};

/// Greatest number that a suggested name has.
const MOST_NAMES: u32 = 10_000;
/// Greatest width or height of a picture, pixels; every device can render it.
const WIDEST: u32 = 8192;

/// Purpose of a file that is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// The file is opened.
    Open,
    /// The DICOM slices in the folder are opened.
    OpenFolder,
    /// Splats are opened from it beside the others.
    Beside,
    /// The session is written to it.
    Save,
    /// The session and its files are written to it.
    Pack,
    /// It is a missing file of a session.
    Find,
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
    /// What is shown is written to it as a page.
    Share,
}

impl Purpose {
    /// Returns the title, the name of the button that confirms, and the extensions that are listed.
    fn words(self) -> (&'static str, &'static str, &'static [&'static str]) {
        const SPLATS: [&str; 5] = [".ply", ".vgs", ".spz", ".sog", ".glb"];
        static DATA: LazyLock<Vec<&str>> =
            LazyLock::new(|| SPLATS.iter().chain(&[".toml"]).chain(VOLUMES.iter()).copied().collect());
        static VOLUMES: LazyLock<Vec<&str>> = LazyLock::new(|| {
            engine::volume::FORMATS.iter().flat_map(|format| format.extensions).copied().collect()
        });
        match self {
            Purpose::Open => ("Open splats, a volume, a mask or a session", "Open", DATA.as_slice()),
            Purpose::OpenFolder => ("Open a folder of DICOM slices", "Open the folder", VOLUMES.as_slice()),
            Purpose::Beside => ("Open splats beside the others", "Open", SPLATS.as_slice()),
            Purpose::Save => ("Save the session", "Save", &[".toml"]),
            Purpose::Pack => ("Pack the session and all its files", "Pack", &[".zip"]),
            Purpose::Find => ("Where is the missing file?", "Take it", DATA.as_slice()),
            Purpose::Screenshot => ("Screenshot", "Write", &[".png", ".exr"]),
            Purpose::Record => ("Record a turntable", "Record", &[".png"]),
            Purpose::Transfer => {
                ("Open a transfer function", "Open", &[".vp.json", ".json", ".xml", ".mrml", ".vp"])
            }
            Purpose::SaveTransfer => ("Save the transfer function", "Save", &[".vp.json"]),
            Purpose::Mask => ("Open a mask or a label map", "Open", VOLUMES.as_slice()),
            Purpose::Keep => ("Keep the splats: .ply, or .vgs for a small file", "Keep", &[".ply", ".vgs"]),
            Purpose::SaveSplats => (
                "Save the splats that are shown: .ply, .vgs for a small file, .spz, .sog or .glb for viewers of colours",
                "Save",
                &SPLATS,
            ),
            Purpose::SaveObject(_) => (
                "Save this object: .ply, .vgs for a small file, .spz, .sog or .glb for viewers of colours",
                "Save",
                &SPLATS,
            ),
            Purpose::Share => ("Share as a page", "Write", &[".html"]),
        }
    }

    /// Returns true if the file is written.
    fn writes(self) -> bool {
        !self.name_endings().is_empty()
    }

    /// Returns what is put between the name of what is shown and a number, and the ending of a new file; an empty
    /// ending for a file that is read.
    fn name_endings(self) -> &'static str {
        match self {
            Purpose::Open
            | Purpose::OpenFolder
            | Purpose::Find
            | Purpose::Beside
            | Purpose::Transfer
            | Purpose::Mask => "",
            Purpose::Save => ".toml",
            Purpose::Pack => ".zip",
            Purpose::Screenshot | Purpose::Record => ".png",
            Purpose::SaveTransfer => ".vp.json",
            Purpose::Keep | Purpose::SaveSplats | Purpose::SaveObject(_) => ".ply",
            Purpose::Share => ".html",
        }
    }

    /// Returns the suggested name of a new file in a folder, after the `case`: of none that is there or open.
    fn suggestion(self, folder: &Path, case: &str, open: &Files) -> String {
        let ending = self.name_endings();
        if ending.is_empty() {
            return String::new();
        }
        let name = |number: u32| match (self, number) {
            (Purpose::Screenshot, _) => format!("{case}-{number}{ending}"),
            (Purpose::Record, 1) => format!("{case}-turn{ending}"),
            (Purpose::Record, _) => format!("{case}-turn-{number}{ending}"),
            (_, 1) => format!("{case}{ending}"),
            _ => format!("{case}-{number}{ending}"),
        };
        let is_free = |name: &String| {
            let path = folder.join(name);
            !path.exists() && !open.all().any(|file| *file == path)
        };
        (1..=MOST_NAMES).map(name).find(is_free).unwrap_or_else(|| name(1))
    }
}

/// Open question for a file.
#[derive(Clone, Debug)]
pub struct Prompt {
    /// Purpose of the file.
    purpose: Purpose,
    path: String,
    options: PictureOptions,
    frames: u32,
    /// Title of a page.
    title: String,
    list: FileList,
    /// True if there may be DICOM files among those that are open.
    has_dicom: bool,
    /// True until it was shown; then the path takes the keyboard focus.
    fresh: bool,
}

/// Question that the dialog of the desktop shows.
pub struct Asked {
    /// The question, should our own dialog have to show it.
    pub prompt: Prompt,
    /// The answer on its way.
    pub answer: Pending,
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
    /// Asks for a file, first in the folder of the files that are open. A new file is named after them, or after the
    /// `session`, whose file is also that to which it is saved again. `size` is the suggested size of a picture, pixels;
    /// the folders of `recent` files are at hand.
    pub fn new(
        purpose: Purpose,
        (files, session): (&Files, Option<&Path>),
        size: [u32; 2],
        recent: &[PathBuf],
    ) -> Self {
        let known = session.filter(|path| purpose == Purpose::Save && !is_packed(path));
        let beside = session.and_then(Path::parent).filter(|folder| folder.is_dir()).map(Path::to_owned);
        let near = files.folder().filter(|_| session.is_none() || !purpose.writes()).or(beside);
        let folder = near.map_or_else(std::env::current_dir, Ok).unwrap_or_default();
        let stem = session.and_then(Path::file_stem).map(|stem| stem.to_string_lossy().into_owned());
        let case = stem.or_else(|| files.case_name()).unwrap_or_else(|| "vgs".to_owned());
        let path = match (known, purpose.suggestion(&folder, &case, files)) {
            (Some(known), _) => known.to_string_lossy().into_owned(),
            (None, name) if name.is_empty() => as_folder(&folder),
            (None, name) => folder.join(name).to_string_lossy().into_owned(),
        };
        let has_dicom = files.may_have_series();
        Prompt {
            purpose,
            has_dicom,
            path,
            options: PictureOptions::new(size),
            frames: 120,
            title: String::new(),
            list: FileList::new(recent),
            fresh: true,
        }
    }

    /// Shows the question and returns the answer.
    pub fn show(&mut self, context: &Context) -> Answer {
        let modal = Modal::new(Id::new("prompt")).show(context, |ui| {
            ui.set_width(640.0);
            self.content(ui)
        });
        if modal.inner == Answer::Open && escaped(context, &modal) { Answer::Cancelled } else { modal.inner }
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
        let double = self.list.show(ui, &mut self.path, endings, self.purpose.writes());
        if matches!(self.purpose, Purpose::Screenshot | Purpose::Record) {
            self.picture(ui);
        }
        if self.purpose == Purpose::Share {
            self.share(ui);
        }
        if self.purpose == Purpose::Pack && self.has_dicom {
            ui.colored_label(
                crate::panels::theme::SIGNAL,
                "DICOM files are packed as they are: they name the patient.",
            );
        }
        let path = PathBuf::from(&self.path);
        let there = path.is_file();
        let force = there && self.purpose.writes();
        let good = match self.purpose {
            Purpose::OpenFolder => path.is_dir(),
            purpose if purpose.writes() => path.file_name().is_some() && !path.is_dir(),
            _ => there,
        };
        let mut answer = Answer::Open;
        ui.horizontal(|ui| {
            let word = if force { "Replace" } else { word };
            let done = ui.add_enabled(good, egui::Button::new(word)).clicked();
            // An existing file is replaced only by a click.
            if done || (good && !force && (entered || double)) {
                answer = Answer::Do(self.action(vec![path.clone()], force));
            }
            if matches!(self.purpose, Purpose::Open | Purpose::Find) && path.is_dir() {
                let button = ui.button("Open the folder");
                if button.on_hover_text("as a scan: all DICOM slices in it are one volume").clicked() {
                    answer = Answer::Do(self.action(vec![path.clone()], false));
                }
            }
            if ui.button("Cancel").clicked() {
                answer = Answer::Cancelled;
            }
            if force {
                ui.colored_label(crate::panels::theme::SIGNAL, "the file exists");
            } else if !good && !self.path.is_empty() && !path.is_dir() {
                ui.weak("there is no such file");
            }
        });
        answer
    }

    /// Shows what a page tells, and changes its title.
    fn share(&mut self, ui: &mut Ui) {
        row(ui, "Title", "at the top of the page; names of files are not in it", |ui| {
            ui.add(TextEdit::singleline(&mut self.title).hint_text("that of its objects"))
        });
        ui.label(
            "Anyone with the page has its splats, including those of hidden objects and those cut away by planes. Deleted splats are not in it.",
        );
    }

    /// Shows how a picture is written, and changes it.
    fn picture(&mut self, ui: &mut Ui) {
        let options = &mut self.options;
        row(ui, "Size", "width and height of the picture", |ui| {
            for side in &mut options.size {
                ui.add(DragValue::new(side).range(16..=WIDEST).suffix(" px"));
            }
            for (text, size) in [("1080p", [1920, 1080]), ("4K", [3840, 2160]), ("square", [2048, 2048])] {
                if ui.small_button(text).on_hover_text(format!("{} × {}", size[0], size[1])).clicked() {
                    options.size = size;
                }
            }
        });
        row(ui, "In print", "size on paper; stored in the PNG for other programs", |ui| {
            let [mut width, height] = options.printed_mm();
            let value = DragValue::new(&mut width).range(1.0..=3000.0).suffix(" mm").max_decimals(1);
            if ui.add(value).changed() {
                options.set_printed_width(width, WIDEST);
            }
            ui.label(format!("× {height:.1} mm at"));
            ui.add(DragValue::new(&mut options.dpi).range(50..=2400).suffix(" dpi"));
        });
        row(ui, "Background", "behind the picture; Camera has the colour that is shown", |ui| {
            for (backing, name) in Backing::ALL {
                ui.selectable_value(&mut options.backing, backing, name);
            }
        });
        ui.checkbox(&mut options.told, "Letters, bars, cube, names and distances, as shown");
        if self.purpose == Purpose::Record {
            row(ui, "Frames", "for a full turn", |ui| {
                ui.add(DragValue::new(&mut self.frames).range(2..=3600))
            });
        }
    }

    /// Returns what the dialog of the desktop is asked; `None` if there is more to ask than a path.
    pub fn question(&self) -> Option<Question> {
        let wanted = match self.purpose {
            Purpose::Screenshot | Purpose::Record | Purpose::Pack | Purpose::Share => return None,
            Purpose::Open => Wanted::Files,
            Purpose::OpenFolder => Wanted::Folder,
            purpose if purpose.writes() => {
                let name = Path::new(&self.path).file_name().unwrap_or_default();
                Wanted::New(name.to_string_lossy().into_owned())
            }
            _ => Wanted::File,
        };
        let (title, button, endings) = self.purpose.words();
        Some(Question { title, button, wanted, endings, folder: folder_of(&self.path) })
    }

    /// Takes the paths that the dialog of the desktop has given. It has asked before a file is replaced; where a missing
    /// ending makes it another file, which is there, too, our own dialog has to ask.
    pub fn take(&mut self, mut paths: Vec<PathBuf>) -> Answer {
        let (.., endings) = self.purpose.words();
        let named = paths.first().filter(|_| self.purpose.writes()).and_then(|path| path.file_name());
        let name = named.map(|name| name.to_string_lossy().to_lowercase());
        let lacks = name.is_some_and(|name| !endings.iter().any(|ending| name.ends_with(ending)));
        if let Some(path) = paths.first_mut().filter(|_| lacks) {
            path.as_mut_os_string().push(self.purpose.name_endings());
        }
        let there = self.purpose.writes() && paths.iter().any(|path| path.exists());
        match paths.first() {
            Some(path) if lacks && there => {
                self.path = path.to_string_lossy().into_owned();
                Answer::Open
            }
            _ => Answer::Do(self.action(paths, there)),
        }
    }

    /// Returns what is done with the paths, of which only what opens files takes more than one.
    fn action(&self, paths: Vec<PathBuf>, force: bool) -> Action {
        let Prompt { options, frames, .. } = *self;
        let path = paths.first().cloned().unwrap_or_default();
        match self.purpose {
            Purpose::Open | Purpose::OpenFolder => Action::Open(paths),
            Purpose::Beside => Action::Beside(path),
            Purpose::Save => Action::Save { path, force },
            Purpose::Pack => Action::Pack { path, force },
            Purpose::Find => Action::Found(path),
            Purpose::Screenshot => Action::Screenshot { path, options, force },
            Purpose::Record => Action::Record { path, options, frames, force },
            Purpose::Transfer => Action::Transfer(path.to_string_lossy().into_owned()),
            Purpose::SaveTransfer => Action::SaveTransfer { path, force },
            Purpose::Mask => Action::Mask(path),
            Purpose::Keep => Action::Keep { path, force },
            Purpose::SaveSplats => Action::SaveSplats { path, object: None, force },
            Purpose::SaveObject(object) => Action::SaveSplats { path, object: Some(object), force },
            Purpose::Share => Action::Share { path, title: self.title.clone(), force },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_is_the_action_of_its_purpose() {
        let prompt = |purpose| Prompt::new(purpose, (&Files::default(), None), [640, 480], &[]);
        let path = PathBuf::from("x");
        let options = PictureOptions::new([640, 480]);
        let liver = Target { file: 0, label: Some(5) };
        for (purpose, expected) in [
            (Purpose::Open, Action::Open(vec![path.clone()])),
            (Purpose::OpenFolder, Action::Open(vec![path.clone()])),
            (Purpose::Beside, Action::Beside(path.clone())),
            (Purpose::Save, Action::Save { path: path.clone(), force: true }),
            (Purpose::Pack, Action::Pack { path: path.clone(), force: true }),
            (Purpose::Find, Action::Found(path.clone())),
            (Purpose::Screenshot, Action::Screenshot { path: path.clone(), options, force: true }),
            (Purpose::Record, Action::Record { path: path.clone(), options, frames: 120, force: true }),
            (Purpose::Transfer, Action::Transfer("x".into())),
            (Purpose::SaveTransfer, Action::SaveTransfer { path: path.clone(), force: true }),
            (Purpose::Mask, Action::Mask(path.clone())),
            (Purpose::Keep, Action::Keep { path: path.clone(), force: true }),
            (Purpose::SaveSplats, Action::SaveSplats { path: path.clone(), object: None, force: true }),
            (
                Purpose::SaveObject(liver),
                Action::SaveSplats { path: path.clone(), object: Some(liver), force: true },
            ),
            (Purpose::Share, Action::Share { path: path.clone(), title: String::new(), force: true }),
        ] {
            assert_eq!(prompt(purpose).action(vec![path.clone()], true), expected);
        }
    }

    #[test]
    fn the_dialog_of_the_desktop_is_asked_for_a_path_and_no_more() {
        let files = Files { splats: vec![PathBuf::from("/bones.ply")], ..Files::default() };
        let question = |purpose| Prompt::new(purpose, (&files, None), [640, 480], &[]).question();
        let wanted = |purpose| question(purpose).map(|question| question.wanted);
        assert_eq!(wanted(Purpose::Open), Some(Wanted::Files));
        assert_eq!(wanted(Purpose::OpenFolder), Some(Wanted::Folder));
        assert_eq!(wanted(Purpose::Mask), Some(Wanted::File));
        for purpose in [Purpose::Screenshot, Purpose::Record, Purpose::Pack, Purpose::Share] {
            assert_eq!(wanted(purpose), None, "{purpose:?} has options");
        }
        let expected = Question {
            title: "Save the session",
            button: "Save",
            wanted: Wanted::New("bones.toml".into()),
            endings: &[".toml"],
            folder: "/".into(),
        };
        assert_eq!(question(Purpose::Save), Some(expected));
    }

    #[test]
    fn what_the_desktop_has_asked_about_is_replaced_and_nothing_else() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        ["old.PLY", "old.toml"].iter().for_each(|name| std::fs::write(at(name), "").expect("a file"));
        let mut prompt = Prompt::new(Purpose::SaveSplats, (&Files::default(), None), [640, 480], &[]);
        let saved =
            |name: &str, force| Answer::Do(Action::SaveSplats { path: at(name), object: None, force });
        assert_eq!(prompt.take(vec![at("new.spz")]), saved("new.spz", false));
        assert_eq!(prompt.take(vec![at("old.PLY")]), saved("old.PLY", true));
        assert_eq!(prompt.take(vec![at("new")]), saved("new.ply", false));
        assert_eq!(prompt.take(vec![at("old.toml")]), saved("old.toml.ply", false));
        let mut prompt = Prompt::new(Purpose::Save, (&Files::default(), None), [640, 480], &[]);
        assert_eq!(prompt.take(vec![at("old")]), Answer::Open, "nobody was asked about old.toml");
        assert_eq!(PathBuf::from(prompt.path), at("old.toml"));
        // What is read keeps its name.
        let mut prompt = Prompt::new(Purpose::Open, (&Files::default(), None), [640, 480], &[]);
        let both = vec![at("old"), at("old.PLY")];
        assert_eq!(prompt.take(both.clone()), Answer::Do(Action::Open(both)));
    }

    #[test]
    fn a_new_file_is_named_after_what_is_shown() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        let name = |purpose, files: &Files, session: Option<&Path>| {
            let path = PathBuf::from(Prompt::new(purpose, (files, session), [640, 480], &[]).path);
            assert_eq!(path.parent(), Some(folder.path()), "{}", path.display());
            path.file_name().expect("a name").to_string_lossy().into_owned()
        };
        let bones =
            Files { splats: vec![at("bones.ply")], volume: Some(at("ct.nii.gz")), ..Files::default() };
        let ct = Files { volume: Some(at("ct.nii.gz")), ..Files::default() };
        std::fs::write(at("bones.ply"), "").expect("a file");
        for (purpose, files, expected) in [
            (Purpose::Save, &bones, "bones.toml"),
            (Purpose::Pack, &bones, "bones.zip"),
            (Purpose::Screenshot, &bones, "bones-1.png"),
            (Purpose::Record, &bones, "bones-turn.png"),
            (Purpose::SaveTransfer, &bones, "bones.vp.json"),
            (Purpose::SaveSplats, &bones, "bones-2.ply"),
            (Purpose::Share, &bones, "bones.html"),
            (Purpose::Keep, &ct, "ct.ply"),
            (Purpose::Screenshot, &ct, "ct-1.png"),
        ] {
            assert_eq!(name(purpose, files, None), expected, "{purpose:?}");
        }
        std::fs::write(at("bones-1.png"), "").expect("a file");
        assert_eq!(name(Purpose::Screenshot, &bones, None), "bones-2.png");
        // A session gives its name, and is written again to its own file.
        let session = at("hip.toml");
        std::fs::write(&session, "").expect("a file");
        assert_eq!(name(Purpose::Save, &bones, Some(&session)), "hip.toml");
        assert_eq!(name(Purpose::Screenshot, &bones, Some(&session)), "hip-1.png");
        let nothing = Prompt::new(Purpose::Save, (&Files::default(), None), [640, 480], &[]);
        assert!(nothing.path.ends_with("vgs.toml"), "{}", nothing.path);
    }

    #[test]
    fn splats_are_saved_in_every_format_that_is_written() {
        let formats = engine::splat::FORMATS.iter().map(|format| format!(".{}", format.name));
        assert!(formats.eq(Purpose::SaveSplats.words().2.iter().copied()));
    }
}
