//! The view of a scene to begin with.

use engine::render::{ClipPlane, Look};
use engine::splat::Object;
use engine::unit::Unit;
use glam::DVec3;
use view::model::state::{self, ViewState};

/// The view of a scene to begin with.
#[derive(Clone, Debug)]
pub struct Start {
    /// What is shown of the scene, and how.
    pub state: ViewState,
    /// The scene's numbers of the rows of [`ViewState::objects`].
    pub numbers: Vec<u8>,
    /// Least and greatest intensity of the scene.
    pub range: [f64; 2],
    /// Text behind an intensity: " HU", or nothing.
    pub unit: &'static str,
    /// True if the scene has a binary region, whose edges can be smooth.
    pub has_region: bool,
}

/// Returns the view that a scene of these objects, with intensities in `range`, HU, has with a look.
pub fn view_of(look: &Look, objects: &[Object], range: [f64; 2]) -> Start {
    let mut state = ViewState::new(&look.transfer);
    let row = |object: &Object| {
        let row = state::Object::new(0, Some(object.number), &object.name);
        match look.objects.get(&object.number) {
            None => row,
            Some(seen) => state::Object {
                visible: seen.visible,
                tint: seen.tint.map(|colour| DVec3::from_array(colour.map(f64::from))),
                opacity: f64::from(seen.opacity),
                ..row
            },
        }
    };
    state.objects = objects.iter().map(row).collect();
    state.clip.planes = look.clip.iter().map(standing).collect();
    Start {
        state,
        numbers: objects.iter().map(|object| object.number).collect(),
        range,
        unit: Unit::Hu.text(),
        has_region: false,
    }
}

/// Returns a plane that stands in the patient.
pub(crate) fn standing(plane: &ClipPlane) -> state::Plane {
    state::Plane { on: true, normal: plane.normal, offset_mm: plane.offset }
}
