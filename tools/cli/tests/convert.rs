//! `vgs convert`: layouts of the PLY, and what another program has dropped.
#![forbid(unsafe_code)]

mod support;

use support::{Folder, fit};

/// Returns a PLY of ours as splat-transform writes it: without comments and without a second element.
fn without_comments(file: &[u8]) -> Vec<u8> {
    let end = file.windows(11).position(|w| w == b"end_header\n").expect("a header") + 11;
    let header = std::str::from_utf8(&file[..end]).expect("ASCII");
    let (vertices, _) =
        header.split_once("element exception").expect("a fit to a binary mask has exceptions");
    let kept: Vec<&str> = vertices.lines().filter(|line| !line.starts_with("comment")).collect();
    let count: usize = kept[2].rsplit(' ').next().expect("a count").parse().expect("a number");
    let floats = kept.iter().filter(|line| line.starts_with("property float")).count();
    [kept.join("\n").as_bytes(), b"\nend_header\n", &file[end..][..count * floats * 4]].concat()
}

#[test]
fn what_a_program_has_dropped_comes_back_from_the_original() {
    let folder = Folder::new(16);
    assert_eq!(folder.run(&fit("ours.ply", &["--no-eval"])).code, 0);
    folder.write("edited.ply", without_comments(&folder.read("ours.ply")));
    let ended = folder.run(&["info", "edited.ply", "--json"]);
    assert!(ended.err.contains("--like ORIGINAL"), "{}", ended.err);
    assert_eq!(ended.json()["kernel"], "gaussian", "no one says which it is");
    let places = |name: &str| folder.run(&["info", name, "--json"]).json()["bounding_box_mm"].clone();
    assert_eq!(places("edited.ply"), places("ours.ply"), "the places do not depend on a comment");

    let ended = folder.run(&["convert", "edited.ply", "--like", "ours.ply", "-o", "back.ply"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert!(folder.read("back.ply") == folder.read("ours.ply"), "all of it is back");

    let ended = folder.run(&["convert", "ours.ply", "--like", "ours.ply", "-o", "no.ply"]);
    assert_eq!(ended.code, 2, "{}", ended.err);
    assert!(ended.err.contains("VGS-CLI-129"), "{}", ended.err);
}

#[test]
fn a_ply_is_written_in_any_layout_that_needs_no_volume() {
    let folder = Folder::new(16);
    assert_eq!(folder.run(&fit("ours.ply", &["--no-eval"])).code, 0);
    let ended = folder.run(&["convert", "ours.ply", "-o", "rows.ply", "--ply-layout", "inria"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert_eq!(folder.run(&["info", "rows.ply", "--json"]).json()["layout"], "inria");
    assert_eq!(folder.run(&["convert", "rows.ply", "-o", "again.ply"]).code, 0);
    assert!(folder.read("again.ply") == folder.read("ours.ply"), "there and back it is the same file");

    let ended = folder.run(&["convert", "ours.ply", "-o", "no.ply", "--ply-layout", "reference"]);
    assert_eq!(ended.code, 2, "{}", ended.err);
    assert!(ended.err.contains("vgs fit --ply-layout reference"), "{}", ended.err);
}

#[test]
fn splats_in_formats_of_others_are_told_by_name() {
    let folder = Folder::new(16);
    for (name, start, word) in
        [("a.spz", &b"NGSP\x04\0\0\0"[..], "an SPZ file"), ("a.sog", b"PK\x03\x04", "a SOG bundle")]
    {
        folder.write(name, start);
        for command in [&["info", name][..], &["convert", name, "-o", "a.ply"]] {
            let ended = folder.run(command);
            assert_eq!(ended.code, 65, "{}", ended.err);
            assert!(ended.err.contains(word) && ended.err.contains("splat-transform"), "{}", ended.err);
        }
    }
}
