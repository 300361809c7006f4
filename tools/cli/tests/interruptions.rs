//! Signals and locks: what happens to a run that is stopped, and to a second one that comes in between.

mod support;

use std::process::Child;
use std::time::{Duration, Instant};

use support::{Folder, finish};

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
        let child = endless(&folder);
        // The iterations have begun some time after the lock.
        std::thread::sleep(Duration::from_millis(1500));
        send(&child, signal);
        let start = Instant::now();
        let ended = finish(child);
        assert_eq!(ended.code, exit, "{}", ended.err);
        assert!(start.elapsed() < Duration::from_secs(5));
        let record: serde_json::Value = serde_json::from_str(&folder.text("a.run.json")).expect("a record");
        assert_eq!(record["end"], "stopped");
        let info = folder.run(&["info", "a.ply", "--json"]).json();
        assert_eq!(info["splats"], 40);
        let names: Vec<_> = folder.contents().into_keys().collect();
        assert_eq!(names.len(), 6, "two inputs, four outputs, no litter: {names:?}");
    }
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
