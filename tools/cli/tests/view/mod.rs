//! `vgs view` as a person uses it: a real window on a virtual screen, a mouse and keys.

mod beside;
mod drags;

use crate::support::screen::{Screen, Viewer, begin, without_notice};
use crate::support::series::write_two_series;
use crate::support::{Folder, fit};
use engine::volume::{ReadOptions, Volume};

/// Where the picture is, well within its edges: the panels are at the right.
const PICTURE: [usize; 4] = [100, 100, 800, 600];

fn folder() -> Folder {
    let folder = Folder::new(40);
    let ended =
        folder.run(&fit("s.ply", &["--no-eval", "--iterations", "24", "--splats", "800", "--offsets", "4"]));
    assert_eq!(ended.code, 0, "{}", ended.err);
    folder
}

fn bright(pixel: [u8; 3]) -> bool {
    pixel.iter().any(|&v| v > 40)
}

#[test]
fn a_session_with_mouse_and_keys() {
    let Some(screen) = Screen::new() else { return };
    let folder = folder();
    let arguments = [
        "s.ply",
        "--volume",
        "ct.nii.gz",
        "--roi",
        "mask.nii.gz",
        "--tf",
        "CT-Soft-Tissue",
        "--report",
        "r.json",
    ];
    let mut viewer = Viewer::start(&screen, &folder, &arguments);
    viewer.wait("the first picture", |v| v.frames()[1] > 0);
    viewer.settle();
    screen.look().keep("notice");
    // There is no window manager to give it the keys.
    screen.hand(&["search", "--name", "vgs", "windowfocus"]);
    // The notice, once and for all.
    screen.hand(&["mousemove", "492", "447", "click", "1"]);
    viewer.settle();
    assert!(folder.text("config/vgs/view.toml").contains("notice_seen = true"));
    screen.hand(&["mousemove", "450", "350"]);
    viewer.settle();
    let first = screen.look();
    first.keep("first");
    let seen = first.count(PICTURE, bright);
    assert!(seen > 10_000, "{seen} pixels of the phantom");

    // Turned by the mouse, and by a key to where it stood before.
    let turned = viewer.drag("1", ["450", "350"], ["600", "380"]);
    assert!(viewer.log().contains("picture rendered fast"), "coarser while it moves");
    turned.keep("turned");
    assert!(turned.differences(&first, PICTURE) > 500, "turned");

    // The volume instead of the splats: like them, and not the same.
    let volume = viewer.act(&["key", "space"]);
    volume.keep("volume");
    let differing = volume.differences(&turned, PICTURE);
    assert!(differing > 20 && differing < seen, "{differing} of {seen} pixels differ");
    let both = viewer.act(&["key", "b"]);
    both.keep("split");

    // Nothing happens, so nothing is done.
    let (frames, cpu) = (viewer.frames()[0], viewer.cpu_seconds());
    std::thread::sleep(std::time::Duration::from_secs(3));
    let idle = viewer.cpu_seconds() - cpu;
    assert_eq!(viewer.frames()[0], frames, "frames while nothing happens");
    assert!(idle < 0.15, "{idle} s of CPU time in 3 s of rest");

    let ended = viewer.quit();
    assert_eq!(ended.code, 0, "{}", ended.err);
    let report: serde_json::Value = serde_json::from_str(&folder.text("r.json")).expect("JSON");
    assert!(report["first_picture_ms"].as_f64() > Some(0.0), "{report}");
    assert!(report["frames"].as_u64() >= report["pictures"].as_u64(), "{report}");
}

/// What a session file says.
fn toml(folder: &Folder, name: &str) -> toml::Table {
    folder.text(name).parse().expect("a session")
}

#[test]
fn what_is_edited_measured_and_written_is_there_again() {
    let Some(screen) = Screen::of_size("1280x720") else { return };
    let folder = folder();
    without_notice(&folder);
    let arguments = ["s.ply", "--tf", "CT-Soft-Tissue", "--report", "r.json"];
    let mut viewer = begin(&screen, &folder, &arguments);
    let first = screen.look();
    first.keep("edit-first");
    let seen = first.count(PICTURE, bright);

    // Window and level by the right button; undone and done again by keys.
    let wider = viewer.drag("3", ["450", "380"], ["560", "380"]);
    wider.keep("edit-window");
    assert!(wider.differences(&first, PICTURE) > 1000, "a wider window");
    screen.hand(&["mousemove", "450", "380"]);
    let undone = viewer.act(&["key", "ctrl+z"]);
    assert!(undone.differences(&first, PICTURE) < 50, "undone");
    let redone = viewer.act(&["key", "ctrl+y"]);
    assert!(redone.differences(&wider, PICTURE) < 50, "done again");
    viewer.act(&["key", "ctrl+z"]);

    // A plane halves the body.
    let cut = viewer.act(&["key", "c"]);
    cut.keep("edit-clip");
    let left = cut.count(PICTURE, bright);
    assert!(left < seen * 9 / 10, "{left} of {seen} pixels are left");
    viewer.act(&["key", "c"]);

    // A distance between two points of the surface, then everything into a session, and a picture.
    for step in [
        &["key", "d"][..],
        &["mousemove", "420", "380"],
        &["click", "1"],
        &["mousemove", "480", "380"],
        &["click", "1"],
    ] {
        screen.hand(step);
        viewer.settle();
    }
    screen.look().keep("edit-distance");
    // However many of these come between two frames, they count in their order.
    screen.hand(&["key", "Escape", "key", "a", "key", "Right"]);
    viewer.settle();
    let told = screen.look();
    for (key, name) in [("ctrl+s", "kept.toml"), ("ctrl+p", "shot.png")] {
        viewer.write(&folder, key, name);
    }
    screen.hand(&["mousemove", "450", "700"]);
    viewer.settle();
    let last = screen.look();
    last.keep("edit-last");
    assert_eq!(viewer.quit().code, 0);

    let session = toml(&folder, "kept.toml");
    let distances = session["distances"].as_array().expect("distances");
    let place = |name: &str| -> Vec<f64> {
        distances[0][name].as_array().expect("a point").iter().map(|v| v.as_float().expect("mm")).collect()
    };
    let (from, to) = (place("from_mm"), place("to_mm"));
    let mm = from.iter().zip(&to).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    // The phantom has an edge of 40 mm and fills most of 760 pixels.
    assert!(distances.len() == 1 && mm > 1.0 && mm < 20.0, "{mm} mm");
    let picture = engine::image::read(folder.path("shot.png")).expect("a picture").image;
    assert!(picture.size[0] > 800 && picture.size[1] > 600, "{:?}", picture.size);
    assert!(picture.pixels.iter().filter(|p| p[3] > 0.1 && p[0] > 0.1).count() > 10_000);
    // It tells what the screen does: the bars to the left, the cube to the right, both at the lower edge. The menus are
    // above it.
    let [width, height] = picture.size;
    let differing = |menus: usize| {
        let corners =
            (height - 220..height).flat_map(|y| (0..140).chain(width - 110..width).map(move |x| [x, y]));
        let differ = |[x, y]: &[usize; 2]| {
            let (shown, written) = (told.at(*x, *y + menus), picture.at(*x, *y));
            (0..3).any(|i| (f32::from(shown[i]) - 255.0 * written[i]).abs() > 40.0)
        };
        corners.filter(differ).count()
    };
    let least = (0..=told.size[1] - height).map(differing).min().expect("a place");
    let blank = (height - 220..height).flat_map(|y| (0..140).map(move |x| [x, y]));
    let letters = blank.filter(|[x, y]| picture.at(*x, *y)[0] > 0.9).count();
    assert!(letters > 100 && least < 300, "{letters} bright pixels; {least} differ from the screen");
    let report: serde_json::Value = serde_json::from_str(&folder.text("r.json")).expect("JSON");
    let edits = report["edits_ms"].as_array().expect("edits");
    assert!(!edits.is_empty() && edits.iter().all(|ms| ms.as_f64() > Some(0.0)), "{report}");

    // The session brings all of it back.
    let mut again = Viewer::start(&screen, &folder, &["kept.toml"]);
    again.wait("the first picture", |v| v.frames()[1] > 0);
    again.settle();
    screen.hand(&["search", "--name", "vgs", "windowfocus", "mousemove", "450", "700"]);
    again.settle();
    let back = screen.look();
    back.keep("edit-back");
    // Beside the messages of what was written, which fade by the clock.
    let differing = back.differences(&last, [300, PICTURE[1], PICTURE[2], PICTURE[3]]);
    assert!(differing < 50, "{differing} pixels differ");
    assert_eq!(again.quit().code, 0);
}

#[test]
fn what_is_deleted_is_gone_and_comes_back() {
    let Some(screen) = Screen::new() else { return };
    let folder = folder();
    without_notice(&folder);
    let mut viewer = begin(&screen, &folder, &["s.ply", "--tf", "CT-Soft-Tissue"]);
    let first = viewer.act(&["key", "l"]);
    first.keep("delete-first");
    let seen = first.count(PICTURE, bright);

    // The box is around everything, so nothing is left.
    viewer.act(&["key", "x"]);
    screen.hand(&["key", "Delete"]);
    viewer.wait("the rest", |v| v.log().contains("deleting splats:"));
    viewer.settle();
    let gone = screen.look();
    gone.keep("delete-all");
    assert!(gone.count(PICTURE, bright) < seen / 4, "{} pixels are left", gone.count(PICTURE, bright));
    // It is not lost unasked.
    screen.hand(&["key", "ctrl+q"]);
    viewer.settle();
    screen.look().keep("delete-asked");
    screen.hand(&["key", "Escape"]);
    viewer.settle();
    viewer.act(&["key", "ctrl+z"]);
    let undone = viewer.act(&["key", "ctrl+z"]);
    undone.keep("delete-undone");
    assert!(undone.differences(&first, PICTURE) < 50, "{} differ", undone.differences(&first, PICTURE));
    viewer.write(&folder, "ctrl+s", "whole.toml");
    assert_eq!(viewer.quit().code, 0, "nothing has changed since");

    // A session brings a deletion back; what is left is what `vgs convert` would leave.
    let told = folder.run(&["info", "s.ply", "--json"]).json();
    let corner = |at: usize| -> Vec<f64> {
        let values = told["bounding_box_mm"][at].as_array().expect("a corner");
        values.iter().map(|v| v.as_f64().expect("mm")).collect()
    };
    let (low, mut high) = (corner(0), corner(1));
    high[0] = 0.5 * (low[0] + high[0]);
    let deletion =
        format!("[[deleted]]\n[deleted.outside]\nlow_mm = {low:?}\nhigh_mm = {high:?}\nfiles = 1\n");
    std::fs::write(folder.path("half.toml"), folder.text("whole.toml") + "\n" + &deletion)
        .expect("a session");
    let mut viewer = begin(&screen, &folder, &["half.toml"]);
    let half = viewer.act(&["key", "a"]);
    half.keep("delete-half");
    let left = half.count(PICTURE, bright);
    assert!((seen / 5..seen * 4 / 5).contains(&left), "{left} of {seen} pixels are left");
    viewer.write(&folder, "ctrl+e", "half.ply");
    viewer.write(&folder, "ctrl+shift+e", "half.html");
    assert_eq!(viewer.quit().code, 0, "the session has not changed");
    let corners = low.iter().chain(&high).map(f64::to_string).collect::<Vec<_>>().join(",");
    let converted = folder.run(&["convert", "s.ply", "-o", "same.ply", &format!("--box={corners}")]);
    assert_eq!(converted.code, 0, "{}", converted.err);
    let count =
        |name: &str| folder.run(&["info", name, "--json"]).json()["splats"].as_u64().expect("a number");
    assert_eq!(count("half.ply"), count("same.ply"));
    assert!((1..count("s.ply")).contains(&count("half.ply")));
    // The page is that of the session, however it is made.
    assert_eq!(folder.run(&["convert", "half.toml", "-o", "same.html"]).code, 0);
    let page = |name: &str| page::Page::read(&folder.path(name)).expect("a page").0;
    let (shared, same) = (page("half.html"), page("same.html"));
    assert!(shared.data == same.data && shared.scene.parts == same.scene.parts);
    assert!(shared.scene.camera != same.scene.camera, "it was turned since");
}

#[test]
fn a_session_is_packed_sent_and_opened_from_its_zip() {
    let Some(screen) = Screen::new() else { return };
    let folder = folder();
    without_notice(&folder);
    let mut viewer = begin(&screen, &folder, &["s.ply", "--volume", "ct.nii.gz", "--tf", "CT-Soft-Tissue"]);
    let first = viewer.act(&["key", "l"]);
    viewer.write(&folder, "ctrl+shift+s", "case.zip");
    screen.look().keep("pack");
    viewer.write(&folder, "ctrl+s", "case.toml");
    assert_eq!(viewer.quit().code, 0);
    assert!(folder.text("case.toml").contains("\"s.ply\""), "relative: {}", folder.text("case.toml"));
    // Nothing is left of what it was made of.
    for name in ["s.ply", "ct.nii.gz"] {
        std::fs::rename(folder.path(name), folder.path(&format!("config/{name}"))).expect("moved");
    }
    let mut viewer = begin(&screen, &folder, &["case.zip"]);
    screen.hand(&["mousemove", "450", "700"]);
    viewer.settle();
    let opened = screen.look();
    opened.keep("packed");
    let differing = opened.differences(&first, [100, 100, 800, 600]);
    assert!(differing < 400, "{differing} pixels differ");
    assert_eq!(viewer.quit().code, 0, "nothing has changed");
    // A session whose files are gone asks for them.
    let mut viewer = Viewer::start(&screen, &folder, &["case.toml"]);
    viewer.wait("a frame", |v| v.frames()[0] > 0);
    viewer.settle();
    screen.hand(&["search", "--name", "vgs", "windowfocus"]);
    let asked = screen.look();
    asked.keep("missing");
    assert!(asked.count([400, 250, 880, 550], bright) > 1000, "a question");
    assert!(asked.differences(&first, [100, 100, 800, 600]) > 10_000);
    screen.hand(&["key", "Escape"]);
    viewer.settle();
    assert_eq!(viewer.quit().code, 0);
}

#[test]
fn a_window_fits_a_small_screen() {
    let Some(screen) = Screen::of_size("1000x600") else { return };
    let folder = folder();
    without_notice(&folder);
    let viewer = begin(&screen, &folder, &["s.ply", "--tf", "CT-Soft-Tissue"]);
    let shot = screen.look();
    shot.keep("small-screen");
    // The line below begins with letters; the picture has none there.
    let letters = shot.count([40, 582, 150, 600], |pixel| pixel.iter().all(|&v| v > 100));
    assert!(letters > 50, "{letters} bright pixels in the line below");
    assert_eq!(viewer.quit().code, 0);
}

#[test]
fn a_window_of_other_sizes_and_scales() {
    let Some(screen) = Screen::new() else { return };
    let folder = folder();
    without_notice(&folder);
    let start = |environment: &[(&str, &str)]| {
        let mut viewer =
            Viewer::start_with(&screen, &folder, &["s.ply", "--tf", "CT-Soft-Tissue"], environment);
        viewer.wait("the first picture", |v| v.frames()[1] > 0);
        viewer.settle();
        screen.hand(&["search", "--name", "vgs", "windowfocus", "mousemove", "200", "200"]);
        viewer.settle();
        viewer
    };
    let mut viewer = start(&[]);
    let first = viewer.act(&["key", "l"]);
    // Every size that the mouse passes through while it pulls an edge, the smallest allowed one among them.
    for step in 0..12 {
        let [width, height] = [1280 - 80 * step, 800 - 45 * step].map(|n: u32| n.to_string());
        screen.hand(&["search", "--name", "vgs", "windowsize", &width, &height]);
    }
    viewer.settle();
    let small = screen.look();
    small.keep("small");
    assert!(small.differences(&first, PICTURE) > 1000, "smaller");
    assert!(
        small.count([0, 25, 400, 280], bright) > 5000,
        "panels leave room for a picture in a narrow window"
    );
    // Out of sight and back: nothing is drawn in between, and nothing is lost.
    screen.hand(&["search", "--name", "vgs", "windowunmap", "--sync"]);
    viewer.settle();
    screen.hand(&["search", "--name", "vgs", "windowmap", "--sync"]);
    screen.hand(&["search", "--name", "vgs", "windowsize", "1280", "800"]);
    viewer.settle();
    screen.hand(&["search", "--name", "vgs", "windowfocus"]);
    viewer.act(&["key", "a"]);
    let back = viewer.act(&["key", "l"]);
    back.keep("back");
    // The mouse's arrow may lie elsewhere.
    assert!(back.differences(&first, PICTURE) < 400, "{} pixels differ", back.differences(&first, PICTURE));
    assert_eq!(viewer.quit().code, 0);

    // A screen of twice the scale: letters twice as large, a picture as fine as its pixels, and the mouse acts where it is.
    let mut viewer = start(&[("WINIT_X11_SCALE_FACTOR", "2")]);
    let fine = screen.look();
    fine.keep("scale-2");
    assert!(fine.differences(&first, [0, 0, 1280, 720]) > 10_000, "another scale");
    let turned = viewer.drag("1", ["200", "400"], ["300", "400"]);
    assert!(turned.differences(&fine, [100, 150, 700, 700]) > 500, "turned");
    assert_eq!(viewer.quit().code, 0);
}

#[test]
fn a_lost_device_is_made_again() {
    let Some(screen) = Screen::new() else { return };
    let folder = folder();
    without_notice(&folder);
    let arguments = ["s.ply", "--tf", "CT-Soft-Tissue"];
    let shot = |fault: &[(&str, &str)]| {
        let mut viewer = Viewer::start_with(&screen, &folder, &arguments, fault);
        viewer.wait("the first picture", |v| v.frames()[1] > 0);
        viewer.settle();
        screen.hand(&["search", "--name", "vgs", "windowfocus", "mousemove", "450", "700"]);
        viewer.settle();
        let seen = viewer.act(&["key", "l"]);
        let log = viewer.log();
        assert_eq!(viewer.quit().code, 0);
        (seen, log)
    };
    let (whole, log) = shot(&[]);
    assert!(!log.contains("starting over"));
    // In the middle of the upload, and while the field is decoded beside the window.
    for at in [3, 30] {
        let (again, log) = shot(&[("VGS_FAULT", &format!("submit:{at}:lost"))]);
        again.keep(&format!("lost-{at}"));
        assert!(log.contains("the device was lost; starting over"), "{at}: {log}");
        let differing = again.differences(&whole, [0, 0, 1280, 720]);
        assert!(differing < 500, "{at}: {differing} pixels differ");
    }
}

/// A swapchain that no longer fits is made again, a lost device or surface once; what else fails ends the program
/// with its exit code. The validation layer, which writes to stdout, is silent.
#[test]
fn what_fails_in_a_window_is_made_up_for_or_told() {
    let Some(screen) = Screen::new() else { return };
    let folder = folder();
    without_notice(&folder);
    let start = |fault: &str| {
        let environment = [("VK_INSTANCE_LAYERS", "VK_LAYER_KHRONOS_validation"), ("VGS_FAULT", fault)];
        Viewer::start_with(&screen, &folder, &["s.ply", "--tf", "CT-Soft-Tissue"], &environment)
    };
    for (fault, begins_anew) in [
        ("acquire:2:out-of-date", false),
        ("present:1:out-of-date", false),
        ("acquire:2:lost", true),
        ("present:1:lost", true),
        ("wait:9:lost", true),
        ("acquire:1:surface-lost", true),
        ("swapchain:1:surface-lost", true),
    ] {
        let mut viewer = start(fault);
        viewer.wait(&format!("{fault}: a picture"), |v| v.frames()[1] > 0);
        viewer.settle();
        assert!(screen.look().count(PICTURE, bright) > 5000, "{fault}: something is seen");
        screen.hand(&["search", "--name", "vgs", "windowfocus"]);
        let ended = viewer.quit();
        assert_eq!(ended.code, 0, "{fault}: {}", ended.err);
        assert_eq!(ended.err.contains("starting over"), begins_anew, "{fault}: {}", ended.err);
        assert_eq!(ended.out, "", "{fault}");
    }
    for (fault, code, says) in [
        ("swapchain:1:device-memory", 75, "VGS-GPU-010"),
        ("present:1:device-memory", 75, "VGS-GPU-010"),
        ("memory:1:device-memory", 75, "VGS-GPU-024"),
        ("object:1:host-memory", 71, "VGS-GPU-011"),
    ] {
        let ended = start(fault).end();
        assert_eq!(ended.code, code, "{fault}: {}", ended.err);
        assert!(ended.err.contains(says), "{fault}: {}", ended.err);
        assert_eq!(ended.out, "", "{fault}");
    }
}

#[test]
fn without_a_display_it_names_another_way() {
    let folder = folder();
    let ended = crate::support::finish(
        folder
            .command(&["view", "s.ply"])
            .env_remove("DISPLAY")
            .env_remove("WAYLAND_DISPLAY")
            .env_remove("WAYLAND_SOCKET")
            .spawn()
            .expect("the viewer starts"),
    );
    assert_eq!(ended.code, 69, "{}", ended.err);
    assert!(ended.err.contains("VGS-VIEW-030") && ended.err.contains("vgs render"), "{}", ended.err);
}

#[test]
fn what_cannot_be_shown_is_refused_before_a_window_opens() {
    let folder = folder();
    for (arguments, code, what) in [
        (vec!["view", "none.ply"], 66, "none.ply"),
        (vec!["view", "s.docx"], 2, "VGS-VIEW-020"),
        (vec!["view", "s.ply", "--tf", "CT-Nothing"], 2, "CT-Nothing"),
        (vec!["view", "s.ply", "--roi", "mask.nii.gz"], 2, "--volume"),
        (vec!["view", "s.ply", "--beside", "none.vgs"], 66, "none.vgs"),
        (vec!["view", "s.ply", "--beside", "ct.nii.gz"], 2, "VGS-VIEW-021"),
        (vec!["view", "ct.nii.gz", "--beside", "s.ply"], 3, "VGS-VIEW-022"),
    ] {
        let ended = folder.run(&arguments);
        assert_eq!(ended.code, code, "{arguments:?}: {}", ended.err);
        assert!(ended.err.contains(what), "{arguments:?}: {}", ended.err);
    }
}

#[test]
fn slices_stand_beside_the_picture_and_follow_a_click_in_it() {
    let Some(screen) = Screen::new() else { return };
    let folder = folder();
    without_notice(&folder);
    let arguments = ["s.ply", "--volume", "ct.nii.gz", "--tf", "CT-Soft-Tissue"];
    let mut viewer = begin(&screen, &folder, &arguments);
    let without = screen.look();
    let with = viewer.act(&["key", "v"]);
    with.keep("slices");
    // Where the slices are now, with grey of the volume.
    let left = [10, 60, 230, 640];
    assert!(with.differences(&without, left) > 5000, "slices are shown");
    let grey = |[r, g, b]: [u8; 3]| r == g && g == b && (60..240).contains(&r);
    assert!(with.count(left, grey) > 3000, "grey of the volume: {}", with.count(left, grey));
    // A click on the scene moves the lines in the slices, and so does one in a slice. No picture is rendered anew.
    let mut click = |x: &str, y: &str| {
        screen.hand(&["mousemove", x, y]);
        viewer.settle();
        screen.hand(&["click", "1"]);
        viewer.settle();
        screen.look()
    };
    let clicked = click("560", "330");
    clicked.keep("slices-clicked");
    assert!(clicked.differences(&with, left) > 200, "lines and slices have moved");
    let again = click("90", "110");
    assert!(again.differences(&clicked, left) > 200, "by a click in a slice");
    let closed = viewer.act(&["key", "v"]);
    assert!(closed.differences(&with, left) > 5000, "closed again");
    assert_eq!(viewer.quit().code, 0);
}

/// A region by a threshold, a fit, a file: without a command line.
#[test]
fn splats_are_fitted_in_the_window_and_kept() {
    let Some(screen) = Screen::new() else { return };
    let folder = folder();
    without_notice(&folder);
    let mut viewer = begin(&screen, &folder, &["ct.nii.gz", "--tf", "CT-Soft-Tissue"]);
    let closed = screen.look();
    let press = |viewer: &mut Viewer<'_>, hand: &[&str]| {
        screen.hand(hand);
        viewer.settle();
        // The panel unfolds by the clock.
        viewer.settle();
        screen.look()
    };
    let click = |x: &'static str, y: &'static str| ["mousemove", x, y, "click", "1"];
    let opened = press(&mut viewer, &["key", "g"]);
    opened.keep("fit-open");
    let slices = [10, 60, 230, 640];
    let shaded = |[r, _, b]: [u8; 3]| b > r.saturating_add(25);
    assert_eq!(closed.count(slices, shaded), 0);
    assert!(opened.count(slices, shaded) > 300, "bones are shaded: {}", opened.count(slices, shaded));

    // Find, then the cheapest quality, then the button that has come below its estimate.
    press(&mut viewer, &click("924", "215"));
    viewer.wait("the region", |v| v.log().contains("finding the region of ct.nii.gz:"));
    viewer.settle();
    let found = press(&mut viewer, &click("1033", "298"));
    found.keep("fit-found");
    let picture = [250, 100, 880, 640];
    assert!(found.differences(&opened, picture) > 1000, "the picture shows the region alone");
    screen.hand(&click("930", "345"));
    viewer.wait("the splats", |v| v.log().matches("decoding the fit:").count() > 1);
    viewer.settle();
    let fitted = screen.look();
    fitted.keep("fit-ended");
    assert!(fitted.differences(&found, [900, 30, 1270, 700]) > 1000, "the panel tells of the fit");
    let differing = fitted.differences(&found, picture);
    assert!((20..100_000).contains(&differing), "splats like the volume, and not the same: {differing}");

    // Nothing happens while nobody decides.
    let frames = viewer.frames()[0];
    std::thread::sleep(std::time::Duration::from_secs(2));
    assert_eq!(viewer.frames()[0], frames, "frames while nothing happens");

    // The window is not closed unasked.
    press(&mut viewer, &["key", "ctrl+q"]).keep("fit-asked");
    press(&mut viewer, &["key", "Escape"]);

    // Keep: the question has the name of the volume in its folder, and the focus.
    press(&mut viewer, &click("932", "143"));
    screen.look().keep("fit-keep");
    let before = viewer.frames()[1];
    screen.hand(&["key", "Return"]);
    viewer.wait("the file", |v| {
        v.log().contains("computing the histogram of the splats:") && v.frames()[1] > before
    });
    viewer.settle();
    screen.look().keep("fit-kept");
    assert_eq!(viewer.quit().code, 0, "the splats are in a file");
    let took = toml(&folder, "config/vgs/view.toml")["fit_seconds"]["default preview"].as_float();
    assert!(took.is_some_and(|seconds| seconds > 0.0), "the time of the next one can be told");
    let told = folder.run(&["info", "ct.ply", "--json"]).json();
    assert!(told["splats"].as_u64().is_some_and(|n| (50..1000).contains(&n)), "{told}");
}

#[test]
fn a_mask_without_a_telling_name_is_known_by_its_values() {
    let Some(screen) = Screen::new() else { return };
    let folder = folder();
    without_notice(&folder);
    std::fs::copy(folder.path("mask.nii.gz"), folder.path("bones.nii.gz")).expect("a copy");
    let mut viewer = begin(&screen, &folder, &["bones.nii.gz", "ct.nii.gz", "--tf", "CT-Soft-Tissue"]);
    let taken = "bones.nii.gz is used as the region of ct.nii.gz, because it has mask values";
    assert!(viewer.log().contains(taken), "{}", viewer.log());
    let region = screen.look();
    // The session has it.
    screen.hand(&["key", "ctrl+s"]);
    viewer.settle();
    screen.hand(&["key", "Return"]);
    viewer.settle();
    assert_eq!(viewer.quit().code, 0);
    let files = &toml(&folder, "ct.toml")["files"];
    assert!(files["volume"].as_str().is_some_and(|path| path.ends_with("ct.nii.gz")), "{files}");
    assert!(files["roi"].as_str().is_some_and(|path| path.ends_with("bones.nii.gz")), "{files}");
    let viewer = begin(&screen, &folder, &["ct.nii.gz", "--tf", "CT-Soft-Tissue"]);
    let differing = screen.look().differences(&region, PICTURE);
    assert!(differing > 10_000, "without it all of the volume is seen: {differing} pixels differ");
    assert_eq!(viewer.quit().code, 0);
}

/// A folder of several series is asked about, at the start and later.
#[test]
fn a_series_of_a_folder_is_chosen_in_the_window() {
    let Some(screen) = Screen::new() else { return };
    let folder = Folder::new(24);
    without_notice(&folder);
    let volume = Volume::read(folder.path("ct.nii.gz"), &ReadOptions::default()).expect("a volume");
    write_two_series(&folder, "scan", &volume);
    let mut viewer = Viewer::start(&screen, &folder, &["scan"]);
    viewer.wait("the question", |v| v.log().contains("reading scan:"));
    viewer.settle();
    // There is no window manager to give it the keys.
    screen.hand(&["search", "--name", "vgs", "windowfocus"]);
    viewer.settle();
    screen.look().keep("series");
    let choose = |viewer: &mut Viewer<'_>, row: &'static str, count: usize| {
        screen.hand(&["mousemove", "560", row, "click", "1"]);
        viewer.wait("the series", |v| v.log().matches("computing the histogram of scan:").count() >= count);
        viewer.settle();
        screen.look()
    };
    let opened = choose(&mut viewer, "452", 1);
    assert!(opened.count(PICTURE, bright) > 1000, "the volume is shown");
    screen.hand(&["key", "ctrl+d"]);
    viewer.wait("the list", |v| v.log().contains("listing the series:"));
    viewer.settle();
    choose(&mut viewer, "369", 2);
    viewer.write(&folder, "ctrl+s", "scene.toml");
    assert_eq!(viewer.quit().code, 0);
    assert_eq!(toml(&folder, "scene.toml")["files"]["series"].as_str(), Some("1.2.3"), "by its UID");
}

#[test]
fn objects_look_as_flags_say() {
    let Some(screen) = Screen::new() else { return };
    let folder = folder();
    without_notice(&folder);
    let green = |[r, g, b]: [u8; 3]| g > 60 && r < g / 2 && b < g / 2;
    let seen = |flags: &[&str]| {
        let viewer = begin(&screen, &folder, &[&["s.ply"], flags].concat());
        let shot = screen.look();
        let log = viewer.log();
        assert_eq!(viewer.quit().code, 0);
        ([shot.count(PICTURE, green), shot.count(PICTURE, bright)], log)
    };
    let ([tinted, _], _) = seen(&["--object", "s:colour=#00ff00"]);
    assert!(tinted > 10_000, "{tinted} green pixels");
    let ([none, bones], log) = seen(&["--object", "liver:hidden"]);
    assert!(none == 0 && bones > 10_000, "nothing is called so: {none} {bones}");
    assert!(log.contains("VGS-"), "which is told: {log}");
    // Several objects have the colours that are usual for their names, a vein's is blue. Where
    // both have the same weight, a point belongs to the first one.
    std::fs::copy(folder.path("s.ply"), folder.path("vein.ply")).expect("a vein");
    let viewer = begin(&screen, &folder, &["vein.ply", "s.ply", "--object", "s:hidden"]);
    let shot = screen.look();
    shot.keep("objects-vein");
    let blue = shot.count(PICTURE, |[r, g, b]| b > 60 && r < b / 4 && g < b);
    assert_eq!(viewer.quit().code, 0);
    assert!(blue > 10_000, "{blue} blue pixels");
}
