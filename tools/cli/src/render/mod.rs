//! `vgs render`: pictures of splats, or of the volume they were fitted to, through a transfer function.

pub mod arguments;
mod frames;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::{ArgGroup, Args};
use engine::gpu::Gpu;
use engine::render::{
    Camera, ClipPlane, FOV_DEGREES, Look, ModeRow, Precision, Renderer, Scene, Settings, VolumeSource, mode,
};
use engine::splat::{self, Form, Place, SplatSet};
use engine::volume::{Roi, Volume};
use engine::{Error, Kind, Result, fit, transfer};
use serde::Serialize;

use crate::arguments::DeviceArguments;
use crate::console::Console;
use crate::failure::Stop;
use crate::inputs::{ReadArguments, region_of, volume_of};
use crate::outputs;
use crate::splats;
use arguments::{Background, Clip, ObjectChange, Size, View};
use frames::{Output, Turntable};

/// Renders splats or a volume through a transfer function
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct Arguments {
    /// The splats (PLY); several files are shown together, in the space of the patient
    #[arg(required_unless_present = "volume")]
    splats: Vec<PathBuf>,
    /// A volume: with --mode volume, or without splats, it is what is rendered. It also places splats of a PLY of the
    /// paper's authors, with its region
    #[arg(long, value_name = "VOLUME", help_heading = "Volume")]
    volume: Option<PathBuf>,
    #[command(flatten)]
    region: VolumeRegion,
    #[command(flatten)]
    read: ReadArguments,
    #[command(flatten)]
    output: Output,
    /// How it is rendered; slab for splats and volume for a volume by default
    #[arg(long, value_name = "MODE", help_heading = "Picture", value_parser = mode_name)]
    mode: Option<&'static str>,
    /// Transfer function: a preset, a file (.vp, .vp.json, .xml:NAME, ParaView .json), or window:WIDTH,LEVEL
    #[arg(long, value_name = "PRESET|FILE", default_value = "CT-Bone", help_heading = "Picture")]
    tf: String,
    /// Moves the transfer function along the intensities, HU
    #[arg(
        long,
        value_name = "HU",
        default_value_t = 0.0,
        allow_negative_numbers = true,
        help_heading = "Picture"
    )]
    tf_shift: f64,
    /// Lights surfaces, or not; as the transfer function says by default
    #[arg(long, value_name = "on|off", help_heading = "Picture", value_parser = arguments::on_off)]
    shade: Option<bool>,
    /// From where: a side (anterior, left, superior ..., or several as anterior-left), or a file with eye_mm, target_mm,
    /// up, fov_deg
    #[arg(long, value_name = "SIDE|FILE.json", default_value = "anterior", help_heading = "Picture")]
    camera: View,
    /// Field of view from the upper to the lower edge, degrees, for a camera that is a side
    #[arg(long, value_name = "DEGREES", default_value_t = FOV_DEGREES, help_heading = "Picture",
          value_parser = arguments::degrees)]
    fov: f64,
    /// How near a camera that is a side comes: 1 shows all, 2 half of it
    #[arg(long, value_name = "TIMES", default_value_t = 1.0, help_heading = "Picture", value_parser = arguments::zoom)]
    zoom: f64,
    /// Pixels
    #[arg(long, value_name = "WIDTHxHEIGHT", default_value = "1024x1024", help_heading = "Picture")]
    size: Size,
    /// Behind everything: black, white, grey, #rrggbb, or transparent
    #[arg(long, value_name = "COLOUR", default_value = "black", help_heading = "Picture")]
    background: Background,
    /// Cuts away: x<MM, x>MM (patient RAS; also y and z), box:X0,Y0,Z0,X1,Y1,Z1 keeps a box; may be repeated
    #[arg(long, value_name = "PLANE|BOX", allow_hyphen_values = true, help_heading = "Picture")]
    clip: Vec<Clip>,
    /// How an object is shown, by name or number: colour=#rrggbb, opacity=0..1 (a factor of the opacity per mm), hidden.
    /// Each file is an object, or each of its labels; may be repeated
    #[arg(long, value_name = "NAME|N:HOW,...", help_heading = "Picture")]
    object: Vec<ObjectChange>,
    /// Hides objects: --hide-label ribs,5 is --object ribs:hidden --object 5:hidden
    #[arg(long, value_name = "N|NAME,...", value_delimiter = ',', help_heading = "Picture")]
    hide_label: Vec<String>,
    /// Letters at the edges: which way is right, left, anterior, posterior, superior, inferior
    #[arg(long, help_heading = "Picture")]
    orientation: bool,
    /// A bar of a round length in mm, true in the plane through the middle of the scene
    #[arg(long, help_heading = "Picture")]
    scale_bar: bool,
    /// Steps along a ray: standard deviations of the splats, or voxels of the volume; smaller is finer [default: 0.5]
    #[arg(long, value_name = "N", help_heading = "Quality", value_parser = arguments::step)]
    step: Option<f64>,
    /// Voxels from one sample of mode decoded to the next: 1 is the grid that the splats were fitted on, 0.5 is finer
    #[arg(long, value_name = "VOXELS", default_value_t = 1.0, help_heading = "Quality",
          value_parser = arguments::pitch)]
    pitch: f64,
    /// How the transfer function is applied: point, pre-integrated, or auto
    #[arg(long, value_name = "WAY", default_value = "auto", help_heading = "Quality",
          value_parser = arguments::classification)]
    classification: arguments::Classified,
    /// How splats are kept on the device: full (48 bytes each) or packed (16 bytes)
    #[arg(long, value_name = "full|packed", default_value = "full", help_heading = "Quality",
          value_parser = arguments::precision)]
    precision: Precision,
    /// Renders at most so many splats: the most important ones of those that can be seen
    #[arg(long, value_name = "N", help_heading = "Quality", value_parser = clap::value_parser!(u32).range(1..))]
    splat_budget: Option<u32>,
    #[command(flatten)]
    turntable: Turntable,
    #[command(flatten)]
    device: DeviceArguments,
}

/// The region of the volume.
#[derive(Args, Clone, Debug)]
#[group(skip)]
#[command(next_help_heading = "Volume", group = ArgGroup::new("shown").args(["roi", "roi_threshold"]))]
struct VolumeRegion {
    /// Shows nothing of the volume outside this mask
    #[arg(long, value_name = "MASK", requires = "volume")]
    roi: Option<PathBuf>,
    /// Or outside the voxels from LOW to HIGH, HU
    #[arg(long, value_name = "LOW,HIGH", requires = "volume", value_parser = crate::arguments::pair,
          allow_hyphen_values = true)]
    roi_threshold: Option<[f32; 2]>,
    /// Which labels of the mask, by number or name
    #[arg(long, value_name = "N|NAME,...", requires = "roi")]
    roi_label: Option<String>,
}

/// Steps of a still picture: fine enough that lit surfaces show no rings.
const STEP: f64 = 0.5;

const EXAMPLES: &str = "\
Examples:
  vgs render bones.ply -o bones.png
  vgs render bones.ply -o bones.png --tf CT-Bones-Steep --camera left --orientation --scale-bar
  vgs render body.ply -o soft.exr --tf CT-Soft-Tissue --clip 'y>20'
  vgs render bones.ply vessels.ply -o both.png --object vessels:colour=#c03020 --object bones:opacity=0.2
  vgs render --volume ct.nii.gz --roi bones.nii.gz -o ct.png --tf CT-Bone
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

/// What `--json` prints.
#[derive(Serialize)]
struct Printed {
    outputs: Vec<String>,
    mode: &'static str,
    transfer_function: String,
    size: [u32; 2],
    splats: Option<usize>,
    active_splats: Option<usize>,
    objects: Vec<PrintedObject>,
    frames: u32,
    seconds_per_frame: f64,
    device_bytes: u64,
    device: String,
    driver: String,
}

/// An object of the scene.
#[derive(Serialize)]
struct PrintedObject {
    number: u8,
    name: String,
    splats: usize,
}

/// Runs the command.
pub fn run(arguments: &Arguments, console: &Console) -> std::result::Result<u8, Stop> {
    let files = arguments.output.files(&arguments.turntable)?;
    let written: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
    let volumes = [&arguments.volume, &arguments.region.roi].into_iter().flatten();
    let inputs: Vec<&Path> = arguments.splats.iter().chain(volumes).map(PathBuf::as_path).collect();
    outputs::check(&written, &inputs, arguments.output.force)?;
    let mut row = arguments.mode_row()?;
    // The splats are in the way of nothing where the volume is rendered, but they would enlarge the view.
    let set = if row.of_splats { Some(arguments.read_splats()?) } else { None };
    let of_grid = set.as_ref().is_some_and(|set| set.form != Form::Field);
    if of_grid && arguments.mode.is_none() {
        row = mode("decoded")?;
    } else if of_grid && row.name != "decoded" {
        tracing::warn!(
            "these splats are fitted for the voxels of their CT alone (vgs.form grid): mode {} shows what lies between \
             the voxels, too, which means nothing; leave --mode out",
            row.name
        );
    }
    let wants_volume = set.is_none();
    let (volume, roi) = if wants_volume { arguments.read_volume()? } else { (None, None) };
    let source = volume.as_ref().map(|volume| VolumeSource { volume, roi: roi.as_ref() });
    let look = arguments.look(set.as_ref(), intensities(set.as_ref(), volume.as_ref()))?;
    let gpu = arguments.device.boot()?;
    let mut scene = Scene::with_precision(&gpu, set.as_ref(), source.as_ref(), &look, arguments.precision)?;
    if let Some(budget) = arguments.splat_budget {
        scene.set_splat_budget(Some(budget as usize))?;
    }
    let camera = arguments.camera(&scene)?;
    let settings = Settings {
        depth: arguments.output.wants_depth(),
        step: arguments.step.unwrap_or(STEP),
        pitch: arguments.pitch,
        classification: arguments.classification.0,
        precise: true,
        ..Settings::new(arguments.size.0)
    };
    let mut renderer = Renderer::new(&gpu, row, &scene, &settings)?;
    let start = Instant::now();
    let oriented = volume.as_ref().is_none_or(|v| v.oriented);
    let count = frames::render(arguments, console, &mut renderer, &scene, camera, oriented)?;
    let seconds = start.elapsed().as_secs_f64() / f64::from(count);
    arguments.report(console, row, &gpu, &scene, &files, count, seconds)?;
    Ok(0)
}

impl Arguments {
    fn mode_row(&self) -> Result<&'static ModeRow> {
        let name = self.mode.unwrap_or(if self.splats.is_empty() { "volume" } else { "slab" });
        let row = mode(name)?;
        if row.of_splats && self.splats.is_empty() {
            return Err(Error::new(Kind::Usage, "VGS-CLI-090", format!("--mode {name} renders splats"))
                .help("give a PLY, or --mode volume"));
        }
        if !row.of_splats && self.volume.is_none() {
            return Err(Error::new(Kind::Usage, "VGS-CLI-091", format!("--mode {name} renders a volume"))
                .help("give it with --volume, and its mask with --roi"));
        }
        Ok(row)
    }

    /// The volume and its region, where they are given.
    fn read_volume(&self) -> Result<(Option<Volume>, Option<Roi>)> {
        let Some(path) = &self.volume else { return Ok((None, None)) };
        let volume = volume_of(path, &self.read)?;
        let VolumeRegion { roi, roi_threshold, roi_label } = &self.region;
        let roi = region_of(&volume, &self.read, roi.as_deref(), *roi_threshold, roi_label.as_deref())?;
        Ok((Some(volume), roi))
    }

    /// Reads splats of any kind, of several files as one set; the volume only if one of them must be placed. Objects are
    /// called after the files.
    fn read_splats(&self) -> Result<SplatSet> {
        let mut place: Option<Place> = None;
        let mut sets = Vec::new();
        for path in &self.splats {
            let splats = splats::read(path)?;
            if splats.needs_volume() && place.is_none() {
                let (volume, roi) = self.read_volume()?;
                place = volume.map(|volume| fit::place::place(&volume, roi.as_ref()));
            }
            let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            sets.push((name, splats.placed(place.as_ref())?));
        }
        splat::join(sets)
    }

    /// How `splats` are to be seen. `range` are the intensities that are there; some presets are stretched over them.
    fn look(&self, splats: Option<&SplatSet>, range: [f64; 2]) -> Result<Look> {
        let mut transfer = transfer::load(&self.tf, range)?;
        if self.tf_shift != 0.0 {
            transfer = transfer.shifted(self.tf_shift)?;
        }
        if let Some(shade) = self.shade {
            transfer.material.shade = shade;
        }
        let clip: Vec<ClipPlane> = self.clip.iter().flat_map(|c| c.0.iter().copied()).collect();
        let there = splats.map(SplatSet::objects).unwrap_or_default();
        let mut objects = BTreeMap::new();
        for change in
            self.object.iter().cloned().chain(self.hide_label.iter().map(|l| ObjectChange::hiding(l)))
        {
            change.apply(&there, &mut objects)?;
        }
        Ok(Look { transfer, clip, objects })
    }

    fn camera(&self, scene: &Scene) -> Result<Camera> {
        let [low, high] = scene.bounds();
        let aspect = f64::from(self.size.0[0]) / f64::from(self.size.0[1]);
        match &self.camera {
            View::File(file) => file.camera(aspect),
            View::Side(name) => {
                let radius = (high - low).length() * 0.5 / self.zoom;
                Camera::from_side(name, (low + high) * 0.5, radius, self.fov, aspect)
            }
        }
    }

    #[expect(clippy::too_many_arguments, reason = "what is reported comes from everywhere")]
    fn report(
        &self,
        console: &Console,
        row: &ModeRow,
        gpu: &Gpu,
        scene: &Scene,
        files: &[PathBuf],
        frames: u32,
        seconds: f64,
    ) -> Result<()> {
        let splats = scene.splats.as_ref();
        let active = splats.map(|c| c.active_count()).transpose()?;
        if console.json {
            return console.json_data(&Printed {
                outputs: files.iter().map(|p| p.display().to_string()).collect(),
                mode: row.name,
                transfer_function: scene.look().transfer.name.clone(),
                size: self.size.0,
                splats: splats.map(|c| c.count),
                active_splats: active,
                objects: scene
                    .objects()
                    .iter()
                    .map(|o| PrintedObject { number: o.number, name: o.name.clone(), splats: o.splats })
                    .collect(),
                frames,
                seconds_per_frame: seconds,
                device_bytes: gpu.memory_by_purpose().values().sum(),
                device: gpu.description().name.clone(),
                driver: gpu.description().driver.clone(),
            });
        }
        if let (Some(splats), Some(active)) = (splats, active) {
            let verb = if self.splat_budget.is_some() { "are rendered" } else { "can be seen" };
            console.say(&format!("{active} of {} splats {verb}", splats.count));
        }
        for (purpose, bytes) in gpu.memory_by_purpose() {
            tracing::info!("device memory for {purpose}: {:.1} MB", bytes as f64 * 1e-6);
        }
        let what = if frames > 1 {
            format!("{frames} frames, {seconds:.3} s each")
        } else {
            format!("{seconds:.3} s")
        };
        console.say(&format!("{}: {what}, mode {}", files[0].display(), row.name));
        Ok(())
    }
}

/// Least and greatest intensity of what is shown.
fn intensities(set: Option<&SplatSet>, volume: Option<&Volume>) -> [f64; 2] {
    let range = match (set, volume) {
        (Some(set), _) => set.splats.iter().map(|s| s.intensity).fold(None, |range: Option<[f32; 2]>, c| {
            Some(range.map_or([c, c], |[low, high]| [low.min(c), high.max(c)]))
        }),
        (None, Some(volume)) => volume.min_max().map(|(low, high)| [low, high]),
        (None, None) => None,
    };
    range.unwrap_or([0.0, 1.0]).map(f64::from)
}
