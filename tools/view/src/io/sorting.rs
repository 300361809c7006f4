//! Sorts files that are opened: splats, a volume, its region, a session.
//!
//! Names decide where they can. What a name leaves open is looked into: a volume that comes to another one may
//! be its mask. [`Sorted::notes`] says what was taken for what.

use std::path::{Path, PathBuf};

use engine::splat;
use engine::volume::{FORMATS, ReadOptions, Roi, Volume};
use engine::{Error, Kind, Result};

use crate::model::region::Region;
use crate::model::state::{Files, ViewState, is_session};

/// Words in the name of a volume that say that it is a mask.
const MASK_WORDS: [&str; 4] = ["mask", "label", "roi", "seg"];

/// Files sorted by their names, by what is open already and, where they were looked into, by their content.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sorted {
    /// Session file, which replaces everything.
    pub session: Option<PathBuf>,
    /// The session, once it was read.
    pub read: Option<ViewState>,
    /// Files that are open once these are.
    pub files: Files,
    /// What was taken for what, in sentences, where that is not plain.
    pub notes: Vec<String>,
}

impl Sorted {
    /// Returns the session, reading it unless that was done; `None` if there is no session file.
    pub fn state(&self) -> Option<Result<ViewState>> {
        self.read.clone().map(Ok).or_else(|| self.session.as_deref().map(ViewState::read))
    }
}

/// Files by the kind that their names tell.
#[derive(Default)]
struct Named {
    splats: Vec<PathBuf>,
    session: Option<PathBuf>,
    masks: Vec<PathBuf>,
    volumes: Vec<PathBuf>,
}

/// Adds files to those that are open: splats to splats; a volume replaces the volume and its region. A volume
/// whose name says mask, label, roi or seg is the region, or the volume if there is none.
///
/// # Errors
/// Returns [`Kind::Usage`] for a file that is none of these.
pub fn sort(open: &Files, added: &[PathBuf]) -> Result<Sorted> {
    Ok(combined(open, by_name(added)?, Vec::new(), "by its name"))
}

/// Returns true if names alone do not tell which of these files is a volume and which its mask, or if there is a
/// session, whose files may have to be unpacked.
pub fn needs_look(open: &Files, added: &[PathBuf]) -> bool {
    by_name(added).is_ok_and(|Named { volumes, session, .. }| {
        let others = volumes.iter().filter(|path| open.volume.as_ref() != Some(path)).count();
        others > usize::from(open.volume.is_none()) || session.is_some()
    })
}

/// Puts a file of splats beside those that are open, and splits the picture between them.
///
/// # Errors
/// Returns [`Kind::Usage`] if it is not one by its name, and [`Kind::NothingToDo`] if no splats are open.
pub fn put_beside(state: &mut ViewState, path: PathBuf) -> Result<()> {
    if by_name(std::slice::from_ref(&path))?.splats.is_empty() {
        return Err(Error::new(Kind::Usage, "VGS-VIEW-021", "only splats can stand beside splats")
            .file(&path)
            .help(format!("give one of these: {}", splat_endings().collect::<Vec<_>>().join(", "))));
    }
    if state.files.splats.is_empty() {
        return Err(Error::new(Kind::NothingToDo, "VGS-VIEW-022", "there are no splats to compare with")
            .file(path)
            .help("open it as it is, or open splats first"));
    }
    state.files.beside = Some(path);
    state.split.get_or_insert(0.5);
    Ok(())
}

/// Adds files as [`sort`] does, and looks into volumes whose names do not say that they are masks: one with the
/// values of a mask ([`Roi::has_values_of_mask`]) on the grid of the others, or of `volume`, the one that is
/// open, is its region.
///
/// # Errors
/// As [`sort`]. A file that cannot be read counts as a volume; reading it tells why.
pub fn sort_looking(open: &Files, added: &[PathBuf], volume: Option<&Volume>) -> Result<Sorted> {
    let mut named = by_name(added)?;
    let looked: Vec<Look> = named.volumes.drain(..).map(Look::at).collect();
    let picture = looked.iter().rev().find(|look| !look.is_mask);
    let grid = picture.map_or(volume, |look| look.grid.as_ref());
    let on_grid = |look: &Look| match (&look.grid, grid) {
        (Some(mask), Some(volume)) => Roi::is_on_grid_of(mask, volume),
        _ => true,
    };
    let (masks, others): (Vec<&Look>, _) = looked.iter().partition(|look| look.is_mask && on_grid(look));
    // What could be a mask, but lies on another grid, is a volume only where there is no other.
    let (strays, pictures): (Vec<&Look>, _) = others.into_iter().partition(|look| look.is_mask);
    let mut left_out = Vec::new();
    if pictures.is_empty() {
        named.volumes.extend(strays.iter().map(|look| look.path.clone()));
    } else {
        left_out.extend(strays.iter().map(|look| look.path.clone()));
        named.volumes.extend(pictures.iter().map(|look| look.path.clone()));
    }
    // A name that says mask counts most.
    let by = match named.masks.is_empty() {
        true => "because it has mask values on the same grid",
        false => "by its name",
    };
    named.masks.splice(0..0, masks.iter().map(|look| look.path.clone()));
    Ok(combined(open, named, left_out, by))
}

/// Volume file that was looked into.
struct Look {
    path: PathBuf,
    /// True if it has the values of a mask.
    is_mask: bool,
    /// The volume without its samples; `None` if it was not read.
    grid: Option<Volume>,
}

impl Look {
    fn at(path: PathBuf) -> Self {
        // A folder of slices is no mask.
        let read = if path.is_dir() { None } else { Volume::read(&path, &ReadOptions::default()).ok() };
        let is_mask = read.as_ref().is_some_and(Roi::has_values_of_mask);
        let grid = read.map(|volume| Volume { samples: Vec::new(), ..volume });
        Look { path, is_mask, grid }
    }
}

fn by_name(added: &[PathBuf]) -> Result<Named> {
    let mut named = Named::default();
    for path in added {
        let name = name_of(path).to_lowercase();
        // A folder is taken for one of DICOM slices.
        let is_volume = path.is_dir() || volume_endings().any(|end| name.ends_with(end));
        if splat_endings().any(|end| name.ends_with(&end)) {
            named.splats.push(path.clone());
        } else if is_session(path) {
            named.session = Some(path.clone());
        } else if is_volume && MASK_WORDS.iter().any(|word| name.contains(word)) {
            named.masks.push(path.clone());
        } else if is_volume {
            named.volumes.push(path.clone());
        } else {
            let (splats, volumes) =
                (splat_endings().collect::<Vec<_>>(), volume_endings().collect::<Vec<_>>());
            return Err(Error::new(Kind::Usage, "VGS-VIEW-020", "not a file that can be shown")
                .file(path)
                .help(format!(
                    "splats are {}; volumes and masks {}; sessions .toml",
                    splats.join(", "),
                    volumes.join(", ")
                )));
        }
    }
    Ok(named)
}

/// Puts sorted files to those that are open. The last volume and the last mask count; the others are left out.
/// `by` says by what the mask was known.
fn combined(open: &Files, named: Named, left_out: Vec<PathBuf>, by: &str) -> Sorted {
    let mut sorted = Sorted { session: named.session, files: open.clone(), ..Sorted::default() };
    let Sorted { files, notes, .. } = &mut sorted;
    for path in named.splats {
        if !files.splats.contains(&path) {
            files.splats.push(path);
        }
    }
    let (mut volumes, mut masks) = (named.volumes, named.masks);
    if volumes.is_empty() && files.volume.is_none() {
        // A mask alone is shown as a volume.
        volumes.extend(masks.pop());
    }
    let mut left_out = left_out;
    if let Some(path) = volumes.pop().filter(|path| files.volume.as_ref() != Some(path)) {
        if let Some(old) = &files.volume {
            notes.push(format!("{} replaces {} as the volume.", name_of(&path), name_of(old)));
        }
        // Region and series were those of the volume before.
        *files = Files {
            splats: std::mem::take(&mut files.splats),
            beside: files.beside.take(),
            volume: Some(path),
            unpacked: std::mem::take(&mut files.unpacked),
            ..Files::default()
        };
    }
    if let (Some(path), Some(volume)) = (masks.pop(), &files.volume) {
        notes.push(format!("{} is used as the region of {}, {by}.", name_of(&path), name_of(volume)));
        files.set_region(Some(Region::Mask { path, labels: None }));
    }
    left_out.extend(volumes.into_iter().chain(masks));
    if !left_out.is_empty() {
        let names: Vec<_> = left_out.iter().map(|path| name_of(path)).collect();
        notes.push(format!("Not opened: {}. Only one volume and one mask can be open.", names.join(", ")));
    }
    sorted
}

fn name_of(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Returns the extensions of splats, in lower case.
fn splat_endings() -> impl Iterator<Item = String> {
    splat::FORMATS.iter().map(|format| format!(".{}", format.name))
}

/// Returns the extensions of volumes, in lower case.
fn volume_endings() -> impl Iterator<Item = &'static str> {
    FORMATS.iter().flat_map(|format| format.extensions).copied()
}

#[cfg(test)]
mod tests {
    use engine::volume::nifti;
    use glam::{DAffine3, DVec3};

    use super::*;

    fn paths(names: &[&str]) -> Vec<PathBuf> {
        names.iter().map(PathBuf::from).collect()
    }

    #[test]
    fn files_are_known_by_their_names() {
        let sorted = sort(&Files::default(), &paths(&["b.ply", "ct.nii.gz", "mask_bones.nii.gz"])).unwrap();
        assert_eq!(sorted.files.splats, paths(&["b.ply"]));
        assert_eq!(sorted.files.volume, Some("ct.nii.gz".into()));
        assert_eq!(sorted.files.roi, Some("mask_bones.nii.gz".into()));
        let more = sort(&sorted.files, &paths(&["a.PLY", "b.ply"])).unwrap();
        assert_eq!(more.files.splats, paths(&["b.ply", "a.PLY"]), "none is open twice");
        assert_eq!(more.files.volume, sorted.files.volume, "what is open stays");
        for name in ["ct.nrrd", "ct.nhdr", "ct.mha", "CT.MHD", "ct.npy"] {
            let sorted = sort(&Files::default(), &paths(&[name, "bones.seg.nrrd"])).unwrap();
            assert_eq!(
                (sorted.files.volume, sorted.files.roi),
                (Some(name.into()), Some("bones.seg.nrrd".into()))
            );
        }
        let small = sort(&Files::default(), &paths(&["small.vgs"])).unwrap();
        assert_eq!(small.files.splats, paths(&["small.vgs"]), "every format of splats");
        let alone = sort(&Files::default(), &paths(&["mask.nii"])).unwrap();
        assert_eq!((alone.files.volume, alone.files.roi), (Some("mask.nii".into()), None));
        assert_eq!(sort(&more.files, &paths(&["s.toml"])).unwrap().session, Some("s.toml".into()));
        let error = sort(&Files::default(), &paths(&["x.docx"])).unwrap_err();
        assert_eq!((error.kind, error.file), (Kind::Usage, Some("x.docx".into())));
    }

    #[test]
    fn a_volume_brings_no_region_of_another_one() {
        let open = Files { volume: Some("ct.nii".into()), series: Some("3".into()), ..Files::default() };
        let with = sort(&open, &paths(&["mask.nii"])).unwrap();
        assert_eq!(with.files.roi, Some("mask.nii".into()));
        assert_eq!(with.files.series.as_deref(), Some("3"), "the volume stays");
        assert_eq!(with.notes, ["mask.nii is used as the region of ct.nii, by its name."]);
        assert_eq!(sort(&with.files, &paths(&["ct.nii"])).unwrap().files, with.files, "it is open already");
        let other = sort(&with.files, &paths(&["mr.nii"])).unwrap();
        assert_eq!(other.files, Files { volume: Some("mr.nii".into()), ..Files::default() });
        assert_eq!(other.notes, ["mr.nii replaces ct.nii as the volume."]);
        let both = sort(&open, &paths(&["seg.nii", "roi.nii", "mr.nii"])).unwrap();
        assert_eq!((both.files.volume, both.files.roi), (Some("mr.nii".into()), Some("roi.nii".into())));
        assert!(both.notes[2].contains("Not opened: seg.nii."), "{:?}", both.notes);
    }

    #[test]
    fn splats_stand_beside_splats_alone() {
        let mut state = ViewState::new(&engine::transfer::load("CT-Bone", [-1000.0, 2000.0]).unwrap());
        let error = put_beside(&mut state, "coarse.vgs".into()).unwrap_err();
        assert_eq!((error.code, error.kind), ("VGS-VIEW-022", Kind::NothingToDo));
        state.files.splats = paths(&["fine.ply"]);
        for (name, code) in
            [("ct.nii.gz", "VGS-VIEW-021"), ("s.toml", "VGS-VIEW-021"), ("x.docx", "VGS-VIEW-020")]
        {
            let error = put_beside(&mut state, name.into()).unwrap_err();
            assert_eq!((error.code, error.file), (code, Some(name.into())));
        }
        assert_eq!((&state.files.beside, state.split), (&None, None));
        put_beside(&mut state, "coarse.vgs".into()).unwrap();
        assert_eq!((state.files.beside.clone(), state.split), (Some("coarse.vgs".into()), Some(0.5)));
        state.split = Some(0.2);
        put_beside(&mut state, "middle.vgs".into()).unwrap();
        assert_eq!((state.files.beside.clone(), state.split), (Some("middle.vgs".into()), Some(0.2)));
        let other = sort(&state.files, &paths(&["mr.nii"])).unwrap().files;
        assert_eq!((other.beside, other.splats), (Some("middle.vgs".into()), state.files.splats));
    }

    #[test]
    fn a_mask_is_known_by_its_values_and_grid() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, shift: f64, value: fn(usize) -> f32| {
            let affine = DAffine3::from_translation(DVec3::splat(shift));
            let volume = Volume::new([8, 7, 6], affine, (0..8 * 7 * 6).map(value).collect());
            let path = folder.path().join(name);
            nifti::write(&path, &volume, false).unwrap();
            path
        };
        let ct = write("ct.nii", 0.0, |i| i as f32 - 500.0);
        let mr = write("mr.nii", 0.0, |i| i as f32);
        let bones = write("bones.nii", 0.0, |i| (i % 2) as f32);
        let organs = write("organs.nii", 0.0, |i| (i % 100) as f32);
        let soft = write("soft.nii", 0.0, |i| (i % 100) as f32 / 99.0);
        let away = write("away.nii", 3.0, |i| (i % 2) as f32);
        let open = Files { volume: Some(ct.clone()), ..Files::default() };
        let volume = Volume::read(&ct, &ReadOptions::default()).unwrap();
        let look = |open: &Files, added: &[&PathBuf]| {
            let added: Vec<PathBuf> = added.iter().map(|path| (*path).clone()).collect();
            assert!(needs_look(open, &added), "{added:?}");
            let sorted = sort_looking(open, &added, open.volume.as_ref().map(|_| &volume)).unwrap();
            (sorted.files.volume, sorted.files.roi, sorted.notes.join(" "))
        };
        for mask in [&bones, &organs, &soft] {
            let (with, region, notes) = look(&open, &[mask]);
            assert_eq!((with.as_ref(), region.as_ref()), (Some(&ct), Some(mask)));
            assert!(notes.contains("mask values on the same grid"), "{notes}");
        }
        for other in [&mr, &away] {
            let (with, region, notes) = look(&open, &[other]);
            assert_eq!((with.as_ref(), region), (Some(other), None));
            assert!(notes.contains("replaces ct.nii"), "{notes}");
        }
        // Several at once, in any order.
        let nothing = Files::default();
        for added in [[&bones, &ct], [&ct, &bones]] {
            let (with, region, _) = look(&nothing, &added);
            assert_eq!((with.as_ref(), region.as_ref()), (Some(&ct), Some(&bones)));
        }
        let (with, region, notes) = look(&nothing, &[&ct, &away]);
        assert_eq!((with.as_ref(), region), (Some(&ct), None));
        assert!(notes.contains("Not opened: away.nii"), "{notes}");
        let alone = std::slice::from_ref(&ct);
        assert!(!needs_look(&nothing, alone) && !needs_look(&open, alone));
    }
}
