//! A folder of DICOM slices becomes splats that are coloured, cut and measured, with nothing but a mouse and keys.
//!
//! The film in docs/use is made by this test: `VGS_SHOTS` names a folder for its pictures, and `VGS_FILM` a volume to
//! take in place of the phantom.

use crate::support::Folder;
use crate::support::screen::{Screen, Shot, begin, without_notice};
use crate::support::series::write_series;
use engine::volume::{ReadOptions, Volume};

/// Where the picture is, well within its edges, with slices at its left and panels at its right.
const PICTURE: [usize; 4] = [250, 100, 880, 640];

/// Puts pictures of one size beside each other, two in a row, at half their size.
fn strip(shots: &[Shot]) -> Shot {
    let [width, height] = shots[0].size.map(|n| n / 2);
    let rows = shots.len().div_ceil(2);
    let mut whole =
        Shot { size: [2 * width, rows * height], pixels: vec![[0; 3]; 2 * width * rows * height] };
    for (i, shot) in shots.iter().enumerate() {
        for y in 0..height {
            for x in 0..width {
                let four = [0, 1, 2, 3].map(|k| shot.at(2 * x + k % 2, 2 * y + k / 2).map(u32::from));
                let mean = std::array::from_fn(|c| (four.iter().map(|p| p[c]).sum::<u32>() / 4) as u8);
                whole.pixels[(i / 2 * height + y) * 2 * width + i % 2 * width + x] = mean;
            }
        }
    }
    whole
}

#[test]
fn a_dicom_folder_becomes_a_scene() {
    let Some(screen) = Screen::new() else { return };
    let folder = Folder::new(40);
    without_notice(&folder);
    let other = std::env::var_os("VGS_FILM").map(std::path::PathBuf::from);
    let source = other.unwrap_or_else(|| folder.path("ct.nii.gz"));
    let volume = Volume::read(&source, &ReadOptions::default()).expect("a volume");
    write_series(&folder, "scan", &volume, |_, _| ());

    let mut viewer = begin(&screen, &folder, &["scan"]);
    let step = |viewer: &mut crate::support::screen::Viewer<'_>, hand: &[&str]| {
        screen.hand(hand);
        viewer.settle();
        // Panels unfold by the clock.
        viewer.settle();
        screen.look()
    };
    let click = |x: &'static str, y: &'static str| ["mousemove", x, y, "click", "1"];

    // The region by a threshold, seen in the slices; the cheapest quality; the fit.
    let opened = step(&mut viewer, &["key", "g"]);
    step(&mut viewer, &click("924", "215"));
    viewer.wait("the region", |v| v.log().contains("finding the region of scan:"));
    viewer.settle();
    step(&mut viewer, &click("1033", "298"));
    let region = screen.look();
    assert!(region.differences(&opened, PICTURE) > 1000, "the picture shows the region alone");
    screen.hand(&click("930", "345"));
    viewer.wait("the splats", |v| v.log().matches("decoding the fit:").count() > 1);
    viewer.settle();
    let fitted = screen.look();
    assert!(fitted.differences(&region, [900, 30, 1270, 700]) > 1000, "the panel tells of the fit");
    step(&mut viewer, &click("932", "143"));
    let path = folder.path("fit.ply").to_string_lossy().into_owned();
    step(&mut viewer, &["key", "ctrl+a"]);
    step(&mut viewer, &["type", "--delay", "20", &path]);
    let before = viewer.frames()[1];
    screen.hand(&["key", "Return"]);
    viewer.wait("the file", |v| {
        v.log().contains("computing the histogram of the splats:") && v.frames()[1] > before
    });
    viewer.settle();

    // The list of presets, with the scene by each of them.
    let closed = screen.look();
    let list = step(&mut viewer, &click("973", "625"));
    let thumbnails = |[r, g, b]: [u8; 3]| r > g.saturating_add(20) && g > b.saturating_add(10);
    let pictures = [915, 45, 985, 612];
    let (before, with) = (closed.count(pictures, thumbnails), list.count(pictures, thumbnails));
    list.keep("film-presets");
    assert!(with > before + 100, "bones in the list: {with} pixels, and {before} without it");
    step(&mut viewer, &["key", "Escape"]);

    // Another look, a cut, a distance.
    let coloured = viewer.act(&["mousemove", "560", "700", "key", "Next"]);
    assert!(coloured.differences(&fitted, PICTURE) > 1000, "another transfer function");
    let cut = viewer.act(&["key", "c"]);
    assert!(cut.differences(&coloured, PICTURE) > 1000, "a part is cut away");
    for hand in [
        &["key", "d"][..],
        &["mousemove", "540", "330"],
        &["click", "1"],
        &["mousemove", "600", "400"],
        &["click", "1"],
    ] {
        screen.hand(hand);
        viewer.settle();
    }
    let measured = screen.look();
    assert!(measured.differences(&cut, PICTURE) > 20, "a line with its length");

    // All of it goes into a session, which the headset opens, too.
    step(&mut viewer, &["key", "Escape"]);
    viewer.write(&folder, "ctrl+s", "scene.toml");
    assert_eq!(viewer.quit().code, 0);
    let mut session: toml::Table = folder.text("scene.toml").parse().expect("a session");
    let count = |name: &str| session[name].as_array().map_or(0, Vec::len);
    assert_eq!(count("distances"), 1, "{session}");
    assert_eq!(session["clip"]["planes"].as_array().map_or(0, Vec::len), 1, "{session}");
    let told = folder.run(&["info", "fit.ply", "--json"]).json();
    assert!(told["splats"].as_u64().is_some_and(|n| n > 50), "{told}");

    let film = [opened, region, fitted, coloured, cut, measured];
    strip(&film).keep("film");
    if let Some(shots) = std::env::var_os("VGS_SHOTS").map(std::path::PathBuf::from) {
        std::fs::copy(folder.path("fit.ply"), shots.join("fit.ply")).expect("a copy");
        // The session is kept beside its splats, without the slices, which are not.
        let mut files = toml::Table::new();
        files.insert("splats".into(), vec!["fit.ply"].into());
        session.insert("files".into(), files.into());
        std::fs::write(shots.join("scene.toml"), session.to_string()).expect("a session");
    }
}
