//! What a drag costs the window.

use super::folder;
use crate::support::screen::{Screen, begin, without_notice};

/// Once a drag has begun, its frames allocate nothing, wait for nothing and make no pipeline, whatever is dragged.
#[test]
fn frames_of_a_drag_wait_for_nothing() {
    let Some(screen) = Screen::of_size("1280x720") else { return };
    let folder = folder();
    without_notice(&folder);
    let mut viewer = begin(&screen, &folder, &["s.ply", "--tf", "CT-Soft-Tissue", "--report", "r.json"]);
    // The camera, window and level, and a plane that is moved with the camera.
    viewer.act(&["key", "c"]);
    let buttons = ["1", "3", "2"];
    for button in buttons {
        screen.hand(&["mousemove", "430", "350"]);
        viewer.settle();
        screen.hand(&["mousedown", button]);
        let places = (0..80).map(|step| [(430 + 2 * step).to_string(), (350 + step % 7).to_string()]);
        let moves: Vec<String> = places
            .flat_map(|[x, y]| ["mousemove".to_owned(), x, y, "sleep".to_owned(), "0.03".to_owned()])
            .collect();
        screen.hand(&moves.iter().map(String::as_str).collect::<Vec<_>>());
        screen.hand(&["mouseup", button]);
        viewer.settle();
    }
    viewer.write(&folder, "ctrl+s", "kept.toml");
    let ended = viewer.quit();
    assert_eq!(ended.code, 0, "{}", ended.err);
    let report: serde_json::Value = serde_json::from_str(&folder.text("r.json")).expect("JSON");
    let drags = &report["drags"];
    let [frames, allocating, waiting, compiling] =
        ["frames", "allocating", "waiting", "compiling"].map(|what| drags[what].as_u64().expect("a number"));
    println!("{drags}");
    assert!(frames >= 3 * buttons.len() as u64, "{drags}");
    assert_eq!(waiting, 0, "{drags}");
    // The first frame of what moves may make what all others use.
    assert!(allocating <= buttons.len() as u64 && compiling <= buttons.len() as u64, "{drags}");
}
