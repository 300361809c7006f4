//! Monado: whether it is there, what its remote driver is sent, and what a program leaves behind that ran
//! under it.

use std::io::Write as _;
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use engine::render::Fov;
use serde_json::Value;
use xr_app::headset::{Eye, Pose};

/// Returns where the scripts are, if these components are set up; otherwise it says which is not.
pub fn tools(components: &[&str]) -> Option<PathBuf> {
    let tools = Path::new(env!("CARGO_MANIFEST_DIR")).parent()?.join("tools");
    let environment = PathBuf::from(std::env::var_os("VGS_CACHE")?).join("driver.env");
    let text = std::fs::read_to_string(environment).unwrap_or_default();
    let there = |component: &str| {
        let folders = text.lines().filter_map(|line| line.strip_prefix(component)?.strip_prefix('='));
        folders.into_iter().any(|folder| Path::new(folder).is_dir())
    };
    for component in components {
        if !there(component) {
            println!("skipped: tools/setup {component} was not run, and nothing is checked");
            return None;
        }
    }
    Some(tools)
}

/// Returns what a program said.
pub fn said(output: &Output) -> String {
    [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes)).concat()
}

/// Returns the variables that switch the validation layer of OpenXR on; its log is `openxr.log` in the
/// folder.
pub fn validation(folder: &Path) -> [(&'static str, PathBuf); 3] {
    [
        ("XR_ENABLE_API_LAYERS", "XR_APILAYER_LUNARG_core_validation".into()),
        ("XR_CORE_VALIDATION_EXPORT_TYPE", "text".into()),
        ("XR_CORE_VALIDATION_FILE_NAME", folder.join("openxr.log")),
    ]
}

/// Its report, `report.json` in the folder, after a run that ended well and in which the layers were silent.
pub fn report(folder: &Path, output: &Output) -> Value {
    assert!(output.status.success(), "{}", said(output));
    let layer = std::fs::read_to_string(folder.join("openxr.log")).expect("the layer was on");
    let complaints: Vec<_> =
        layer.lines().filter(|l| l.contains("VALID_ERROR") || l.contains("VALID_WARN")).collect();
    assert!(layer.contains("initialized") && complaints.is_empty(), "{complaints:?}");
    serde_json::from_slice(&std::fs::read(folder.join("report.json")).expect("a report")).expect("JSON")
}

/// Returns a field of view of these angles to the left, right, upper and lower edge, degrees.
pub fn degrees([left, right, up, down]: [f64; 4]) -> Fov {
    let tangent = |angle: f64| angle.to_radians().tan();
    Fov { left: tangent(left), right: tangent(right), up: tangent(up), down: tangent(down) }
}

/// What the remote driver is told.
#[derive(Clone, Copy)]
pub struct Sent {
    /// The head in the room.
    pub head: Pose,
    /// The eyes in the head.
    pub views: [Eye; 2],
    /// The hands that there are, and whether they hold.
    pub hands: [Option<(Pose, bool)>; 2],
}

impl Sent {
    /// As Monado 25 takes it: 376 bytes (struct r_remote_data).
    pub fn packet(&self) -> Vec<u8> {
        let mut out = b"mndrmt3\0".to_vec();
        let floats = |out: &mut Vec<u8>, values: &[f64]| {
            values.iter().for_each(|&v| out.extend((v as f32).to_le_bytes()));
        };
        let pose = |out: &mut Vec<u8>, pose: &Pose| {
            floats(out, &pose.orientation.to_array());
            floats(out, &pose.position.to_array());
        };
        for Eye { pose: view, fov } in &self.views {
            floats(&mut out, &[fov.left, fov.right, fov.up, fov.down].map(f64::atan));
            pose(&mut out, view);
            out.extend([0; 4]);
        }
        pose(&mut out, &self.head);
        // The views are valid.
        out.extend([1, 0, 0, 0]);
        for hand in self.hands {
            let (place, holds) = hand.unwrap_or((Pose::IDENTITY, false));
            pose(&mut out, &place);
            // Velocities, then the curl of five fingers.
            floats(&mut out, &[0.0; 6 + 5]);
            floats(&mut out, &[f64::from(u8::from(holds)); 3]);
            // Thumbstick, force, trackpad.
            floats(&mut out, &[0.0; 5]);
            let mut buttons = [0u8; 16];
            buttons[1] = u8::from(hand.is_some());
            out.extend(buttons);
        }
        assert_eq!(out.len(), 376);
        out
    }
}

/// Runs the program in a folder, under a Monado of its own and with the layers on, and sends head, views and hands
/// by the seconds since the start. Returns what it said in the end.
pub fn run_remote(tools: &Path, folder: &Path, arguments: &[&str], sent: impl Fn(f64) -> Sent) -> Output {
    // The port is the service's own; a shell writes it down for us.
    let child = format!(
        "echo $MONADO_PORT > port; exec {run} {program} \"$@\"",
        run = tools.join("run").display(),
        program = env!("CARGO_BIN_EXE_vgs-xr")
    );
    let _ = std::fs::remove_file(folder.join("port"));
    let mut running = Command::new(tools.join("monado"))
        .args(["bash", "-c", &child, "vgs-xr", "--validation", "--report", "report.json", "--force"])
        .args(arguments)
        .current_dir(folder)
        .env("MONADO_HEAD", "remote")
        .env("MONADO_LOG", folder.join("monado.log"))
        .envs(validation(folder))
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("tools");
    let start = Instant::now();
    let mut connection: Option<TcpStream> = None;
    while running.try_wait().expect("a child").is_none() && start.elapsed() < Duration::from_secs(200) {
        if connection.is_none() {
            let port = std::fs::read_to_string(folder.join("port")).ok().and_then(|p| p.trim().parse().ok());
            connection = port.and_then(|port: u16| TcpStream::connect(("127.0.0.1", port)).ok());
        }
        if let Some(stream) = &mut connection {
            // The service goes before us in the end.
            let _ = stream.write_all(&sent(start.elapsed().as_secs_f64()).packet());
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    running.wait_with_output().expect("a child")
}
