//! What hands do to the scene: one hand carries it, two stretch and turn it, the thumbstick moves window and
//! level, buttons change presets, hold a cutting plane, and reset everything.

use engine::Result;
use engine::render::{ClipPlane, Look};
use engine::splat::Object;
use engine::transfer::{PRESETS, load};
use glam::DVec3;
use view::state::{self, ViewState};
use view::transfer::Transfer;

use crate::headset::{Hand, Hands, Pose};
use crate::placement::Placement;

/// Squeeze from which a hand holds; it lets go below half of it.
const HOLDS: f64 = 0.6;
/// Largest deflection of a thumbstick that counts as rest.
const RESTS: f64 = 0.15;
/// Part of the data's range by which a thumbstick at its end moves level or width in a second.
const PER_SECOND: f64 = 0.25;
/// Narrowest window, as a part of the preset's window.
const NARROWEST: f64 = 0.05;

/// A button, with its state at the last call: true if it was down.
#[derive(Clone, Copy, Default)]
pub struct Button(bool);

impl Button {
    /// Returns true if the button is down now and was not at the last call.
    pub fn pressed(&mut self, down: bool) -> bool {
        !std::mem::replace(&mut self.0, down) && down
    }
}

/// The state that was shown last.
#[derive(PartialEq)]
struct Shown {
    transfer: Transfer,
    objects: Vec<state::Object>,
    cut: Option<ClipPlane>,
}

/// The state that hands have changed so far.
pub struct Controls {
    /// Placement of the patient in the room.
    pub placement: Placement,
    /// View of the patient, which hands and the panel change.
    pub state: ViewState,
    /// Least and greatest intensity of the scene.
    pub range: [f64; 2],
    home: Placement,
    /// Pose, in the frame before, of each hand that holds.
    held: [Option<Pose>; 2],
    next: [Button; 2],
    other: [Button; 2],
    /// The transfer function before it was moved, and the objects as they were at the start.
    base: Transfer,
    base_objects: Vec<state::Object>,
    /// True if the right hand holds a plane.
    cutting: bool,
    clip: Vec<ClipPlane>,
    /// Numbers by which the scene knows the rows of the objects.
    numbers: Vec<u8>,
    shown: Shown,
}

impl Controls {
    /// Creates the controls of a scene with these objects and with intensities in `range`; nothing is changed
    /// yet.
    pub fn new(placement: Placement, look: &Look, objects: &[Object], range: [f64; 2]) -> Self {
        let mut state = ViewState::new(&look.transfer);
        let row = |object: &Object| {
            let row = state::Object::new(0, Some(object.number), &object.name);
            match look.objects.get(&object.number) {
                None => row,
                Some(seen) => state::Object {
                    visible: seen.visible,
                    tint: seen.tint.map(|colour| DVec3::from_array(colour.map(f64::from))),
                    opacity: f64::from(seen.opacity),
                    ..row
                },
            }
        };
        state.objects = objects.iter().map(row).collect();
        let shown = Shown { transfer: state.transfer.clone(), objects: state.objects.clone(), cut: None };
        Controls {
            placement,
            base: state.transfer.clone(),
            base_objects: state.objects.clone(),
            state,
            range,
            home: placement,
            held: [None; 2],
            next: Default::default(),
            other: Default::default(),
            cutting: false,
            clip: look.clip.clone(),
            numbers: objects.iter().map(|object| object.number).collect(),
            shown,
        }
    }

    /// Moves the patient to a placement; a reset returns it there.
    pub fn place(&mut self, placement: Placement) {
        (self.placement, self.home) = (placement, placement);
        self.held = [None; 2];
    }

    /// Returns true if a hand holds the patient.
    pub fn holds(&self, side: usize) -> bool {
        self.held[side].is_some()
    }

    /// Applies what the hands do in a frame that lasts `seconds`. Returns the scene's look if it has changed
    /// since the last call, by a hand or by the panel.
    pub fn update(&mut self, hands: &Hands, seconds: f64) -> Result<Option<Look>> {
        self.carry(hands);
        for (side, step) in [(0, PRESETS.len() - 1), (1, 1)] {
            if self.next[side].pressed(hands[side].next) {
                let now = PRESETS.iter().position(|p| p.name == self.preset()).unwrap_or(PRESETS.len() - 1);
                self.choose(PRESETS[(now + step) % PRESETS.len()].name)?;
            }
        }
        if self.other[0].pressed(hands[0].other) {
            self.placement = self.home;
            (self.state.transfer, self.state.objects) = (self.base.clone(), self.base_objects.clone());
            self.cutting = false;
        }
        self.cutting ^= self.other[1].pressed(hands[1].other);
        self.window(&hands[1], seconds);
        let cut = hands[1].grip.filter(|_| self.cutting).map(|grip| self.plane(&grip));
        let ViewState { transfer, objects, .. } = &self.state;
        if (transfer, objects, cut) == (&self.shown.transfer, &self.shown.objects, self.shown.cut) {
            return Ok(None);
        }
        self.shown = Shown { transfer: transfer.clone(), objects: objects.clone(), cut };
        let mut look = self.state.look(&self.numbers)?;
        look.clip = self.clip.iter().copied().chain(cut).collect();
        Ok(Some(look))
    }

    /// Moves the patient: one hand carries it, two stretch it.
    fn carry(&mut self, hands: &Hands) {
        let before = self.held;
        for (held, hand) in self.held.iter_mut().zip(hands) {
            let needed = if held.is_some() { HOLDS * 0.5 } else { HOLDS };
            *held = hand.grip.filter(|_| hand.squeeze >= needed);
        }
        self.placement = match (before, self.held) {
            ([Some(a), Some(b)], [Some(c), Some(d)]) => {
                self.placement.stretched([a.position, b.position], [c.position, d.position])
            }
            ([Some(from), None], [Some(to), None]) | ([None, Some(from)], [None, Some(to)]) => {
                self.placement.carried(&from, &to)
            }
            // A hand has just taken hold or let go.
            _ => self.placement,
        };
    }

    /// Moves the window with the thumbstick: sideways its width, up and down its level.
    fn window(&mut self, hand: &Hand, seconds: f64) {
        let beyond = |v: f64| v.signum() * (v.abs() - RESTS).max(0.0) / (1.0 - RESTS);
        let (x, y) = (beyond(hand.stick.x), beyond(hand.stick.y));
        if (x, y) == (0.0, 0.0) {
            return;
        }
        let [low, high] = self.state.transfer.window();
        let least = NARROWEST * (self.base.window()[1] - self.base.window()[0]);
        let half = 0.5 * ((high - low) * (x * 4.0 * PER_SECOND * seconds).exp()).max(least);
        let level = (low + high) * 0.5 + y * PER_SECOND * seconds * (self.range[1] - self.range[0]);
        self.state.transfer.set_window([level - half, level + half]);
    }

    /// Takes a transfer function: a preset, a window or a file.
    pub fn choose(&mut self, name: &str) -> Result<()> {
        self.state.transfer = Transfer::new(&load(name, self.range)?);
        self.base = self.state.transfer.clone();
        Ok(())
    }

    /// Returns a plane across the hand, like a blade in it: everything to the left of it, as the hand sees
    /// it, is cut away.
    fn plane(&self, grip: &Pose) -> ClipPlane {
        let normal = self.placement.patient_direction(grip.orientation * DVec3::X);
        ClipPlane { normal, offset: normal.dot(self.placement.patient(grip.position)) }
    }

    /// Returns the name of the transfer function.
    pub fn preset(&self) -> &str {
        &self.state.transfer.name
    }
}

#[cfg(test)]
mod tests {
    use engine::transfer::preset;
    use glam::{DQuat, DVec2};

    use super::*;

    const FRAME: f64 = 1.0 / 72.0;

    fn controls() -> Controls {
        let head = Pose { position: DVec3::new(0.0, 1.6, 0.0), ..Pose::IDENTITY };
        let look = Look::new(preset("CT-Bone").expect("a preset").over([-1000.0, 2000.0]));
        let objects = [3, 7].map(|number| Object { number, name: format!("label {number}"), splats: 1 });
        Controls::new(Placement::before(&head, DVec3::ZERO, 100.0), &look, &objects, [-1000.0, 2000.0])
    }

    fn at(x: f64, squeeze: f64) -> Hand {
        let grip = Pose { position: DVec3::new(x, 1.5, -0.5), orientation: DQuat::IDENTITY };
        Hand { grip: Some(grip), squeeze, ..Hand::default() }
    }

    #[test]
    fn a_hand_that_holds_carries_and_one_that_does_not_does_not() {
        let mut c = controls();
        let start = c.placement;
        let idle = Hand::default();
        for (squeeze, x, expect) in [
            (0.3, 0.0, 0.0),
            (0.3, 0.1, 0.0),
            (1.0, 0.1, 0.0),
            (1.0, 0.2, 0.1),
            (0.4, 0.3, 0.2),
            (0.1, 0.9, 0.2),
        ] {
            assert!(c.update(&[idle, at(x, squeeze)], FRAME).expect("no error").is_none());
            let moved = c.placement.position - start.position;
            assert!((moved - DVec3::X * expect).length() < 1e-9, "{squeeze} at {x}: {moved}");
        }
    }

    #[test]
    fn two_hands_stretch_and_nothing_jumps_when_one_lets_go() {
        let mut c = controls();
        c.update(&[at(-0.1, 1.0), at(0.1, 1.0)], FRAME).expect("no error");
        assert_eq!(c.placement.scale, 1.0);
        c.update(&[at(-0.2, 1.0), at(0.2, 1.0)], FRAME).expect("no error");
        assert!((c.placement.scale - 2.0).abs() < 1e-9);
        let before = c.placement;
        c.update(&[at(-0.2, 0.0), at(0.5, 1.0)], FRAME).expect("no error");
        assert_eq!(c.placement, before);
    }

    #[test]
    fn a_button_counts_once_however_long_it_is_held() {
        let mut c = controls();
        let first = c.preset().to_owned();
        let down = Hand { next: true, ..Hand::default() };
        let up = Hand::default();
        assert!(c.update(&[up, down], FRAME).expect("no error").is_some());
        let second = c.preset().to_owned();
        assert_ne!(first, second);
        assert!(c.update(&[up, down], FRAME).expect("no error").is_none());
        c.update(&[up, up], FRAME).expect("no error");
        c.update(&[down, up], FRAME).expect("no error");
        assert_eq!(c.preset(), first, "the left hand goes back");
    }

    #[test]
    fn the_stick_moves_the_window_and_reset_puts_everything_back() {
        let mut c = controls();
        let start = (c.placement, c.state.transfer.window());
        let stick = Hand { stick: DVec2::new(0.1, 1.0), ..Hand::default() };
        let look = (0..72).map(|_| c.update(&[Hand::default(), stick], FRAME).expect("no error")).last();
        let moved = look.flatten().expect("it changed").transfer.extent();
        for side in 0..2 {
            assert!(
                (moved[side] - start.1[side] - 750.0).abs() < 1e-6,
                "a quarter of 3000 HU in a second: {moved:?}"
            );
        }
        c.update(&[Hand::default(), at(0.0, 1.0)], FRAME).expect("no error");
        c.update(&[Hand::default(), at(0.4, 1.0)], FRAME).expect("no error");
        assert_ne!(c.placement, start.0);
        let reset = Hand { other: true, ..Hand::default() };
        let look = c.update(&[reset, Hand::default()], FRAME).expect("no error").expect("it changed");
        assert_eq!((c.placement, look.transfer.extent()), start);
    }

    #[test]
    fn what_is_edited_elsewhere_is_shown_and_put_back() {
        let mut c = controls();
        let idle = [Hand::default(); 2];
        assert!(c.update(&idle, FRAME).expect("no error").is_none());
        c.state.objects[1].visible = false;
        let look = c.update(&idle, FRAME).expect("no error").expect("it changed");
        assert!(look.objects[&3].visible && !look.objects[&7].visible);
        assert!(c.update(&idle, FRAME).expect("no error").is_none(), "once");
        let reset = Hand { other: true, ..Hand::default() };
        let look = c.update(&[reset, Hand::default()], FRAME).expect("no error").expect("it changed");
        assert!(look.objects[&7].visible);
    }

    #[test]
    fn the_hand_cuts_where_it_is() {
        let mut c = controls();
        let hand = Hand { other: true, ..at(0.05, 0.0) };
        let look = c.update(&[Hand::default(), hand], FRAME).expect("no error").expect("it changed");
        let plane = look.clip[0];
        // Room x is the patient's -x: 5 cm to the viewer's right are 50 mm to the patient's left.
        assert!(
            (plane.normal - DVec3::NEG_X).length() < 1e-9 && (plane.offset - 50.0).abs() < 1e-9,
            "{plane:?}"
        );
        let moved = c.update(&[Hand::default(), at(0.1, 0.0)], FRAME).expect("no error").expect("it follows");
        assert!((moved.clip[0].offset - 100.0).abs() < 1e-9);
    }
}
