//! Sheets: planes in the room with egui's painting on them, drawn over the pictures of both eyes.
//!
//! egui has one screen, of points. A sheet is a rectangle of that screen on a plane of its own: the panel is
//! one, and each label, line and cursor another. Triangles go to the device when egui has new ones; the
//! positions of the planes, in each frame. All sheets are one draw, in painting order, and nothing of the
//! scene hides them.

use egui::TexturesDelta;
use egui::epaint::ClippedPrimitive;
use egui::{Pos2, pos2};
use engine::Result;
use engine::gpu::{Buffer, Format, Gpu, Overlap, Recorder};
use engine::render::IN_FLIGHT;
use glam::DVec3;
use shaders_glsl::types::{PanelVertex, Sheet, SheetsParams, View};
use shaders_glsl::{PANELS_FRAG, SHEETS_VERT, Shader};
use view::screen::painter::{Mesh, Textures, fill};

use crate::eye_drawing::EyeDrawing;
use crate::headset::{FrameImages, Pose};
use crate::placement::Placement;

/// Initial capacity for corners, indices and rectangles; a panel with labels takes a third of it.
const ROOM: [usize; 3] = [1 << 15, 1 << 16, 1 << 9];

const SHADERS: [&Shader; 2] = [&SHEETS_VERT, &PANELS_FRAG];

/// A plane in the room with the screen's points on it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Plane {
    /// Place of the screen's origin, metres.
    pub zero: DVec3,
    /// Step of one point to the right, metres.
    pub right: DVec3,
    /// Step of one point down, metres.
    pub down: DVec3,
}

impl Plane {
    /// Creates a plane with the point `anchor` of the screen at a place in the room.
    pub fn anchored(anchor: Pos2, at: DVec3, right: DVec3, down: DVec3) -> Self {
        let zero = at - right * f64::from(anchor.x) - down * f64::from(anchor.y);
        Plane { zero, right, down }
    }

    /// Creates an upright plane that faces an eye, with points `metres` large.
    pub fn facing(anchor: Pos2, at: DVec3, eye: DVec3, metres: f64) -> Self {
        let towards = (eye - at).try_normalize().unwrap_or(DVec3::Z);
        let right = DVec3::Y.cross(towards).try_normalize().unwrap_or(DVec3::X);
        Plane::anchored(anchor, at, right * metres, right.cross(towards) * metres)
    }

    /// Returns the place of a point of the screen in the room, metres.
    pub fn place(&self, at: Pos2) -> DVec3 {
        self.zero + self.right * f64::from(at.x) + self.down * f64::from(at.y)
    }

    /// Returns the point of the screen that a ray meets, and its distance, metres.
    pub fn met(&self, ray: &Pose) -> Option<(Pos2, f64)> {
        let normal = self.right.cross(self.down);
        let distance = (self.zero - ray.position).dot(normal) / ray.forward().dot(normal);
        if !(distance > 0.0 && distance.is_finite()) {
            return None;
        }
        let on = ray.position + ray.forward() * distance - self.zero;
        let along = |axis: DVec3| (on.dot(axis) / axis.length_squared()) as f32;
        Some((pos2(along(self.right), along(self.down)), distance))
    }
}

/// Buffers on the device for one turn of the frames.
struct Slot {
    vertices: Buffer<PanelVertex>,
    indices: Buffer<u32>,
    sheets: Buffer<Sheet>,
    /// Version of the triangles in its buffers.
    version: u64,
}

/// Draws sheets.
pub struct Sheets {
    gpu: Gpu,
    drawing: EyeDrawing,
    textures: Textures,
    changes: TexturesDelta,
    mesh: Mesh,
    /// Index of the plane of each rectangle of the mesh.
    plane_of: Vec<usize>,
    version: u64,
    slots: Vec<Slot>,
}

impl Sheets {
    /// Creates the drawing over pictures of this format, with or without depth, with a layer for each eye.
    pub fn new(gpu: &Gpu, format: Format, depth: bool) -> Result<Self> {
        let slot = |n| {
            let name = |what: &str| format!("{what} of sheets {n}");
            Ok(Slot {
                vertices: gpu.mapped(&name("vertices"), "panels", ROOM[0])?,
                indices: gpu.mapped(&name("indices"), "panels", ROOM[1])?,
                sheets: gpu.mapped(&name("rows"), "panels", ROOM[2])?,
                version: 0,
            })
        };
        Ok(Sheets {
            gpu: gpu.clone(),
            drawing: EyeDrawing::new(gpu, SHADERS, Overlap::Blended, format, depth)?,
            textures: Textures::new(gpu)?,
            changes: TexturesDelta::default(),
            mesh: Mesh::default(),
            plane_of: Vec::new(),
            version: 0,
            slots: (0..IN_FLIGHT).map(slot).collect::<Result<_>>()?,
        })
    }

    /// Takes egui's output; `plane` returns the index of the plane for the rectangle to which a primitive is
    /// clipped.
    pub fn take(
        &mut self,
        primitives: &[ClippedPrimitive],
        changes: TexturesDelta,
        plane: impl Fn(egui::Rect) -> usize,
    ) {
        self.changes.append(changes);
        self.mesh = Mesh::of(primitives);
        let rectangle = |c: &[f32; 4]| egui::Rect::from_min_max(pos2(c[0], c[1]), pos2(c[2], c[3]));
        self.plane_of = self.mesh.clips.iter().map(|clip| plane(rectangle(clip))).collect();
        self.version += 1;
    }

    /// Records updates of egui's textures.
    pub fn update(&mut self, recorder: &mut Recorder) -> Result<()> {
        self.textures.update(recorder, &mut self.changes)?;
        self.textures.forget(&mut self.changes);
        Ok(())
    }

    /// Records the sheets over the pictures of both eyes, which see the scene as `views` say. `slot` is the
    /// frame's turn, `placement` that of the patient, and `origin` the scene's origin, mm RAS. For pictures
    /// of another kind than the headset's a pipeline is created first.
    pub fn draw(
        &mut self,
        recorder: &mut Recorder,
        (slot, views): (usize, &Buffer<View>),
        (placement, origin): (&Placement, DVec3),
        planes: &[Plane],
        eyes: &mut FrameImages<'_>,
    ) -> Result<()> {
        if self.mesh.indices.is_empty() {
            return Ok(());
        }
        let Slot { vertices, indices, sheets, version } = &mut self.slots[slot];
        if std::mem::replace(version, self.version) != self.version {
            fill(&self.gpu, vertices, &self.mesh.vertices)?;
            fill(&self.gpu, indices, &self.mesh.indices)?;
        }
        let narrow = |v: DVec3| v.as_vec3().to_array();
        let row = |(&clip, &plane): (&[f32; 4], &usize)| {
            let plane = planes.get(plane).copied().unwrap_or_default();
            Sheet {
                clip,
                zero: narrow(placement.patient(plane.zero) - origin),
                right: narrow(placement.patient_offset(plane.right)),
                down: narrow(placement.patient_offset(plane.down)),
            }
        };
        let rows: Vec<Sheet> = self.mesh.clips.iter().zip(&self.plane_of).map(row).collect();
        fill(&self.gpu, sheets, &rows)?;
        let drawing = self.drawing.over(eyes)?;
        for (id, range) in &self.mesh.runs {
            let Some(texture) = self.textures.get(*id) else { continue };
            recorder
                .draw(drawing)
                .read("vertices", vertices)
                .read("indices", indices)
                .read("sheets", sheets)
                .sample("glyphs", texture)
                .read("views", views)
                .push(&SheetsParams { range: placement.depth_range() })
                .vertices_over(&mut eyes.pictures(), range.clone());
        }
        Ok(())
    }
}

impl Drop for Sheets {
    fn drop(&mut self) {
        // egui must be told that changes no longer matter.
        self.changes.clear();
    }
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;

    #[test]
    fn a_ray_meets_a_plane_where_it_is() {
        let eye = DVec3::new(0.1, 1.6, 0.0);
        let at = DVec3::new(0.3, 1.4, -0.7);
        let plane = Plane::facing(pos2(200.0, 100.0), at, eye, 0.001);
        assert!(plane.place(pos2(200.0, 100.0)).distance(at) < 1e-9);
        let normal = plane.right.cross(plane.down);
        assert!(normal.normalize().dot((at - eye).normalize()) > 1.0 - 1e-9, "it faces the eye");
        assert!(plane.down.y < 0.0 && plane.right.y.abs() < 1e-12, "upright");
        let target = plane.place(pos2(30.0, 170.0));
        let ahead = (target - eye).normalize();
        let ray = Pose { position: eye, orientation: DQuat::from_rotation_arc(DVec3::NEG_Z, ahead) };
        let (point, distance) = plane.met(&ray).expect("it points there");
        assert!((point - pos2(30.0, 170.0)).length() < 1e-3, "{point:?}");
        assert!((distance - target.distance(eye)).abs() < 1e-9);
        let back = Pose { orientation: DQuat::from_rotation_arc(DVec3::NEG_Z, -ahead), ..ray };
        assert_eq!(plane.met(&back), None);
        assert_eq!(Plane::default().met(&ray), None);
    }
}
