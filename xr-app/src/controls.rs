//! What hands do to the scene: one carries it, two stretch and turn it, thumbsticks move window and level, buttons change
//! presets, hold a cutting plane, and put everything back.

use std::collections::BTreeMap;

use engine::Result;
use engine::render::{Appearance, ClipPlane, Look};
use engine::transfer::{PRESETS, TransferFunction, preset};
use glam::DVec3;

use crate::headset::{Hand, Hands, Pose};
use crate::placement::Placement;

/// A hand holds from this on, and lets go below half of it.
const HOLDS: f64 = 0.6;
/// Where a thumbstick rests, its ends are not yet meant.
const RESTS: f64 = 0.15;
/// A thumbstick at its end moves level or width by this part of the data's range in a second.
const PER_SECOND: f64 = 0.25;
/// Narrowest window, a part of the one of the preset.
const NARROWEST: f64 = 0.05;

/// Whether a button went down.
#[derive(Clone, Copy, Default)]
struct Button(bool);

impl Button {
    fn pressed(&mut self, down: bool) -> bool {
        !std::mem::replace(&mut self.0, down) && down
    }
}

/// What hands have done so far.
pub struct Controls {
    /// Where the patient is.
    pub placement: Placement,
    home: Placement,
    /// Where each hand that holds was in the frame before.
    held: [Option<Pose>; 2],
    next: [Button; 2],
    other: [Button; 2],
    /// The transfer function before it was moved.
    base: TransferFunction,
    range: [f64; 2],
    /// How far level has been moved, HU, and by how much the window is wider.
    shift: f64,
    width: f64,
    /// Whether the right hand holds a plane.
    cutting: bool,
    clip: Vec<ClipPlane>,
    objects: BTreeMap<u8, Appearance>,
}

impl Controls {
    /// Nothing done yet, to a scene with intensities in `range`.
    pub fn new(placement: Placement, look: &Look, range: [f64; 2]) -> Self {
        Controls {
            placement,
            home: placement,
            held: [None; 2],
            next: Default::default(),
            other: Default::default(),
            base: look.transfer.clone(),
            range,
            shift: 0.0,
            width: 1.0,
            cutting: false,
            clip: look.clip.clone(),
            objects: look.objects.clone(),
        }
    }

    /// Puts the patient elsewhere, which is where a reset puts it.
    pub fn place(&mut self, placement: Placement) {
        (self.placement, self.home) = (placement, placement);
        self.held = [None; 2];
    }

    /// Takes note of what the hands do in a frame that lasts so long, and says what the scene looks like now if that has
    /// changed.
    pub fn update(&mut self, hands: &Hands, seconds: f64) -> Result<Option<Look>> {
        self.carry(hands);
        let mut changed = false;
        for (side, step) in [(0, PRESETS.len() - 1), (1, 1)] {
            if self.next[side].pressed(hands[side].next) {
                self.choose(step)?;
                changed = true;
            }
        }
        if self.other[0].pressed(hands[0].other) {
            self.placement = self.home;
            (self.shift, self.width) = (0.0, 1.0);
            self.cutting = false;
            changed = true;
        }
        if self.other[1].pressed(hands[1].other) {
            self.cutting = !self.cutting;
            changed = true;
        }
        changed |= self.window(&hands[1], seconds);
        changed |= self.cutting && hands[1].grip.is_some();
        changed.then(|| self.look(&hands[1])).transpose()
    }

    /// One hand carries, two stretch.
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

    /// The thumbstick: sideways the width, up and down the level. Whether anything moved.
    fn window(&mut self, hand: &Hand, seconds: f64) -> bool {
        let beyond = |v: f64| v.signum() * (v.abs() - RESTS).max(0.0) / (1.0 - RESTS);
        let (x, y) = (beyond(hand.stick.x), beyond(hand.stick.y));
        self.shift += y * PER_SECOND * seconds * (self.range[1] - self.range[0]);
        self.width = (self.width * (x * 4.0 * PER_SECOND * seconds).exp()).max(NARROWEST);
        x != 0.0 || y != 0.0
    }

    /// The preset so many rows further in the table.
    fn choose(&mut self, step: usize) -> Result<()> {
        let now = PRESETS.iter().position(|p| p.name == self.base.name).unwrap_or(PRESETS.len() - 1);
        let name = PRESETS[(now + step) % PRESETS.len()].name;
        self.base = preset(name)?.over(self.range);
        (self.shift, self.width) = (0.0, 1.0);
        Ok(())
    }

    fn look(&self, right: &Hand) -> Result<Look> {
        let mut clip = self.clip.clone();
        if let Some(grip) = right.grip.filter(|_| self.cutting) {
            clip.push(self.plane(&grip));
        }
        Ok(Look { transfer: self.transfer()?, clip, objects: self.objects.clone() })
    }

    /// The transfer function, moved and widened about its middle.
    fn transfer(&self) -> Result<TransferFunction> {
        let [low, high] = self.base.extent();
        let (middle, half) = ((low + high) * 0.5, (high - low) * 0.5);
        if (self.shift, self.width) == (0.0, 1.0) || half <= 0.0 {
            return Ok(self.base.clone());
        }
        let to = [-1.0, 1.0].map(|side| middle + self.shift + side * half * self.width);
        self.base.stretched([low, high], to)
    }

    /// A plane across the hand, like a blade in it: what lies to the left of it, as the hand sees it, is cut away.
    fn plane(&self, grip: &Pose) -> ClipPlane {
        let normal = self.placement.patient_direction(grip.orientation * DVec3::X);
        ClipPlane { normal, offset: normal.dot(self.placement.patient(grip.position)) }
    }

    /// Name of the transfer function.
    pub fn preset(&self) -> &str {
        &self.base.name
    }
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec2};

    use super::*;

    const FRAME: f64 = 1.0 / 72.0;

    fn controls() -> Controls {
        let head = Pose { position: DVec3::new(0.0, 1.6, 0.0), ..Pose::IDENTITY };
        let look = Look::new(preset("CT-Bone").expect("a preset").over([-1000.0, 2000.0]));
        Controls::new(Placement::before(&head, DVec3::ZERO, 100.0), &look, [-1000.0, 2000.0])
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
        let start = (c.placement, c.base.extent());
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
