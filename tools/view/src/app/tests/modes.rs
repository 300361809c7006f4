//! What the panel of the quality offers.

use super::*;

#[test]
fn only_modes_that_suit_the_splats_are_offered() {
    let mut bench = Bench::new();
    let there =
        |bench: &Bench| ["slab", "decoded", "alpha", "exact"].map(|mode| bench.place_of(mode).is_some());
    bench.rest();
    assert_eq!(there(&bench), [true; 4]);
    for (kind, mode, seen) in [
        (SplatKind::Grid, SplatMode::named("decoded").expect("a mode"), [false, true, false, false]),
        (SplatKind::Coloured, SplatMode::named("alpha").expect("a mode"), [false, false, true, false]),
    ] {
        (bench.kind, bench.app.state.mode) = (Some(kind), mode);
        bench.rest();
        assert_eq!(there(&bench), seen, "{kind:?}");
        bench.press(Key::M, Modifiers::NONE);
        assert_eq!(bench.app.state.mode, mode, "the next one is the same");
    }
    // A volume alone.
    (bench.kind, bench.app.state.shown) = (None, Subject::Volume);
    bench.rest();
    assert_eq!((there(&bench), bench.place_of("Mode")), ([false; 4], None));
    bench.press(Key::M, Modifiers::NONE);
    assert_eq!(bench.app.state.mode, SplatMode::named("alpha").expect("a mode"), "nothing to choose from");
}

#[test]
fn a_step_has_the_unit_of_what_is_rendered() {
    let mut bench = Bench::new();
    for (kind, mode, shown, text) in [
        (Some(SplatKind::Field), SplatMode::named("slab").expect("a mode"), Subject::Splats, Some("0.75 mm")),
        (
            Some(SplatKind::Field),
            SplatMode::named("slab").expect("a mode"),
            Subject::Volume,
            Some("0.2 voxels"),
        ),
        (
            Some(SplatKind::Grid),
            SplatMode::named("decoded").expect("a mode"),
            Subject::Splats,
            Some("0.2 voxels"),
        ),
        (None, SplatMode::named("slab").expect("a mode"), Subject::Volume, Some("0.2 voxels")),
        (Some(SplatKind::Field), SplatMode::named("exact").expect("a mode"), Subject::Splats, None),
        (Some(SplatKind::Coloured), SplatMode::named("alpha").expect("a mode"), Subject::Splats, None),
    ] {
        (bench.kind, bench.app.state.mode, bench.app.state.shown) = (kind, mode, shown);
        bench.rest();
        // The number and its unit are texts of their own.
        let is_there = |text: &&str| text.split(' ').all(|word| !bench.rects_of(word).is_empty());
        let found = ["0.75 mm", "0.2 voxels"].into_iter().find(is_there);
        assert_eq!((found, bench.place_of("Step").is_some()), (text, text.is_some()), "{mode:?} {shown:?}");
        assert_eq!(bench.app.state.quality.step, None, "looking changes nothing");
        let budget = kind.is_some() && mode != SplatMode::named("decoded").expect("a mode");
        assert_eq!(bench.place_of("Splat budget").is_some(), budget, "{mode:?}");
    }
}
