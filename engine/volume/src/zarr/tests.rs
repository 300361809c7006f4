use std::fs;
use std::io::{Cursor, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DAffine3, DVec3};
use serde_json::{Value, json};
use zarrs::array::codec::{BloscCodec, GzipCodec, ZstdCodec};
use zarrs::array::{ArrayBuilder, data_type};
use zarrs::metadata_ext::codec::blosc::{BloscCompressionLevel, BloscCompressor, BloscShuffleMode};

use super::*;
use crate::{LabelChoice, Volume};

const SIZE: [usize; 3] = [5, 4, 3];
const SCALES: &str = "coordinateTransformations";

fn ramp() -> Vec<f32> {
    (0..60).map(|i| i as f32 - 20.0).collect()
}

fn axis(name: &str) -> Value {
    json!({ "name": name, "type": "space", "unit": "millimeter" })
}

fn scale(numbers: &[f64]) -> Value {
    json!([{ "type": "scale", "scale": numbers }])
}

/// Attributes of a whole image of one resolution, `0`.
fn plain() -> Value {
    json!({ "version": "0.5", "multiscales": [{
        "axes": [axis("z"), axis("y"), axis("x")],
        "datasets": [{ "path": "0", "coordinateTransformations": scale(&[3.0, 2.0, 1.0]) }],
    }]})
}

fn put_group(folder: &Path, ome: &Value) {
    fs::create_dir_all(folder).unwrap();
    let group = json!({ "zarr_format": 3, "node_type": "group", "attributes": { "ome": ome } });
    fs::write(folder.join("zarr.json"), group.to_string()).unwrap();
}

/// A store with the ramp as array `0`, in small chunks.
fn put_image(folder: &Path, ome: &Value) {
    put_group(folder, ome);
    let store = Arc::new(Store::in_folder(folder));
    let mut builder = ArrayBuilder::new(vec![3, 4, 5], vec![2, 3, 2], data_type::int16(), 0_i16);
    builder.bytes_to_bytes_codecs(vec![Arc::new(ZstdCodec::new(3, true))]);
    let array = builder.build(store, "/0").unwrap();
    array.store_metadata().unwrap();
    let values: Vec<i16> = ramp().iter().map(|v| *v as i16).collect();
    array.store_array_subset(&[0..3, 0..4, 0..5], values.as_slice()).unwrap();
}

fn image() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.zarr");
    put_image(&path, &plain());
    (folder, path)
}

fn read(path: &Path) -> Result<Volume> {
    Volume::read(path, &ReadOptions::default())
}

/// The files of a folder as a zip, with a folder around them.
fn zipped(folder: &Path) -> Vec<u8> {
    fn add(zip: &mut zip::ZipWriter<Cursor<Vec<u8>>>, folder: &Path, name: &str) {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = format!("{name}/{}", path.file_name().unwrap().to_string_lossy());
            match path.is_dir() {
                true => add(zip, &path, &name),
                false => {
                    zip.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
                    zip.write_all(&fs::read(path).unwrap()).unwrap();
                }
            }
        }
    }
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    add(&mut zip, folder, "a.zarr");
    zip.finish().unwrap().into_inner()
}

#[test]
fn what_is_written_is_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.zarr");
    let size = [70, 65, 3];
    let samples: Vec<f32> = (0..size.iter().product()).map(|i: usize| (i % 977) as f32 - 300.5).collect();
    let turned = DAffine3::from_rotation_x(0.4) * DAffine3::from_scale(DVec3::new(0.5, 1.0, 2.0));
    let lps = DAffine3::from_scale(DVec3::new(-0.5, -1.0, 2.0));
    for (map, axes) in
        [(turned, "RAS"), (DAffine3::from_translation(DVec3::new(7.0, -80.0, 9.5)) * lps, "LPS")]
    {
        let mut volume = Volume::new(size, map, samples.clone());
        volume.labels.insert(3, "liver".into());
        write(&path, &volume, true).unwrap();
        let back = read(&path).unwrap();
        assert_eq!((back.size, &back.samples), (size, &volume.samples));
        assert_eq!((back.oriented, back.axis_codes().as_str()), (true, axes));
        assert!(back.world_from_voxel.abs_diff_eq(map, 1e-12));
        assert_eq!(back.labels, volume.labels);
        // The coarser resolution is the means, where they lie.
        let levels = levels(&path).unwrap();
        assert_eq!(levels.iter().map(|l| l.size).collect::<Vec<_>>(), [size, [35, 33, 2]]);
        let coarse = Volume::read(&path, &ReadOptions { level: Some(1), ..ReadOptions::default() }).unwrap();
        let means = volume.coarsened(2);
        assert_eq!(coarse.samples, means.samples);
        assert!(coarse.world_from_voxel.abs_diff_eq(means.world_from_voxel, 1e-9));
        // Others have the directions of the axes alone, or none.
        let file = path.join("zarr.json");
        let mut group: Value = serde_json::from_slice(&fs::read(&file).unwrap()).unwrap();
        group["attributes"].as_object_mut().unwrap().remove("vgs");
        fs::write(&file, group.to_string()).unwrap();
        let other = read(&path).unwrap();
        assert_eq!(other.oriented, axes == "LPS");
        assert_eq!(other.world_from_voxel.abs_diff_eq(map, 1e-9), axes == "LPS");
    }
    let unknown = Volume { oriented: false, ..Volume::new(size, turned, samples) };
    write(&path, &unknown, true).unwrap();
    assert!(!read(&path).unwrap().oriented);
    assert_eq!(write(folder.path().join("a.nii"), &unknown, true).unwrap_err().code, "VGS-ZAR-008");
}

#[test]
fn boxes_are_read_across_chunks_and_from_a_zip() {
    let (_folder, path) = image();
    let zip = zipped(&path);
    let inputs = [Input::from(&path), Input::of(Cursor::new(zip.clone()), "a.zarr.zip")];
    let whole = read(&path).unwrap();
    assert_eq!((whole.size, &whole.samples), (SIZE, &ramp()));
    assert_eq!((whole.spacing_mm(), whole.oriented), (DVec3::new(1.0, 2.0, 3.0), false));
    for input in inputs {
        let source = Volume::open(&input, &ReadOptions::default()).unwrap();
        for (first, size) in [([0; 3], SIZE), ([1, 2, 0], [4, 1, 3]), ([4, 3, 2], [1, 1, 1])] {
            let (part, wanted) = (source.read_box(first, size).unwrap(), whole.cropped(first, size));
            assert_eq!((part.size, &part.samples), (size, &wanted.samples));
            assert_eq!(part.world_from_voxel, wanted.world_from_voxel);
        }
        assert_eq!(source.read_box([5, 0, 0], [1; 3]).unwrap_err().code, "VGS-VOL-026");
    }
    // Cut anywhere, a zip is refused.
    for end in [10, zip.len() / 2, zip.len() - 1] {
        let error =
            Volume::read(Input::of(Cursor::new(zip[..end].to_vec()), "a.ozx"), &ReadOptions::default());
        assert_eq!(error.unwrap_err().kind, Kind::BadData, "{end}");
    }
}

#[test]
fn every_codec_and_type_of_both_versions() {
    let folder = tempfile::tempdir().unwrap();
    let blosc = |compressor| {
        let level = BloscCompressionLevel::try_from(5).unwrap();
        Arc::new(BloscCodec::new(compressor, level, None, BloscShuffleMode::BitShuffle, Some(4)).unwrap())
    };
    for codec in ["none", "gzip", "zstd", "blosclz", "lz4", "snappy", "zlib", "blosc zstd", "shards"] {
        let path = folder.path().join(codec);
        put_group(&path, &plain());
        let store = Arc::new(Store::in_folder(&path));
        let mut builder = ArrayBuilder::new(vec![3, 4, 5], vec![2, 4, 4], data_type::float32(), -1000.0_f32);
        match codec {
            "gzip" => _ = builder.bytes_to_bytes_codecs(vec![Arc::new(GzipCodec::new(5).unwrap())]),
            "zstd" => _ = builder.bytes_to_bytes_codecs(vec![Arc::new(ZstdCodec::new(1, true))]),
            "blosclz" => _ = builder.bytes_to_bytes_codecs(vec![blosc(BloscCompressor::BloscLZ)]),
            "lz4" => _ = builder.bytes_to_bytes_codecs(vec![blosc(BloscCompressor::LZ4)]),
            "snappy" => _ = builder.bytes_to_bytes_codecs(vec![blosc(BloscCompressor::Snappy)]),
            "zlib" => _ = builder.bytes_to_bytes_codecs(vec![blosc(BloscCompressor::Zlib)]),
            "blosc zstd" => _ = builder.bytes_to_bytes_codecs(vec![blosc(BloscCompressor::Zstd)]),
            "shards" => _ = builder.subchunk_shape(vec![1, 2, 2]),
            _ => {}
        }
        let array = builder.build(store, "/0").unwrap();
        array.store_metadata().unwrap();
        array.store_array_subset(&[0..3, 0..4, 0..5], ramp().as_slice()).unwrap();
        assert_eq!(read(&path).unwrap().samples, ramp(), "{codec}");
        // A chunk that is missing is the fill value, which is known without reading; of one that is there nothing is.
        fs::remove_file(path.join("0/c/1/0/0")).unwrap();
        let found = read(&path).unwrap().samples;
        let known = |first, size| Volume::open(&path, &ReadOptions::default()).unwrap().known(first, size);
        assert_eq!(known([0, 0, 2], [4, 4, 1]), Some(-1000.0), "{codec}");
        assert_eq!((known([0, 0, 1], [4, 4, 2]), known([0, 0, 2], [5, 4, 1])), (None, None), "{codec}");
        let expected = |i: usize, v: f32| if i / 20 == 2 && i % 5 < 4 { -1000.0 } else { v };
        assert!(found.iter().enumerate().all(|(i, v)| *v == expected(i, ramp()[i])), "{codec}");
        // One that is damaged is an error.
        let chunk = path.join("0/c/0/0/0");
        let bytes = fs::read(&chunk).unwrap();
        fs::write(&chunk, &bytes[..bytes.len() / 2]).unwrap();
        assert_eq!(read(&path).unwrap_err().code, "VGS-ZAR-007", "{codec}");
    }
    // Zarr 2, big-endian, with every type.
    let values = |bytes: &dyn Fn(i64) -> Vec<u8>| (0..8).flat_map(bytes).collect::<Vec<u8>>();
    for (kind, bytes) in [
        ("|b1", values(&|v| vec![u8::from(v > 0)])),
        ("|i1", values(&|v| (v as i8).to_be_bytes().into())),
        ("|u1", values(&|v| (v as u8).to_be_bytes().into())),
        (">i2", values(&|v| (v as i16).to_be_bytes().into())),
        ("<u2", values(&|v| (v as u16).to_le_bytes().into())),
        (">i4", values(&|v| (v as i32).to_be_bytes().into())),
        ("<u4", values(&|v| (v as u32).to_le_bytes().into())),
        (">i8", values(&|v| v.to_be_bytes().into())),
        ("<u8", values(&|v| (v as u64).to_le_bytes().into())),
        (">f2", values(&|v| half::f16::from_f64(v as f64).to_be_bytes().into())),
        ("<f4", values(&|v| (v as f32).to_le_bytes().into())),
        (">f8", values(&|v| (v as f64).to_be_bytes().into())),
    ] {
        let path = folder.path().join("two.zarr");
        fs::create_dir_all(path.join("0")).unwrap();
        fs::write(path.join(".zgroup"), r#"{"zarr_format": 2}"#).unwrap();
        fs::write(path.join(".zattrs"), plain().to_string()).unwrap();
        let fill = if kind == "|b1" { json!(false) } else { json!(0) };
        let array = json!({ "zarr_format": 2, "shape": [2, 2, 2], "chunks": [2, 2, 2], "dtype": kind, "order": "C",
            "compressor": null, "fill_value": fill, "filters": null, "dimension_separator": "/" });
        fs::write(path.join("0/.zarray"), array.to_string()).unwrap();
        fs::create_dir_all(path.join("0/0/0")).unwrap();
        fs::write(path.join("0/0/0/0"), bytes).unwrap();
        let expected = |i: usize| if kind == "|b1" { f32::from(i > 0) } else { i as f32 };
        assert_eq!(read(&path).unwrap().samples, (0..8).map(expected).collect::<Vec<_>>(), "{kind}");
    }
}

#[test]
fn axes_units_and_directions() {
    let (folder, path) = image();
    let with = |change: &dyn Fn(&mut Value)| {
        let mut ome = plain();
        change(&mut ome["multiscales"][0]);
        put_group(&path, &ome);
        read(&path)
    };
    let found = with(&|image| {
        for (k, unit) in ["micrometer", "centimeter", "meter"].into_iter().enumerate() {
            image["axes"][k]["unit"] = json!(unit);
        }
        image[SCALES] = json!([{ "type": "scale", "scale": [1.0, 1.0, 0.5] }]);
    });
    assert!(found.unwrap().spacing_mm().abs_diff_eq(DVec3::new(500.0, 20.0, 0.003), 1e-12));
    let found = with(&|image| {
        for (k, value) in
            ["superior-to-inferior", "anterior-to-posterior", "right-to-left"].into_iter().enumerate()
        {
            image["axes"][k]["orientation"] = json!({ "type": "anatomical", "value": value });
        }
        let steps = image["datasets"][0][SCALES].as_array_mut().unwrap();
        steps.push(json!({ "type": "translation", "translation": [10.0, 20.0, 30.0] }));
    });
    let found = found.unwrap();
    assert_eq!((found.oriented, found.axis_codes().as_str()), (true, "LPI"));
    assert_eq!(found.world_from_voxel.translation, DVec3::new(-30.0, -20.0, -10.0));
    // The axes of space by their names, in any order.
    let found = with(&|image| {
        image["axes"] = json!([axis("x"), axis("y"), axis("z")]);
        image["datasets"][0][SCALES] = scale(&[1.0, 2.0, 3.0]);
    });
    let found = found.unwrap();
    assert_eq!((found.size, found.spacing_mm()), ([3, 4, 5], DVec3::new(1.0, 2.0, 3.0)));
    assert_eq!(found.samples[found.index(2, 1, 4)], ramp()[4 + 5 + 2 * 20]);
    // Times and channels count volumes.
    fs::remove_dir_all(path.join("0")).unwrap();
    let store = Arc::new(Store::in_folder(&path));
    let array =
        ArrayBuilder::new(vec![2, 3, 1, 1, 2], vec![1; 5], data_type::uint8(), 0_u8).build(store, "/0");
    let array = array.unwrap();
    array.store_metadata().unwrap();
    array
        .store_array_subset(&[0..2, 0..3, 0..1, 0..1, 0..2], (0..12_u8).collect::<Vec<_>>().as_slice())
        .unwrap();
    let mut ome = plain();
    let times = [json!({ "name": "t", "type": "time" }), json!({ "name": "c", "type": "channel" })];
    ome["multiscales"][0]["axes"] = json!([times[0], times[1], axis("z"), axis("y"), axis("x")]);
    ome["multiscales"][0]["datasets"][0][SCALES] = scale(&[1.0, 1.0, 3.0, 2.0, 1.0]);
    put_group(&path, &ome);
    assert_eq!(read(&path).unwrap_err().code, "VGS-VOL-020");
    let options = ReadOptions { volume_index: Some(4), ..ReadOptions::default() };
    assert_eq!(Volume::read(&path, &options).unwrap().samples, [8.0, 9.0]);
    drop(folder);
}

#[test]
fn what_is_no_image_is_refused_by_name() {
    let (_folder, path) = image();
    let options = |level, max_bytes| ReadOptions { level, max_bytes, ..ReadOptions::default() };
    let code = |options: &ReadOptions| Volume::read(&path, options).unwrap_err().code;
    assert_eq!(code(&options(Some(1), 1 << 20)), "VGS-ZAR-006");
    assert_eq!(code(&options(None, 4 * 59)), "VGS-VOL-005");
    // The array alone, a group around images, and arrays of other kinds.
    assert_eq!(read(&path.join("0")).unwrap_err().code, "VGS-ZAR-001");
    let around = path.with_file_name("around.zarr");
    put_group(&around, &json!({}));
    put_image(&around.join("labels/liver"), &plain());
    put_group(&around.join("labels"), &json!({}));
    let error = read(&around).unwrap_err();
    assert_eq!(error.code, "VGS-ZAR-001");
    assert!(error.to_string().contains("labels/liver"), "{error}");
    let mask = Volume::read_mask(
        around.join("labels/liver"),
        &ReadOptions::default(),
        &LabelChoice::Whole,
        &read(&path).unwrap(),
    );
    assert_eq!(mask.unwrap().samples, ramp());
    let array = path.join("0/zarr.json");
    let good = fs::read_to_string(&array).unwrap();
    let pretty: Value = serde_json::from_str(&good).unwrap();
    assert_eq!(pretty["shape"], json!([3, 4, 5]));
    let good = pretty.to_string();
    let change = |from: &str, to: &str| {
        assert!(good.contains(from), "{from}: {good}");
        fs::write(&array, good.replace(from, to)).unwrap();
        read(&path).map_or_else(|e| e.code, |_| "read")
    };
    assert_eq!(change("\"int16\"", "\"complex64\""), "VGS-ZAR-004");
    assert_eq!(change("\"int16\"", "\"string\""), "VGS-ZAR-004");
    assert_eq!(change("[3,4,5]", "[3,4]"), "VGS-ZAR-004");
    assert_eq!(change("[3,4,5]", "[3,0,5]"), "VGS-ZAR-004");
    assert_eq!(change("[2,3,2]", "[2,0,2]"), "VGS-ZAR-004");
    assert_eq!(change("[3,4,5]", "[3000000000,4000000000,5000000000]"), "VGS-VOL-005");
    assert_eq!(change("[2,3,2]", "[2000000,3000000,2000000]"), "VGS-VOL-005");
    assert_eq!(change("zstd", "lzma"), "VGS-ZAR-004");
    fs::remove_file(&array).unwrap();
    assert_eq!(read(&path).unwrap_err().code, "VGS-ZAR-004");
}

#[test]
fn no_claim_of_a_chunk_takes_the_memory() {
    let (_folder, path) = image();
    let chunk = path.join("0/c/0/0/0");
    // A frame of zstd whose header claims 2^60 bytes, and one of many runs of 128 KiB.
    let claim = [&[0x28, 0xb5, 0x2f, 0xfd, 0xe0][..], &(1_u64 << 60).to_le_bytes(), &[1, 0, 0]].concat();
    let run = [0x02, 0x00, 0x10, 0x00];
    let runs = [&[0x28, 0xb5, 0x2f, 0xfd, 0x00, 0x58][..], &run.repeat(100_000), &[1, 0, 0]].concat();
    for bytes in [claim, runs, vec![0; 2 << 20]] {
        fs::write(&chunk, bytes).unwrap();
        let error = read(&path).unwrap_err();
        assert_eq!((error.kind, error.code), (Kind::BadData, "VGS-ZAR-007"), "{error}");
    }
}

#[test]
fn no_attribute_that_cannot_be_read_counts_as_absent() {
    let (_folder, path) = image();
    for row in FIELDS {
        for wrong in row.refused {
            let wrong: Value = serde_json::from_str(wrong).unwrap();
            let mut ome = plain();
            let mut own = json!({});
            let image = &mut ome["multiscales"][0];
            match row.name {
                "multiscales" => ome["multiscales"] = wrong.clone(),
                "axes" | "datasets" => image[row.name] = wrong.clone(),
                "unit" | "orientation" => image["axes"][0][row.name] = wrong.clone(),
                "path" | "coordinateTransformations" => image["datasets"][0][row.name] = wrong.clone(),
                name => own[name] = wrong.clone(),
            }
            let attributes = json!({ "ome": ome, "vgs": own });
            let group = json!({ "zarr_format": 3, "node_type": "group", "attributes": attributes });
            fs::write(path.join("zarr.json"), group.to_string()).unwrap();
            let error = read(&path).map(|_| ()).expect_err(&format!("{}: {wrong}", row.name));
            assert_eq!((error.kind, error.code), (Kind::BadData, "VGS-ZAR-003"), "{}: {error}", row.name);
        }
        if row.absent.is_empty() {
            let mut ome = plain();
            let image = &mut ome["multiscales"][0];
            match row.name {
                "multiscales" => ome = json!({}),
                "axes" | "datasets" => _ = image.as_object_mut().unwrap().remove(row.name),
                name => _ = image["datasets"][0].as_object_mut().unwrap().remove(name),
            }
            put_group(&path, &ome);
            assert_eq!(read(&path).unwrap_err().kind, Kind::BadData, "{}", row.name);
        }
    }
}
