//! The list of a folder in a question for a file: places to go to, and what is there with its size and day.

use std::path::{MAIN_SEPARATOR, Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use egui::{Align, Button, Layout, ScrollArea, Ui, vec2};

use engine::figures::{bytes, utc};

/// Greatest number of entries of a folder that are listed.
const MOST: usize = 1000;
/// Greatest number of folders of recent files among the places.
const MOST_PLACES: usize = 8;
/// Height of the list, points of the screen: the same whatever is in it, so that nothing jumps.
const HEIGHT: f32 = 240.0;
/// Widths of the places, of a size and of a day, points of the screen.
const WIDTHS: [f32; 3] = [120.0, 70.0, 76.0];

/// The list of a folder.
#[derive(Clone, Debug, Default)]
pub struct FileList {
    places: Vec<(String, PathBuf)>,
    /// True if files of other endings are listed, too.
    all: bool,
    /// What was listed last: of which folder, whether of all files, and the entries.
    listed: Option<(PathBuf, bool, Vec<Entry>)>,
}

/// Entry of a folder.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Entry {
    is_file: bool,
    name: String,
    /// Size, bytes, and day of the last change; folders have no size.
    bytes: u64,
    day: String,
}

impl FileList {
    /// Creates a list with the folders of recent files, the latest first, as places beside the home folder.
    pub fn new(recent: &[PathBuf]) -> Self {
        let home = std::env::var_os("HOME").or_else(|| std::env::var_os("USERPROFILE")).map(PathBuf::from);
        let mut places: Vec<_> = home.into_iter().map(|home| ("Home".to_owned(), home)).collect();
        for folder in recent.iter().filter_map(|file| file.parent()) {
            let name = folder.file_name().unwrap_or(folder.as_os_str()).to_string_lossy().into_owned();
            if places.len() <= MOST_PLACES
                && places.iter().all(|(_, place)| place != folder)
                && folder.is_dir()
            {
                places.push((name, folder.to_owned()));
            }
        }
        FileList { places, ..FileList::default() }
    }

    /// Shows the folder in which `path` is, or which it names with a separator at its end, and changes the path by
    /// what is clicked; its last part stays if `keeps_name`. Returns true if a file was double clicked.
    pub fn show(&mut self, ui: &mut Ui, path: &mut String, endings: &[&str], keeps_name: bool) -> bool {
        let folder = folder_of(path);
        let mut next = None;
        let mut double = false;
        ui.horizontal_top(|ui| {
            ui.vertical(|ui| {
                ui.set_width(WIDTHS[0]);
                for (name, place) in &self.places {
                    let button = ui.add(Button::selectable(*place == folder, name.as_str()).truncate());
                    if button.on_hover_text(place.display().to_string()).clicked() {
                        next = Some((place.clone(), false));
                    }
                }
                ui.separator();
                ui.checkbox(&mut self.all, "All files")
                    .on_hover_text("including files with other extensions");
            });
            // A line between them would grow with the window, and the window with it.
            ui.vertical(|ui| {
                let known = self
                    .listed
                    .as_ref()
                    .is_some_and(|(listed, all, _)| *listed == folder && *all == self.all);
                if !known {
                    self.listed = Some((folder.clone(), self.all, entries(&folder, endings, self.all)));
                }
                let found = self.listed.as_ref().map_or(&[][..], |(.., found)| found);
                let own = Path::new(path).file_name().filter(|_| !ends_in_separator(path));
                let own = own.map(|name| name.to_string_lossy().into_owned());
                let scroll = ScrollArea::vertical().id_salt(&folder).auto_shrink(false);
                scroll.max_height(HEIGHT).min_scrolled_height(HEIGHT).show(ui, |ui| {
                    if folder.parent().is_some() && ui.add(Button::selectable(false, "../")).clicked() {
                        next = folder.parent().map(|parent| (parent.to_owned(), false));
                    }
                    for entry in found {
                        let clicked = entry.show(ui, own.as_deref() == Some(entry.name.as_str()));
                        if let Some(twice) = clicked {
                            next = Some((folder.join(&entry.name), entry.is_file));
                            double = twice && entry.is_file;
                        }
                    }
                    if found.is_empty() {
                        ui.weak("no matching files here");
                    }
                });
            });
        });
        if let Some((place, is_file)) = next {
            let name = Path::new(path).file_name().filter(|_| keeps_name && !ends_in_separator(path));
            let place = match (is_file, name) {
                (true, _) => place,
                (false, name) => place.join(name.unwrap_or_default()),
            };
            *path = place.to_string_lossy().into_owned();
        }
        double
    }
}

impl Entry {
    /// Shows the entry. Returns whether it was clicked, and if so whether twice.
    fn show(&self, ui: &mut Ui, is_chosen: bool) -> Option<bool> {
        ui.horizontal(|ui| {
            let height = ui.spacing().interact_size.y;
            let width = ui.available_width() - WIDTHS[1] - WIDTHS[2] - 24.0;
            let left = Layout::left_to_right(Align::Center);
            let name = if self.is_file { self.name.clone() } else { format!("{}/", self.name) };
            let button = ui.allocate_ui_with_layout(vec2(width, height), left, |ui| {
                ui.set_min_width(width);
                ui.add(Button::selectable(is_chosen, name).truncate())
            });
            for (text, width) in [(self.size(), WIDTHS[1]), (self.day.clone(), WIDTHS[2])] {
                let right = Layout::right_to_left(Align::Center);
                ui.allocate_ui_with_layout(vec2(width, height), right, |ui| ui.weak(text));
            }
            let button = button.inner;
            (button.clicked() || button.double_clicked()).then(|| button.double_clicked())
        })
        .inner
    }

    fn size(&self) -> String {
        if self.is_file { bytes(self.bytes) } else { String::new() }
    }
}

fn ends_in_separator(path: &str) -> bool {
    path.ends_with(std::path::is_separator)
}

/// Returns the folder that is listed for a path: the part up to its last separator, so that it does not change while a
/// name is typed.
pub fn folder_of(path: &str) -> PathBuf {
    let end = path.rfind(std::path::is_separator).map_or(0, |at| at + 1);
    let folder = Path::new(&path[..end]);
    // Without the separator, except for the root.
    folder.components().collect()
}

/// Returns the path of a folder, with a separator at its end, so that it is listed itself.
pub fn as_folder(path: &Path) -> String {
    let text = path.to_string_lossy().into_owned();
    if ends_in_separator(&text) || text.is_empty() { text } else { format!("{text}{MAIN_SEPARATOR}") }
}

/// Returns folders and then files, in the order of their names: those with one of these endings, or all. Hidden entries
/// and what cannot be read are left out.
fn entries(folder: &Path, endings: &[&str], all: bool) -> Vec<Entry> {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let Ok(found) = std::fs::read_dir(folder) else { return Vec::new() };
    let entry = |entry: std::fs::DirEntry| {
        let name = entry.file_name().into_string().ok().filter(|name| !name.starts_with('.'))?;
        // Links are followed.
        let meta = std::fs::metadata(entry.path()).ok()?;
        let lower = name.to_lowercase();
        let listed = meta.is_dir() || all || endings.iter().any(|end| lower.ends_with(end));
        let day = meta.modified().ok().map(day).unwrap_or_default();
        listed.then(|| Entry { is_file: !meta.is_dir(), name, bytes: meta.len(), day })
    };
    let mut entries: Vec<_> = found.flatten().filter_map(entry).collect();
    entries.sort();
    entries.truncate(MOST);
    entries
}

/// Returns the day of a time (UTC), as 2026-03-31.
fn day(time: SystemTime) -> String {
    let seconds = time.duration_since(UNIX_EPOCH).map(|d| d.as_secs()).unwrap_or_default();
    utc(seconds).chars().take_while(|c| *c != 'T').collect()
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn folders_come_first_and_only_what_can_be_opened() {
        let folder = tempfile::tempdir().expect("a folder");
        for name in ["b.PLY", "a.nii.gz", "notes.txt", ".hidden.ply"] {
            std::fs::write(folder.path().join(name), "12345").expect("a file");
        }
        std::fs::create_dir(folder.path().join("z")).expect("a folder");
        let changed = UNIX_EPOCH + Duration::from_secs(951_782_400);
        let file = std::fs::File::options().write(true).open(folder.path().join("b.PLY")).expect("a file");
        file.set_modified(changed).expect("a time");
        let names = |all| {
            let found = entries(folder.path(), &[".ply", ".nii.gz"], all);
            found.iter().map(|entry| entry.name.clone()).collect::<Vec<_>>()
        };
        assert_eq!(names(false), ["z", "a.nii.gz", "b.PLY"]);
        assert_eq!(names(true), ["z", "a.nii.gz", "b.PLY", "notes.txt"]);
        let found = entries(folder.path(), &[".ply"], false);
        assert_eq!((found[1].size().as_str(), found[1].day.as_str()), ("5 bytes", "2000-02-29"));
        assert_eq!(found[0].size(), "", "a folder has no size");
        assert!(entries(&folder.path().join("none"), &[".ply"], true).is_empty());
    }

    #[test]
    fn the_list_stays_while_a_name_is_typed() {
        for (path, folder) in [
            ("/data/bo", "/data"),
            ("/data/bones", "/data"),
            ("/data/", "/data"),
            ("/x", "/"),
            ("x", ""),
            ("a/x", "a"),
        ] {
            assert_eq!(folder_of(path), Path::new(folder), "{path}");
        }
        assert_eq!((as_folder(Path::new("/data")), as_folder(Path::new("/"))), ("/data/".into(), "/".into()));
    }

    #[test]
    fn places_are_those_of_recent_files_once() {
        let folder = tempfile::tempdir().expect("a folder");
        let recent = ["a.ply", "b.ply", "gone/c.ply"].map(|name| folder.path().join(name));
        let list = FileList::new(&recent);
        let found = list.places.iter().filter(|(_, place)| place == folder.path()).count();
        assert!(
            found == 1 && list.places.iter().all(|(_, place)| !place.ends_with("gone")),
            "{:?}",
            list.places
        );
    }
}
