//! Inputs and arguments that must be refused: with the right exit code, a message that helps, and nothing touched.

use crate::support::Folder;

struct RefusalRow {
    name: &'static str,
    arguments: &'static [&'static str],
    exit: i32,
    /// What stderr must hold.
    says: &'static [&'static str],
}

const ROWS: &[RefusalRow] = &[
    RefusalRow {
        name: "the volume is missing",
        arguments: &["fit", "none.nii.gz", "--roi", "mask.nii.gz", "-o", "x.ply"],
        exit: 66,
        says: &["error[VGS-VOL-001]: none.nii.gz: no such file"],
    },
    RefusalRow {
        name: "the mask is missing",
        arguments: &["fit", "ct.nii.gz", "--roi", "none.nii.gz", "-o", "x.ply"],
        exit: 66,
        says: &["none.nii.gz: no such file"],
    },
    RefusalRow {
        name: "the volume is empty",
        arguments: &["fit", "empty.nii", "--roi", "mask.nii.gz", "-o", "x.ply"],
        exit: 65,
        says: &["empty.nii: the file is empty"],
    },
    RefusalRow {
        name: "the mask is zero everywhere",
        arguments: &["fit", "ct.nii.gz", "--roi", "zero.nii", "-o", "x.ply"],
        exit: 3,
        says: &["zero.nii: the mask is zero everywhere"],
    },
    RefusalRow {
        name: "mask and volume are apart",
        arguments: &["fit", "ct.nii.gz", "--roi", "far.nii", "-o", "x.ply"],
        exit: 65,
        says: &["far.nii: mask and volume do not overlap (boxes"],
    },
    RefusalRow {
        name: "no label was chosen",
        arguments: &["fit", "ct.nii.gz", "--roi", "labels.nii", "-o", "x.ply"],
        exit: 2,
        says: &["labels.nii", "--roi-label", "5 ("],
    },
    RefusalRow {
        name: "a label that is not there",
        arguments: &["fit", "ct.nii.gz", "--roi", "labels.nii", "--roi-label", "7", "-o", "x.ply"],
        exit: 2,
        says: &["no label '7'"],
    },
    RefusalRow {
        name: "a label that no splat can carry",
        arguments: &["fit", "ct.nii.gz", "--roi", "atlas.nii", "--roi-label", "300", "-o", "x.ply"],
        exit: 65,
        says: &["VGS-ROI-013", "atlas.nii: label 300", "renumber"],
    },
    RefusalRow {
        name: "no voxel is between the thresholds",
        arguments: &["fit", "ct.nii.gz", "--roi-threshold", "20000,30000", "-o", "x.ply"],
        exit: 3,
        says: &["ct.nii.gz: the region of interest is empty"],
    },
    RefusalRow {
        name: "a negative radius, before a file is read",
        arguments: &["fit", "none.nii", "--roi-threshold", "0,1", "--roi-close", "-1", "-o", "x.ply"],
        exit: 2,
        says: &["VGS-ROI-014", "--roi-close is -1; it must be a radius from 0 to 50 mm", "--roi-close 2"],
    },
    RefusalRow {
        name: "a radius that closes everything",
        arguments: &["fit", "ct.nii.gz", "--roi-threshold", "0,1", "--roi-close", "60", "-o", "x.ply"],
        exit: 2,
        says: &["VGS-ROI-014", "--roi-close is 60"],
    },
    RefusalRow {
        name: "a least volume that is no number",
        arguments: &["eval", "away.ply", "ct.nii.gz", "--roi-threshold", "0,1", "--roi-min-ml", "NaN"],
        exit: 2,
        says: &["VGS-ROI-014", "--roi-min-ml is NaN"],
    },
    RefusalRow {
        name: "no piece of the threshold",
        arguments: &["fit", "ct.nii.gz", "--roi-threshold", "0,1", "--roi-largest=0", "-o", "x.ply"],
        exit: 2,
        says: &["VGS-ROI-014", "--roi-largest is 0"],
    },
    RefusalRow {
        name: "no piece of the threshold is large enough",
        arguments: &["fit", "ct.nii.gz", "--roi-threshold", "-9e3,9e3", "--roi-min-ml", "1e6", "-o", "x.ply"],
        exit: 3,
        says: &["VGS-ROI-015", "ct.nii.gz: no connected piece from -9000 to 9000 has 1000000 ml"],
    },
    RefusalRow {
        name: "a mask is not cleaned",
        arguments: &["fit", "ct.nii.gz", "--roi", "mask.nii.gz", "--roi-largest", "-o", "x.ply"],
        exit: 2,
        says: &["--roi", "cannot be used with", "--roi-largest"],
    },
    RefusalRow {
        name: "a mask of a picture is not cleaned either",
        arguments: &["render", "ct.nii.gz", "--roi", "mask.nii.gz", "--roi-fill", "-o", "x.png"],
        exit: 2,
        says: &["--roi", "cannot be used with", "--roi-fill"],
    },
    RefusalRow {
        name: "distances of voxels that the file has",
        arguments: &["eval", "away.ply", "ct.nii.gz", "--roi", "mask.nii.gz", "--voxel-mm", "2"],
        exit: 2,
        says: &["VGS-CLI-120", "ct.nii.gz: --voxel-mm is for files without a voxel spacing"],
    },
    RefusalRow {
        name: "a series of no folder",
        arguments: &["view", "--series", "3"],
        exit: 2,
        says: &["VGS-CLI-121", "--series is one of a DICOM folder"],
    },
    RefusalRow {
        name: "a mistyped quality",
        arguments: &["fit", "ct.nii.gz", "--roi", "mask.nii.gz", "--quality", "fien", "-o", "x.ply"],
        exit: 2,
        says: &["VGS-CFG-015", "did you mean fine?"],
    },
    RefusalRow {
        name: "a threshold has no labels",
        arguments: &["fit", "ct.nii.gz", "--roi-threshold", "0,1", "--roi-label", "5", "-o", "x.ply"],
        exit: 2,
        says: &["--roi-label", "cannot be used with", "--roi-threshold"],
    },
    RefusalRow {
        name: "cleaning without a threshold",
        arguments: &["fit", "ct.nii.gz", "--roi-fill", "-o", "x.ply"],
        exit: 2,
        says: &["--roi-threshold"],
    },
    RefusalRow {
        name: "neither mask nor thresholds",
        arguments: &["fit", "ct.nii.gz", "-o", "x.ply"],
        exit: 2,
        says: &["--roi"],
    },
    RefusalRow {
        name: "mask and thresholds",
        arguments: &["fit", "ct.nii.gz", "--roi", "mask.nii.gz", "--roi-threshold", "0,1", "-o", "x.ply"],
        exit: 2,
        says: &["--roi"],
    },
    RefusalRow {
        name: "the output exists",
        arguments: &["fit", "ct.nii.gz", "--roi", "mask.nii.gz", "-o", "taken.ply"],
        exit: 73,
        says: &["taken.ply: the output exists already", "--force"],
    },
    RefusalRow {
        name: "a file beside the output exists",
        arguments: &["fit", "ct.nii.gz", "--roi", "mask.nii.gz", "-o", "half.ply"],
        exit: 73,
        says: &["half.csv: the output exists already"],
    },
    RefusalRow {
        name: "the output is the input",
        arguments: &["rasterize", "taken.ply", "--like", "ct.nii.gz", "-o", "link.nii.gz", "--force"],
        exit: 73,
        says: &["the output is the input"],
    },
    RefusalRow {
        name: "the output's folder is missing",
        arguments: &["fit", "none.nii.gz", "--roi", "mask.nii.gz", "-o", "nowhere/x.ply"],
        exit: 73,
        says: &["nowhere/x.ply"],
    },
    RefusalRow {
        name: "the output's folder is a file",
        arguments: &["fit", "ct.nii.gz", "--roi", "mask.nii.gz", "-o", "empty.nii/x.ply"],
        exit: 73,
        says: &["empty.nii/x.ply"],
    },
    RefusalRow {
        name: "the output's extension is unknown",
        arguments: &["fit", "ct.nii.gz", "--roi", "mask.nii.gz", "-o", "x.obj"],
        exit: 2,
        says: &["x.obj", ".ply"],
    },
    RefusalRow {
        name: "an unknown key in the configuration",
        arguments: &["fit", "ct.nii.gz", "--roi", "mask.nii.gz", "-o", "x.ply", "--config", "typo.toml"],
        exit: 2,
        says: &["typo.toml", "\"iteratons\"", "did you mean \"iterations\""],
    },
    RefusalRow {
        name: "a wrong type in the configuration",
        arguments: &["fit", "ct.nii.gz", "--roi", "mask.nii.gz", "-o", "x.ply", "--config", "type.toml"],
        exit: 2,
        says: &["type.toml: rate_mean"],
    },
    RefusalRow {
        name: "a configuration that is no TOML",
        arguments: &["fit", "ct.nii.gz", "--roi", "mask.nii.gz", "-o", "x.ply", "--config", "broken.toml"],
        exit: 2,
        says: &["broken.toml", "not valid TOML"],
    },
    RefusalRow {
        name: "a configuration without end",
        arguments: &["fit", "ct.nii.gz", "--roi", "mask.nii.gz", "-o", "x.ply", "--config", "/dev/zero"],
        exit: 65,
        says: &["VGS-IO-002", "/dev/zero: is a device, not a file"],
    },
    RefusalRow {
        name: "a configuration of bytes",
        arguments: &["fit", "ct.nii.gz", "--roi", "mask.nii.gz", "-o", "x.ply", "--config", "ct.nii.gz"],
        exit: 2,
        says: &["VGS-CFG-013", "ct.nii.gz: no configuration: not text: byte 1 is not UTF-8"],
    },
    RefusalRow {
        name: "a camera without end",
        arguments: &["render", "away.ply", "-o", "x.png", "--camera", "zero.json"],
        exit: 2,
        says: &["zero.json: is a device, not a file"],
    },
    RefusalRow {
        name: "a missing configuration",
        arguments: &["fit", "ct.nii.gz", "--roi", "mask.nii.gz", "-o", "x.ply", "--config", "none.toml"],
        exit: 66,
        says: &["none.toml"],
    },
    RefusalRow {
        name: "a negative learning rate",
        arguments: &["fit", "ct.nii.gz", "--roi", "mask.nii.gz", "-o", "x.ply", "--rate-mean", "-1"],
        exit: 2,
        says: &["rate_mean"],
    },
    RefusalRow {
        name: "far too many iterations",
        arguments: &["fit", "ct.nii.gz", "--roi", "mask.nii.gz", "-o", "x.ply", "--iterations", "1e12"],
        exit: 2,
        says: &["iterations"],
    },
    RefusalRow {
        name: "far too many splats",
        arguments: &["fit", "ct.nii.gz", "--roi", "mask.nii.gz", "-o", "x.ply", "--splats", "1000000000"],
        exit: 2,
        says: &["VGS-FIT-040", "1000000000 splats for a region of", "choose at most"],
    },
    RefusalRow {
        name: "more splats than can be counted",
        arguments: &[
            "fit",
            "ct.nii.gz",
            "--roi",
            "mask.nii.gz",
            "-o",
            "x.ply",
            "--splats",
            "99999999999999999999",
        ],
        exit: 2,
        says: &["VGS-CFG-012", "splats"],
    },
    RefusalRow {
        name: "a density beyond all",
        arguments: &["fit", "ct.nii.gz", "--roi", "mask.nii.gz", "-o", "x.ply", "--density", "1e9"],
        exit: 2,
        says: &["VGS-CFG-001", "at most 100"],
    },
    RefusalRow {
        name: "a picture that no memory holds",
        arguments: &["render", "away.ply", "-o", "x.png", "--size", "99999x99999"],
        exit: 2,
        says: &["99999x99999"],
    },
    RefusalRow {
        name: "a profile that is not there",
        arguments: &["fit", "ct.nii.gz", "--roi", "mask.nii.gz", "-o", "x.ply", "--profile", "best"],
        exit: 2,
        says: &["\"best\"", "profiles: default"],
    },
    RefusalRow {
        name: "a quality that is not there",
        arguments: &["fit", "ct.nii.gz", "--roi", "mask.nii.gz", "-o", "x.ply", "--quality", "best"],
        exit: 2,
        says: &["\"best\"", "qualities: preview"],
    },
    RefusalRow {
        name: "a device that is not there",
        arguments: &["fit", "ct.nii.gz", "--roi", "mask.nii.gz", "-o", "x.ply", "--device", "no such device"],
        exit: 69,
        says: &["no Vulkan device", "no such device"],
    },
    RefusalRow {
        name: "a volume beyond the limit",
        arguments: &["fit", "ct.nii.gz", "--roi", "mask.nii.gz", "-o", "x.ply", "--max-bytes", "1000"],
        exit: 65,
        says: &["--max-bytes"],
    },
    RefusalRow {
        name: "splats without an intensity",
        arguments: &["eval", "colour.ply", "ct.nii.gz", "--roi", "mask.nii.gz"],
        exit: 65,
        says: &["colour.ply", "no intensity"],
    },
    RefusalRow {
        name: "the picture exists",
        arguments: &["eval", "away.ply", "ct.nii.gz", "--roi", "mask.nii.gz", "--picture", "half.csv"],
        exit: 73,
        says: &["half.csv: the output exists already"],
    },
    RefusalRow {
        name: "splats of another place",
        arguments: &["eval", "away.ply", "ct.nii.gz", "--roi", "mask.nii.gz"],
        exit: 65,
        says: &["away.ply", "no splat lies in the volume"],
    },
    RefusalRow {
        name: "no PLY at all",
        arguments: &["eval", "ct.nii.gz", "ct.nii.gz", "--roi", "mask.nii.gz"],
        exit: 65,
        says: &["not a splat file"],
    },
    RefusalRow {
        name: "a reversed range",
        arguments: &["eval", "away.ply", "ct.nii.gz", "--roi", "mask.nii.gz", "--range", "3071,-1024"],
        exit: 2,
        says: &["--range"],
    },
    RefusalRow {
        name: "a grid around the splats beyond the limit",
        arguments: &["rasterize", "away.ply", "--spacing", "0.001", "-o", "x.nii.gz", "--max-bytes", "1M"],
        exit: 2,
        says: &["--spacing"],
    },
    RefusalRow {
        name: "a volume with another ending",
        arguments: &["rasterize", "away.ply", "--spacing", "1", "-o", "x.mha"],
        exit: 2,
        says: &["x.mha", ".nii.gz"],
    },
    RefusalRow {
        name: "a file that is nothing known",
        arguments: &["info", "typo.toml"],
        exit: 65,
        says: &["typo.toml"],
    },
    RefusalRow { name: "no command", arguments: &[], exit: 2, says: &["Usage"] },
];

/// A NIfTI-1 file of uint8 voxels, 1 mm apart, whose first voxel lies at (x, x, x).
fn nifti(size: u16, x: f32, value: impl Fn(usize) -> u8) -> Vec<u8> {
    let mut file = vec![0; 352];
    let mut put = |at: usize, bytes: &[u8]| file[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, &348i32.to_le_bytes());
    for (i, n) in [3, size, size, size, 1, 1, 1, 1].into_iter().enumerate() {
        put(40 + 2 * i, &n.to_le_bytes());
    }
    put(70, &2i16.to_le_bytes());
    put(72, &8i16.to_le_bytes());
    for i in 0..4 {
        put(76 + 4 * i, &1f32.to_le_bytes());
    }
    put(108, &352f32.to_le_bytes());
    put(123, &[2]);
    put(254, &1i16.to_le_bytes());
    for row in 0..3 {
        put(280 + 16 * row + 4 * row, &1f32.to_le_bytes());
        put(280 + 16 * row + 12, &x.to_le_bytes());
    }
    put(344, b"n+1\0");
    file.extend((0..usize::from(size).pow(3)).map(value));
    file
}

fn ply(extra: &str, place: f32, tail: &str) -> String {
    format!(
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
         property float f_dc_0\nproperty float f_dc_1\nproperty float f_dc_2\nproperty float opacity\n\
         property float scale_0\nproperty float scale_1\nproperty float scale_2\nproperty float rot_0\n\
         property float rot_1\nproperty float rot_2\nproperty float rot_3\n{extra}end_header\n\
         {place} {place} {place} 0 0 0 1 0 0 0 1 0 0 0{tail}\n"
    )
}

#[test]
fn bad_inputs_are_refused_and_nothing_is_touched() {
    let folder = Folder::new(16);
    folder.write("empty.nii", "");
    folder.write("zero.nii", nifti(16, -7.5, |_| 0));
    folder.write("far.nii", nifti(16, 900.0, |_| 1));
    folder.write("labels.nii", nifti(16, -7.5, |i| if i % 2 == 0 { 0 } else { 5 }));
    // The same with a slope of 60.
    let mut atlas = nifti(16, -7.5, |i| if i % 2 == 0 { 0 } else { 5 });
    atlas[112..116].copy_from_slice(&60f32.to_le_bytes());
    folder.write("atlas.nii", atlas);
    folder.write("taken.ply", "precious");
    folder.write("half.csv", "precious");
    folder.write("typo.toml", "iteratons = 5\n");
    folder.write("type.toml", "rate_mean = \"fast\"\n");
    folder.write("broken.toml", "rate_mean = \n");
    folder.write("colour.ply", ply("", 0.0, ""));
    folder.write("away.ply", ply("property float hu\n", 5000.0, " 40"));
    std::os::unix::fs::symlink("ct.nii.gz", folder.path("link.nii.gz")).expect("a link");
    let before = folder.contents();
    std::os::unix::fs::symlink("/dev/zero", folder.path("zero.json")).expect("a link");
    let mut wrong = Vec::new();
    for row in ROWS {
        let ended = folder.run(row.arguments);
        let missing: Vec<_> = row.says.iter().filter(|text| !ended.err.contains(*text)).collect();
        if ended.code != row.exit || !missing.is_empty() || !ended.out.is_empty() {
            let text =
                format!("{}: exit {}, lacks {missing:?}\n{}{}", row.name, ended.code, ended.out, ended.err);
            wrong.push(text);
        }
        if ended.err.contains('\x1b') {
            wrong.push(format!("{}: escape sequences on a stderr that is no terminal", row.name));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    std::fs::remove_file(folder.path("zero.json")).expect("the link");
    assert_eq!(before, folder.contents(), "a refused command leaves every file as it was, and no other");
}

#[test]
fn errors_as_json_have_all_keys() {
    let folder = Folder::new(8);
    let rows: [(&[&str], i64, &str); 3] = [
        (&["fit", "none.nii", "--roi-threshold", "0,1", "-o", "x.ply", "--json"], 66, "VGS-VOL-001"),
        (&["--json", "fit", "none.nii", "--nonsense"], 2, "VGS-CLI-001"),
        (&["info", "mask.nii.gz", "none", "--json"], 66, "VGS-VOL-001"),
    ];
    for (arguments, exit, code) in rows {
        let ended = folder.run(arguments);
        let object: serde_json::Value = serde_json::from_str(&ended.err).expect("one object on stderr");
        for key in ["level", "code", "file", "msg", "help", "exit"] {
            assert!(object.get(key).is_some(), "{key} in {object}");
        }
        assert_eq!(
            (&object["level"], &object["code"], &object["exit"]),
            (&"error".into(), &code.into(), &exit.into())
        );
        assert_eq!(i64::from(ended.code), exit);
    }
}

#[test]
fn a_folder_that_may_not_be_written_is_found_out_first() {
    use std::os::unix::fs::PermissionsExt;
    let folder = Folder::new(8);
    let closed = folder.path("closed");
    std::fs::create_dir(&closed).expect("a folder");
    std::fs::set_permissions(&closed, std::fs::Permissions::from_mode(0o555)).expect("permissions");
    // Root may write anywhere but there.
    let root = std::fs::File::create(closed.join("probe")).is_ok();
    let output = if root { "/sys/x.ply" } else { "closed/x.ply" };
    let ended = folder.run(&["fit", "none.nii", "--roi-threshold", "0,1", "-o", output]);
    assert_eq!(ended.code, 73, "{}", ended.err);
    std::fs::set_permissions(&closed, std::fs::Permissions::from_mode(0o755)).expect("permissions");
}
