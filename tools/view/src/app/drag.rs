//! What the mouse has taken hold of in the picture.

use egui::Pos2;

use crate::handles::Handle;

/// What the mouse has taken hold of in the picture, other than the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Target {
    /// A handle of a clip plane or of the crop box.
    Handle(Handle),
    /// The line between splats and volume.
    Split,
}

/// What is in the hand, and where the mouse was last.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Drag {
    pub(super) what: Target,
    pub(super) at: Pos2,
}
