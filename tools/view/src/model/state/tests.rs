use engine::transfer::PRESETS;

use super::*;
use crate::model::deletions::{Bounds, Target};
use crate::model::region::{Region, Threshold};
use crate::model::state::mode_row;

fn full() -> ViewState {
    let mut state = ViewState::new(&PRESETS[0].over([-1000.0, 2000.0]));
    state.shown = Subject::Volume;
    state.mode = SplatMode::named("exact").expect("a mode");
    state.split = Some(0.25);
    state.background = DVec3::new(0.1, 0.2, 0.3);
    state.files = Files {
        splats: vec!["/data/a.ply".into(), "/data/b.ply".into()],
        beside: Some("/data/coarse.vgs".into()),
        volume: Some("/data/ct.nii.gz".into()),
        series: Some("3".into()),
        roi: Some("/data/mask.nii.gz".into()),
        labels: Some("5,aorta".into()),
        threshold: None,
        unpacked: Vec::new(),
    };
    state.orbit = Orbit { azimuth_deg: 33.3, elevation_deg: -12.25, distance_mm: 1e3 / 3.0, ..state.orbit };
    state.bookmarks = vec![Bookmark { name: "hilum".into(), orbit: Orbit { fov_deg: 12.5, ..state.orbit } }];
    state.quality =
        Quality { step: Some(1.5), splat_budget: Some(100_000), target_frame_ms: 11.1, adaptive: false };
    state.show.overlay = true;
    state.clip = Clip {
        planes: vec![Plane { on: true, normal: DVec3::new(0.6, 0.0, 0.8), offset_mm: -7.5 }],
        crop: Some(CropBox { on: true, low_mm: DVec3::splat(-50.0), high_mm: DVec3::splat(60.0) }),
    };
    state.transfer.shift = -40.0;
    state.transfer.material.occlusion = 0.35;
    state.transfer.gradient_opacities = vec![[0.0, 0.5], [100.0, 1.0]];
    state.objects = vec![
        Object { tint: Some(DVec3::X), opacity: 0.4, ..Object::new(0, Some(5), "liver") },
        Object { visible: false, ..Object::new(0, Some(7), "aorta") },
        Object::new(1, None, "b"),
    ];
    state.distances = vec![Distance { from_mm: DVec3::ZERO, to_mm: DVec3::new(3.0, 4.0, 0.0) }];
    let bounds = Bounds { low_mm: DVec3::splat(-8.5), high_mm: DVec3::splat(9.5), files: 2 };
    state.deleted = vec![
        Deletion::Outside(bounds),
        Deletion::Object(Target { file: 0, label: Some(7) }),
        Deletion::Inside(Bounds { files: 1, ..bounds }),
        Deletion::Object(Target { file: 1, label: None }),
    ];
    state
}

#[test]
fn what_is_written_is_read_back_equal() {
    let mut threshold = full();
    let cleaned = Threshold { largest: Some(2), close_mm: Some(1.5), ..Threshold::new(226.0, 3071.0) };
    threshold.files.set_region(Some(Region::Threshold(cleaned)));
    for state in [full(), threshold, ViewState::new(&PRESETS[1].over([0.0, 1.0]))] {
        let text = state.text().expect("UTF-8");
        assert_eq!(ViewState::parse(&text).unwrap_or_else(|e| panic!("{e}\n{text}")), state);
    }
}

#[test]
fn files_are_found_from_the_session_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("session.toml");
    let mut state = full();
    state.files.splats[0] = "near.ply".into();
    state.files.beside = Some("fits/coarse.vgs".into());
    state.write(&path, false).expect("written");
    // Paths that are relative begin where the program does.
    let here = std::env::current_dir().expect("a folder");
    let read = ViewState::read(&path).expect("read");
    assert_eq!(read.files.splats[0], here.join("near.ply"));
    assert_eq!(read.files.volume, state.files.volume);
    std::fs::write(folder.path().join("near.ply"), "").expect("a file");
    std::fs::create_dir(folder.path().join("fits")).expect("a folder");
    std::fs::write(folder.path().join("fits/coarse.vgs"), "").expect("a file");
    // What is not there is looked for beside the session.
    let read = ViewState::read(&path).expect("read");
    assert_eq!(read.files.splats[0], folder.path().join("near.ply"));
    assert_eq!(read.files.beside, Some(folder.path().join("fits/coarse.vgs")));
    assert_eq!(state.write(&path, false).expect_err("it exists").code, "VGS-OUT-001");
    state.write(&path, true).expect("replaced");
    let missing = ViewState::read(folder.path().join("none.toml")).expect_err("missing");
    assert_eq!(missing.kind, Kind::Missing);
}

#[test]
fn what_a_session_leaves_out_takes_along_what_belongs_to_it() {
    let mut state = full();
    state.leave_out(Path::new("/data/a.ply"));
    assert_eq!(state.files.splats, [Path::new("/data/b.ply")]);
    let rows: Vec<_> = state.objects.iter().map(|o| (o.file, o.name.as_str())).collect();
    assert_eq!(rows, [(0, "b")], "the second file is the first now");
    let bounds = Bounds { low_mm: DVec3::splat(-8.5), high_mm: DVec3::splat(9.5), files: 1 };
    let whole = Deletion::Object(Target { file: 0, label: None });
    assert_eq!(state.deleted, [Deletion::Outside(bounds), whole], "boxes act on what is left");
    state.leave_out(Path::new("/data/ct.nii.gz"));
    assert_eq!((&state.files.volume, &state.files.series, state.files.region()), (&None, &None, None));
    state.leave_out(Path::new("/data/b.ply"));
    assert!(state.files == Files::default() && state.deleted.is_empty() && state.objects.is_empty());
    state.split = None;
    assert!(ViewState::parse(&state.text().expect("UTF-8")).is_ok());
}

#[test]
fn a_short_file_takes_defaults() {
    let text = full().text().expect("UTF-8");
    let transfer =
        &text[text.find("[transfer]").expect("a section")..text.find("[[objects]]").expect("rows")];
    let state = ViewState::parse(&format!("version = 1\n{transfer}")).expect("the rest has defaults");
    assert_eq!(state.quality, Quality::default());
    assert_eq!(state.orbit, Orbit::default());
    // Files from before there was ambient occlusion.
    let older = transfer.replace("occlusion = 0.35\n", "");
    assert_ne!(older, transfer);
    let state = ViewState::parse(&format!("version = 1\n{older}")).expect("occlusion has a default");
    assert_eq!(state.transfer.material.occlusion, 0.0);
    // Files from before splats could stand beside others.
    let text = full().text().expect("UTF-8");
    let state = ViewState::parse(&text.replace("beside = \"/data/coarse.vgs\"\n", "")).expect("none beside");
    assert_eq!(Files { beside: full().files.beside, ..state.files }, full().files);
}

#[test]
fn a_split_picture_shows_splats_beside_splats_or_the_volume() {
    let mut state = full();
    let all = |_| true;
    let none_beside = |subject| subject != Subject::Beside;
    assert_eq!(state.subjects(all), [Subject::Splats, Subject::Beside]);
    assert_eq!(state.subjects(none_beside), [Subject::Splats, Subject::Volume]);
    assert_eq!(state.subjects(|subject| subject == Subject::Beside), [Subject::Beside]);
    // The split is at a quarter.
    for (x, left, right) in
        [(0.2, Subject::Splats, Subject::Splats), (0.25, Subject::Beside, Subject::Volume)]
    {
        assert_eq!((state.subject_at(x, all), state.subject_at(x, none_beside)), (Some(left), Some(right)));
    }
    assert_eq!(state.subject_at(0.9, |subject| subject == Subject::Splats), Some(Subject::Splats));
    state.split = None;
    for subject in Subject::ALL {
        state.shown = subject;
        assert_eq!((state.subjects(all), state.subject_at(0.9, all)), (vec![subject], Some(subject)));
    }
    assert_eq!((state.subjects(|_| false), state.subject_at(0.5, |_| false)), (vec![], None));
}

#[test]
fn splats_beside_go_with_those_that_they_are_beside_of() {
    let mut state = full();
    state.shown = Subject::Beside;
    state.forget_missing_files();
    assert_eq!((state.shown, state.files.beside.is_some()), (Subject::Beside, true));
    state.files.splats.clear();
    state.forget_missing_files();
    assert_eq!((state.shown, &state.files.beside), (Subject::Splats, &None));
    assert!(ViewState::parse(&state.text().expect("UTF-8")).is_ok());
    state.shown = Subject::Beside;
    let error = ViewState::parse(&state.text().expect("UTF-8")).expect_err("nothing is beside");
    assert!(error.code == "VGS-VIEW-003" && error.message.contains("beside"), "{error}");
}

#[test]
fn what_is_wrong_is_named() {
    let text = full().text().expect("UTF-8");
    for (from, to, code, word) in [
        ("version = 1", "version = 2", "VGS-VIEW-001", "version 2"),
        ("version = 1", "version = 1\nflavour = 3", "VGS-VIEW-002", "flavour"),
        ("splats = [\"/data/a.ply\", \"/data/b.ply\"]", "splats = []", "VGS-VIEW-003", "beside"),
        ("mode = \"exact\"", "mode = \"pretty\"", "VGS-VIEW-002", "pretty"),
        ("split = 0.25", "split = 1.25", "VGS-VIEW-003", "split"),
        ("split = 0.25", "split = nan", "VGS-VIEW-003", "split"),
        ("step = 1.5", "step = 0.0", "VGS-VIEW-003", "step"),
        ("splat_budget = 100000", "splat_budget = 0", "VGS-VIEW-003", "splat_budget"),
        ("fov_deg = 30.0", "fov_deg = 300.0", "VGS-VIEW-003", "fov_deg"),
        ("offset_mm = -7.5", "offset_mm = inf", "VGS-VIEW-003", "planes"),
        ("file = 1", "file = 2", "VGS-VIEW-003", "objects"),
        ("occlusion = 0.35", "occlusion = 1.35", "VGS-TF-012", "occlusion"),
        ("opacity = 0.4", "opacity = 1.4", "VGS-VIEW-003", "objects"),
        ("files = 2", "files = 3", "VGS-VIEW-003", "deleted"),
        ("files = 2", "files = 0", "VGS-VIEW-003", "deleted"),
        ("low_mm = [-8.5, ", "low_mm = [nan, ", "VGS-VIEW-003", "deleted"),
        ("low_mm = [-8.5, ", "low_mm = [80.5, ", "VGS-VIEW-003", "deleted"),
        ("[deleted.outside]", "[deleted.beside]", "VGS-VIEW-002", "beside"),
        ("files = 1", "faces = 1", "VGS-VIEW-002", "faces"),
    ] {
        assert!(text.contains(from), "{from}\n{text}");
        let error = ViewState::parse(&text.replace(from, to)).expect_err(to);
        assert_eq!(error.code, code, "{to}: {error}");
        assert!(error.message.contains(word), "{to}: {error}");
    }
    assert_eq!(ViewState::parse("not toml at all").expect_err("nonsense").code, "VGS-VIEW-002");
}

#[test]
fn clip_planes_keep_the_box() {
    let mut state = full();
    let inside = |clip: &Clip, x: DVec3| clip.planes().iter().all(|p| p.normal.dot(x) >= p.offset);
    assert_eq!(state.clip.planes().len(), 7);
    assert!(inside(&state.clip, DVec3::ZERO));
    assert!(!inside(&state.clip, DVec3::new(0.0, 61.0, 0.0)));
    assert!(!inside(&state.clip, DVec3::new(-20.0, 0.0, 0.0)), "beyond the plane");
    state.clip.planes[0].on = false;
    assert!(inside(&state.clip, DVec3::new(-20.0, 0.0, 0.0)));
    state.clip.planes[0] = Plane { on: true, normal: DVec3::ZERO, offset_mm: 1.0 };
    assert_eq!(state.clip.planes().len(), 6, "a plane without a direction cuts nothing");
}

#[test]
fn objects_of_a_session_keep_their_settings() {
    let mut state = full();
    state.set_objects(vec![
        Object::new(0, Some(5), "renamed"),
        Object::new(0, Some(9), "spleen"),
        Object::new(1, None, "b"),
    ]);
    let rows: Vec<_> = state.objects.iter().map(|o| (o.name.as_str(), o.opacity)).collect();
    assert_eq!(rows, [("liver", 0.4), ("spleen", 1.0), ("b", 1.0)]);
    state.objects[1].visible = false;
    let look = state.look(&[5, 9, 10]).expect("a look");
    let seen: Vec<_> = look.objects.iter().map(|(n, o)| (*n, o.visible, o.opacity)).collect();
    assert_eq!(seen, [(5, true, 0.4), (9, false, 1.0), (10, true, 1.0)]);
    assert!(state.look(&[]).expect("a look").objects.is_empty());
}

#[test]
fn undo_brings_back_what_was_edited_and_not_the_camera() {
    let mut state = full();
    let before = state.edited();
    state.transfer.shift = 9.0;
    state.orbit.distance_mm = 77.0;
    state.objects[0].visible = false;
    assert!(before.has_objects_of(&state.edited()));
    state.restore(before.clone());
    assert_eq!((state.transfer.shift, state.objects[0].visible), (-40.0, true));
    assert_eq!(state.orbit.distance_mm, 77.0);
    let deleted = std::mem::take(&mut state.deleted);
    assert!(!state.is_edited_as(&before));
    state.restore(before.clone());
    assert_eq!(state.deleted, deleted);
    // A file that could not be read is not left behind in what names it.
    state.files.splats.pop();
    state.forget_missing_files();
    assert_eq!((state.deleted.len(), state.objects.len()), (2, 2), "{:?}", state.deleted);
    assert!(ViewState::parse(&state.text().expect("UTF-8")).is_ok());
    state.restore(before.clone());
    state.set_objects(vec![Object::new(0, None, "other")]);
    assert!(!before.has_objects_of(&state.edited()));
}

#[test]
fn modes_are_those_of_the_engine() {
    for mode in SplatMode::all() {
        assert!(mode.of_splats);
    }
    assert!(!mode_row(full().mode_of(Subject::Volume)).of_splats);
    assert!(Orbit::default().check().is_ok());
}

#[cfg(unix)]
#[test]
fn a_name_that_is_no_text_is_an_error() {
    use std::os::unix::ffi::OsStrExt;
    let mut state = full();
    state.files.splats[0] = std::ffi::OsStr::from_bytes(b"\xff.ply").into();
    assert_eq!(state.text().expect_err("no UTF-8").code, "VGS-VIEW-005");
}
