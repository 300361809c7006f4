//! The source tree is as it claims to be: who may use whom (the map in `engine/src/lib.rs` is the table), where unsafe
//! code is, how long files are, and that every kernel says what it does.
#![forbid(unsafe_code)]

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Lines that a file may have without a `//! long:` reason.
const LONG: usize = 700;
/// Modules of the engine that all others may use.
const COMMON: [&str; 2] = ["error", "output"];
/// Where unsafe code and ash may be: the Vulkan layer, the OpenXR half of the headset app, and its entry on Android.
const UNSAFE: [&str; 3] = ["engine/src/gpu/", "xr-app/src/headset/openxr.rs", "xr-app/src/android.rs"];

/// Which module may use which.
type Table = BTreeMap<String, BTreeSet<String>>;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("tests/ lies in the repository").to_owned()
}

/// All files below a folder with that ending, as (path from the root, content). Build folders are left out.
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

/// The code of a file: comments are gone, lines stay.
fn code(text: &str) -> String {
    text.lines().map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n")
}

/// Which module may use which, from the lines with arrows in the map: "a, b -> c -> d" lets a and b use c and d, and c
/// use d.
fn allowed(map: &str) -> Table {
    let mut table = Table::new();
    let lines = map.lines().filter_map(|line| line.strip_prefix("//! "));
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

/// The module path of a file below `engine/src/`.
fn module_path(file: &str) -> Vec<&str> {
    let path = file.trim_start_matches("engine/src/").trim_end_matches(".rs").trim_end_matches("/mod");
    path.split('/').filter(|part| *part != "lib").collect()
}

/// Arrows of some files that the table does not allow.
fn forbidden(files: &[(String, String)], table: &Table, modules: &BTreeSet<String>) -> Vec<String> {
    let mut out = Vec::new();
    for (file, text) in files {
        let path = module_path(file);
        let Some(&own) = path.first() else { continue };
        let may = table.get(own).cloned().unwrap_or_default();
        for name in used(&code(text), &path, modules) {
            if name != own && !COMMON.contains(&name.as_str()) && !may.contains(&name) {
                out.push(format!("{file}: {own} may not use {name}"));
            }
        }
    }
    out
}

fn engine() -> (Vec<(String, String)>, Table, BTreeSet<String>) {
    let files = sources("engine/src", "rs");
    let map = &files.iter().find(|(file, _)| file == "engine/src/lib.rs").expect("the map").1;
    let modules =
        files.iter().filter_map(|(file, _)| module_path(file).first().map(|m| (*m).to_owned())).collect();
    (files.clone(), allowed(map), modules)
}

#[test]
fn the_engine_keeps_its_arrows() {
    let (files, table, modules) = engine();
    assert!(files.len() > 30 && modules.len() > 5, "the engine was found");
    let wrong = forbidden(&files, &table, &modules);
    assert!(
        wrong.is_empty(),
        "arrows that the map in engine/src/lib.rs does not allow:\n{}",
        wrong.join("\n")
    );
    for module in &modules {
        let listed = table.contains_key(module) || table.values().any(|row| row.contains(module));
        assert!(
            listed || COMMON.contains(&module.as_str()),
            "the map in engine/src/lib.rs does not know {module}"
        );
    }
}

/// The checker itself, on arrows that must not be.
#[test]
fn forbidden_arrows_are_found() {
    let (_, table, modules) = engine();
    let row = |user: &str| table.get(user).cloned().unwrap_or_default();
    assert!(row("fit").contains("gpu") && row("fit").contains("volume") && row("passes").contains("splat"));
    for (user, used) in
        [("gpu", "volume"), ("volume", "splat"), ("splat", "volume"), ("reference", "gpu"), ("passes", "fit")]
    {
        assert!(!row(user).contains(used), "the map must not let {user} use {used}");
    }
    for (file, text, expected) in [
        ("gpu/memory.rs", "use crate::volume::Roi;", 1),
        ("gpu/memory.rs", "use crate::error::Result; // crate::volume", 0),
        ("gpu/memory.rs", "use super::super::splat::Splat;", 1),
        ("gpu/mod.rs", "use super::fit::Fitter;", 1),
        ("gpu/kernel.rs", "use super::memory::Buffer; use super::super::super::volume;", 0),
        ("splat/ply/read.rs", "fn f() -> crate::volume::Roi {}", 1),
        ("volume/mod.rs", "use crate::{Error, Kind, gpu::{Gpu, Buffer}, splat};", 2),
        ("reference/loss.rs", "use crate::{\n    gpu,\n};", 1),
        ("passes/bin.rs", "use crate::fit::FitConfig; use crate::volume::Bricks;", 1),
        ("fit/init.rs", "use crate::volume::Roi; use crate::splat::Splat; use crate::passes;", 0),
    ] {
        let files = [(format!("engine/src/{file}"), text.to_owned())];
        let found = forbidden(&files, &table, &modules);
        assert_eq!(found.len(), expected, "{file}: {text}: {found:?}");
    }
}

/// Which crates of this workspace a manifest depends on.
fn members_used(manifest: &str) -> BTreeSet<&str> {
    let line = |line: &str| line.split(['.', ' ', '=']).next().map(str::to_owned);
    let names = ["engine", "shaders-glsl", "view"];
    names.into_iter().filter(|name| manifest.lines().any(|l| line(l).as_deref() == Some(*name))).collect()
}

#[test]
fn crates_keep_their_arrows() {
    let manifests = sources("", "toml");
    let mut seen = 0;
    for (file, text) in manifests.iter().filter(|(file, _)| file.ends_with("/Cargo.toml")) {
        let used = members_used(text);
        let may: &[&str] = match file.trim_end_matches("/Cargo.toml") {
            "shaders-glsl" => &[],
            "engine" => &["shaders-glsl"],
            "tools/view" => &["engine", "shaders-glsl"],
            "tests" => &["engine", "shaders-glsl", "view"],
            "tools/cli" => &["engine", "view"],
            "xr-app" => &["engine", "shaders-glsl", "view"],
            _ => &["engine"], // other tools
        };
        let wrong: Vec<_> = used.iter().filter(|name| !may.contains(name)).collect();
        assert!(wrong.is_empty(), "{file} may not use {wrong:?}");
        let ash = text.lines().any(|line| line.starts_with("ash"));
        assert!(!ash || file.starts_with("engine/") || file.starts_with("xr-app/"), "{file} may not use ash");
        seen += 1;
    }
    assert!(seen >= 4, "the manifests were found");
}

#[test]
fn unsafe_code_and_ash_stay_in_their_place() {
    let mut places = 0;
    for (file, text) in sources("", "rs") {
        let code = code(&text);
        // In this file the words are in strings.
        if file == "tests/tests/arrows.rs" {
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
        let may_deny = file.starts_with("engine/") || file.starts_with("xr-app/");
        assert!(!crate_root || forbids || may_deny && denies, "{file} must forbid unsafe code");
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
    assert_eq!(kernels.len(), shaders_glsl::ALL.len(), "a kernel is one .comp file");
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
