//! Zips, segmentations and structure sets that the tests write.

use std::io::{Cursor, Write};

use glam::DVec3;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use super::super::lengths::PACKED;
use super::super::structures::other_space;
use super::writer::{Dicom, words};
use super::{even, place};
use crate::dicom::{list, structures};
use crate::tests::read_both;
use crate::{LabelChoice, ReadOptions, Roi, Volume};
use base::{Error, Kind, Result};

const SEGMENTATION: &str = "1.2.840.10008.5.1.4.1.1.66.4";
const STRUCTURE_SET: &str = "1.2.840.10008.5.1.4.1.1.481.3";

fn zip_of(files: &[(&str, Vec<u8>)]) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in files {
        zip.start_file(*name, SimpleFileOptions::default()).unwrap();
        zip.write_all(bytes).unwrap();
    }
    zip.finish().unwrap().into_inner()
}

/// Writes a file into a folder of its own.
fn on_disk(name: &str, bytes: &[u8]) -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    (folder, path)
}

fn read_bytes(name: &str, bytes: &[u8]) -> Result<Volume> {
    let (_folder, path) = on_disk(name, bytes);
    Volume::read(path, &ReadOptions::default())
}

fn zipped_series() -> Vec<u8> {
    let mut files = vec![("readme.txt", b"not DICOM".to_vec())];
    let slices = even(4);
    // Names that would lead out of any folder are only names.
    let names = ["/etc/a", "../../b", "c/d", "e"];
    files.extend(names.into_iter().zip(slices.iter().map(Dicom::bytes)));
    zip_of(&files)
}

#[test]
fn a_zip_is_read_like_its_folder() {
    let folder = super::folder(&even(4));
    let expected = super::read(folder.path(), &ReadOptions::default()).unwrap();
    // The name does not matter.
    for name in ["scan.zip", "scan"] {
        let read = read_both(name, &zipped_series(), &ReadOptions::default()).unwrap();
        assert_eq!((read.size, read.world_from_voxel), (expected.size, expected.world_from_voxel));
        assert_eq!(read.samples, expected.samples);
    }
    let (_folder, path) = on_disk("scan.zip", &zipped_series());
    assert_eq!(list(&path, &ReadOptions::default()).unwrap()[0].size, [4, 3, 4]);
}

#[test]
fn zips_without_a_series_and_damaged_ones_are_refused() {
    let refused = |bytes: &[u8], options: &ReadOptions| {
        let (_folder, path) = on_disk("a.zip", bytes);
        Volume::read(path, options).expect_err("a zip that is refused")
    };
    let default = ReadOptions::default();
    let error = refused(&zip_of(&[("ct.nii", vec![0; 400])]), &default);
    assert_eq!((error.code, error.help.contains("unpack")), ("VGS-DCM-001", true), "{error}");
    let whole = zipped_series();
    assert_eq!(refused(&whole[..whole.len() / 2], &default).code, "VGS-DCM-015");
    // A slice that unpacks to more than is allowed is refused before it is unpacked.
    let mut large = even(1).remove(0);
    large.put((0x7fe0, 0x0010), b"OW", vec![0; 1 << 20]);
    let bomb = zip_of(&[("a", large.bytes())]);
    assert!(bomb.len() < 1 << 13, "{}", bomb.len());
    let error = refused(&bomb, &ReadOptions { max_bytes: 1 << 19, ..ReadOptions::default() });
    assert_eq!((error.code, error.help.contains("--max-bytes")), ("VGS-VOL-005", true), "{error}");
    for at in (0..whole.len()).step_by(31) {
        let mut damaged = whole.clone();
        damaged[at] ^= 0x15;
        // Whatever was changed, there is a volume or an error.
        let _ = read_bytes("a.zip", &damaged);
    }
}

/// A file whose elements are packed as a whole is bounded, too, on disk and in a zip.
#[test]
fn packed_elements_are_bounded_before_they_are_taken() {
    for syntax in PACKED {
        let mut slice = even(1).remove(0);
        slice.syntax = syntax;
        slice.put((0x0009, 0x1010), b"OB", vec![0; 1 << 20]);
        let whole = slice.bytes();
        let meta = 132 + 12 + u32::from_le_bytes(whole[140..144].try_into().unwrap()) as usize;
        let mut packed = flate2::write::DeflateEncoder::new(Vec::new(), flate2::Compression::best());
        packed.write_all(&whole[meta..]).unwrap();
        let bytes = [&whole[..meta], &packed.finish().unwrap()].concat();
        assert!(bytes.len() < 1 << 13);
        for (name, bytes) in [("a.dcm", bytes.clone()), ("a.zip", zip_of(&[("a", bytes)]))] {
            let (_folder, path) = on_disk(name, &bytes);
            let small = ReadOptions { max_bytes: 1 << 19, ..ReadOptions::default() };
            let error = Volume::read(&path, &small).unwrap_err();
            assert_eq!((error.code, error.help.contains("--max-bytes")), ("VGS-VOL-005", true), "{error}");
            // The pixels of the other two are elsewhere, over a network.
            if syntax == PACKED[0] {
                assert_eq!(Volume::read(&path, &ReadOptions::default()).unwrap().size, [4, 3, 1], "{name}");
            }
        }
    }
}

/// Structures on the grid of [`even`] slices, each with its voxels: column, row, slice.
pub(super) fn segmentation(segments: &[(u16, &str, Vec<[usize; 3]>)], kind: &str) -> Dicom {
    let mut file = Dicom::slice(0, place(0.0));
    file.class = SEGMENTATION;
    for tag in [(0x0020, 0x0032), (0x0020, 0x0037), (0x0028, 0x0030), (0x0028, 0x1052), (0x0028, 0x1053)] {
        file.remove(tag);
    }
    file.text((0x0008, 0x0060), b"CS", "SEG");
    file.text((0x0062, 0x0001), b"CS", kind);
    file.put((0x0062, 0x000e), b"US", words(&[200]));
    let items: Vec<_> = segments
        .iter()
        .map(|(number, name, _)| {
            let mut item = Dicom::empty("");
            item.put((0x0062, 0x0004), b"US", words(&[*number]));
            item.text((0x0062, 0x0005), b"LO", name);
            item
        })
        .collect();
    file.sequence((0x0062, 0x0002), &items);
    let mut measures = Dicom::empty("");
    measures.text((0x0028, 0x0030), b"DS", "2\\0.5");
    measures.text((0x0018, 0x0050), b"DS", "3");
    measures.text((0x0018, 0x0088), b"DS", "3");
    let mut orientation = Dicom::empty("");
    orientation.text((0x0020, 0x0037), b"DS", "0.8\\0.6\\0\\-0.6\\0.8\\0");
    let mut shared = Dicom::empty("");
    shared.sequence((0x0028, 0x9110), &[measures]);
    shared.sequence((0x0020, 0x9116), &[orientation]);
    file.sequence((0x5200, 0x9229), &[shared]);
    // The slices where a structure is, the last one first.
    let mut frames = Vec::new();
    let mut pixels: Vec<u8> = Vec::new();
    for (number, _, voxels) in segments {
        for z in (0..10).rev().filter(|z| voxels.iter().any(|v| v[2] == *z)) {
            let mut position = Dicom::empty("");
            let at = place(z as f64).to_array().map(|v| v.to_string()).join("\\");
            position.text((0x0020, 0x0032), b"DS", &at);
            let mut segment = Dicom::empty("");
            segment.put((0x0062, 0x000b), b"US", words(&[*number]));
            let mut frame = Dicom::empty("");
            frame.sequence((0x0020, 0x9113), &[position]);
            frame.sequence((0x0062, 0x000a), &[segment]);
            frames.push(frame);
            let own = (0..12).map(|i| {
                let value = if voxels.contains(&[i % 4, i / 4, z]) { 1 } else { 0 };
                // A quarter and three quarters of the greatest fraction.
                if kind == "FRACTIONAL" && i < 4 {
                    50 * value
                } else if kind == "FRACTIONAL" {
                    150 * value
                } else {
                    value
                }
            });
            pixels.extend(own);
        }
    }
    file.text((0x0028, 0x0008), b"IS", &frames.len().to_string());
    file.sequence((0x5200, 0x9230), &frames);
    let bits = kind == "BINARY";
    for (tag, value) in [(0x0100, 1), (0x0101, 1), (0x0102, 0)] {
        let value = if bits { value } else { [8, 8, 7][usize::from(tag & 3)] };
        file.put((0x0028, tag), b"US", words(&[value]));
    }
    let stored = match bits {
        // Frames of 12 bits do not begin at bytes.
        true => {
            pixels.chunks(8).map(|eight| eight.iter().rev().fold(0, |byte, bit| byte << 1 | bit)).collect()
        }
        false => pixels,
    };
    file.put((0x7fe0, 0x0010), b"OB", stored);
    file
}

/// Reads a file as a mask of [`even`] slices and returns it with the region of the choice.
pub(super) fn mask(file: &Dicom, choice: &str) -> Result<(Volume, Roi)> {
    let folder = super::folder(&even(6));
    let volume = super::read(folder.path(), &ReadOptions::default())?;
    let (_folder, path) = on_disk("mask.dcm", &file.bytes());
    let labels: LabelChoice = if choice.is_empty() { LabelChoice::Whole } else { choice.parse()? };
    let mask = Volume::read_mask(&path, &ReadOptions::default(), &labels, &volume)?;
    let roi = Roi::from_mask(&mask, &labels, &volume)?;
    assert_eq!(roi.size, [4, 3, 6]);
    Ok((mask, roi))
}

/// Returns the voxels of a region with a weight.
fn voxels(roi: &Roi) -> Vec<[usize; 3]> {
    let at = |i: usize| [i % 4, i / 4 % 3, i / 12];
    roi.weight.iter().enumerate().filter(|(_, w)| **w > 0.0).map(|(i, _)| at(i)).collect()
}

#[test]
fn segments_are_labels_where_they_lie() {
    let liver = vec![[1, 1, 1], [2, 1, 1], [3, 2, 4]];
    let vessel = vec![[0, 0, 3], [2, 1, 1]];
    let file = segmentation(&[(2, "Liver", liver.clone()), (7, "vessel", vessel.clone())], "BINARY");
    let (whole, _) = mask(&file, "2,7").unwrap();
    assert_eq!((whole.size, &whole.labels[&2]), ([4, 3, 4], &"Liver".to_owned()), "slices 1 to 4");
    // Structures that overlap are whole, each by itself.
    assert_eq!(voxels(&mask(&file, "liver").unwrap().1), liver);
    assert_eq!(voxels(&mask(&file, "7").unwrap().1), [[2, 1, 1], [0, 0, 3]]);
    let both = voxels(&mask(&file, "liver,vessel").unwrap().1);
    assert_eq!(both, [[1, 1, 1], [2, 1, 1], [0, 0, 3], [3, 2, 4]]);
    let error = mask(&file, "").unwrap_err();
    assert!(
        error.code == "VGS-ROI-008" && error.help.contains("7 vessel (2 voxels)"),
        "{error}: {}",
        error.help
    );
    assert_eq!(mask(&file, "spleen").unwrap_err().code, "VGS-ROI-010");
    // One structure needs no choice, and is also its number.
    let one = segmentation(&[(7, "vessel", vessel)], "BINARY");
    assert_eq!(voxels(&mask(&one, "").unwrap().1), [[2, 1, 1], [0, 0, 3]]);
    assert_eq!(voxels(&mask(&one, "7").unwrap().1).len(), 2);
}

#[test]
fn fractions_are_soft_alone_and_halved_among_others() {
    let all = (0..12).map(|i| [i % 4, i / 4, 2]).collect::<Vec<_>>();
    let file = segmentation(&[(1, "a", all.clone())], "FRACTIONAL");
    let (_, roi) = mask(&file, "").unwrap();
    assert!(roi.soft && roi.weight[24] == 0.25 && roi.weight[30] == 0.75, "{:?}", &roi.weight[24..36]);
    let (_, roi) = mask(&file, "1").unwrap();
    assert!(!roi.soft && roi.voxel_count() == 8);
    let mut file = segmentation(&[(1, "a", all)], "LABELMAP");
    assert_eq!(mask(&file, "a").unwrap().1.voxel_count(), 12);
    file.text((0x0062, 0x0001), b"CS", "SURFACE");
    assert_eq!(mask(&file, "").unwrap_err().code, "VGS-DCM-017");
}

#[test]
fn segmentations_that_cannot_be_read_are_refused() {
    let good = || segmentation(&[(1, "a", vec![[1, 1, 1], [1, 1, 2]])], "BINARY");
    type Change = fn(&mut Dicom);
    let rows: [(&str, Change); 4] = [
        ("VGS-DCM-016", |file| file.remove((0x0062, 0x0002))),
        ("VGS-DCM-012", |file| file.put((0x7fe0, 0x0010), b"OB", vec![1; 2])),
        ("VGS-DCM-004", |file| file.remove((0x5200, 0x9230))),
        ("VGS-DCM-003", |file| file.text((0x0028, 0x0008), b"IS", "2000000000")),
    ];
    for (code, change) in rows {
        let mut file = good();
        change(&mut file);
        let error = mask(&file, "").unwrap_err();
        assert_eq!(error.code, code, "{error}");
        assert!(error.file.is_some() && !error.help.is_empty(), "{error}");
    }
    let whole = good().bytes();
    for at in (128..whole.len()).step_by(13) {
        let mut bytes = whole.clone();
        bytes[at] ^= 0x11;
        let _ = read_bytes("a.dcm", &bytes);
        let _ = read_bytes("a.dcm", &whole[..at]);
    }
}

#[test]
fn a_scan_beside_its_segmentation_is_the_scan() {
    let folder = super::folder(&even(3));
    let mask = segmentation(&[(1, "a", vec![[1, 1, 1]])], "BINARY");
    std::fs::write(folder.path().join("seg.dcm"), mask.bytes()).unwrap();
    assert_eq!(super::read(folder.path(), &ReadOptions::default()).unwrap().size, [4, 3, 3]);
    let alone = super::folder(std::slice::from_ref(&mask));
    let found = structures(alone.path(), &ReadOptions::default()).unwrap().expect("structures");
    assert_eq!((found.len(), found[0].name.as_str()), (1, "a"));
    let two = super::folder(&[mask.clone(), mask]);
    let error = super::read(two.path(), &ReadOptions::default()).unwrap_err();
    assert_eq!((error.kind, error.code), (Kind::Usage, "VGS-DCM-020"));
}

/// Returns a structure set; contours are points in voxels of [`even`] slices.
pub(super) fn structure_set(structures: &[(i32, &str, Vec<Vec<DVec3>>)]) -> Dicom {
    let mut file = Dicom::empty(STRUCTURE_SET);
    file.text((0x0008, 0x0060), b"CS", "RTSTRUCT");
    let (along, across) = (DVec3::new(0.8, 0.6, 0.0) * 0.5, DVec3::new(-0.6, 0.8, 0.0) * 2.0);
    let rois: Vec<_> = structures
        .iter()
        .map(|(number, name, _)| {
            let mut item = Dicom::empty("");
            item.text((0x3006, 0x0022), b"IS", &number.to_string());
            item.text((0x3006, 0x0024), b"UI", "1.2.3.3");
            item.text((0x3006, 0x0026), b"LO", name);
            item
        })
        .collect();
    let of_rois: Vec<_> = structures
        .iter()
        .map(|(number, _, contours)| {
            let contours: Vec<_> = contours
                .iter()
                .map(|contour| {
                    let mut item = Dicom::empty("");
                    item.text((0x3006, 0x0042), b"CS", "CLOSED_PLANAR");
                    let numbers = contour.iter().flat_map(|p| {
                        let at = place(p.z) + along * p.x + across * p.y;
                        at.to_array().map(|v| format!("{v:.6}"))
                    });
                    item.text((0x3006, 0x0050), b"DS", &numbers.collect::<Vec<_>>().join("\\"));
                    item
                })
                .collect();
            let mut item = Dicom::empty("");
            item.text((0x3006, 0x0084), b"IS", &number.to_string());
            item.sequence((0x3006, 0x0040), &contours);
            item
        })
        .collect();
    file.sequence((0x3006, 0x0020), &rois);
    file.sequence((0x3006, 0x0039), &of_rois);
    file
}

/// Returns a rectangle of voxels in a slice.
pub(super) fn rectangle(low: [f64; 2], high: [f64; 2], slice: f64) -> Vec<DVec3> {
    let corners = [[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]];
    corners.map(|[x, y]| DVec3::new(x, y, slice)).into()
}

#[test]
fn contours_are_the_voxels_whose_centres_they_enclose() {
    let outer = rectangle([-0.5, -0.5], [3.5, 2.5], 2.0);
    let hole = rectangle([0.5, 0.5], [2.5, 1.5], 2.0);
    let tumour = |slice| rectangle([1.5, 0.5], [2.5, 1.5], slice);
    let file = structure_set(&[
        (1, "liver", vec![outer, hole]),
        // Drawn on every other slice; the one between takes the nearer contour.
        (2, "tumour", vec![tumour(1.0), tumour(3.0)]),
    ]);
    let liver = voxels(&mask(&file, "liver").unwrap().1);
    assert_eq!(liver.len(), 10);
    assert!(
        !liver.contains(&[1, 1, 2]) && !liver.contains(&[2, 1, 2]) && liver.contains(&[3, 1, 2]),
        "{liver:?}"
    );
    let tumour = voxels(&mask(&file, "2").unwrap().1);
    let slices: Vec<_> = tumour.iter().map(|v| v[2]).collect();
    assert!(tumour.iter().all(|v| v[..2] == [2, 1]), "{tumour:?}");
    assert_eq!(slices, [0, 1, 2, 3], "each stands for two slices");
    assert_eq!(mask(&file, "").unwrap_err().code, "VGS-ROI-008");
}

#[test]
fn structure_sets_that_cannot_be_read_are_refused() {
    let whole = vec![rectangle([0.0, 0.0], [3.0, 2.0], 1.0)];
    let alone = structure_set(&[(0, "a", whole.clone())]);
    assert_eq!(
        mask(&alone, "").unwrap().1.voxel_count(),
        12,
        "centres on the contour are inside; numbered anew: 0 is no label"
    );
    let error: Error = read_bytes("a.dcm", &alone.bytes()).unwrap_err();
    assert!(error.code == "VGS-DCM-018" && error.help.contains("--roi"), "{error}");
    let across = vec![DVec3::ZERO, DVec3::new(3.0, 0.0, 2.0), DVec3::new(0.0, 2.0, 4.0)];
    assert_eq!(mask(&structure_set(&[(1, "a", vec![across])]), "").unwrap_err().code, "VGS-DCM-019");
    assert_eq!(mask(&structure_set(&[]), "").unwrap_err().code, "VGS-DCM-016");
    let nothing = structure_set(&[(1, "a", Vec::new())]);
    assert_eq!(mask(&nothing, "").unwrap_err().code, "VGS-ROI-003");
}

/// Returns the columns and rows of slice 2 that contours there enclose, by their type.
fn enclosed(kind: &str, contours: Vec<Vec<DVec3>>) -> Vec<[usize; 2]> {
    let mut file = structure_set(&[(1, "a", contours)]);
    assert!(file.change_all((0x3006, 0x0042), Some((b"CS", kind.as_bytes()))));
    match mask(&file, "") {
        Ok((_, roi)) => voxels(&roi).into_iter().map(|[x, y, _]| [x, y]).collect(),
        Err(error) => {
            assert_eq!(error.code, "VGS-ROI-003", "{error}");
            Vec::new()
        }
    }
}

#[test]
fn contours_are_a_union_less_the_holes_and_by_parity_if_they_say_so() {
    const PLANAR: &str = "CLOSED_PLANAR";
    const XOR: &str = "CLOSEDPLANAR_XOR";
    let of = |low: [f64; 2], high: [f64; 2]| rectangle(low, high, 2.0);
    let all = of([-0.5, -0.5], [3.5, 2.5]);
    let ring = || vec![all.clone(), of([0.5, 0.5], [2.5, 1.5])];
    assert_eq!(enclosed(PLANAR, vec![all.clone()]).len(), 12);
    // A hole, in either order; twice is once, in either direction and from any point on.
    let reversed = || all.iter().rev().copied().collect::<Vec<_>>();
    let turned = || [&all[2..], &all[..2]].concat();
    for kind in [PLANAR, XOR] {
        assert_eq!(enclosed(kind, ring()).len(), 10, "{kind}");
        assert_eq!(enclosed(kind, ring().into_iter().rev().collect()).len(), 10, "{kind}");
    }
    for same in [all.clone(), reversed(), turned()] {
        assert_eq!(enclosed(PLANAR, vec![all.clone(), same.clone()]).len(), 12);
        assert_eq!(enclosed(PLANAR, [ring(), vec![same.clone()], ring()].concat()).len(), 10);
        assert!(enclosed(XOR, vec![all.clone(), same]).is_empty(), "the standard has them cancel out");
    }
    // Overlap in part: all of both, and by parity what one of them alone has.
    let left = of([-0.5, -0.5], [2.5, 2.5]);
    let right = of([1.5, -0.5], [3.5, 2.5]);
    assert_eq!(enclosed(PLANAR, vec![left.clone(), right.clone()]).len(), 12);
    assert_eq!(enclosed(XOR, vec![left.clone(), right.clone()]).len(), 9);
    // A hole in one that another one covers is no hole there.
    let hole = of([0.6, 0.6], [1.4, 1.4]);
    let cover = of([0.8, -0.5], [3.5, 2.5]);
    assert!(enclosed(PLANAR, vec![left.clone(), hole.clone(), cover]).contains(&[1, 1]));
    assert!(!enclosed(PLANAR, vec![left.clone(), hole, right]).contains(&[1, 1]));
    // An island in a hole, which no voxel separates.
    let island = || of([0.9, 0.9], [1.1, 1.1]);
    for kind in [PLANAR, XOR] {
        let found = enclosed(kind, [ring(), vec![island()]].concat());
        assert!(found.contains(&[1, 1]) && !found.contains(&[2, 1]), "{kind}: {found:?}");
    }
    // A keyhole leads to the hole and back; what stands in the hole is beside it.
    let path =
        [[-0.5, -0.5], [3.5, -0.5], [3.5, 2.5], [-0.5, 2.5], [-0.5, 1.0], [0.5, 1.0], [0.5, 1.5], [2.5, 1.5]];
    let path = [&path[..], &[[2.5, 0.5], [0.5, 0.5], [0.5, 1.0], [-0.5, 1.0]]].concat();
    let keyhole: Vec<DVec3> = path.iter().map(|[x, y]| DVec3::new(*x, *y, 2.0)).collect();
    assert_eq!(enclosed(PLANAR, vec![keyhole.clone()]).len(), 10);
    assert_eq!(enclosed(PLANAR, vec![keyhole, of([1.8, 0.8], [2.2, 1.2])]).len(), 11);
    // Neighbours share an edge, and one fills the bay of another one.
    let bay = [
        [-0.5, -0.5],
        [0.5, -0.5],
        [0.5, 1.5],
        [1.5, 1.5],
        [1.5, -0.5],
        [3.5, -0.5],
        [3.5, 2.5],
        [-0.5, 2.5],
    ];
    let bay: Vec<DVec3> = bay.iter().map(|[x, y]| DVec3::new(*x, *y, 2.0)).collect();
    assert_eq!(enclosed(PLANAR, vec![bay.clone()]).len(), 10);
    assert_eq!(enclosed(PLANAR, vec![bay, of([0.5, -0.5], [1.5, 1.5])]).len(), 12);
}

/// The very name comes first, all structures of it are taken, and another case is only a help.
#[test]
fn structures_of_one_name() {
    let voxel = |x: f64| vec![rectangle([x - 0.2, 0.8], [x + 0.2, 1.2], 2.0)];
    let contours = |names: [&str; 3]| {
        structure_set(&[(1, names[0], voxel(0.0)), (4, names[1], voxel(1.0)), (6, names[2], voxel(2.0))])
    };
    let voxels_of = |names: [&str; 3]| {
        let bits = |x: usize| vec![[x, 1, 2]];
        segmentation(&[(1, names[0], bits(0)), (4, names[1], bits(1)), (6, names[2], bits(2))], "BINARY")
    };
    for write in [&contours as &dyn Fn([&str; 3]) -> Dicom, &voxels_of] {
        let columns = |names, choice: &str| {
            mask(&write(names), choice).map(|(_, roi)| voxels(&roi).iter().map(|v| v[0]).collect::<Vec<_>>())
        };
        assert_eq!(columns(["GTV", "gtv", "heart"], "gtv").unwrap(), [1]);
        assert_eq!(columns(["GTV", "gtv", "heart"], "GTV").unwrap(), [0]);
        assert_eq!(columns(["Lesion", "Lesion", "heart"], "Lesion").unwrap(), [0, 1]);
        assert_eq!(columns(["Lesion", "Lesion", "heart"], "lesion").unwrap(), [0, 1]);
        assert_eq!(columns(["Lesion", "Lesion", "Heart"], "heart,1").unwrap(), [0, 2]);
        let error = columns(["GTV", "gtv", "heart"], "Gtv").unwrap_err();
        assert_eq!((error.kind, error.code), (Kind::Usage, "VGS-ROI-018"));
        assert!(error.message.contains("1 GTV, 4 gtv"), "{error}");
    }
}

/// Slices that are empty are left out, and no slice is as thick as a gap.
#[test]
fn segments_far_apart_lie_on_the_planes_of_the_scan() {
    for slices in [vec![0, 2, 4], vec![1, 4], vec![3], vec![0, 5]] {
        for (thickness, distance) in
            [(Some("3"), None), (None, None), (Some("1.5"), None), (Some("3"), Some("3"))]
        {
            let marked: Vec<[usize; 3]> = slices.iter().map(|&z| [1, 1, z]).collect();
            let mut file = segmentation(&[(1, "a", marked.clone())], "BINARY");
            let set = |file: &mut Dicom, tag, value: Option<&'static str>| {
                file.change_all(tag, value.map(|value| (b"DS", value.as_bytes())));
            };
            set(&mut file, (0x0018, 0x0050), thickness);
            set(&mut file, (0x0018, 0x0088), distance);
            let found = voxels(&mask(&file, "").unwrap().1);
            assert_eq!(found, marked, "thickness {thickness:?}, distance {distance:?}");
        }
    }
}

#[test]
fn structures_of_another_space_are_told() {
    let scan: Vec<Dicom> = even(3)
        .into_iter()
        .map(|mut file| {
            file.text((0x0020, 0x0052), b"UI", "1.2.3.3");
            file
        })
        .collect();
    let volume = super::read(super::folder(&scan).path(), &ReadOptions::default()).unwrap();
    assert_eq!(volume.frame_of_reference.as_deref(), Some("1.2.3.3"));
    let options = ReadOptions { frame_of_reference: volume.frame_of_reference, ..ReadOptions::default() };
    assert_eq!(other_space("1.2.3.3", &options), None);
    assert_eq!(other_space("", &options), None, "it is not told");
    assert_eq!(other_space("9.9", &ReadOptions::default()), None, "the volume does not know its own");
    assert!(other_space("9.9", &options).is_some_and(|note| note.contains("9.9")));
}
