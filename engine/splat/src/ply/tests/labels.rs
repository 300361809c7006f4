//! Labels of splats, and their names.

use super::*;
use crate::LabelCount;

fn labelled() -> SplatSet {
    SplatSet {
        labels: Some((0..10_000).map(|i| (i % 7 * 40) as u8).collect()),
        label_names: vec![(40, "left lung upper lobe".into()), (200, "Größe (ß)".into())],
        ..sample(10_000)
    }
}

#[test]
fn labels_survive_among_the_properties_of_the_vertices() {
    let set = labelled();
    let file = encoded(&set);
    let read = loaded(&file, &STRICT).expect("our own file");
    assert_eq!(read.set, set);
    let header = header_of(&file);
    assert_eq!(file.len(), header.len() + 10_000 * (17 + 1 + 1) * 4);
    let lines: Vec<&str> = header.lines().collect();
    assert_eq!(lines[2], "element vertex 10000", "other readers take the third line for the count");
    // All are floats: a program that counts only these would take another type for no property at all.
    assert_eq!(lines[20..22], ["property float intensity", "property float label"]);
    assert!(lines.contains(&"comment vgs.label 40 left lung upper lobe"));

    // An independent reader agrees.
    let ply = ply_rs::parser::Parser::<ply_rs::ply::DefaultElement>::new()
        .read_ply(&mut file.as_slice())
        .expect("the PLY crate reads it");
    for (index, &label) in set.labels.iter().flatten().enumerate().step_by(777) {
        let got = ply.payload["vertex"][index]["label"].to_f32_lossy();
        assert_eq!(got, Some(f32::from(label)));
    }
}

#[test]
fn labels_are_described() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("splats.ply");
    write(&path, &labelled(), false).expect("writing");
    let summary = describe(&path, &STRICT).expect("our own file");
    assert_eq!(summary.labels.len(), 7);
    let expected = LabelCount { label: 40, name: Some("left lung upper lobe".into()), splats: 1429 };
    assert_eq!(summary.labels[1], expected);
    assert_eq!(summary.labels[6], LabelCount { label: 240, name: None, splats: 1428 });
    assert_eq!(summary.harmonics_degree, None);
    write(&path, &sample(3), true).expect("writing");
    assert!(describe(&path, &STRICT).expect("without labels").labels.is_empty());
}

#[test]
fn labels_of_others_and_wrong_ones() {
    let le = "binary_little_endian";
    let header =
        |kind: &str| format!("{}element splat_intensity 2\nproperty {kind} label\n", plain_header("2"));
    let rows = [little(&PLAIN_ROW), little(&PLAIN_ROW)].concat();
    let with = |kind: &str, payload: &[u8]| file(le, &header(kind), &[&rows[..], payload].concat());

    // Of any type, as long as the numbers fit; the intensity then comes from elsewhere.
    for good in
        [with("ushort", &[7, 0, 255, 0]), with("float", &little(&[7.0, 255.0])), with("char", &[7, 127])]
    {
        let set = loaded(&good, &STRICT).expect("labels alone").set;
        assert!(set.colours.is_some() && !set.unit.is_physical());
        assert_eq!(set.labels.expect("labels")[0], 7);
    }
    for (bad, word) in [
        (with("ushort", &[7, 0, 0, 1]), "splat 1 has the label 256"),
        (with("char", &[255, 1]), "splat 0 has the label -1"),
        (with("float", &little(&[0.0, 1.5])), "1.5"),
        (with("float", &little(&[f32::NAN, 1.0])), "NaN"),
    ] {
        let error = loaded(&bad, &LENIENT).err().unwrap_or_else(|| panic!("{word}: it was read"));
        assert_eq!((error.kind, error.code), (Kind::BadData, "VGS-PLY-025"), "{error}");
        assert!(error.message.contains(word) && error.help.contains("1 to 255"), "{error}");
    }
    // A property of that name in a file of others may be anything; in one of ours it is wrong.
    let named = |comment: &str, label: f32| {
        let header = format!("{}property float label\n{comment}", plain_header("1"));
        file(le, &header, &[little(&PLAIN_ROW), little(&[label])].concat())
    };
    assert_eq!(loaded(&named("", 200.0), &STRICT).expect("a label").set.labels, Some(vec![200]));
    assert_eq!(loaded(&named("", -1.0), &STRICT).expect("something else").set.labels, None);
    let error = loaded(&named("comment vgs.axes ras\n", -1.0), &STRICT).err().expect("a wrong label");
    assert_eq!(error.code, "VGS-PLY-025");

    // The label of a splat goes with it.
    let mut rows = rows;
    rows[..4].copy_from_slice(&f32::NAN.to_le_bytes());
    let dropped = loaded(&file(le, &header("uchar"), &[&rows[..], &[7, 8]].concat()), &LENIENT).expect("one");
    assert_eq!((dropped.set.labels, dropped.mended.dropped), (Some(vec![8]), 1));

    let plain = plain_header("0");
    for comment in
        ["vgs.label", "vgs.label 5", "vgs.label 0 none", "vgs.label 256 liver", "vgs.label liver 5"]
    {
        let wrong = file(le, &format!("{plain}comment {comment}\n"), &[]);
        assert_eq!(loaded(&wrong, &LENIENT).err().expect(comment).code, "VGS-PLY-016", "{comment}");
    }
    let twice = file(le, &format!("{plain}comment vgs.label 5 liver\ncomment vgs.label 5 spleen\n"), &[]);
    assert_eq!(loaded(&twice, &LENIENT).err().expect("twice").code, "VGS-PLY-016");
    let unsorted = file(le, &format!("{plain}comment vgs.label 9 b\ncomment vgs.label 5 a\u{7}  c\n"), &[]);
    let names = loaded(&unsorted, &LENIENT).expect("in any order").set.label_names;
    assert_eq!(names, [(5, "a c".to_owned()), (9, "b".to_owned())]);
}

#[test]
fn the_longest_names_fit_the_header() {
    let name = |label| (label, crate::label_name(&"\u{1f600}".repeat(99)));
    let set = SplatSet { label_names: (1..=255).map(name).collect(), ..sample(1) };
    assert_eq!(loaded(&encoded(&set), &STRICT).expect("our own file").set, set);
    let broken = SplatSet { labels: Some(vec![1; 2]), ..sample(1) };
    let error = check(&broken).expect_err("two labels for one splat");
    assert!(error.code == "VGS-PLY-012" && error.message.contains("one label"), "{error}");
}
