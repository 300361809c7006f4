//! The session of a headset: its state, its events, its frames, and its description.

use engine::gpu::Format;
use engine::{Error, Kind, Result};

/// A frame to come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timing {
    /// Time at which it will be seen.
    pub display_ns: i64,
    /// Time from this frame to the next.
    pub period_ns: i64,
    /// True if anybody will see it.
    pub visible: bool,
}

/// State of a session.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SessionState {
    /// The headset is not used, or another program uses it.
    Idle,
    /// Frames are wanted, though nobody sees them yet.
    Synchronized,
    /// Frames are seen.
    Visible,
    /// Frames are seen, and hands act on them.
    Focused,
    /// No frames are wanted any more.
    Stopping,
    /// The headset asks to end.
    Over,
    /// The headset is lost: the runtime ends or is replaced.
    Lost,
}

/// An event of a session.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// The session has reached another state.
    State(SessionState),
    /// The viewer has chosen a new middle of the room.
    Recentred,
    /// The display has changed to this number of frames a second.
    Rate(f64),
    /// Lenses now hide another part of the pictures.
    Lenses,
}

/// Background behind the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Blend {
    /// No background of the headset; the picture has one of its own.
    Opaque,
    /// The room, to which the picture is added.
    Additive,
    /// The room, where the picture is transparent.
    Alpha,
}

/// What a user wants behind the picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Background {
    /// The first choice of the headset.
    #[default]
    Any,
    /// This one.
    This(Blend),
    /// The room, however the headset shows it.
    Room,
}

/// What is behind the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Backdrop {
    /// How the picture is drawn over it.
    pub blend: Blend,
    /// True if the room is a layer of its own below the picture.
    pub layer: bool,
}

impl Background {
    /// Chooses among what a headset offers, its first choice first; `layer` says that it has a layer of the
    /// room. A room is best seen where the picture is transparent; what is added to it looks like a ghost.
    ///
    /// # Errors
    /// [`Kind::Usage`] if it does not have what is wanted, [`Kind::Unavailable`] if it shows no room.
    pub fn choose(self, offered: &[Blend], layer: bool) -> Result<Backdrop> {
        let of = |blend| Backdrop { blend, layer: false };
        let has = |blend| offered.contains(&blend);
        let names: Vec<_> = offered.iter().map(|blend| format!("{blend:?}").to_lowercase()).collect();
        let names = names.join(", ");
        match self {
            Background::Any => Ok(of(offered.first().copied().unwrap_or(Blend::Opaque))),
            Background::This(blend) if has(blend) => Ok(of(blend)),
            Background::This(blend) => {
                let wanted = format!("{blend:?}").to_lowercase();
                let message = format!("this headset has no {wanted} background");
                Err(Error::new(Kind::Usage, "VGS-XR-009", message).help(format!("it has {names}")))
            }
            Background::Room if has(Blend::Alpha) => Ok(of(Blend::Alpha)),
            Background::Room if layer => Ok(Backdrop { blend: Blend::Alpha, layer }),
            Background::Room if has(Blend::Additive) => Ok(of(Blend::Additive)),
            Background::Room => {
                let message = "this headset's runtime has no passthrough";
                Err(Error::new(Kind::Unavailable, "VGS-XR-028", message).help(format!(
                    "it has {names}, and no XR_FB_passthrough; allow passthrough in its settings, or leave \
                     --passthrough out"
                )))
            }
        }
    }
}

/// Properties that do not change as long as a session lasts.
#[derive(Clone, Debug)]
pub struct Description {
    /// Name and version of the runtime.
    pub runtime: String,
    /// Name of the device.
    pub system: String,
    /// Width and height of the pictures of an eye, pixels.
    pub eye_size: [u32; 2],
    /// Format of the pictures.
    pub format: Format,
    /// Background behind the picture.
    pub blend: Blend,
    /// Frames a second, if the runtime tells it before the first frame.
    pub rate_hz: Option<f64>,
    /// True if it takes the depth of an eye's picture, to move the picture with the head.
    pub depth: bool,
    /// True if it tells what its lenses hide.
    pub lenses: bool,
    /// Extensions in use.
    pub extensions: Vec<&'static str>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_room_is_shown_however_the_headset_can() {
        use Blend::{Additive, Alpha, Opaque};
        let room = |offered: &[Blend], layer| Background::Room.choose(offered, layer).map_err(|e| e.code);
        let of = |blend, layer| Ok(Backdrop { blend, layer });
        assert_eq!(room(&[Opaque, Additive, Alpha], true), of(Alpha, false));
        assert_eq!(room(&[Opaque, Additive], true), of(Alpha, true));
        assert_eq!(room(&[Additive], false), of(Additive, false));
        assert_eq!(room(&[Opaque], true), of(Alpha, true));
        assert_eq!(room(&[Opaque], false), Err("VGS-XR-028"));
        let error = Background::Room.choose(&[Opaque], false).expect_err("no room");
        assert!(error.help.contains("opaque") && error.help.contains("--passthrough"), "{}", error.help);
    }

    #[test]
    fn a_background_is_the_first_one_or_the_one_that_is_wanted() {
        use Blend::{Additive, Alpha, Opaque};
        let blend = |wanted: Background| {
            wanted.choose(&[Additive, Opaque], true).map(|behind| behind.blend).map_err(|e| e.code)
        };
        assert_eq!(blend(Background::Any), Ok(Additive));
        assert_eq!(blend(Background::This(Opaque)), Ok(Opaque));
        assert_eq!(blend(Background::This(Alpha)), Err("VGS-XR-009"));
    }
}
