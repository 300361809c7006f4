//! The arguments of the command line.

use std::path::{Path, PathBuf};

use clap::{Parser, ValueEnum};
use engine::render::ObjectChange;
use engine::{Error, Kind, Result};

use crate::headset::{Background, Blend};
use crate::inputs::Wanted;
#[cfg(not(target_os = "android"))]
use crate::mirror::Shown;

/// Shows splats in a headset, through OpenXR
#[derive(Parser, Debug)]
#[command(name = "vgs-xr", version, after_help = EXAMPLES)]
pub struct HeadsetArguments {
    /// What is shown: splats (PLY), several of which become one scene, a volume, or a session (TOML)
    #[arg(required_unless_present_any = ["volume", "session"])]
    pub files: Vec<PathBuf>,
    /// The volume that the splats were fitted to; without splats it is shown itself
    #[arg(long, value_name = "VOLUME")]
    pub volume: Option<PathBuf>,
    /// Which series of a DICOM folder: its number in `vgs info`, its UID, or a part of its description
    #[arg(long, value_name = "N|TEXT")]
    pub series: Option<String>,
    /// Shows nothing of the volume outside this mask
    #[arg(long, value_name = "MASK")]
    pub roi: Option<PathBuf>,
    /// Transfer function: a preset, a file, or window:WIDTH,LEVEL [default: the session's, or CT-Bone; of several objects,
    /// one for the kind of each]
    #[arg(long, value_name = "PRESET|FILE")]
    pub tf: Option<String>,
    /// How an object is shown, by name or number: colour=#rrggbb, opacity=0..1 (a factor of the opacity per
    /// mm), hidden. Each file is an object, or each of its labels; may be repeated
    #[arg(long, value_name = "NAME|N:HOW,...")]
    pub object: Vec<ObjectChange>,
    /// Keeps what is made in the headset (distances, planes, objects, transfer function, place) in this session, and begins
    /// with it if it is there. Without this, what was made goes into a new file beside the splats
    #[arg(long, value_name = "FILE.toml")]
    pub session: Option<PathBuf>,
    /// The same without a headset: poses and clock follow a script
    #[arg(long)]
    pub simulated: bool,
    /// Ends after so many frames
    #[arg(long, value_name = "N")]
    pub frames: Option<u64>,
    /// What is behind the picture: the headset's first choice by default
    #[arg(long, value_enum)]
    pub blend: Option<Behind>,
    /// Shows the room behind the picture, however the headset can: where the picture is transparent, as a layer
    /// of its own (XR_FB_passthrough), or added to it
    #[arg(long, conflicts_with = "blend")]
    pub passthrough: bool,
    /// Frames a second, where the headset leaves the choice
    #[arg(long, value_name = "HZ")]
    pub rate: Option<f64>,
    /// Edges of the eyes' pictures, as a part of what the headset recommends
    #[arg(long, value_name = "PART", default_value_t = 1.0, value_parser = part)]
    pub resolution: f64,
    /// Renders all that the eyes see at fewer pixels and its middle at all of them, in pictures whose edges are such a part of
    /// the eyes': 0.5 renders less than half of the pixels
    #[arg(long, value_name = "PART", value_parser = inset)]
    pub foveation: Option<f64>,
    /// Device time that a frame may take; 9/10 of the display's period by default
    #[arg(long, value_name = "MS", value_parser = positive)]
    pub budget: Option<f64>,
    /// Stays on a quality level, 0 the best, instead of keeping to the budget
    #[arg(long, alias = "rung", value_name = "N")]
    pub level: Option<usize>,
    /// Device memory that may be used, MiB: splats are packed, and if need be only the most important ones are shown
    #[arg(long, value_name = "MIB", value_parser = positive)]
    pub memory_budget: Option<f64>,
    /// Shows the panel from the start
    #[arg(long)]
    pub panel: bool,
    /// Shows the card of what hands do at the start; without this, the first time that there is a headset
    #[arg(long, value_name = "WHEN", value_enum, num_args = 0..=1, require_equals = true, default_missing_value = "always")]
    pub card: Option<Card>,
    /// Shows what the eyes see in a window, too
    #[cfg(not(target_os = "android"))]
    #[arg(long, value_name = "EYES", value_enum, num_args = 0..=1, require_equals = true, default_missing_value = "both")]
    pub mirror: Option<Shown>,
    /// Writes what was measured (JSON)
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
    /// Writes what the left and the right eye saw last, side by side
    #[arg(long, value_name = "FILE.png")]
    pub picture: Option<PathBuf>,
    /// Replaces files
    #[arg(long)]
    pub force: bool,
    /// Device by index or part of its name, for --simulated; a headset is bound to its own
    #[arg(long, value_name = "DEVICE")]
    pub device: Option<String>,
    /// Turns on the validation layers of Vulkan, and fails if they have anything to say
    #[arg(long)]
    pub validation: bool,
}

const EXAMPLES: &str = "\
Examples:
  vgs-xr bones.ply
  vgs-xr body.ply --tf CT-Soft-Tissue --passthrough
  vgs-xr bones.ply vessels.ply --object vessels:colour=#c03020
  vgs-xr session.toml
  vgs-xr bones.ply --session plan.toml                    begins with it, and keeps it
  vgs-xr --volume ct.nii.gz --roi bones.nii.gz
  vgs-xr bones.ply --simulated --frames 300 --report session.json --picture eyes.png
  tools/monado cargo run -p vgs-xr -- bones.ply --frames 200

Hands: grab with one to move, with both to scale and turn. Right thumbstick: up and down the level, sideways the
width of the window. First button: next preset (right), last preset (left). Second button: a cutting plane in the
hand, then standing, then gone (right); undo, and held for a second everything back (left). Thumbstick pressed: the
panel, on which the trigger clicks; with its button Measure the trigger places ends of distances where the ray meets
the patient.

For looking, not for diagnosis.";

/// Whether the card of what hands do is shown at the start.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Card {
    /// Whether it was seen before or not
    Always,
    /// Nor the first time
    Never,
}

/// What is behind the picture.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Behind {
    /// A background
    Opaque,
    /// The room, to which the picture is added
    Additive,
    /// The room, where the picture is transparent
    Alpha,
}

impl From<Behind> for Blend {
    fn from(behind: Behind) -> Self {
        match behind {
            Behind::Opaque => Blend::Opaque,
            Behind::Additive => Blend::Additive,
            Behind::Alpha => Blend::Alpha,
        }
    }
}

fn part(text: &str) -> std::result::Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "a number is needed")?;
    if (0.05..=2.0).contains(&value) { Ok(value) } else { Err("0.05 to 2".into()) }
}

fn inset(text: &str) -> std::result::Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "a number is needed")?;
    if (0.1..=0.9).contains(&value) { Ok(value) } else { Err("0.1 to 0.9".into()) }
}

fn positive(text: &str) -> std::result::Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "a number is needed")?;
    if value > 0.0 && value.is_finite() { Ok(value) } else { Err("a number above 0 is needed".into()) }
}

impl HeadsetArguments {
    /// Returns what is wanted behind the picture.
    pub fn background(&self) -> Background {
        match self.blend {
            Some(blend) => Background::This(blend.into()),
            None if self.passthrough => Background::Room,
            None => Background::Any,
        }
    }

    /// Returns what is to be shown.
    pub fn wanted(&self) -> Wanted {
        Wanted {
            files: self.files.clone(),
            volume: self.volume.clone(),
            series: self.series.clone(),
            roi: self.roi.clone(),
            tf: self.tf.clone(),
            objects: self.object.clone(),
            session: self.session.clone(),
        }
    }

    /// Creates the arguments of a program without a command line: all splats (PLY) of a folder, in the order
    /// of their names, and the defaults.
    ///
    /// # Errors
    /// [`Kind::Missing`] if there are no splats.
    pub fn of_folder(folder: &Path) -> Result<Self> {
        let files =
            std::fs::read_dir(folder).into_iter().flatten().filter_map(|entry| Some(entry.ok()?.path()));
        let mut splats: Vec<PathBuf> = files
            .filter(|path| path.extension().is_some_and(|end| end.eq_ignore_ascii_case("ply")))
            .collect();
        splats.sort();
        let words = std::iter::once(PathBuf::from("vgs-xr")).chain(splats);
        Self::try_parse_from(words).map_err(|_| {
            Error::new(Kind::Missing, "VGS-XR-026", "there are no splats")
                .file(folder)
                .help("copy a PLY into this folder")
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arguments_are_sound() {
        use clap::CommandFactory as _;
        HeadsetArguments::command().debug_assert();
    }

    #[test]
    fn a_folder_gives_its_splats_by_name() {
        let folder = tempfile::tempdir().expect("a folder");
        let none = HeadsetArguments::of_folder(folder.path()).expect_err("no splats");
        assert_eq!((none.kind, none.code), (Kind::Missing, "VGS-XR-026"));
        for name in ["b.ply", "-a.PLY", "notes.txt", "ply"] {
            std::fs::write(folder.path().join(name), "").expect("a file");
        }
        let found = HeadsetArguments::of_folder(folder.path()).expect("splats");
        assert_eq!(found.files, ["-a.PLY", "b.ply"].map(|name| folder.path().join(name)));
        assert_eq!((found.tf.as_deref(), found.simulated, found.frames), (None, false, None));
        assert!(
            HeadsetArguments::of_folder(&folder.path().join("none")).is_err(),
            "a folder that is not there"
        );
    }
}
