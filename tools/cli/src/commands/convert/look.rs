//! How the splats look: as flags say, or a session, or as is usual.

use std::collections::BTreeMap;

use engine::render::Look;
use engine::splat::SplatSet;

use super::arguments::{ConvertArguments, ObjectFlag};
use crate::shared::looks::{self, look_of};

impl ConvertArguments {
    /// Returns the look of `set` that the flags ask for: that of the session, if there is one, with changes.
    pub fn look(&self, set: &SplatSet, session: Option<Look>) -> engine::Result<Look> {
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
        let changes = self.object.iter().filter_map(|flag| match flag {
            ObjectFlag::Shown(change) => Some(change),
            ObjectFlag::Chosen(_) => None,
        });
        looks::change(&mut look, set, self.object_colours, changes, &self.clip)?;
        Ok(look)
    }
}
