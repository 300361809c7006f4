//! Two sets of splats in a window.

use super::*;

#[test]
fn two_fits_stand_side_by_side_with_one_camera() {
    let Some(screen) = Screen::new() else { return };
    let folder = folder();
    let coarse = ["--no-eval", "--iterations", "12", "--splats", "60", "--offsets", "4"];
    let ended = folder.run(&fit("coarse.vgs", &coarse));
    assert_eq!(ended.code, 0, "{}", ended.err);
    without_notice(&folder);
    let arguments = ["s.ply", "--beside", "coarse.vgs", "--tf", "CT-Soft-Tissue"];
    let mut viewer = begin(&screen, &folder, &arguments);
    let whole = viewer.act(&["key", "l"]);
    whole.keep("beside");
    let write = |viewer: &mut Viewer<'_>, key: &str, name: &str| {
        viewer.write(&folder, key, name);
        // The message that it is written.
        screen.hand(&["key", "Escape"]);
        viewer.settle();
    };
    write(&mut viewer, "ctrl+s", "both.toml");
    write(&mut viewer, "ctrl+p", "both.png");
    screen.hand(&["mousemove", "448", "600"]);
    let moved = viewer.drag("1", ["448", "600"], ["300", "600"]);
    moved.keep("beside-moved");
    viewer.act(&["key", "b"]);
    let flipped = viewer.act(&["key", "space"]);
    flipped.keep("beside-flipped");
    write(&mut viewer, "ctrl+p", "coarse.png");
    let closed = viewer.act(&["key", "ctrl+shift+b"]);
    closed.keep("beside-closed");
    assert_eq!(viewer.quit().code, 0);

    // The same session with the coarse fit alone.
    let mut session = toml(&folder, "both.toml");
    let split = session.remove("split").and_then(|split| split.as_float());
    assert_eq!(split, Some(0.5));
    session.remove("objects");
    let files = session["files"].as_table_mut().expect("files");
    let beside = files.remove("beside").expect("the session has it");
    files.insert("splats".to_owned(), vec![beside].into());
    std::fs::write(folder.path("alone.toml"), session.to_string()).expect("a session");
    let viewer = begin(&screen, &folder, &["alone.toml"]);
    let alone = screen.look();
    alone.keep("beside-alone");
    assert_eq!(viewer.quit().code, 0);

    // The line is in the middle, at 448, with its grip.
    let [left, right] = [[100, 100, 436, 600], [460, 100, 800, 600]];
    assert!(alone.count(right, bright) > 5000, "something is seen");
    assert!(whole.differences(&alone, left) > 1000, "the fine fit to the left");
    assert!(whole.differences(&closed, left) < 50, "{} pixels differ", whole.differences(&closed, left));
    assert!(closed.differences(&alone, right) > 1000, "and everywhere once the coarse one is closed");
    assert!(whole.differences(&alone, right) < 50, "{} pixels differ", whole.differences(&alone, right));
    let between = [312, 100, 436, 600];
    assert!(whole.differences(&moved, between) > 200, "the line has moved");
    let follows = [312, 100, 800, 600];
    assert!(moved.differences(&alone, follows) < 50, "{} differ", moved.differences(&alone, follows));
    assert!(flipped.differences(&alone, PICTURE) < 50, "{} differ", flipped.differences(&alone, PICTURE));

    // The session brings both back, and pictures have both sides, too.
    let viewer = begin(&screen, &folder, &["both.toml"]);
    let back = screen.look();
    assert!(back.differences(&whole, PICTURE) < 50, "{} differ", back.differences(&whole, PICTURE));
    assert_eq!(viewer.quit().code, 0);
    let picture = |name: &str| engine::image::read(folder.path(name)).expect("a picture").image;
    let (both, coarse) = (picture("both.png"), picture("coarse.png"));
    // Below the names of the two sets.
    let differing = |columns: std::ops::Range<usize>| {
        let rows = both.pixels.chunks(both.size[0]).zip(coarse.pixels.chunks(both.size[0])).skip(60);
        let row = |(a, b): (&[[f32; 4]], &[[f32; 4]])| columns.clone().filter(|&x| a[x] != b[x]).count();
        rows.map(row).sum::<usize>()
    };
    assert_eq!(both.size, coarse.size);
    let middle = both.size[0] / 2;
    // Beside the line and its grip, which only one of the pictures has.
    assert_eq!(differing(middle + 12..both.size[0]), 0);
    assert!(differing(0..middle) > 1000, "{} pixels differ", differing(0..middle));
}

#[test]
fn splats_beside_that_cannot_be_read_leave_the_others_as_they_are() {
    let Some(screen) = Screen::new() else { return };
    let folder = folder();
    without_notice(&folder);
    let mut viewer = begin(&screen, &folder, &["s.ply", "--tf", "CT-Soft-Tissue"]);
    screen.hand(&["mousemove", "450", "700"]);
    viewer.settle();
    let alone = screen.look();
    assert_eq!(viewer.quit().code, 0);
    std::fs::write(folder.path("broken.vgs"), "no splats").expect("a file");
    let mut viewer = begin(&screen, &folder, &["s.ply", "--beside", "broken.vgs", "--tf", "CT-Soft-Tissue"]);
    viewer.wait("a message", |v| v.log().contains("broken.vgs"));
    // The message goes, and with the mouse elsewhere nothing is different.
    screen.hand(&["key", "Escape", "mousemove", "450", "700"]);
    viewer.settle();
    let shown = screen.look();
    shown.keep("beside-broken");
    assert!(shown.differences(&alone, PICTURE) < 50, "{} pixels differ", shown.differences(&alone, PICTURE));
    screen.hand(&["key", "ctrl+s"]);
    viewer.settle();
    screen.hand(&["key", "Return"]);
    viewer.wait("the session", |_| folder.path("s.toml").is_file());
    viewer.settle();
    assert_eq!(viewer.quit().code, 0);
    let files = &toml(&folder, "s.toml")["files"];
    assert!(
        files.get("beside").is_none() && files["splats"].as_array().is_some_and(|s| s.len() == 1),
        "{files}"
    );
}
