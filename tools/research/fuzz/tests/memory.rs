//! Reading takes no more memory than what is read needs: for valid files of every format at most twice that and what
//! buffers take, for files that claim or unpack to far more than they hold, hardly any.
//!
//! The heap is counted for the whole process, so that nothing may run beside the only test.

use std::io::Write;
use std::path::Path;

use engine::image::{self, Image};
use engine::splat::{self, Harmonics, Splat, SplatSet};
use engine::unit::Unit;
use engine::volume::{ReadOptions, Volume, nifti};
use engine::{Kind, Result};
use flate2::Compression;
use flate2::write::GzEncoder;
use fuzz::trial::heap_of;
use glam::{DAffine3, DVec3};
use writer::{Dicom, words};
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

#[path = "../../../../engine/volume/src/dicom/tests/writer.rs"]
mod writer;

/// Voxels along an axis of the volumes, pixels along one of the pictures, and splats.
const VOXELS: usize = 160;
const PIXELS: usize = 1024;
const SPLATS: usize = 200_000;
/// Bytes that buffers may take besides: of files, of decoders, and of the library for DICOM.
const BUFFERS: usize = 4 << 20;
/// Bytes that a file may take that is refused.
const REFUSED: usize = 100_000_000;

fn gzipped(parts: &[&[u8]]) -> Vec<u8> {
    let mut packed = GzEncoder::new(Vec::new(), Compression::fast());
    parts.iter().for_each(|part| packed.write_all(part).expect("memory takes it"));
    packed.finish().expect("memory takes it")
}

/// Returns 16-bit samples as a file has them.
fn voxels() -> Vec<u8> {
    (0..VOXELS.pow(3)).flat_map(|i| ((i * 37 % 2000) as i16 - 1000).to_le_bytes()).collect()
}

fn nrrd(encoding: &str, voxels: &[u8]) -> Vec<u8> {
    let header = format!(
        "NRRD0004\ntype: short\ndimension: 3\nspace: left-posterior-superior\nsizes: {VOXELS} {VOXELS} {VOXELS}\n\
         space directions: (1,0,0) (0,1,0) (0,0,1)\nendian: little\nencoding: {encoding}\nspace origin: (0,0,0)\n\n"
    );
    [header.as_bytes(), voxels].concat()
}

/// Files of volumes with their names.
fn volumes(folder: &Path) -> Vec<(&'static str, Vec<u8>)> {
    let samples = (0..VOXELS.pow(3)).map(|i| (i * 37 % 2000) as f32).collect();
    let volume = Volume::new([VOXELS; 3], DAffine3::IDENTITY, samples);
    let nifti = |name| {
        nifti::write(folder.join(name), &volume, true).expect("writing");
        (name, std::fs::read(folder.join(name)).expect("reading"))
    };
    let voxels = voxels();
    let text: Vec<u8> = voxels
        .chunks_exact(2)
        .flat_map(|two| format!("{} ", i16::from_le_bytes([two[0], two[1]])).into_bytes())
        .collect();
    let mha = format!(
        "NDims = 3\nDimSize = {VOXELS} {VOXELS} {VOXELS}\nElementType = MET_SHORT\nElementByteOrderMSB = False\n\
         ElementDataFile = LOCAL\n"
    );
    let npy = format!(
        "{:<117}\n",
        format!("{{'descr': '<i2', 'fortran_order': False, 'shape': ({VOXELS}, {VOXELS}, {VOXELS}), }}")
    );
    vec![
        nifti("a.nii"),
        nifti("a.nii.gz"),
        ("raw.nrrd", nrrd("raw", &voxels)),
        ("gzip.nrrd", nrrd("gzip", &gzipped(&[&voxels]))),
        ("text.nrrd", nrrd("ascii", &text)),
        ("a.mha", [mha.as_bytes(), &voxels].concat()),
        ("a.npy", [b"\x93NUMPY\x01\x00\x76\x00", npy.as_bytes(), &voxels].concat()),
        ("a.inv3", inv3(&voxels)),
    ]
}

fn inv3(voxels: &[u8]) -> Vec<u8> {
    let main = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<plist version=\"1.0\"><dict><key>format_version</key>\
         <real>1.1</real><key>matrix</key><dict><key>filename</key><string>matrix.dat</string><key>shape</key><array>\
         <integer>{VOXELS}</integer><integer>{VOXELS}</integer><integer>{VOXELS}</integer></array><key>dtype</key>\
         <string>int16</string></dict><key>spacing</key><array><real>1</real><real>1</real><real>1</real></array>\
         <key>masks</key><dict></dict></dict></plist>\n"
    );
    let mut archive = tar::Builder::new(Vec::new());
    for (name, content) in [("main.plist", main.as_bytes()), ("matrix.dat", voxels)] {
        let mut header = tar::Header::new_gnu();
        header.set_size(content.len() as u64);
        header.set_cksum();
        archive.append_data(&mut header, name, content).expect("memory takes it");
    }
    gzipped(&[&archive.into_inner().expect("memory takes it")])
}

/// A series of slices, in a folder and in a zip.
fn series(folder: &Path) {
    let side = VOXELS as u16;
    std::fs::create_dir(folder.join("series")).expect("a folder");
    let mut zip = ZipWriter::new(std::fs::File::create(folder.join("series.zip")).expect("a file"));
    for i in 0..side {
        let mut slice = Dicom::slice(i, DVec3::new(0.0, 0.0, f64::from(i)));
        slice.put((0x0028, 0x0010), b"US", words(&[side]));
        slice.put((0x0028, 0x0011), b"US", words(&[side]));
        let pixels: Vec<u16> = (0..VOXELS.pow(2)).map(|k| (k * 37 % 2000) as u16).collect();
        slice.put((0x7fe0, 0x0010), b"OW", words(&pixels));
        let (name, bytes) = (format!("{i:03}.dcm"), slice.bytes());
        std::fs::write(folder.join("series").join(&name), &bytes).expect("writing");
        zip.start_file(name, SimpleFileOptions::default()).expect("writing");
        zip.write_all(&bytes).expect("writing");
    }
    zip.finish().expect("writing");
}

fn splats(coloured: bool) -> SplatSet {
    let splat = |i: usize| Splat {
        mean: [(i % 97) as f32, (i % 89) as f32, (i % 83) as f32],
        rotation: [1.0, 0.0, 0.0, 0.1],
        intensity: (i % 300) as f32,
        ..Splat::default()
    };
    let colours = Harmonics { degree: 3, coefficients: vec![0.25; 48 * SPLATS] };
    SplatSet {
        splats: (0..SPLATS).map(splat).collect(),
        origin_mm: DVec3::ZERO,
        colours: coloured.then_some(colours),
        unit: if coloured { Unit::Luminance } else { Unit::Hu },
        ..SplatSet::default()
    }
}

#[test]
fn memory_follows_what_is_read() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut wrong = Vec::new();
    let mut judge = |name: &str, need: usize, read: &mut dyn FnMut() -> Result<usize>| {
        let (bytes, taken) = heap_of(read);
        let bytes = bytes.unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(bytes, need, "{name}");
        println!("{name}: {:.1} MB for {:.1} MB", taken as f64 / 1e6, need as f64 / 1e6);
        // Colours are there a second time while they are turned, and of glTF a third time.
        let times = if ["c.spz", "c.sog", "c.glb"].contains(&name) { 4 } else { 2 };
        if taken > times * need + BUFFERS {
            wrong.push(format!("{name}: {taken} bytes for {need}"));
        }
    };

    for (name, file) in volumes(folder.path()) {
        let path = folder.path().join(name);
        std::fs::write(&path, &file).expect("writing");
        drop(file);
        judge(name, 4 * VOXELS.pow(3), &mut || {
            Volume::read(&path, &ReadOptions::default()).map(|volume| 4 * volume.samples.len())
        });
    }
    series(folder.path());
    for name in ["series", "series.zip"] {
        let path = folder.path().join(name);
        judge(name, 4 * VOXELS.pow(3), &mut || {
            Volume::read(&path, &ReadOptions::default()).map(|volume| 4 * volume.samples.len())
        });
    }
    let own = SPLATS * size_of::<Splat>();
    let with_colours = own + 4 * 48 * SPLATS;
    for (name, coloured, need) in [
        ("a.ply", false, own),
        ("c.ply", true, with_colours),
        ("a.vgs", false, own),
        ("c.spz", true, with_colours),
        ("c.sog", true, with_colours),
        ("c.glb", true, with_colours),
    ] {
        let path = folder.path().join(name);
        splat::write(&path, &splats(coloured), true).expect("writing");
        judge(name, need, &mut || {
            let set = splat::read(&path, &splat::ReadOptions::default())?;
            let colours = set.colours.map_or(0, |colours| 4 * colours.coefficients.len());
            Ok(set.splats.len() * size_of::<Splat>() + colours)
        });
    }
    for name in ["a.png", "a.exr"] {
        let path = folder.path().join(name);
        let picture = Image::new([PIXELS; 2], [0.25, 0.5, 0.75, 1.0]);
        image::write(&path, &picture, None, &image::WriteOptions::default()).expect("writing");
        drop(picture);
        judge(name, 16 * PIXELS.pow(2), &mut || image::read(&path).map(|read| 16 * read.image.pixels.len()));
    }
    assert!(wrong.is_empty(), "{wrong:#?}");

    bombs_are_refused_cheaply(folder.path());
}

/// Files of a few bytes or megabytes that claim, or unpack to, gigabytes.
fn bombs_are_refused_cheaply(folder: &Path) {
    let header = |size: [u16; 3]| {
        let mut header = vec![0; 352];
        let mut put = |at: usize, bytes: &[u8]| header[at..at + bytes.len()].copy_from_slice(bytes);
        put(0, &348_i32.to_le_bytes());
        for (i, n) in [3, size[0], size[1], size[2], 1, 1, 1, 1].into_iter().enumerate() {
            put(40 + 2 * i, &n.to_le_bytes());
        }
        put(70, &4_i16.to_le_bytes());
        put(72, &16_i16.to_le_bytes());
        (1..4).for_each(|i| put(76 + 4 * i, &1_f32.to_le_bytes()));
        put(108, &352_f32.to_le_bytes());
        put(344, b"n+1\0");
        header
    };
    // 4 GiB of zeros, packed as 256 members.
    let mut zeros = GzEncoder::new(Vec::new(), Compression::best());
    zeros.write_all(&vec![0; 1 << 24]).expect("memory takes it");
    let zeros = zeros.finish().expect("memory takes it").repeat(256);
    let wide = [gzipped(&[&header([1024, 1024, 2048])]), zeros.clone()].concat();
    let narrow = [gzipped(&[&header([4, 3, 2]), &[0; 48]]), zeros].concat();
    let mib = narrow.len() >> 20;
    assert!((3..20).contains(&mib), "{mib} MiB");
    let claim = gzipped(&[&header([2500, 2500, 1666])]);
    let nrrd = nrrd("gzip", &[]);
    let nrrd = String::from_utf8(nrrd).expect("text").replace("160 160 160", "30000 30000 30000");
    let mut ply =
        String::from_utf8_lossy(b"ply\nformat binary_little_endian 1.0\nelement vertex 199999999\n")
            .into_owned();
    for name in
        "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3".split(' ')
    {
        ply += &format!("property float {name}\n");
    }
    ply += "end_header\n";
    let spz = [&b"NGSP\x03\0\0\0"[..], &199_999_999u32.to_le_bytes(), &[3, 12, 0, 0]].concat();
    for (name, bytes) in [
        ("claim.spz", gzipped(&[&spz])),
        ("zeros.spz", gzipped(&[&spz, &[0; 1 << 22]])),
        ("wide.nii.gz", wide),
        ("narrow.nii.gz", narrow),
        ("claim.nii.gz", claim),
        ("a.nrrd", nrrd.into_bytes()),
        ("a.ply", ply.into_bytes()),
    ] {
        let path = folder.join(name);
        std::fs::write(&path, bytes).expect("writing");
        let read = || match name {
            "a.ply" | "claim.spz" | "zeros.spz" => {
                splat::read(&path, &splat::ReadOptions::default()).map(drop)
            }
            // So much is unpacked, and thrown away, before it is refused.
            _ => Volume::read(&path, &ReadOptions { max_bytes: 1 << 28, ..ReadOptions::default() }).map(drop),
        };
        let (read, taken) = heap_of(read);
        let error = read.expect_err(name);
        // Whether there is memory for a claim depends on the machine.
        let is_claim = error.kind == Kind::HostMemory && name.ends_with(".spz");
        assert!(is_claim || error.kind == Kind::BadData, "{name}: {error}");
        assert!(taken < REFUSED, "{name}: {taken} bytes");
        println!("{name}: {:.1} MB, {error}", taken as f64 / 1e6);
    }
}
