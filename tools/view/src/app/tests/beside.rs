//! Tests of splats beside others and of the split picture.

use super::*;

#[test]
fn the_line_of_the_split_follows_the_mouse() {
    let mut bench = Bench::new();
    bench.press(Key::B, Modifiers::NONE);
    let picture = bench.app.picture();
    let by = vec2(-0.25 * picture.width(), 0.0);
    bench.drag(picture.center() + vec2(2.0, 80.0), by, PointerButton::Primary, Modifiers::NONE);
    let split = bench.app.state.split.expect("both");
    assert!((split - 0.25).abs() < 0.01, "{split}");
    assert_eq!(bench.app.take_changes(), Changes { rendering: true, ..Changes::default() });
}

#[test]
fn both_sides_of_the_split_are_named() {
    let mut bench = Bench::new();
    bench.app.state.files.volume = Some("scans/ct.nii.gz".into());
    bench.app.state.files.splats = vec!["fine/a.ply".into(), "fine/b.ply".into()];
    bench.press(Key::B, Modifiers::NONE);
    let line = bench.middle().x;
    assert!(bench.find("a.ply and 1 more").x < line && bench.find("ct.nii.gz").x > line);
    // Splats beside the others come in place of the volume.
    bench.app.state.files.splats.pop();
    bench.app.state.files.beside = Some("coarse/b.vgs".into());
    bench.beside = true;
    bench.rest();
    assert!(bench.find("a.ply").x < line && bench.find("b.vgs").x > line);
    // Names that are the same are told apart by their folders.
    bench.app.state.files.beside = Some("coarse/a.ply".into());
    bench.rest();
    assert!(bench.find("fine/a.ply").x < line && bench.find("coarse/a.ply").x > line);
    // Where there is but one side, there is no line.
    (bench.beside, bench.volume) = (false, false);
    bench.rest();
    assert!(bench.place_of("a.ply").is_none() && bench.place_of("fine/a.ply").is_none());
    let orbit = bench.app.state.orbit;
    bench.drag(bench.middle(), vec2(90.0, 0.0), PointerButton::Primary, Modifiers::NONE);
    assert!(bench.app.state.split == Some(0.5) && bench.app.state.orbit != orbit, "a drag turns");
}

#[test]
fn splats_are_opened_beside_others_seen_in_turn_and_closed() {
    let folder = tempfile::tempdir().expect("a folder");
    let coarse = folder.path().join("coarse.vgs");
    std::fs::write(&coarse, "").expect("a file");
    let mut bench = Bench::new();
    bench.app.state.files.splats = vec![folder.path().join("fine.ply")];
    let file = bench.find("File");
    bench.click(file);
    let open = bench.find("Open beside…");
    bench.click(open);
    let name = bench.find("coarse.vgs");
    bench.click(name);
    let open = bench.find("Open");
    assert_eq!(bench.click(open), [Action::Beside(coarse.clone())]);

    // The window has opened it.
    bench.app.state.files.beside = Some(coarse);
    bench.beside = true;
    bench.rest();
    for subject in [Subject::Beside, Subject::Volume, Subject::Splats, Subject::Beside] {
        bench.press(Key::Space, Modifiers::NONE);
        assert_eq!(bench.app.state.shown, subject);
    }
    assert!(bench.place_of("Beside").is_some(), "the panel has it, too");
    let picture = bench.app.picture();
    bench.press(Key::B, Modifiers::NONE);
    for (at, expected) in [
        (picture.left_center() + vec2(200.0, 0.0), None),
        (picture.right_center() - vec2(200.0, 0.0), Some(77.0)),
    ] {
        bench.frame(vec![Event::PointerMoved(at)], Modifiers::NONE);
        let reading = bench.app.reading.expect("the ball is hit everywhere");
        let own = Some(reading.at_mm.y);
        assert_eq!(reading.intensity, expected.or(own), "the side under the cursor is read");
    }
    let path = bench.app.state.files.beside.clone().expect("beside");
    bench.app.act(
        Action::SaveSplats { path, object: None, force: true },
        &PanelInfo { splats: Some(9), ..PanelInfo::default() },
    );
    assert!(
        bench.app.messages.latest().is_some_and(|m| m.text.contains("is open")),
        "it is not written over"
    );
    bench.app.messages.close();

    // Without it the split is that of the volume; without a volume there is none.
    let close = |bench: &mut Bench| bench.press(Key::B, Modifiers::COMMAND | Modifiers::SHIFT);
    assert_eq!(close(&mut bench), [Action::CloseBeside]);
    let state = &bench.app.state;
    assert_eq!((&state.files.beside, state.shown, state.split), (&None, Subject::Splats, Some(0.5)));
    assert_eq!(close(&mut bench), [], "there is nothing to close");
    bench.app.state.files.beside = Some("coarse.vgs".into());
    bench.volume = false;
    assert_eq!(close(&mut bench), [Action::CloseBeside]);
    assert_eq!(bench.app.state.split, None);
    bench.beside = false;
    bench.press(Key::Space, Modifiers::NONE);
    bench.press(Key::B, Modifiers::NONE);
    assert_eq!((bench.app.state.shown, bench.app.state.split), (Subject::Splats, None), "there is one alone");

    bench.app.state.files.splats.clear();
    bench.press(Key::B, Modifiers::COMMAND);
    assert!(bench.app.prompt.is_none() && bench.app.messages.latest().is_some_and(|m| m.bad));
}
