//! The n-th failing write: whichever of its bytes the disk has no room for, an output is the old one or the new
//! one, no temporary file is left, and the message says which file it was.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::support::{Folder, fit};

/// `command`, started by a shell in which `before` has run; `$1` is `argument`, the program and its arguments
/// are `$@` after a shift.
fn within(command: &Command, before: &str, argument: &str) -> Output {
    let mut shell = Command::new("sh");
    shell.args(["-c", before, "sh", argument]).arg(command.get_program()).args(command.get_args());
    shell.current_dir(command.get_current_dir().expect("a folder"));
    shell.output().expect("sh")
}

/// Each file is as it was before, or as a run leaves it that succeeds.
fn assert_old_or_new(
    found: &BTreeMap<PathBuf, Vec<u8>>,
    old: &BTreeMap<PathBuf, Vec<u8>>,
    new: &BTreeMap<PathBuf, Vec<u8>>,
    what: &str,
) {
    let names = |files: &BTreeMap<PathBuf, Vec<u8>>| files.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(found), names(old), "{what}: no file more or less");
    for (path, bytes) in found {
        assert!(*bytes == old[path] || *bytes == new[path], "{what}: {} is neither", path.display());
    }
}

/// A limit of the size of files, from one block (512 bytes) on until all outputs fit. (A software driver keeps its
/// memory in files, so these are commands without a device.)
#[test]
fn whichever_block_is_refused() {
    let folder = Folder::new(20);
    assert_eq!(folder.run(&fit("a.ply", &["--no-eval"])).code, 0);
    assert_eq!(folder.run(&["convert", "a.ply", "-o", "b.vgs"]).code, 0);
    assert_eq!(folder.run(&["convert", "b.vgs", "-o", "c.vgs"]).code, 0);
    assert_eq!(folder.run(&["phantom", "-o", ".", "--size", "20", "--seed", "1", "--force"]).code, 0);
    for (arguments, outputs) in [
        (
            &["phantom", "-o", ".", "--size", "20", "--seed", "2", "--force"][..],
            &["ct.nii.gz", "mask.nii.gz"][..],
        ),
        (&["convert", "b.vgs", "-o", "c.vgs", "--force"], &["c.vgs"]),
        (&["convert", "b.vgs", "-o", "a.ply", "--force"], &["a.ply"]),
    ] {
        let old = folder.contents();
        assert_eq!(folder.run(arguments).code, 0);
        let new = folder.contents();
        assert!(
            outputs.iter().all(|name| old[&folder.path(name)] != new[&folder.path(name)])
                || outputs == ["c.vgs"]
        );
        let mut failures = 0;
        for blocks in 0.. {
            old.iter().for_each(|(path, bytes)| std::fs::write(path, bytes).expect("as before"));
            let what = format!("{} within {blocks} blocks", arguments.join(" "));
            let ended =
                within(&folder.command(arguments), "ulimit -f $1; shift; exec \"$@\"", &blocks.to_string());
            if ended.status.success() {
                assert!(folder.contents() == new, "{what}");
                break;
            }
            failures += 1;
            let said = String::from_utf8_lossy(&ended.stderr);
            assert_eq!(ended.status.code(), Some(74), "{what}: {said}");
            let named: Vec<_> = outputs.iter().filter(|name| said.contains(**name)).collect();
            assert!(said.contains("File too large") && named.len() == 1, "{what}: {said}");
            assert_old_or_new(&folder.contents(), &old, &new, &what);
            let of = folder.path(named[0]);
            assert!(folder.contents()[&of] == old[&of], "{what}: what it says failed is as before");
        }
        assert!(failures > 2, "{}: {failures} failures", arguments.join(" "));
    }
}

/// A disk (of memory, in a name space of its own) that has no room for some of what a fit writes.
#[test]
fn whatever_of_a_fit_the_disk_has_no_room_for() {
    let allowed = Command::new("unshare").args(["-rm", "true"]).status().is_ok_and(|s| s.success());
    if !allowed {
        println!("skipped: no name space can be made here (unshare -rm)");
        return;
    }
    let folder = Folder::new(16);
    std::fs::create_dir(folder.path("old")).expect("a folder");
    std::fs::create_dir(folder.path("disk")).expect("a folder");
    assert_eq!(folder.run(&fit("old/s.ply", &["--seed", "2"])).code, 0);
    let old = files(&folder.path("old"));
    let again = folder.command(&fit("disk/s.ply", &["--force", "--checkpoint-every", "8"]));
    let (mut failures, mut kib) = (0, 24);
    loop {
        let what = format!("a disk of {kib} KiB");
        let _ = std::fs::remove_dir_all(folder.path("after"));
        let script = "mount -t tmpfs -o size=${1}k none disk && cp old/* disk/ || exit 99\n\
                      shift; \"$@\"; code=$?\ncp -r disk after; exit $code";
        let mut shell = Command::new("unshare");
        shell.args(["-rm", "sh", "-c", script, "sh", &kib.to_string()]);
        shell.arg(again.get_program()).args(again.get_args()).current_dir(folder.path("."));
        let ended = shell.output().expect("unshare");
        let said = String::from_utf8_lossy(&ended.stderr);
        if ended.status.code() == Some(99) {
            // The old files do not fit.
            kib += 4;
            continue;
        }
        let found = files(&folder.path("after"));
        assert!(
            found.keys().all(|name| !name.ends_with(".tmp") && !name.ends_with(".lock")),
            "{what}: {:?}",
            found.keys()
        );
        if ended.status.success() {
            break;
        }
        failures += 1;
        println!("{what}: {said}");
        // Without room for its lock a fit cannot begin.
        let code = if said.contains("cannot create the lock file") { 73 } else { 74 };
        assert_eq!(ended.status.code(), Some(code), "{what}: {said}");
        for (name, bytes) in &old {
            assert!(found[name] == *bytes, "{what}: {name} has changed: {said}");
        }
        kib += 4;
    }
    assert!(failures > 2, "{failures} failures");
}

/// The files of a folder, by name.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path());
    let name = |path: &Path| path.file_name().expect("a name").to_string_lossy().into_owned();
    entries.map(|path| (name(&path), std::fs::read(&path).expect("a file"))).collect()
}
