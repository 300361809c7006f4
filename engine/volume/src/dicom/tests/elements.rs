//! Every row of the elements: what is done where one is absent, and where its value cannot be read.

use std::collections::BTreeSet;

use super::super::elements::{Absence, ELEMENTS};
use super::structures::{mask, rectangle, segmentation, structure_set};
use super::writer::{Dicom, words};
use super::{even, volume};
use base::Result;

/// A file with elements of ours, and how it is read: as a scan, or as a mask.
struct Base {
    name: &'static str,
    file: Dicom,
    read: fn(&Dicom) -> Result<Vec<f32>>,
    /// Elements that nobody asks of such a file.
    unused: &'static [(u16, u16)],
}

fn scan(file: &Dicom) -> Result<Vec<f32>> {
    // NaN is no value that could be compared.
    let samples = volume(std::slice::from_ref(file))?.samples;
    Ok(samples.into_iter().map(|v| if v.is_nan() { f32::MAX } else { v }).collect())
}

fn first_structure(file: &Dicom) -> Result<Vec<f32>> {
    Ok(mask(file, "1")?.1.weight)
}

fn item(elements: &[((u16, u16), &'static [u8; 2], &str)]) -> Dicom {
    let mut item = Dicom::empty("");
    elements.iter().for_each(|(tag, vr, value)| item.text(*tag, vr, value));
    item
}

/// A slice with all that a file of one frame may have.
fn slice() -> Dicom {
    let mut file = even(1).remove(0);
    for (tag, vr, value) in [
        ((0x0008, 0x0008), b"CS", "ORIGINAL\\PRIMARY"),
        ((0x0008, 0x0016), b"UI", "1.2.840.10008.5.1.4.1.1.2"),
        ((0x0008, 0x0032), b"TM", "120000"),
        ((0x0008, 0x0033), b"TM", "120001"),
        ((0x0018, 0x0050), b"DS", "3"),
        ((0x0018, 0x0081), b"DS", "4.5"),
        ((0x0018, 0x0086), b"IS", "1"),
        ((0x0018, 0x0088), b"DS", "3"),
        ((0x0018, 0x1060), b"DS", "200"),
        ((0x0020, 0x0012), b"IS", "1"),
        ((0x0020, 0x0013), b"IS", "1"),
        ((0x0020, 0x0052), b"UI", "1.2.3.3"),
        ((0x0020, 0x0100), b"IS", "1"),
        ((0x0028, 0x1040), b"CS", "LIN"),
        ((0x0028, 0x1054), b"LO", "HU"),
        ((0x0054, 0x1001), b"CS", "HU"),
    ] {
        file.text(tag, vr, value);
    }
    file.put((0x0028, 0x0120), b"US", words(&[3]));
    file.put((0x0028, 0x0121), b"US", words(&[5]));
    file.sequence((0x0040, 0x9096), &[item(&[((0x0040, 0x9210), b"SH", "HU")])]);
    file
}

/// A slice whose values go through a table.
fn with_table() -> Dicom {
    let mut file = slice();
    let mut table = item(&[((0x0028, 0x3004), b"LO", "HU")]);
    table.put((0x0028, 0x3002), b"US", words(&[12, 0, 16]));
    table.put((0x0028, 0x3006), b"OW", words(&[7; 12]));
    file.sequence((0x0028, 0x3000), &[table]);
    file
}

/// A file of two frames, whole in one part of a concatenation.
fn enhanced() -> Dicom {
    let within = |tag, inner: Dicom| {
        let mut item = Dicom::empty("");
        item.sequence(tag, &[inner]);
        item
    };
    let mut file = even(1).remove(0);
    let moved = [(0x0020, 0x0032), (0x0020, 0x0037), (0x0028, 0x0030), (0x0028, 0x1052), (0x0028, 0x1053)];
    moved.into_iter().for_each(|tag| file.remove(tag));
    file.text((0x0020, 0x9161), b"UI", "1.2.3.7");
    file.put((0x0020, 0x9162), b"US", words(&[1]));
    file.put((0x0020, 0x9163), b"US", words(&[1]));
    file.text((0x0028, 0x0008), b"IS", "2");
    let measures = [((0x0018, 0x0050), b"DS", "3"), ((0x0028, 0x0030), b"DS", "2\\0.5")];
    let mut shared = within((0x0028, 0x9110), item(&measures));
    shared.sequence((0x0020, 0x9116), &[item(&[((0x0020, 0x0037), b"DS", "0.8\\0.6\\0\\-0.6\\0.8\\0")])]);
    let scale =
        [((0x0028, 0x1052), b"DS", "-1024"), ((0x0028, 0x1053), b"DS", "2"), ((0x0028, 0x1054), b"LO", "HU")];
    shared.sequence((0x0028, 0x9145), &[item(&scale)]);
    let frames: Vec<Dicom> = (0..2)
        .map(|i| {
            let at = format!("10\\-20\\{}", 30 + 3 * i);
            let mut frame = within((0x0020, 0x9113), item(&[((0x0020, 0x0032), b"DS", &at)]));
            let number = |tag, vr, value: Vec<u8>| {
                let mut item = Dicom::empty("");
                item.put(tag, vr, value);
                item
            };
            let real = |v: f64| v.to_le_bytes().to_vec();
            let index = number((0x0020, 0x9128), b"UL", vec![1, 0, 0, 0]);
            frame.sequence((0x0020, 0x9111), &[index]);
            let mut heart = number((0x0020, 0x9241), b"FL", 70_f32.to_le_bytes().to_vec());
            heart.put((0x0020, 0x9153), b"FD", real(300.0));
            frame.sequence((0x0018, 0x9118), &[heart]);
            frame.sequence(
                (0x0020, 0x9253),
                &[number((0x0020, 0x9245), b"FL", 30_f32.to_le_bytes().to_vec())],
            );
            frame.sequence((0x0018, 0x9114), &[number((0x0018, 0x9082), b"FD", real(4.5))]);
            frame.sequence((0x0018, 0x9117), &[number((0x0018, 0x9087), b"FD", real(1000.0))]);
            frame
        })
        .collect();
    file.sequence((0x5200, 0x9229), &[shared]);
    file.sequence((0x5200, 0x9230), &frames);
    file.put((0x7fe0, 0x0010), b"OW", words(&(0..24).collect::<Vec<_>>()));
    file
}

fn bases() -> [Base; 5] {
    let whole = vec![[1, 1, 1], [2, 1, 2]];
    let contours = vec![rectangle([0.0, 0.0], [3.0, 2.0], 1.0)];
    let segments = segmentation(&[(1, "a", whole)], "FRACTIONAL");
    let outlines = structure_set(&[(1, "a", contours)]);
    [
        Base { name: "slice", file: slice(), read: scan, unused: &[] },
        Base { name: "table", file: with_table(), read: scan, unused: &[] },
        Base { name: "enhanced", file: enhanced(), read: scan, unused: &[] },
        Base { name: "segmentation", file: segments, read: first_structure, unused: &[] },
        Base { name: "contours", file: outlines, read: first_structure, unused: &[(0x0008, 0x0060)] },
    ]
}

#[test]
fn what_cannot_be_read_is_an_error_and_no_default() {
    let mut met = BTreeSet::new();
    for base in bases() {
        (base.read)(&base.file).unwrap_or_else(|e| panic!("{}: {e}", base.name));
        for row in ELEMENTS {
            let tag = (row.tag.0, row.tag.1);
            let mut file = base.file.clone();
            let garbage = if row.is_number() || ["SQ", "OW"].contains(&row.vr.to_string()) {
                (b"LO", b"abc ".to_vec())
            } else {
                (b"SQ", item(&[]).item())
            };
            if !file.change_all(tag, Some((garbage.0, &garbage.1))) {
                continue;
            }
            if base.unused.contains(&tag) {
                continue;
            }
            met.insert(row.tag);
            let Err(error) = (base.read)(&file) else { panic!("{}: {row} is read", base.name) };
            assert_eq!(error.code, "VGS-DCM-021", "{}: {row}: {error}", base.name);
            assert!(error.message.contains(&row.to_string()), "{}: {row}: {error}", base.name);
            assert!(error.file.is_some() && error.help.contains("--lenient"), "{row}: {error}");
        }
    }
    let shown = ELEMENTS.iter().filter(|row| row.absence == Absence::Shown).map(|row| row.tag);
    met.extend(shown);
    let not_met: Vec<_> = ELEMENTS.iter().filter(|row| !met.contains(&row.tag)).map(|row| row.name).collect();
    assert!(not_met.is_empty(), "no file here has {not_met:?}");
}

#[test]
fn what_is_absent_is_what_its_row_says() {
    for base in bases() {
        for row in ELEMENTS {
            let tag = (row.tag.0, row.tag.1);
            let [mut without, mut empty] = [base.file.clone(), base.file.clone()];
            if !without.change_all(tag, None) {
                continue;
            }
            empty.change_all(tag, Some((b"LO", b"  ")));
            for (how, file) in [("missing", &without), ("empty", &empty)] {
                // Of a sequence that is none, the type is told.
                if how == "empty" && row.vr.to_string() == "SQ" {
                    continue;
                }
                let read = (base.read)(file);
                let place = format!("{}: {row} is {how}", base.name);
                match (row.absence, read) {
                    (Absence::Needed, Err(error)) => {
                        assert_eq!(error.code, "VGS-DCM-022", "{place}: {error}");
                        assert!(error.message.contains(&row.to_string()), "{place}: {error}");
                    }
                    (Absence::Shown, _) => {}
                    (Absence::Needed, Ok(_)) => panic!("{place}, and it is read"),
                    (Absence::Is(value), read) => {
                        let mut told = base.file.clone();
                        told.change_all(tag, Some((b"DS", value.to_string().as_bytes())));
                        assert_eq!(read.unwrap(), (base.read)(&told).unwrap(), "{place}");
                    }
                    // What is told is told with a reason of its own.
                    (Absence::Fine(text), Err(error)) => assert!(
                        ["VGS-DCM-004", "VGS-DCM-016", "VGS-ROI-010"].contains(&error.code)
                            || error.code == "VGS-DCM-022" && text == "the file says it",
                        "{place}: {error}"
                    ),
                    (Absence::Fine(_), Ok(_)) => {}
                }
            }
        }
    }
}

/// A representation that the file has wrong, or does not know, does not matter.
#[test]
fn elements_are_taken_by_the_dictionary() {
    for base in bases() {
        let expected = (base.read)(&base.file).unwrap();
        for row in ELEMENTS.iter().filter(|row| row.vr.to_string() != "SQ") {
            let tag = (row.tag.0, row.tag.1);
            let is_text = ["DS", "IS", "CS", "LO", "UI", "TM"].contains(&row.vr.to_string());
            let others: &[&'static [u8; 2]] =
                if is_text { &[b"UN", b"UT", b"OB", b"LO"] } else { &[b"UN", b"OB"] };
            for vr in others {
                let mut file = base.file.clone();
                if !file.map_all(tag, &|value| Some((vr, value.to_vec()))) {
                    continue;
                }
                let read = (base.read)(&file);
                let read =
                    read.unwrap_or_else(|e| panic!("{}: {row} as {}: {e}", base.name, vr.escape_ascii()));
                assert_eq!(read, expected, "{}: {row} as {}", base.name, vr.escape_ascii());
            }
        }
        // Sequences, whose items have no representations then.
        for row in ELEMENTS.iter().filter(|row| row.vr.to_string() == "SQ") {
            let mut file = base.file.clone();
            file.map_all((row.tag.0, row.tag.1), &|value| Some((b"UN", Dicom::implicit_items(value))));
            assert_eq!((base.read)(&file).ok(), Some(expected.clone()), "{}: {row} as UN", base.name);
        }
    }
}
