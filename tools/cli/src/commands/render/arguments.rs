//! Flags of `vgs render`.

use std::path::PathBuf;

use clap::{ArgGroup, Args};
use engine::image::file;
use engine::render::{FOV_DEGREES, ObjectChange, Precision, mode};
use engine::volume::BetweenSlices;
use engine::volume::edges::Edges;
use engine::{Error, Kind, Result};

use super::values::{self, GradientOpacity, PictureSize};
use crate::shared::flags::{Clip, DeviceArguments, between_slices, bytes, on_off, pair};
use crate::shared::inputs::{CleaningArguments, ReadArguments};
use crate::shared::light::{self, LightArguments};
use crate::shared::viewing::{Background, View, degrees, zoom};

/// Renders splats or a volume through a transfer function
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES)]
pub struct RenderArguments {
    /// The splats (PLY); several files are shown together, in the space of the patient. Or a volume
    #[arg(required_unless_present = "volume", value_name = "SPLATS|VOLUME")]
    pub splats: Vec<PathBuf>,
    /// A volume: with --mode volume, or without splats, it is what is rendered. It also places splats of a
    /// PLY of the paper's authors, with its region
    #[arg(long, value_name = "VOLUME", help_heading = "Volume")]
    pub volume: Option<PathBuf>,
    /// What lies between thick slices of the volume: smooth, other slices, by a cubic and by the shape of the mask; or
    /// linear, nothing, with steps from slice to slice
    #[arg(long, value_name = "smooth|linear", default_value = "smooth", value_parser = between_slices,
          help_heading = "Volume")]
    pub between_slices: BetweenSlices,
    /// Edges of a binary region: how far they may move from where the mask has them, mm, to be smooth; 0: each voxel stays
    /// inside or outside; voxel: blocks, as the mask has them
    #[arg(long, value_name = "voxel|MM", default_value_t, help_heading = "Picture")]
    pub edges: Edges,
    #[command(flatten)]
    pub region: VolumeRegion,
    #[command(flatten)]
    pub read: ReadArguments,
    #[command(flatten)]
    pub output: OutputArguments,
    /// How it is rendered; by default decoded for fits for a grid, slab for other splats, volume for a volume
    #[arg(long, value_name = "MODE", help_heading = "Picture", value_parser = mode_name)]
    pub mode: Option<&'static str>,
    /// Transfer function: a preset, a file (.vp, .vp.json, .xml:NAME, ParaView .json), or window:WIDTH,LEVEL [default:
    /// CT-Bone, or MR-Default without HU, or a preset that shows more; of several objects, one for the kind of each]
    #[arg(long, value_name = "PRESET|FILE", help_heading = "Picture")]
    pub tf: Option<String>,
    /// Moves the transfer function along the intensities, HU
    #[arg(
        long,
        value_name = "HU",
        default_value_t = 0.0,
        allow_negative_numbers = true,
        help_heading = "Picture"
    )]
    pub tf_shift: f64,
    /// Lights surfaces, or not; as the transfer function says by default
    #[arg(long, value_name = "on|off", help_heading = "Picture", value_parser = on_off)]
    pub shade: Option<bool>,
    /// Darkens crevices, in modes volume and decoded: the share of the light that is lost where all around is opaque
    /// (ambient occlusion), 0 to 1; as the transfer function says by default, which is none
    #[arg(long, value_name = "SHARE", help_heading = "Picture", value_parser = light::share)]
    pub occlusion: Option<f64>,
    /// Shows what changes, in modes volume and decoded: nothing where the gradient is below LOW, all from HIGH on, in HU
    /// over a mean voxel edge; or none, for the transfer function without the gradient opacity that its file has
    #[arg(long, value_name = "LOW,HIGH|none", help_heading = "Picture", value_parser = values::gradient_opacity)]
    pub gradient_opacity: Option<GradientOpacity>,
    #[command(flatten)]
    pub light: LightArguments,
    /// Colours surfaces by their error against --volume, in its region if one is given: blue where the splats are too low,
    /// red where they are too high; in mode decoded
    #[arg(long, help_heading = "Picture", conflicts_with_all = ["object", "object_colours"])]
    pub error: bool,
    /// Error at which these colours end, HU [default: a round number that 99 % of the voxels stay below]
    #[arg(long, value_name = "HU", requires = "error", help_heading = "Picture", value_parser = values::above_zero)]
    pub error_range: Option<f64>,
    /// From where: a side (anterior, left, superior ..., or several as anterior-left), or a file with eye_mm,
    /// target_mm, up, fov_deg
    #[arg(long, value_name = "SIDE|FILE.json", default_value = "anterior", help_heading = "Picture")]
    pub camera: View,
    /// Field of view from the upper to the lower edge, degrees, for a camera that is a side
    #[arg(long, value_name = "DEGREES", default_value_t = FOV_DEGREES, help_heading = "Picture",
          value_parser = degrees)]
    pub fov: f64,
    /// How near a camera that is a side comes: 1 shows all, 2 half of it
    #[arg(long, value_name = "TIMES", default_value_t = 1.0, help_heading = "Picture", value_parser = zoom)]
    pub zoom: f64,
    /// Pixels, or the size in print: 85x60mm, 3.3x2.4in
    #[arg(long, value_name = "WIDTHxHEIGHT", default_value = "1024x1024", help_heading = "Picture")]
    pub size: PictureSize,
    /// Pixels per inch, which the PNG tells to programs that print it [default: 300 for a --size in mm or in]
    #[arg(long, value_name = "N", help_heading = "Picture", value_parser = values::dpi)]
    pub dpi: Option<f64>,
    /// Behind everything: black, white, grey, #rrggbb, or transparent
    #[arg(long, value_name = "COLOUR", default_value = "black", help_heading = "Picture")]
    pub background: Background,
    /// Cuts away: x<MM, x>MM (patient RAS; also y and z), box:X0,Y0,Z0,X1,Y1,Z1 keeps a box; may be repeated
    #[arg(long, value_name = "PLANE|BOX", allow_hyphen_values = true, help_heading = "Picture")]
    pub clip: Vec<Clip>,
    /// How an object is shown, by name, number, range (1-24) or pattern (rib_*): colour=#rrggbb, opacity=0..1 (a factor of the opacity per
    /// mm), tf=CT-Bone (a transfer function of its own), hidden. Each file is an object, or each of its labels;
    /// may be repeated
    #[arg(long, value_name = "NAME|N:HOW,...", help_heading = "Picture")]
    pub object: Vec<ObjectChange>,
    /// Gives each object its usual colour although --tf is given: the one for its name, as kidney_left or aorta, or
    /// the next of a few that are easily told apart. --object changes single ones
    #[arg(long, help_heading = "Picture")]
    pub object_colours: bool,
    /// Hides objects, chosen as by --object: --hide-label ribs,5 is --object ribs:hidden --object 5:hidden
    #[arg(long, value_name = "N|NAME|...", value_delimiter = ',', help_heading = "Picture")]
    pub hide_label: Vec<String>,
    /// Letters at the edges: which way is right, left, anterior, posterior, superior, inferior
    #[arg(long, help_heading = "Picture")]
    pub orientation: bool,
    /// A bar of a round length in mm, true in the plane through the middle of the scene
    #[arg(long, help_heading = "Picture")]
    pub scale_bar: bool,
    /// A bar of the colours of the intensities that the transfer function shows
    #[arg(long, help_heading = "Picture")]
    pub colour_bar: bool,
    /// Steps along a ray: standard deviations of the splats or, in modes volume and decoded, voxels where something
    /// shows; smaller is finer [default: 0.2 in modes volume and decoded, 0.5 in mode slab]
    #[arg(long, value_name = "N", help_heading = "Quality", value_parser = values::step)]
    pub step: Option<f64>,
    /// Steps where nothing shows, in modes volume and decoded, voxels, 0.01 to 2 [default: four of --step, but 1 to 1.5]
    #[arg(long, value_name = "VOXELS", help_heading = "Quality", value_parser = values::cell)]
    pub cell: Option<f64>,
    /// Voxels from one sample of mode decoded to the next: 1 is the grid that the splats were fitted on; 0.5
    /// is finer, for fits of --profile field; 2, 4, 8 and 16 of other fits are means of voxels
    #[arg(long, value_name = "VOXELS", default_value_t = 1.0, help_heading = "Quality",
          value_parser = values::pitch)]
    pub pitch: f64,
    /// How the transfer function is applied: point, pre-integrated, or auto
    #[arg(long, value_name = "WAY", default_value = "auto", help_heading = "Quality",
          value_parser = values::classification)]
    pub classification: values::Classified,
    /// How splats are kept on the device: full (48 bytes each) or packed (16 bytes)
    #[arg(long, value_name = "full|packed", default_value = "full", help_heading = "Quality",
          value_parser = values::precision)]
    pub precision: Precision,
    /// Renders at most so many splats: the most important ones of those that can be seen
    #[arg(long, value_name = "N", help_heading = "Quality", value_parser = clap::value_parser!(u32).range(1..))]
    pub splat_budget: Option<u32>,
    /// Most memory of the device that mode decoded takes for the field, as 64M or 2G: what is far or out of sight is shown
    /// coarser where that is too little
    #[arg(long, value_name = "BYTES", help_heading = "Quality", value_parser = bytes)]
    pub field_memory: Option<u64>,
    #[command(flatten)]
    pub turntable: TurntableArguments,
    #[command(flatten)]
    pub device: DeviceArguments,
}

/// Flags of the region of the volume.
#[derive(Args, Clone, Debug)]
#[group(skip)]
#[command(next_help_heading = "Volume", group = ArgGroup::new("shown").args(["roi", "roi_threshold"]))]
pub struct VolumeRegion {
    /// Shows nothing of the volume outside this mask
    #[arg(long, value_name = "MASK")]
    pub roi: Option<PathBuf>,
    /// Or outside the voxels from LOW to HIGH, HU
    #[arg(long, value_name = "LOW,HIGH", value_parser = pair, allow_hyphen_values = true)]
    pub roi_threshold: Option<[f32; 2]>,
    /// Which labels of the mask, by number or name
    #[arg(long, value_name = "N|NAME|...", requires = "roi")]
    pub roi_label: Option<String>,
    #[command(flatten)]
    pub cleaning: CleaningArguments,
}

/// Flags of the output files.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Output")]
pub struct OutputArguments {
    /// Where the picture goes: .png, or .exr for floats and depth
    #[arg(short, long, value_name = "FILE.png|FILE.exr")]
    pub output: PathBuf,
    /// Replaces outputs that exist
    #[arg(short, long)]
    pub force: bool,
}

/// Flags of a turn around the scene.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Turntable")]
pub struct TurntableArguments {
    /// Turns once around the patient's long axis in so many frames: an animated PNG
    #[arg(long, value_name = "FRAMES", value_parser = clap::value_parser!(u32).range(2..=3600))]
    pub turntable: Option<u32>,
    /// Frames per second of the animation
    #[arg(long, value_name = "N", default_value_t = 15, value_parser = clap::value_parser!(u16).range(1..=120))]
    pub fps: u16,
    /// One file a frame (NAME-000.png ...) instead of an animation
    #[arg(long, requires = "turntable")]
    pub sequence: bool,
}

impl OutputArguments {
    /// Returns the files that will be written.
    pub fn files(&self, turntable: &TurntableArguments) -> Result<Vec<PathBuf>> {
        let format = file::of_extension(&self.output)?;
        match turntable.turntable {
            Some(count) if turntable.sequence => Ok((0..count).map(|i| self.numbered(i, count)).collect()),
            Some(_) if format.depth => Err(Error::new(Kind::Usage, "VGS-CLI-093", "an animation is a PNG")
                .file(&self.output)
                .help("choose a name that ends in .png, or --sequence for one file a frame")),
            _ => Ok(vec![self.output.clone()]),
        }
    }

    /// Returns true if the format can store depth.
    pub fn wants_depth(&self) -> bool {
        file::of_extension(&self.output).is_ok_and(|f| f.depth)
    }

    /// Returns the file of one frame of a sequence.
    pub fn numbered(&self, index: u32, count: u32) -> PathBuf {
        let digits = (count - 1).to_string().len().max(3);
        let name = self.output.file_stem().unwrap_or_default().to_string_lossy();
        let ending = self.output.extension().unwrap_or_default().to_string_lossy();
        self.output.with_file_name(format!("{name}-{index:0digits$}.{ending}"))
    }
}

const EXAMPLES: &str = "\
Examples:
  vgs render bones.ply -o bones.png
  vgs render bones.ply -o bones.png --tf CT-Bones-Steep --camera left --orientation --scale-bar
  vgs render bones.ply -o figure.png --size 85x60mm --dpi 300 --background white --scale-bar --colour-bar
  vgs render body.ply -o soft.exr --tf CT-Soft-Tissue --clip 'y>20'
  vgs render bones.ply vessels.ply -o both.png --object vessels:colour=#c03020 --object bones:opacity=0.2
  vgs render organs.ply -o organs.png                     each label in its usual colour
  vgs render organs.ply -o organs.png --tf CT-Soft-Tissue --object-colours
  vgs render body.ply -o body.png --tf CT-Soft-Tissue --object bones:tf=CT-Bone
  vgs render ct.nii.gz --roi bones.nii.gz -o ct.png --tf CT-Bone
  vgs render bones.ply -o bones.png --headlight --shininess 40
  vgs render bones.ply -o bones.png --light-direction 30,45 --fill-light 0.3
  vgs render bones.ply --error --volume ct.nii.gz --roi bones.nii.gz -o error.png
  vgs render bones.ply -o turn.png --turntable 60
  vgs render bones.ply -o frame.png --turntable 60 --sequence
  vgs render theirs.ply --volume ct.nii.gz --roi bones.nii.gz -o theirs.png      a PLY of the paper's authors
  vgs compare ct.png bones.png --diff difference.png

Modes:
  volume  the CT itself, ray-marched: the reference
  exact   the splats' field in very fine steps: what the other modes are measured against
  slab    the splats' field in slabs, classified after it is added up (the default)
  decoded the splats' field on the CT's own voxels, put there once, ray-marched as those; the default
          of splats fitted for these voxels (vgs fit --form grid)
  alpha   sorted splats of one colour each: the fastest, and the only one for splats without intensities

Colours are display-referred, as those of VTK and Slicer. For looking, not for diagnosis.";

fn mode_name(text: &str) -> std::result::Result<&'static str, String> {
    mode(text).map(|row| row.name).map_err(|e| format!("{e}; {}", e.help))
}
