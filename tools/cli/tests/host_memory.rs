//! A program that may take only so much memory (`ulimit -v`) does what is asked, or ends with the exit code for it:
//! never by a signal, and never as if the fault were its own. (These are commands without a device: lavapipe itself
//! dies where it gets no memory.)

mod support;

use std::process::Command;

use support::Folder;

#[test]
fn without_memory_it_ends_with_its_exit_code() {
    let folder = Folder::new(16);
    // 12 million voxels take 48 MB as numbers of 32 bits.
    assert_eq!(folder.run(&["phantom", "-o", "large.nii", "--size", "230", "--mask", "mask.nii"]).code, 0);
    let commands: [&[&str]; 3] = [
        &["phantom", "-o", "large.nii", "--size", "230", "--force"],
        &["info", "large.nii"],
        &["compare", "large.nii", "mask.nii", "--range", "0,1000"],
    ];
    for arguments in commands {
        let (mut lacking, mut last) = (0, -1);
        for mib in [40, 80, 120, 200, 400, 1500] {
            let command = folder.command(arguments);
            let mut limited = Command::new("sh");
            limited.args(["-c", "ulimit -v $1; shift; exec \"$@\"", "sh", &(mib * 1024).to_string()]);
            limited.arg(command.get_program()).args(command.get_args()).current_dir(folder.path("."));
            // A backtrace of an allocation that failed takes many seconds.
            limited.env("RUST_BACKTRACE", "0");
            let ended = limited.output().expect("sh");
            let said = String::from_utf8_lossy(&ended.stderr);
            let code = ended.status.code();
            let what = format!("{} in {mib} MiB: {:?}: {said}", arguments.join(" "), ended.status);
            assert!(matches!(code, Some(0 | 71)), "{what}");
            lacking += usize::from(code == Some(71));
            last = code.unwrap_or(-1);
        }
        assert!(lacking > 0 && last == 0, "{arguments:?}: {lacking} times without memory");
    }
}
