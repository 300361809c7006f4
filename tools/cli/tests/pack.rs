//! A session that is sent: packed by command, and opened from the zip.

use std::path::PathBuf;

use crate::support::Folder;
use crate::support::series::write_two_series;
use engine::transfer::PRESETS;
use engine::volume::{ReadOptions, Volume, nifti};
use view::io::loader::read_volume;
use view::model::state::{Files, ViewState};

/// Returns a folder with two series, a mask, and the session `s.toml` of the second series by its number.
fn folder() -> (Folder, Volume) {
    let folder = Folder::new(16);
    let mut volume = Volume::read(folder.path("ct.nii.gz"), &ReadOptions::default()).expect("the phantom");
    volume.samples.iter_mut().for_each(|hu| *hu = hu.round());
    nifti::write(folder.path("ct.nii.gz"), &volume, true).expect("the phantom");
    write_two_series(&folder, "scan", &volume);
    let files = Files {
        volume: Some(folder.path("scan")),
        series: Some("2".into()),
        roi: Some(folder.path("mask.nii.gz")),
        ..Files::default()
    };
    let state = ViewState { files, ..ViewState::new(&PRESETS[0].over([-1000.0, 2000.0])) };
    state.write(folder.path("s.toml"), false).expect("a session");
    (folder, volume)
}

#[test]
fn a_session_is_packed_with_the_series_that_it_shows() {
    let (folder, volume) = folder();
    let text = folder.text("s.toml");
    assert!(text.contains("volume = \"scan\"") && text.contains("roi = \"mask.nii.gz\""), "{text}");
    let packed = folder.run(&["pack", "s.toml", "-o", "case.zip", "--json"]);
    assert_eq!(packed.code, 0, "{}", packed.err);
    let json = packed.json();
    assert_eq!((json["files"].as_u64(), json["dicom"].as_bool()), (Some(17), Some(true)), "{json}");
    assert!(packed.err.contains("name the patient"), "{}", packed.err);
    // The same files make the same bytes.
    let first = folder.read("case.zip");
    assert_eq!(folder.run(&["pack", "s.toml", "-o", "case.zip", "--force"]).code, 0);
    assert!(folder.read("case.zip") == first);

    // Elsewhere and alone it shows the same volume, by the UID of its series.
    let elsewhere = tempfile::tempdir().expect("a folder");
    let zip = elsewhere.path().join("case.zip");
    std::fs::copy(folder.path("case.zip"), &zip).expect("sent");
    drop(folder);
    let state = ViewState::read(&zip).expect("opened");
    assert_eq!(state.files.series.as_deref(), Some("1.2.9"));
    let path = state.files.volume.clone().expect("a volume");
    assert!(path.ends_with("scan"), "{}", path.display());
    let shown = read_volume(&path, None, &state.files).expect("read");
    assert!(shown.volume.samples == volume.samples && shown.roi.is_some());
    assert_eq!(shown.series.as_deref(), Some("1.2.9"));
}

#[test]
fn a_number_of_a_series_becomes_its_uid_where_it_is_read() {
    let (folder, _) = folder();
    let state = ViewState::read(folder.path("s.toml")).expect("a session");
    assert_eq!(state.files.series.as_deref(), Some("2"), "old sessions still open");
    let path = state.files.volume.clone().expect("a volume");
    let shown = read_volume(&path, None, &state.files).expect("read");
    assert_eq!(shown.series.as_deref(), Some("1.2.9"));
    // `vgs info` and --series know it by that, too.
    let info = folder.run(&["compare", "scan", "ct.nii.gz", "--series", "1.2.9", "--json"]);
    assert_eq!(info.code, 0, "{}", info.err);
}

#[test]
fn what_cannot_be_packed_is_named_and_nothing_is_written() {
    let (folder, _) = folder();
    std::fs::remove_file(folder.path("mask.nii.gz")).expect("gone");
    folder.write("there.zip", "mine");
    let before = folder.contents();
    for (arguments, code, told) in [
        (&["s.toml", "-o", "case.zip"][..], 66, "mask.nii.gz"),
        (&["none.toml", "-o", "case.zip"], 66, "none.toml"),
        (&["ct.nii.gz", "-o", "case.zip"], 65, "ct.nii.gz"),
        (&["s.toml", "-o", "there.zip"], 73, "--force"),
        (&["s.toml", "-o", "s.toml", "--force"], 73, "input"),
        (&["s.toml"], 2, "--output"),
    ] {
        let ended = folder.run(&[&["pack"], arguments].concat());
        assert_eq!(ended.code, code, "{arguments:?}: {}", ended.err);
        assert!(ended.err.contains(told), "{arguments:?}: {}", ended.err);
    }
    assert_eq!(folder.contents(), before);
    assert!(!PathBuf::from("case.zip").exists());
}
