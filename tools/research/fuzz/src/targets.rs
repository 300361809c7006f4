//! The readers that are fuzzed.

use std::io::{Cursor, Read};
use std::sync::LazyLock;

use engine::bake::BakeState;
use engine::fit::{FitConfig, FitState};
use engine::input::Input;
use engine::render::CameraFile;
use engine::splat::{ReadOptions as SplatOptions, read_unplaced};
use engine::volume::{LabelChoice, ReadOptions, Roi, Volume};
use engine::{Error, Kind, Result, image, transfer};
use view::Settings;
use view::model::state::ViewState;

use crate::seeds::{self, BETWEEN, STORE, dicom, splats};

/// Bytes that a volume may take here; a larger claim is refused.
pub const VOLUME_BYTES: u64 = 32 << 20;

/// A reader.
pub struct Target {
    /// Name, by which the command line chooses it.
    pub name: &'static str,
    /// Extension of its files.
    pub extension: &'static str,
    /// Returns valid files.
    pub seeds: fn() -> Vec<Vec<u8>>,
    /// Makes the last change of a mutated file, such as a checksum that is right.
    pub mend: fn(&[u8]) -> Vec<u8>,
    /// Name of a file with voxels beside the file.
    pub beside: Option<&'static str>,
    /// True if the file is read from memory, and nothing of it is on disk.
    pub in_memory: bool,
    /// Reads a file.
    pub read: fn(&Input) -> Result<()>,
}

/// Returns a reader of files on disk that need nothing but themselves.
const fn reader(
    name: &'static str,
    extension: &'static str,
    seeds: fn() -> Vec<Vec<u8>>,
    read: fn(&Input) -> Result<()>,
) -> Target {
    Target { name, extension, seeds, mend: as_it_is, beside: None, in_memory: false, read }
}

/// Returns a reader of such files in memory.
const fn in_memory(
    name: &'static str,
    extension: &'static str,
    seeds: fn() -> Vec<Vec<u8>>,
    read: fn(&Input) -> Result<()>,
) -> Target {
    Target { in_memory: true, ..reader(name, extension, seeds, read) }
}

/// All readers.
pub const TARGETS: &[Target] = &[
    in_memory("nifti", "nii", seeds::nifti, volume),
    Target { beside: Some("file.img"), ..reader("nifti-pair", "hdr", seeds::nifti_pair, volume) },
    Target { beside: Some("beside.raw"), ..reader("nrrd", "nrrd", seeds::nrrd, volume) },
    Target { beside: Some("beside.raw"), ..reader("metaimage", "mha", seeds::metaimage, volume) },
    in_memory("npy", "npy", seeds::npy, volume),
    in_memory("inv3", "inv3", seeds::inv3, volume),
    reader("dicom", "dcm", dicom::slice, volume),
    in_memory("zarr", "store", seeds::zarr, store),
    in_memory("dicom-zip", "zip", dicom::zip, volume),
    reader("dicom-seg", "dcm", dicom::segmentation, mask),
    reader("rtstruct", "dcm", dicom::contours, mask),
    in_memory("ply", "ply", splats::ply, splat_set),
    in_memory("ply-colours", "ply", splats::ply_colours, splat_set),
    in_memory("ply-reference", "ply", splats::ply_reference, splat_set),
    Target { mend: splats::vgs_sums, ..in_memory("vgs", "vgs", splats::vgs, splat_set) },
    Target { mend: splats::spz_sums, ..in_memory("spz", "spz", splats::spz, splat_set) },
    Target { mend: splats::sog_sums, ..in_memory("sog", "sog", splats::sog, splat_set) },
    in_memory("glb", "glb", splats::glb, splat_set),
    reader("vp-json", "json", seeds::vp_json, transfer_function),
    reader("vp", "vp", seeds::vp, transfer_function),
    reader("slicer-xml", "xml", seeds::slicer_xml, transfer_function),
    reader("paraview", "json", seeds::paraview, transfer_function),
    Target { mend: seeds::png_sums, ..reader("png", "png", seeds::png, picture) },
    reader("exr", "exr", seeds::exr, picture),
    Target { mend: seeds::state_sum, ..reader("state", "state", seeds::state, fit_state) },
    Target { mend: seeds::state_sum, ..reader("bake-state", "state", seeds::bake_state, bake_state) },
    reader("config", "toml", config_seeds, config),
    reader("session", "toml", session_seeds, session),
    reader("settings", "toml", settings_seeds, settings),
    reader("camera", "json", camera_seeds, camera),
];

fn volume(input: &Input) -> Result<()> {
    let options = ReadOptions { max_bytes: VOLUME_BYTES, ..ReadOptions::default() };
    let strict = Volume::read(input, &options).map(drop);
    // What is refused may still be read by the lenient way, which must be as safe.
    if strict.is_err() {
        let _ = Volume::read(input, &ReadOptions { lenient: true, volume_index: Some(0), ..options });
    }
    strict
}

/// Reads the files of a store, which are in one, as a zip of them.
fn store(input: &Input) -> Result<()> {
    let mut bytes = Vec::new();
    let read = input.open().and_then(|mut stream| stream.read_to_end(&mut bytes));
    read.map_err(|e| Error::io(input.name(), "reading", &e))?;
    let at: Vec<usize> = bytes
        .windows(BETWEEN.len())
        .enumerate()
        .filter(|(_, w)| *w == BETWEEN)
        .map(|(i, _)| i)
        .take(2)
        .collect();
    let mut files = Vec::new();
    let mut start = 0;
    for (name, end) in STORE.into_iter().zip(at.into_iter().chain([bytes.len()])) {
        files.push((name.to_owned(), bytes.get(start..end).unwrap_or_default().to_vec()));
        start = end + BETWEEN.len();
    }
    volume(&Input::of(Cursor::new(dicom::zipped(&files, zip::CompressionMethod::Stored)), "a.zarr.zip"))
}

/// The volume that masks are read for.
static SCAN: LazyLock<Volume> = LazyLock::new(|| {
    let samples = (0..24).map(|i| i as f32).collect();
    Volume::new([4, 3, 2], dicom::world_from_voxel(), samples)
});

fn mask(input: &Input) -> Result<()> {
    let options = ReadOptions { max_bytes: VOLUME_BYTES, ..ReadOptions::default() };
    let labels = LabelChoice::Labels(vec!["1".into()]);
    let whole = Volume::read_mask(input, &options, &LabelChoice::Whole, &SCAN);
    let chosen = Volume::read_mask(input, &options, &labels, &SCAN)?;
    let _ = Roi::from_mask(&chosen, &labels, &SCAN);
    whole.map(drop)
}

fn splat_set(input: &Input) -> Result<()> {
    let _ = engine::splat::describe(input, &SplatOptions { strict: true, ..SplatOptions::default() });
    read_unplaced(input, &SplatOptions::default())?.placed(Some(&splats::place())).map(drop)
}

fn transfer_function(input: &Input) -> Result<()> {
    transfer::read(input.name(), None, [-1000.0, 2000.0]).map(drop)
}

fn picture(input: &Input) -> Result<()> {
    image::read(input.name()).map(drop)
}

fn bake_state(input: &Input) -> Result<()> {
    BakeState::read(input.name()).map(drop)
}

fn fit_state(input: &Input) -> Result<()> {
    FitState::read(input.name()).map(drop)
}

fn as_it_is(bytes: &[u8]) -> Vec<u8> {
    bytes.to_vec()
}

fn text(input: &Input) -> Result<String> {
    let bytes = std::fs::read(input.name()).map_err(|e| Error::io(input.name(), "reading", &e))?;
    String::from_utf8(bytes).map_err(|_| bad("not UTF-8"))
}

fn bad(message: impl ToString) -> Error {
    Error::new(Kind::BadData, "VGS-FUZ-001", message.to_string())
}

fn config(input: &Input) -> Result<()> {
    let config: FitConfig = toml::from_str(&text(input)?).map_err(bad)?;
    config.check()
}

fn config_seeds() -> Vec<Vec<u8>> {
    vec![toml::to_string(&FitConfig::default()).expect("a configuration is TOML").into_bytes()]
}

fn session(input: &Input) -> Result<()> {
    ViewState::read(input.name()).map(drop)
}

fn session_seeds() -> Vec<Vec<u8>> {
    let function = transfer::preset(transfer::PRESETS[0].name).expect("a preset").over([-1000.0, 2000.0]);
    vec![ViewState::new(&function).text().expect("a session is TOML").into_bytes()]
}

fn settings(input: &Input) -> Result<()> {
    Settings::read(Some(input.name().to_owned())).map(drop)
}

fn settings_seeds() -> Vec<Vec<u8>> {
    vec![b"notice_seen = true\nrecent = [\"/home/a/b.ply\", \"c.vgs\"]\n".to_vec()]
}

fn camera(input: &Input) -> Result<()> {
    let file: CameraFile = serde_json::from_str(&text(input)?).map_err(bad)?;
    file.camera(1.0).map(drop)
}

fn camera_seeds() -> Vec<Vec<u8>> {
    vec![br#"{"eye_mm": [0, -300, 20], "target_mm": [0, 0, 0], "up": [0, 0, 1], "fov_deg": 30}"#.to_vec()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_format_of_a_file_is_fuzzed() {
        let fuzzed =
            |ending: &str| TARGETS.iter().any(|target| ending.rsplit('.').next() == Some(target.extension));
        for format in engine::volume::FORMATS {
            assert!(format.extensions.iter().any(|ending| fuzzed(ending)), "{} has no target", format.name);
        }
        let splats = engine::splat::FORMATS.iter().map(|format| format.name);
        let pictures = image::file::FORMATS.iter().map(|format| format.name);
        for name in splats.chain(pictures) {
            assert!(fuzzed(name), "{name} has no target");
        }
        for format in transfer::FORMATS {
            assert!(format.extensions.iter().any(|ending| fuzzed(ending)), "{} has no target", format.name);
        }
    }
}
