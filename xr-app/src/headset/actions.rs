//! Hands through OpenXR: actions, and their bindings on the controllers that people have.

use engine::Result;
use glam::DVec2;
use openxr as xr;

use super::convert::{place_of, pose_of};
use super::error::runtime_error;
use super::hands::{Hand, Hands, JOINTS, Joint, Pulse};

/// Paths of the two hands.
const HANDS: [&str; 2] = ["/user/hand/left", "/user/hand/right"];

/// The bindings of the actions on a controller, below the hand's path; the same for both hands, or one for
/// each.
struct Profile {
    path: &'static str,
    /// True if it needs XR_EXT_hand_interaction.
    hands: bool,
    squeeze: &'static str,
    select: Option<&'static str>,
    stick: Option<&'static str>,
    next: [Option<&'static str>; 2],
    other: [Option<&'static str>; 2],
    panel: [Option<&'static str>; 2],
    /// True if it can vibrate.
    haptic: bool,
}

const NONE: [Option<&str>; 2] = [None; 2];
/// The press of the thumbstick, for controllers on which it is free for the panel.
const STICK: [Option<&str>; 2] = [Some("input/thumbstick/click"); 2];

/// Path of the profile of hands without controllers.
const BARE: &str = "/interaction_profiles/ext/hand_interaction_ext";

/// All profiles. On a controller with one button, that button grabs, and clicks on the panel.
const PROFILES: [Profile; 5] = [
    Profile {
        path: "/interaction_profiles/khr/simple_controller",
        hands: false,
        squeeze: "input/select/click",
        select: Some("input/select/click"),
        stick: None,
        next: [None, Some("input/menu/click")],
        other: NONE,
        panel: [Some("input/menu/click"), None],
        haptic: true,
    },
    Profile {
        path: "/interaction_profiles/oculus/touch_controller",
        hands: false,
        squeeze: "input/squeeze/value",
        select: Some("input/trigger/value"),
        stick: Some("input/thumbstick"),
        next: [Some("input/x/click"), Some("input/a/click")],
        other: [Some("input/y/click"), Some("input/b/click")],
        panel: STICK,
        haptic: true,
    },
    Profile {
        path: "/interaction_profiles/valve/index_controller",
        hands: false,
        squeeze: "input/squeeze/value",
        select: Some("input/trigger/value"),
        stick: Some("input/thumbstick"),
        next: [Some("input/a/click"); 2],
        other: [Some("input/b/click"); 2],
        panel: STICK,
        haptic: true,
    },
    Profile {
        path: "/interaction_profiles/microsoft/motion_controller",
        hands: false,
        squeeze: "input/squeeze/click",
        select: Some("input/trigger/value"),
        stick: Some("input/thumbstick"),
        next: [Some("input/trackpad/click"); 2],
        other: [Some("input/menu/click"); 2],
        panel: STICK,
        haptic: true,
    },
    Profile {
        path: BARE,
        hands: true,
        squeeze: "input/grasp_ext/value",
        select: Some("input/pinch_ext/value"),
        stick: None,
        next: NONE,
        other: NONE,
        panel: NONE,
        haptic: false,
    },
];

/// The actions of both hands.
pub(super) struct Actions {
    set: xr::ActionSet,
    hands: [xr::Path; 2],
    /// Profile of hands without controllers, if the runtime knows it.
    bare: Option<xr::Path>,
    grip: [xr::Space; 2],
    aim: [xr::Space; 2],
    squeeze: xr::Action<f32>,
    select: xr::Action<bool>,
    stick: xr::Action<xr::Vector2f>,
    next: xr::Action<bool>,
    other: xr::Action<bool>,
    panel: xr::Action<bool>,
    haptic: xr::Action<xr::Haptic>,
    /// Trackers of the joints of hands without controllers, where the headset has them.
    trackers: Option<[xr::HandTracker; 2]>,
}

impl Actions {
    /// Creates and binds the actions, for good: a session takes them once. `hand_interaction` says that the
    /// runtime knows hands without controllers, `hand_tracking` that it tells their joints.
    pub(super) fn new(
        instance: &xr::Instance,
        session: &xr::Session<xr::Vulkan>,
        hand_interaction: bool,
        hand_tracking: bool,
    ) -> Result<Self> {
        Self::make(instance, session, hand_interaction, hand_tracking)
            .map_err(|e| runtime_error("binding the controllers", e))
    }

    fn make(
        instance: &xr::Instance,
        session: &xr::Session<xr::Vulkan>,
        hand_interaction: bool,
        hand_tracking: bool,
    ) -> xr::Result<Self> {
        let set = instance.create_action_set("hands", "Hands", 0)?;
        let hands = [instance.string_to_path(HANDS[0])?, instance.string_to_path(HANDS[1])?];
        let grip = set.create_action::<xr::Posef>("grip", "Grip pose", &hands)?;
        let aim = set.create_action::<xr::Posef>("aim", "Aim pose", &hands)?;
        let squeeze = set.create_action::<f32>("grab", "Grab", &hands)?;
        let select = set.create_action::<bool>("select", "Select", &hands)?;
        let stick = set.create_action::<xr::Vector2f>("window", "Window and level", &hands)?;
        let next = set.create_action::<bool>("preset", "Previous and next preset", &hands)?;
        let other = set.create_action::<bool>("cut", "Undo and reset, and cut", &hands)?;
        let panel = set.create_action::<bool>("panel", "Show and hide the panel", &hands)?;
        let haptic = set.create_action::<xr::Haptic>("haptic", "Haptics", &hands)?;
        for profile in PROFILES.iter().filter(|p| !p.hands || hand_interaction) {
            let mut bindings = Vec::new();
            for (side, hand) in HANDS.iter().enumerate() {
                let path = |end: &str| instance.string_to_path(&format!("{hand}/{end}"));
                bindings.push(xr::Binding::new(&grip, path("input/grip/pose")?));
                bindings.push(xr::Binding::new(&aim, path("input/aim/pose")?));
                bindings.push(xr::Binding::new(&squeeze, path(profile.squeeze)?));
                if profile.haptic {
                    bindings.push(xr::Binding::new(&haptic, path("output/haptic")?));
                }
                if let Some(end) = profile.select {
                    bindings.push(xr::Binding::new(&select, path(end)?));
                }
                if let Some(end) = profile.stick {
                    bindings.push(xr::Binding::new(&stick, path(end)?));
                }
                for (action, ends) in
                    [(&next, profile.next), (&other, profile.other), (&panel, profile.panel)]
                {
                    if let Some(end) = ends[side] {
                        bindings.push(xr::Binding::new(action, path(end)?));
                    }
                }
            }
            match instance
                .suggest_interaction_profile_bindings(instance.string_to_path(profile.path)?, &bindings)
            {
                // A runtime may not know a controller; then nobody uses one there.
                Ok(()) | Err(xr::sys::Result::ERROR_PATH_UNSUPPORTED) => {}
                Err(e) => return Err(e),
            }
        }
        session.attach_action_sets(&[&set])?;
        let bare = hand_interaction.then(|| instance.string_to_path(BARE)).transpose()?;
        let tracker = |hand| session.create_hand_tracker(hand);
        let trackers = match hand_tracking {
            true => Some([tracker(xr::Hand::LEFT)?, tracker(xr::Hand::RIGHT)?]),
            false => None,
        };
        let space =
            |action: &xr::Action<xr::Posef>, hand| action.create_space(session, hand, xr::Posef::IDENTITY);
        Ok(Actions {
            grip: [space(&grip, hands[0])?, space(&grip, hands[1])?],
            aim: [space(&aim, hands[0])?, space(&aim, hands[1])?],
            set,
            hands,
            bare,
            squeeze,
            select,
            stick,
            next,
            other,
            panel,
            haptic,
            trackers,
        })
    }

    /// Returns what the hands do at a time; poses are in the space `room`.
    pub(super) fn hands(
        &self,
        session: &xr::Session<xr::Vulkan>,
        room: &xr::Space,
        time: xr::Time,
    ) -> Result<Hands> {
        self.read(session, room, time).map_err(|e| runtime_error("asking the controllers", e))
    }

    /// Lets the controller in a hand vibrate, if it can.
    pub(super) fn pulse(&self, session: &xr::Session<xr::Vulkan>, side: usize, pulse: &Pulse) -> Result<()> {
        let vibration = xr::HapticVibration::new()
            .amplitude(pulse.strength as f32)
            .frequency(xr::FREQUENCY_UNSPECIFIED)
            .duration(xr::Duration::from_nanos((pulse.seconds * 1e9) as i64));
        self.haptic
            .apply_feedback(session, self.hands[side], &vibration)
            .map_err(|e| runtime_error("letting a controller vibrate", e))
    }

    fn read(&self, session: &xr::Session<xr::Vulkan>, room: &xr::Space, time: xr::Time) -> xr::Result<Hands> {
        session.sync_actions(&[xr::ActiveActionSet::new(&self.set)])?;
        let mut out = [Hand::default(); 2];
        for (side, hand) in out.iter_mut().enumerate() {
            let at = self.hands[side];
            let pose = |space: &xr::Space| {
                let found = space.locate(room, time)?;
                let known =
                    xr::SpaceLocationFlags::POSITION_VALID | xr::SpaceLocationFlags::ORIENTATION_VALID;
                Ok(found.location_flags.contains(known).then(|| pose_of(&found.pose)))
            };
            let bare = match self.bare {
                Some(bare) => session.current_interaction_profile(at)? == bare,
                None => false,
            };
            let grip = pose(&self.grip[side])?;
            // With a controller in it, the joints of a hand are a guess.
            let tracker = self.trackers.as_ref().filter(|_| bare || grip.is_none());
            let joints = tracker.map(|trackers| joints(&trackers[side], room, time)).transpose()?.flatten();
            let stick = self.stick.state(session, at)?.current_state;
            *hand = Hand {
                grip,
                joints,
                aim: pose(&self.aim[side])?,
                squeeze: f64::from(self.squeeze.state(session, at)?.current_state),
                select: self.select.state(session, at)?.current_state,
                stick: DVec2::new(f64::from(stick.x), f64::from(stick.y)),
                next: self.next.state(session, at)?.current_state,
                other: self.other.state(session, at)?.current_state,
                panel: self.panel.state(session, at)?.current_state,
                bare,
            };
        }
        Ok(out)
    }
}

/// Returns the joints of a hand, if all of them are known.
fn joints(
    tracker: &xr::HandTracker,
    room: &xr::Space,
    time: xr::Time,
) -> xr::Result<Option<[Joint; JOINTS]>> {
    let Some(found) = room.locate_hand_joints(tracker, time)? else { return Ok(None) };
    let is_known =
        |joint: &xr::HandJointLocation| joint.location_flags.contains(xr::SpaceLocationFlags::POSITION_VALID);
    let joint = |joint: &xr::HandJointLocation| Joint {
        place: place_of(&joint.pose.position),
        radius: f64::from(joint.radius),
    };
    Ok(found.iter().all(is_known).then(|| found.each_ref().map(joint)))
}
