//! Small valid files of every format, by the project's own writers where it has them.

use std::io::Write;
use std::path::Path;

use engine::image::{self, Image};
use engine::transfer::{self, PRESETS, preset};
use engine::volume::{Volume, nifti, zarr};
use exr::prelude::{Encoding, Layer, LayerAttributes, SpecificChannels, Vec2, WritableImage};
use flate2::write::{GzEncoder, ZlibEncoder};
use flate2::{Compression, Crc};
use glam::{DAffine3, DVec3};
use png::{BitDepth, ColorType, Encoder};

pub mod dicom;
pub mod splats;

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

/// What stands between the files of a store of Zarr, of which a seed has all: the group, its array, and a chunk.
pub const BETWEEN: &[u8] = b"\n---\n";
/// The names of these files.
pub const STORE: [&str; 3] = ["zarr.json", "0/zarr.json", "0/c/0/0/0"];

/// Stores of Zarr: of this project, and one of version 0.4 of the attributes with a chunk that is not compressed.
///
/// # Panics
/// As [`written`].
pub fn zarr() -> Vec<Vec<u8>> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.zarr");
    let affine = DAffine3::from_scale(DVec3::new(-1.0, -1.5, 2.0));
    let volume = Volume::new(SIZE, affine, samples().into_iter().map(f32::from).collect());
    zarr::write(&path, &volume, true).expect("valid content");
    let [group, array, chunk] = STORE.map(|name| std::fs::read(path.join(name)).expect("what was written"));
    let plain = br#"{"zarr_format": 3, "node_type": "array", "shape": [2, 3, 4], "data_type": "int16",
        "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": [2, 3, 4]}},
        "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}}, "fill_value": -7,
        "codecs": [{"name": "bytes", "configuration": {"endian": "little"}}]}"#;
    let image = br#"{"zarr_format": 3, "node_type": "group", "attributes": {"multiscales": [{"axes": [
        {"name": "z", "type": "space", "unit": "micrometer"}, {"name": "y", "type": "space"},
        {"name": "x", "type": "space"}], "datasets": [{"path": "0", "coordinateTransformations": [
        {"type": "scale", "scale": [2, 1.5, 1]}, {"type": "translation", "translation": [1, 2, 3]}]}],
        "coordinateTransformations": [{"type": "identity"}]}]}}"#;
    vec![
        [&group, BETWEEN, &array, BETWEEN, &chunk].concat(),
        [&image[..], BETWEEN, plain, BETWEEN, &voxels()].concat(),
    ]
}

/// Returns the voxels as a file has them.
pub fn voxels() -> Vec<u8> {
    samples().iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// NIfTI of this project, plain and packed, one with integers, and one with label names.
pub fn nifti() -> Vec<Vec<u8>> {
    let affine = DAffine3::from_scale(DVec3::new(1.0, 1.5, 2.0));
    let volume = Volume::new(SIZE, affine, samples().into_iter().map(f32::from).collect());
    let mut files = written(&["a.nii", "a.nii.gz"], |path| nifti::write(path, &volume, true));
    let mut header = files[0][..352].to_vec();
    // datatype 4, int16.
    header[70..74].copy_from_slice(&[4, 0, 16, 0]);
    files.push([header.clone(), voxels()].concat());
    let names = br#"<CaretExtension><VolumeInformation><LabelTable><Label Key="1">liver</Label></LabelTable></VolumeInformation></CaretExtension>"#;
    let length = (8 + names.len()).next_multiple_of(16);
    header[108..112].copy_from_slice(&((352 + length) as f32).to_le_bytes());
    header[348] = 1;
    let mut extension = [&(length as u32).to_le_bytes()[..], &30_u32.to_le_bytes(), names].concat();
    extension.resize(length, 0);
    files.push([header, extension, voxels()].concat());
    files
}

/// Headers of NIfTI whose voxels are in a file beside them.
pub fn nifti_pair() -> Vec<Vec<u8>> {
    let mut header = nifti()[2][..352].to_vec();
    header[108..112].copy_from_slice(&0_f32.to_le_bytes());
    header[344..348].copy_from_slice(b"ni1\0");
    vec![header]
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
        [
            &header("raw")[..header("raw").len() - 1],
            b"Segment0_ID:=a\nSegment0_LabelValue:=1\nSegment0_Layer:=0\n\
          Segment0_Name:=liver\n\n",
            &voxels(),
        ]
        .concat(),
        [&header("raw")[..header("raw").len() - 1], b"data file: beside.raw\n"].concat(),
    ]
}

/// MetaImage with its voxels inside, plain and packed, and beside it.
pub fn metaimage() -> Vec<Vec<u8>> {
    let header = "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n\
                  CompressedData = False\nTransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = 0 0 0\n\
                  ElementSpacing = 1 1.5 2\nDimSize = 4 3 2\nElementType = MET_SHORT\nElementDataFile = LOCAL\n";
    let mut zlib = ZlibEncoder::new(Vec::new(), Compression::fast());
    zlib.write_all(&voxels()).expect("memory takes it");
    let zlib = zlib.finish().expect("memory takes it");
    vec![
        [header.as_bytes(), &voxels()].concat(),
        [header.replace("CompressedData = False", "CompressedData = True").as_bytes(), &zlib].concat(),
        header.replace("= LOCAL", "= beside.raw").into_bytes(),
    ]
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

/// Transfer functions of this project, which are Slicer's of today.
pub fn vp_json() -> Vec<Vec<u8>> {
    let function = preset(PRESETS[0].name).expect("a preset").over([-1000.0, 2000.0]);
    written(&["a.vp.json"], |path| transfer::save(&function, path, true))
}

/// Transfer functions of older Slicers.
pub fn vp() -> Vec<Vec<u8>> {
    let text =
        "1\n1\n0.9\n0.1\n0.2\n10\n6 0 0 300 0 1000 1\n4 0 1 255 1\n12 0 0 0 0 300 1 0.5 0.2 1000 1 1 1\n";
    vec![text.into()]
}

/// Presets of Slicer.
pub fn slicer_xml() -> Vec<Vec<u8>> {
    let text = r#"<MRML><VolumeProperty name="a" gradientOpacity="4 0 1 255 1" scalarOpacity="4 0 0 300 1"
colorTransfer="8 0 0 0 0 300 1 0.5 0.2" interpolation="1" shade="1" diffuse="0.9" ambient="0.1" specular="0.2"
specularPower="10"/></MRML>"#;
    vec![text.into()]
}

/// Colour maps of ParaView.
pub fn paraview() -> Vec<Vec<u8>> {
    let text = r#"[{"ColorSpace":"RGB","Name":"a","Points":[0,0,0.5,0,1,1,0.5,0],"RGBPoints":[0,0,0,0,1,1,0.5,0.2]}]"#;
    vec![text.into()]
}

/// PNG: this project's, and others with each way to store a pixel, not packed, so that a change stays where it is.
pub fn png() -> Vec<Vec<u8>> {
    let image = Image::new([5, 4], [0.5, 0.25, 1.0, 0.75]);
    let options = image::WriteOptions { force: true, ..image::WriteOptions::default() };
    let ours = written(&["a.png"], |path| image::write(path, &image, None, &options));
    let stored = |color: ColorType, depth: BitDepth, row: usize| {
        let mut out = Vec::new();
        let mut encoder = Encoder::new(&mut out, 5, 4);
        encoder.set_color(color);
        encoder.set_depth(depth);
        encoder.set_compression(png::Compression::NoCompression);
        if color == ColorType::Indexed {
            encoder.set_palette(vec![0; 3 << 2]);
        }
        let mut writer = encoder.write_header().expect("memory takes it");
        let pixels: Vec<u8> = (0..4 * row).map(|i| (37 * i) as u8).collect();
        writer.write_image_data(&pixels).expect("memory takes it");
        writer.finish().expect("memory takes it");
        out
    };
    let others = [
        stored(ColorType::Grayscale, BitDepth::One, 1),
        stored(ColorType::GrayscaleAlpha, BitDepth::Sixteen, 20),
        stored(ColorType::Rgb, BitDepth::Sixteen, 30),
        stored(ColorType::Indexed, BitDepth::Two, 2),
    ];
    [ours, others.into()].concat()
}

/// Writes the checksums of the chunks of a changed PNG anew, of most files: every sixteenth keeps those it has.
pub fn png_sums(bytes: &[u8]) -> Vec<u8> {
    let mut out = bytes.to_vec();
    if crc(bytes).is_multiple_of(16) {
        return out;
    }
    let mut at = 8;
    while let Some(length) = out.get(at..at + 4).and_then(|four| four.first_chunk()) {
        let end = at + 8 + u32::from_be_bytes(*length) as usize;
        if out.len() < end + 4 {
            break;
        }
        let sum = crc(&out[at + 4..end]).to_be_bytes();
        out[end..end + 4].copy_from_slice(&sum);
        at = end + 4;
    }
    out
}

/// EXR with and without depth, packed, and not packed.
pub fn exr() -> Vec<Vec<u8>> {
    let image = Image::new([5, 4], [0.5, 0.25, 1.0, 0.75]);
    let depth: Vec<f32> = (0..20).map(|i| i as f32).collect();
    let options = image::WriteOptions { force: true, ..image::WriteOptions::default() };
    let mut files = written(&["a.exr"], |path| image::write(path, &image, None, &options));
    files.extend(written(&["b.exr"], |path| image::write(path, &image, Some(&depth), &options)));
    for encoding in [Encoding::UNCOMPRESSED, Encoding::FAST_LOSSLESS, Encoding::SMALL_LOSSLESS] {
        let pixels =
            SpecificChannels::rgba(|at: Vec2<usize>| (at.x() as f32, at.y() as f32, 0.5_f32, 1.0_f32));
        let layer = Layer::new((5, 4), LayerAttributes::named("a"), encoding, pixels);
        let mut out = std::io::Cursor::new(Vec::new());
        exr::prelude::Image::from_layer(layer).write().to_buffered(&mut out).expect("memory takes it");
        files.push(out.into_inner());
    }
    files
}

/// A paused fit of two splats.
pub fn state() -> Vec<Vec<u8>> {
    let words: Vec<u8> = [3u32, 0, 0, 2].iter().flat_map(|word| word.to_le_bytes()).collect();
    let row = [0u8; 4 * (12 + 11 + 11 + 2)];
    vec![state_of("vgs-state-3", &[br#"{"a": 1}"#, &words, &row.repeat(2)])]
}

/// The state of baking two splats, with a coefficient each.
pub fn bake_state() -> Vec<Vec<u8>> {
    let numbers = |count: usize| 1.0f64.to_le_bytes().repeat(count);
    let floats = |count: usize| vec![0u8; 2 * 4 * count];
    let parts = [
        br#"{"a": "1"}"#.to_vec(),
        numbers(3),
        numbers(1),
        numbers(2),
        numbers(5),
        floats(1),
        floats(12),
        floats(11),
        floats(11),
        floats(2),
        floats(3),
        floats(3),
        floats(3),
    ];
    vec![state_of("vgs-bake-state-1", &parts.each_ref().map(Vec::as_slice))]
}

/// A state of this kind with these parts.
fn state_of(kind: &str, parts: &[&[u8]]) -> Vec<u8> {
    let told = |part: &&[u8]| [&(part.len() as u64).to_le_bytes()[..], part].concat();
    let body: Vec<u8> = parts.iter().flat_map(told).collect();
    summed(&[kind.as_bytes(), b"\n", &body].concat())
}

/// Returns the bytes with their checksum behind them.
fn summed(bytes: &[u8]) -> Vec<u8> {
    [bytes, &crc(bytes).to_le_bytes()].concat()
}

/// Writes the checksum of a changed state anew.
pub fn state_sum(bytes: &[u8]) -> Vec<u8> {
    summed(&bytes[..bytes.len().saturating_sub(4)])
}

/// Returns the checksum of gzip, PNG and zip.
pub fn crc(bytes: &[u8]) -> u32 {
    let mut crc = Crc::new();
    crc.update(bytes);
    crc.sum()
}
