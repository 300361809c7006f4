//! Tests that the table of `lib.rs` is true.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Reads the table: kernel -> file below `engine`.
fn table() -> BTreeMap<&'static str, String> {
    let quoted = |cell: &'static str| cell.split('`').skip(1).step_by(2);
    let mut found = BTreeMap::new();
    for line in include_str!("lib.rs").lines() {
        let cells: Vec<_> = line.split('|').collect();
        let ["//! ", files, kernels, _, ""] = cells[..] else { continue };
        for kernel in quoted(kernels) {
            let file = quoted(files).next().expect("a kernel has a file");
            let (member, file) = file.split_once('/').unwrap_or(("passes", file));
            let before = found.insert(kernel, format!("{member}/src/{file}.rs"));
            assert!(before.is_none(), "{kernel} is in the table twice");
        }
    }
    found
}

/// Finds all sources of the engine.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a readable folder") {
        let path = entry.expect("a readable folder").path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            found.push(path);
        }
    }
}

/// Returns true if the text names the shader.
fn uses(text: &str, item: &str) -> bool {
    let path = format!("glsl::{item}");
    text.match_indices(&path)
        .any(|(at, _)| !text[at + path.len()..].starts_with(|c: char| c.is_alphanumeric() || c == '_'))
}

#[test]
fn every_kernel_is_recorded_in_the_file_that_the_table_names() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut files = Vec::new();
    sources(&root, &mut files);
    let texts: Vec<_> = files
        .iter()
        .map(|file| {
            let name = file.strip_prefix(&root).expect("below engine").to_string_lossy().replace('\\', "/");
            (name, std::fs::read_to_string(file).expect("UTF-8"))
        })
        .collect();
    let mut table = table();
    for shader in shaders_glsl::KERNELS {
        let named = table.remove(shader.name).unwrap_or_else(|| panic!("the table lacks {}", shader.name));
        let item = shader.name.to_uppercase();
        let found: Vec<_> =
            texts.iter().filter(|(_, text)| uses(text, &item)).map(|(name, _)| name).collect();
        assert_eq!(found, [&named], "{}: the files that use it, and that of the table", shader.name);
    }
    assert!(table.is_empty(), "the table has kernels that are none: {table:?}");
}
