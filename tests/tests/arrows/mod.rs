//! The source tree is as it claims to be: who may use whom, no files that use each other in a circle, where
//! unsafe code is, how long files are, and that every kernel says what it does.
//!
//! The maps are the tables: that of the crates in `docs/design/architecture.md`, those of the modules at the
//! top of `tools/view/src/lib.rs` and `xr-app/src/lib.rs`.

mod dependencies;
mod imports;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Lines that a file may have without a `//! long:` reason.
const LONG: usize = 700;
/// Where unsafe code and ash may be: the Vulkan layer, the OpenXR half of the headset app, and its entry on
/// Android.
const UNSAFE: [&str; 3] = ["engine/gpu/src/", "xr-app/src/headset/openxr.rs", "xr-app/src/android.rs"];
/// The members of the workspace: the folder of each, and what others call it in their dependencies.
const MEMBERS: [(&str, &str); 23] = [
    ("engine", "engine"),
    ("engine/bake", "bake"),
    ("engine/base", "base"),
    ("engine/fit", "fit"),
    ("engine/gpu", "gpu"),
    ("engine/image", "image"),
    ("engine/passes", "passes"),
    ("engine/reference", "reference"),
    ("engine/render", "render"),
    ("engine/splat", "splat"),
    ("engine/transfer", "transfer"),
    ("engine/volume", "volume"),
    ("shaders-glsl", "shaders-glsl"),
    ("shaders-glsl/interface", "shader-interface"),
    ("tools/view", "view"),
    ("xr-app", "xr-app"),
    ("tools/cli", "vgs"),
    ("tools/page", "page"),
    ("tools/python", "vgs-python"),
    ("tools/research/bench", "bench"),
    ("tools/research/studies", "vgs-studies"),
    ("tools/research/fuzz", "vgs-fuzz"),
    ("tests", "vgs-tests"),
];
/// The crates with a map of their modules at the top of `lib.rs`.
const MAPS: [&str; 2] = ["tools/view/src", "xr-app/src"];
/// Which module may use which.
type Table = BTreeMap<String, BTreeSet<String>>;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("tests/ lies in the repository").to_owned()
}

/// Returns all files below a folder with that ending, as (path from the root, content). Build folders are
/// left out.
fn sources(folder: &str, ending: &str) -> Vec<(String, String)> {
    let mut found = Vec::new();
    let mut open = vec![root().join(folder)];
    while let Some(folder) = open.pop() {
        let Ok(entries) = std::fs::read_dir(&folder) else { continue };
        for path in entries.map(|e| e.expect("a readable folder").path()) {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            if path.is_dir() {
                if name != "target" && !name.starts_with('.') {
                    open.push(path);
                }
            } else if path.extension().is_some_and(|e| e == ending) {
                let relative = path.strip_prefix(root()).expect("below the root").to_string_lossy();
                found.push((relative.replace('\\', "/"), std::fs::read_to_string(&path).expect("UTF-8")));
            }
        }
    }
    found.sort();
    found
}

/// Returns the code of a file: comments are gone, lines stay.
fn code(text: &str) -> String {
    text.lines().map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n")
}

/// Returns which module may use which, from the lines with arrows in the map of a crate.
fn allowed(map: &str) -> Table {
    table(map.lines().filter_map(|line| line.strip_prefix("//! ")))
}

/// Returns who may use whom, from lines with arrows: "a, b -> c -> d" lets a and b use c and d, and c use d.
/// Three spaces stand between two statements of a line.
fn table<'a>(lines: impl Iterator<Item = &'a str>) -> Table {
    let mut table = Table::new();
    let statements =
        lines.flat_map(|line| line.split("   ")).filter(|s| s.contains("->") && !s.contains('"'));
    for statement in statements {
        let steps: Vec<Vec<&str>> =
            statement.split("->").map(|names| names.split(',').map(str::trim).collect()).collect();
        for (i, users) in steps.iter().enumerate() {
            for user in users {
                let row = table.entry((*user).to_owned()).or_default();
                row.extend(steps[i + 1..].iter().flatten().map(|used| (*used).to_owned()));
            }
        }
    }
    table
}

/// Top-level modules that a file of module `path` (such as ["fit", "init"]) names, among `modules`.
fn used(code: &str, path: &[&str], modules: &BTreeSet<String>) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    let up = vec!["super"; path.len()].join("::");
    for start in ["crate".to_owned(), up] {
        for (at, _) in code.match_indices(&format!("{start}::")) {
            // Not the end of a longer word, nor of a longer chain of supers (which cannot reach the root).
            let before = code[..at].chars().next_back();
            if before.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == ':') {
                continue;
            }
            let rest = &code[at + start.len() + 2..];
            let names = match rest.strip_prefix('{') {
                Some(group) => heads(group),
                None => vec![word(rest)],
            };
            found.extend(names.into_iter().filter(|name| modules.contains(name)));
        }
    }
    found
}

fn word(text: &str) -> String {
    text.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect()
}

/// First words of the parts of a group `a::b, c::{d, e}, f}`.
fn heads(group: &str) -> Vec<String> {
    let (mut depth, mut start, mut out) = (0, 0, Vec::new());
    for (i, c) in group.char_indices() {
        match c {
            '{' => depth += 1,
            '}' if depth > 0 => depth -= 1,
            '}' | ',' if depth == 0 => {
                out.push(word(group[start..i].trim()));
                start = i + 1;
                if c == '}' {
                    break;
                }
            }
            _ => {}
        }
    }
    out
}

/// Returns the module path of a file below the source folder of a crate.
fn module_path<'a>(folder: &str, file: &'a str) -> Vec<&'a str> {
    let path = file.strip_prefix(folder).unwrap_or(file).trim_end_matches(".rs").trim_end_matches("/mod");
    path.split('/').filter(|part| !["", "lib", "main"].contains(part)).collect()
}

/// A crate with a map of its modules.
struct Mapped {
    folder: &'static str,
    files: Vec<(String, String)>,
    table: Table,
    modules: BTreeSet<String>,
}

impl Mapped {
    fn read(folder: &'static str) -> Self {
        let files = sources(folder, "rs");
        let lib = format!("{folder}/lib.rs");
        let map = &files.iter().find(|(file, _)| *file == lib).expect("the map").1;
        let first = |file: &str| module_path(folder, file).first().map(|m| (*m).to_owned());
        let modules = files.iter().filter_map(|(file, _)| first(file)).collect();
        Mapped { folder, table: allowed(map), files, modules }
    }

    /// Returns the arrows of some files that the map does not allow.
    fn forbidden(&self, files: &[(String, String)]) -> Vec<String> {
        let mut out = Vec::new();
        for (file, text) in files {
            let path = module_path(self.folder, file);
            let Some(&own) = path.first() else { continue };
            let may = self.table.get(own).cloned().unwrap_or_default();
            for name in used(&code(text), &path, &self.modules) {
                if name != own && !may.contains(&name) {
                    out.push(format!("{file}: {own} may not use {name}"));
                }
            }
        }
        out
    }
}

#[test]
fn modules_keep_their_arrows() {
    for folder in MAPS {
        let mapped = Mapped::read(folder);
        assert!(mapped.files.len() > 20 && mapped.modules.len() > 5, "{folder} was found");
        let wrong = mapped.forbidden(&mapped.files);
        assert!(
            wrong.is_empty(),
            "arrows that the map in {folder}/lib.rs does not allow:\n{}",
            wrong.join("\n")
        );
        let listed = |module: &String| {
            mapped.table.contains_key(module) || mapped.table.values().any(|row| row.contains(module))
        };
        for module in &mapped.modules {
            assert!(listed(module), "the map in {folder}/lib.rs does not know {module}");
        }
        for module in mapped.table.iter().flat_map(|(user, used)| used.iter().chain([user])) {
            assert!(mapped.modules.contains(module), "{folder} has no module {module}, which its map names");
        }
    }
}

#[test]
fn no_files_use_each_other_in_a_circle() {
    for (member, _) in MEMBERS {
        let folder = &format!("{member}/src");
        let files = imports::Crate::new(folder, &sources(folder, "rs"));
        assert!(files.len() > 0, "{folder} was found");
        let circles = files.circles();
        assert!(circles.is_empty(), "these files use each other in a circle: {circles:#?}");
    }
}

/// The front file of a folder lies in it: `foo/mod.rs`, not `foo.rs` beside `foo`.
#[test]
fn front_files_lie_in_their_folders() {
    for (file, _) in sources("", "rs") {
        let beside = !sources(file.trim_end_matches(".rs"), "rs").is_empty();
        assert!(!beside, "{file} lies beside the folder whose front file it is");
    }
}

/// The checker itself, on arrows that must not be.
#[test]
fn forbidden_arrows_are_found() {
    let view = Mapped::read("tools/view/src");
    let row = |user: &str| view.table.get(user).cloned().unwrap_or_default();
    assert!(row("viewer").contains("screen") && row("panels").contains("model"));
    for (user, used) in [("model", "viewer"), ("panels", "screen"), ("io", "panels"), ("app", "viewer")] {
        assert!(!row(user).contains(used), "the map must not let {user} use {used}");
    }
    for (file, text, expected) in [
        ("model/orbit.rs", "use crate::viewer::Viewer;", 1),
        ("model/orbit.rs", "use crate::model::Orbit; // crate::viewer", 0),
        ("model/orbit.rs", "use super::super::viewer::Viewer;", 1),
        ("model/mod.rs", "use super::viewer::Viewer;", 1),
        ("model/orbit.rs", "use super::viewer::Viewer; use super::super::super::viewer;", 0),
        ("panels/editor/curve.rs", "fn f() -> crate::screen::Canvas {}", 1),
        ("io/mod.rs", "use crate::{panels, app::{App, Key}, model};", 2),
        ("panels/editor/widget.rs", "use crate::{\n    screen,\n};", 1),
        ("panels/cut.rs", "use crate::screen::Canvas; use crate::model::Orbit;", 1),
    ] {
        let files = [(format!("tools/view/src/{file}"), text.to_owned())];
        let found = view.forbidden(&files);
        assert_eq!(found.len(), expected, "{file}: {text}: {found:?}");
    }
}

/// Returns which members of this workspace a manifest depends on.
fn members_used(manifest: &str) -> BTreeSet<&'static str> {
    let keys: BTreeSet<&str> =
        manifest.lines().filter_map(|line| line.split(['.', ' ', '=']).next()).collect();
    MEMBERS.into_iter().map(|(_, name)| name).filter(|name| keys.contains(name)).collect()
}

#[test]
fn crates_keep_their_arrows() {
    let page = std::fs::read_to_string(root().join("docs/design/architecture.md")).expect("the page");
    let lines =
        page.lines().skip_while(|line| *line != "## Crates and arrows").skip_while(|line| *line != "```");
    let table = table(lines.skip(1).take_while(|line| *line != "```"));
    let manifests = sources("", "toml");
    let mut seen = 0;
    for (file, text) in manifests.iter().filter(|(file, _)| file.ends_with("/Cargo.toml")) {
        let folder = file.trim_end_matches("/Cargo.toml");
        let (_, name) =
            MEMBERS.iter().find(|(place, _)| *place == folder).expect("a member that is known here");
        let may = table.get(*name).cloned().unwrap_or_default();
        let wrong: Vec<_> = members_used(text).into_iter().filter(|used| !may.contains(*used)).collect();
        assert!(wrong.is_empty(), "{file} may not use {wrong:?}: see docs/design/architecture.md");
        let ash = text.lines().any(|line| line.starts_with("ash"));
        assert!(
            !ash || file.starts_with("engine/gpu/") || file.starts_with("xr-app/"),
            "{file} may not use ash"
        );
        seen += 1;
    }
    assert_eq!(seen, MEMBERS.len(), "the manifests were found");
    for name in table.iter().flat_map(|(user, used)| used.iter().chain([user])) {
        assert!(
            MEMBERS.iter().any(|(_, member)| member == name),
            "the page names {name}, which is no member"
        );
    }
}

#[test]
fn unsafe_code_and_ash_stay_in_their_place() {
    let mut places = 0;
    for (file, text) in sources("", "rs") {
        let code = code(&text);
        // In this file the words are in strings.
        if file.starts_with("tests/tests/arrows/") {
            continue;
        }
        let words = |word: &str| code.split(|c: char| !(c.is_alphanumeric() || c == '_')).any(|w| w == word);
        let here = UNSAFE.iter().any(|place| file.starts_with(place));
        places += usize::from(here);
        assert!(here || !words("unsafe"), "{file}: unsafe code");
        assert!(here || !words("ash"), "{file}: ash");
        let crate_root = file.ends_with("src/lib.rs") || file.ends_with("src/main.rs");
        let (forbids, denies) =
            (text.contains("#![forbid(unsafe_code)]"), text.contains("#![deny(unsafe_code)]"));
        assert!(
            !crate_root || forbids || here || file.starts_with("xr-app/") && denies,
            "{file} must forbid unsafe code"
        );
    }
    assert!(places >= 4, "the Vulkan layer was found");
}

#[test]
fn files_are_short_or_say_why_not() {
    let mut files = sources("", "rs");
    for ending in ["comp", "vert", "frag", "glsl"] {
        files.extend(sources("shaders-glsl", ending));
    }
    assert!(files.len() > 60, "the sources were found");
    for (file, text) in files {
        let lines = text.lines().count();
        assert!(
            lines <= LONG || text.contains("//! long:"),
            "{file} has {lines} lines and no `//! long:` reason"
        );
    }
}

#[test]
fn every_kernel_says_what_it_does() {
    let kernels = sources("shaders-glsl", "comp");
    assert_eq!(kernels.len(), shaders_glsl::KERNELS.len(), "a kernel is one .comp file");
    for (file, text) in kernels {
        let mut lines = text.lines();
        assert!(lines.next().is_some_and(|l| l.starts_with("#version")), "{file} begins with its version");
        let header: Vec<_> = lines.take_while(|l| l.starts_with("//")).collect();
        assert!(
            header.concat().len() > 80,
            "{file} has a header that says what it computes and who owns what"
        );
    }
}
