use engine::transfer::{PRESETS, window_level};

use super::*;

const FULL: [f64; 2] = [-1000.0, 2000.0];

fn ramp() -> Transfer {
    Transfer::new(&window_level(400.0, 40.0, 0.5).expect("a window"))
}

fn ascends(transfer: &Transfer) -> bool {
    transfer.points.is_sorted_by(|a, b| a.intensity <= b.intensity)
}

#[test]
fn a_new_point_changes_only_what_it_is_told() {
    let (mut editor, mut transfer) = (Editor::default(), ramp());
    transfer.shift = 10.0;
    let before = transfer.function().expect("a function");
    assert!(editor.add(&mut transfer, 150.0, 0.4, FULL));
    assert_eq!((transfer.points.len(), editor.selected(&transfer)), (3, Some(1)));
    assert!(ascends(&transfer));
    let after = transfer.function().expect("a function");
    assert!((after.at(150.0).1 - 0.4).abs() < 1e-12);
    for v in [-200.0, 0.0, 100.0, 150.0, 200.0, 300.0] {
        assert!(after.at(v).0.distance(before.at(v).0) < 1e-12, "the colours stay: {v}");
    }
    assert!(!editor.add(&mut transfer, 150.01, 0.9, FULL), "on another one");
    assert!(editor.add(&mut transfer, 1e9, 2.0, FULL));
    let last = transfer.points[3];
    assert_eq!((last.intensity + transfer.shift, last.opacity), (2000.0, 1.0), "kept in range");
    assert!(!editor.add(&mut transfer, f64::NAN, 0.5, FULL));
}

#[test]
fn points_stay_in_order_and_in_range() {
    let (mut editor, mut transfer) = (Editor::default(), Transfer::new(&PRESETS[0].over(FULL)));
    let count = transfer.points.len();
    // Wildly moved, deterministically.
    let mut seed = 1u64;
    for _ in 0..2000 {
        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        let index = (seed >> 33) as usize % count;
        let intensity = ((seed >> 20) % 9000) as f64 - 4000.0;
        let opacity = ((seed >> 11) % 300) as f64 / 100.0 - 1.0;
        editor.select(Some(index));
        editor.move_to(&mut transfer, intensity, opacity, FULL);
        assert!(ascends(&transfer) && transfer.points.len() == count);
        for p in &transfer.points {
            assert!((FULL[0]..=FULL[1]).contains(&p.intensity) && (0.0..=1.0).contains(&p.opacity));
        }
        transfer.function().expect("still a function");
    }
    let before = transfer.clone();
    editor.move_to(&mut transfer, f64::NAN, 0.5, FULL);
    editor.select(None);
    editor.move_to(&mut transfer, 0.0, 0.5, FULL);
    editor.select(Some(count));
    editor.nudge(&mut transfer, 5.0, 0.1, FULL);
    assert_eq!(transfer, before, "nothing chosen, nothing moved");
}

#[test]
fn two_points_stay() {
    let (mut editor, mut transfer) = (Editor::default(), ramp());
    assert!(!editor.remove(&mut transfer), "none is chosen");
    editor.select(Some(0));
    assert!(editor.add_beside(&mut transfer, FULL));
    assert_eq!(transfer.points[1].intensity, 40.0);
    assert!(editor.remove(&mut transfer));
    assert_eq!((editor.selected(&transfer), transfer.points.len()), (Some(0), 2));
    assert!(!editor.remove(&mut transfer));
    assert_eq!(transfer, ramp());
}

#[test]
fn a_nudge_is_in_intensity_or_in_height() {
    let (mut editor, mut transfer) = (Editor::default(), ramp());
    editor.select(Some(1));
    editor.nudge(&mut transfer, 5.0, 0.0, FULL);
    assert_eq!((transfer.points[1].intensity, transfer.points[1].opacity), (245.0, 0.5));
    editor.nudge(&mut transfer, 0.0, 0.1, FULL);
    assert!((transfer.points[1].opacity - (0.5f64.sqrt() + 0.1).powi(2)).abs() < 1e-12);
    editor.nudge(&mut transfer, 0.0, -9.0, FULL);
    assert_eq!(transfer.points[1].opacity, 0.0);
    editor.colour(&mut transfer, DVec3::new(0.5, 2.0, -1.0));
    assert_eq!(transfer.points[1].colour, DVec3::new(0.5, 1.0, 0.0));
}

#[test]
fn the_view_zooms_about_the_cursor_and_stays_in_range() {
    let mut editor = Editor::default();
    assert_eq!(editor.view(FULL), FULL);
    editor.zoom(0.5, 500.0, FULL);
    assert_eq!(editor.view(FULL), [-250.0, 1250.0]);
    editor.pan(1e9, FULL);
    assert_eq!(editor.view(FULL), [500.0, 2000.0]);
    editor.zoom(1e-9, 1000.0, FULL);
    let [low, high] = editor.view(FULL);
    assert!((high - low - 3.0).abs() < 1e-9 && low < 1000.0 && high > 1000.0);
    editor.zoom(1e9, 1000.0, FULL);
    assert_eq!(editor.view(FULL), FULL);
    editor.zoom(0.1, -1000.0, FULL);
    assert_eq!(editor.view([0.0, 10.0]), [0.0, 10.0], "a view of other data shows all of these");
    editor.view_all();
    assert_eq!(editor.view(FULL), FULL);
}

#[test]
fn one_steps_through_the_points() {
    let (mut editor, transfer) = (Editor::default(), ramp());
    for (forward, expected) in [(true, 0), (true, 1), (true, 1), (false, 0), (false, 0)] {
        editor.select_next(&transfer, forward);
        assert_eq!(editor.selected(&transfer), Some(expected));
    }
}

#[test]
fn heights_are_roots() {
    for o in [0.0, 0.01, 0.25, 1.0] {
        assert!((opacity(height(o)) - o).abs() < 1e-12);
    }
    assert_eq!((opacity(7.0), opacity(-1.0), height(-1.0)), (1.0, 0.0, 0.0));
    assert_eq!(full_range(&ramp(), [0.0, 1000.0]), [-160.0, 1020.0]);
}

#[test]
fn ticks_are_round() {
    assert_eq!(ticks([-1000.0, 2000.0], 6), [-1000.0, -500.0, 0.0, 500.0, 1000.0, 1500.0, 2000.0]);
    assert_eq!(ticks([0.1, 0.9], 4), [0.2, 0.4, 0.6000000000000001, 0.8]);
    assert!(ticks([0.0, 0.0], 4).is_empty());
    assert!(ticks([f64::NAN, 1.0], 4).is_empty());
}
