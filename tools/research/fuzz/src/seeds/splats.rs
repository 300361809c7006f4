//! Splats: PLY of this project, with colours, in the layout of the paper's authors; `.vgs`, SPZ, SOG and glTF.

use std::io::{Cursor, Read};
use std::path::Path;

use engine::splat::{
    self, Field, Form, Grid, Harmonics, PLY_LAYOUTS, Place, PlyLayout, Region, Splat, SplatSet,
};
use engine::unit::Unit;
use engine::volume::{Roi, Volume};
use flate2::read::GzDecoder;
use glam::{DAffine3, DVec3};
use serde::Deserialize;
use zip::{CompressionMethod, ZipArchive};

use super::dicom::zipped;
use super::{crc, written};

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
        form: Form::Grid,
        region: Region::of([8; 3], |i| (i % 5 < 3).then_some((i / 100) as u8)),
        splats,
        ..SplatSet::default()
    }
}

/// Returns a PLY of the set in a layout.
fn in_layout(layout: &'static PlyLayout, set: &SplatSet) -> Vec<Vec<u8>> {
    let options =
        splat::WriteOptions { layout, place: Some(place()), force: true, made_of: None, live: None };
    written(&["a.ply"], |path| splat::write_as(path, set, &options))
}

/// PLY of Volume Encoding Gaussians: two splats in floats, and two of halves and codes.
fn encoding_volumes() -> Vec<Vec<u8>> {
    let names = "x y z opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3 scalar".split(' ');
    let properties = |places: &str, others: &str| -> String {
        let kind = |k: usize| if k < 3 { places } else { others };
        names.clone().enumerate().map(|(k, name)| format!("property {} {name}\n", kind(k))).collect()
    };
    let start = "ply\nformat binary_little_endian 1.0\nelement gaussians 2\n";
    let plain = format!("{start}{}end_header\n", properties("float", "float"));
    let codebook = "opacity scaling rotation_re rotation_im scalar".split(' ');
    let codebook: String = codebook.map(|name| format!("property short {name}\n")).collect();
    let coded = properties("short", "uchar");
    let coded = format!("{start}{coded}element codebook_centers 256\n{codebook}end_header\n");
    let floats: Vec<u8> = [0.5f32; 24].iter().flat_map(|v| v.to_le_bytes()).collect();
    // 1 as a float of 16 bits.
    let codes = [[0, 0x3c, 0, 0x3c, 0, 0x3c, 0, 1, 2, 3, 4, 5, 6, 7, 8].repeat(2), [0, 0x3c].repeat(5 * 256)]
        .concat();
    vec![[plain.into_bytes(), floats].concat(), [coded.into_bytes(), codes].concat()]
}

/// PLY of this project, one as text, and those of others.
pub fn ply() -> Vec<Vec<u8>> {
    let names = "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3";
    let properties: String = names.split(' ').map(|name| format!("property float {name}\n")).collect();
    let text = format!(
        "ply\nformat ascii 1.0\nelement vertex 2\n{properties}end_header\n{}",
        "0 1 2 0.5 0.5 0.5 1 -1 -1 -1 1 0 0 0\n".repeat(2)
    );
    [in_layout(&PLY_LAYOUTS[0], &set()), vec![text.into_bytes()], encoding_volumes()].concat()
}

/// Returns a set with colours up to a degree.
fn coloured(degree: u8) -> SplatSet {
    let floats = 3 * (usize::from(degree) + 1).pow(2) * set().splats.len();
    let coefficients = (0..floats).map(|i| (i as f32 * 0.37).sin()).collect();
    SplatSet {
        colours: Some(Harmonics { degree, coefficients }),
        unit: Unit::Luminance,
        splats: set().splats,
        ..SplatSet::default()
    }
}

/// PLY of ordinary 3D Gaussian splatting, with colours up to each degree.
pub fn ply_colours() -> Vec<Vec<u8>> {
    (0..=3).flat_map(|degree| in_layout(&PLY_LAYOUTS[0], &coloured(degree))).collect()
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

/// `.vgs` with labels and a region, with none, with many splats, and with coded voxels.
pub fn vgs() -> Vec<Vec<u8>> {
    let origin_mm = DVec3::new(3.0, -7.0, 9.0);
    let bare = SplatSet { splats: set().splats, origin_mm, ..SplatSet::default() };
    // With more bytes of splats than of header.
    let many = SplatSet { splats: set().splats.repeat(60), origin_mm, ..SplatSet::default() };
    let size = [9, 8, 40];
    let volume = Volume::new(size, DAffine3::IDENTITY, (0..2880).map(|i| ((i * i) % 97) as f32).collect());
    let weight = (0..2880).map(|i| f32::from(u8::from(i % 9 > 1 && i / 72 % 3 > 0))).collect();
    let roi = Roi::new(weight, &volume).expect("a region");
    let coded = engine::coded::coded(&volume, &roi, None, 3.0).expect("a set");
    let write = |set: SplatSet| written(&["a.vgs"], move |path: &Path| splat::write(path, &set, true));
    [write(set()), write(bare), write(many), write(coded)].concat()
}

/// SPZ of version 3, as it is written and so that its bytes can be changed, of version 4, and with a fit.
pub fn spz() -> Vec<Vec<u8>> {
    let of = |degree| written(&["a.spz"], move |path: &Path| splat::write(path, &coloured(degree), true));
    let live = written(&["a.spz"], |path: &Path| {
        let fit = set();
        splat::write_as(path, &coloured(1), &splat::WriteOptions { live: Some(&fit), ..Default::default() })
    });
    let written = [of(0), of(2)].concat();
    let content = |file: &Vec<u8>| {
        let mut content = Vec::new();
        GzDecoder::new(&file[..]).read_to_end(&mut content).expect("gzip");
        content
    };
    let contents: Vec<_> = written.iter().map(content).collect();
    let stored = contents.iter().map(|content| stored_gzip(content)).collect();
    [written, stored, contents.iter().map(|content| in_version_4(content)).collect(), live].concat()
}

/// Bytes before and behind the content of a file of [`stored_gzip`].
const BEFORE_STORED: usize = 15;
const BEHIND_STORED: usize = 8;

/// Returns a gzip file of one block that holds its content as it is (RFC 1951, RFC 1952).
fn stored_gzip(content: &[u8]) -> Vec<u8> {
    let length = content.len() as u16;
    let mut out = vec![0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 0xff, 1];
    out.extend(length.to_le_bytes());
    out.extend((!length).to_le_bytes());
    out.extend(content);
    out.extend(crc(content).to_le_bytes());
    out.extend((content.len() as u32).to_le_bytes());
    out
}

/// Writes length and checksum of a changed file of [`stored_gzip`] anew.
pub fn spz_sums(bytes: &[u8]) -> Vec<u8> {
    match bytes.len().checked_sub(BEHIND_STORED) {
        Some(end) if end > BEFORE_STORED && bytes.starts_with(&[0x1f, 0x8b]) && bytes[10] == 1 => {
            stored_gzip(&bytes[BEFORE_STORED..end])
        }
        _ => bytes.to_vec(),
    }
}

/// Returns the content of a file of version 3 in version 4, with a record of an extension. Its zstd frames have raw
/// blocks.
fn in_version_4(content: &[u8]) -> Vec<u8> {
    let (header, mut body) = content.split_at(16);
    let count = set().splats.len();
    let harmonics = (body.len() / count).saturating_sub(20);
    let mut streams = Vec::new();
    for width in [9, 1, 3, 3, 4, harmonics].into_iter().filter(|&width| width > 0) {
        let (section, rest) = body.split_at(width * count);
        body = rest;
        streams.push((section.len(), zstd_frame(section)));
    }
    let mut out = [&header[..4], &4u32.to_le_bytes(), &header[8..14], &[2, streams.len() as u8]].concat();
    let record = [0xadbe_0003u32, 4, 4].map(u32::to_le_bytes).concat();
    out.extend((32 + record.len() as u32).to_le_bytes());
    out.extend([0; 12]);
    out.extend(record);
    for (whole, packed) in &streams {
        out.extend((packed.len() as u64).to_le_bytes());
        out.extend((*whole as u64).to_le_bytes());
    }
    out.extend(streams.into_iter().flat_map(|(_, packed)| packed));
    out
}

/// Returns a zstd frame of one raw block (RFC 8878): a single segment with a size of four bytes.
fn zstd_frame(content: &[u8]) -> Vec<u8> {
    let size = content.len() as u32;
    let block = (size << 3 | 1).to_le_bytes();
    [&0xfd2f_b528u32.to_le_bytes()[..], &[0xa0], &size.to_le_bytes(), &block[..3], content].concat()
}

/// SOG of each degree, and with files that are packed in the zip.
pub fn sog() -> Vec<Vec<u8>> {
    let of = |degree| written(&["a.sog"], move |path: &Path| splat::write(path, &coloured(degree), true));
    let files: Vec<_> = (0..=3).flat_map(of).collect();
    let mut zip = ZipArchive::new(Cursor::new(&files[1])).expect("a zip");
    let names: Vec<String> = zip.file_names().flatten().map(|name| name.into_owned()).collect();
    let content = |name: String| {
        let mut content = Vec::new();
        zip.by_name(&name).expect("a file").read_to_end(&mut content).expect("its bytes");
        (name, content)
    };
    let contents: Vec<_> = names.into_iter().map(content).collect();
    [files, vec![zipped(&contents, CompressionMethod::Deflated)]].concat()
}

/// Writes the checksums of stored files of a changed zip anew, into the headers before them and into its directory.
pub fn sog_sums(bytes: &[u8]) -> Vec<u8> {
    let mut out = bytes.to_vec();
    let number = |out: &[u8], at: usize, bytes: usize| {
        let number =
            out.get(at..at + bytes)?.iter().rev().fold(0u64, |number, &b| number << 8 | u64::from(b));
        usize::try_from(number).ok()
    };
    let mut mended = |entry: usize| {
        let (size, local) = (number(&out, entry + 24, 4)?, number(&out, entry + 42, 4)?);
        let content = local + 30 + number(&out, local + 26, 2)? + number(&out, local + 28, 2)?;
        let sum = crc(bytes.get(content..content.checked_add(size)?)?).to_le_bytes();
        for at in [entry + 16, local + 14] {
            out.get_mut(at..at + 4)?.copy_from_slice(&sum);
        }
        Some(())
    };
    let entries = bytes.windows(4).enumerate().filter(|(_, window)| *window == b"PK\x01\x02");
    for (entry, _) in entries {
        // What points out of the file stays as it is.
        let _ = mended(entry);
    }
    out
}

/// Binary glTF: of colours, and of colours that were made of intensities.
pub fn glb() -> Vec<Vec<u8>> {
    let bare = written(&["a.glb"], |path: &Path| splat::write(path, &coloured(1), true));
    let both = written(&["a.glb"], |path: &Path| {
        let made_of = set();
        let options = splat::WriteOptions { made_of: Some(&made_of), ..splat::WriteOptions::default() };
        splat::write_as(path, &SplatSet { labels: made_of.labels.clone(), ..coloured(0) }, &options)
    });
    [bare, both].concat()
}

/// What of the header of a `.vgs` file says where its parts are.
#[derive(Deserialize)]
struct Parts {
    region: Option<Part>,
    #[serde(default)]
    voxels: Vec<Slabs>,
    layers: Vec<Part>,
}

#[derive(Deserialize)]
struct Slabs {
    slabs: Vec<Part>,
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
    // The header ends with its layers.
    let key = b"\"layers\"";
    let Some(last) = bytes.windows(key.len()).position(|window| window == key) else { return kept() };
    let Some(end) = bytes[last..].windows(2).position(|end| end == b"]}").map(|at| last + at + 2) else {
        return kept();
    };
    let mut header = bytes[START.min(last)..end].to_vec();
    let mut rest = &bytes[end..];
    if let Ok(Parts { region, voxels, layers }) = serde_json::from_slice::<Parts>(&header) {
        let key = b"\"crc32\":";
        let mut from = 0;
        for part in region.iter().chain(voxels.iter().flat_map(|voxels| &voxels.slabs)).chain(&layers) {
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
