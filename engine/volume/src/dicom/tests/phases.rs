//! Slices at one place: phases, acquisitions, copies, and a slice that was scanned twice.

use super::writer::Dicom;
use super::{folder, list, place, read, refused, volume};
use crate::ReadOptions;
use crate::dicom::StackSummary;

/// Returns slices at these places; `change` gets the number of each in the list.
fn slices(places: &[f64], change: impl Fn(usize, &mut Dicom)) -> Vec<Dicom> {
    let slice = |(i, &at): (usize, &f64)| {
        let mut file = Dicom::slice(i as u16, place(at));
        // Each slice is made some time after the one before.
        file.text((0x0008, 0x0033), b"TM", &format!("12{:02}{:02}.5", i / 60, i % 60));
        file.text((0x0020, 0x0013), b"IS", &(i + 1).to_string());
        change(i, &mut file);
        file
    };
    places.iter().enumerate().map(slice).collect()
}

fn listed(files: &[Dicom]) -> Vec<StackSummary> {
    list(folder(files).path(), &ReadOptions::default()).unwrap()
}

/// Returns the number of slices of each volume, and what distinguishes it.
fn phases(files: &[Dicom]) -> Vec<(usize, String)> {
    let name = |row: StackSummary| (row.size[2], row.description.replacen("Abdomen 1.0", "", 1));
    listed(files)
        .into_iter()
        .map(name)
        .map(|(n, text)| (n, text.trim_start_matches(", ").to_owned()))
        .collect()
}

#[test]
fn a_slice_that_was_scanned_twice_is_one() {
    let files = slices(&[0.0, 1.0, 2.0, 3.0, 4.0, 2.0], |_, _| ());
    assert_eq!(phases(&files), [(5, String::new())]);
    let read = volume(&files).unwrap();
    // The one that was made last.
    assert_eq!(read.samples[read.index(0, 0, 2)], 2.0 * 500.0 - 1024.0);
    // Where its acquisition says which one it is, both can be chosen.
    let repeated = slices(&[0.0, 1.0, 2.0, 3.0, 4.0, 2.0], |i, file| {
        file.text((0x0020, 0x0012), b"IS", ["1", "2"][i / 5])
    });
    assert_eq!(phases(&repeated), [(5, "acquisition 1".to_owned()), (1, "acquisition 2".to_owned())]);
    assert_eq!(volume(&repeated).unwrap().samples[2 * 12], 2.0 * 200.0 - 1024.0);
}

#[test]
fn a_phase_is_a_series() {
    let places: Vec<f64> = (0..12).map(|i| f64::from(i % 6)).collect();
    type Change = fn(usize, &mut Dicom);
    let rows: [(&str, &str, Change); 7] = [
        ("temporal position 1", "temporal position 2", |i, file| {
            file.text((0x0020, 0x0100), b"IS", ["1", "2"][i / 6]);
        }),
        ("temporal index 1", "temporal index 2", |i, file| {
            file.put((0x0020, 0x9128), b"UL", vec![1 + i as u8 / 6, 0, 0, 0]);
        }),
        ("cardiac phase, % 30", "cardiac phase, % 70", |i, file| {
            file.put((0x0020, 0x9241), b"FL", [30_f32, 70.0][i / 6].to_le_bytes().to_vec());
        }),
        ("trigger time 0", "trigger time 400", |i, file| {
            file.text((0x0018, 0x1060), b"DS", ["0", "400.0"][i / 6]);
        }),
        ("b value 0", "b value 1000", |i, file| {
            file.put((0x0018, 0x9087), b"FD", [0_f64, 1000.0][i / 6].to_le_bytes().to_vec());
        }),
        // The second half overlaps the first one in all places but is another acquisition.
        ("acquisition 3", "acquisition 4", |i, file| file.text((0x0020, 0x0012), b"IS", ["3", "4"][i / 6])),
        // Times of a phase differ from slice to slice.
        ("trigger time 1 of 2", "trigger time 2 of 2", |i, file| {
            file.text((0x0018, 0x1060), b"DS", &format!("{}", 300 * (i / 6) + 7 * (i % 6)));
        }),
    ];
    for (first, second, change) in rows {
        let files = slices(&places, change);
        assert_eq!(phases(&files), [(6, first.to_owned()), (6, second.to_owned())]);
        let series = Some(second.to_owned());
        let second = read(folder(&files).path(), &ReadOptions { series, ..ReadOptions::default() }).unwrap();
        assert_eq!(second.samples[second.index(0, 0, 5)], 2.0 * 1100.0 - 1024.0);
    }
}

#[test]
fn phases_of_two_kinds_and_acquisitions_that_overlap() {
    // Two echoes, each as magnitude and phase.
    let places: Vec<f64> = (0..16).map(|i| f64::from(i % 4)).collect();
    let files = slices(&places, |i, file| {
        file.text((0x0018, 0x0086), b"IS", ["1", "2"][i / 8]);
        file.text((0x0008, 0x0008), b"CS", ["ORIGINAL\\M", "ORIGINAL\\P"][i / 4 % 2]);
    });
    let found = phases(&files);
    assert_eq!(found.len(), 4);
    assert!(found.iter().all(|(slices, _)| *slices == 4), "{found:?}");
    assert_eq!(found[3].1, "echo 2, image type ORIGINAL\\P");
    let overlap = slices(&[0.0, 1.0, 2.0, 3.0, 2.0, 3.0, 4.0, 5.0], |i, file| {
        file.text((0x0020, 0x0012), b"IS", ["1", "2"][i / 4]);
    });
    assert_eq!(phases(&overlap), [(4, "acquisition 1".to_owned()), (4, "acquisition 2".to_owned())]);
    let error = refused(&overlap);
    assert!(error.code == "VGS-DCM-006" && error.help.contains("acquisition 2"), "{error}: {}", error.help);
    // Side by side they are one volume.
    let beside =
        slices(&[0.0, 1.0, 2.0, 3.0], |i, file| file.text((0x0020, 0x0012), b"IS", ["1", "2"][i / 2]));
    assert_eq!(volume(&beside).unwrap().size[2], 4);
}

#[test]
fn files_of_one_uid_are_not_copies() {
    let one_uid = |_: usize, file: &mut Dicom| file.text((0x0008, 0x0018), b"UI", "1.2.3");
    assert_eq!(volume(&slices(&[0.0, 1.0, 2.0, 3.0], one_uid)).unwrap().size[2], 4);
    // A copy is one by all that it says.
    let mut copied = slices(&[0.0, 1.0, 2.0, 3.0], one_uid);
    copied.push(copied[2].clone());
    assert_eq!(volume(&copied).unwrap().size[2], 4);
}

#[test]
fn single_slices_are_not_called_orientations() {
    let several = slices(&[0.0, 1.0, 2.0], |i, file| {
        file.text((0x0020, 0x000e), b"UI", &format!("1.2.{i}"));
        file.text((0x0008, 0x0018), b"UI", &format!("5.{i}"));
    });
    let error = refused(&several);
    assert!(error.code == "VGS-DCM-006" && error.message.contains("3 single slices"), "{error}");
}
