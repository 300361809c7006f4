use super::*;

const ASPECT: f64 = 1.6;

fn somewhere() -> Orbit {
    Orbit {
        pivot_mm: DVec3::new(10.0, -20.0, 300.0),
        distance_mm: 420.0,
        azimuth_deg: 25.0,
        elevation_deg: -40.0,
        fov_deg: 35.0,
    }
}

#[test]
fn sides_are_those_of_the_engine() {
    for side in Side::ALL {
        let mut orbit = somewhere();
        orbit.look_from(side);
        let camera = orbit.camera(ASPECT);
        let engine = Camera::from_side(side.name(), orbit.pivot_mm, 100.0, 35.0, ASPECT).expect("a side");
        assert!(camera.right.distance(engine.right) < 1e-12, "{side:?}: {}", camera.right);
        assert!(camera.up.distance(engine.up) < 1e-12, "{side:?}: {}", camera.up);
        assert!(camera.forward().distance(engine.forward()) < 1e-12, "{side:?}");
    }
}

#[test]
fn a_full_turn_returns() {
    let start = somewhere();
    let mut orbit = start;
    for _ in 0..36 {
        orbit.turn(10.0, 0.0);
    }
    assert!(orbit.eye_mm().distance(start.eye_mm()) < 1e-9);
    assert!((-180.0..=180.0).contains(&orbit.azimuth_deg));
    orbit.turn(-7200.0, 0.0);
    assert!(orbit.eye_mm().distance(start.eye_mm()) < 1e-9);
}

#[test]
fn the_poles_are_ordinary() {
    let mut orbit = somewhere();
    for elevation in [1e9, -1e9] {
        orbit.turn(0.0, elevation);
        for _ in 0..100 {
            orbit.turn(13.0, 0.0);
            let [right, up, back] = orbit.axes();
            for (a, b) in [(right, up), (up, back), (back, right)] {
                assert!(a.dot(b).abs() < 1e-12 && (a.length() - 1.0).abs() < 1e-12);
            }
            assert!(right.cross(up).distance(back) < 1e-12);
        }
        assert!(orbit.eye_mm().is_finite());
    }
}

#[test]
fn pan_follows_the_cursor_in_the_plane_of_the_pivot() {
    let start = somewhere();
    let mut orbit = start;
    let by = DVec2::new(0.13, -0.21);
    orbit.pan(by, ASPECT);
    let (place, depth) = orbit.seen(start.pivot_mm, ASPECT).expect("before the eye");
    assert!((place - (DVec2::splat(0.5) + by)).length() < 1e-12, "{place}");
    assert!((depth - start.distance_mm).abs() < 1e-9);
}

#[test]
fn zoom_keeps_what_is_under_the_cursor() {
    let place = DVec2::new(0.9, 0.3);
    for factor in [0.25, 0.9, 3.0, 0.0, 1e30] {
        let mut orbit = somewhere();
        let under = orbit.at_pivot(place, ASPECT);
        orbit.zoom(factor, place, ASPECT);
        let (after, _) = orbit.seen(under, ASPECT).expect("before the eye");
        assert!((after - place).length() < 1e-6, "{factor}: {after}");
        assert!((1.0..=1e6).contains(&orbit.distance_mm));
    }
}

#[test]
fn fit_shows_all_corners_and_not_from_afar() {
    let bounds = [DVec3::new(-100.0, -80.0, 0.0), DVec3::new(120.0, 90.0, 700.0)];
    for aspect in [0.4, 1.0, 2.5] {
        for side in Side::ALL {
            for turned in [0.0, 33.0] {
                let mut orbit = Orbit::default();
                orbit.look_from(side);
                orbit.turn(turned, -turned);
                orbit.fit(bounds, aspect);
                let mut reach = 0.0f64;
                for corner in 0..8 {
                    let pick = |axis: usize| bounds[corner >> axis & 1][axis];
                    let x = DVec3::new(pick(0), pick(1), pick(2));
                    let (place, _) = orbit.seen(x, aspect).expect("before the eye");
                    reach = reach.max((place - 0.5).abs().max_element());
                }
                assert!((0.4..0.5).contains(&reach), "{side:?} {aspect} {turned}: {reach}");
            }
        }
    }
    let mut orbit = somewhere();
    orbit.fit([DVec3::NAN, DVec3::ONE], ASPECT);
    assert_eq!(orbit, somewhere(), "a box of no size that is known changes nothing");
    orbit.fit([DVec3::ONE, DVec3::ONE], ASPECT);
    assert!(orbit.check().is_ok(), "a single point");
}

#[test]
fn the_field_of_view_keeps_the_size_at_the_pivot() {
    let mut orbit = somewhere();
    let height = orbit.height_mm();
    orbit.set_fov(70.0);
    assert!((orbit.height_mm() - height).abs() < 1e-9 && orbit.distance_mm < somewhere().distance_mm);
    orbit.set_fov(1e9);
    assert_eq!(orbit.fov_deg, FOV_RANGE[1]);
}

#[test]
fn places_and_points_are_inverse() {
    let orbit = somewhere();
    for place in [DVec2::new(0.0, 0.0), DVec2::new(0.7, 0.2), DVec2::new(1.0, 1.0)] {
        let x = orbit.at_depth(place, 333.0, ASPECT);
        let (back, depth) = orbit.seen(x, ASPECT).expect("before the eye");
        assert!((back - place).length() < 1e-12 && (depth - 333.0).abs() < 1e-9);
    }
    assert_eq!(orbit.seen(orbit.eye_mm() + orbit.axes()[2], ASPECT), None);
    // The engine's camera sees the same.
    let camera = orbit.camera(ASPECT);
    let x = orbit.at_depth(DVec2::new(1.0, 0.0), 100.0, ASPECT) - camera.eye;
    assert!((x.dot(camera.right) / x.dot(camera.forward()) - camera.fov.right).abs() < 1e-12);
    assert!((x.dot(camera.up) / x.dot(camera.forward()) - camera.fov.up).abs() < 1e-12);
}

#[test]
fn a_broken_camera_is_refused() {
    let good = somewhere();
    assert!(good.check().is_ok());
    for bad in [
        Orbit { distance_mm: 0.0, ..good },
        Orbit { distance_mm: f64::NAN, ..good },
        Orbit { pivot_mm: DVec3::NAN, ..good },
        Orbit { azimuth_deg: f64::INFINITY, ..good },
        Orbit { elevation_deg: 91.0, ..good },
        Orbit { fov_deg: 0.0, ..good },
    ] {
        assert_eq!(bad.check().expect_err("broken").code, "VGS-VIEW-003", "{bad:?}");
    }
}
