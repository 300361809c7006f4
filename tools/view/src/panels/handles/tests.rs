use super::*;
use crate::model::orbit::Side;
use crate::model::state::{CropBox, Plane};

const BOUNDS: [DVec3; 2] = [DVec3::splat(-100.0), DVec3::splat(100.0)];
const ASPECT: f64 = 1.5;

fn clip() -> Clip {
    Clip {
        planes: vec![Plane { on: true, normal: DVec3::new(0.0, -1.0, 0.0), offset_mm: 10.0 }],
        crop: Some(CropBox { on: true, low_mm: BOUNDS[0], high_mm: BOUNDS[1] }),
    }
}

/// Returns a camera at the front left and above.
fn orbit() -> Orbit {
    let mut orbit = Orbit::default();
    orbit.turn(35.0, 25.0);
    orbit.fit(BOUNDS, ASPECT);
    orbit
}

fn place(orbit: &Orbit, x: DVec3) -> DVec2 {
    orbit.seen(x, ASPECT).expect("before the eye").0
}

fn at(placed: &[Placed], handle: Handle) -> DVec3 {
    placed.iter().find(|p| p.handle == handle).expect("a handle").at_mm
}

#[test]
fn handles_are_where_planes_and_faces_are() {
    let placed = handles(&clip(), BOUNDS);
    assert_eq!(placed.len(), 8);
    assert_eq!(at(&placed, Handle::Offset(0)), DVec3::new(0.0, -10.0, 0.0));
    assert!(at(&placed, Handle::Normal(0)).y < -50.0);
    assert_eq!(at(&placed, Handle::Face { axis: 2, high: true }), DVec3::new(0.0, 0.0, 100.0));
    let mut off = clip();
    off.planes[0].on = false;
    assert_eq!(handles(&off, BOUNDS).len(), 6);
    off.crop = None;
    assert!(handles(&off, BOUNDS).is_empty());
}

#[test]
fn a_handle_is_hit_where_it_is_seen() {
    let (placed, orbit) = (handles(&clip(), BOUNDS), orbit());
    for p in &placed {
        let place = place(&orbit, p.at_mm) + DVec2::new(0.005, -0.005);
        assert_eq!(hit(&placed, &orbit, ASPECT, place, 0.02), Some(p.handle));
    }
    assert_eq!(hit(&placed, &orbit, ASPECT, DVec2::ZERO, 0.02), None);
    // Seen from the front, two faces are at one place: the nearer one counts.
    let mut front = orbit;
    front.look_from(Side::Anterior);
    let crop = Clip { planes: Vec::new(), ..clip() };
    let nearest = hit(&handles(&crop, BOUNDS), &front, ASPECT, DVec2::splat(0.5), 0.01);
    assert_eq!(nearest, Some(Handle::Face { axis: 1, high: true }));
}

#[test]
fn a_plane_follows_the_cursor_along_its_normal() {
    let (mut clip, orbit) = (clip(), orbit());
    let from = at(&handles(&clip, BOUNDS), Handle::Offset(0));
    let target = from + clip.planes[0].normal * 30.0;
    let places = [place(&orbit, from), place(&orbit, target)];
    drag(&mut clip, Handle::Offset(0), BOUNDS, &orbit, ASPECT, places);
    assert!((clip.planes[0].offset_mm - 40.0).abs() < 1e-6, "{}", clip.planes[0].offset_mm);
    // Looking along the normal, upwards is away from the viewer, which here is towards what stays.
    let mut front = orbit;
    front.look_from(Side::Anterior);
    drag(&mut clip, Handle::Offset(0), BOUNDS, &front, ASPECT, [DVec2::splat(0.5), DVec2::new(0.5, 0.45)]);
    let expected = 40.0 + 0.05 * front.height_mm();
    assert!((clip.planes[0].offset_mm - expected).abs() < 1e-6, "{}", clip.planes[0].offset_mm);
}

#[test]
fn the_arrow_turns_the_plane_about_its_middle() {
    for (start, end) in [(DVec3::Y, DVec3::new(0.3, 1.0, 0.4)), (DVec3::NEG_Y, DVec3::new(0.2, -1.0, -0.3))] {
        let (mut clip, orbit) = (clip(), orbit());
        clip.planes[0].normal = start;
        let [foot, tip] = arrow(&clip, 0, BOUNDS).expect("a plane");
        let expected = end.normalize();
        let target = foot + expected * tip.distance(foot);
        let places = [place(&orbit, tip), place(&orbit, target)];
        drag(&mut clip, Handle::Normal(0), BOUNDS, &orbit, ASPECT, places);
        let plane = clip.planes[0];
        assert!(plane.normal.distance(expected) < 1e-6, "{} {expected}", plane.normal);
        assert!((plane.normal.dot(foot) - plane.offset_mm).abs() < 1e-9, "the middle stays");
    }
    // Far beside the ball it lies at the outline, across the view.
    let (mut clip, orbit) = (clip(), orbit());
    let [foot, tip] = arrow(&clip, 0, BOUNDS).expect("a plane");
    let places = [place(&orbit, tip), DVec2::new(9.0, 0.5)];
    drag(&mut clip, Handle::Normal(0), BOUNDS, &orbit, ASPECT, places);
    let normal = clip.planes[0].normal;
    assert!((normal.length() - 1.0).abs() < 1e-12 && normal.is_finite(), "{foot} {normal}");
}

#[test]
fn a_face_stops_before_the_opposite_one() {
    let (mut clip, orbit) = (clip(), orbit());
    let face = Handle::Face { axis: 0, high: true };
    let from = DVec3::new(100.0, 0.0, 0.0);
    let ends = |x: f64| [place(&orbit, from), place(&orbit, DVec3::new(x, 0.0, 0.0))];
    drag(&mut clip, face, BOUNDS, &orbit, ASPECT, ends(35.0));
    assert!((clip.crop.expect("a box").high_mm.x - 35.0).abs() < 1e-6);
    drag(&mut clip, face, BOUNDS, &orbit, ASPECT, ends(-400.0));
    let crop = clip.crop.expect("a box");
    assert!(crop.high_mm.x > crop.low_mm.x && crop.high_mm.x < -99.0, "{crop:?}");
}

#[test]
fn a_plane_cuts_a_box_in_a_polygon() {
    let square = outline(DVec3::Z, 20.0, BOUNDS);
    assert_eq!(square.len(), 4);
    assert!(square.iter().all(|x| x.z == 20.0));
    let length: f64 = (0..4).map(|i| square[i].distance(square[(i + 1) % 4])).sum();
    assert!((length - 800.0).abs() < 1e-9, "in order around it: {length}");
    assert_eq!(outline(DVec3::ONE.normalize(), 0.0, BOUNDS).len(), 6);
    assert!(outline(DVec3::X, 500.0, BOUNDS).is_empty());
}

#[test]
fn a_box_has_twelve_edges() {
    let edges = edges([DVec3::ZERO, DVec3::new(1.0, 2.0, 4.0)]);
    for (i, edge) in edges.iter().enumerate() {
        assert_eq!(edge[0].distance(edge[1]), [1.0, 2.0, 4.0][i / 4]);
        assert!(edges[..i].iter().all(|other| other != edge));
    }
}
