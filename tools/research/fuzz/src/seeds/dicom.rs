//! DICOM: slices, alone and in a zip, and masks as voxels and as contours.

use std::io::{Cursor, Write};

use glam::{DAffine3, DVec3};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use writer::{Dicom, words};

#[path = "../../../../../engine/volume/src/dicom/tests/writer.rs"]
mod writer;

/// Map from the voxels of the slices here to the world, mm RAS: columns half a millimetre apart, rows 2 mm, slices
/// 3 mm.
pub fn world_from_voxel() -> DAffine3 {
    let columns = [DVec3::new(-0.4, -0.3, 0.0), DVec3::new(1.2, -1.6, 0.0), DVec3::new(0.0, 0.0, 3.0)];
    DAffine3::from_cols(columns[0], columns[1], columns[2], DVec3::new(-10.0, 20.0, 30.0))
}

/// Returns the place of the first pixel of slice `i`, mm LPS.
fn place(i: usize) -> DVec3 {
    DVec3::new(10.0, -20.0, 30.0 + 3.0 * i as f64)
}

/// A slice of a CT, with the kinds of its elements and without.
pub fn slice() -> Vec<Vec<u8>> {
    let mut slice = Dicom::slice(1, place(0));
    let mut code = Dicom::empty("");
    code.text((0x0008, 0x0100), b"SH", "T-D4000");
    slice.sequence((0x0008, 0x2218), &[code]);
    let explicit = slice.bytes();
    vec![implicit(&explicit), explicit]
}

/// Returns a file of explicit elements, all of whose sequences have items of explicit lengths, as one of implicit
/// elements.
fn implicit(file: &[u8]) -> Vec<u8> {
    const META: usize = 132 + 12;
    let word = |at: usize| u16::from_le_bytes([file[at], file[at + 1]]);
    let end = META + usize::from(word(META - 4));
    let syntax = b"1.2.840.10008.1.2.1\0";
    let at = file.windows(syntax.len()).position(|window| window == syntax).expect("a plain file");
    let mut out = file[..end].to_vec();
    out.splice(at - 2..at + syntax.len(), [&18_u16.to_le_bytes()[..], b"1.2.840.10008.1.2\0"].concat());
    let length = out.len() - META;
    out[META - 4..META - 2].copy_from_slice(&(length as u16).to_le_bytes());
    out.extend(implicit_elements(&file[end..]));
    out
}

fn implicit_elements(mut rest: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    while rest.len() >= 8 {
        let is_long = [b"OB", b"OW", b"SQ", b"UN"].iter().any(|kind| rest[4..6] == kind[..]);
        let (head, length) = match is_long {
            true => (12, u32::from_le_bytes([rest[8], rest[9], rest[10], rest[11]])),
            false => (8, u16::from_le_bytes([rest[6], rest[7]]).into()),
        };
        let (content, after) = rest[head..].split_at(length as usize);
        let content = match &rest[4..6] {
            // Of one item.
            b"SQ" => {
                let inner = implicit_elements(&content[8..]);
                [&content[..4], &(inner.len() as u32).to_le_bytes(), &inner].concat()
            }
            _ => content.to_vec(),
        };
        out.extend([&rest[..4], &(content.len() as u32).to_le_bytes(), &content].concat());
        rest = after;
    }
    out
}

/// A zip of two slices, packed and as they are.
pub fn zip() -> Vec<Vec<u8>> {
    let slices = [0, 1].map(|i| (format!("{i}.dcm"), Dicom::slice(i, place(i.into())).bytes()));
    [CompressionMethod::Deflated, CompressionMethod::Stored].map(|method| zipped(&slices, method)).into()
}

/// Returns a zip of these files.
///
/// # Panics
/// If memory does not take it.
pub fn zipped(files: &[(String, Vec<u8>)], method: CompressionMethod) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(method).compression_level(None);
    for (name, bytes) in files {
        zip.start_file(name, options).expect("memory takes it");
        zip.write_all(bytes).expect("memory takes it");
    }
    zip.finish().expect("memory takes it").into_inner()
}

/// Segmentations of two slices: bits, fractions and labels.
pub fn segmentation() -> Vec<Vec<u8>> {
    ["BINARY", "FRACTIONAL", "LABELMAP"].map(|kind| segmentation_of(kind).bytes()).into()
}

fn segmentation_of(kind: &str) -> Dicom {
    let item = |texts: &[((u16, u16), &'static [u8; 2], &str)]| {
        let mut item = Dicom::empty("");
        texts.iter().for_each(|(tag, vr, value)| item.text(*tag, vr, value));
        item
    };
    let within = |tag, inner: Dicom| {
        let mut item = Dicom::empty("");
        item.sequence(tag, &[inner]);
        item
    };
    let mut file = Dicom::slice(0, place(0));
    file.class = "1.2.840.10008.5.1.4.1.1.66.4";
    for tag in [(0x0020, 0x0032), (0x0020, 0x0037), (0x0028, 0x0030), (0x0028, 0x1052), (0x0028, 0x1053)] {
        file.remove(tag);
    }
    file.text((0x0008, 0x0060), b"CS", "SEG");
    file.text((0x0062, 0x0001), b"CS", kind);
    file.put((0x0062, 0x000e), b"US", words(&[200]));
    let mut segment = item(&[((0x0062, 0x0005), b"LO", "liver")]);
    segment.put((0x0062, 0x0004), b"US", words(&[1]));
    file.sequence((0x0062, 0x0002), &[segment]);
    let measures = item(&[
        ((0x0028, 0x0030), b"DS", "2\\0.5"),
        ((0x0018, 0x0050), b"DS", "3"),
        ((0x0018, 0x0088), b"DS", "3"),
    ]);
    let mut shared = within((0x0028, 0x9110), measures);
    shared.sequence((0x0020, 0x9116), &[item(&[((0x0020, 0x0037), b"DS", "0.8\\0.6\\0\\-0.6\\0.8\\0")])]);
    file.sequence((0x5200, 0x9229), &[shared]);
    let frames = [0, 1].map(|i| {
        let at = place(i).to_array().map(|v| v.to_string()).join("\\");
        let mut number = Dicom::empty("");
        number.put((0x0062, 0x000b), b"US", words(&[1]));
        let mut frame = within((0x0020, 0x9113), item(&[((0x0020, 0x0032), b"DS", &at)]));
        frame.sequence((0x0062, 0x000a), &[number]);
        frame
    });
    file.text((0x0028, 0x0008), b"IS", "2");
    file.sequence((0x5200, 0x9230), &frames);
    let is_bits = kind == "BINARY";
    for (tag, bits, bytes) in [(0x0100, 1, 8), (0x0101, 1, 8), (0x0102, 0, 7)] {
        file.put((0x0028, tag), b"US", words(&[if is_bits { bits } else { bytes }]));
    }
    let pixels: Vec<u8> = if is_bits { vec![0x5a, 0x37, 0xc4] } else { (0..24).map(|i| i % 2).collect() };
    file.put((0x7fe0, 0x0010), b"OB", pixels);
    file
}

/// A structure set: a triangle and a rectangle with a hole, on the slices.
pub fn contours() -> Vec<Vec<u8>> {
    let mut file = Dicom::empty("1.2.840.10008.5.1.4.1.1.481.3");
    file.text((0x0008, 0x0060), b"CS", "RTSTRUCT");
    let contour = |points: &[[f64; 3]]| {
        let mut item = Dicom::empty("");
        item.text((0x3006, 0x0042), b"CS", "CLOSED_PLANAR");
        let lps = DVec3::new(-1.0, -1.0, 1.0);
        let at = |p: &[f64; 3]| lps * world_from_voxel().transform_point3(DVec3::from_array(*p));
        let numbers: Vec<String> =
            points.iter().flat_map(|p| at(p).to_array().map(|v| format!("{v:.3}"))).collect();
        item.text((0x3006, 0x0050), b"DS", &numbers.join("\\"));
        item
    };
    let rectangle = |low: f64, high: f64, z: f64| {
        contour(&[[low, low, z], [high, low, z], [high, high, z], [low, high, z]])
    };
    let triangle = contour(&[[0.0, 0.0, 0.0], [3.0, 0.5, 0.0], [1.0, 2.0, 0.0]]);
    let structures =
        [("liver", vec![triangle]), ("vessel", vec![rectangle(0.0, 2.0, 1.0), rectangle(0.6, 1.4, 1.0)])];
    let (mut names, mut drawn) = (Vec::new(), Vec::new());
    for (i, (name, contours)) in structures.into_iter().enumerate() {
        let number = (i + 1).to_string();
        let mut structure = Dicom::empty("");
        structure.text((0x3006, 0x0022), b"IS", &number);
        structure.text((0x3006, 0x0026), b"LO", name);
        names.push(structure);
        let mut lines = Dicom::empty("");
        lines.text((0x3006, 0x0084), b"IS", &number);
        lines.sequence((0x3006, 0x0040), &contours);
        drawn.push(lines);
    }
    file.sequence((0x3006, 0x0020), &names);
    file.sequence((0x3006, 0x0039), &drawn);
    vec![file.bytes()]
}
