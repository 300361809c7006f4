//! `vgs view` as a person uses it: a real window on a virtual screen, a mouse and keys.

mod support;

#[path = "support/screen.rs"]
mod screen;

use screen::{Screen, Viewer};
use support::{Folder, fit};

/// Where the picture is, well within its edges: the panels are at the right.
const PICTURE: [usize; 4] = [100, 100, 800, 600];

/// A turn, as slowly as a hand: what happens between two frames is one event for panels.
const DRAG: [&str; 14] = [
    "mousedown",
    "1",
    "sleep",
    "0.2",
    "mousemove",
    "500",
    "350",
    "sleep",
    "0.2",
    "mousemove",
    "600",
    "380",
    "mouseup",
    "1",
];

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
    let turned = viewer.act(&DRAG);
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

#[test]
fn without_a_display_it_names_another_way() {
    let folder = folder();
    let ended = support::finish(
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
    ] {
        let ended = folder.run(&arguments);
        assert_eq!(ended.code, code, "{arguments:?}: {}", ended.err);
        assert!(ended.err.contains(what), "{arguments:?}: {}", ended.err);
    }
}
