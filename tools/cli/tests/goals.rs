//! Fits that are asked for an error or for a size, not for a number of splats.

use crate::support::Folder;

const FIT: [&str; 5] = ["fit", "ct.nii.gz", "--roi", "mask.nii.gz", "--json"];

fn fit(folder: &Folder, more: &[&str]) -> serde_json::Value {
    folder.run(&[&FIT[..], &["--iterations", "120", "--eval-offsets", "0"], more].concat()).json()
}

#[test]
fn a_target_is_reached_and_told() {
    let folder = Folder::new(32);
    for (output, flag, target, key) in
        [("a.ply", "--target-psnr", "32", "psnr_db"), ("b.vgs", "--target-hu", "120", "p99_hu")]
    {
        let found = fit(&folder, &["-o", output, flag, target]);
        let (value, target) =
            (found[key].as_f64().expect("a figure"), target.parse::<f64>().expect("a number"));
        assert_eq!(found["target_reached"], true, "{found}");
        assert!(if key == "psnr_db" { value >= target } else { value <= target }, "{value}, {target}");
    }
    let limited = folder.run(
        &[&FIT[..4], &["-o", "c.ply", "--iterations", "20", "--target-psnr", "99", "--max-splats", "40"]]
            .concat(),
    );
    assert_eq!(limited.code, 0, "{}", limited.err);
    assert!(limited.err.contains("40 are the most there may be"), "{}", limited.err);
    assert!(limited.err.contains("a PSNR of 99 dB is missed by"), "{}", limited.err);
    assert!(limited.out.contains("fitted 40 splats"), "{}", limited.out);
}

#[test]
fn a_file_has_at_most_the_size_that_it_may_have() {
    let folder = Folder::new(32);
    for (output, size) in [("a.ply", 12_000), ("b.ply", 6_000), ("a.vgs", 2_500)] {
        let found = fit(&folder, &["-o", output, "--force", "--max-size", &size.to_string()]);
        let bytes = folder.read(output).len();
        println!("{output}: {} splats, {bytes} of {size} bytes", found["splats"]);
        assert!(bytes <= size && bytes * 10 > size * 6, "{output}: {bytes} of {size} bytes");
        assert_eq!(found["target_reached"], serde_json::Value::Null);
    }
    // No file is that small: what is possible is written, and the rest is said.
    let ended = folder.run(
        &[&FIT[..4], &["-o", "b.ply", "--iterations", "5", "--no-eval", "--force", "--max-size", "100"]]
            .concat(),
    );
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert!(ended.err.contains("more than 100 bytes"), "{}", ended.err);
}

#[test]
fn two_answers_to_one_question_are_refused() {
    let folder = Folder::new(16);
    for number in [["--splats", "10"], ["--density", "0.1"]] {
        let ended = folder.run(&[&FIT[..4], &["-o", "a.ply", "--target-hu", "50"], &number[..]].concat());
        assert_eq!(ended.code, 2, "{}", ended.err);
        assert!(ended.err.contains("VGS-CFG-017") && ended.err.contains(&number[0][2..]), "{}", ended.err);
    }
    assert!(!folder.path("a.ply").exists());
}
