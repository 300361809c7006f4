//! Files of our own, of others, and files that are wrong.

use glam::DQuat;
use serde_json::json;

use super::*;
use crate::file::tests::read_both;
use crate::ordinary::tests::{Errors, check, coloured, rows};
use crate::region::tests::region_of;
use crate::{Field, Form, Grid, Kernel, WriteOptions, describe, write, write_as};

fn file_of(json: &Value, binary: &[u8]) -> Vec<u8> {
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let length = 12 + 8 + text.len() + 8 + binary.len();
    let mut out = b"glTF\x02\0\0\0".to_vec();
    out.extend((length as u32).to_le_bytes());
    out.extend((text.len() as u32).to_le_bytes());
    out.extend(b"JSON");
    out.extend(text);
    out.extend((binary.len() as u32).to_le_bytes());
    out.extend(b"BIN\0");
    out.extend(binary);
    out
}

fn read_bytes(bytes: &[u8]) -> Result<SplatSet> {
    read_both(read, bytes, &ReadOptions::default())
}

/// A file of two splats as others may write it: a node that turns, scales and moves them, numbers of 8 and 16 bits, rows
/// of one view, and colours in linear light.
fn foreign() -> (Value, Vec<u8>) {
    let mut binary = Vec::new();
    for (place, opacity) in [([1.0f32, 0.0, 0.0], 255u8), ([0.0, 2.0, 0.0], 51)] {
        binary.extend(place.iter().flat_map(|v| v.to_le_bytes()));
        // x, y, z, w: a quarter turn about z.
        binary.extend([0i16, 0, 23170, 23170].iter().flat_map(|v| v.to_le_bytes()));
        binary.extend([0.1f32, 0.2, 0.3].iter().flat_map(|v| v.to_le_bytes()));
        binary.extend([opacity, 0, 0, 0]);
        binary.extend([0.0f32, -0.5 / SH0, 0.5 / SH0].iter().flat_map(|v| v.to_le_bytes()));
    }
    let accessor = |offset: usize, kind: u32, shape: &str, normalized: bool| {
        json!({ "bufferView": 0, "byteOffset": offset, "componentType": kind, "count": 2, "type": shape,
                "normalized": normalized })
    };
    let document = json!({
        "asset": { "version": "2.0" },
        "extensionsUsed": [NAME],
        "extensionsRequired": [NAME],
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "children": [1], "translation": [0.0, 10.0, 0.0] },
                  { "mesh": 0, "rotation": [0.0, 0.5f64.sqrt(), 0.0, 0.5f64.sqrt()], "scale": [2.0, 2.0, 2.0] }],
        "meshes": [{ "primitives": [
            { "attributes": { "POSITION": 0 }, "mode": 4 },
            { "attributes": {
                "POSITION": 0, "KHR_gaussian_splatting:ROTATION": 1, "KHR_gaussian_splatting:SCALE": 2,
                "KHR_gaussian_splatting:OPACITY": 3, "KHR_gaussian_splatting:SH_DEGREE_0_COEF_0": 4 },
              "mode": 0,
              "extensions": { NAME: { "kernel": "ellipse", "colorSpace": "lin_rec709_display" } } },
        ] }],
        "buffers": [{ "byteLength": binary.len() }],
        "bufferViews": [{ "buffer": 0, "byteLength": binary.len(), "byteStride": 48 }],
        "accessors": [
            accessor(0, 5126, "VEC3", false), accessor(12, 5122, "VEC4", true), accessor(20, 5126, "VEC3", false),
            accessor(32, 5121, "SCALAR", true), accessor(36, 5126, "VEC3", false),
        ],
    });
    (document, binary)
}

#[test]
fn colours_that_are_written_are_read() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.glb");
    let mut set = coloured();
    set.labels = Some((0..set.splats.len()).map(|i| if i % 3 == 0 { 5 } else { 255 }).collect());
    set.label_names = vec![(5, "liver".to_owned())];
    write(&path, &set, false).expect("a file");
    let found = crate::read(&path, &ReadOptions::default()).expect("the same splats");
    let allowed = Errors { place_mm: 1e-4, shape: 1e-5, opacity: 1e-6, colour: 1e-5 };
    check(&set, &rows(&found), |v| v, &allowed);
    assert!(found.origin_mm.distance(set.origin_mm) < 1e-9);
    assert_eq!((found.labels, found.label_names), (set.labels, set.label_names));
    assert_eq!((found.unit, found.field.kernel), (Unit::Luminance, Kernel::Gaussian));
    let summary = describe(&path, &ReadOptions::default()).expect("a description");
    assert_eq!((summary.format, summary.splats, summary.harmonics_degree), ("glb", 60, Some(2)));
}

/// A set with all that a set of intensities can have, and the same splats with colours, widened.
fn both() -> (SplatSet, SplatSet) {
    let mut colours = coloured();
    let grid = Grid {
        size: [40, 50, 60],
        world_from_voxel: DAffine3::from_scale_rotation_translation(
            DVec3::new(1.0, 1.5, 2.0),
            DQuat::from_rotation_z(0.3),
            DVec3::new(7.0, 8.0, 900.0),
        ),
    };
    let mut made_of = SplatSet {
        colours: None,
        unit: Unit::Hu,
        field: Field { background: -3.5, epsilon: 0.002, ..Field::default() },
        labels: Some((0..60).map(|i| [3, 0, 7][i % 3]).collect()),
        label_names: vec![(3, "left atrium".to_owned()), (7, "aorta".to_owned())],
        iterations: Some(400),
        grid: Some(grid),
        volume_crc32: Some(0xdead_beef),
        form: Form::Grid,
        region: Some(region_of(&[([1, 2, 3], 3), ([29, 29, 29], 7)])),
        ..colours.clone()
    };
    for (i, (own, splat)) in made_of.splats.iter_mut().zip(&mut colours.splats).enumerate() {
        own.intensity = 37.25 * i as f32 - 1000.0;
        let widening = 0.98 + 0.01 * i as f32;
        splat.log_scale = own.log_scale.map(|log| log + widening.ln());
        splat.set_opacity(0.1);
    }
    colours.labels = made_of.labels.clone();
    (made_of, colours)
}

#[test]
fn intensities_come_back_with_all_that_was_stated() {
    let folder = tempfile::tempdir().expect("a folder");
    let (glb, ply) = (folder.path().join("a.glb"), folder.path().join("a.ply"));
    for unit in [Unit::Hu, Unit::Arbitrary] {
        let (made_of, colours) = both();
        let made_of = SplatSet { unit, ..made_of };
        let options = WriteOptions { made_of: Some(&made_of), force: true, ..WriteOptions::default() };
        write_as(&glb, &colours, &options).expect("a file");
        let bytes = crate::file_bytes(&glb, &colours, &options).expect("bytes");
        assert_eq!(bytes, std::fs::metadata(&glb).expect("a file").len());
        let found = crate::read(&glb, &ReadOptions::default()).expect("the same set");
        let exactly = |set: &SplatSet| SplatSet { splats: Vec::new(), origin_mm: DVec3::ZERO, ..set.clone() };
        assert_eq!(exactly(&found), exactly(&made_of), "but for rounding");
        assert!(found.origin_mm.distance(made_of.origin_mm) < 1e-9);
        for (i, (a, b)) in found.splats.iter().zip(&made_of.splats).enumerate() {
            assert_eq!((a.intensity, a.opacity_logit), (b.intensity, b.opacity_logit), "splat {i}");
            assert!(
                (0..3).all(|k| (a.mean[k] - b.mean[k]).abs() < 2e-5),
                "splat {i}: {:?} {:?}",
                a.mean,
                b.mean
            );
            assert!((0..3).all(|k| (a.log_scale[k] - b.log_scale[k]).abs() < 2e-6), "splat {i}");
            let apart = a.axes() - b.axes();
            assert!(apart.to_cols_array().iter().all(|v| v.abs() < 1e-6), "splat {i}");
        }
        // And once more as a PLY, which is exact.
        write(&ply, &found, true).expect("a file");
        assert_eq!(crate::read(&ply, &ReadOptions::default()).expect("a set"), found);
        let summary = describe(&glb, &ReadOptions::default()).expect("a description");
        assert_eq!((summary.layout, summary.unit, summary.region_voxels), ("vgs", unit, Some(2)));
    }
}

#[test]
fn a_node_that_another_program_moves_takes_the_grid_along() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.glb");
    let (made_of, colours) = both();
    let options = WriteOptions { made_of: Some(&made_of), ..WriteOptions::default() };
    write_as(&path, &colours, &options).expect("a file");
    let bytes = std::fs::read(&path).expect("the file");
    let json = u32::from_le_bytes(bytes[12..16].try_into().expect("four bytes")) as usize;
    let mut document: Value = serde_json::from_slice(&bytes[20..20 + json]).expect("JSON");
    let parent = json!({ "children": [0], "translation": [0.1, 0.0, 0.0], "rotation": [0.0, 1.0, 0.0, 0.0] });
    document["nodes"].as_array_mut().expect("nodes").push(parent);
    document["scenes"][0]["nodes"] = json!([1]);
    let moved = read_bytes(&file_of(&document, &bytes[28 + json..])).expect("a set");
    // Half a turn about the axis to the head, and 100 mm to the patient's left.
    let place =
        |set: &SplatSet, i: usize| DVec3::from_array(set.splats[i].mean.map(f64::from)) + set.origin_mm;
    let in_voxels = |set: &SplatSet, i: usize| {
        set.grid.expect("a grid").world_from_voxel.inverse().transform_point3(place(set, i))
    };
    for i in 0..60 {
        let (x, wanted) = (place(&made_of, i), place(&moved, i));
        assert!(wanted.distance(DVec3::new(-x.x - 100.0, -x.y, x.z)) < 1e-3, "splat {i}");
        assert!(in_voxels(&moved, i).distance(in_voxels(&made_of, i)) < 1e-3, "splat {i}");
    }
}

#[test]
fn files_of_others_are_read_where_their_nodes_put_them() {
    let (document, binary) = foreign();
    let set = read_bytes(&file_of(&document, &binary)).expect("two splats");
    let world = |i: usize| DVec3::from_array(set.splats[i].mean.map(f64::from)) + set.origin_mm;
    // A quarter turn about y takes x to −z of glTF, which is the back: −y of RAS; up is z.
    assert!(world(0).distance(DVec3::new(0.0, -2000.0, 10_000.0)) < 1e-2, "{}", world(0));
    assert!(world(1).distance(DVec3::new(0.0, 0.0, 14_000.0)) < 1e-2, "{}", world(1));
    let scale = set.splats[0].scale();
    assert!((0..3).all(|k| (scale[k] / [200.0, 400.0, 600.0][k] - 1.0).abs() < 1e-4), "{scale:?}");
    // x of the splat lies along y of its mesh, which stays up.
    assert!((set.splats[0].axes().x_axis.z.abs() - 1.0).abs() < 1e-6);
    assert!(set.splats[0].opacity() > 0.999_999 && (set.splats[1].opacity() - 0.2).abs() < 1e-6);
    let colour = set.colours.as_ref().expect("colours").colour(0, [0.0, 0.0, 1.0]);
    assert!((colour[0] - 0.735_357).abs() < 1e-4 && colour[1].abs() < 1e-4 && (colour[2] - 1.0).abs() < 1e-4);

    // The same mesh shown by a second node, and colours with a degree more.
    let mut more = document.clone();
    let attributes = &mut more["meshes"][0]["primitives"][1]["attributes"];
    for k in 0..3 {
        attributes[format!("{NAME}:SH_DEGREE_1_COEF_{k}")] = json!(4);
    }
    let primitives = more["meshes"][0]["primitives"].as_array_mut().expect("primitives");
    let second = primitives[1].clone();
    primitives[0] = second;
    primitives[0]["attributes"] = document["meshes"][0]["primitives"][1]["attributes"].clone();
    let set = read_bytes(&file_of(&more, &binary)).expect("four splats");
    let colours = set.colours.expect("colours");
    assert_eq!((set.splats.len(), colours.degree), (4, 1));
    let lit = |i: usize| colours.of(i)[3..].iter().any(|c| c.abs() > 1e-6);
    assert!(!lit(0) && lit(2), "the first has a degree less");
    assert_eq!(set.splats[0], set.splats[2]);
}

#[test]
fn what_is_wrong_is_refused_by_name() {
    let (document, binary) = foreign();
    let with = |change: &dyn Fn(&mut Value)| {
        let mut changed = document.clone();
        change(&mut changed);
        file_of(&changed, &binary)
    };
    let splatting = "/meshes/0/primitives/1";
    let set = |place: &str, value: Value| {
        let (parent, key) = place.rsplit_once('/').expect("a place");
        with(&|document| {
            let parent = document.pointer_mut(parent).expect("a place");
            match parent.as_array_mut() {
                Some(rows) => rows[key.parse::<usize>().expect("a number")] = value.clone(),
                None => parent[key] = value.clone(),
            }
        })
    };
    let whole = file_of(&document, &binary);
    let mut version = whole.clone();
    version[4] = 1;
    let nobody = json!([{ "children": [1] }, { "children": [0] }]);
    let many = json!([{ "children": (1..40).collect::<Vec<_>>() }]);
    let copies: Vec<Value> =
        std::iter::once(many[0].clone()).chain((1..40).map(|_| json!({ "mesh": 0 }))).collect();
    for (name, file, code, word) in [
        ("cut off", whole[..whole.len() - 1].to_vec(), "VGS-GLB-001", "bytes"),
        ("cut off in the header", whole[..16].to_vec(), "VGS-GLB-001", "header"),
        ("glTF 1", version, "VGS-GLB-002", "version 1"),
        ("no JSON", [&whole[..20], b"xxxx", &whole[24..]].concat(), "VGS-GLB-001", "JSON"),
        ("meshes alone", set(&format!("{splatting}/extensions"), json!({})), "VGS-GLB-003", NAME),
        ("packed", set("/extensionsRequired", json!(["KHR_x_spz"])), "VGS-GLB-004", "KHR_x_spz"),
        ("sparse", set("/accessors/2/sparse", json!({})), "VGS-GLB-004", "SCALE"),
        ("no such accessor", set("/accessors", json!([])), "VGS-GLB-001", "accessor"),
        ("another type", set("/accessors/1/type", json!("VEC3")), "VGS-GLB-001", "VEC4"),
        ("doubles", set("/accessors/1/componentType", json!(5130)), "VGS-GLB-001", "5130"),
        ("too many rows", set("/accessors/0/count", json!(3)), "VGS-GLB-001", "3 rows"),
        ("endless rows", set("/accessors/0/count", json!(u64::MAX)), "VGS-GLB-001", "rows"),
        ("fewer rows of one", set("/accessors/3/count", json!(1)), "VGS-GLB-001", "1 rows for 2"),
        (
            "no opacity",
            set(&format!("{splatting}/attributes"), json!({ "POSITION": 0 })),
            "VGS-GLB-001",
            "OPACITY",
        ),
        ("an offset behind the end", set("/accessors/0/byteOffset", json!(u64::MAX)), "VGS-GLB-001", "fit"),
        (
            "a view behind the end",
            set("/bufferViews/0/byteLength", json!(100)),
            "VGS-GLB-001",
            "end of the file",
        ),
        ("another file", set("/buffers/0/uri", json!("a.bin")), "VGS-GLB-001", "another file"),
        ("rows of nothing", set("/bufferViews/0/byteStride", json!(0)), "VGS-GLB-001", "apart"),
        ("a circle", set("/nodes", nobody), "VGS-GLB-001", "two places"),
        ("no such node", set("/scenes/0/nodes", json!([7])), "VGS-GLB-001", "node 7"),
        ("no such scene", set("/scene", json!(3)), "VGS-GLB-001", "scene"),
        ("a mirror", set("/nodes/1/scale", json!([1.0, -1.0, 1.0])), "VGS-GLB-001", "mirrors"),
        ("flat", set("/nodes/1/scale", json!([1.0, 0.0, 1.0])), "VGS-GLB-001", "mirrors"),
        ("copies", set("/nodes", json!(copies)), "VGS-GLB-006", "again and again"),
        (
            "other statements",
            set(&format!("{splatting}/extras"), json!({ "vgs": 1 })),
            "VGS-GLB-001",
            "extras",
        ),
    ] {
        let error = read_bytes(&file).err().unwrap_or_else(|| panic!("{name}: it was read"));
        assert_eq!((error.kind, error.code), (Kind::BadData, code), "{name}: {error}");
        assert!(error.message.contains(word), "{name}: {error}");
    }
    assert!(sniff(&whole) && !sniff(b"glt") && !sniff(b"{\"asset\""));
}

#[test]
fn splats_that_are_no_numbers_are_dropped() {
    let (document, mut binary) = foreign();
    binary[48..52].copy_from_slice(&f32::NAN.to_le_bytes());
    let file = file_of(&document, &binary);
    assert_eq!(read_bytes(&file).expect("the other").splats.len(), 1);
    let strict = ReadOptions { strict: true, ..ReadOptions::default() };
    assert_eq!(read_both(read, &file, &strict).expect_err("NaN").code, "VGS-PLY-022");
}
