//! The last step of the film from a DICOM folder to a headset: `vgs-xr` shows a session as the desktop viewer stores
//! it, under Monado, and both eyes see its colours, its cut and its distance.
//!
//! docs/use/film-headset.png is made by this test: `VGS_SHOTS` names a folder for the picture, and `VGS_SESSION` the
//! session that the film's test stored, to take in place of the phantom's.

use std::path::{Path, PathBuf};

use crate::support::monado::{Sent, degrees, report, run_remote, tools};
use engine::image::{self, Image};
use engine::splat::{self, Activations as _, Splat, SplatSet};
use engine::transfer::preset;
use glam::DVec3;
use view::model::state::{Distance, Plane, ViewState};
use xr_app::headset::{Eye, Pose};

/// Intensity of the phantom: vessels with contrast medium, dark red by CT-Angio.
const INTENSITY: f32 = 200.0;

/// Writes a cube of 10 cm into a folder, and returns its session: cut in the middle from left to right, with a
/// distance of 60 mm before the part that is left.
fn phantom(folder: &Path) -> ViewState {
    let splats = (0..10i32.pow(3)).map(|i| {
        let mut splat = Splat {
            mean: [i % 10, i / 10 % 10, i / 100].map(|n| 10.0 * n as f32 - 45.0),
            intensity: INTENSITY,
            rotation: [1.0, 0.0, 0.0, 0.0],
            ..Splat::default()
        };
        splat.set_opacity(0.9);
        splat.set_scale([5.0; 3]);
        splat
    });
    let set = SplatSet { splats: splats.collect(), ..SplatSet::default() };
    splat::write(&folder.join("fit.ply"), &set, false).expect("a file");
    let mut state = ViewState::new(&preset("CT-Angio").expect("a preset").over([-1000.0, 2000.0]));
    state.files.splats = vec!["fit.ply".into()];
    state.clip.planes = vec![Plane { on: true, normal: DVec3::X, offset_mm: 0.0 }];
    let end = |z: f64| DVec3::new(25.0, 60.0, z);
    state.distances = vec![Distance { from_mm: end(-30.0), to_mm: end(30.0) }];
    state
}

/// Returns a head that rests where it was before anything was sent, and eyes that see little more than the patient.
fn sent(_seconds: f64) -> Sent {
    let eye = |side: f64| {
        let [left, right] = if side < 0.0 { [-22.0, 20.0] } else { [-20.0, 22.0] };
        let pose = Pose { position: DVec3::X * (side * 0.032), ..Pose::IDENTITY };
        // Three quarters as high as wide, as the pictures.
        Eye { pose, fov: degrees([left, right, 16.1, -16.1]) }
    };
    let head = Pose { position: DVec3::Y * 1.6, ..Pose::IDENTITY };
    Sent { head, views: [eye(-1.0), eye(1.0)], hands: [None; 2] }
}

/// Returns what the left and the right eye see of a session.
fn seen(tools: &Path, folder: &Path, name: &str, state: &ViewState) -> [Image; 2] {
    let [session, picture] = ["toml", "png"].map(|end| format!("{name}.{end}"));
    state.write(folder.join(&session), false).expect("a session");
    // Monado without a screen recommends 320 × 240 pixels.
    let size = ["--resolution", "2", "--level", "0", "--card=never", "--frames", "30"];
    let arguments = [&[&*session, "--picture", &picture], &size[..]].concat();
    let output = run_remote(tools, folder, &arguments, sent);
    let report = report(folder, &output);
    assert!(report["runtime"].as_str().is_some_and(|runtime| runtime.starts_with("Monado")), "{report}");
    let both = image::read(folder.join(picture)).expect("a picture").image;
    let [width, height] = [both.size[0] / 2, both.size[1]];
    [0, 1].map(|eye| {
        let rows = both.pixels.chunks(2 * width).flat_map(|row| &row[eye * width..][..width]);
        Image { size: [width, height], pixels: rows.copied().collect() }
    })
}

fn count(image: &Image, is_so: impl Fn(usize, [f32; 4]) -> bool) -> usize {
    image.pixels.iter().enumerate().filter(|&(at, &pixel)| is_so(at, pixel)).count()
}

/// Returns true for what is neither background nor blue, as the outline of a plane.
fn is_patient([r, _, b, _]: [f32; 4]) -> bool {
    r > 0.15 && r > b + 0.05
}

/// Returns true for the colour of lines and words of distances.
fn is_signal([r, g, b, _]: [f32; 4]) -> bool {
    r > 0.7 && g > 0.55 && b < 0.47
}

#[test]
fn a_session_is_seen_by_both_eyes() {
    let Some(tools) = tools(&["xr"]) else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let own = std::env::var_os("VGS_SESSION").map(PathBuf::from);
    let film = own.as_ref().map_or_else(|| phantom(folder), |path| ViewState::read(path).expect("a session"));
    let mut whole = film.clone();
    whole.clip.planes.clear();
    let mut unmeasured = film.clone();
    unmeasured.distances.clear();
    let shown = seen(&tools, folder, "film-headset", &film);
    if let Some(shots) = std::env::var_os("VGS_SHOTS") {
        let name = "film-headset.png";
        std::fs::copy(folder.join(name), Path::new(&shots).join(name)).expect("a copy");
    }
    let whole = seen(&tools, folder, "whole", &whole);
    let unmeasured = seen(&tools, folder, "unmeasured", &unmeasured);
    for eye in 0..2 {
        let [shown, whole, unmeasured] = [&shown, &whole, &unmeasured].map(|eyes| &eyes[eye]);
        let patient = count(whole, |_, pixel| is_patient(pixel));
        assert!(patient > whole.pixels.len() / 50, "eye {eye}: {patient} pixels of the patient");
        // By CT-Bone, which is shown without a session, red would be less than twice the green.
        let red = count(whole, |_, p| is_patient(p) && p[0] > 2.2 * p[1]);
        assert!(own.is_some() || 10 * red > 8 * patient, "eye {eye}: {red} of {patient} are dark red");
        let cut = count(unmeasured, |at, pixel| is_patient(whole.pixels[at]) && !is_patient(pixel));
        assert!(10 * cut > patient, "eye {eye}: {cut} of {patient} pixels are cut away");
        let left = count(unmeasured, |_, pixel| is_patient(pixel));
        assert!(10 * left > patient, "eye {eye}: {left} of {patient} pixels are left");
        let line = count(shown, |at, pixel| is_signal(pixel) && pixel != unmeasured.pixels[at]);
        assert!(line > 100, "eye {eye}: {line} pixels of the distance");
        println!(
            "eye {eye}: patient {patient}, dark red {red}, cut away {cut}, left {left}, distance {line}"
        );
    }
    let apart = count(&shown[0], |at, pixel| pixel != shown[1].pixels[at]);
    assert!(apart > shown[0].pixels.len() / 100, "{apart} pixels differ between the eyes");
}
