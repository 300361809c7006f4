//! Conversion of poses, fields of view and times between OpenXR and this program.

use engine::render::Fov;
use glam::{DQuat, DVec3};
use openxr as xr;

use super::pose::Pose;

pub(super) fn place_of(p: &xr::Vector3f) -> DVec3 {
    DVec3::new(f64::from(p.x), f64::from(p.y), f64::from(p.z))
}

pub(super) fn pose_of(pose: &xr::Posef) -> Pose {
    let q = pose.orientation;
    let orientation = DQuat::from_xyzw(f64::from(q.x), f64::from(q.y), f64::from(q.z), f64::from(q.w));
    Pose { position: place_of(&pose.position), orientation: orientation.normalize() }
}

pub(super) fn pose_to(pose: &Pose) -> xr::Posef {
    let (p, q) = (pose.position, pose.orientation);
    xr::Posef {
        position: xr::Vector3f { x: p.x as f32, y: p.y as f32, z: p.z as f32 },
        orientation: xr::Quaternionf { x: q.x as f32, y: q.y as f32, z: q.z as f32, w: q.w as f32 },
    }
}

pub(super) fn fov_of(fov: &xr::Fovf) -> Fov {
    let tangent = |angle: f32| f64::from(angle).tan();
    Fov {
        left: tangent(fov.angle_left),
        right: tangent(fov.angle_right),
        up: tangent(fov.angle_up),
        down: tangent(fov.angle_down),
    }
}

pub(super) fn fov_to(fov: &Fov) -> xr::Fovf {
    let angle = |tangent: f64| tangent.atan() as f32;
    xr::Fovf {
        angle_left: angle(fov.left),
        angle_right: angle(fov.right),
        angle_up: angle(fov.up),
        angle_down: angle(fov.down),
    }
}

pub(super) fn time(ns: i64) -> xr::Time {
    xr::Time::from_nanos(ns)
}
