//! Structures: what a segmentation or a structure set delineates, and the mask of those that are chosen.

use std::collections::BTreeMap;

use crate::source::reserve_samples;
use crate::{Grid, LabelChoice, ReadOptions, Volume};
use base::{Error, Kind, Result};

/// A structure of a file, such as an organ.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Structure {
    /// Number, by which it can be chosen; at least 1.
    pub number: i32,
    /// Name; may be empty.
    pub name: String,
}

/// Returns the structures that are to be read: those of the choice, or all of them if it names none of the
/// file, which is then refused where labels are resolved, with a list of what there is.
///
/// # Errors
/// [`Kind::Usage`] if a name may mean several.
pub(super) fn chosen(all: &[Structure], choice: &LabelChoice) -> Result<Vec<Structure>> {
    let names = all.iter().map(|structure| (structure.number, structure.name.as_str()));
    let numbers = choice.numbers(names)?;
    let chosen: Vec<_> =
        all.iter().filter(|structure| numbers.contains(&structure.number)).cloned().collect();
    Ok(if chosen.is_empty() { all.to_vec() } else { chosen })
}

/// Returns a note if a mask gives its places in another space than the volume that it is read for: `space` is the
/// UID of its frame of reference.
pub(super) fn other_space(space: &str, options: &ReadOptions) -> Option<String> {
    let of_volume = options.frame_of_reference.as_deref().unwrap_or_default();
    (!space.is_empty() && !of_volume.is_empty() && space != of_volume).then(|| {
        format!(
            "the structures belong to another scan by their Frame of Reference UID ({space}, that of the volume is \
             {of_volume}): they lie where they should only if the scans were registered to each other"
        )
    })
}

/// Returns the error of a file without structures.
pub(super) fn none() -> Error {
    Error::new(Kind::BadData, "VGS-DCM-016", "the file has no structures")
        .help("export it again, with the structures that are needed")
}

/// A map of labels in the making. A voxel has the label of one structure.
pub(super) struct LabelMap {
    grid: Grid,
    values: Vec<f32>,
    names: BTreeMap<i32, String>,
    /// Label of a structure that is alone in a mask without a choice: a mask of 0 and 1 needs no choice.
    alone: bool,
    /// Number of voxels that belong to two structures or more.
    shared: usize,
}

impl LabelMap {
    /// Creates a map without a label.
    ///
    /// # Errors
    /// [`Kind::BadData`] if it is larger than [`ReadOptions::max_bytes`]; [`Kind::HostMemory`].
    pub fn new(grid: Grid, structures: &[Structure], options: &ReadOptions) -> Result<Self> {
        let count = grid.size.iter().try_fold(1_usize, |product, &n| product.checked_mul(n));
        let limit = usize::try_from(options.max_bytes / 4).unwrap_or(usize::MAX);
        let Some(count) = count.filter(|&count| count <= limit) else {
            let [x, y, z] = grid.size;
            let message = format!(
                "a mask of {x} x {y} x {z} voxels is more than the limit of {} bytes",
                options.max_bytes
            );
            return Err(Error::new(Kind::BadData, "VGS-VOL-005", message)
                .help("if the size is right, raise the limit with --max-bytes"));
        };
        let mut values = reserve_samples(count, options.max_bytes)?;
        values.resize(count, 0.0);
        let alone = structures.len() == 1 && options.labels == LabelChoice::Whole;
        let names = structures.iter().filter(|s| !s.name.is_empty());
        let names = names.map(|s| (if alone { 1 } else { s.number }, s.name.clone())).collect();
        Ok(LabelMap { grid, values, names, alone, shared: 0 })
    }

    /// Returns the number of voxels.
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Gives a voxel, by its index, to a structure. A voxel of several has the greatest number.
    pub fn add(&mut self, voxel: usize, structure: i32) {
        let label = if self.alone { 1.0 } else { structure as f32 };
        let value = &mut self.values[voxel];
        if *value != 0.0 && *value != label {
            self.shared += 1;
        }
        *value = value.max(label);
    }

    /// Returns the map as a volume, and a note if structures overlap.
    pub fn finish(self) -> (Volume, Option<String>) {
        let note = (self.shared > 0).then(|| {
            format!(
                "structures overlap in {} voxels, which count as the one with the greatest number alone; \
                 choose one at a time where that matters",
                self.shared
            )
        });
        let mut volume = Volume::new(self.grid.size, self.grid.world_from_voxel, self.values);
        volume.labels = self.names;
        (volume, note)
    }
}
