//! Packs a session with all of its files into one zip, which can be sent and opened as it is.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use engine::error::{Error, Kind, Result};
use engine::volume::{Format, ReadOptions, dicom, files_of};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

use crate::model::state::{Copy, Files, ViewState, copy};

/// Endings of files that are packed already.
const PACKED: [&str; 6] = ["gz", "zip", "vgs", "spz", "sog", "inv3"];
/// Size from which a file needs the long form of a zip's numbers, bytes.
const LONG: u64 = u32::MAX as u64;
/// How hard it is packed: more takes several times as long for a few percent.
const LEVEL: i64 = 3;

/// What was packed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Contents {
    /// Number of files, without the session.
    pub files: usize,
    /// Their size, bytes.
    pub bytes: u64,
    /// True if there are DICOM files, which name the patient.
    pub has_dicom: bool,
}

/// Writes a session with all of its files as a zip. The same files make the same bytes. Of a DICOM folder the files
/// of the series that is shown are packed. `progress` is called with the part that is done.
///
/// # Errors
/// Returns [`Kind::Missing`] with the files that are not there, [`Kind::Usage`] for a name that does not end in
/// `.zip`, and the errors of the readers and of [`engine::output::write_atomic`].
pub fn pack(state: &ViewState, path: &Path, force: bool, progress: &mut dyn FnMut(f32)) -> Result<Contents> {
    if path.extension().is_none_or(|end| !end.eq_ignore_ascii_case("zip")) {
        let message = "a packed session is a .zip";
        return Err(Error::new(Kind::Usage, "VGS-VIEW-051", message).file(path).help("end its name in .zip"));
    }
    let missing = state.files.missing();
    if let Some(first) = missing.first() {
        let names: Vec<_> = missing.iter().map(|path| path.display().to_string()).collect();
        return Err(Error::new(Kind::Missing, "VGS-VIEW-052", "not all files of the session are there")
            .file(first)
            .help(format!(
                "missing: {}. Open the session in the window to say where they are",
                names.join(", ")
            )));
    }
    let mut plan = Plan::default();
    let files = plan.files(&state.files)?;
    let text = ViewState { files, ..state.clone() }.text()?;
    let session = path.file_stem().unwrap_or_default().to_string_lossy();
    let size = |path: &PathBuf| {
        std::fs::metadata(path).map(|meta| meta.len()).map_err(|e| Error::io(path, "packing", &e))
    };
    let sizes = plan.entries.iter().map(|(_, path)| size(path)).collect::<Result<Vec<_>>>()?;
    let all: u64 = sizes.iter().sum();
    let mut unread = None;
    let written = engine::output::write_atomic(path, force, |out| {
        let mut zip = ZipWriter::new_stream(out);
        zip.start_file(format!("{session}.toml"), options(CompressionMethod::Deflated, 0))?;
        zip.write_all(text.as_bytes())?;
        let mut done = 0;
        for ((name, path), &size) in plan.entries.iter().zip(&sizes) {
            progress(done as f32 / all.max(1) as f32);
            zip.start_file(name, options(method(path), size))?;
            copy_file(path, &mut zip, size).map_err(|e| match e {
                Copy::Read(e) => {
                    unread = Some(Error::io(path, "packing", &e));
                    io::Error::other("a file could not be read")
                }
                Copy::Write(e) => e,
            })?;
            done += size;
        }
        zip.finish()?.into_inner().flush()
    });
    unread.map_or(written, Err)?;
    Ok(Contents { files: sizes.len(), bytes: all, has_dicom: plan.has_dicom })
}

fn method(path: &Path) -> CompressionMethod {
    let is_packed =
        path.extension().is_some_and(|end| PACKED.iter().any(|known| end.eq_ignore_ascii_case(known)));
    if is_packed { CompressionMethod::Stored } else { CompressionMethod::Deflated }
}

/// Returns the options of a file, which have no time and no owner: these would differ from one packing to the next.
fn options(method: CompressionMethod, size: u64) -> SimpleFileOptions {
    let level = (method == CompressionMethod::Deflated).then_some(LEVEL);
    SimpleFileOptions::default()
        .compression_method(method)
        .compression_level(level)
        .last_modified_time(DateTime::default())
        .unix_permissions(0o644)
        .large_file(size >= LONG)
}

/// Copies a file of this size.
fn copy_file(path: &Path, to: &mut impl Write, size: u64) -> std::result::Result<(), Copy> {
    let mut file = File::open(path).map_err(Copy::Read)?;
    let count = copy(&mut file, to)?;
    if count == size { Ok(()) } else { Err(Copy::Read(io::Error::other("it changed in the meantime"))) }
}

/// What goes into the zip, in this order.
#[derive(Default)]
struct Plan {
    /// Names in the zip, with the files.
    entries: Vec<(String, PathBuf)>,
    /// Names that are taken, in lower case: the zip may be unpacked where case does not count.
    taken: BTreeSet<String>,
    has_dicom: bool,
}

impl Plan {
    /// Adds all files of a session; returns them with their paths in the zip.
    fn files(&mut self, from: &Files) -> Result<Files> {
        let mut files = Files { unpacked: Vec::new(), ..from.clone() };
        files.splats = from.splats.iter().map(|path| self.add(path, vec![path.clone()])).collect();
        files.beside = from.beside.as_ref().map(|path| self.add(path, vec![path.clone()]));
        if let Some(path) = &from.volume {
            let (place, series) = self.volume(path, from.series.clone())?;
            (files.volume, files.series) = (Some(place), series);
        }
        if let Some(path) = &from.roi {
            files.roi = Some(self.volume(path, None)?.0);
        }
        Ok(files)
    }

    /// Adds a volume or a mask with all that belongs to it; returns its path in the zip and the key of its series.
    fn volume(&mut self, path: &Path, series: Option<String>) -> Result<(PathBuf, Option<String>)> {
        let options = ReadOptions { series: series.clone(), ..ReadOptions::default() };
        let format = Format::of(path, &options)?.name;
        if ![dicom::NAME, dicom::ZIP_NAME].contains(&format) {
            return Ok((self.add(path, files_of(path)), series));
        }
        self.has_dicom = true;
        let found = dicom::series_files(path, &options)?;
        let files = if format == dicom::ZIP_NAME { vec![path.to_owned()] } else { found.files };
        // A series that is alone needs no name.
        let key = found.key.filter(|_| series.is_some());
        Ok((self.add(path, files), key))
    }

    /// Adds the files that make up one; returns its path in the zip.
    fn add(&mut self, path: &Path, files: Vec<PathBuf>) -> PathBuf {
        let known = |(_, file): &&(String, PathBuf)| file == path;
        if let Some((name, _)) = self.entries.iter().find(known) {
            return name.into();
        }
        let is_folder = path.is_dir();
        let root = if is_folder { path } else { path.parent().unwrap_or(Path::new("")) };
        // A folder keeps its name, so that one sees what it is; so does that of a slice of many.
        let own = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let of_slices = root.file_name().map_or("slices".into(), |name| name.to_string_lossy().into_owned());
        let folder = match (is_folder, files.len() > 2) {
            (true, _) if own.is_empty() => Some("slices".to_owned()),
            (true, _) => Some(own.clone()),
            (false, true) => Some(of_slices),
            (false, false) => None,
        };
        let inner = |file: &Path| {
            let rest = file
                .strip_prefix(root)
                .ok()
                .map_or(PathBuf::from(file.file_name().unwrap_or_default()), Path::to_owned);
            let parts: Vec<_> = rest.components().map(|part| part.as_os_str().to_string_lossy()).collect();
            parts.join("/")
        };
        let place = |number: usize, inner: &str| {
            let number = (number > 1).then(|| number.to_string());
            let parts = number
                .as_deref()
                .into_iter()
                .chain(folder.as_deref())
                .chain(Some(inner).filter(|i| !i.is_empty()));
            parts.collect::<Vec<_>>().join("/")
        };
        let is_free = |number: &usize| {
            let whole = place(*number, "").to_lowercase();
            let free = |name: &str| !self.taken.contains(name);
            (folder.is_none() || free(&whole))
                && files.iter().all(|file| free(&place(*number, &inner(file)).to_lowercase()))
        };
        let number = (1..).find(is_free).unwrap_or(1);
        if folder.is_some() {
            self.taken.insert(place(number, "").to_lowercase());
        }
        for file in &files {
            let name = place(number, &inner(file));
            self.taken.insert(name.to_lowercase());
            self.entries.push((name, file.clone()));
        }
        PathBuf::from(place(number, if is_folder { "" } else { &own }))
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use engine::transfer::PRESETS;

    use super::*;
    use crate::model::state::{Object, Unpacked, is_packed, is_session};

    fn state(files: Files) -> ViewState {
        ViewState { files, ..ViewState::new(&PRESETS[0].over([-1000.0, 2000.0])) }
    }

    fn volume(path: &Path) {
        let volume = engine::volume::Volume::new(
            [4, 5, 6],
            glam::DAffine3::IDENTITY,
            (0..120).map(|i| i as f32).collect(),
        );
        engine::volume::nifti::write(path, &volume, false).expect("a volume");
    }

    /// Returns a session with two files of one name, a volume that is its own mask, and the folder of all.
    fn case() -> (tempfile::TempDir, ViewState) {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at("other")).expect("a folder");
        fs::write(at("bones.ply"), "the first").expect("a file");
        fs::write(at("other/Bones.ply"), "the second").expect("a file");
        volume(&at("ct.nii"));
        let splats = vec![at("bones.ply"), at("other/Bones.ply")];
        let ct = Some(at("ct.nii"));
        let mut state = state(Files { splats, volume: ct.clone(), roi: ct, ..Files::default() });
        state.objects = vec![Object::new(0, None, "bones"), Object::new(1, None, "other")];
        (folder, state)
    }

    #[test]
    fn a_packed_session_opens_as_it_is_and_after_unpacking() {
        let (folder, state) = case();
        let zip = folder.path().join("case.zip");
        let mut parts = Vec::new();
        let contents = pack(&state, &zip, false, &mut |part| parts.push(part)).expect("packed");
        let bytes =
            state.files.splats.iter().chain(&state.files.volume).map(|p| fs::metadata(p).unwrap().len());
        assert_eq!(contents, Contents { files: 3, bytes: bytes.sum(), has_dicom: false });
        assert!(parts.is_sorted() && parts.len() == 3, "{parts:?}");
        assert!(is_packed(&zip) && is_session(&zip) && !is_packed(&folder.path().join("ct.nii")));

        // It does not need the files that it was made of.
        let elsewhere = tempfile::tempdir().expect("a folder");
        let moved = elsewhere.path().join("sent.zip");
        fs::rename(&zip, &moved).expect("moved");
        drop(folder);
        let read = ViewState::read(&moved).expect("opened");
        let texts: Vec<_> =
            read.files.splats.iter().map(|path| fs::read_to_string(path).expect("a file")).collect();
        assert_eq!(texts, ["the first", "the second"]);
        assert!(read.files.missing().is_empty() && read.files.roi == read.files.volume);
        assert_eq!((&read.objects, &read.transfer), (&state.objects, &state.transfer));
        // What was unpacked goes with the last copy.
        let place = read.files.unpacked[0].folder().to_owned();
        let copy = read.files.clone();
        // A session that is saved beside the zip names what is in it.
        let saved = elsewhere.path().join("again.toml");
        read.write(&saved, false).expect("written");
        let text = fs::read_to_string(&saved).expect("a session");
        assert!(text.contains("\"sent.zip/bones.ply\"") && !text.contains("vgs-session"), "{text}");
        drop(read);
        assert!(place.is_dir());
        drop(copy);
        assert!(!place.exists(), "no patient's data stay behind");
        let again = ViewState::read(&saved).expect("opened");
        assert_eq!(fs::read_to_string(&again.files.splats[1]).expect("a file"), "the second");
        // Packed once more it is the same, and so is its unpacked content.
        let twice = elsewhere.path().join("case.zip");
        pack(&again, &twice, false, &mut |_| {}).expect("packed");
        let unpacked = Unpacked::of(&twice).expect("unpacked");
        let plain = ViewState::read(unpacked.session()).expect("after unpacking");
        assert!(plain.files.missing().is_empty() && plain.files.unpacked.is_empty());
        assert_eq!(plain.files.splats[0], unpacked.folder().join("bones.ply"));
    }

    #[test]
    fn the_same_files_make_the_same_bytes() {
        let (folder, state) = case();
        let bytes = |name: &str| {
            let path = folder.path().join(name);
            pack(&state, &path, false, &mut |_| {}).expect("packed");
            fs::read(path).expect("a zip")
        };
        fs::create_dir(folder.path().join("later")).expect("a folder");
        let first = bytes("case.zip");
        std::thread::sleep(std::time::Duration::from_millis(1100));
        let times = fs::FileTimes::new().set_modified(std::time::SystemTime::now());
        File::open(folder.path().join("ct.nii"))
            .and_then(|file| file.set_times(times))
            .expect("a later time");
        assert!(first == bytes("later/case.zip"));
    }

    #[test]
    fn a_header_brings_its_voxels_along() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        let head = "NRRD0004\ntype: short\ndimension: 3\nsizes: 2 2 2\nencoding: raw\nendian: little\n\
                    data file: deep/voxels.raw\n";
        fs::write(at("ct.nhdr"), head).expect("a header");
        fs::create_dir(at("deep")).expect("a folder");
        fs::write(at("deep/voxels.raw"), [1_u8; 16]).expect("voxels");
        let state = state(Files { volume: Some(at("ct.nhdr")), ..Files::default() });
        let contents = pack(&state, &at("case.zip"), false, &mut |_| {}).expect("packed");
        assert_eq!(contents.files, 2);
        fs::remove_dir_all(at("deep")).expect("gone");
        let read = ViewState::read(at("case.zip")).expect("opened");
        let path = read.files.volume.clone().expect("a volume");
        assert_eq!(
            engine::volume::Volume::read(path, &ReadOptions::default()).expect("read").samples,
            [257.0; 8]
        );
    }

    #[test]
    fn what_is_missing_or_damaged_is_named() {
        let (folder, mut state) = case();
        let at = |name: &str| folder.path().join(name);
        state.files.splats.push(at("none.ply"));
        let error = pack(&state, &at("case.zip"), false, &mut |_| {}).expect_err("missing");
        assert_eq!(
            (error.code, error.kind, error.file),
            ("VGS-VIEW-052", Kind::Missing, Some(at("none.ply")))
        );
        state.files.splats.pop();
        let error = pack(&state, &at("case.tar"), false, &mut |_| {}).expect_err("no zip");
        assert_eq!(error.code, "VGS-VIEW-051");
        pack(&state, &at("case.zip"), false, &mut |_| {}).expect("packed");
        let error = pack(&state, &at("case.zip"), false, &mut |_| {}).expect_err("it exists");
        assert_eq!(error.code, "VGS-OUT-001");
        // A byte of a file's content is another one.
        let mut bytes = fs::read(at("case.zip")).expect("a zip");
        let place = bytes.windows(6).position(|w| w == b"ct.nii").expect("an entry") + 40;
        bytes[place] ^= 0x55;
        fs::write(at("bad.zip"), &bytes).expect("a zip");
        let error = ViewState::read(at("bad.zip")).expect_err("damaged");
        assert_eq!((error.code, error.kind), ("VGS-VIEW-050", Kind::BadData), "{error}");
        // A file that would lie outside.
        let mut zip = ZipWriter::new(File::create(at("out.zip")).expect("a zip"));
        for name in ["s.toml", "../out.ply"] {
            zip.start_file(name, options(CompressionMethod::Stored, 0)).expect("an entry");
            zip.write_all(b"x").expect("written");
        }
        zip.finish().expect("a zip");
        let error = ViewState::read(at("out.zip")).expect_err("outside");
        assert!(error.code == "VGS-VIEW-050" && error.message.contains("out.ply"), "{error}");
        assert!(!at("../out.ply").exists());
        // A zip of slices is no session.
        let mut zip = ZipWriter::new(File::create(at("scan.zip")).expect("a zip"));
        zip.start_file("IM1", options(CompressionMethod::Stored, 0)).expect("an entry");
        zip.finish().expect("a zip");
        assert!(!is_session(&at("scan.zip")));
    }
}
