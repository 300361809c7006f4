use std::path::PathBuf;

use super::*;
use crate::model::deletions::{Bounds, Deletion, Target};

/// Returns the actions of a click on a button.
fn click(bench: &mut Bench, text: &str) -> Vec<Action> {
    let at = bench.find(text);
    bench.click(at)
}

/// Opens the section of the clip planes, with a crop box of 80 mm.
fn with_box() -> Bench {
    let mut bench = Bench::new();
    for section in ["Transfer function", "Quality", "Clipping"] {
        click(&mut bench, section);
        for _ in 0..20 {
            bench.rest();
        }
    }
    bench.press(Key::X, Modifiers::NONE);
    let crop = bench.app.state.clip.crop.as_mut().expect("a box");
    (crop.low_mm, crop.high_mm) = (DVec3::splat(-40.0), DVec3::splat(40.0));
    bench.rest();
    bench
}

fn bounds() -> Bounds {
    Bounds { low_mm: DVec3::splat(-40.0), high_mm: DVec3::splat(40.0), files: 1 }
}

fn is_cropped(bench: &Bench) -> bool {
    bench.app.state.clip.crop.expect("a box").on
}

#[test]
fn a_box_deletes_and_undo_restores() {
    let mut bench = with_box();
    click(&mut bench, "Delete outside");
    assert_eq!(bench.app.state.deleted, [Deletion::Outside(bounds())]);
    assert!(!is_cropped(&bench), "the box has done its work");
    click(&mut bench, "Delete inside");
    assert_eq!(bench.app.state.deleted.len(), 1, "the box is off");
    bench.press(Key::Z, Modifiers::COMMAND);
    assert!(bench.app.state.deleted.is_empty() && is_cropped(&bench), "both are one step");
    bench.press(Key::Y, Modifiers::COMMAND);
    assert_eq!(bench.app.state.deleted, [Deletion::Outside(bounds())]);

    // By keys.
    bench.press(Key::Delete, Modifiers::NONE);
    assert!(bench.app.messages.latest().is_some_and(|m| m.bad && m.help.contains('X')), "the box is off");
    bench.press(Key::X, Modifiers::NONE);
    bench.press(Key::Delete, Modifiers::NONE);
    assert_eq!(bench.app.state.deleted, [Deletion::Outside(bounds()), Deletion::Inside(bounds())]);
    bench.press(Key::X, Modifiers::NONE);
    bench.press(Key::Delete, Modifiers::COMMAND);
    assert_eq!(bench.app.state.deleted[2], Deletion::Outside(bounds()));

    bench.deleted = 250;
    bench.rest();
    bench.find("250 of 1250 splats are deleted");
    click(&mut bench, "Restore all");
    assert!(bench.app.state.deleted.is_empty());
    bench.rest();
    assert!(bench.place_of("Restore all").is_none());
    bench.press(Key::Z, Modifiers::COMMAND);
    assert_eq!(bench.app.state.deleted.len(), 3, "that, too, is undone");
}

#[test]
fn an_object_is_deleted_and_restored() {
    let mut bench = Bench::new();
    let aorta = bench.find("aorta");
    let menu = bench.places_of("…").into_iter().find(|at| (at.y - aorta.y).abs() < 6.0).expect("its menu");
    bench.click(menu);
    click(&mut bench, "Delete");
    let own = Deletion::Object(Target { file: 0, label: Some(2) });
    assert_eq!(bench.app.state.deleted, [own]);
    bench.click(menu);
    click(&mut bench, "Restore");
    assert!(bench.app.state.deleted.is_empty());
    bench.click(menu);
    click(&mut bench, "Save this object…");
    assert!(bench.app.prompt.is_some(), "where to");
    let saved = click(&mut bench, "Save");
    let object = Some(Target { file: 0, label: Some(2) });
    assert!(
        matches!(&saved[..], [Action::SaveSplats { object: found, .. }] if *found == object),
        "{saved:?}"
    );
}

#[test]
fn what_cannot_be_deleted_or_written_is_said() {
    let fitted = PanelInfo { fitted: true, splats: Some(5), ..PanelInfo::default() };
    let mut bench = with_box();
    for (action, info) in [
        (Action::DeleteInside, &fitted),
        (Action::AskSaveSplats, &fitted),
        (Action::AskSaveSplats, &PanelInfo { splats: Some(0), ..PanelInfo::default() }),
        (Action::AskSaveSplats, &PanelInfo::default()),
    ] {
        bench.app.messages.close();
        assert_eq!(bench.app.act(action.clone(), info), None);
        assert!(bench.app.messages.latest().is_some_and(|m| m.bad), "{action:?}");
        assert!(bench.app.state.deleted.is_empty() && bench.app.prompt.is_none());
    }
    bench.app.state.objects.clear();
    bench.app.act(Action::DeleteOutside, &PanelInfo::default());
    assert!(bench.app.state.deleted.is_empty() && is_cropped(&bench));
}

#[test]
fn where_nothing_is_left_it_can_be_restored() {
    let mut bench = Bench::new();
    bench.app.state.deleted = vec![Deletion::Inside(bounds())];
    (bench.deleted, bench.nothing) = (1250, true);
    bench.rest();
    bench.find("No splats left");
    assert!(bench.place_of("Nothing is open").is_none());
    let at = bench.places_of("Restore all").into_iter().find(|at| bench.app.picture().contains(*at));
    bench.click(at.expect("in the middle of the picture"));
    assert!(bench.app.state.deleted.is_empty());
}

#[test]
fn splats_are_saved_beside_those_that_are_open() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut bench = Bench::new();
    let open = folder.path().join("splats.ply");
    std::fs::write(&open, "").expect("written");
    bench.app.state.files.splats = vec![open.clone()];
    bench.press(Key::E, Modifiers::COMMAND);
    click(&mut bench, "splats.ply");
    bench.find("the file exists");
    assert_eq!(click(&mut bench, "Replace"), [], "it is open");
    assert!(bench.app.messages.latest().is_some_and(|m| m.bad && m.text.contains("open")));
    bench.app.state.files.splats = vec![folder.path().join("a.ply")];
    std::fs::remove_file(&open).expect("removed");
    bench.press(Key::E, Modifiers::COMMAND);
    let path = folder.path().join("a-2.ply");
    assert_eq!(click(&mut bench, "Save"), [Action::SaveSplats { path, object: None, force: false }]);
}

#[test]
fn a_session_that_has_changed_is_not_lost_unasked() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut bench = Bench::new();
    bench.app.state.files.splats = vec![folder.path().join("a.ply")];
    // What the program changes by itself, and the camera, are no changes.
    bench.app.take_objects(vec![Object::new(0, None, "a")], None, |_| {});
    bench.press(Key::A, Modifiers::NONE);
    assert_eq!(bench.press(Key::Q, Modifiers::COMMAND), [Action::Quit]);

    bench.press(Key::PageDown, Modifiers::NONE);
    bench.app.change_unasked(|state| state.objects[0].name = "b".into());
    assert_eq!(bench.press(Key::Q, Modifiers::COMMAND), []);
    bench.find("Unsaved changes");
    assert_eq!(click(&mut bench, "Cancel"), []);
    assert_eq!(bench.press(Key::Q, Modifiers::COMMAND), []);
    assert_eq!(click(&mut bench, "Quit without saving"), [Action::Quit]);
    bench.press(Key::Escape, Modifiers::NONE);

    // Cancelled, the question for the file does not end the program when the session is saved later.
    let leave = |bench: &mut Bench| {
        bench.app.leaving = None;
        assert_eq!(bench.press(Key::Q, Modifiers::COMMAND), []);
        click(bench, "Save session")
    };
    assert_eq!(leave(&mut bench), []);
    bench.find("Save the session");
    assert_eq!(click(&mut bench, "Cancel"), []);
    bench.press(Key::S, Modifiers::COMMAND);
    assert_eq!(click(&mut bench, "Save"), []);
    assert_eq!(bench.press(Key::Q, Modifiers::COMMAND), [Action::Quit], "it is saved");
    bench.app.state.deleted = vec![Deletion::Inside(bounds())];
    assert_eq!(leave(&mut bench), []);
    assert_eq!(click(&mut bench, "Replace"), [Action::Quit]);
    let path = folder.path().join("a.toml");
    assert_eq!(ViewState::read(path).expect("a session").deleted.len(), 1);

    // Another session takes the place of this one only when it is saved, or need not be.
    let [other, splats] = ["other.toml", "b.ply"].map(|name| folder.path().join(name));
    let open = |bench: &mut Bench, path: &PathBuf| {
        let left = bench.app.act(Action::Open(vec![path.clone()]), &PanelInfo::default());
        bench.rest();
        left
    };
    let opened = Action::Open(vec![other.clone()]);
    assert_eq!(open(&mut bench, &other), Some(opened.clone()), "nothing has changed");
    bench.app.state.transfer.shift = 5.0;
    assert!(open(&mut bench, &splats).is_some(), "more files take nothing away");
    assert_eq!(open(&mut bench, &other), None);
    assert_eq!(click(&mut bench, "Cancel"), []);
    assert_eq!(open(&mut bench, &other), None);
    assert_eq!(click(&mut bench, "Open without saving"), std::slice::from_ref(&opened));
    assert_eq!(open(&mut bench, &other), None);
    assert_eq!(click(&mut bench, "Save session"), []);
    assert_eq!(click(&mut bench, "Replace"), [opened], "the file that it was saved to before");

    // A fit is still asked about once the session is saved.
    bench.app.state.transfer.shift = 7.0;
    bench.fit = Some(FitStatus::default());
    assert_eq!(leave(&mut bench), []);
    assert_eq!(click(&mut bench, "Replace"), []);
    bench.rest();
    bench.find("The fit has not been saved");
    assert!(bench.place_of("Save session").is_none());
    // What is no longer lost is no longer asked about.
    bench.fit = None;
    bench.rest();
    assert!(bench.place_of("The fit has not been saved").is_none() && bench.app.leaving.is_none());
}
