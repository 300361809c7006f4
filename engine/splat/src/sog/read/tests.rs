//! Files of our own, files as others write them, and files that are wrong.

use std::io::Write;

use glam::DVec3;
use image_webp::{ColorType, WebPEncoder};
use serde_json::{Value, json};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::*;
use crate::SNIFF_BYTES;
use crate::file::tests::read_both;
use crate::ordinary::tests::{Errors, check, coloured, in_order, many, rows};
use crate::{describe, write};
use base::unit::Unit;

/// The files of a bundle by their names.
type Files = Vec<(String, Vec<u8>)>;

fn zipped(files: &[(String, Vec<u8>)], method: CompressionMethod) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, content) in files {
        let options = SimpleFileOptions::default().compression_method(method);
        zip.start_file(name.as_str(), options).expect("a file");
        zip.write_all(content).expect("memory takes it");
    }
    zip.finish().expect("memory takes it").into_inner()
}

fn webp(size: [u32; 2], colours: ColorType, pixels: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    WebPEncoder::new(&mut out).encode(pixels, size[0], size[1], colours).expect("an image");
    out
}

/// Returns the files of two splats in images of 2 x 2 pixels: at (1, −2, 0.5) m along the axes of the file and at the origin,
/// as others write them.
fn two() -> Files {
    let log = |v: f64| v.signum() * (v.abs() + 1.0).ln();
    let codes = |second: f64| {
        let mut codes = vec![json!(0.0); 256];
        (codes[0], codes[7]) = (json!(-1.0), json!(second));
        codes
    };
    let meta = json!({
        "version": 2,
        "asset": { "generator": "by hand" },
        "count": 2,
        "means": {
            "mins": [0.0, log(-2.0), 0.0],
            "maxs": [log(1.0), 0.0, log(0.5)],
            "files": ["low.webp", "high.webp"],
        },
        "scales": { "codebook": codes(-4.0), "files": ["scales.webp"] },
        "quats": { "files": ["quats.webp"] },
        "sh0": { "codebook": codes(1.5), "files": ["sh0.webp"] },
        "shN": { "count": 65, "bands": 1, "codebook": codes(0.25), "files": ["rows.webp", "labels.webp"] },
    });
    let means = [255, 0, 255, 0, 255, 0, 9, 9, 9, 9, 9, 9];
    // A quarter turn about the file's z: w and z are ½√2 and w is left out; and none.
    let quarter = [[128, 128, 255, 252], [128, 128, 128, 252], [0; 4], [0; 4]].concat();
    let mut palette = vec![0; 3 * 192 * 2];
    // Row 64 is the first of the second line: its third function is green.
    palette[3 * (192 + 2) + 1] = 7;
    let rgb = |pixels: &[u8]| webp([2, 2], ColorType::Rgb8, pixels);
    [
        ("low.webp", rgb(&means)),
        ("high.webp", rgb(&means)),
        ("scales.webp", rgb(&[7, 7, 0, 7, 7, 7, 0, 0, 0, 0, 0, 0])),
        ("quats.webp", webp([2, 2], ColorType::Rgba8, &quarter)),
        ("sh0.webp", webp([2, 2], ColorType::Rgba8, &[7, 0, 0, 255, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0])),
        ("rows.webp", webp([192, 2], ColorType::Rgb8, &palette)),
        ("labels.webp", rgb(&[64, 0, 0, 1, 0, 0, 255, 255, 0, 0, 0, 0])),
        ("meta.json", meta.to_string().into_bytes()),
    ]
    .map(|(name, content)| (name.to_owned(), content))
    .to_vec()
}

/// Returns the files with another one of a name, or without it.
fn with(name: &str, content: Option<Vec<u8>>) -> Files {
    let mut files = two();
    files.retain(|(own, _)| own != name);
    files.extend(content.map(|content| (name.to_owned(), content)));
    files
}

/// Returns the files with another value in `meta.json`, or without it.
fn with_meta(pointer: &str, value: Option<Value>) -> Files {
    let (_, text) = two().pop().expect("meta.json");
    let mut meta: Value = serde_json::from_slice(&text).expect("JSON");
    let (parent, key) = pointer.rsplit_once('/').expect("a pointer");
    match (meta.pointer_mut(parent).expect("a place"), value) {
        (Value::Object(parent), None) => drop(parent.remove(key)),
        (Value::Array(parent), Some(value)) => parent[key.parse::<usize>().expect("a number")] = value,
        (parent, value) => parent[key] = value.expect("a value"),
    }
    with("meta.json", Some(meta.to_string().into_bytes()))
}

fn stored(files: &[(String, Vec<u8>)]) -> Vec<u8> {
    zipped(files, CompressionMethod::Stored)
}

#[test]
fn what_is_written_is_read() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.sog");
    let set = many();
    write(&path, &set, false).expect("a file");
    let found = crate::read(&path, &ReadOptions::default()).expect("the same splats");
    let allowed = Errors { place_mm: 0.003, shape: 0.035, opacity: 0.5 / 255.0 + 1e-6, colour: 0.03 };
    check(&set, &in_order(&set, rows(&found), |v| v), |v| v, &allowed);
    assert_eq!((found.unit, found.labels.as_ref(), found.grid), (Unit::Luminance, None, None));
    let summary = describe(&path, &ReadOptions::default()).expect("a description");
    assert_eq!((summary.format, summary.layout, summary.splats), ("sog", "3dgs", set.splats.len()));
    assert_eq!((summary.encoding.as_str(), summary.harmonics_degree), ("version 2, lossless WebP", Some(2)));
    // A second time opacities are not rounded any more, and other numbers hardly; the palette may be a shorter one.
    write(&path, &found, true).expect("a file");
    let again = crate::read(&path, &ReadOptions::default()).expect("the same splats");
    let allowed = Errors { place_mm: 0.003, shape: 0.01, opacity: 1e-6, colour: 0.02 };
    check(&found, &in_order(&found, rows(&again), |v| v), |v| v, &allowed);
}

#[test]
fn degrees_zero_to_three_are_read_and_few_splats_exactly() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.sog");
    for degree in 0..=3u8 {
        let mut set = coloured();
        let floats = 60 * 3 * basis_count(degree);
        let coefficients = (0..floats).map(|i| f32::from(((i * 7) % 200) as u8) * 0.01 - 1.0).collect();
        set.colours = Some(Harmonics { degree, coefficients });
        write(&path, &set, true).expect("a file");
        let found = crate::read(&path, &ReadOptions::default()).expect("the same splats");
        assert_eq!(found.colours.as_ref().map(|colours| colours.degree), Some(degree));
        let allowed = Errors { place_mm: 0.003, shape: 0.03, opacity: 0.002, colour: 0.02 };
        check(&set, &in_order(&set, rows(&found), |v| v), |v| v, &allowed);
    }
}

#[test]
fn files_of_others_are_read() {
    let lost = with_meta("/sh0/codebook/0", Some(json!(null)));
    for (name, file, first) in [
        ("stored", stored(&two()), -1.0),
        ("packed", zipped(&two(), CompressionMethod::Deflated), -1.0),
        ("without the first number of a codebook", stored(&lost), 0.0),
    ] {
        let set = read_both(read, &file, &ReadOptions::default()).unwrap_or_else(|e| panic!("{name}: {e}"));
        let [splat, second] = &set.splats[..] else { panic!("{name}: two splats") };
        // Right, down, front are x, −z, y of RAS.
        for (splat, wanted) in [(splat, [1000.0, 500.0, 2000.0]), (second, [0.0; 3])] {
            let off = DVec3::from_array(splat.mean.map(f64::from)).distance(wanted.into());
            // The low bytes are 0 where 2 m have the step 0 of 65535.
            assert!(off < 1e-2, "{name}: {:?}", splat.mean);
        }
        assert!(splat.opacity() > 0.999_999 && second.opacity() < 1e-6, "{name}");
        // x of the splat lies along y of the file, which is −z of RAS.
        let along = splat.axes().x_axis;
        assert!((along.z.abs() - 1.0).abs() < 1e-3, "{name}: {along}");
        let sigma = [-4.0, -4.0, -1.0].map(|log| log + 1000f32.ln());
        assert!((0..3).all(|k| (splat.log_scale[k] - sigma[k]).abs() < 1e-5), "{name}");
        let colours = set.colours.as_ref().expect("colours");
        let own = [1.5, first, first].map(|c| 0.5 + 0.282_094_8 * c);
        // Row 64 has −1 for all but green of the third function of degree 1, −0.4886 x of the file.
        for (direction, x) in [([1.0, 0.0, 0.0], 1.0f64), ([-1.0, 0.0, 0.0], -1.0)] {
            let found = colours.colour(0, direction);
            let wanted = [0, 1, 2].map(|c| {
                let coefficient = if c == 1 { 0.25 } else { -1.0 };
                (own[c] - 0.488_602_5 * x * coefficient).max(0.0)
            });
            assert!((0..3).all(|c| (found[c] - wanted[c]).abs() < 1e-5), "{name}: {found:?} {wanted:?}");
        }
    }
}

#[test]
fn what_is_wrong_is_refused_by_name() {
    let files = two();
    let file = |name: &str| files.iter().find(|(own, _)| own == name).expect(name).1.clone();
    let whole = stored(&files);
    let changed = |name: &str, at: usize, bytes: &[u8]| {
        let mut content = file(name);
        content[at..at + bytes.len()].copy_from_slice(bytes);
        with(name, Some(content))
    };
    let small = webp([1, 1], ColorType::Rgb8, &[0; 3]);
    let large = webp([1100, 1100], ColorType::Rgb8, &vec![0; 3 * 1100 * 1100]);
    let narrow = webp([128, 3], ColorType::Rgb8, &[0; 3 * 128 * 3]);
    let lossy = b"RIFF\x16\0\0\0WEBPVP8 \x0a\0\0\0\x10\0\0\x9d\x01\x2a\x02\0\x02\0".to_vec();
    let strict = ReadOptions { strict: true, max_splats: 1000 };
    let (damaged, count) = ("VGS-SOG-001", |count: u64| with_meta("/count", Some(json!(count))));
    for (name, file, code, word) in [
        ("cut off", whole[..whole.len() - 1].to_vec(), damaged, "zip"),
        ("half of it", whole[..whole.len() / 2].to_vec(), damaged, "zip"),
        ("no meta.json", stored(&with("meta.json", None)), damaged, "meta.json is not"),
        ("no image", stored(&with("quats.webp", None)), damaged, "quats.webp is not"),
        ("no palette", stored(&with("rows.webp", None)), damaged, "rows.webp is not"),
        ("no JSON", stored(&with("meta.json", Some(b"{".to_vec()))), damaged, "meta.json"),
        ("version 1", stored(&with_meta("/version", None)), "VGS-SOG-002", "version 1"),
        ("version 3", stored(&with_meta("/version", Some(json!(3)))), "VGS-SOG-002", "version 3"),
        ("no means", stored(&with_meta("/means", None)), damaged, "missing field `means`"),
        ("no count", stored(&with_meta("/count", None)), damaged, "missing field `count`"),
        ("no ends", stored(&with_meta("/means/maxs", None)), damaged, "missing field `maxs`"),
        ("no codebook", stored(&with_meta("/scales/codebook", None)), damaged, "missing field `codebook`"),
        ("a file less", stored(&with_meta("/means/files", Some(json!(["low.webp"])))), damaged, "meta.json"),
        ("a codebook too short", stored(&with_meta("/sh0/codebook", Some(json!([1])))), damaged, "number 7"),
        ("an empty codebook", stored(&with_meta("/sh0/codebook", Some(json!([])))), damaged, "sh0"),
        ("null", stored(&with_meta("/scales/codebook/3", Some(json!(null)))), damaged, "scales"),
        ("degree 4", stored(&with_meta("/shN/bands", Some(json!(4)))), damaged, "degree 4"),
        ("another degree", stored(&with_meta("/shN/bands", Some(json!(2)))), damaged, "rows.webp"),
        ("a row that is not there", stored(&with_meta("/shN/count", Some(json!(64)))), damaged, "row 64"),
        ("a palette too long", stored(&with_meta("/shN/count", Some(json!(129)))), damaged, "rows.webp"),
        ("a palette of another width", stored(&with("rows.webp", Some(narrow))), damaged, "128 pixels wide"),
        ("too many splats", stored(&count(1001)), "VGS-SOG-003", "1001"),
        ("absurdly many", stored(&count(u64::MAX)), "VGS-SOG-003", "at most 1000"),
        ("more splats than pixels", stored(&count(5)), damaged, "2 x 2 pixels, and 5"),
        ("an image too small", stored(&with("scales.webp", Some(small))), damaged, "1 x 1 pixels, and 2"),
        ("an image too large", stored(&with("sh0.webp", Some(large))), damaged, "1100 x 1100"),
        (
            "an image that claims more",
            stored(&changed("sh0.webp", 21, &[0xff, 0xef, 0xff, 0x13])),
            damaged,
            "sh0.webp claims",
        ),
        ("no WebP", stored(&changed("low.webp", 0, b"PNG")), damaged, "low.webp"),
        ("a lossy image", stored(&with("high.webp", Some(lossy))), "VGS-SOG-004", "high.webp"),
        (
            "no rotation",
            stored(&with("quats.webp", Some(webp([2, 2], ColorType::Rgba8, &[9; 16])))),
            damaged,
            "splat 0 has alpha 9",
        ),
    ] {
        let error = read_both(read, &file, &strict).err().unwrap_or_else(|| panic!("{name}: it was read"));
        assert_eq!((error.kind, error.code), (Kind::BadData, code), "{name}: {error}");
        assert!(error.message.contains(word) && error.file.is_some(), "{name}: {error}");
        assert!(!error.help.is_empty(), "{name}");
    }
    // A zip that unpacks to much more.
    let bomb = zipped(&with("low.webp", Some(vec![0; 1 << 24])), CompressionMethod::Deflated);
    let error = read_both(read, &bomb, &strict).expect_err("a bomb");
    assert!(error.code == damaged && error.message.contains("claims 16777216 bytes"), "{error}");
}

#[test]
fn no_byte_that_is_changed_makes_it_panic() {
    for file in [stored(&two()), zipped(&two(), CompressionMethod::Deflated)] {
        for at in 0..file.len() {
            for flip in [0xff, 1, 0x80] {
                let mut file = file.clone();
                file[at] ^= flip;
                let _ = read(&Input::of(Cursor::new(file), "changed"), &ReadOptions::default());
            }
        }
    }
    // The same within the images, with the checksums of the zip as they should be.
    for (name, content) in two() {
        for at in 0..content.len() {
            for flip in [0xff, 1, 0x10] {
                let mut content = content.clone();
                content[at] ^= flip;
                let file = stored(&with(&name, Some(content)));
                let _ = read(&Input::of(Cursor::new(file), "changed"), &ReadOptions::default());
            }
        }
    }
}

#[test]
fn a_bundle_is_known_by_its_first_file() {
    let order = |first: &str| {
        let mut files = two();
        files.sort_by_key(|(name, _)| name != first);
        files
    };
    for method in [CompressionMethod::Stored, CompressionMethod::Deflated] {
        for first in ["meta.json", "low.webp"] {
            assert!(sniff(&zipped(&order(first), method)[..SNIFF_BYTES as usize]), "{first}");
        }
    }
    let others = |name: &str, content: &[u8]| stored(&[(name.to_owned(), content.to_vec())]);
    for (name, content) in [("meta.json", &b"{\"PatientName\":1}"[..]), ("IM1", b"DICM"), ("a/b.webp", b"")] {
        assert!(!sniff(&others(name, content)), "{name}");
    }
    assert!(!sniff(b"") && !sniff(b"PK\x03\x04") && !sniff(&[0; 1024]));
    assert_eq!(unpacked_rotation([0, 0, 0, 251]), None);
}
