//! What hands do to the scene: one hand carries it, two stretch and turn it, the thumbstick moves window and
//! level, buttons change presets, hold a cutting plane, undo, and reset everything.

use std::cmp::Ordering;

use engine::Result;
use engine::render::{ClipPlane, Look, PLANES, UsualLook};
use engine::transfer::{PRESETS, load};
use engine::volume::edges::Edges;
use glam::DVec3;
use view::model::history::History;
use view::model::state::{self, Clip, Edited, InHeadset, MOST_PLANES, ViewState};
use view::model::transfer::Transfer;

use crate::feedback::{Feedback, GRAB, SNAP};
use crate::headset::{HOLDS, Hand, Hands, Pose};
use crate::placement::Placement;
use crate::start::{Start, standing};

/// Largest deflection of a thumbstick that counts as rest.
const RESTS: f64 = 0.15;
/// Part of the data's range by which a thumbstick at its end moves level or width in a second.
const PER_SECOND: f64 = 0.25;
/// Narrowest window, as a part of the preset's window.
const NARROWEST: f64 = 0.05;
/// Time that the left second button is held until it resets instead of undoing, seconds.
const RESETS: f64 = 1.0;
/// Time after which a button that is still held is told to reset soon, seconds.
const SOON: f64 = 0.4;
/// Distance from real size, as a part of it, within which a patient between two hands has real size.
const SNAPS: f64 = 0.04;

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
    clip: Clip,
    cut: Option<ClipPlane>,
}

/// A step of the history.
#[derive(Clone, PartialEq)]
struct Step {
    edited: Edited,
    base: Transfer,
    /// Number of resets that led here.
    resets: usize,
}

/// The state that hands have changed so far.
pub struct Controls {
    /// Placement of the patient in the room.
    pub placement: Placement,
    /// View of the patient, which hands and the panel change.
    pub state: ViewState,
    /// Least and greatest intensity of the scene.
    pub range: [f64; 2],
    /// Text behind an intensity: " HU", or nothing.
    pub unit: &'static str,
    /// True if what is shown has a binary region, whose edges can be smooth.
    pub has_region: bool,
    /// What the user is to be told of this frame.
    pub feedback: Feedback,
    /// True while something on the panel is dragged: all that it changes is one step of the history.
    pub dragging: bool,
    home: Placement,
    /// Where the session has left the patient, in the room and from home.
    left: Option<(Placement, InHeadset)>,
    /// Pose, in the frame before, of each hand that holds.
    held: [Option<Pose>; 2],
    /// Magnification between two hands, as if nothing snapped; `None` while there are not two.
    stretched: Option<f64>,
    next: [Button; 2],
    other: Button,
    /// Time that the left second button has been down, seconds.
    held_for: Option<f64>,
    /// The transfer function before it was moved.
    base: Transfer,
    /// Objects, clip planes and edges as they were at the start.
    first: (Vec<state::Object>, Clip, Edges),
    history: History<Step>,
    resets: usize,
    /// Placements before each of these resets.
    before: Vec<Placement>,
    /// True if the right hand holds a plane.
    cutting: bool,
    /// The plane in the hand, and where the hand is, mm RAS.
    cut: Option<(ClipPlane, DVec3)>,
    /// Numbers by which the scene knows the rows of the objects.
    numbers: Vec<u8>,
    shown: Shown,
}

impl Controls {
    /// Creates the controls of a scene, with the view to begin with.
    pub fn new(placement: Placement, start: Start) -> Self {
        let Start { state, numbers, range, unit, has_region } = start;
        let (base, resets) = (state.transfer.clone(), 0);
        Controls {
            placement,
            range,
            unit,
            has_region,
            feedback: Feedback::default(),
            dragging: false,
            home: placement,
            left: None,
            held: [None; 2],
            stretched: None,
            next: Default::default(),
            other: Default::default(),
            held_for: None,
            first: (state.objects.clone(), state.clip.clone(), state.edges),
            history: History::new(Step { edited: state.edited(), base: base.clone(), resets }),
            resets,
            before: Vec::new(),
            cutting: false,
            cut: None,
            numbers,
            shown: Shown {
                transfer: base.clone(),
                objects: state.objects.clone(),
                clip: state.clip.clone(),
                cut: None,
            },
            base,
            state,
        }
    }

    /// Moves the patient to a placement; a reset returns it there. From there it goes where the session has left it, once.
    pub fn place(&mut self, placement: Placement) {
        self.home = placement;
        let left = self.state.headset.take().map(|place| (placement.at(&place), place));
        self.placement = left.map_or(placement, |(there, _)| there);
        self.left = left.or(self.left);
        self.held = [None; 2];
    }

    /// Returns the state as a session keeps it: with where the patient is, if that is not where it was placed.
    pub fn session(&self) -> ViewState {
        // Where nobody has moved it, to the last digit.
        let left = self.left.filter(|(there, _)| *there == self.placement).map(|(_, place)| place);
        let moved = (self.placement != self.home).then(|| self.placement.from_home(&self.home));
        let headset = self.state.headset.or(left).or(moved);
        ViewState { headset, ..self.state.clone() }
    }

    /// Returns true if a hand holds the patient.
    pub fn holds(&self, side: usize) -> bool {
        self.held[side].is_some()
    }

    /// Returns the look of the state.
    ///
    /// # Errors
    /// Returns the errors of [`ViewState::look`].
    pub fn look(&self) -> Result<Look> {
        let mut look = self.state.look(&self.numbers)?;
        // There is no room for more.
        look.clip.extend(self.cut.map(|(plane, _)| plane).filter(|_| look.clip.len() < PLANES));
        Ok(look)
    }

    /// Returns the scene's look if it has changed since the last call, by a hand or by the panel.
    ///
    /// # Errors
    /// Returns the errors of [`ViewState::look`].
    pub fn new_look(&mut self) -> Result<Option<Look>> {
        let ViewState { transfer, objects, clip, .. } = &self.state;
        let Shown { transfer: old_transfer, objects: old_objects, clip: old_clip, cut } = &self.shown;
        let in_hand = self.cut.map(|(plane, _)| plane);
        if (transfer, objects, clip, &in_hand) == (old_transfer, old_objects, old_clip, cut) {
            return Ok(None);
        }
        self.shown =
            Shown { transfer: transfer.clone(), objects: objects.clone(), clip: clip.clone(), cut: in_hand };
        self.look().map(Some)
    }

    /// Applies what the hands do in a frame that lasts `seconds`.
    pub fn act(&mut self, hands: &Hands, seconds: f64) -> Result<()> {
        self.carry(hands);
        for (side, step) in [(0, PRESETS.len() - 1), (1, 1)] {
            if self.next[side].pressed(hands[side].next) {
                let now = PRESETS.iter().position(|p| p.name == self.preset()).unwrap_or(PRESETS.len() - 1);
                self.choose(PRESETS[(now + step) % PRESETS.len()].name)?;
            }
        }
        self.left_button(hands[0].other, seconds);
        if self.other.pressed(hands[1].other) {
            self.right_button(&hands[1]);
        }
        let grip = hands[1].grip.filter(|_| self.cutting);
        self.cut = grip.map(|grip| (self.plane(&grip), self.placement.patient(grip.position)));
        let moving = self.window(&hands[1], seconds);
        self.remember(moving || self.dragging);
        Ok(())
    }

    /// Moves the patient: one hand carries it, two stretch it.
    fn carry(&mut self, hands: &Hands) {
        let before = self.held;
        for (side, hand) in hands.iter().enumerate() {
            let needed = if before[side].is_some() { HOLDS * 0.5 } else { HOLDS };
            self.held[side] = hand.grip.filter(|_| hand.squeeze >= needed);
            if before[side].is_none() && self.held[side].is_some() {
                self.feedback.pulse(side, GRAB);
            }
        }
        match (before, self.held) {
            ([Some(a), Some(b)], [Some(c), Some(d)]) => {
                self.stretch([a.position, b.position], [c.position, d.position]);
                return;
            }
            ([Some(from), None], [Some(to), None]) | ([None, Some(from)], [None, Some(to)]) => {
                self.placement = self.placement.carried(&from, &to);
            }
            // A hand has just taken hold or let go.
            _ => {}
        }
        self.stretched = None;
    }

    /// Stretches the patient between two hands; close to real size it snaps to that.
    fn stretch(&mut self, from: [DVec3; 2], to: [DVec3; 2]) {
        let before = self.placement.scale;
        let wanted = Placement::stretched_scale(self.stretched.unwrap_or(before), from, to);
        self.stretched = Some(wanted);
        let scale = if (wanted - 1.0).abs() <= SNAPS { 1.0 } else { wanted };
        if scale == 1.0 && before != 1.0 {
            [0, 1].into_iter().for_each(|side| self.feedback.pulse(side, SNAP));
            self.feedback.say("Real size");
        }
        self.placement = self.placement.stretched(from, to, scale);
    }

    /// Undoes when the left second button is let go, or resets once when it was held long enough.
    fn left_button(&mut self, down: bool, seconds: f64) {
        let before = self.held_for;
        self.held_for = down.then(|| before.map_or(0.0, |before| before + seconds));
        match (before, self.held_for) {
            (Some(before), None) if before < RESETS => self.undo(),
            (Some(before), Some(now)) if before < RESETS && now >= RESETS => {
                self.feedback.pulse(0, SNAP);
                self.reset();
            }
            (Some(before), Some(now)) if before < SOON && now >= SOON => {
                self.feedback.say("Keep holding to reset");
            }
            _ => {}
        }
    }

    /// Takes a plane into the right hand, leaves it where it is, and takes it away, in turn.
    fn right_button(&mut self, hand: &Hand) {
        let planes = &self.state.clip.planes;
        if self.cutting {
            self.cutting = false;
            if let Some(grip) = hand.grip.filter(|_| planes.len() < MOST_PLANES) {
                let plane = self.plane(&grip);
                self.state.clip.planes.push(standing(&plane));
                self.feedback.say("Cutting plane fixed");
            }
        } else if self.state.clip.planes.pop().is_some() {
            self.feedback.say("Cutting plane off");
        } else if self.state.clip.planes().len() < PLANES {
            self.cutting = true;
            self.feedback.say("Cutting plane in the hand");
        }
    }

    /// Puts everything back: the patient where it stood, the last preset as it was chosen, objects and planes
    /// as at the start. It can be undone.
    pub fn reset(&mut self) {
        let (mut objects, clip, edges) = self.first.clone();
        // A function that the user has chosen for all of them stays, too.
        if !UsualLook::has_function(&self.base.name) {
            objects.iter_mut().filter(|object| object.has_usual_function()).for_each(|o| o.transfer = None);
        }
        let ViewState { transfer, objects: there, clip: planes, edges: now, .. } = &self.state;
        let there = (&self.placement, transfer, there, planes, now);
        if there == (&self.home, &self.base, &objects, &clip, &edges) && !self.cutting {
            self.feedback.say("Nothing to reset");
            return;
        }
        self.before.truncate(self.resets);
        self.before.push(self.placement);
        self.resets += 1;
        self.placement = self.home;
        (self.state.transfer, self.state.objects, self.state.clip) = (self.base.clone(), objects, clip);
        self.state.edges = edges;
        self.cutting = false;
        self.feedback.say("Reset; undo brings it back");
    }

    /// Goes one step back.
    pub fn undo(&mut self) {
        let step = self.history.undo(&self.step());
        self.go_to(step, "Undone", "Nothing to undo");
    }

    /// Goes one step forward again.
    pub fn redo(&mut self) {
        let step = self.history.redo(&self.step());
        self.go_to(step, "Done again", "Nothing to redo");
    }

    /// Returns true if there is a step to undo, and one to redo.
    pub fn can_go(&self) -> [bool; 2] {
        [self.history.can_undo(), self.history.can_redo()]
    }

    fn step(&self) -> Step {
        Step { edited: self.state.edited(), base: self.base.clone(), resets: self.resets }
    }

    /// Takes over a step of the history. The patient moves only if it passes a reset.
    fn go_to(&mut self, step: Option<Step>, done: &str, nothing: &str) {
        let Some(Step { edited, base, resets }) = step else {
            self.feedback.say(nothing);
            return;
        };
        match resets.cmp(&self.resets) {
            Ordering::Less => self.placement = self.before[resets],
            Ordering::Greater => self.placement = self.home,
            Ordering::Equal => {}
        }
        (self.base, self.resets) = (base, resets);
        self.state.restore(edited);
        self.feedback.say(done);
    }

    /// Notes what has changed as a step of the history, unless it is still changing.
    fn remember(&mut self, changing: bool) {
        let Step { edited, resets, .. } = self.history.now();
        if !changing && (self.resets != *resets || !self.state.is_edited_as(edited)) {
            self.history.observe(&self.step(), false);
        }
    }

    /// Moves the window with the thumbstick: sideways its width, up and down its level. Returns true if it
    /// moves.
    fn window(&mut self, hand: &Hand, seconds: f64) -> bool {
        let beyond = |v: f64| v.signum() * (v.abs() - RESTS).max(0.0) / (1.0 - RESTS);
        let (x, y) = (beyond(hand.stick.x), beyond(hand.stick.y));
        if (x, y) == (0.0, 0.0) {
            return false;
        }
        let [low, high] = self.state.transfer.window();
        let least = NARROWEST * (self.base.window()[1] - self.base.window()[0]);
        let half = 0.5 * ((high - low) * (x * 4.0 * PER_SECOND * seconds).exp()).max(least);
        let level = (low + high) * 0.5 + y * PER_SECOND * seconds * (self.range[1] - self.range[0]);
        self.state.edit_transfer(|state| state.transfer.set_window([level - half, level + half]));
        true
    }

    /// Takes a transfer function: a preset, a window or a file.
    pub fn choose(&mut self, name: &str) -> Result<()> {
        let chosen = Transfer::new(&load(name, self.range)?);
        self.state.edit_transfer(|state| state.transfer = chosen);
        self.base = self.state.transfer.clone();
        self.feedback.say(self.state.transfer.name.clone());
        Ok(())
    }

    /// Returns a plane across the hand, like a blade in it: everything to the left of it, as the hand sees
    /// it, is cut away.
    fn plane(&self, grip: &Pose) -> ClipPlane {
        let normal = self.placement.patient_direction(grip.orientation * DVec3::X);
        ClipPlane { normal, offset: normal.dot(self.placement.patient(grip.position)) }
    }

    /// Returns the cutting planes: those that stand, and the one in the hand with the place of the hand, mm RAS.
    pub fn planes(&self) -> Vec<(ClipPlane, Option<DVec3>)> {
        // The faces of a crop box are not among them.
        let standing = Clip { crop: None, ..self.state.clip.clone() };
        let standing = standing.planes().into_iter().map(|plane| (plane, None));
        standing.chain(self.cut.map(|(plane, at)| (plane, Some(at)))).collect()
    }

    /// Returns the name of the transfer function.
    pub fn preset(&self) -> &str {
        &self.state.transfer.name
    }
}

#[cfg(test)]
mod tests {
    use engine::splat::Object;
    use engine::transfer::preset;
    use engine::unit::Unit;
    use glam::{DQuat, DVec2};

    use crate::headset::Pulse;

    use super::*;
    use crate::start::view_of;

    const FRAME: f64 = 1.0 / 72.0;

    fn controls() -> Controls {
        let head = Pose { position: DVec3::new(0.0, 1.6, 0.0), ..Pose::IDENTITY };
        let look = Look::new(preset("CT-Bone").expect("a preset").over([-1000.0, 2000.0]));
        let objects = [3, 7].map(|number| Object { number, name: format!("label {number}"), splats: 1 });
        let start = view_of(&look, &objects, [-1000.0, 2000.0]);
        Controls::new(Placement::before(&head, DVec3::ZERO, 100.0), start)
    }

    /// Returns the new look after a frame, if there is one.
    fn update(c: &mut Controls, hands: &Hands) -> Option<Look> {
        c.act(hands, FRAME).expect("no error");
        c.new_look().expect("no error")
    }

    /// Presses the left second button for some frames and lets go.
    fn press_left(c: &mut Controls, frames: usize) -> Option<Look> {
        let down = [Hand { other: true, ..Hand::default() }, Hand::default()];
        let looks: Vec<_> = (0..frames).map(|_| update(c, &down)).collect();
        let last = update(c, &[Hand::default(); 2]);
        looks.into_iter().chain([last]).flatten().last()
    }

    /// Frames of a press that undoes, and of one that resets.
    const SHORT: usize = 5;
    const LONG: usize = 90;

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
            assert!(update(&mut c, &[idle, at(x, squeeze)]).is_none());
            let moved = c.placement.position - start.position;
            assert!((moved - DVec3::X * expect).length() < 1e-9, "{squeeze} at {x}: {moved}");
        }
    }

    #[test]
    fn a_session_has_where_the_patient_was_left() {
        let mut c = controls();
        assert_eq!(c.session().headset, None, "where it was placed");
        let home = c.placement;
        let idle = Hand::default();
        let _ = [0.0, 0.25].map(|x| update(&mut c, &[idle, at(x, 1.0)]));
        let place = c.session().headset.expect("it was carried");
        assert!((place.moved_m.length() - 0.25).abs() < 1e-9 && place.scale == 1.0, "{place:?}");
        // The next session begins there, and has the same numbers as long as nobody moves it.
        let mut again = controls();
        again.state.headset = Some(place);
        assert_eq!(again.session().headset, Some(place), "also before the head is known");
        again.place(home);
        assert!(again.placement.position.distance(home.position + DVec3::X * 0.25) < 1e-9);
        assert_eq!(again.session().headset, Some(place));
        // After recentring it stands where it was placed first.
        again.place(home);
        assert_eq!((again.placement, again.session().headset), (home, None));
    }

    #[test]
    fn a_function_that_is_chosen_is_for_all_objects_also_after_a_reset() {
        let mut c = controls();
        let usual = UsualLook::of_objects(["liver", "aorta"].into_iter(), &[], Unit::Hu);
        c.state.take_usual_look(&usual);
        let mut c = Controls::new(
            c.placement,
            Start {
                state: c.state,
                numbers: vec![3, 7],
                range: [-1000.0, 2000.0],
                unit: " HU",
                has_region: false,
            },
        );
        let own = |c: &Controls| c.look().expect("a look").functions.len();
        assert_eq!(own(&c), 2);
        c.state.objects[0].visible = false;
        c.reset();
        assert!(own(&c) == 2 && c.state.objects[0].visible, "as at the start");
        c.choose("CT-Bone").expect("a preset");
        assert_eq!((own(&c), c.preset()), (0, "CT-Bone"));
        c.state.objects[0].visible = false;
        c.reset();
        assert_eq!((own(&c), c.preset(), c.state.objects[0].visible), (0, "CT-Bone", true));
        assert!(c.state.objects.iter().all(|object| object.tint.is_some()), "colours stay");
    }

    #[test]
    fn two_hands_stretch_and_nothing_jumps_when_one_lets_go() {
        let mut c = controls();
        update(&mut c, &[at(-0.1, 1.0), at(0.1, 1.0)]);
        assert_eq!(c.placement.scale, 1.0);
        update(&mut c, &[at(-0.2, 1.0), at(0.2, 1.0)]);
        assert!((c.placement.scale - 2.0).abs() < 1e-9);
        let before = c.placement;
        update(&mut c, &[at(-0.2, 0.0), at(0.5, 1.0)]);
        assert_eq!(c.placement, before);
    }

    #[test]
    fn a_button_counts_once_however_long_it_is_held() {
        let mut c = controls();
        let first = c.preset().to_owned();
        let down = Hand { next: true, ..Hand::default() };
        let up = Hand::default();
        assert!(update(&mut c, &[up, down]).is_some());
        let second = c.preset().to_owned();
        assert_ne!(first, second);
        assert!(update(&mut c, &[up, down]).is_none());
        update(&mut c, &[up, up]);
        update(&mut c, &[down, up]);
        assert_eq!(c.preset(), first, "the left hand goes back");
    }

    #[test]
    fn the_stick_moves_the_window_and_reset_puts_everything_back() {
        let mut c = controls();
        let start = (c.placement, c.state.transfer.window());
        let stick = Hand { stick: DVec2::new(0.1, 1.0), ..Hand::default() };
        let look = (0..72).map(|_| update(&mut c, &[Hand::default(), stick])).last();
        let moved = look.flatten().expect("it changed").transfer.extent();
        for side in 0..2 {
            assert!(
                (moved[side] - start.1[side] - 750.0).abs() < 1e-6,
                "a quarter of 3000 HU in a second: {moved:?}"
            );
        }
        update(&mut c, &[Hand::default(), at(0.0, 1.0)]);
        update(&mut c, &[Hand::default(), at(0.4, 1.0)]);
        assert_ne!(c.placement, start.0);
        let look = press_left(&mut c, LONG).expect("it changed");
        assert_eq!((c.placement, look.transfer.extent()), start);
    }

    #[test]
    fn what_is_edited_elsewhere_is_shown_and_put_back() {
        let mut c = controls();
        let idle = [Hand::default(); 2];
        assert!(update(&mut c, &idle).is_none());
        c.state.objects[1].visible = false;
        let look = update(&mut c, &idle).expect("it changed");
        assert!(look.objects[&3].visible && !look.objects[&7].visible);
        assert!(update(&mut c, &idle).is_none(), "once");
        let look = press_left(&mut c, LONG).expect("it changed");
        assert!(look.objects[&7].visible);
    }

    #[test]
    fn a_short_press_undoes_and_a_long_one_resets_and_both_can_be_undone() {
        let mut c = controls();
        assert!(
            press_left(&mut c, SHORT).is_none() && c.feedback.notice.as_deref() == Some("Nothing to undo")
        );
        let home = c.placement;
        c.choose("CT-Lung").expect("a preset");
        update(&mut c, &[Hand::default(); 2]);
        // A window that the stick moves for half a second is one step.
        let stick = Hand { stick: DVec2::new(0.0, 1.0), ..Hand::default() };
        (0..36).for_each(|_| _ = update(&mut c, &[Hand::default(), stick]));
        update(&mut c, &[Hand::default(); 2]);
        let moved = c.state.transfer.window();
        update(&mut c, &[Hand::default(), at(0.0, 1.0)]);
        update(&mut c, &[Hand::default(), at(0.4, 1.0)]);
        update(&mut c, &[Hand::default(); 2]);
        let carried = c.placement;
        assert_ne!(carried, home);
        press_left(&mut c, LONG);
        assert_eq!((c.placement, c.preset()), (home, "CT-Lung"));
        assert_ne!(c.state.transfer.window(), moved);
        press_left(&mut c, SHORT);
        assert_eq!((c.placement, c.state.transfer.window()), (carried, moved), "the reset is undone");
        c.redo();
        assert_eq!(c.placement, home, "and done again");
        c.undo();
        press_left(&mut c, SHORT);
        assert_ne!(c.state.transfer.window(), moved);
        assert_eq!((c.placement, c.preset()), (carried, "CT-Lung"), "undo does not move the patient");
        press_left(&mut c, SHORT);
        assert_eq!((c.preset(), c.can_go()), ("CT-Bone", [false, true]));
    }

    #[test]
    fn two_hands_snap_to_real_size_and_go_on_from_there() {
        let mut c = controls();
        let held = |half: f64| [at(-half, 1.0), at(half, 1.0)];
        update(&mut c, &held(0.1));
        assert_eq!(c.feedback.pulses, [(0, GRAB), (1, GRAB)]);
        update(&mut c, &held(0.05));
        assert!((c.placement.scale - 0.5).abs() < 1e-9);
        c.feedback = Feedback::default();
        update(&mut c, &held(0.097));
        assert_eq!(c.placement.scale, 1.0, "0.97 is near enough");
        assert_eq!(c.feedback.pulses, [(0, SNAP), (1, SNAP)]);
        update(&mut c, &held(0.098));
        assert_eq!((c.placement.scale, c.feedback.pulses.len()), (1.0, 2), "it is told once");
        update(&mut c, &held(0.12));
        assert!((c.placement.scale - 1.2).abs() < 1e-9, "nothing is lost: {}", c.placement.scale);
        let is_sound = |p: &Pulse| (0.0..=1.0).contains(&p.strength) && p.seconds < 0.2;
        assert!([GRAB, SNAP].iter().all(is_sound));
    }

    #[test]
    fn a_plane_is_taken_left_and_taken_away() {
        let mut c = controls();
        let right = |x: f64, other: bool| [Hand::default(), Hand { other, ..at(x, 0.0) }];
        update(&mut c, &right(0.05, true));
        update(&mut c, &right(0.05, false));
        let look = update(&mut c, &right(0.1, true)).expect("it stays there");
        assert!(look.clip.len() == 1 && (look.clip[0].offset - 100.0).abs() < 1e-9);
        assert!(update(&mut c, &right(0.3, false)).is_none(), "the hand goes without it");
        assert_eq!(c.planes(), [(look.clip[0], None)]);
        let look = update(&mut c, &right(0.3, true)).expect("it is taken away");
        assert!(look.clip.is_empty() && c.planes().is_empty());
        update(&mut c, &right(0.3, false));
        let look = press_left(&mut c, SHORT).expect("it is back");
        assert_eq!(look.clip.len(), 1);
    }

    #[test]
    fn the_hand_cuts_where_it_is() {
        let mut c = controls();
        let hand = Hand { other: true, ..at(0.05, 0.0) };
        let look = update(&mut c, &[Hand::default(), hand]).expect("it changed");
        let plane = look.clip[0];
        // Room x is the patient's -x: 5 cm to the viewer's right are 50 mm to the patient's left.
        assert!(
            (plane.normal - DVec3::NEG_X).length() < 1e-9 && (plane.offset - 50.0).abs() < 1e-9,
            "{plane:?}"
        );
        let moved = update(&mut c, &[Hand::default(), at(0.1, 0.0)]).expect("it follows");
        assert!((moved.clip[0].offset - 100.0).abs() < 1e-9);
    }
}
