//! Checks the files that a command will write, before anything is read or computed.

use std::path::{Path, PathBuf};

use engine::output::{check_writable, same_file};
use engine::volume::check_output;
use engine::{Error, Kind, Result};

/// Returns an error for outputs that cannot be written, that are also inputs, or that have the same name.
pub fn check(outputs: &[&Path], inputs: &[&Path], force: bool) -> Result<()> {
    for (i, output) in outputs.iter().enumerate() {
        if outputs[..i].contains(output) {
            let message = "two outputs have the same name";
            return Err(Error::new(Kind::Usage, "VGS-CLI-020", message).file(output));
        }
        if let Some(input) = inputs.iter().find(|input| same_file(input, output)) {
            let message = format!("the output is the input {}", input.display());
            return Err(Error::new(Kind::CannotCreate, "VGS-CLI-021", message)
                .file(output)
                .help("choose another name for the output"));
        }
        let is_folder = output.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("zarr"));
        if is_folder { check_output(output, force)? } else { check_writable(output, force)? }
    }
    Ok(())
}

/// Creates a folder for outputs, if there is none yet.
pub fn make_folder(path: &Path) -> Result<()> {
    if path.exists() {
        return Ok(());
    }
    std::fs::create_dir(path).map_err(|e| {
        Error::new(Kind::CannotCreate, "VGS-CLI-061", format!("cannot make the folder: {e}")).file(path)
    })
}

/// Returns the file with `ending` that belongs to the output `path`. A PLY has side files of its name alone, others of
/// their whole name, so that two formats of one name do not share them: `a.ply` has `a.run.json`, and `a.vgs` has
/// `a.vgs.run.json`.
pub fn beside(path: &Path, ending: &str) -> PathBuf {
    let is_ply = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("ply"));
    let name = if is_ply { path.file_stem() } else { path.file_name() };
    let mut name = name.unwrap_or_default().to_owned();
    name.push(ending);
    path.with_file_name(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn side_files_belong_to_one_output() {
        let name = |path: &str| beside(Path::new(path), ".run.json").display().to_string();
        assert_eq!(name("out/a.ply"), "out/a.run.json");
        assert_eq!(name("a.b.PLY"), "a.b.run.json");
        assert_eq!(name("out/a.vgs"), "out/a.vgs.run.json");
    }
}
