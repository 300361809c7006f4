//! The sources of the command line use each other downward alone: main, then commands, then report and picture, then what
//! they share; and no command uses another.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// What each folder of `src` may use; within itself it is free, but for `commands`.
const FLOORS: [(&str, &[&str]); 4] = [
    ("commands", &["report", "picture", "shared"]),
    ("report", &["shared"]),
    ("picture", &["shared"]),
    ("shared", &[]),
];

/// Returns the sources below a folder, by their path from there, without comments and tests.
fn sources(folder: &Path) -> BTreeMap<String, String> {
    let mut found = BTreeMap::new();
    let mut open = vec![folder.to_owned()];
    while let Some(next) = open.pop() {
        for entry in fs::read_dir(&next).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                open.push(path);
            } else {
                let text = fs::read_to_string(&path).expect("a source");
                let code = text.split("#[cfg(test)]").next().unwrap_or_default();
                let code = code.lines().filter(|line| !line.trim_start().starts_with("//"));
                let name = path.strip_prefix(folder).expect("below it").to_string_lossy().replace('\\', "/");
                found.insert(name, code.collect::<Vec<_>>().join("\n"));
            }
        }
    }
    found
}

/// Returns the first words behind each occurrence of `start`.
fn words_after<'a>(code: &'a str, start: &str) -> Vec<&'a str> {
    let word =
        |rest: &'a str| rest.split(|c: char| !(c.is_alphanumeric() || c == '_')).next().unwrap_or_default();
    code.match_indices(start).map(|(at, _)| word(&code[at + start.len()..])).collect()
}

/// Returns the arrows of a source that run up or between commands.
fn forbidden(file: &str, code: &str) -> Vec<String> {
    let Some((folder, rest)) = file.split_once('/') else { return Vec::new() };
    let Some((_, may)) = FLOORS.iter().find(|(name, _)| *name == folder) else {
        return vec![format!("{file}: {folder} has no floor")];
    };
    let mut out = Vec::new();
    for used in words_after(code, "crate::") {
        let inside = used == folder && folder != "commands";
        if !inside && !may.contains(&used) {
            out.push(format!("{file} uses crate::{used}"));
        }
    }
    // From a command itself, `super` is the others; from a file of its folder, `super::super` is.
    let up = if rest.contains('/') { "super::super::" } else { "super::" };
    if folder == "commands" && rest != "mod.rs" && code.contains(up) {
        out.push(format!("{file} uses {up}"));
    }
    out
}

#[test]
fn arrows_run_down_and_commands_do_not_use_each_other() {
    let sources = sources(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"));
    assert!(sources.len() > 40 && sources.contains_key("commands/mod.rs"), "the sources were found");
    let wrong: Vec<String> = sources.iter().flat_map(|(file, code)| forbidden(file, code)).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    let both = |file: &String| {
        let folder = file.trim_end_matches(".rs").to_owned() + "/mod.rs";
        sources.contains_key(&folder)
    };
    let doubled: Vec<&String> = sources.keys().filter(|file| both(file)).collect();
    assert!(doubled.is_empty(), "a file beside a folder of its name: {doubled:?}");
}

#[test]
fn forbidden_arrows_are_found() {
    for (file, code, count) in [
        ("commands/fit/run.rs", "use crate::report::curve; use super::stages;", 0),
        ("commands/fit/run.rs", "use crate::commands::eval;", 1),
        ("commands/fit/run.rs", "use super::super::eval;", 1),
        ("commands/eval.rs", "use super::fit;", 1),
        ("report/curve.rs", "use super::quality; use crate::shared::figures;", 0),
        ("report/curve.rs", "use crate::commands::fit;", 1),
        ("picture/sheet.rs", "use crate::report::quality;", 1),
        ("shared/flags.rs", "use super::inputs; fn f() -> crate::report::Quality {}", 1),
        ("other/a.rs", "", 1),
        ("main.rs", "use crate::commands::fit;", 0),
    ] {
        assert_eq!(forbidden(file, code).len(), count, "{file}: {code}");
    }
}
