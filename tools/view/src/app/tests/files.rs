//! Tests of files that are asked for: opened, written, missing, and series.

use engine::volume::dicom::{self, Slice, StackSummary};

use super::*;

#[test]
fn a_file_is_asked_for_and_written_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut bench = Bench::new();
    bench.app.state.files.splats = vec![folder.path().join("a.ply")];
    let path = folder.path().join("a.toml");
    bench.press(Key::S, Modifiers::COMMAND);
    let save = bench.find("Save");
    bench.click(save);
    assert_eq!(ViewState::read(&path).expect("a session"), bench.app.state);
    let written = std::fs::read(&path).expect("a file");
    bench.press(Key::Escape, Modifiers::NONE);
    bench.app.state.transfer.shift = 5.0;
    // Enter does not replace what is there; the button says that it would.
    bench.press(Key::S, Modifiers::COMMAND);
    bench.press(Key::Enter, Modifiers::NONE);
    assert_eq!(std::fs::read(&path).expect("a file"), written);
    let replace = bench.find("Replace");
    bench.click(replace);
    assert_eq!(ViewState::read(&path).expect("a session").transfer.shift, 5.0);
    bench.press(Key::O, Modifiers::COMMAND);
    bench.find("a.toml");
    bench.find("Home");
    // A click beside it leaves it open.
    bench.click(pos2(5.0, 795.0));
    bench.find("a.toml");
    bench.press(Key::Escape, Modifiers::NONE);
    assert!(bench.app.prompt.is_none());
}

#[test]
fn a_page_is_asked_for_with_its_title() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut bench = Bench::new();
    bench.app.state.files.splats = vec![folder.path().join("a.ply")];
    bench.press(Key::E, Modifiers::COMMAND | Modifiers::SHIFT);
    bench.find("Share as a page");
    let title = bench.find("that of its objects");
    bench.click(title);
    bench.frame(vec![Event::Text("Hip, before".into())], Modifiers::NONE);
    let write = bench.find("Write");
    let share =
        Action::Share { path: folder.path().join("a.html"), title: "Hip, before".into(), force: false };
    assert_eq!(bench.click(write), [share]);
    bench.app.act(Action::AskShare, &PanelInfo::default());
    assert!(
        bench.app.prompt.is_none() && bench.app.messages.latest().is_some_and(|m| m.bad),
        "without splats"
    );
}

#[test]
fn missing_files_of_a_session_are_found_or_left_out() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("renamed.ply"), "").expect("a file");
    let mut bench = Bench::new();
    let before = bench.app.state.clone();
    let mut state = before.clone();
    state.files.splats = vec!["/none/one.ply".into(), "/none/two.ply".into()];
    let session = PathBuf::from("/none/s.toml");
    bench.app.ask_missing(state.clone(), session.clone());
    bench.rest();
    bench.find("Files are missing");
    bench.find("two.ply");
    assert_eq!(bench.press(Key::Q, Modifiers::COMMAND), [], "the question has to be answered first");
    let cancel = bench.find("Cancel");
    assert_eq!(bench.click(cancel), []);
    assert!(bench.app.state == before && bench.app.take_found().is_none(), "nothing has changed");

    bench.app.ask_missing(state.clone(), session.clone());
    bench.rest();
    let find = bench.find("Find…");
    bench.click(find);
    bench.find("Where is the missing file?");
    bench.app.act(Action::Found(at("renamed.ply")), &PanelInfo::default());
    bench.app.prompt = None;
    bench.rest();
    bench.find("A file is missing");
    let without = bench.find("Open without");
    assert_eq!(bench.click(without), [Action::BeginSession]);
    let (found, file) = bench.app.take_found().expect("a session");
    assert_eq!((found.files.splats, file), (vec![at("renamed.ply")], session));
    // Once all of them are found, it opens by itself.
    state.files.splats.pop();
    bench.app.ask_missing(state, "/none/s.toml".into());
    bench.app.act(Action::AskFound("/none/one.ply".into()), &PanelInfo::default());
    let next = bench.app.act(Action::Found(at("renamed.ply")), &PanelInfo::default());
    assert_eq!(next, Some(Action::BeginSession));
}

#[test]
fn a_folder_of_slices_can_be_opened() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut bench = Bench::new();
    bench.app.state.files.splats = vec![folder.path().join("a.ply")];
    bench.press(Key::O, Modifiers::COMMAND);
    let button = bench.find("Open the folder");
    let actions = bench.click(button);
    let expected = Action::Open(vec![folder.path().join("")]);
    assert!(actions.contains(&expected), "{actions:?}");
    // What is written goes to a file.
    bench.press(Key::Escape, Modifiers::NONE);
    bench.press(Key::S, Modifiers::COMMAND);
    assert!(bench.place_of("Open the folder").is_none());
}

#[test]
fn one_of_several_series_is_chosen() {
    let mut bench = Bench::new();
    let row = |number: usize, description: &str, patient: &str, notes: &[&str]| dicom::Series {
        summary: StackSummary {
            number,
            series_uid: format!("1.2.{number}"),
            modality: "CT".into(),
            description: description.into(),
            size: [512, 512, 90],
            localizer: false,
        },
        key: format!("1.2.{number}#1"),
        patient: patient.into(),
        study_date: "2026-03-31".into(),
        thickness_mm: 1.0,
        distance_mm: Some(0.5),
        notes: notes.iter().map(|note| (*note).to_owned()).collect(),
        slice: Some(Slice { size: [4, 4], spacing_mm: [0.7; 2], samples: vec![1.0; 16] }),
    };
    let asked = Files { volume: Some("scan".into()), roi: Some("mask.nii".into()), ..Files::default() };
    let missing = "slices are missing, 3.0 mm between slices 4 and 5";
    let rows = vec![row(1, "Soft tissue", "Doe, Jane", &[]), row(2, "Bone kernel", "Doe, Jane", &[missing])];
    let before = bench.app.state.files.clone();
    let ask = |bench: &mut Bench| {
        bench.app.ask_series(Series { files: asked.clone(), rows: rows.clone() });
        bench.rest();
        bench.find("Which series?");
        assert_eq!(bench.press(Key::Q, Modifiers::COMMAND), [], "the question has to be answered first");
    };
    ask(&mut bench);
    let cancel = bench.find("Cancel");
    assert_eq!(bench.click(cancel), []);
    assert!(bench.app.state.files == before && bench.place_of("Which series?").is_none());
    ask(&mut bench);
    bench.find("Doe, Jane, 2026-03-31");
    let second = format!(
        "2: CT Bone kernel, 90 slices of 512 x 512\n1.00 mm thick, 0.50 mm apart, pixels of 0.70 mm\n{missing}"
    );
    let second = bench.find(&second);
    // A click beside the question does not take it away.
    assert_eq!(bench.click(pos2(5.0, 5.0)), []);
    assert_eq!(bench.click(second), [Action::ReadFiles]);
    assert_eq!(bench.app.state.files, Files { series: Some("1.2.2#1".into()), ..asked });
    assert!(bench.place_of("Which series?").is_none());
    // Another one may be chosen of a folder, and of a slice without an ending.
    for (volume, may) in [(".", true), ("IM0001", true), ("a.zip", true), ("ct.nii.gz", false)] {
        let files = Files { volume: Some(volume.into()), ..Files::default() };
        assert_eq!(files.may_have_series(), may, "{volume}");
    }
}
