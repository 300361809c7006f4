//! The program under a real runtime: Monado, with the validation layers of Vulkan and of OpenXR, which must have nothing
//! to say. `tools/setup xr` brings it; where it is not, the tests say so and check nothing.
#![forbid(unsafe_code)]

use std::io::Write as _;
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use engine::splat::{self, Field, Splat, SplatSet};
use serde_json::Value;

/// Where the scripts are, if Monado is set up.
fn tools() -> Option<PathBuf> {
    let tools = Path::new(env!("CARGO_MANIFEST_DIR")).parent()?.join("tools");
    let environment = PathBuf::from(std::env::var_os("VGS_CACHE")?).join("driver.env");
    let text = std::fs::read_to_string(environment).unwrap_or_default();
    let there = text.lines().filter_map(|l| l.strip_prefix("xr=")).any(|folder| Path::new(folder).is_dir());
    if !there {
        println!("Monado is not set up (tools/setup xr): nothing is checked");
    }
    there.then_some(tools)
}

/// A folder with a small scene.
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

/// The program, under a Monado of its own, in a folder with a scene.
fn program(tools: &Path, folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(tools.join("monado"));
    command
        .arg(tools.join("run"))
        .arg(env!("CARGO_BIN_EXE_vgs-xr"))
        .arg("scene.ply")
        .args(["--validation", "--report", "report.json"])
        .args(arguments)
        .current_dir(folder)
        .env("XR_ENABLE_API_LAYERS", "XR_APILAYER_LUNARG_core_validation")
        .env("XR_CORE_VALIDATION_EXPORT_TYPE", "text")
        .env("XR_CORE_VALIDATION_FILE_NAME", folder.join("openxr.log"))
        .env("MONADO_LOG", folder.join("monado.log"))
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    command
}

fn said(output: &Output) -> String {
    [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes)).concat()
}

/// Its report, after a run that ended well and in which the layers were silent.
fn report(folder: &Path, output: &Output) -> Value {
    assert!(output.status.success(), "{}", said(output));
    let layer = std::fs::read_to_string(folder.join("openxr.log")).expect("the layer was on");
    let complaints: Vec<_> =
        layer.lines().filter(|l| l.contains("VALID_ERROR") || l.contains("VALID_WARN")).collect();
    assert!(layer.contains("initialized") && complaints.is_empty(), "{complaints:?}");
    serde_json::from_slice(&std::fs::read(folder.join("report.json")).expect("a report")).expect("JSON")
}

#[test]
fn two_hundred_frames_under_monado() {
    let Some(tools) = tools() else { return };
    let folder = folder();
    let output = program(&tools, folder.path(), &["--frames", "200", "--panel", "--picture", "eyes.png"])
        .output()
        .expect("tools");
    let report = report(folder.path(), &output);
    assert!(report["frames"].as_u64() >= Some(200), "{report}");
    assert!(report["rendered"].as_u64() >= Some(150), "{report}");
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
    assert!(
        report["latency_ms"]["median"].as_f64() > Some(0.0),
        "poses are asked for before light: {report}"
    );
    let eyes = engine::image::read(folder.path().join("eyes.png")).expect("a picture").image;
    let seen = eyes.pixels.iter().filter(|p| p[0] > 0.3).count();
    assert!(seen > 100, "{seen} pixels of the scene are seen");
}

#[test]
fn a_runtime_that_dies_is_reported() {
    let Some(tools) = tools() else { return };
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
    let Some(tools) = tools() else { return };
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

/// A packet of Monado's remote driver (struct r_remote_data, 376 bytes): canted views of asymmetric fields, and a right hand
/// that holds on, and moves 2 cm a second to the right.
fn packet(seconds: f32) -> Vec<u8> {
    let mut out = b"mndrmt3\0".to_vec();
    let floats = |out: &mut Vec<u8>, values: &[f32]| values.iter().for_each(|v| out.extend(v.to_le_bytes()));
    let half_cant = 2.5f32.to_radians();
    for side in [-1.0f32, 1.0] {
        let (outer, inner) = (54f32.to_radians(), 40f32.to_radians());
        let (left, right) = if side < 0.0 { (-outer, inner) } else { (-inner, outer) };
        floats(&mut out, &[left, right, 44f32.to_radians(), -50f32.to_radians()]);
        floats(&mut out, &[0.0, -side * half_cant.sin(), 0.0, half_cant.cos(), side * 0.032, 0.0, 0.0]);
        out.extend([0; 4]);
    }
    floats(&mut out, &[0.0, 0.0, 0.0, 1.0, 0.0, 1.6, 0.0]);
    out.extend([1, 0, 0, 0]);
    for side in [-1.0f32, 1.0] {
        let x = if side > 0.0 { 0.2 + 0.02 * seconds } else { -0.2 };
        floats(&mut out, &[0.0, 0.0, 0.0, 1.0, x, 1.3, -0.4]);
        floats(&mut out, &[0.0; 6]);
        floats(&mut out, &[0.0; 5]);
        let held = if side > 0.0 { 1.0 } else { 0.0 };
        floats(&mut out, &[held, held, held]);
        floats(&mut out, &[0.0; 5]);
        let mut buttons = [0u8; 16];
        buttons[1] = 1; // active
        out.extend(buttons);
    }
    assert_eq!(out.len(), 376);
    out
}

/// Views that are canted and asymmetric and a hand that grabs, sent from without: the session runs and its layers are silent.
#[test]
fn views_from_a_remote_driver() {
    let Some(tools) = tools() else { return };
    let folder = folder();
    // The port is the service's own; a shell writes it down for us.
    let child = format!(
        "echo $MONADO_PORT > port; exec {run} {program} scene.ply --validation --frames 120 --report report.json --picture eyes.png",
        run = tools.join("run").display(),
        program = env!("CARGO_BIN_EXE_vgs-xr")
    );
    let mut command = Command::new(tools.join("monado"));
    let mut running = command
        .args(["bash", "-c", &child])
        .current_dir(folder.path())
        .env("MONADO_HEAD", "remote")
        .env("XR_ENABLE_API_LAYERS", "XR_APILAYER_LUNARG_core_validation")
        .env("XR_CORE_VALIDATION_EXPORT_TYPE", "text")
        .env("XR_CORE_VALIDATION_FILE_NAME", folder.path().join("openxr.log"))
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("tools");
    let start = Instant::now();
    let mut connection: Option<TcpStream> = None;
    while running.try_wait().expect("a child").is_none() && start.elapsed() < Duration::from_secs(200) {
        if connection.is_none() {
            let port =
                std::fs::read_to_string(folder.path().join("port")).ok().and_then(|p| p.trim().parse().ok());
            connection = port.and_then(|port: u16| TcpStream::connect(("127.0.0.1", port)).ok());
        }
        if let Some(stream) = &mut connection {
            // The service goes before us in the end.
            let _ = stream.write_all(&packet(start.elapsed().as_secs_f32()));
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    let output = running.wait_with_output().expect("a child");
    let report = report(folder.path(), &output);
    // The head is at the middle from left to right, and the patient stood before it until the hand carried it along.
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
