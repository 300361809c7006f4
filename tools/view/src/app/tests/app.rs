use egui::{Context, Event, Key, Modifiers, PointerButton, Pos2, RawInput, Shape, pos2, vec2};
use engine::error::Kind;
use engine::fidelity::ShownError;
use engine::render::{Intensities, SplatKind};
use engine::splat::{Splat, SplatSet};
use glam::DVec2;

use super::*;
use crate::model::fit_plan::FitStatus;
use crate::model::orbit::{Orbit, Side};
use crate::model::region::RegionSize;
use crate::model::state::{Files, SplatMode, Subject};
use crate::model::transfer::Transfer;

#[path = "asking.rs"]
mod asking;
#[path = "bench.rs"]
mod bench;
#[path = "beside.rs"]
mod beside;
#[path = "deletions.rs"]
mod deletions;
#[path = "error.rs"]
mod error;
#[path = "files.rs"]
mod files;
#[path = "fit.rs"]
mod fit;
#[path = "light.rs"]
mod light;
#[path = "messages.rs"]
mod messages;
#[path = "modes.rs"]
mod modes;
#[path = "slices.rs"]
mod slices;

use bench::{Bench, SCREEN};

/// Returns a set of these objects, all splats of one at one intensity.
fn set_of(intensities: &[f32]) -> SplatSet {
    SplatSet {
        splats: intensities.iter().map(|&intensity| Splat { intensity, ..Splat::default() }).collect(),
        labels: Some((1..).take(intensities.len()).collect()),
        ..SplatSet::default()
    }
}

#[test]
fn objects_that_the_function_does_not_show_are_told_once_and_made_visible_by_a_button() {
    let mut bench = Bench::new();
    bench.intensities = Intensities::of_objects(&set_of(&[60.0, -900.0]));
    let soft = PRESETS.iter().find(|p| p.name == "CT-Soft-Tissue").expect("a preset");
    bench.app.state.transfer = Transfer::new(&soft.over([-1000.0, 2000.0]));
    bench.rest();
    let told = "aorta is barely visible.";
    assert!(bench.find(told).y < bench.find("liver").y, "above the list");
    // What is hidden on purpose is not missed.
    bench.app.state.objects[1].visible = false;
    bench.rest();
    assert_eq!(bench.place_of(told), None);
    bench.app.state.objects[1].visible = true;
    let bone = Transfer::new(&PRESETS[0].over([-1000.0, 2000.0]));
    bench.app.state.transfer = bone.clone();
    bench.rest();
    assert!(bench.place_of("2 of 2 objects are barely visible.").is_some());
    let mend = bench.find("Make them visible");
    bench.click(mend);
    bench.rest();
    assert!(bench.place_of("Make them visible").is_none(), "both are seen");
    let functions = |bench: &Bench| -> Vec<Option<String>> {
        bench.app.state.objects.iter().map(|o| Some(o.transfer.as_ref()?.name.clone())).collect()
    };
    assert_eq!(functions(&bench), [Some("Organ".to_owned()), Some("Own range".to_owned())]);
    assert!(bench.app.state.objects.iter().all(|object| object.tint.is_some()));
    // In a mode where objects have functions of their own, that of each counts.
    bench.app.state.mode = SplatMode::named("decoded").expect("a mode");
    bench.app.state.objects[1].transfer = Some(bone.clone());
    bench.rest();
    assert!(bench.place_of(told).is_some());
    // One that a user has chosen stays, others follow what is chosen for the scene; undo brings them back.
    bench.press(Key::PageDown, Modifiers::NONE);
    assert_eq!(functions(&bench), [None, Some("CT-Bone".to_owned())]);
    assert_ne!(bench.app.state.transfer.name, "By kind");
    bench.press(Key::Z, Modifiers::COMMAND);
    assert_eq!(functions(&bench)[0].as_deref(), Some("Organ"));
    assert_eq!(bench.app.state.transfer.name, "By kind");
}

#[test]
fn files_of_several_objects_open_in_their_usual_look_unless_a_user_has_said_more() {
    let rows = |n: usize| -> Vec<Object> {
        let names = ["liver", "aorta", "vertebrae_L3"];
        (1..).zip(names).take(n).map(|(label, name)| Object::new(0, Some(label), name)).collect()
    };
    let usual = |n: usize| {
        let set = set_of(&[60.0, 40.0, 400.0][..n]);
        let rows = rows(n);
        let names = rows.iter().map(|row| row.name.as_str());
        UsualLook::of_objects(names, &Intensities::of_objects(&set), engine::unit::Unit::Hu)
    };
    let fresh = || {
        let state = ViewState::new(&PRESETS[0].over([-1000.0, 2000.0]));
        App::new(state, None, Settings::default())
    };
    let functions = |app: &App| -> Vec<Option<String>> {
        app.state.objects.iter().map(|o| Some(o.transfer.as_ref()?.name.clone())).collect()
    };
    let some = |name: &str| Some(name.to_owned());
    let mut app = fresh();
    app.take_objects(rows(2), Some(&usual(2)), |_| {});
    assert_eq!(functions(&app), [some("Organ"), some("Vessel")]);
    assert!(app.state.transfer.name == "By kind" && !app.is_changed(), "nobody has changed anything");
    // Further files count as well, and what deletions leave of them changes nothing.
    app.take_objects(rows(3), Some(&usual(3)), |_| {});
    assert_eq!(functions(&app), [some("Organ"), some("Vessel"), some("Bone")]);
    let look = (app.state.transfer.clone(), app.state.objects.clone());
    app.take_objects(rows(3), Some(&usual(2)), |_| {});
    assert_eq!((app.state.transfer.clone(), app.state.objects.clone()), look);
    // A user's own function, that of a flag and that of a session stay.
    let other = Transfer::new(&PRESETS[1].over([-1000.0, 2000.0]));
    app.state.edit_transfer(|state| state.transfer = other.clone());
    assert_eq!(functions(&app), [None, None, None]);
    app.take_objects(rows(2), Some(&usual(2)), |_| {});
    assert_eq!((functions(&app), app.state.transfer.clone()), (vec![None, None], other));
    let mut flagged = fresh();
    flagged.keep_look();
    let session = App::new(fresh().state, Some("s.toml".into()), Settings::default());
    for mut app in [flagged, session] {
        app.take_objects(rows(2), Some(&usual(2)), |_| {});
        assert_eq!((functions(&app), app.state.transfer.name.as_str()), (vec![None, None], "CT-Bone"));
        assert!(app.state.objects.iter().all(|object| object.tint.is_none()));
    }
    // How it is lit is no other function.
    let mut app = fresh();
    app.take_objects(rows(2), Some(&usual(2)), |_| {});
    app.state.edit_transfer(|state| state.transfer.material.shade = false);
    assert_eq!(functions(&app), [some("Organ"), some("Vessel")]);
}

#[test]
fn a_list_of_117_objects_is_searched_folded_and_quick() {
    let mut bench = Bench::new();
    let names = (0..117).map(|i| match i {
        0..24 => format!("rib_left_{i}"),
        24..50 => format!("vertebrae_L{i}"),
        50..80 => format!("gluteus_{i}"),
        80 => "liver".to_owned(),
        i => format!("structure {i}"),
    });
    bench.app.state.objects =
        (1..).zip(names).map(|(label, name)| Object::new(0, Some(label), name)).collect();
    bench.intensities = Intensities::of_objects(&set_of(&[60.0; 117]));
    bench.rest();
    // Only what is in view is laid out; all of it can be drawn.
    let rows = bench.places_of("Only").len();
    assert!((5..30).contains(&rows), "{rows} rows");
    for text in ["⏷ Organs  1", "⏷ Bones  50"] {
        bench.find(text);
        let missing: String = bench.context.fonts_mut(|fonts| {
            text.chars().filter(|c| !fonts.has_glyph(&egui::FontId::default(), *c)).collect()
        });
        assert!(missing.is_empty(), "{missing:?}");
    }
    // Quick as a frame: all of the panels, of an unoptimised build on a busy machine.
    let start = std::time::Instant::now();
    (0..20).for_each(|_| _ = bench.frame(Vec::new(), Modifiers::NONE));
    let ms = start.elapsed().as_secs_f64() * 1e3 / 20.0;
    println!("a frame of the panels with 117 objects: {ms:.2} ms");
    assert!(ms < 100.0, "{ms} ms");
    // A heading folds its objects away, and its eye hides them.
    let bones = bench.find("⏷ Bones  50");
    bench.click(bones);
    bench.rest();
    assert!(bench.place_of("rib_left_0").is_none() && bench.place_of("⏵ Bones  50").is_some());
    let heading = bench.find("⏵ Bones  50");
    let eye = bench.places_of("👁").into_iter().find(|at| (at.y - heading.y).abs() < 6.0).expect("its eye");
    bench.click(eye);
    let hidden = bench.app.state.objects.iter().filter(|object| !object.visible).count();
    assert_eq!(hidden, 50);
    // A search finds what is folded away.
    let field = bench.find("Search");
    bench.click(field);
    bench.frame(vec![Event::Text("rib 11".into())], Modifiers::NONE);
    bench.rest();
    assert_eq!(bench.places_of("Only").len(), 1);
    bench.find("rib_left_11");
    let only = bench.find("Only");
    bench.click(only);
    let visible = |bench: &Bench| bench.app.state.objects.iter().filter(|object| object.visible).count();
    assert!(bench.app.state.objects[11].visible && visible(&bench) == 1);
    bench.click(only);
    assert_eq!(visible(&bench), 67, "as before");
}

#[test]
fn the_picture_is_what_the_panels_leave() {
    let mut bench = Bench::new();
    let with = bench.app.picture();
    assert!(with.width() > 500.0 && with.width() < 950.0 && with.height() > 600.0, "{with}");
    bench.press(Key::F2, Modifiers::NONE);
    assert_eq!(bench.app.picture(), SCREEN);
}

#[test]
fn a_drag_turns_and_the_wheel_zooms() {
    let mut bench = Bench::new();
    let middle = bench.middle();
    let before = bench.app.state.orbit;
    bench.app.take_changes();
    bench.drag(middle, vec2(90.0, -60.0), PointerButton::Primary, Modifiers::NONE);
    let orbit = bench.app.state.orbit;
    assert!((orbit.azimuth_deg + 30.0).abs() < 0.1 && (orbit.elevation_deg + 20.0).abs() < 0.1, "{orbit:?}");
    assert_eq!(bench.app.take_changes(), Changes { camera: true, ..Changes::default() });
    assert!(!bench.app.take_changes().any(), "changes are taken once");

    bench.drag(middle, vec2(50.0, 0.0), PointerButton::Middle, Modifiers::NONE);
    let moved = bench.app.state.orbit;
    assert!(moved.pivot_mm != before.pivot_mm && moved.azimuth_deg == orbit.azimuth_deg);
    bench.drag(middle, vec2(-50.0, 0.0), PointerButton::Primary, Modifiers::SHIFT);
    assert!(bench.app.state.orbit.pivot_mm.distance(before.pivot_mm) < 1e-3, "moved back with Shift");

    let wheel = Event::MouseWheel {
        unit: egui::MouseWheelUnit::Line,
        delta: vec2(0.0, 3.0),
        phase: egui::TouchPhase::Move,
        modifiers: Modifiers::NONE,
    };
    bench.frame(vec![Event::PointerMoved(middle), wheel], Modifiers::NONE);
    bench.rest();
    assert!(bench.app.state.orbit.distance_mm < before.distance_mm);
}

#[test]
fn a_right_drag_is_window_and_level_and_one_step_of_undo() {
    let mut bench = Bench::new();
    let before = bench.app.state.transfer.window();
    let middle = bench.middle();
    bench.drag(middle, vec2(100.0, 0.0), PointerButton::Secondary, Modifiers::NONE);
    let wide = bench.app.state.transfer.window();
    assert!(wide[1] - wide[0] > 1.3 * (before[1] - before[0]), "{before:?} {wide:?}");
    assert!((wide[0] + wide[1] - before[0] - before[1]).abs() < 1e-6, "the level stays");
    bench.drag(middle, vec2(0.0, -50.0), PointerButton::Secondary, Modifiers::NONE);
    let high = bench.app.state.transfer.window();
    assert!(high[0] > wide[0] && (high[1] - high[0] - wide[1] + wide[0]).abs() < 1e-6);
    bench.press(Key::Z, Modifiers::COMMAND);
    assert_eq!(bench.app.state.transfer.window(), wide);
    bench.press(Key::Z, Modifiers::COMMAND);
    assert_eq!(bench.app.state.transfer.window(), before);
    bench.press(Key::Z, Modifiers::COMMAND | Modifiers::SHIFT);
    assert_eq!(bench.app.state.transfer.window(), wide);
}

#[test]
fn an_eye_hides_its_object() {
    let mut bench = Bench::new();
    bench.app.take_changes();
    let eye = bench.find("👁");
    bench.click(eye);
    assert_eq!(bench.app.state.objects.iter().map(|o| o.visible).collect::<Vec<_>>(), [false, true]);
    assert!(bench.app.take_changes().look);
    let look = bench.app.state.look(&[1, 2]).expect("a look");
    assert!(!look.objects[&1].visible && look.objects[&2].visible);
    bench.press(Key::Z, Modifiers::COMMAND);
    assert!(bench.app.state.objects[0].visible);
}

#[test]
fn keys_do_what_the_table_says() {
    let mut bench = Bench::new();
    for (key, side) in [(Key::S, Side::Superior), (Key::L, Side::Left), (Key::A, Side::Anterior)] {
        bench.press(key, Modifiers::NONE);
        let mut expected = bench.app.state.orbit;
        expected.look_from(side);
        assert_eq!(bench.app.state.orbit, expected);
    }
    bench.press(Key::Space, Modifiers::NONE);
    assert_eq!(bench.app.state.shown, Subject::Volume);
    bench.press(Key::B, Modifiers::NONE);
    assert_eq!(bench.app.state.split, Some(0.5));
    bench.press(Key::M, Modifiers::NONE);
    assert_eq!(bench.app.state.mode, SplatMode::named("slab").expect("a mode"));
    bench.press(Key::PageDown, Modifiers::NONE);
    assert_eq!(bench.app.state.transfer.name, PRESETS[1].name);
    bench.press(Key::PageUp, Modifiers::NONE);
    bench.press(Key::PageUp, Modifiers::NONE);
    assert_eq!(bench.app.state.transfer.name, PRESETS[PRESETS.len() - 1].name);
    bench.press(Key::PageDown, Modifiers::NONE);
    assert_eq!(bench.press(Key::Q, Modifiers::COMMAND), [Action::Quit]);
    bench.press(Key::Questionmark, Modifiers::NONE);
    bench.find("show all of the scene");
    bench.press(Key::Escape, Modifiers::NONE);
    assert!(!bench.app.keys);
}

#[test]
fn fit_shows_the_scene() {
    let mut bench = Bench::new();
    bench.press(Key::F, Modifiers::NONE);
    let orbit = bench.app.state.orbit;
    let (place, _) =
        orbit.seen(DVec3::new(-100.0, 100.0, 100.0), bench.app.aspect()).expect("before the eye");
    assert!(place.x < 1.0 && place.y > 0.0 && orbit.pivot_mm == DVec3::ZERO, "{place}");
}

#[test]
fn a_distance_is_measured_where_the_depth_is() {
    let mut bench = Bench::new();
    bench.press(Key::D, Modifiers::NONE);
    let middle = bench.middle();
    bench.click(middle);
    bench.click(middle + vec2(100.0, 0.0));
    let orbit = bench.app.state.orbit;
    let [distance] = bench.app.state.distances[..] else { panic!("one distance") };
    // 100 mm before the pivot the picture is narrower by the ratio of the depths.
    let mm_per_point = orbit.height_mm() / f64::from(bench.app.picture().height());
    let expected = 100.0 * mm_per_point * (orbit.distance_mm - 100.0) / orbit.distance_mm;
    assert!((distance.mm() - expected).abs() < 1e-3, "{} {expected}", distance.mm());
    assert!((distance.from_mm.y - 100.0).abs() < 1e-9, "{:?}", distance.from_mm);
    bench.press(Key::Escape, Modifiers::NONE);
    bench.click(middle);
    assert_eq!(bench.app.state.distances.len(), 1);
    let reading = bench.app.reading.expect("the cursor is over the scene");
    assert_eq!(reading.intensity, Some(reading.at_mm.y));
}

#[test]
fn clip_and_crop_begin_with_the_scene() {
    let mut bench = Bench::new();
    bench.press(Key::C, Modifiers::NONE);
    bench.press(Key::X, Modifiers::NONE);
    let clip = &bench.app.state.clip;
    assert_eq!(clip.planes().len(), 7);
    assert!(clip.planes[0].normal.y < -0.999 && clip.planes[0].offset_mm.abs() < 1e-9, "{clip:?}");
    bench.press(Key::C, Modifiers::NONE);
    assert_eq!(bench.app.state.clip.planes().len(), 6);
    bench.press(Key::Z, Modifiers::COMMAND);
    assert_eq!(bench.app.state.clip.planes().len(), 7);
}

#[test]
fn the_notice_is_shown_until_it_is_read() {
    let mut bench = Bench::new();
    bench.app.settings.notice_seen = false;
    bench.rest();
    let read = bench.find("I understand");
    bench.click(read);
    assert!(bench.app.settings.notice_seen);
}

#[test]
fn a_question_is_answered_before_keys_count() {
    let mut bench = Bench::new();
    bench.app.settings.notice_seen = false;
    bench.press(Key::L, Modifiers::NONE);
    assert_eq!(bench.app.state.orbit.azimuth_deg, 0.0);
    bench.app.settings.notice_seen = true;
    bench.press(Key::L, Modifiers::NONE);
    assert_eq!(bench.app.state.orbit.azimuth_deg, 90.0);
}

#[test]
fn where_nothing_is_open_recent_files_are_offered() {
    let mut bench = Bench::new();
    bench.app.settings.recent = vec!["/data/heart.ply".into()];
    let mut shapes = Vec::new();
    for _ in 0..2 {
        let input = RawInput { screen_rect: Some(SCREEN), ..RawInput::default() };
        let output = bench.context.run_ui(input, |ui| {
            bench.app.ui(ui, &PanelInfo::default());
        });
        shapes.clone_from(&output.shapes);
        output.drop_without_applying_deltas();
    }
    bench.shapes = shapes;
    assert!(bench.app.picture().contains(bench.find("heart.ply")));
    bench.find("Nothing is open");
}

#[test]
fn nothing_changes_by_itself_and_no_window_is_too_small() {
    let mut bench = Bench::new();
    bench.rest();
    bench.app.take_changes();
    let state = bench.app.state.clone();
    bench.rest();
    assert_eq!(bench.app.state, state);
    assert!(!bench.app.take_changes().any() && !bench.app.held());
    for size in [vec2(0.0, 0.0), vec2(1.0, 1.0), vec2(40.0, 2000.0)] {
        let input =
            RawInput { screen_rect: Some(Rect::from_min_size(Pos2::ZERO, size)), ..RawInput::default() };
        let output = bench.context.run_ui(input, |ui| {
            bench.app.ui(ui, &PanelInfo::default());
        });
        output.drop_without_applying_deltas();
        assert!(bench.app.aspect() > 0.0 && bench.app.camera().eye.is_finite());
    }
}

#[test]
fn a_point_of_the_editor_is_dragged_and_undone() {
    let mut bench = Bench::new();
    let before = bench.app.state.transfer.clone();
    let last = before.points.len() - 1;
    // The points are the circles of the editor; the last one is drawn last.
    let mut circles = bench.shapes.iter().filter_map(|clipped| match &clipped.shape {
        Shape::Circle(circle) if circle.radius == 4.5 => Some(circle.center),
        _ => None,
    });
    let at = circles.next_back().expect("points of the editor");
    bench.drag(at, vec2(-10.0, 30.0), PointerButton::Primary, Modifiers::NONE);
    let moved = bench.app.state.transfer.points[last];
    assert!(moved.intensity < before.points[last].intensity && moved.opacity < before.points[last].opacity);
    assert!(bench.app.take_changes().look);
    bench.press(Key::Z, Modifiers::COMMAND);
    assert_eq!(bench.app.state.transfer, before);
    bench.press(Key::Y, Modifiers::COMMAND);
    assert_eq!(bench.app.state.transfer.points[last], moved);
}

#[test]
fn a_face_of_the_crop_box_is_dragged_in_the_picture() {
    let mut bench = Bench::new();
    bench.app.state.orbit.turn(30.0, 20.0);
    bench.press(Key::X, Modifiers::NONE);
    bench.press(Key::F, Modifiers::NONE);
    let orbit = bench.app.state.orbit;
    let on_screen = |bench: &Bench, x: DVec3| {
        let (place, _) = orbit.seen(x, bench.app.aspect()).expect("before the eye");
        let size = bench.app.picture().size();
        bench.app.picture().min + vec2(place.x as f32 * size.x, place.y as f32 * size.y)
    };
    let from = on_screen(&bench, DVec3::new(-100.0, 0.0, 0.0));
    let to = on_screen(&bench, DVec3::new(-40.0, 0.0, 0.0));
    bench.drag(from, to - from, PointerButton::Primary, Modifiers::NONE);
    assert_eq!(bench.app.state.orbit, orbit, "the camera stays");
    let low = bench.app.state.clip.crop.expect("a box").low_mm;
    assert!((low.x + 40.0).abs() < 0.1 && low.y == -100.0, "{low}");
    assert!(bench.app.take_changes().look);
    bench.press(Key::H, Modifiers::NONE);
    bench.drag(to, from - to, PointerButton::Primary, Modifiers::NONE);
    assert_ne!(bench.app.state.orbit, orbit, "without handles a drag turns");
}

#[test]
fn letters_and_scale_are_over_the_picture() {
    let mut bench = Bench::new();
    bench.app.frame_all_soon();
    bench.rest();
    for letter in ["R", "L", "S", "I", "50 mm"] {
        assert!(bench.app.picture().contains(bench.find(letter)), "{letter}");
    }
    bench.press(Key::A, Modifiers::NONE);
    assert!(bench.find("L").x > bench.find("R").x, "the patient's left is at the right");
    bench.press(Key::P, Modifiers::NONE);
    assert!(bench.find("L").x < bench.find("R").x);
}

#[test]
fn a_side_of_the_cube_is_looked_at_when_it_is_clicked() {
    let mut bench = Bench::new();
    bench.app.state.orbit = Orbit { azimuth_deg: 40.0, elevation_deg: 30.0, ..bench.app.state.orbit };
    // The letters at the borders would be found first.
    bench.app.state.show.orientation = false;
    bench.rest();
    let head = bench.find("S");
    assert!(bench.app.picture().contains(head));
    bench.click(head);
    assert_eq!(bench.app.state.orbit.elevation_deg, 90.0);
    bench.press(Key::T, Modifiers::NONE);
    assert!(bench.place_of("S").is_none(), "the annotations are off");
}

#[test]
fn the_colour_bar_tells_what_is_shown() {
    let mut bench = Bench::new();
    bench.app.state.transfer =
        Transfer::new(&engine::transfer::load("window:400,40", [0.0, 1.0]).expect("a window"));
    bench.rest();
    let shown = |bench: &Bench| {
        bench.shapes.iter().any(|s| {
            matches!(&s.shape, Shape::Text(t) if t.galley.text().ends_with(" HU")
        && bench.app.picture().contains(t.visual_bounding_rect().center()))
        })
    };
    assert!(shown(&bench));
    for object in &mut bench.app.state.objects {
        object.tint = Some(DVec3::ONE);
    }
    bench.rest();
    assert!(!shown(&bench), "no object has a colour of the function");
}

#[test]
fn a_camera_that_is_kept_comes_back() {
    let mut bench = Bench::new();
    // The other sections would push this one over the edge of the screen.
    for section in ["Objects", "Transfer function", "Quality", "Camera"] {
        let header = bench.find(section);
        bench.click(header);
        for _ in 0..20 {
            bench.rest();
        }
    }
    let kept = bench.app.state.orbit;
    let keep = bench.find("Keep this view");
    bench.click(keep);
    assert_eq!(bench.app.state.bookmarks.len(), 1);
    bench.app.state.orbit.turn(50.0, 10.0);
    bench.rest();
    let back = bench.find("Go to");
    bench.click(back);
    assert_eq!(bench.app.state.orbit, kept);
}

#[test]
fn opening_files_is_no_step_of_undo() {
    let mut bench = Bench::new();
    bench.press(Key::PageDown, Modifiers::NONE);
    assert!(bench.app.history.can_undo());
    bench.app.state.set_objects(vec![Object::new(0, None, "another fit")]);
    bench.rest();
    assert!(!bench.app.history.can_undo());
    let transfer = bench.app.state.transfer.clone();
    bench.press(Key::Z, Modifiers::COMMAND);
    assert_eq!((bench.app.state.transfer.clone(), bench.app.state.objects.len()), (transfer, 1));
}

#[test]
fn all_letters_can_be_drawn() {
    let mut bench = Bench::new();
    bench.app.state.objects[1].visible = false;
    bench.app.act(Action::ToggleFit, &PanelInfo { volume: true, ..PanelInfo::default() });
    for action in [Action::ToggleKeys, Action::ToggleOverlay, Action::Clip, Action::Crop, Action::AskRecord] {
        bench.app.act(action, &PanelInfo::default());
    }
    bench.rest();
    let texts: Vec<_> = bench
        .shapes
        .iter()
        .filter_map(|clipped| match &clipped.shape {
            Shape::Text(shape) => Some(shape.galley.job.clone()),
            _ => None,
        })
        .collect();
    assert!(texts.len() > 60, "{} texts", texts.len());
    for job in texts {
        // The families share all fonts beyond ASCII.
        let font = egui::FontId::default();
        let drawn = job.text.chars().filter(|c| !c.is_ascii());
        let missing: String =
            bench.context.fonts_mut(|fonts| drawn.filter(|c| !fonts.has_glyph(&font, *c)).collect());
        assert!(missing.is_empty(), "{missing:?} of {:?}", job.text);
    }
}

#[test]
fn the_opacity_follows_the_gradient_if_it_is_ticked() {
    let mut bench = Bench::new();
    let tick = |bench: &mut Bench| {
        let at = bench.find("Gradient");
        bench.click(at);
    };
    tick(&mut bench);
    let [low, high] = bench.app.state.transfer.gradient_ramp().expect("a ramp");
    assert!(0.0 < low && low < high);
    assert!(bench.app.state.transfer.function().expect("a function").depends_on_gradient());
    assert!(bench.app.take_changes().look, "the picture is rendered anew");
    bench.press(Key::Z, Modifiers::COMMAND);
    assert_eq!(bench.app.state.transfer.gradient_ramp(), None, "undone");
    // Another curve is kept as it is until it is switched off.
    bench.app.state.transfer.gradient_opacities = vec![[0.0, 0.2], [50.0, 0.8], [90.0, 1.0]];
    bench.rest();
    bench.find("as in the file");
    tick(&mut bench);
    assert!(bench.app.state.transfer.gradient_opacities.is_empty());
}
