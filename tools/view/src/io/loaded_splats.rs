//! Splats of all files as one field, what is left of it after deletions, and how that is written.

use std::path::{Path, PathBuf};

use engine::Result;
use engine::gpu::Gpu;
use engine::render::Intensities;
use engine::splat::{self, Part, SplatSet, WriteOptions, far_splats};

use crate::io::saving;
use crate::model::deletions::{Deletion, Target};
use crate::model::state::{Object, ViewState};

/// Splats of all files, as one field.
pub struct LoadedSplats {
    /// All splats.
    pub set: SplatSet,
    /// Rows of the list of objects, each with its number in the set and its number of splats.
    pub objects: Vec<(Object, u8, usize)>,
    /// Intensities of each row.
    pub intensities: Vec<Intensities>,
    /// Number of splats that lie far from all others.
    pub far: usize,
}

impl LoadedSplats {
    /// Joins the splats of files.
    ///
    /// # Errors
    /// Returns the errors of [`splat::join`].
    pub fn join(files: Vec<(PathBuf, SplatSet)>) -> Result<Self> {
        let mut rows = Vec::new();
        let mut named = Vec::new();
        let files = files.into_iter().map(|(path, set)| (splat::stem(&path), set));
        for Part { file, name, set } in splat::parts(files.collect())? {
            let has_labels = set.labels.is_some();
            let own =
                set.objects().into_iter().map(|o| Object::new(file, has_labels.then_some(o.number), ""));
            rows.extend(own);
            named.push((name, set));
        }
        let mut set = splat::join(named)?;
        // The first splats stand for all while the picture moves.
        set.order_by_importance();
        // Joining numbers the objects in the order of files and labels.
        let objects = rows.into_iter().zip(set.objects());
        let objects = objects.map(|(row, o)| (Object { name: o.name, ..row }, o.number, o.splats)).collect();
        let intensities = Intensities::of_objects(&set);
        let far = far_splats(&set.splats).len();
        Ok(LoadedSplats { set, objects, intensities, far })
    }

    /// Returns the splats that deletions leave, with the part of the region that is theirs. All rows of objects stay,
    /// also those without splats.
    pub fn without(&self, deleted: &[Deletion]) -> Self {
        let mut rows = [None; 256];
        for (row, number, _) in &self.objects {
            rows[usize::from(*number)] = Some(Target { file: row.file, label: row.label });
        }
        let number = |i: usize| self.set.labels.as_ref().map_or(0, |labels| labels[i]);
        let set = self.set.selected(|i, mean_mm| {
            let row = rows[usize::from(number(i))];
            row.is_none_or(|row| !deleted.iter().any(|deletion| deletion.takes(row, mean_mm)))
        });
        let (left, own) = (set.objects(), Intensities::of_objects(&set));
        let at = |number: u8| left.iter().position(|object| object.number == number);
        let count = |number: u8| at(number).map_or(0, |at| left[at].splats);
        let objects = self.objects.iter().map(|(row, number, _)| (row.clone(), *number, count(*number)));
        let of_row = |number: u8| at(number).and_then(|at| own.get(at).cloned()).unwrap_or_default();
        let intensities = self.objects.iter().map(|(_, number, _)| of_row(*number)).collect();
        let far = far_splats(&set.splats).len();
        LoadedSplats { objects: objects.collect(), intensities, set, far }
    }

    /// Returns the splats as files hold them, with the number in them of each row of the list of objects: joining has
    /// made a label of the only file that has none.
    pub fn of_files(&self) -> (SplatSet, Vec<u8>) {
        let mut set = self.set.clone();
        if let [(row, ..)] = &self.objects[..]
            && row.label.is_none()
        {
            (set.labels, set.label_names) = (None, Vec::new());
            return (set, vec![0]);
        }
        (set, self.objects.iter().map(|(_, number, _)| *number).collect())
    }

    /// Writes the splats that a state shows to a file, as `vgs convert` writes those of a session; or those of one
    /// `object`, shown or not. Returns how many of these are not in the file: hidden, cut away by a clip plane, or in colours
    /// that show nothing of them. Waits for the device where colours or a mask have to be found.
    ///
    /// # Errors
    /// Returns the errors of [`ViewState::look`], of [`saving::ready`] and of [`splat::write`](engine::splat::write()).
    pub fn write(
        &self,
        gpu: &Gpu,
        state: &ViewState,
        object: Option<Target>,
        path: &Path,
        force: bool,
    ) -> Result<usize> {
        let (set, numbers) = self.of_files();
        let mut look = state.look(&numbers)?;
        if let Some(object) = object {
            for ((row, ..), number) in self.objects.iter().zip(numbers) {
                let own = Target { file: row.file, label: row.label } == object;
                look.objects.entry(number).or_default().visible = own;
            }
        }
        let options = WriteOptions { force, ..WriteOptions::default() };
        let ready = saving::ready(gpu, &set, &look, path, false)?;
        ready.write(path, &options)?;
        let of_object = |object| {
            let own =
                self.objects.iter().filter(|(row, ..)| Target { file: row.file, label: row.label } == object);
            own.map(|(.., count)| count).sum()
        };
        let wanted: usize = object.map_or(set.splats.len(), of_object);
        Ok(wanted.saturating_sub(ready.set.splats.len()))
    }
}
