//! The examples of the engine run as they stand.

use std::path::{Path, PathBuf};
use std::process::Command;

/// Where cargo puts the examples of this workspace.
fn example(name: &str) -> PathBuf {
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().expect("target/tmp");
    let profile = if cfg!(debug_assertions) { "debug" } else { "release" };
    target.join(profile).join("examples").join(name).with_extension(std::env::consts::EXE_EXTENSION)
}

fn run(name: &str, folder: &Path, arguments: &[&str]) -> String {
    // The runner finds the driver that this test runs on.
    let mut command = match std::env::var_os("VGS_RUNNER") {
        Some(runner) => {
            let mut command = Command::new(runner);
            command.arg(example(name));
            command
        }
        None => Command::new(example(name)),
    };
    let output = command
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap_or_else(|e| panic!("{name}: {e}; `cargo build --examples` makes it"));
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{name}: {told}");
    String::from_utf8_lossy(&output.stdout).into_owned()
}

#[test]
fn a_phantom_is_fitted_and_seen_from_four_sides() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let told = run("fit", folder.path(), &[]);
    assert!(told.starts_with("phantom.ply: ") && told.contains(" splats"), "{told}");
    let told = run("render", folder.path(), &[]);
    assert_eq!(told.lines().collect::<Vec<_>>(), ["anterior.png", "left.png", "posterior.png", "right.png"]);
    for name in told.lines() {
        let picture = engine::image::read(folder.path().join(name)).expect("a picture").image;
        let bright = picture.pixels.iter().filter(|p| p[0] + p[1] + p[2] > 0.5).count();
        assert!(bright > picture.pixels.len() / 50, "{name} shows something: {bright} bright pixels");
    }
}
