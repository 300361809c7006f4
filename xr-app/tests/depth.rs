//! The depth that goes to a headset with the picture: points that are made of it are where the renderer and
//! the probe see them, so that a runtime that moves the picture with the head moves it rightly.

use crate::support::{device, options, script, session, set, silent};
use engine::render::Probe;
use engine::render::{Renderer, Settings, mode};
use glam::DVec3;
use xr_app::headset::simulated::{Script, Simulated};
use xr_app::headset::{DEPTH_RANGE, Eye, Headset as _, Pose};
use xr_app::panel::SIZE;
use xr_app::viewer::Options;

/// Returns the distance along the viewing direction that a depth stands for, metres.
fn distance(depth: f32) -> f64 {
    let [near, far] = DEPTH_RANGE;
    far * near / (far - f64::from(depth) * (far - near))
}

/// Returns the ray of a pixel's middle: what is at distance z along the viewing direction is at the eye + z
/// times this.
fn ray(eye: &Eye, [x, y]: [u32; 2], [width, height]: [u32; 2]) -> DVec3 {
    let part = |n: u32, of: u32| (f64::from(n) + 0.5) / f64::from(of);
    let fov = &eye.fov;
    let across = fov.left + (fov.right - fov.left) * part(x, width);
    let up = fov.up + (fov.down - fov.up) * part(y, height);
    eye.pose.orientation * DVec3::new(across, up, -1.0)
}

fn depths(headset: &Simulated) -> Vec<f32> {
    headset.depth().expect("depth is taken").read().expect("texels")
}

#[test]
fn points_of_the_depth_are_where_things_are() {
    let gpu = device();
    let full = Options { level: Some(0), ..options() };
    let (viewer, headset) = session(&gpu, Script { depth: true, ..script(12) }, full);
    let shown = headset.shown.expect("a frame");
    let size = headset.description().eye_size;
    let placement = *viewer.placement();
    let settings = Settings { views: 2, depth: true, ..Settings::new(size) };
    let mut renderer =
        Renderer::new(&gpu, mode("slab").expect("a mode"), viewer.scene(), &settings).expect("a renderer");
    renderer.render(viewer.scene(), &shown.map(|eye| placement.camera(&eye))).expect("a picture");
    let found = depths(&headset);
    let probe = Probe::new(&set());
    let (mut near, mut all) = (0, 0);
    for (at, eye) in shown.iter().enumerate() {
        let expected = renderer.target.read_depth(at as u32).expect("depth");
        let colour = renderer.target.read_colour(at as u32).expect("colour");
        for y in 0..size[1] {
            for x in 0..size[0] {
                let pixel = (y * size[0] + x) as usize;
                let depth = found[at * expected.len() + pixel];
                let opacity = colour[pixel][3];
                if opacity < 0.04 {
                    assert_eq!(depth, 1.0, "nothing is seen at {x}, {y}");
                }
                if opacity < 0.06 {
                    continue;
                }
                let metres = f64::from(expected[pixel]) * 1e-3 * placement.scale;
                assert!(
                    (distance(depth) - metres).abs() < 2e-4,
                    "{} m, not {metres} at {x}, {y}",
                    distance(depth)
                );
                if opacity < 0.98 {
                    continue;
                }
                // What the probe meets on the ray of the pixel.
                let ray = ray(eye, [x, y], size);
                let point = placement.patient(eye.pose.position + ray * distance(depth));
                let from = placement.patient(eye.pose.position);
                let met = probe.along(from, placement.patient_direction(ray), viewer.scene().look());
                all += 1;
                near += u32::from(met.is_some_and(|met| met.at_mm.distance(point) < 3.0));
            }
        }
    }
    // The mean depth of the light lies behind where half of it is gone, by more where a ray only grazes
    // something.
    assert!(all > 40 && f64::from(near) > 0.9 * f64::from(all), "{near} of {all} points are met");
    silent(&gpu);
}

#[test]
fn the_panel_has_a_depth_of_its_own() {
    let gpu = device();
    let head = |_: f64| (Pose::IDENTITY, true);
    let script = Script { depth: true, head, eye_size: [200, 200], ..script(8) };
    let (viewer, headset) = session(&gpu, script, Options { panel: true, ..options() });
    let plane = viewer.pointing().panel().expect("it is shown");
    let found = depths(&headset);
    let eye = headset.shown.expect("a frame")[0];
    let mut seen = 0;
    for y in 0..200 {
        for x in 0..200 {
            let ray = ray(&eye, [x, y], [200, 200]);
            let normal = plane.right.cross(plane.down);
            let z = (plane.zero - eye.pose.position).dot(normal) / ray.dot(normal);
            let on = eye.pose.position + ray * z - plane.zero;
            let part = |axis: DVec3, size: f32| on.dot(axis) / axis.length_squared() / f64::from(size);
            let [across, down] = [part(plane.right, SIZE.x), part(plane.down, SIZE.y)];
            if (0.02..0.98).contains(&across) && (0.02..0.98).contains(&down) && z > 0.0 {
                seen += 1;
                let depth = distance(found[(y * 200 + x) as usize]);
                assert!((depth - z).abs() < 1e-4, "{depth} m, not {z} at {x}, {y}");
            }
        }
    }
    assert!(seen > 1000, "{seen} pixels of the panel");
    silent(&gpu);
}
