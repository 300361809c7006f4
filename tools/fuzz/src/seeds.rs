//! Small valid files of every format, by the project's own writers where it has them.

use std::io::Write;
use std::path::Path;

use engine::image::{self, Image};
use engine::splat::{self, Exception, Form, Grid, PLY_LAYOUTS, Splat, SplatSet};
use engine::transfer::{self, PRESETS, preset};
use engine::volume::{Volume, nifti};
use flate2::Compression;
use flate2::write::GzEncoder;
use glam::{DAffine3, DVec3};

/// Returns what `write` writes into files with these names, in a folder of its own.
///
/// # Panics
/// If a valid file cannot be written, which is a bug of a writer or of these seeds.
fn written(names: &[&str], write: impl Fn(&Path) -> engine::Result<()>) -> Vec<Vec<u8>> {
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &&str| {
        let path = folder.path().join(name);
        write(&path).expect("valid content");
        std::fs::read(&path).expect("what was written")
    };
    names.iter().map(file).collect()
}

fn gzipped(bytes: &[u8]) -> Vec<u8> {
    let mut packed = GzEncoder::new(Vec::new(), Compression::fast());
    packed.write_all(bytes).expect("memory takes it");
    packed.finish().expect("memory takes it")
}

const SIZE: [usize; 3] = [4, 3, 2];

fn samples() -> Vec<i16> {
    (0..24).map(|i| i * 50 - 300).collect()
}

fn voxels() -> Vec<u8> {
    samples().iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// NIfTI of this project, plain and packed, and one with integers.
pub fn nifti() -> Vec<Vec<u8>> {
    let affine = DAffine3::from_scale(DVec3::new(1.0, 1.5, 2.0));
    let volume = Volume::new(SIZE, affine, samples().into_iter().map(f32::from).collect());
    let mut files = written(&["a.nii", "a.nii.gz"], |path| nifti::write(path, &volume, true));
    let mut header = files[0][..352].to_vec();
    // datatype 4, int16.
    header[70..74].copy_from_slice(&[4, 0, 16, 0]);
    files.push([header, voxels()].concat());
    files
}

/// NRRD, attached, as text and packed.
pub fn nrrd() -> Vec<Vec<u8>> {
    let header = |encoding: &str| {
        format!(
            "NRRD0004\ntype: short\ndimension: 3\nspace: left-posterior-superior\nsizes: 4 3 2\n\
             space directions: (1,0,0) (0,1.5,0) (0,0,2)\nkinds: domain domain domain\nendian: little\n\
             encoding: {encoding}\nspace origin: (0,0,0)\n\n"
        )
        .into_bytes()
    };
    let text: Vec<u8> = samples().iter().flat_map(|v| format!("{v} ").into_bytes()).collect();
    vec![
        [header("raw"), voxels()].concat(),
        [header("gzip"), gzipped(&voxels())].concat(),
        [header("ascii"), text].concat(),
    ]
}

/// MetaImage with its voxels inside.
pub fn metaimage() -> Vec<Vec<u8>> {
    let header = "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n\
                  CompressedData = False\nTransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = 0 0 0\n\
                  ElementSpacing = 1 1.5 2\nDimSize = 4 3 2\nElementType = MET_SHORT\nElementDataFile = LOCAL\n";
    vec![[header.as_bytes(), &voxels()].concat()]
}

/// NumPy arrays.
pub fn npy() -> Vec<Vec<u8>> {
    let file = |header: &str| {
        let header = format!("{header:<117}\n");
        let length = (header.len() as u16).to_le_bytes();
        [b"\x93NUMPY\x01\x00", &length[..], header.as_bytes(), &voxels()].concat()
    };
    vec![
        file("{'descr': '<i2', 'fortran_order': False, 'shape': (2, 3, 4), }"),
        file("{'descr': '<i2', 'fortran_order': True, 'shape': (4, 3, 2), }"),
    ]
}

/// InVesalius: a packed archive of property lists and voxels.
pub fn inv3() -> Vec<Vec<u8>> {
    let list = |keys: &str| {
        format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<plist version=\"1.0\"><dict>{keys}</dict></plist>\n"
        )
    };
    let main = list(
        "<key>format_version</key><real>1.1</real><key>matrix</key><dict><key>filename</key><string>matrix.dat\
         </string><key>shape</key><array><integer>2</integer><integer>3</integer><integer>4</integer></array>\
         <key>dtype</key><string>int16</string></dict><key>spacing</key><array><real>1</real><real>1.5</real>\
         <real>2</real></array><key>masks</key><dict></dict>",
    );
    let mut archive = tar::Builder::new(Vec::new());
    for (name, content) in [("main.plist", main.as_bytes()), ("matrix.dat", &voxels())] {
        let mut header = tar::Header::new_gnu();
        header.set_size(content.len() as u64);
        header.set_mode(0o644);
        header.set_cksum();
        archive.append_data(&mut header, name, content).expect("memory takes it");
    }
    vec![gzipped(&archive.into_inner().expect("memory takes it"))]
}

/// A slice of a CT, explicit little endian.
pub fn dicom() -> Vec<Vec<u8>> {
    let element = |group: u16, number: u16, kind: &[u8; 2], content: &[u8]| {
        let mut content = content.to_vec();
        if content.len() % 2 == 1 {
            content.push(if kind == b"UI" { 0 } else { b' ' });
        }
        let mut bytes = [group.to_le_bytes(), number.to_le_bytes(), *kind].concat();
        match kind {
            b"OW" | b"OB" | b"SQ" => {
                bytes.extend([0, 0]);
                bytes.extend((content.len() as u32).to_le_bytes());
            }
            _ => bytes.extend((content.len() as u16).to_le_bytes()),
        }
        bytes.extend(content);
        bytes
    };
    let meta = [
        element(2, 1, b"OB", &[0, 1]),
        element(2, 2, b"UI", b"1.2.840.10008.5.1.4.1.1.2"),
        element(2, 3, b"UI", b"1.2.3.4"),
        element(2, 0x10, b"UI", b"1.2.840.10008.1.2.1"),
        element(2, 0x12, b"UI", b"1.2.3"),
    ]
    .concat();
    let short = |n: u16| n.to_le_bytes();
    let slice = [
        element(8, 0x16, b"UI", b"1.2.840.10008.5.1.4.1.1.2"),
        element(8, 0x18, b"UI", b"1.2.3.4"),
        element(8, 0x60, b"CS", b"CT"),
        element(0x18, 0x50, b"DS", b"2"),
        element(0x20, 0xd, b"UI", b"1.2.3.5"),
        element(0x20, 0xe, b"UI", b"1.2.3.6"),
        element(0x20, 0x13, b"IS", b"1"),
        element(0x20, 0x32, b"DS", b"0\\0\\0"),
        element(0x20, 0x37, b"DS", b"1\\0\\0\\0\\1\\0"),
        element(0x20, 0x52, b"UI", b"1.2.3.7"),
        element(0x28, 2, b"US", &short(1)),
        element(0x28, 4, b"CS", b"MONOCHROME2"),
        element(0x28, 0x10, b"US", &short(3)),
        element(0x28, 0x11, b"US", &short(4)),
        element(0x28, 0x30, b"DS", b"1.5\\1"),
        element(0x28, 0x100, b"US", &short(16)),
        element(0x28, 0x101, b"US", &short(16)),
        element(0x28, 0x102, b"US", &short(15)),
        element(0x28, 0x103, b"US", &short(1)),
        element(0x28, 0x1052, b"DS", b"-1024"),
        element(0x28, 0x1053, b"DS", b"1"),
        element(0x7fe0, 0x10, b"OW", &voxels()[..24]),
    ]
    .concat();
    let length = element(2, 0, b"UL", &(meta.len() as u32).to_le_bytes());
    vec![[vec![0; 128], b"DICM".to_vec(), length, meta, slice].concat()]
}

/// Splats in all layouts, with all that a set can have.
pub fn ply() -> Vec<Vec<u8>> {
    let splats: Vec<Splat> = (0..5)
        .map(|i| Splat {
            mean: [i as f32, 1.0, 0.5],
            rotation: [1.0, 0.1 * i as f32, 0.0, 0.0],
            intensity: 100.0 * i as f32,
            ..Splat::default()
        })
        .collect();
    let set = SplatSet {
        labels: Some(vec![0, 1, 1, 2, 0]),
        label_names: vec![(1, "liver".into()), (2, "spleen".into())],
        iterations: Some(100),
        grid: Some(Grid { size: [8, 8, 8], world_from_voxel: DAffine3::IDENTITY }),
        form: Form::Grid { binary: true },
        exceptions: vec![Exception { voxel: [1, 2, 3], inside: true }],
        splats,
        ..SplatSet::default()
    };
    let layouts = PLY_LAYOUTS.iter().flat_map(|layout| {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.ply");
        // Layouts in units of voxels need the volume, which these have not.
        let options = splat::WriteOptions { layout, place: None, force: true };
        splat::write_as(&path, &set, &options).ok().and_then(|()| std::fs::read(&path).ok())
    });
    let names = "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3";
    let properties: String = names.split(' ').map(|name| format!("property float {name}\n")).collect();
    let text = format!(
        "ply\nformat ascii 1.0\nelement vertex 2\n{properties}end_header\n{}",
        "0 1 2 0.5 0.5 0.5 1 -1 -1 -1 1 0 0 0\n".repeat(2)
    );
    layouts.chain([text.into_bytes()]).collect()
}

/// Transfer functions of this project, of Slicer and of ParaView.
pub fn transfer() -> Vec<Vec<u8>> {
    let function = preset(PRESETS[0].name).expect("a preset").over([-1000.0, 2000.0]);
    let mut files = written(&["a.vp.json"], |path| transfer::save(&function, path, true));
    files.push(
        b"1\n1\n0.9\n0.1\n0.2\n10\n6 0 0 300 0 1000 1\n4 0 1 255 1\n12 0 0 0 0 300 1 0.5 0.2 1000 1 1 1\n"
            .to_vec(),
    );
    files.push(
        br#"[{"ColorSpace":"RGB","Name":"a","Points":[0,0,0.5,0,1,1,0.5,0],"RGBPoints":[0,0,0,0,1,1,0.5,0.2]}]"#
            .to_vec(),
    );
    files.push(
        br#"<MRML><VolumeProperty name="a" gradientOpacity="4 0 1 255 1" scalarOpacity="4 0 0 300 1"
colorTransfer="8 0 0 0 0 300 1 0.5 0.2" interpolation="1" shade="1" diffuse="0.9" ambient="0.1" specular="0.2"
specularPower="10"/></MRML>"#
            .to_vec(),
    );
    files
}

/// Pictures with and without depth.
pub fn pictures() -> Vec<Vec<u8>> {
    let image = Image::new([5, 4], [0.5, 0.25, 1.0, 0.75]);
    let depth: Vec<f32> = (0..20).map(|i| i as f32).collect();
    let options = image::WriteOptions { force: true, ..image::WriteOptions::default() };
    let mut files = written(&["a.png", "a.exr"], |path| image::write(path, &image, None, &options));
    files.extend(written(&["b.exr"], |path| image::write(path, &image, Some(&depth), &options)));
    files
}

/// A paused fit of two splats.
pub fn state() -> Vec<Vec<u8>> {
    let notes = br#"{"a": 1}"#;
    let words: Vec<u8> = [3u32, 0, 0, 0].iter().flat_map(|word| word.to_le_bytes()).collect();
    let row = [0u8; 4 * (12 + 11 + 11 + 2)];
    let parts: [&[u8]; 6] = [
        b"vgs-state-2\n",
        &(notes.len() as u64).to_le_bytes(),
        notes,
        &words,
        &[2u64.to_le_bytes(), 2u64.to_le_bytes()].concat(),
        &row.repeat(2),
    ];
    vec![summed(&parts.concat())]
}

/// Returns the bytes with their checksum behind them.
pub fn summed(bytes: &[u8]) -> Vec<u8> {
    let mut crc = flate2::Crc::new();
    crc.update(bytes);
    [bytes, &crc.sum().to_le_bytes()].concat()
}
