//! The numbers that host and shaders share, read from GLSL: part of the build scripts of this crate and of `interface`.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Constants by the stem of their file and their name; each has its item and its file.
pub type Modules = BTreeMap<String, BTreeMap<String, (String, String)>>;

/// Returns the files of a folder, sorted.
pub fn list(folder: &Path) -> Vec<PathBuf> {
    let mut files: Vec<_> = fs::read_dir(folder)
        .unwrap_or_else(|e| panic!("{}: {e}", folder.display()))
        .map(|f| f.expect("a readable folder").path())
        .collect();
    files.sort();
    files
}

/// Notes the constants of a source that are plain numbers: lines such as `const uint PLANES = 8;`.
pub fn read_constants(file: &Path, root: &Path, modules: &mut Modules) {
    let shown = file.strip_prefix(root).unwrap_or(file).to_string_lossy().into_owned();
    let module = file.file_stem().expect("a file has a name").to_string_lossy().into_owned();
    for line in fs::read_to_string(file).expect("a listed file is readable").lines() {
        let Some((declared, value)) = line
            .strip_prefix("const ")
            .and_then(|rest| rest.split(';').next())
            .and_then(|statement| statement.split_once(" = "))
        else {
            continue;
        };
        let value = value.trim_end_matches('u');
        let (ty, value) = match declared.split_once(' ') {
            Some(("uint", _)) => match value.strip_prefix("0x") {
                Some(digits) => ("u32", u32::from_str_radix(digits, 16).ok().map(|v| v.to_string())),
                None => ("u32", value.parse::<u32>().ok().map(|v| v.to_string())),
            },
            Some(("float", _)) => ("f32", value.parse::<f32>().ok().map(|v| format!("{v:?}"))),
            _ => continue,
        };
        let (Some(value), Some((_, name))) = (value, declared.split_once(' ')) else { continue };
        let item = format!("pub const {name}: {ty} = {value};");
        let before =
            modules.entry(module.clone()).or_default().insert(name.to_owned(), (item.clone(), shown.clone()));
        assert!(
            before.is_none_or(|(other, _)| other == item),
            "{shown}: {name} differs from another {module}'s"
        );
    }
}

/// Returns the module of these constants.
pub fn module(name: &str, constants: &BTreeMap<String, (String, String)>) -> String {
    let items: String =
        constants.iter().map(|(name, (item, file))| format!("/// `{name}` of `{file}`\n{item}\n")).collect();
    format!("/// Constants of the shaders called `{name}`.\npub mod {name} {{\n{items}}}\n")
}
