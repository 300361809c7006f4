//! The light, moved in the picture and in its panel.

use engine::transfer::{FixedTo, Light};

use super::*;

#[test]
fn a_drag_with_ctrl_moves_the_light_and_not_the_camera() {
    let mut bench = Bench::new();
    bench.app.state.transfer.material.shade = true;
    bench.rest();
    let (orbit, middle) = (bench.app.state.orbit, bench.middle());
    bench.app.take_changes();
    bench.drag(middle, vec2(120.0, 0.0), PointerButton::Primary, Modifiers::COMMAND);
    let axes = orbit.axes();
    let [before, after] = [Light::default(), bench.app.state.light].map(|light| light.seen(axes));
    assert!(after.x > before.x + 0.2 && (after.y - before.y).abs() < 0.02, "{before} {after}");
    assert_eq!(bench.app.state.orbit, orbit);
    assert!(bench.app.take_changes().look);
    // The edit can be undone.
    bench.press(Key::Z, Modifiers::COMMAND);
    assert_eq!(bench.app.state.light, Light::default());
    // Where nothing is lit the same drag turns.
    bench.app.state.transfer.material.shade = false;
    bench.drag(middle, vec2(60.0, 0.0), PointerButton::Primary, Modifiers::COMMAND);
    assert!(bench.app.state.light == Light::default() && bench.app.state.orbit != orbit);
}

#[test]
fn a_light_of_the_patient_stays_when_the_picture_turns() {
    let mut bench = Bench::new();
    bench.app.state.transfer.material.shade = true;
    bench.rest();
    let at = bench.find("Headlight");
    bench.click(at);
    assert_eq!(bench.app.state.light, Light::HEAD);
    let at = bench.find("with the patient");
    bench.click(at);
    assert_eq!(bench.app.state.light.fixed_to, FixedTo::Patient);
    let axes = bench.app.state.orbit.axes();
    assert!(bench.app.state.light.seen(axes).distance(DVec3::Z) < 1e-9, "it has not moved");
    bench.press(Key::L, Modifiers::NONE);
    let axes = bench.app.state.orbit.axes();
    assert!(bench.app.state.light.seen(axes).z.abs() < 1e-9, "from the side now");
    let at = bench.find("Usual");
    bench.click(at);
    assert_eq!(bench.app.state.light, Light::default());
}
