//! What surrounds the program: paths, environment, locale, streams, signals and drivers that are not as usual.

use std::ffi::OsStr;
use std::io::{BufRead, BufReader};
use std::os::unix::ffi::OsStrExt;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::support::{Folder, QUICK, finish, fit};

/// Inputs and outputs are where their names say, whatever these look like.
#[test]
fn any_path_is_a_path() {
    let folder = Folder::new(12);
    let odd: [&[u8]; 6] =
        [b"a b", b"~", b"C:\\scans", b"-o", "Kopf_\u{e4}\u{1f480}".as_bytes(), b"latin-1 \xe4\xff"];
    for name in odd {
        let inner = folder.path(".").join(OsStr::from_bytes(name));
        std::fs::create_dir(&inner).expect("a folder");
        let [ct, out] = ["ct.nii.gz", "s.ply"].map(|file| inner.join(file));
        std::fs::copy(folder.path("ct.nii.gz"), &ct).expect("a copy");
        let mut command = folder.command(&["fit", "--roi-threshold", "-200,3000", "--no-eval", "--quiet"]);
        let output = command.args(QUICK).arg(&ct).arg("-o").arg(&out).output().expect("the program starts");
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{}: {told}", inner.display());
        assert!(out.exists() && inner.join("s.run.json").exists(), "{}", inner.display());
    }
    // Relative to the folder, where a name could be taken for a flag or for the home folder.
    assert_eq!(folder.run(&["info", "~/ct.nii.gz", "./-o/s.ply"]).code, 0);
    let long = format!("{}.ply", "x".repeat(300));
    let ended = folder.run(&fit(&long, &[]));
    assert_eq!(ended.code, 73, "{}", ended.err);
    let ended = folder.run(&["info", &long]);
    assert!(ended.code == 74 && ended.err.contains("too long"), "{}: {}", ended.code, ended.err);
}

/// Numbers have a point, times are UTC and nothing in the files depends on where the program runs.
#[test]
fn locale_and_time_zone_change_nothing() {
    let folder = Folder::new(12);
    let run = |output: &str, variables: &[(&str, &str)]| {
        let mut command = folder.command(&fit(output, &["--no-eval", "--density", "0.5"]));
        command.envs(variables.iter().copied());
        let output = command.output().expect("the program starts");
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    };
    run("here.ply", &[]);
    run("there.ply", &[("LC_ALL", "de_DE.UTF-8"), ("LANG", "de_DE.UTF-8"), ("TZ", "Pacific/Kiritimati")]);
    run("nowhere.ply", &[("LC_ALL", "xx"), ("TZ", "Mars/Phobos"), ("HOME", "/nonexistent")]);
    let here = folder.read("here.ply");
    assert!(folder.read("there.ply") == here && folder.read("nowhere.ply") == here);
    assert!(folder.text("there.csv").lines().skip(1).all(|line| line.contains('.')));
}

#[test]
fn variables_that_cannot_be_read_are_told() {
    let folder = Folder::new(8);
    for (variable, value, exit, says) in [
        ("VGS_SHELL", "many", 2, "shell"),
        ("VGS_SEED", "-1", 2, "seed"),
        ("VGS_HU_RANGE", "1,2,3", 2, "hu"),
        ("VGS_RATE_MEAN", "0,2", 2, "rate"),
        ("VGS_MAX_BYTES", "lots", 2, "lots"),
        ("VGS_DEVICE", "no such device", 69, "no such device"),
        ("VGS_PROFILE", "best", 2, "best"),
    ] {
        let mut command = folder.command(&fit("x.ply", &["--no-eval"]));
        let output = command.env(variable, value).output().expect("the program starts");
        let told = String::from_utf8_lossy(&output.stderr).to_lowercase();
        assert_eq!(output.status.code(), Some(exit), "{variable}: {told}");
        assert!(told.contains(&says.to_lowercase()), "{variable}: {told}");
        assert!(!folder.path("x.ply").exists());
    }
}

/// Nobody reads what is said: the command does its work all the same, and its exit code says how it went.
#[test]
fn a_full_or_closed_stderr_is_no_panic() {
    let folder = Folder::new(8);
    let full = || std::fs::OpenOptions::new().write(true).open("/dev/full").expect("/dev/full");
    let run = |arguments: &[&str]| {
        let mut command = folder.command(arguments);
        command.stderr(full()).output().expect("the program starts").status.code()
    };
    assert_eq!(run(&fit("a.ply", &["-vv"])), Some(0));
    assert!(folder.path("a.ply").exists());
    assert_eq!(run(&["info", "none.nii"]), Some(66));
    assert_eq!(run(&["fit", "--nonsense"]), Some(2));
    let mut closed = folder.command(&["info", "none.nii"]).spawn().expect("the program starts");
    drop(closed.stderr.take());
    assert_eq!(finish(closed).code, 66);
}

/// A pipe that nobody writes to, in place of any file that is read.
#[test]
fn a_pipe_as_input_is_refused_at_once() {
    let folder = Folder::new(8);
    assert_eq!(folder.run(&fit("a.ply", &["--no-eval"])).code, 0);
    for name in ["pipe.nii", "pipe.ply", "pipe.vgs", "pipe.json", "pipe.toml", "pipe.png", "pipe.dcm"] {
        assert!(Command::new("mkfifo").arg(folder.path(name)).status().expect("mkfifo").success());
    }
    for arguments in [
        &["info", "pipe.nii"][..],
        &["info", "pipe.ply"],
        &["info", "pipe.dcm"],
        &["fit", "pipe.nii", "--roi", "mask.nii.gz", "-o", "b.ply"],
        &["fit", "ct.nii.gz", "--roi", "pipe.nii", "-o", "b.ply"],
        &["fit", "ct.nii.gz", "--roi", "mask.nii.gz", "-o", "b.ply", "--config", "pipe.toml"],
        &["convert", "pipe.vgs", "-o", "b.ply"],
        &["convert", "a.ply", "-o", "b.spz", "--tf", "pipe.json"],
        &["compare", "pipe.png", "pipe.png"],
        &["view", "pipe.toml"],
    ] {
        let begin = Instant::now();
        let ended = folder.run(arguments);
        assert_eq!(ended.code, 65, "{arguments:?}: {}", ended.err);
        assert!(ended.err.contains("is a pipe, not a file"), "{arguments:?}: {}", ended.err);
        assert!(begin.elapsed() < Duration::from_secs(20), "{arguments:?}");
    }
}

/// What is asked for on stdout has to arrive.
#[test]
fn a_full_stdout_is_told_by_help_and_version_too() {
    let folder = Folder::new(8);
    for arguments in [
        &["--help"][..],
        &["-h"],
        &["fit", "--help"],
        &["help", "info"],
        &["--version"],
        &["completions", "bash"],
    ] {
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full").expect("/dev/full");
        let mut command = folder.command(arguments);
        let output = command.stdout(full).output().expect("the program starts");
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(74), "{arguments:?}: {told}");
        assert!(told.contains("VGS-CLI-002"), "{arguments:?}: {told}");
        let mut closed = folder.start(arguments);
        drop(closed.stdout.take());
        assert_eq!(finish(closed).code, 0, "{arguments:?}: a closed pipe is no error");
    }
}

/// The first signal lets the fit save what it has; the second one does not wait for that.
#[test]
fn a_second_signal_ends_at_once_and_a_hangup_saves() {
    let long = ["--splats", "40", "--iterations", "10000000"];
    let start = |folder: &Folder| {
        let fit = ["fit", "ct.nii.gz", "--roi", "mask.nii.gz", "-o", "a.ply", "--no-eval"];
        let mut child = folder.start(&[&fit[..], &long].concat());
        let mut said = BufReader::new(child.stderr.take().expect("a pipe"));
        let mut before = String::new();
        while !before.contains("fitting 40 splats") {
            assert_ne!(said.read_line(&mut before).expect("text"), 0, "it ended: {before}");
        }
        (child, said)
    };
    let send = |id: u32, signals: &[&str]| {
        for signal in signals {
            let sent = Command::new("kill").args([*signal, &id.to_string()]).status();
            assert!(sent.expect("kill").success());
        }
    };
    let folder = Folder::new(16);
    let (child, _said) = start(&folder);
    send(child.id(), &["-HUP"]);
    assert_eq!(finish(child).code, 129);
    assert_eq!(folder.run(&["info", "a.ply", "--json"]).json()["splats"], 40);

    let folder = Folder::new(16);
    let (child, _said) = start(&folder);
    let begin = Instant::now();
    send(child.id(), &["-STOP", "-INT", "-TERM", "-CONT"]);
    let ended = finish(child);
    assert!([130, 143].contains(&ended.code), "{}", ended.code);
    assert!(begin.elapsed() < Duration::from_secs(5), "{:?}", begin.elapsed());
    assert!(!folder.path("a.ply.lock").exists(), "the lock goes with its process");
}

/// Without a driver that there is, whatever else the machine has.
#[test]
fn without_a_device_it_says_so() {
    let folder = Folder::new(8);
    for (arguments, exit) in [(fit("a.ply", &[]), 69), (vec!["info", "ct.nii.gz"], 0)] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_vgs"));
        command.args(arguments).current_dir(folder.path(".")).stdin(Stdio::null());
        for variable in ["LD_LIBRARY_PATH", "VK_ADD_DRIVER_FILES", "VK_LAYER_PATH"] {
            command.env_remove(variable);
        }
        command.env("VK_DRIVER_FILES", "/nonexistent.json").env("VK_ICD_FILENAMES", "/nonexistent.json");
        let output = command.output().expect("the program starts");
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(exit), "{told}");
        assert!(exit == 0 || told.contains("error[VGS-GPU-00") && told.contains("help: "), "{told}");
    }
    assert!(!folder.path("a.ply").exists());
}

/// What was meant as the volume is no mask, and is told from one.
#[test]
fn volume_and_mask_that_were_swapped_are_told() {
    let folder = Folder::new(12);
    let swapped = ["fit", "mask.nii.gz", "--roi", "ct.nii.gz", "-o", "x.ply"];
    let ended = folder.run(&swapped);
    assert_eq!(ended.code, 65, "{}", ended.err);
    assert!(ended.err.contains("ct.nii.gz"), "{}", ended.err);
    let ended = folder.run(&[
        "fit",
        "mask.nii.gz",
        "--roi",
        "mask.nii.gz",
        "-o",
        "x.ply",
        "--no-eval",
        "--iterations",
        "2",
    ]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert!(ended.err.contains("were volume and mask swapped?"), "{}", ended.err);
}
