//! The program under a real runtime: Monado, with the validation layers of Vulkan and of OpenXR, which must
//! have nothing to say. `tools/setup xr` brings it; where it is not, the tests say so and check nothing.

use std::path::Path;
use std::process::{Command, Stdio};

use crate::support::monado::{Sent, degrees, report, run_remote, said, tools, validation};
use engine::splat::{self, Field, Splat, SplatSet};
use glam::{DQuat, DVec3};
use xr_app::headset::{Eye, Pose};

/// Returns a folder with a small scene.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let splats = (0..60)
        .map(|i| Splat {
            mean: [(i % 10) as f32 * 12.0, 0.0, (i / 10) as f32 * 12.0],
            opacity_logit: 3.0,
            rotation: [1.0, 0.0, 0.0, 0.0],
            log_scale: [1.6; 3],
            intensity: 600.0 + 10.0 * i as f32,
        })
        .collect();
    let set = SplatSet { splats, field: Field::default(), ..SplatSet::default() };
    splat::write(&folder.path().join("scene.ply"), &set, false).expect("a file");
    folder
}

/// Returns the program, under a Monado of its own, in a folder with a scene.
fn program(tools: &Path, folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(tools.join("monado"));
    command
        .arg(tools.join("run"))
        .arg(env!("CARGO_BIN_EXE_vgs-xr"))
        .arg("scene.ply")
        .args(["--validation", "--report", "report.json"])
        .args(arguments)
        .current_dir(folder)
        .envs(validation(folder))
        .env("MONADO_LOG", folder.join("monado.log"))
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    command
}

#[test]
fn two_hundred_frames_under_monado() {
    let Some(tools) = tools(&["xr"]) else { return };
    let folder = folder();
    let output = program(&tools, folder.path(), &["--frames", "200", "--panel", "--picture", "eyes.png"])
        .output()
        .expect("tools");
    let report = report(folder.path(), &output);
    assert!(report["frames"].as_u64() >= Some(200), "{report}");
    let rendered = report["rendered"].as_u64().expect("a count");
    assert!(rendered >= 150, "{report}");
    assert!(report["runtime"].as_str().is_some_and(|r| r.starts_with("Monado")));
    let extensions = report["extensions"].as_array().expect("a list");
    assert!(
        extensions.iter().any(|name| name == "XR_KHR_composition_layer_depth"),
        "Monado takes depth: {extensions:?}"
    );
    assert!(
        extensions.iter().any(|name| name == "XR_KHR_visibility_mask"),
        "Monado says what lenses hide: {extensions:?}"
    );
    let hidden = |eye: usize| report["hidden"][eye].as_f64().expect("a part");
    assert!((0.02..0.5).contains(&hidden(0)) && (0.02..0.5).contains(&hidden(1)), "{}", report["hidden"]);
    assert_eq!((report["allocations"].as_u64(), report["pipelines"].as_u64()), (Some(0), Some(0)));
    let latency = |part: &str| report["latency_ms"][part].as_f64().expect("ms");
    let percentiles = ["p5", "median", "p95", "p99", "most"].map(latency);
    assert!(
        percentiles[1] > 0.0 && percentiles.is_sorted(),
        "poses are asked for before light: {percentiles:?} ms"
    );
    let bins = report["latency_histogram_ms"]["counts"].as_array().expect("bins");
    // Of late frames the time from motion to light is not known.
    let late = report["late"].as_u64().expect("a count");
    assert_eq!(bins.iter().map(|n| n.as_u64().expect("a count")).sum::<u64>() + late, rendered);
    let eyes = engine::image::read(folder.path().join("eyes.png")).expect("a picture").image;
    let seen = eyes.pixels.iter().filter(|p| p[0] > 0.3).count();
    assert!(seen > 100, "{seen} pixels of the scene are seen");
}

#[test]
fn a_runtime_that_dies_is_reported() {
    let Some(tools) = tools(&["xr"]) else { return };
    let folder = folder();
    // The shell between has the service's id.
    let mut command = Command::new(tools.join("monado"));
    let child = format!(
        "{run} {program} scene.ply & sleep 4; kill -9 $MONADO_PID; wait $!",
        run = tools.join("run").display(),
        program = env!("CARGO_BIN_EXE_vgs-xr")
    );
    let output = command.args(["bash", "-c", &child]).current_dir(folder.path()).output().expect("tools");
    let text = said(&output);
    assert!(!output.status.success() && text.contains("VGS-XR-010"), "{text}");
}

#[test]
fn without_a_runtime_the_help_names_a_way() {
    let Some(tools) = tools(&["xr"]) else { return };
    let folder = folder();
    let empty = folder.path().join("empty");
    std::fs::create_dir(&empty).expect("a folder");
    let output = Command::new(tools.join("run"))
        .arg(env!("CARGO_BIN_EXE_vgs-xr"))
        .arg("scene.ply")
        .current_dir(folder.path())
        .env("XDG_RUNTIME_DIR", &empty)
        .output()
        .expect("tools");
    let text = said(&output);
    assert!(
        !output.status.success() && text.contains("VGS-XR-002") && text.contains("--simulated"),
        "{text}"
    );
}

/// Views that are canted, of asymmetric fields, and a right hand that holds on, and moves 2 cm a second to
/// the right.
fn carrying(seconds: f64) -> Sent {
    let view = |side: f64| {
        let [left, right] = if side < 0.0 { [-54.0, 40.0] } else { [-40.0, 54.0] };
        let pose = Pose {
            position: DVec3::X * (side * 0.032),
            orientation: DQuat::from_rotation_y(-side * 5f64.to_radians()),
        };
        Eye { pose, fov: degrees([left, right, 44.0, -50.0]) }
    };
    let hand = |x: f64, holds| Some((Pose { position: DVec3::new(x, 1.3, -0.4), ..Pose::IDENTITY }, holds));
    Sent {
        head: Pose { position: DVec3::Y * 1.6, ..Pose::IDENTITY },
        views: [view(-1.0), view(1.0)],
        hands: [hand(-0.2, false), hand(0.2 + 0.02 * seconds, true)],
    }
}

/// Views that are canted and asymmetric and a hand that grabs, sent from without: the session runs and its
/// layers are silent.
#[test]
fn views_from_a_remote_driver() {
    let Some(tools) = tools(&["xr"]) else { return };
    let folder = folder();
    let output = run_remote(&tools, folder.path(), &["scene.ply", "--frames", "120"], carrying);
    let report = report(folder.path(), &output);
    // The head is at the middle from left to right, and the patient stood before it until the hand carried it
    // along.
    let carried = report["patient"][0].as_f64().expect("a number");
    assert!((0.02..1.0).contains(&carried), "carried by {carried} m");
    let eyes = report["eyes"].as_array().expect("both eyes");
    for (eye, side) in eyes.iter().zip([-1.0, 1.0]) {
        let part = |name: &str| eye[name].as_f64().expect("a number");
        let (outer, inner) = (54f64.to_radians().tan(), 40f64.to_radians().tan());
        let expected = if side < 0.0 { [-outer, inner] } else { [-inner, outer] };
        assert!(
            (part("left") - expected[0]).abs() < 1e-3 && (part("right") - expected[1]).abs() < 1e-3,
            "{eye}"
        );
        assert!((part("up") - 44f64.to_radians().tan()).abs() < 1e-3, "{eye}");
        // Turned outwards by half of 5 degrees.
        let forward_x = eye["forward"][0].as_f64().expect("a number");
        assert!((forward_x - side * 5f64.to_radians().sin()).abs() < 2e-3, "{eye}");
    }
}

/// The device is lost in the middle of the session, or has no memory for the pictures: the program says so and ends
/// with the code for "try again"; the runtime is left as it should be, says its layer.
#[test]
fn what_fails_on_the_device_ends_the_session() {
    let Some(tools) = tools(&["xr"]) else { return };
    let folder = folder();
    // Some allocations have another way where one fails.
    let mut ends = 0;
    for (fault, says) in [
        ("submit:60:lost", "VGS-GPU-012"),
        ("memory:9:device-memory", "VGS-GPU-024"),
        ("memory:23:device-memory", "VGS-GPU-024"),
        ("memory:37:device-memory", "VGS-GPU-024"),
        ("memory:51:device-memory", "VGS-GPU-024"),
    ] {
        let mut command = program(&tools, folder.path(), &["--frames", "200", "--force"]);
        let output = command.env("VGS_FAULT", fault).output().expect("tools");
        let text = said(&output);
        let code = output.status.code();
        let has_another_way = fault.starts_with("memory") && code == Some(0);
        assert!(
            has_another_way || code == Some(75) && text.contains(says),
            "{fault}: {}: {text}",
            output.status
        );
        ends += u32::from(code == Some(75));
        let layer = std::fs::read_to_string(folder.path().join("openxr.log")).expect("the layer was on");
        assert!(!layer.contains("VALID_ERROR"), "{fault}: {layer}");
    }
    assert!(ends > 1, "{ends} of the faults end the session");
}
