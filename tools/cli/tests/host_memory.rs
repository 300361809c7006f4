//! A program that may take only so much memory (`ulimit -v`) does what is asked, or ends with the exit code for it:
//! never by a signal, and never as if the fault were its own. (These are commands without a device: lavapipe itself
//! dies where it gets no memory.)

use std::process::{Command, Output};

use crate::support::Folder;
use engine::volume::{Volume, nifti};
use glam::DAffine3;

/// Runs a command within so many MiB of address space.
fn within(folder: &Folder, mib: u32, arguments: &[&str]) -> Output {
    let command = folder.command(arguments);
    let mut limited = Command::new("sh");
    limited.args(["-c", "ulimit -v $1; shift; exec \"$@\"", "sh", &(mib * 1024).to_string()]);
    limited.arg(command.get_program()).args(command.get_args()).current_dir(folder.path("."));
    // A backtrace of an allocation that failed takes many seconds.
    limited.env("RUST_BACKTRACE", "0").output().expect("sh")
}

/// The address space, in MiB, that the program and its libraries themselves take: it depends on how they are compiled.
fn own(folder: &Folder) -> u32 {
    let starts = |mib: &u32| within(folder, *mib, &["--version"]).status.success();
    (16..1024).step_by(2).find(starts).expect("a program that starts in 1 GiB")
}

#[test]
fn without_memory_it_ends_with_its_exit_code() {
    let folder = Folder::new(8);
    // 12 million voxels take 48 MB as numbers of 32 bits.
    let voxels = (0..230 * 230 * 230).map(|i| (i % 1000) as f32).collect();
    let volume = Volume::new([230; 3], DAffine3::IDENTITY, voxels);
    nifti::write(folder.path("large.nii"), &volume, false).expect("a file");
    let own = own(&folder);
    let commands: [&[&str]; 2] = [&["info", "large.nii"], &["compare", "large.nii", "large.nii"]];
    for arguments in commands {
        let codes = [6, 30, 70, 150, 1450].map(|mib| {
            let ended = within(&folder, own + mib, arguments);
            let said = String::from_utf8_lossy(&ended.stderr);
            let code = ended.status.code();
            assert!(
                matches!(code, Some(0 | 71)),
                "{arguments:?} in {own} + {mib} MiB: {:?}: {said}",
                ended.status
            );
            code
        });
        assert!(codes[0] == Some(71) && codes[4] == Some(0), "{arguments:?}: {codes:?}");
    }
    // What is not a reader's does not ask before: the allocation itself fails.
    let ended = within(&folder, own + 26, &["phantom", "-o", "phantom.nii", "--size", "230"]);
    let said = String::from_utf8_lossy(&ended.stderr);
    assert_eq!(ended.status.code(), Some(71), "{:?}: {said}", ended.status);
    assert!(said.contains("memory allocation of 48668000 bytes failed"), "{said}");
}
