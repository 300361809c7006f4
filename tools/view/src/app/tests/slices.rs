use super::*;

#[test]
fn slices_share_a_crosshair_with_the_picture() {
    let mut bench = Bench::new();
    let wide = bench.app.picture();
    bench.press(Key::V, Modifiers::NONE);
    let narrow = bench.app.picture();
    assert!(narrow.left() > wide.left() + 200.0, "the slices are beside the picture: {narrow}");
    let [axial, coronal, sagittal] = ["Axial", "Coronal", "Sagittal"].map(|name| bench.find(name));
    assert!(axial.y < coronal.y && coronal.y < sagittal.y);
    assert_eq!(bench.app.state.slices.at_mm, Some(DVec3::ZERO), "the middle of the scene");
    assert_eq!(bench.app.state.slices.window, Some([-200.0, 800.0]));
    bench.find("0.0 HU");

    // A click in the axial slice moves the crosshair in its plane: to the left is the patient's right.
    let middle = axial + vec2(100.0, 90.0);
    bench.click(middle);
    let first = bench.app.state.slices.at_mm.expect("a crosshair");
    bench.click(middle - vec2(40.0, 30.0));
    let at = bench.app.state.slices.at_mm.expect("a crosshair");
    let moved = at - first;
    assert!(moved.x > 10.0 && moved.y > 10.0 && moved.z == 0.0, "{moved}");
    assert!((moved.x / moved.y - 4.0 / 3.0).abs() < 1e-3, "as many mm a point along both");
    // The intensity of this scene is its y.
    bench.find(&format!("{:.1} HU", at.y));

    let wheel = Event::MouseWheel {
        unit: egui::MouseWheelUnit::Line,
        delta: vec2(0.0, 3.0),
        phase: egui::TouchPhase::Move,
        modifiers: Modifiers::NONE,
    };
    let distance = bench.app.state.orbit.distance_mm;
    bench.frame(vec![Event::PointerMoved(middle), wheel], Modifiers::NONE);
    bench.rest();
    let scrolled = bench.app.state.slices.at_mm.expect("a crosshair") - at;
    assert!(scrolled.z > 0.0 && scrolled.x == 0.0 && scrolled.y == 0.0, "{scrolled}");
    assert_eq!(bench.app.state.orbit.distance_mm, distance, "the picture does not move");

    bench.drag(middle, vec2(100.0, 0.0), PointerButton::Secondary, Modifiers::NONE);
    let [low, high] = bench.app.state.slices.window.expect("a window");
    assert!(high - low > 1300.0 && (low + high - 600.0).abs() < 1e-6, "{low} {high}");

    // A click on the scene brings the slices there.
    let on_scene = bench.middle();
    bench.click(on_scene);
    let at = bench.app.state.slices.at_mm.expect("a crosshair");
    assert!(at.distance(DVec3::new(0.0, 100.0, 0.0)) < 1.0, "the nearest point of the ball: {at}");

    let text = toml::to_string(&bench.app.state).expect("a session");
    assert!(text.contains("[slices]") && text.contains("shown = true"), "{text}");
    let read: ViewState = toml::from_str(&text).expect("a session");
    assert_eq!(read.slices, bench.app.state.slices);
    bench.press(Key::V, Modifiers::NONE);
    assert_eq!(bench.app.picture(), wide);
}

#[test]
fn slices_are_made_anew_where_something_has_changed() {
    let mut bench = Bench::new();
    bench.press(Key::V, Modifiers::NONE);
    let asked = std::cell::Cell::new(0);
    let sample = |x: DVec3| {
        asked.set(asked.get() + 1);
        Some(x.z)
    };
    let frame = |bench: &mut Bench, data| {
        asked.set(0);
        let info = PanelInfo {
            bounds: Some([DVec3::splat(-100.0), DVec3::splat(100.0)]),
            range: [-1000.0, 2000.0],
            unit: " HU",
            volume: true,
            data,
            sample: &sample,
            ..PanelInfo::default()
        };
        let input = RawInput { screen_rect: Some(SCREEN), time: Some(bench.time), ..RawInput::default() };
        let output = bench.context.run_ui(input, |ui| _ = bench.app.ui(ui, &info));
        output.drop_without_applying_deltas();
        asked.get()
    };
    frame(&mut bench, 1);
    let at_rest = frame(&mut bench, 1);
    assert!(at_rest < 10, "{at_rest} samples of a picture that is there");
    let all = frame(&mut bench, 2);
    let one = all / 3;
    // Another device has none of their textures.
    bench.app.forget_textures();
    let again = frame(&mut bench, 2);
    assert_eq!(again, all);
    assert!(all > 3 * 100 * 100, "other data: {all}");
    bench.app.state.slices.at_mm = Some(DVec3::new(0.0, 0.0, 5.0));
    let moved = frame(&mut bench, 2);
    assert!(moved > one / 2 && moved < 2 * one, "one of three planes: {moved} of {all}");
}
