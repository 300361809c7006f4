//! Signals and locks: what happens to a run that is stopped, and to a second one that comes in between.

use std::io::{BufRead, BufReader, Read};
use std::process::Child;
use std::time::{Duration, Instant};

use crate::support::{Folder, finish, fit};

/// A fit that would go on for hours.
fn endless(folder: &Folder) -> Child {
    let child = folder.start(&[
        "fit",
        "ct.nii.gz",
        "--roi",
        "mask.nii.gz",
        "-o",
        "a.ply",
        "--splats",
        "40",
        "--iterations",
        "10000000",
    ]);
    wait_for("the lock", || folder.path("a.ply.lock").exists());
    child
}

fn wait_for(what: &str, there: impl Fn() -> bool) {
    let start = Instant::now();
    while !there() {
        assert!(start.elapsed() < Duration::from_secs(60), "waiting for {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

fn send(child: &Child, signal: &str) {
    let sent = std::process::Command::new("kill").args([signal, &child.id().to_string()]).status();
    assert!(sent.expect("kill").success());
}

#[test]
fn a_signal_leaves_usable_splats() {
    for (signal, exit) in [("-INT", 130), ("-TERM", 143)] {
        let folder = Folder::new(16);
        let mut child = endless(&folder);
        let mut said = BufReader::new(child.stderr.take().expect("a pipe"));
        let mut before = String::new();
        while !before.contains("fitting 40 splats") {
            assert_ne!(said.read_line(&mut before).expect("text"), 0, "it ended: {before}");
        }
        send(&child, signal);
        let mut after = String::new();
        said.read_to_string(&mut after).expect("text");
        let ended = finish(child);
        assert_eq!(ended.code, exit, "{after}");
        assert!(ended.out.contains("stopped early: fitted 40 splats"), "{}", ended.out);
        let record: serde_json::Value = serde_json::from_str(&folder.text("a.run.json")).expect("a record");
        assert_eq!(record["end"], "stopped");
        let info = folder.run(&["info", "a.ply", "--json"]).json();
        assert_eq!(info["splats"], 40);
        let names: Vec<_> = folder.contents().into_keys().collect();
        assert_eq!(names.len(), 7, "two inputs, four outputs, the state, no litter: {names:?}");
    }
}

/// What a finished fit has left is not replaced by what a stopped one came to; what a stopped one has left is.
#[test]
fn a_stopped_fit_leaves_a_finished_one_alone() {
    let folder = Folder::new(16);
    let ended = folder.run(&fit("a.ply", &[]));
    assert_eq!(ended.code, 0, "{}", ended.err);
    let outputs = ["a.ply", "a.run.json", "a.csv", "a.svg"];
    let before = outputs.map(|name| folder.read(name));
    let stopped = |output: &str| {
        let child = folder.start(&[&LONG_RUN[..], &["-o", output, "--force"]].concat());
        wait_for("a checkpoint", || folder.path(&output.replace(".ply", ".000100.ply")).exists());
        send(&child, "-INT");
        finish(child)
    };
    let ended = stopped("a.ply");
    assert_eq!(ended.code, 130, "{}", ended.err);
    assert!(ended.err.contains("a.ply stays as it is"), "{}", ended.err);
    assert!(ended.out.contains("a.unfinished.ply") && ended.out.contains("a.state"), "{}", ended.out);
    assert!(outputs.map(|name| folder.read(name)) == before, "the finished fit is all there");
    let record: serde_json::Value =
        serde_json::from_str(&folder.text("a.unfinished.run.json")).expect("a record");
    assert_eq!(record["end"], "stopped");
    // Of two stopped fits the later one counts.
    for _ in 0..2 {
        let ended = stopped("b.ply");
        assert!(ended.code == 130 && ended.out.contains("written: b.ply"), "{}{}", ended.err, ended.out);
        std::fs::remove_file(folder.path("b.000100.ply")).expect("a checkpoint");
    }
    assert!(!folder.path("b.unfinished.ply").exists());
}

#[test]
fn a_second_run_on_the_same_output_is_told_to_wait() {
    let folder = Folder::new(16);
    let first = endless(&folder);
    let again = ["fit", "ct.nii.gz", "--roi", "mask.nii.gz", "-o", "a.ply"];
    let ended = folder.run(&again);
    assert_eq!(ended.code, 75, "{}", ended.err);
    assert!(
        ended.err.contains("a.ply: locked by process ") && ended.err.contains(" since 20"),
        "{}",
        ended.err
    );
    // The lock goes with its process, however that ends; the file left behind locks nobody out.
    send(&first, "-KILL");
    assert_ne!(finish(first).code, 0);
    let ended = folder.run(&[&again[..], &["--splats", "10", "--iterations", "2", "--no-eval"]].concat());
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert!(!folder.path("a.ply.lock").exists());
}

/// A fit that goes on until it is stopped.
const LONG_RUN: [&str; 13] = [
    "fit",
    "ct.nii.gz",
    "--roi",
    "mask.nii.gz",
    "--splats",
    "40",
    "--iterations",
    "1000000",
    "--checkpoint-every",
    "100",
    "--checkpoint-keep",
    "1000000",
    "--no-eval",
];

const LONG: [&str; 12] = [
    "--splats",
    "40",
    "--iterations",
    "700",
    "--checkpoint-every",
    "100",
    "--checkpoint-keep",
    "1000000",
    "--offsets",
    "4",
    "--subset",
    "16",
];

fn flags(output: &'static str, more: &[&'static str]) -> Vec<&'static str> {
    let mut all = vec!["fit", "ct.nii.gz", "--roi", "mask.nii.gz", "-o", output];
    all.extend(LONG);
    all.extend(more);
    all
}

/// Killed without warning or stopped by Ctrl-C: with --resume the splats become those of a run that went through.
#[test]
fn an_interrupted_fit_goes_on_to_the_same_bytes() {
    let folder = Folder::new(16);
    let whole = folder.run(&flags("whole.ply", &[]));
    assert_eq!(whole.code, 0, "{}", whole.err);
    assert!(!folder.path("whole.state").exists(), "a fit that is done needs no state");
    let other_volume = Folder::with_seed(16, 2).read("ct.nii.gz");
    let checkpoint = folder.run(&["info", "whole.000300.ply", "--json"]).json();
    assert_eq!(checkpoint["splats"], 40);
    assert_eq!(checkpoint["iterations"], 300);

    for signal in ["-KILL", "-INT"] {
        let child = folder.start(&flags("part.ply", &["--force"]));
        wait_for("a checkpoint", || folder.path("part.000100.ply").exists());
        wait_for("its state", || folder.path("part.state").exists());
        send(&child, signal);
        let ended = finish(child);
        assert_ne!(ended.code, 0, "stopped in time");

        let other = folder.run(&flags("part.ply", &["--resume", "--rate-mean", "0.3"]));
        assert_eq!(other.code, 2, "{}", other.err);
        assert!(other.err.contains("rate_mean was 0.2 and is now 0.3"), "{}", other.err);
        // Another volume, though it is called like the one of the fit.
        let volume = folder.read("ct.nii.gz");
        folder.write("ct.nii.gz", &other_volume);
        let other = folder.run(&flags("part.ply", &["--resume"]));
        assert!(other.code == 2 && other.err.contains("the file of the volume differs"), "{}", other.err);
        folder.write("ct.nii.gz", volume);
        let anew = folder.run(&flags("part.ply", &[]));
        assert_eq!(anew.code, 73, "{}", anew.err);

        let resumed = folder.run(&flags("part.ply", &["--resume"]));
        assert_eq!(resumed.code, 0, "{}", resumed.err);
        assert!(folder.read("part.ply") == folder.read("whole.ply"), "{signal}: the splats differ");
        for checkpoint in ["000200", "000700"] {
            let (part, whole) = (format!("part.{checkpoint}.ply"), format!("whole.{checkpoint}.ply"));
            assert!(folder.read(&part) == folder.read(&whole), "{signal}: {part} differs");
        }
        assert!(!folder.path("part.state").exists());
        let rows = folder.text("part.csv").lines().count();
        assert!(rows > 7, "the curve has all parts: {rows} lines");
    }
    let none = folder.run(&flags("none.ply", &["--resume"]));
    assert_eq!(none.code, 66, "{}", none.err);
    assert!(none.err.contains("start without --resume"), "{}", none.err);
}

/// The last state is damaged: the fit goes on from the one before, to the same bytes.
#[test]
fn a_damaged_state_has_one_before_it() {
    let folder = Folder::new(16);
    assert_eq!(folder.run(&flags("whole.ply", &[])).code, 0);
    assert!(!folder.path("whole.previous.state").exists(), "a fit that is done needs no state");

    let child = folder.start(&flags("part.ply", &[]));
    wait_for("two states", || folder.path("part.previous.state").exists());
    wait_for("the last state", || folder.path("part.state").exists());
    send(&child, "-KILL");
    assert_ne!(finish(child).code, 0, "stopped in time");
    let mut state = folder.read("part.state");
    let middle = state.len() / 2;
    state[middle] ^= 1;
    std::fs::write(folder.path("part.state"), state).expect("written");

    let resumed = folder.run(&flags("part.ply", &["--resume"]));
    assert_eq!(resumed.code, 0, "{}", resumed.err);
    assert!(
        resumed.err.contains("damaged") && resumed.err.contains("the state before it"),
        "{}",
        resumed.err
    );
    assert!(folder.read("part.ply") == folder.read("whole.ply"), "the splats differ");
    assert!(!folder.path("part.state").exists() && !folder.path("part.previous.state").exists());
}

/// A limit of the size of files is an error like a full disk, and nothing half written stays. (A software driver
/// keeps its memory in files, so that a command without a device shows it.)
#[test]
fn a_limit_of_the_size_of_files_is_an_error() {
    let folder = Folder::new(16);
    let phantom = folder.command(&["phantom", "-o", "large", "--size", "40"]);
    let mut limited = std::process::Command::new("sh");
    limited.args(["-c", "ulimit -f 4; exec \"$@\"", "sh"]).arg(phantom.get_program());
    limited.args(phantom.get_args()).current_dir(folder.path("."));
    let output = limited.output().expect("sh");
    let err = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(74), "{err}");
    assert!(err.contains("ct.nii.gz") && err.contains("File too large"), "{err}");
    let left = std::fs::read_dir(folder.path("large")).map_or(0, Iterator::count);
    assert_eq!(left, 0, "half a volume");
}

/// What Ctrl-C stops goes on to the bytes of baking that went through.
#[test]
fn interrupted_baking_goes_on_to_the_same_bytes() {
    let folder = Folder::new(16);
    folder.run(&fit("ours.ply", &["--no-eval"]));
    let to = |output: &'static str, more: &[&'static str]| {
        let few = ["--views", "6", "--size", "48", "--iterations", "700", "--tf", "CT-Soft-Tissue"];
        [&["bake", "ours.ply", "-o", output], &few[..], more].concat()
    };
    let long = |more| to("part.spz", more);
    let none = folder.run(&long(&["--resume"]));
    assert!(none.code == 66 && none.err.contains("start without --resume"), "{}", none.err);
    // How long the first pictures take is the machine's affair.
    for delay in [1, 2, 4, 8, 16] {
        let child = folder.start(&long(&["--force"]));
        std::thread::sleep(Duration::from_secs(delay));
        send(&child, "-INT");
        let ended = finish(child);
        assert!(ended.code == 130 || delay > 2, "stopped in time: {}", ended.err);
        if folder.path("part.spz.state").exists() {
            assert!(ended.err.contains("--resume goes on"), "{}", ended.err);
            break;
        }
    }
    assert!(folder.path("part.spz").exists(), "splats that can be used");
    let anew = folder.run(&long(&[]));
    assert!(anew.code == 73 && anew.err.contains("continue with --resume"), "{}", anew.err);
    let other = folder.run(&long(&["--resume", "--seed", "1"]));
    assert!(other.code == 2 && other.err.contains("--seed was 0 and is now 1"), "{}", other.err);
    let other = folder.run(&long(&["--resume", "--shade", "off"]));
    assert!(other.code == 2 && other.err.contains("the look differs"), "{}", other.err);
    // Stopped again, be it before the first step: what was done is not lost.
    let child = folder.start(&long(&["--resume"]));
    std::thread::sleep(Duration::from_millis(300));
    send(&child, "-INT");
    finish(child);
    assert!(folder.path("part.spz.state").exists(), "there is still something to go on from");
    let resumed = folder.run(&long(&["--resume"]));
    assert_eq!(resumed.code, 0, "{}", resumed.err);
    assert!(!folder.path("part.spz.state").exists(), "baking that is done needs no state");
    assert_eq!(folder.text("part.spz.csv").lines().count(), 7, "the curve has all points");
    assert_eq!(folder.run(&to("whole.spz", &[])).code, 0);
    assert!(folder.read("part.spz") == folder.read("whole.spz"), "the same bytes");
}
