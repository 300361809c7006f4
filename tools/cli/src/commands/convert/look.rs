//! How the splats look: as flags say, or a session, or as is usual.

use std::collections::BTreeMap;

use engine::render::Look;
use engine::splat::SplatSet;

use super::arguments::{ConvertArguments, ObjectFlag};
use crate::shared::looks::look_of;

impl ConvertArguments {
    /// Returns the look of `set` that the flags ask for: that of the session, if there is one, with changes.
    pub fn look(&self, set: &SplatSet, session: Option<Look>) -> engine::Result<Look> {
        let range = set.intensity_range().unwrap_or([0.0, 1.0]);
        let mut look = match session {
            // One function for all, in place of those of the objects, too.
            Some(look) if self.tf.is_some() => Look {
                transfer: look_of(set, self.tf.as_deref())?.transfer,
                functions: BTreeMap::new(),
                ..look
            },
            Some(look) => look,
            None => look_of(set, self.tf.as_deref())?,
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
