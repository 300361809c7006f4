//! Describes what the mouse drags in the picture.

use egui::Pos2;

use crate::panels::handles::Handle;

/// Target that the mouse can drag in the picture, apart from the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Target {
    /// A handle of a clip plane or of the crop box.
    Handle(Handle),
    /// The line between splats and volume.
    Split,
}

/// Drag in progress: its target, and the last place of the mouse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Drag {
    pub(super) what: Target,
    pub(super) at: Pos2,
}
