//! The readers that are fuzzed.

use std::path::Path;

use engine::fit::{FitConfig, FitState};
use engine::render::CameraFile;
use engine::splat::{ReadOptions as SplatOptions, read_unplaced};
use engine::volume::{ReadOptions, Volume};
use engine::{Error, Kind, Result, image, transfer};
use view::state::ViewState;

use crate::seeds;

/// Bytes that a volume may take here; a larger claim is refused.
const VOLUME_BYTES: u64 = 32 << 20;

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
    /// Reads a file.
    pub read: fn(&Path) -> Result<()>,
}

/// All readers.
pub const TARGETS: &[Target] = &[
    Target { name: "nifti", extension: "nii", seeds: seeds::nifti, mend: as_it_is, read: volume },
    Target { name: "nrrd", extension: "nrrd", seeds: seeds::nrrd, mend: as_it_is, read: volume },
    Target { name: "metaimage", extension: "mha", seeds: seeds::metaimage, mend: as_it_is, read: volume },
    Target { name: "npy", extension: "npy", seeds: seeds::npy, mend: as_it_is, read: volume },
    Target { name: "inv3", extension: "inv3", seeds: seeds::inv3, mend: as_it_is, read: volume },
    Target { name: "dicom", extension: "dcm", seeds: seeds::dicom, mend: as_it_is, read: volume },
    Target { name: "ply", extension: "ply", seeds: seeds::ply, mend: as_it_is, read: splats },
    Target {
        name: "transfer",
        extension: "json",
        seeds: seeds::transfer,
        mend: as_it_is,
        read: transfer_function,
    },
    Target { name: "picture", extension: "png", seeds: seeds::pictures, mend: as_it_is, read: picture },
    Target { name: "state", extension: "state", seeds: seeds::state, mend: sum_again, read: fit_state },
    Target { name: "config", extension: "toml", seeds: config_seeds, mend: as_it_is, read: config },
    Target { name: "session", extension: "toml", seeds: session_seeds, mend: as_it_is, read: session },
    Target { name: "camera", extension: "json", seeds: camera_seeds, mend: as_it_is, read: camera },
];

fn volume(path: &Path) -> Result<()> {
    let options = ReadOptions { max_bytes: VOLUME_BYTES, ..ReadOptions::default() };
    let strict = Volume::read(path, &options).map(drop);
    // What is refused may still be read by the lenient way, which must be as safe.
    if strict.is_err() {
        let _ = Volume::read(path, &ReadOptions { lenient: true, volume_index: Some(0), ..options });
    }
    strict
}

fn splats(path: &Path) -> Result<()> {
    let _ = engine::splat::describe(path, &SplatOptions { strict: true, ..SplatOptions::default() });
    read_unplaced(path, &SplatOptions::default()).map(drop)
}

fn transfer_function(path: &Path) -> Result<()> {
    transfer::read(path, None, [-1000.0, 2000.0]).map(drop)
}

fn picture(path: &Path) -> Result<()> {
    image::read(path).map(drop)
}

fn fit_state(path: &Path) -> Result<()> {
    FitState::read(path).map(drop)
}

fn as_it_is(bytes: &[u8]) -> Vec<u8> {
    bytes.to_vec()
}

fn sum_again(bytes: &[u8]) -> Vec<u8> {
    seeds::summed(&bytes[..bytes.len().saturating_sub(4)])
}

fn text(path: &Path) -> Result<String> {
    let bytes = std::fs::read(path).map_err(|e| Error::io(path, "reading", &e))?;
    String::from_utf8(bytes).map_err(|_| bad("not UTF-8"))
}

fn bad(message: impl ToString) -> Error {
    Error::new(Kind::BadData, "VGS-FUZ-001", message.to_string())
}

fn config(path: &Path) -> Result<()> {
    let config: FitConfig = toml::from_str(&text(path)?).map_err(bad)?;
    config.check()
}

fn config_seeds() -> Vec<Vec<u8>> {
    vec![toml::to_string(&FitConfig::default()).expect("a configuration is TOML").into_bytes()]
}

fn session(path: &Path) -> Result<()> {
    ViewState::read(path).map(drop)
}

fn session_seeds() -> Vec<Vec<u8>> {
    let function = transfer::preset(transfer::PRESETS[0].name).expect("a preset").over([-1000.0, 2000.0]);
    vec![ViewState::new(&function).text().expect("a session is TOML").into_bytes()]
}

fn camera(path: &Path) -> Result<()> {
    let file: CameraFile = serde_json::from_str(&text(path)?).map_err(bad)?;
    file.camera(1.0).map(drop)
}

fn camera_seeds() -> Vec<Vec<u8>> {
    vec![br#"{"eye_mm": [0, -300, 20], "target_mm": [0, 0, 0], "up": [0, 0, 1], "fov_deg": 30}"#.to_vec()]
}
