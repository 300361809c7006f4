//! Regions as files have them.

use super::kinds::Region;
use super::occupied::Exception;
use crate::{Form, SplatSet};
use base::error::Result;

/// What a file has of a region.
#[derive(Default)]
pub(crate) struct Stored {
    /// Name of its form.
    pub(crate) form: &'static str,
    /// Its bytes.
    pub(crate) bytes: Option<Vec<u8>>,
    /// Where the occupancy of the splats is wrong, in files without a region.
    pub(crate) exceptions: Vec<Exception>,
}

impl Stored {
    /// Returns the region of a set without one, which is otherwise as the file has it; or what is wrong with the file.
    ///
    /// # Errors
    /// [`Kind::HostMemory`](base::Kind) for a region that memory does not hold.
    pub(crate) fn region(&self, set: &SplatSet) -> Result<std::result::Result<Option<Region>, &'static str>> {
        let Some(grid) = &set.grid else {
            let lost = self.form == Form::WITH_REGION;
            return Ok(if lost { Err("it has a region and no grid for it") } else { Ok(None) });
        };
        if self.form == Form::OCCUPIED {
            let region = Region::occupied(set, grid, &self.exceptions)?;
            if region.is_none() {
                tracing::warn!("the splats are too many and too large to find their mask; edges are soft");
            }
            return Ok(Ok(region));
        }
        match (&self.bytes, self.form == Form::WITH_REGION) {
            (None, true) => Ok(Err("its region is missing")),
            (None, false) => Ok(Ok(None)),
            (Some(_), false) => Ok(Err("it has a region, and its form is another")),
            (Some(bytes), true) => {
                Ok(Region::decode(bytes, grid.size)?.map(Some).ok_or("its region is not as it was written"))
            }
        }
    }
}
