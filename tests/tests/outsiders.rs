//! What vgs reads agrees with what other programs read: `tests/outsiders` writes files over the product of options at the
//! edges of their formats, and takes the odd files that Python packages bring. `tools/setup outsiders` gets the programs;
//! without them this is left out.
//!
//! `VGS_WRITE_OUTSIDERS=1` writes docs/results/outsiders.md anew.

use std::path::Path;
use std::process::{Command, Stdio};

#[test]
fn vgs_reads_what_other_programs_read() {
    let Some(python) = super::set_up("outsiders") else { return };
    let voxels = Path::new(env!("CARGO_BIN_EXE_voxels"));
    // The program itself, where it is built too, as by a test run of the workspace.
    let vgs = voxels.with_file_name("vgs").with_extension(std::env::consts::EXE_EXTENSION);
    let mut command = Command::new(python);
    command.env("PYTHONDONTWRITEBYTECODE", "1").arg(super::root().join("tests/outsiders")).arg(voxels);
    if vgs.exists() {
        command.arg("--vgs").arg(vgs);
    }
    if std::env::var_os("VGS_WRITE_OUTSIDERS").is_some() {
        command.arg("--write");
    }
    let status = command.stdin(Stdio::null()).status().expect("Python");
    assert!(
        status.success(),
        "vgs reads otherwise than other programs, or docs/results/outsiders.md is old: see above"
    );
}
