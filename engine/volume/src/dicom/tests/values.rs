//! From what is stored to intensities, and to places: scales, tables, bits, and what is refused by name.

use super::writer::{Dicom, words};
use super::{even, folder, place, read, refused, volume};
use crate::{ReadOptions, Volume};

const INTERCEPT: (u16, u16) = (0x0028, 0x1052);
const SLOPE: (u16, u16) = (0x0028, 0x1053);

fn changed(count: u16, change: impl Fn(&mut Dicom)) -> Vec<Dicom> {
    let mut files = even(count);
    files.iter_mut().for_each(change);
    files
}

#[test]
fn an_intercept_is_read_or_refused_by_name_however_it_is_written() {
    let expected = volume(&even(3)).unwrap().samples;
    let read_as: [(&'static [u8; 2], &[u8]); 12] = [
        (b"DS", b"-1024,0 "),
        (b"DS", b" -1024"),
        (b"DS", b"-1.024E+3\0"),
        (b"DS", b"-1024\0\0\0"),
        (b"LO", b"-1024.0 "),
        (b"SH", b"-1024 "),
        (b"UT", b"-1024 "),
        (b"UN", b"-1024 "),
        (b"OB", b"-1024 "),
        (b"FD", b"-1024.00"),
        (b"FL", &(-1024_f32).to_le_bytes()),
        (b"SS", &(-1024_i16).to_le_bytes()),
    ];
    for (vr, bytes) in read_as {
        let files = changed(3, |file| file.put(INTERCEPT, vr, bytes.to_vec()));
        assert_eq!(volume(&files).unwrap().samples, expected, "{} {bytes:?}", vr.escape_ascii());
    }
    let in_doubles = changed(3, |file| file.put(INTERCEPT, b"FD", (-1024_f64).to_le_bytes().to_vec()));
    assert_eq!(volume(&in_doubles).unwrap().samples, expected);
    let refused_as: [(&'static [u8; 2], &[u8]); 9] = [
        (b"DS", b"-10 24 "),
        (b"DS", b"- 1024 "),
        (b"DS", b"-1,024"),
        (b"DS", b"1024 HU "),
        (b"DS", b"nan "),
        (b"DS", b"inf "),
        (b"DS", b"-1024\\0 "),
        (b"UN", &[0xff, 0xfe, 0x12, 0x80]),
        (b"FD", &f64::NAN.to_le_bytes()),
    ];
    for (vr, bytes) in refused_as {
        let error = refused(&changed(3, |file| file.put(INTERCEPT, vr, bytes.to_vec())));
        assert!(
            error.code == "VGS-DCM-021" && error.message.contains("Rescale Intercept (0028,1052)"),
            "{} {bytes:?}: {error}",
            vr.escape_ascii()
        );
    }
    // Half a number would be taken for the next element.
    let error = refused(&changed(3, |file| file.put(INTERCEPT, b"FD", b"-1024 ".to_vec())));
    assert!(error.code == "VGS-DCM-005" && error.message.contains("(0028,1052) has 6 bytes"), "{error}");
}

/// Writes a table in place of slope and intercept.
fn with_table(signed: bool, descriptor: [u16; 3], vr: &'static [u8; 2], data: &[u8]) -> Vec<Dicom> {
    changed(2, |file| {
        let mut table = Dicom::empty("");
        table.put((0x0028, 0x3002), if signed { b"SS" } else { b"US" }, words(&descriptor));
        table.put((0x0028, 0x3006), vr, data.to_vec());
        file.sequence((0x0028, 0x3000), &[table]);
        file.remove(INTERCEPT);
        file.remove(SLOPE);
        file.put((0x0028, 0x0103), b"US", words(&[signed.into()]));
        let stored: [i16; 12] = if signed {
            [-3, -2, -1, 0, 1, 2, 9, -9, 0, 0, 0, 0]
        } else {
            [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]
        };
        file.put((0x7fe0, 0x0010), b"OW", words(&stored.map(|v| v as u16)));
    })
}

#[test]
fn a_table_takes_the_place_of_slope_and_intercept() {
    let first = |files: &[Dicom], n: usize| volume(files).unwrap().samples[..n].to_vec();
    // Before the first and behind the last entry their values go on.
    let unsigned = with_table(false, [4, 2, 16], b"OW", &words(&[10, 20, 30, 60000]));
    assert_eq!(first(&unsigned, 8), [10.0, 10.0, 10.0, 20.0, 30.0, 60000.0, 60000.0, 60000.0]);
    let signed = with_table(true, [4, (-2_i16) as u16, 16], b"US", &words(&[10, 20, 30, 40]));
    assert_eq!(first(&signed, 8), [10.0, 10.0, 20.0, 30.0, 40.0, 40.0, 40.0, 10.0]);
    // Bytes, two in a word; and in words of their own.
    assert_eq!(first(&with_table(false, [3, 0, 8], b"OW", &[7, 8, 200, 0]), 4), [7.0, 8.0, 200.0, 200.0]);
    assert_eq!(
        first(&with_table(false, [3, 0, 8], b"OW", &words(&[7, 8, 200])), 4),
        [7.0, 8.0, 200.0, 200.0]
    );
    // As bytes that nobody described.
    assert_eq!(
        first(&with_table(false, [3, 0, 16], b"UN", &words(&[7, 8, 200])), 4),
        [7.0, 8.0, 200.0, 200.0]
    );
    // 65536 entries do not fit the descriptor, which has 0 then.
    let large: Vec<u16> = (0..=u16::MAX).map(|v| v ^ 1).collect();
    assert_eq!(first(&with_table(false, [0, 0, 16], b"OW", &words(&large)), 4), [1.0, 0.0, 3.0, 2.0]);
    for (descriptor, data, name) in [
        ([4, 0, 16], words(&[1, 2, 3]), "LUT Data (0028,3006)"),
        ([4, 0, 32], words(&[1, 2, 3, 4]), "LUT Descriptor (0028,3002)"),
    ] {
        let error = refused(&with_table(false, descriptor, b"OW", &data));
        assert!(error.code == "VGS-DCM-021" && error.message.contains(name), "{error}");
    }
}

#[test]
fn slices_with_and_without_a_scale_are_no_volume() {
    let mut files = even(4);
    files[2].remove(INTERCEPT);
    files[2].remove(SLOPE);
    let error = refused(&files);
    assert!(error.code == "VGS-DCM-024" && error.message.contains("1 of 4 slices"), "{error}");
    // Without any, the values are what is stored.
    let bare = changed(2, |file| {
        file.remove(INTERCEPT);
        file.remove(SLOPE);
    });
    assert_eq!(volume(&bare).unwrap().samples[..3], [0.0, 1.0, 2.0]);
    // Slices may differ in everything that says how values are stored.
    let mut mixed = even(3);
    mixed[1].put((0x0028, 0x0103), b"US", words(&[1]));
    mixed[1].put((0x7fe0, 0x0010), b"OW", words(&[0xfffe; 12]));
    mixed[2].put((0x0028, 0x0100), b"US", words(&[8]));
    mixed[2].put((0x0028, 0x0101), b"US", words(&[8]));
    mixed[2].put((0x0028, 0x0102), b"US", words(&[7]));
    mixed[2].put((0x7fe0, 0x0010), b"OW", vec![9; 12]);
    let read = volume(&mixed).unwrap();
    assert_eq!([12, 24].map(|i| read.samples[i]), [-1028.0, -1006.0]);
}

#[test]
fn padding_has_the_sign_of_the_pixels() {
    for (vr, padding) in [(b"US", 63536_u16), (b"SS", 63536), (b"UN", 63536)] {
        let files = changed(2, |file| {
            file.put((0x0028, 0x0103), b"US", words(&[1]));
            file.put((0x0028, 0x0120), vr, words(&[padding]));
            file.put((0x7fe0, 0x0010), b"OW", words(&[(-2000_i16) as u16, 5, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]));
        });
        let samples = volume(&files).unwrap().samples;
        assert!(samples[0].is_nan() && samples[1] == -1014.0, "{vr:?}: {samples:?}");
    }
}

#[test]
fn what_the_standard_does_not_allow_is_refused_by_name() {
    let rows: [(&str, (u16, u16), u16); 5] = [
        ("High Bit (0028,0102)", (0x0028, 0x0102), 9),
        ("High Bit (0028,0102)", (0x0028, 0x0102), 16),
        ("Bits Stored (0028,0101)", (0x0028, 0x0101), 17),
        ("Bits Allocated (0028,0100)", (0x0028, 0x0100), 0),
        ("Pixel Representation (0028,0103)", (0x0028, 0x0103), 2),
    ];
    for (name, tag, value) in rows {
        let error = refused(&changed(2, |file| file.put(tag, b"US", words(&[value]))));
        assert!(error.code == "VGS-DCM-021" && error.message.contains(name), "{name}: {error}");
    }
    for photometric in ["PALETTE COLOR", "RGB", "YBR_FULL"] {
        let error = refused(&changed(2, |file| file.text((0x0028, 0x0004), b"CS", photometric)));
        assert!(error.code == "VGS-DCM-010" && error.message.contains(photometric), "{error}");
    }
    let mosaic = changed(1, |file| file.text((0x0008, 0x0008), b"CS", "ORIGINAL\\PRIMARY\\M\\MOSAIC"));
    let error = refused(&mosaic);
    assert!(error.code == "VGS-DCM-023" && error.help.contains("dcm2niix"), "{error}");
    let tiles = changed(1, |file| {
        file.text((0x0019, 0x0010), b"LO", "SIEMENS MR HEADER");
        file.put((0x0019, 0x100a), b"US", words(&[4]));
    });
    assert_eq!(refused(&tiles).code, "VGS-DCM-023");
    // Windows are a viewer's, however they are written.
    let window = changed(2, |file| file.text((0x0028, 0x1050), b"DS", "40,0 HU"));
    assert_eq!(volume(&window).unwrap().samples, volume(&even(2)).unwrap().samples);
}

#[test]
fn a_slice_a_little_off_its_place_is_taken() {
    let mut files = even(8);
    let at = place(5.0);
    // 0.2 mm along the slices' normal and 0.1 mm beside it.
    files[5].text((0x0020, 0x0032), b"DS", &format!("{}\\{}\\{}", at.x + 0.1, at.y, at.z + 0.2));
    let read = volume(&files).unwrap();
    assert_eq!((read.size[2], read.spacing_mm().z), (8, 3.0));
    assert_eq!(read.samples[read.index(0, 0, 5)], 2.0 * 500.0 - 1024.0);
    let mut first = even(8);
    first[0].text((0x0020, 0x0032), b"DS", "10\\-20\\30.2");
    let read = volume(&first).unwrap();
    let origin = read.world_from_voxel.translation;
    assert!((origin.z - 30.0).abs() < 1e-9, "the line is that of the others: {origin}");
}

/// Files as archives keep them: without preamble, without magic, without meta information.
#[test]
fn the_beginning_of_a_file_may_be_missing() {
    let expected = volume(&even(3)).unwrap();
    let bare = |file: &Dicom, explicit: bool| {
        let mut file = file.clone();
        file.text((0x0008, 0x0005), b"CS", "ISO_IR 100");
        file.text((0x0008, 0x0016), b"UI", "1.2.840.10008.5.1.4.1.1.2");
        if explicit { file.body() } else { Dicom::implicit_items(&file.item())[8..].to_vec() }
    };
    type Cut<'a> = &'a dyn Fn(&Dicom) -> Vec<u8>;
    let rows: [(&str, Cut); 4] = [
        ("no preamble", &|file| file.bytes()[128..].to_vec()),
        ("no preamble and no magic", &|file| file.bytes()[132..].to_vec()),
        ("elements alone", &|file| bare(file, true)),
        ("elements without representations alone", &|file| bare(file, false)),
    ];
    for (name, cut) in rows {
        let folder = tempfile::tempdir().unwrap();
        for (i, file) in even(3).iter().enumerate() {
            std::fs::write(folder.path().join(format!("{i}")), cut(file)).unwrap();
        }
        let whole = read(folder.path(), &ReadOptions::default()).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!((whole.size, &whole.samples), (expected.size, &expected.samples), "{name}");
        let one = Volume::read(folder.path().join("1"), &ReadOptions::default()).unwrap();
        assert_eq!(one.samples, expected.samples, "{name}: a slice stands for its series");
    }
    // Other files are not taken for DICOM.
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.bin"), [8, 0, 5, 0].repeat(100)).unwrap();
    assert_eq!(read(folder.path(), &ReadOptions::default()).unwrap_err().code, "VGS-DCM-001");
}

/// A series in two files of two frames each.
fn parts() -> [Dicom; 2] {
    let part = |number: u16| {
        let mut file = even(1).remove(0);
        file.text((0x0008, 0x0018), b"UI", &format!("1.2.3.{number}"));
        file.remove((0x0020, 0x0032));
        file.text((0x0020, 0x9161), b"UI", "1.2.3.7");
        file.put((0x0020, 0x9162), b"US", words(&[number]));
        file.put((0x0020, 0x9163), b"US", words(&[2]));
        file.text((0x0028, 0x0008), b"IS", "2");
        let frame = |i: u16| {
            let at = place(f64::from(2 * (number - 1) + i)).to_array().map(|v| v.to_string()).join("\\");
            let mut position = Dicom::empty("");
            position.text((0x0020, 0x0032), b"DS", &at);
            let mut frame = Dicom::empty("");
            frame.sequence((0x0020, 0x9113), &[position]);
            frame
        };
        file.sequence((0x5200, 0x9230), &[frame(0), frame(1)]);
        file.put((0x7fe0, 0x0010), b"OW", words(&[number; 24]));
        file
    };
    [part(1), part(2)]
}

#[test]
fn half_a_concatenation_is_no_volume() {
    let [first, second] = parts();
    let both = folder(&[first.clone(), second]);
    for path in [both.path().to_owned(), both.path().join("998.dcm")] {
        let whole = Volume::read(path, &ReadOptions::default()).unwrap();
        assert_eq!((whole.size[2], whole.samples[0], whole.samples[47]), (4, -1022.0, -1020.0));
    }
    let half = folder(&[first]);
    let error = Volume::read(half.path().join("999.dcm"), &ReadOptions::default()).unwrap_err();
    assert!(error.code == "VGS-DCM-025" && error.message.contains("missing: 2"), "{error}");
    let lenient = ReadOptions { lenient: true, ..ReadOptions::default() };
    assert_eq!(read(half.path(), &lenient).unwrap().size[2], 2);
}
