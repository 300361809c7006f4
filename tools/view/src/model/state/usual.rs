//! The usual look of objects, as long as nobody has said how they look, and how a user's own function takes its place.

use engine::render::UsualLook;
use glam::Vec3;

use super::state::{Object, ViewState};
use crate::model::transfer::Transfer;

impl Object {
    /// Returns true if its function is the usual one for it: no user has chosen it.
    pub fn has_usual_function(&self) -> bool {
        self.transfer.as_ref().is_some_and(|function| UsualLook::has_function(&function.name))
    }
}

impl ViewState {
    /// Gives each object the colour and the function that are usual for it, and the scene one that shows what they show.
    /// `usual` has the looks of the rows of [`ViewState::objects`].
    pub fn take_usual_look(&mut self, usual: &UsualLook) {
        for (object, look) in self.objects.iter_mut().zip(&usual.objects) {
            object.tint = Some(Vec3::from_array(look.tint).as_dvec3());
            object.transfer = Some(Transfer::new(&look.function));
        }
        self.transfer = Transfer::new(&usual.transfer);
    }

    /// Does what may change the transfer function of the scene. If it does, objects with their usual functions follow
    /// the scene from then on: a function that a user chooses is for all of them. How it is lit is no such change.
    pub fn edit_transfer<R>(&mut self, edit: impl FnOnce(&mut Self) -> R) -> R {
        let before = self.transfer.clone();
        let done = edit(self);
        let after = &self.transfer;
        if (Transfer { material: before.material, ..after.clone() }) != before {
            self.follow_scene();
        }
        done
    }

    /// Shows all objects through the function of the scene, but those for which a user has chosen another one.
    pub fn follow_scene(&mut self) {
        self.objects.iter_mut().filter(|object| object.has_usual_function()).for_each(|o| o.transfer = None);
    }
}
