//! Files as scanners and other programs write them, in `../shared/faults`, each with a README that says what is right
//! and by which program that was found out. Without that folder there is nothing to read, and the test says so.

use std::path::{Path, PathBuf};

use super::super::list;
use crate::{LabelChoice, ReadOptions, Roi, Volume};
use base::{Error, Result};

fn faults() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/faults");
    if !folder.is_dir() {
        eprintln!("skipped: there is no {}", folder.display());
        return None;
    }
    Some(folder)
}

fn range(path: &Path) -> Result<(f32, f32)> {
    Ok(Volume::read(path, &ReadOptions::default())?.min_max().unwrap_or_default())
}

/// Returns the number of voxels of a mask on the CT beside it.
fn count(mask: &Path, labels: &str) -> Result<usize> {
    let labels: LabelChoice = if labels.is_empty() { LabelChoice::Whole } else { labels.parse()? };
    let ct = mask.with_file_name("ct.nii.gz");
    let ct = Volume::read(ct, &ReadOptions::default())?;
    let mask = Volume::read_mask(mask, &ReadOptions::default(), &labels, &ct)?;
    Ok(Roi::from_mask(&mask, &labels, &ct)?.voxel_count())
}

#[test]
fn values_of_scans() {
    let Some(faults) = faults() else { return };
    assert_eq!(range(&faults.join("rescale-decimal-comma/series")).unwrap(), (-1000.0, 94.0));
    assert_eq!(range(&faults.join("modality-lut/series")).unwrap(), (48.0, 2236.0));
    let error: Error = range(&faults.join("siemens-mosaic/series")).unwrap_err();
    assert!(error.code == "VGS-DCM-023" && error.help.contains("dcm2niix"), "{error}");
    let slices = |name: &str| -> Vec<usize> {
        let listed = list(&faults.join(name), &ReadOptions::default()).unwrap();
        listed.iter().map(|row| row.size[2]).collect()
    };
    assert_eq!(slices("one-slice-twice/series"), [8]);
    assert_eq!(slices("one-slice-twice/phases"), [8, 8]);
}

#[test]
fn voxels_of_structures() {
    let Some(faults) = faults() else { return };
    for (name, labels, voxels) in [
        ("contour-data-un/long.dcm", "", 1516),
        ("contour-data-un/long-implicit.dcm", "", 1516),
        ("structures-same-name/case.dcm", "gtv", 1200),
        ("structures-same-name/case.dcm", "GTV", 1280),
        ("structures-same-name/twice.dcm", "Lesion", 1920),
        ("structures-same-name/seg-twice.dcm", "Lesion", 1692),
        ("closedplanar-xor/xor.dcm", "", 1200),
        ("contours-overlap/overlap.dcm", "", 2180),
        ("contours-overlap/twice.dcm", "", 1280),
        ("contours-overlap/one-twice.dcm", "", 1280),
        ("seg-slices-apart/seg135.dcm", "", 1242),
        ("seg-slices-apart/seg16.dcm", "", 828),
    ] {
        let found = count(&faults.join(name), labels).unwrap_or_else(|e| panic!("{name} {labels}: {e}"));
        assert_eq!(found, voxels, "{name} {labels}");
    }
}
