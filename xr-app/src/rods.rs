//! Rods: round bodies in the room, drawn over the pictures of both eyes. Where the headset takes depth, what is
//! nearer hides them; elsewhere they are drawn over everything.

use engine::Result;
use engine::gpu::{Buffer, Format, Gpu, Overlap, Recorder};
use engine::render::IN_FLIGHT;
use glam::DVec3;
use shaders_glsl::rods::CORNERS;
use shaders_glsl::types::{self, RodsParams, View};
use shaders_glsl::{RODS_FRAG, RODS_VERT};
use view::screen::painter::fill;

use crate::eye_drawing::EyeDrawing;
use crate::headset::FrameImages;
use crate::placement::Placement;

/// Initial capacity: two hands with all their joints have 48.
const ROOM: usize = 64;

/// A round body between two places, with a half sphere at each end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rod {
    /// Middles of both ends in the room, metres.
    pub ends: [DVec3; 2],
    /// Radius of either end, metres.
    pub radii: [f64; 2],
    /// Colour, sRGB.
    pub colour: [u8; 3],
}

/// Draws rods.
pub struct Rods {
    gpu: Gpu,
    drawing: EyeDrawing,
    /// Rods on the device, for each turn of the frames.
    slots: Vec<Buffer<types::Rod>>,
}

impl Rods {
    /// Creates the drawing over pictures of this format, with or without depth, with a layer for each eye.
    pub fn new(gpu: &Gpu, format: Format, depth: bool) -> Result<Self> {
        let slot = |n| gpu.mapped(&format!("rods {n}"), "panels", ROOM);
        Ok(Rods {
            gpu: gpu.clone(),
            drawing: EyeDrawing::new(gpu, [&RODS_VERT, &RODS_FRAG], Overlap::Nearest, format, depth)?,
            slots: (0..IN_FLIGHT).map(slot).collect::<Result<_>>()?,
        })
    }

    /// Records rods over the pictures of both eyes, which see the scene as `views` say. `slot` is the frame's
    /// turn, `placement` that of the patient, and `origin` the scene's origin, mm RAS. Of two rods the one
    /// that is nearer to `head`, metres, hides the other.
    pub fn draw(
        &mut self,
        recorder: &mut Recorder,
        (slot, views): (usize, &Buffer<View>),
        (placement, origin): (&Placement, DVec3),
        (rods, head): (&[Rod], DVec3),
        eyes: &mut FrameImages<'_>,
    ) -> Result<()> {
        if rods.is_empty() {
            return Ok(());
        }
        let mut sorted = rods.to_vec();
        // Without a picture of depth what is drawn last is seen.
        let distance = |rod: &Rod| ((rod.ends[0] + rod.ends[1]) * 0.5).distance(head);
        sorted.sort_by(|a, b| distance(b).total_cmp(&distance(a)));
        let row = |rod: &Rod| {
            let [from, to] = rod.ends.map(|end| (placement.patient(end) - origin).as_vec3().to_array());
            let radii = rod.radii.map(|radius| placement.patient_length(radius) as f32);
            let [r, g, b] = rod.colour;
            types::Rod { from, to, radii, colour: u32::from_le_bytes([r, g, b, 255]) }
        };
        let rows: Vec<_> = sorted.iter().map(row).collect();
        fill(&self.gpu, &mut self.slots[slot], &rows)?;
        recorder
            .draw(self.drawing.over(eyes)?)
            .read("rods", &self.slots[slot])
            .read("views", views)
            .push(&RodsParams { range: placement.depth_range() })
            .vertices_over(&mut eyes.pictures(), 0..CORNERS * rows.len() as u32);
        Ok(())
    }
}
