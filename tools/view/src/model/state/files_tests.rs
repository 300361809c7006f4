use std::fs;

use super::*;

/// Returns a folder with these files.
fn folder(names: &[&str]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    for name in names {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("folders");
        fs::write(path, name).expect("a file");
    }
    folder
}

fn files(splats: &[PathBuf], volume: Option<PathBuf>) -> Files {
    Files { splats: splats.to_vec(), volume, ..Files::default() }
}

#[test]
fn paths_below_a_session_are_relative_and_others_are_not() {
    let (case, other) = (folder(&["bones.ply", "scan/1.dcm"]), folder(&["liver.ply"]));
    let at = |name: &str| case.path().join(name);
    let liver = other.path().join("liver.ply");
    let open = files(&[at("bones.ply"), liver.clone()], Some(at("scan")));
    let seen = open.seen_from(case.path());
    assert_eq!(seen, files(&["bones.ply".into(), liver.clone()], Some("scan".into())));
    // The session may lie in the folder of slices itself.
    assert_eq!(open.seen_from(&at("scan")).volume, Some(".".into()));
    // They are found from there again, and where the folder was moved to.
    let mut found = seen.clone();
    found.find_from(case.path()).expect("found");
    assert_eq!(found, open);
    assert!(found.missing().is_empty());
    let moved = folder(&["bones.ply", "scan/1.dcm"]);
    let mut found = seen;
    found.find_from(moved.path()).expect("found");
    assert_eq!(found, files(&[moved.path().join("bones.ply"), liver], Some(moved.path().join("scan"))));
}

#[test]
fn what_is_missing_is_looked_for_beside_the_session_and_named() {
    let case = folder(&["bones.ply", "deep/fits/coarse.ply", "coarse.ply"]);
    let at = |name: &str| case.path().join(name);
    let named =
        ["/home/someone/deep/fits/coarse.ply", r"C:\Users\someone\bones.ply", "/home/someone/none.ply"];
    let mut open = files(&named.map(PathBuf::from), None);
    open.find_from(case.path()).expect("found");
    // The longest end of a path that is there, since names may be there twice.
    assert_eq!(open.splats[..2], [at("deep/fits/coarse.ply"), at("bones.ply")]);
    assert_eq!(open.missing(), [PathBuf::from(named[2])]);

    // One that is found brings along those beside it.
    let elsewhere = folder(&["renamed.ply", "ct.nii.gz"]);
    open.volume = Some("/home/someone/ct.nii.gz".into());
    assert_eq!(open.missing().len(), 2);
    open.replace_missing(Path::new(named[2]), &elsewhere.path().join("renamed.ply"));
    assert!(open.missing().is_empty(), "{:?}", open.missing());
    assert_eq!(open.volume, Some(elsewhere.path().join("ct.nii.gz")));
}

#[test]
fn a_case_is_named_after_its_first_file() {
    for (file, name) in [
        ("a/bones.ply", "bones"),
        ("a/Bones.Fine.VGS", "Bones.Fine"),
        ("a/ct.nii.gz", "ct"),
        ("a/scans", "scans"),
        ("a/IM0001", "IM0001"),
        ("a/.ply", "vgs"),
    ] {
        let named = files(&[file.into()], Some("b/other.nii".into())).case_name();
        assert_eq!(named.as_deref().unwrap_or("vgs"), name);
    }
    assert_eq!(files(&[], Some("b/other.nii".into())).case_name().as_deref(), Some("other"));
    assert_eq!(Files::default().case_name(), None);
}
