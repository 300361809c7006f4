//! What is shown: splats, a volume or a session, as the desktop viewer reads them.

use std::path::{Path, PathBuf};

use engine::render::{ObjectChange, SplatKind, UsualLook};
use engine::{Error, Kind, Result, transfer};
use view::io::loader::{self, LoadedSplats, LoadedVolume};
use view::io::sorting;
use view::model::deletions::Deletion;
use view::model::state::{Files, SplatMode, Subject, ViewState, is_session};
use view::model::transfer::Transfer;

use crate::start::Start;

/// What the user wants to see.
#[derive(Clone, Debug, Default)]
pub struct Wanted {
    /// Splats, a volume, or a session.
    pub files: Vec<PathBuf>,
    /// The volume that the splats were fitted to, or that is shown.
    pub volume: Option<PathBuf>,
    /// The series of a DICOM folder.
    pub series: Option<String>,
    /// The mask outside of which nothing of the volume is shown.
    pub roi: Option<PathBuf>,
    /// Transfer function; `None` for that of the session, or the first one.
    pub tf: Option<String>,
    /// Changes of objects, one after the other.
    pub objects: Vec<ObjectChange>,
    /// The session that is kept: it is read if it is there.
    pub session: Option<PathBuf>,
}

/// What was read.
pub enum Content {
    /// Splats of all files.
    Splats(LoadedSplats),
    /// A volume with its region.
    Volume(LoadedVolume),
}

/// Reads what the user wants to see; returns it with the view to begin with. Splats are shown where there are
/// any, unless a session shows the volume.
///
/// # Errors
/// [`Kind::Usage`] for flags that do not fit together, and the errors of the readers, with the file.
pub fn read(wanted: &Wanted) -> Result<(Content, Start)> {
    let kept = wanted.session.as_ref().filter(|session| session.exists());
    let files: Vec<PathBuf> = match kept {
        // Its own files are those that are shown.
        Some(session) => vec![session.clone()],
        None => wanted.files.clone(),
    };
    let sorted = sorting::sort(&Files::default(), &files)?;
    let session = sorted.state().transpose()?;
    let has_session = session.is_some();
    if let (Some(state), Some(named)) = (&session, kept) {
        let same =
            |a: &Path, b: &Path| a.canonicalize().is_ok_and(|a| b.canonicalize().is_ok_and(|b| a == b));
        let is_there = |file: &&PathBuf| is_session(file) || state.files.all().any(|known| same(known, file));
        if let Some(other) = wanted.files.iter().find(|file| !is_there(file)) {
            return Err(Error::new(
                Kind::Usage,
                "VGS-XR-035",
                format!("{} shows other files", named.display()),
            )
            .file(other)
            .help("leave the file out, or name a new session"));
        }
    }
    let mut state = match session {
        Some(state) => state,
        // A function that is stretched over the intensities is stretched once they are read.
        None => {
            let first = transfer::load(wanted.tf.as_deref().unwrap_or(transfer::FIRST), [-1000.0, 3000.0])?;
            ViewState { files: sorted.files, ..ViewState::new(&first) }
        }
    };
    let files = &mut state.files;
    for (file, named) in [(&mut files.volume, &wanted.volume), (&mut files.roi, &wanted.roi)] {
        if named.is_some() {
            file.clone_from(named);
        }
    }
    if wanted.series.is_some() {
        files.series.clone_from(&wanted.series);
    }
    if files.volume.is_none() && (files.roi.is_some() || wanted.series.is_some()) {
        return Err(Error::new(Kind::Usage, "VGS-XR-029", "--roi and --series are those of a volume")
            .help("name the volume with --volume"));
    }
    let files = state.files.clone();
    let shows_volume = files.splats.is_empty() || has_session && state.shown == Subject::Volume;
    let (content, numbers, range) = match files.volume.as_ref().filter(|_| shows_volume) {
        Some(path) => {
            let volume = loader::read_volume(path, None, &files)?;
            let range = volume.volume.min_max().map_or([0.0, 1.0], |(low, high)| [low, high].map(f64::from));
            state.set_objects(Vec::new());
            (Content::Volume(volume), Vec::new(), range)
        }
        None if files.splats.is_empty() => {
            return Err(nothing("give splats (PLY, .vgs), a volume, or a session that names some"));
        }
        None => {
            let sets = files.splats.iter();
            let sets = sets.map(|path| Ok((path.clone(), loader::read_splats(path, &files)?)));
            let splats = LoadedSplats::join(sets.collect::<Result<_>>()?)?;
            state.set_objects(splats.objects.iter().map(|(row, ..)| row.clone()).collect());
            let range = splats.set.intensity_range().unwrap_or_default();
            let numbers = splats.objects.iter().map(|(_, number, _)| *number).collect();
            (Content::Splats(splats), numbers, range)
        }
    };
    let unit = match &content {
        Content::Splats(splats) => splats.set.unit,
        Content::Volume(volume) => volume.volume.unit(),
    };
    if let Some(tf) = wanted.tf.as_deref().or((!has_session).then_some(transfer::first(unit))) {
        state.transfer = Transfer::new(&transfer::load(tf, range)?);
    }
    if let Content::Splats(splats) = &content {
        // The mode of the first quality level, in which objects may have functions of their own.
        let usual = SplatKind::of(&splats.set).usual_mode();
        state.mode = SplatMode::named(usual).unwrap_or(state.mode);
        if let Some(usual) = UsualLook::of(&splats.set).filter(|_| !has_session && wanted.tf.is_none()) {
            state.take_usual_look(&usual);
        }
    }
    let there = match &content {
        Content::Splats(splats) => splats.set.objects(),
        Content::Volume(_) => Vec::new(),
    };
    state.change_objects(&there, &numbers, range, &wanted.objects)?;
    let has_region = match &content {
        Content::Splats(splats) => splats.set.region.is_some(),
        Content::Volume(volume) => volume.roi.as_ref().is_some_and(|roi| !roi.soft),
    };
    Ok((content, Start { state, numbers, range, unit: unit.text(), has_region }))
}

fn nothing(help: &str) -> Error {
    Error::new(Kind::Usage, "VGS-XR-030", "there is nothing to show").help(help)
}

/// Returns the splats that the deletions of a session leave.
///
/// # Errors
/// [`Kind::Usage`] if none are left.
pub fn left(splats: LoadedSplats, deleted: &[Deletion]) -> Result<LoadedSplats> {
    if deleted.is_empty() {
        return Ok(splats);
    }
    let left = splats.without(deleted);
    match left.set.is_empty() {
        true => Err(nothing("all splats of the session are deleted; restore some in `vgs view`")),
        false => Ok(left),
    }
}

#[cfg(test)]
mod tests {
    use engine::splat::{self, Splat, SplatSet};
    use engine::unit::Unit;
    use engine::volume::{Volume, nifti};
    use glam::{DAffine3, DVec3};

    use super::*;

    /// Returns a folder with two sets, a volume and a mask of a half of it.
    fn folder() -> tempfile::TempDir {
        let folder = tempfile::tempdir().expect("a folder");
        for (name, x) in [("bones", 0.0), ("liver", 9.0)] {
            let splat = Splat {
                mean: [x, 0.0, 0.0],
                rotation: [1.0, 0.0, 0.0, 0.0],
                intensity: 500.0 + x,
                ..Splat::default()
            };
            let set = SplatSet { splats: vec![splat; 3], ..SplatSet::default() };
            splat::write(&folder.path().join(format!("{name}.ply")), &set, false).expect("a file");
        }
        let volume = |value: fn(usize) -> f32| {
            Volume::new([4, 5, 6], DAffine3::IDENTITY, (0..120).map(value).collect())
        };
        for (name, volume) in
            [("ct", volume(|i| i as f32 - 20.0)), ("mask", volume(|i| if i < 60 { 1.0 } else { 0.0 }))]
        {
            nifti::write(folder.path().join(format!("{name}.nii")), &volume, false).expect("a file");
        }
        folder
    }

    fn wanted(folder: &tempfile::TempDir, files: &[&str]) -> Wanted {
        Wanted { files: files.iter().map(|name| folder.path().join(name)).collect(), ..Wanted::default() }
    }

    #[test]
    fn what_has_no_hu_has_another_first_function() {
        let folder = folder();
        let first = |name: &str| {
            let (_, start) = read(&wanted(&folder, &[name])).expect("something to show");
            (start.state.transfer.name, start.unit)
        };
        assert_eq!(first("bones.ply"), ("CT-Bone".into(), " HU"));
        assert_eq!(first("ct.nii"), ("CT-Bone".into(), " HU"), "its name says that it is one");
        let path = folder.path().join("mr.ply");
        let bones =
            splat::read(folder.path().join("bones.ply"), &splat::ReadOptions::default()).expect("splats");
        splat::write(&path, &SplatSet { unit: Unit::Arbitrary, ..bones }, false).expect("a file");
        assert_eq!(first("mr.ply"), ("MR-Default".into(), ""));
    }

    #[test]
    fn objects_are_changed_by_flags() {
        let folder = folder();
        let objects = ["liver:hidden", "bones:colour=#ff0000,opacity=0.5"];
        let objects = objects.map(|text| text.parse().expect("a change")).to_vec();
        let both = wanted(&folder, &["bones.ply", "liver.ply"]);
        let tf = Some("CT-Bone".to_owned());
        let both = Wanted { tf, ..both };
        let (content, start) = read(&Wanted { objects, ..both.clone() }).expect("splats");
        assert!(matches!(content, Content::Splats(splats) if splats.set.splats.len() == 6));
        let [bones, liver] = &start.state.objects[..] else { panic!("two objects") };
        assert_eq!((bones.tint, bones.opacity, bones.visible), (Some(DVec3::X), 0.5, true));
        assert!(!liver.visible && liver.tint.is_none());
        assert_eq!((start.numbers, start.range), (vec![1, 2], [500.0, 509.0]));
        let unknown = vec!["heart:hidden".parse().expect("a change")];
        let error = read(&Wanted { objects: unknown, ..both }).err().expect("no heart");
        assert!(error.code == "VGS-SPLAT-010" && error.help.contains("liver"), "{error}");
    }

    /// Several objects are lit from the start, each as is usual for it, unless a function or a session says otherwise.
    #[test]
    fn several_objects_have_the_usual_look_of_each() {
        let folder = folder();
        let both = wanted(&folder, &["bones.ply", "liver.ply"]);
        let functions = |start: &Start| -> Vec<Option<String>> {
            start.state.objects.iter().map(|o| Some(o.transfer.as_ref()?.name.clone())).collect()
        };
        let (_, start) = read(&both).expect("splats");
        assert_eq!(functions(&start), ["Bone", "Organ"].map(|name| Some(name.to_owned())));
        assert!(start.state.objects.iter().all(|object| object.tint.is_some()));
        assert_eq!(start.state.transfer.name, "By kind");
        let (_, asked) = read(&Wanted { tf: Some("CT-Bone".into()), ..both.clone() }).expect("splats");
        assert_eq!((functions(&asked), asked.state.transfer.name.as_str()), (vec![None, None], "CT-Bone"));
        let path = folder.path().join("kept.toml");
        let mut state = asked.state;
        state.objects[0].visible = false;
        state.write(&path, false).expect("a session");
        // A session that is kept is read instead of the files; one that is not there yet is none.
        let kept = Wanted { session: Some(path), ..both.clone() };
        let (_, again) = read(&kept).expect("a session");
        assert!(!again.state.objects[0].visible && functions(&again) == [None, None]);
        let new = Wanted { session: Some(folder.path().join("new.toml")), ..both };
        assert!(read(&new).expect("splats").1.state.objects[0].visible);
    }

    #[test]
    fn a_session_is_shown_as_it_was_left() {
        let folder = folder();
        let (_, start) = read(&wanted(&folder, &["bones.ply", "liver.ply"])).expect("splats");
        let mut state = start.state;
        state.files.splats = ["bones.ply", "liver.ply"].map(PathBuf::from).to_vec();
        state.transfer = Transfer::new(&transfer::load("CT-Lung", [-1000.0, 2000.0]).expect("a preset"));
        state.objects[1].visible = false;
        // A headset shows nothing beside them, and does not even read it.
        (state.files.beside, state.shown) = (Some("coarse.vgs".into()), Subject::Beside);
        state.clip.planes.push(view::model::state::Plane { on: true, normal: DVec3::X, offset_mm: 4.0 });
        state.write(folder.path().join("s.toml"), false).expect("a session");
        let session = wanted(&folder, &["s.toml"]);
        let (content, start) = read(&session).expect("a session");
        assert_eq!((start.state.transfer.name.as_str(), start.state.clip.planes.len()), ("CT-Lung", 1));
        assert!(start.state.objects[0].visible && !start.state.objects[1].visible);
        assert!(matches!(content, Content::Splats(_)));
        let other = Wanted { tf: Some("CT-Bone".into()), ..session };
        assert_eq!(read(&other).expect("a session").1.state.transfer.name, "CT-Bone");
    }

    #[test]
    fn what_a_session_has_deleted_is_left_out() {
        let folder = folder();
        let (_, start) = read(&wanted(&folder, &["bones.ply", "liver.ply"])).expect("splats");
        let mut state = start.state;
        state.files.splats = ["bones.ply", "liver.ply"].map(PathBuf::from).to_vec();
        let object = |file| Deletion::Object(view::model::deletions::Target { file, label: None });
        state.deleted = vec![object(0)];
        state.write(folder.path().join("s.toml"), false).expect("a session");
        let (content, mut start) = read(&wanted(&folder, &["s.toml"])).expect("a session");
        let Content::Splats(splats) = content else { panic!("splats") };
        let rest = left(splats, &start.state.deleted).expect("the liver");
        assert_eq!(rest.set.splats.len(), 3);
        assert!(rest.set.splats.iter().all(|splat| splat.intensity == 509.0));
        start.state.deleted.push(object(1));
        let error = left(rest, &start.state.deleted).err().expect("nothing is left");
        assert!(error.code == "VGS-XR-030" && error.help.contains("restore"), "{error}");
    }

    #[test]
    fn a_volume_is_shown_where_there_are_no_splats() {
        let folder = folder();
        let (content, start) = read(&wanted(&folder, &["ct.nii", "mask.nii"])).expect("a volume");
        assert!(matches!(content, Content::Volume(volume) if volume.roi.is_some()));
        assert!(start.state.objects.is_empty() && start.range == [-20.0, 99.0]);
        let ct = Some(folder.path().join("ct.nii"));
        let beside = Wanted { volume: ct, ..wanted(&folder, &["bones.ply"]) };
        assert!(matches!(read(&beside).expect("splats").0, Content::Splats(_)));
        let roi = Wanted { roi: Some(folder.path().join("mask.nii")), ..wanted(&folder, &["bones.ply"]) };
        assert_eq!(read(&roi).err().map(|e| e.code), Some("VGS-XR-029"));
        assert_eq!(read(&Wanted::default()).err().map(|e| e.code), Some("VGS-XR-030"));
    }
}
