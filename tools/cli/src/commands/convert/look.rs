//! How the splats look: as flags say, or a session, or as is usual.

use std::collections::BTreeMap;

use engine::render::{Intensities, Look, UsualLook};
use engine::splat::SplatSet;
use engine::transfer;

use super::arguments::{ConvertArguments, ObjectFlag};

impl ConvertArguments {
    /// Returns the look of `set` that the flags ask for: that of the session, if there is one, with changes.
    pub fn look(&self, set: &SplatSet, session: Option<Look>) -> engine::Result<Look> {
        let range = set.intensity_range().unwrap_or([0.0, 1.0]);
        let given = self.tf.as_deref().map(|name| transfer::load(name, range)).transpose()?;
        let mut look = match (session, given) {
            (Some(look), None) => look,
            // One function for all, in place of those of the objects, too.
            (Some(look), Some(given)) => Look { transfer: given, functions: BTreeMap::new(), ..look },
            (None, Some(given)) => Look::new(given),
            (None, None) => match UsualLook::of(set) {
                Some(usual) => usual.look(&set.objects()),
                None => {
                    let suiting = Intensities::of_set(set).suiting_preset(set.unit);
                    Look::new(transfer::load(suiting, range)?)
                }
            },
        };
        let there = set.objects();
        if self.object_colours {
            look.tint_objects(&there);
        }
        for flag in &self.object {
            if let ObjectFlag::Shown(change) = flag {
                change.apply(&there, &mut look, range)?;
            }
        }
        look.clip.extend(self.clip.iter().flat_map(|clip| clip.0.iter().copied()));
        Ok(look)
    }
}
