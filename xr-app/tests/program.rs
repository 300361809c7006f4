//! The program itself, with a simulated headset: what it shows, over what, its memory budget, and its window on
//! the desktop.

use std::path::Path;
use std::process::{Command, Output};

use engine::image::{self, Image};
use engine::splat::{self, Activations as _, Form, Grid, Splat, SplatSet};
use engine::volume::{Volume, nifti};
use glam::{DAffine3, DVec3};
use serde_json::Value;
use view::model::state::ViewState;

/// Returns a folder with a scene of so many splats in a cube of 12 cm, fitted for its 121³ voxels if so.
fn folder(count: usize, for_grid: bool) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let edge = (count as f64).cbrt().ceil() as usize;
    let splats = (0..count).map(|i| {
        let [x, y, z] = [i % edge, i / edge % edge, i / edge / edge].map(|n| 120.0 * n as f32 / edge as f32);
        let mut splat = Splat {
            mean: [x, y, z],
            intensity: 500.0 + x,
            rotation: [1.0, 0.0, 0.0, 0.0],
            ..Splat::default()
        };
        splat.set_opacity(0.5);
        splat.set_scale([60.0 / edge as f32; 3]);
        splat
    });
    let mut set = SplatSet { splats: splats.collect(), ..SplatSet::default() };
    if for_grid {
        set.grid = Some(Grid { size: [121; 3], world_from_voxel: DAffine3::IDENTITY });
        set.form = Form::Grid;
    }
    splat::write(&folder.path().join("scene.ply"), &set, false).expect("a file");
    folder
}

fn tool(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tools").join(name)
}

/// Ends as it ends.
fn run(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(tool("run"))
        .arg(env!("CARGO_BIN_EXE_vgs-xr"))
        .args(["scene.ply", "--simulated", "--resolution", "0.2", "--report", "report.json", "--force"])
        .args(arguments)
        .current_dir(folder)
        .output()
        .expect("tools/run starts")
}

/// Returns what it says on stderr, and MiB of device memory in the end, after a run that ended well.
fn used(folder: &Path, arguments: &[&str]) -> (String, f64) {
    let output = run(folder, arguments);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{said}");
    let report = std::fs::read(folder.join("report.json")).expect("a report");
    let report: Value = serde_json::from_slice(&report).expect("JSON");
    let bytes = report["device_bytes"].as_object().expect("purposes").values();
    (said, bytes.map(|v| v.as_f64().expect("bytes")).sum::<f64>() / f64::from(1 << 20))
}

#[test]
fn a_memory_budget_is_kept_to_or_refused() {
    let folder = folder(60_000, false);
    let folder = folder.path();
    let frames = ["--frames", "3", "--level", "3"];
    let (said, all) = used(folder, &frames);
    assert_eq!(said, "");
    let within = |mib: f64| {
        let budget = format!("{mib:.3}");
        used(folder, &[&frames[..], &["--memory-budget", &budget]].concat())
    };
    let (said, packed) = within(all - 0.5);
    assert!(said.contains("packed") && packed <= all - 0.5, "{packed} of {all} MiB: {said}");
    let (said, fewer) = within(all * 0.7);
    assert!(said.contains("of 60000 splats fit") && fewer <= all * 0.7, "{fewer} of {all} MiB: {said}");
    let refused = run(folder, &[&frames[..], &["--memory-budget", "0.5"]].concat());
    let said = String::from_utf8_lossy(&refused.stderr);
    assert!(!refused.status.success() && said.contains("VGS-XR-024"), "{said}");
}

/// What is shown decoded loses no splat to a budget: parts of its field become coarser.
#[test]
fn a_memory_budget_makes_a_decoded_field_coarser() {
    let folder = folder(4_000, true);
    let folder = folder.path();
    let frames = ["--frames", "3", "--level", "3"];
    let (_, all) = used(folder, &frames);
    let within = |mib: f64| {
        let budget = format!("{mib:.3}");
        used(folder, &[&frames[..], &["--memory-budget", &budget]].concat())
    };
    let (said, found) = within(all * 0.6);
    assert!(
        said.contains("parts of the field are coarser") && found <= all * 0.6,
        "{found} of {all} MiB: {said}"
    );
    assert!(!said.contains("left out"), "{said}");
    let refused = run(folder, &[&frames[..], &["--memory-budget", "0.1"]].concat());
    let said = String::from_utf8_lossy(&refused.stderr);
    assert!(!refused.status.success() && said.contains("VGS-XR-024"), "{said}");
}

/// Returns the picture of both eyes that a run writes which ends well.
fn picture(folder: &Path, arguments: &[&str]) -> Image {
    let all =
        [&["--frames", "4", "--level", "0", "--validation", "--picture", "eyes.png"], arguments].concat();
    let output = run(folder, &all);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    image::read(folder.join("eyes.png")).expect("a picture").image
}

/// Returns the number of pixels with as much red, green and blue as this.
fn count(image: &Image, is_so: fn([f32; 4]) -> bool) -> usize {
    image.pixels.iter().filter(|&&pixel| is_so(pixel)).count()
}

/// With the room behind it, the picture is opaque where the patient is and transparent elsewhere.
#[test]
fn the_room_is_seen_behind_the_patient() {
    let folder = folder(3000, false);
    let room = picture(folder.path(), &["--passthrough"]);
    assert_eq!(room.pixels[0], [0.0; 4], "nothing in the corner");
    let (solid, clear) = (count(&room, |p| p[3] > 0.95 && p[0] > 0.3), count(&room, |p| p[3] == 0.0));
    assert!(solid > 200 && clear > room.pixels.len() / 2, "{solid} solid and {clear} clear pixels");
    let black = picture(folder.path(), &[]);
    assert!(black.pixels.iter().all(|pixel| pixel[3] == 1.0), "without it there is a background");
    let both = run(folder.path(), &["--passthrough", "--blend", "alpha"]);
    assert_eq!(both.status.code(), Some(2), "one or the other");
}

/// Objects have colours by flags, and a session shows what it was saved with.
#[test]
fn objects_sessions_and_volumes_are_shown() {
    let folder = folder(3000, false);
    let folder = folder.path();
    let green = |p: [f32; 4]| p[1] > 0.2 && p[1] > 3.0 * p[0] && p[1] > 3.0 * p[2];
    assert_eq!(count(&picture(folder, &[]), green), 0);
    let changed = picture(folder, &["--object", "scene:colour=#00ff00"]);
    assert!(count(&changed, green) > 200, "{} green pixels", count(&changed, green));
    let unknown = run(folder, &["--frames", "1", "--object", "heart:hidden"]);
    let said = String::from_utf8_lossy(&unknown.stderr);
    assert!(unknown.status.code() == Some(2) && said.contains("VGS-SPLAT-010"), "{said}");

    let function = engine::transfer::load("CT-Bone", [0.0, 1000.0]).expect("a preset");
    let mut state = ViewState::new(&function);
    state.files.splats = vec!["scene.ply".into()];
    state.objects = vec![view::model::state::Object::new(0, None, "scene")];
    state.objects[0].tint = Some(DVec3::Y);
    state.write(folder.join("session.toml"), false).expect("a session");
    // The session is beside the files, not one more of them.
    let alone = |file: &str| {
        let output = Command::new(tool("run"))
            .arg(env!("CARGO_BIN_EXE_vgs-xr"))
            .args([file, "--simulated", "--resolution", "0.2", "--frames", "4", "--level", "0"])
            .args(["--picture", "eyes.png", "--force", "--validation"])
            .current_dir(folder)
            .output()
            .expect("tools/run starts");
        assert!(output.status.success(), "{file}: {}", String::from_utf8_lossy(&output.stderr));
        image::read(folder.join("eyes.png")).expect("a picture").image
    };
    let session = alone("session.toml");
    assert!(count(&session, green) > 200, "{} green pixels", count(&session, green));

    // A cube of bone in the middle of nothing.
    let inside = |i: usize| [i % 40, i / 40 % 40, i / 1600].iter().all(|n| (12..28).contains(n));
    let samples = (0..40usize.pow(3)).map(|i| if inside(i) { 900.0 } else { -1000.0 }).collect();
    let volume = Volume::new([40; 3], DAffine3::from_scale(DVec3::splat(3.0)), samples);
    nifti::write(folder.join("ct.nii"), &volume, false).expect("a volume");
    let shown = alone("ct.nii");
    let bone = count(&shown, |p| p[0] > 0.3);
    assert!(bone > 200, "{bone} pixels of bone");
}

/// Returns the bright pixels of the screen in the left and in the right half of the window, after a file of
/// xwd: a header of big-endian words, colours, then rows of four bytes a pixel, blue first.
fn bright(xwd: &[u8], window: [usize; 2]) -> [usize; 2] {
    let word =
        |at: usize| u32::from_be_bytes(xwd[4 * at..4 * at + 4].try_into().expect("four bytes")) as usize;
    let (header, width, row, colours) = (word(0), word(4), word(12), word(19));
    assert!(width >= window[0], "the window fits on the screen");
    let texels = &xwd[header + 12 * colours..];
    let mut found = [0; 2];
    for y in 0..window[1] {
        for x in 0..window[0] {
            let texel = &texels[y * row + 4 * x..][..3];
            found[usize::from(2 * x >= window[0])] += usize::from(texel.iter().all(|&c| c > 90));
        }
    }
    found
}

/// A window on a virtual screen shows what both eyes see, or one; it lies in the screen's upper left corner,
/// where no window manager moves it.
#[test]
fn a_window_shows_what_the_eyes_see() {
    let folder = folder(3000, false);
    let there = Command::new(tool("xvfb")).arg("true").output().expect("tools/xvfb starts");
    if !there.status.success() {
        println!("skipped: there is no virtual screen; `tools/setup window` brings one");
        assert!(std::env::var_os("CI").is_none(), "CI has a virtual screen");
        return;
    }
    // Of one eye the window is half as wide.
    for eyes in ["both", "left"] {
        let script = format!(
            "{run} {program} scene.ply --simulated --resolution 0.2 --rate 20 --level 1 --validation \
             --mirror={eyes} & sleep 6; cp $VGS_SCREEN shot.xwd; kill -INT $!; wait $!",
            run = tool("run").display(),
            program = env!("CARGO_BIN_EXE_vgs-xr")
        );
        let output = Command::new(tool("xvfb"))
            .args(["bash", "-c", &script])
            .current_dir(folder.path())
            .output()
            .expect("tools/xvfb starts");
        let said = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes)).concat();
        assert!(output.status.success(), "{said}");
        let shot = std::fs::read(folder.path().join("shot.xwd")).expect("the screen");
        let [left, right] = bright(&shot, [960, 480]);
        assert!(left > 1000, "{eyes}: {left} bright pixels on the left: {said}");
        assert!(
            if eyes == "both" { right > 1000 } else { right == 0 },
            "{eyes}: {right} on the right: {said}"
        );
        let shown = said
            .lines()
            .find_map(|l| l.strip_prefix("the window showed ")?.split(' ').next()?.parse::<u64>().ok());
        assert!(shown > Some(5), "{said}");
    }
}
