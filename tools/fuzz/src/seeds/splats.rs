//! Splats: PLY of this project, with colours, in the layout of the paper's authors, and `.vgs`.

use std::path::Path;

use engine::splat::{
    self, Exception, Field, Form, Grid, Harmonics, PLY_LAYOUTS, Place, PlyLayout, Splat, SplatSet,
};
use engine::unit::Unit;
use flate2::Crc;
use glam::{DAffine3, DVec3};
use serde::Deserialize;

use super::written;

/// The place that a volume gives to splats in the layout of the paper's authors.
pub fn place() -> Place {
    let world_from_voxel = DAffine3::from_scale(DVec3::new(1.0, 1.5, 2.0));
    Place { size: [8; 3], world_from_voxel, range: [-1000.0, 2000.0], region_range: Some([0.0, 400.0]) }
}

/// Returns a set with all that a set of intensities can have.
fn set() -> SplatSet {
    let splats: Vec<Splat> = (0..5)
        .map(|i| Splat {
            mean: [i as f32, 1.0, 0.5],
            rotation: [1.0, 0.1 * i as f32, 0.0, 0.0],
            intensity: 100.0 * i as f32,
            ..Splat::default()
        })
        .collect();
    SplatSet {
        labels: Some(vec![0, 1, 1, 2, 0]),
        label_names: vec![(1, "liver".into()), (2, "spleen".into())],
        iterations: Some(100),
        grid: Some(Grid { size: [8, 8, 8], world_from_voxel: place().world_from_voxel }),
        form: Form::Grid { binary: true },
        exceptions: vec![Exception { voxel: [1, 2, 3], inside: true }],
        splats,
        ..SplatSet::default()
    }
}

/// Returns a PLY of the set in a layout.
fn in_layout(layout: &'static PlyLayout, set: &SplatSet) -> Vec<Vec<u8>> {
    let options = splat::WriteOptions { layout, place: Some(place()), force: true };
    written(&["a.ply"], |path| splat::write_as(path, set, &options))
}

/// PLY of this project, and one as text.
pub fn ply() -> Vec<Vec<u8>> {
    let names = "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3";
    let properties: String = names.split(' ').map(|name| format!("property float {name}\n")).collect();
    let text = format!(
        "ply\nformat ascii 1.0\nelement vertex 2\n{properties}end_header\n{}",
        "0 1 2 0.5 0.5 0.5 1 -1 -1 -1 1 0 0 0\n".repeat(2)
    );
    [in_layout(&PLY_LAYOUTS[0], &set()), vec![text.into_bytes()]].concat()
}

/// PLY of ordinary 3D Gaussian splatting, with colours up to each degree.
pub fn ply_colours() -> Vec<Vec<u8>> {
    let colours = |degree: u8| {
        let floats = 3 * (usize::from(degree) + 1).pow(2) * set().splats.len();
        let coefficients = (0..floats).map(|i| (i as f32 * 0.37).sin()).collect();
        SplatSet {
            colours: Some(Harmonics { degree, coefficients }),
            unit: Unit::Luminance,
            splats: set().splats,
            ..SplatSet::default()
        }
    };
    (0..=3).flat_map(|degree| in_layout(&PLY_LAYOUTS[0], &colours(degree))).collect()
}

/// PLY in the layout of the paper's authors, as this project writes it and as they do: without comments.
pub fn ply_reference() -> Vec<Vec<u8>> {
    let layout = PlyLayout::named("reference").expect("a layout of that name");
    let kernel = layout.kernel.expect("a layout of one kernel");
    let ours = in_layout(layout, &SplatSet { field: Field { kernel, ..Field::default() }, ..set() });
    let bare = ours.iter().map(|file| without_comments(file)).collect();
    [ours, bare].concat()
}

fn without_comments(file: &[u8]) -> Vec<u8> {
    let end = b"end_header\n";
    let at = file.windows(end.len()).position(|window| window == end).expect("a header");
    let header = String::from_utf8_lossy(&file[..at]);
    let kept: String = header.split_inclusive('\n').filter(|line| !line.starts_with("comment")).collect();
    [kept.as_bytes(), &file[at..]].concat()
}

/// `.vgs` with labels and exceptions, with none, and with many splats.
pub fn vgs() -> Vec<Vec<u8>> {
    let origin_mm = DVec3::new(3.0, -7.0, 9.0);
    let bare = SplatSet { splats: set().splats, origin_mm, ..SplatSet::default() };
    // With more bytes of splats than of header.
    let many = SplatSet { splats: set().splats.repeat(60), origin_mm, ..SplatSet::default() };
    let write = |set: SplatSet| written(&["a.vgs"], move |path: &Path| splat::write(path, &set, true));
    [write(set()), write(bare), write(many)].concat()
}

/// What of the header of a `.vgs` file says where its parts are.
#[derive(Deserialize)]
struct Parts {
    layers: Vec<Part>,
    exceptions: Part,
}

#[derive(Deserialize)]
struct Part {
    bytes: u64,
}

/// Writes length and checksums of a changed `.vgs` file anew, of most files: every sixteenth keeps those it has.
pub fn vgs_sums(bytes: &[u8]) -> Vec<u8> {
    const START: usize = 20;
    let kept = || bytes.to_vec();
    if bytes.len() < START || crc(bytes).is_multiple_of(16) {
        return kept();
    }
    // The header ends with its last object, that of the exceptions.
    let key = b"\"exceptions\"";
    let Some(last) = bytes.windows(key.len()).position(|window| window == key) else { return kept() };
    let Some(end) = bytes[last..].windows(2).position(|pair| pair == b"}}").map(|at| last + at + 2) else {
        return kept();
    };
    let mut header = bytes[START.min(last)..end].to_vec();
    let mut rest = &bytes[end..];
    if let Ok(Parts { layers, exceptions }) = serde_json::from_slice::<Parts>(&header) {
        let key = b"\"crc32\":";
        let mut from = 0;
        for part in layers.iter().chain([&exceptions]) {
            let length = usize::try_from(part.bytes).unwrap_or(usize::MAX).min(rest.len());
            let (own, after) = rest.split_at(length);
            rest = after;
            let Some(at) = header[from..].windows(key.len()).position(|window| window == key) else { break };
            let begin = from + at + key.len();
            let digits = header[begin..].iter().take_while(|byte| byte.is_ascii_digit()).count();
            header.splice(begin..begin + digits, crc(own).to_string().into_bytes());
            from = begin;
        }
    }
    let mut out = bytes[..12].to_vec();
    out.extend((header.len() as u32).to_le_bytes());
    out.extend(crc(&header).to_le_bytes());
    out.extend(&header);
    out.extend(&bytes[end..]);
    out
}

fn crc(bytes: &[u8]) -> u32 {
    let mut crc = Crc::new();
    crc.update(bytes);
    crc.sum()
}
