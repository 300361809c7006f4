//! Runs `vgs render`: what is shown, how, and from where.

use std::path::{Path, PathBuf};
use std::time::Instant;

use engine::fidelity::{self, ShownError};
use engine::gpu::Gpu;
use engine::image::{ColourBar, file};
use engine::render::{
    Camera, DecodeOptions, FieldBudget, Intensities, Look, ModeRow, OF_VOLUMES, ObjectChange, Renderer,
    Scene, Settings, SplatKind, UsualLook, VolumeSource, mode,
};
use engine::splat::{self, SplatSet};
use engine::transfer::TransferFunction;
use engine::unit::Unit;
use engine::volume::{self, Roi, Volume};
use engine::{Error, Kind, Result, fit, memory, transfer};
use serde::Serialize;

use super::arguments::{RenderArguments, VolumeRegion};
use super::frames;
use super::values::GradientOpacity;
use crate::shared::console::Console;
use crate::shared::failure::Stop;
use crate::shared::inputs::{is_volume, region_of, volume_of};
use crate::shared::viewing::View;
use crate::shared::waiting::Waiting;
use crate::shared::{outputs, splat_files};

/// Host bytes that a pixel takes.
const BYTES_A_PIXEL: u64 = 40;

/// Output of `--json`.
#[derive(Serialize)]
struct RenderOutput {
    outputs: Vec<String>,
    mode: &'static str,
    transfer_function: String,
    size: [u32; 2],
    splats: Option<usize>,
    active_splats: Option<usize>,
    objects: Vec<ObjectOutput>,
    frames: u32,
    seconds_per_frame: f64,
    device_bytes: u64,
    device: String,
    driver: String,
    /// Error that surfaces are coloured by; null without --error.
    error: Option<ErrorOutput>,
}

/// Error that surfaces are coloured by.
#[derive(Clone, Copy, Serialize)]
struct ErrorOutput {
    voxels: usize,
    mean_error_hu: f64,
    p99_hu: f64,
    /// Error at which the colours end, HU.
    range_hu: f64,
}

/// Object of the scene.
#[derive(Serialize)]
struct ObjectOutput {
    number: u8,
    name: String,
    splats: usize,
    transfer_function: String,
    colour: Option<[f32; 3]>,
}

/// Runs the command.
pub fn run(arguments: &RenderArguments, console: &Console) -> std::result::Result<u8, Stop> {
    let arguments = &arguments.sorted()?;
    let files = arguments.output.files(&arguments.turntable)?;
    let size = arguments.pixels()?;
    let written: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
    let volumes = [&arguments.volume, &arguments.region.roi].into_iter().flatten();
    let inputs: Vec<&Path> = arguments.splats.iter().chain(volumes).map(PathBuf::as_path).collect();
    outputs::check(&written, &inputs, arguments.output.force)?;
    let mut row = arguments.mode_row()?;
    // If the volume is rendered, the splats would enlarge the view for nothing.
    let set = if row.of_splats { Some(arguments.read_splats()?) } else { None };
    arguments.check_mode(row, set.as_ref())?;
    let kind = set.as_ref().map(SplatKind::of);
    if let Some(kind) = kind {
        if arguments.mode.is_none() {
            row = mode(kind.usual_mode())?;
        } else if kind.own_mode().is_some_and(|own| own != row.name) {
            let why = match kind {
                SplatKind::Coloured => "these splats have colours and no intensity that could be classified",
                _ => "these splats are fitted for the voxels of their CT alone (vgs.form grid)",
            };
            tracing::warn!("{why}: mode {} shows something else; leave --mode out", row.name);
        }
    }
    let wants_volume = set.is_none();
    if arguments.error {
        row = arguments.error_row(row, set.as_ref())?;
    }
    let (volume, roi) = if wants_volume { arguments.read_volume()? } else { (None, None) };
    let shown = |of| volume::shown(of, roi.as_ref(), arguments.between_slices, arguments.edges);
    let shown = volume.as_ref().map(shown);
    let source = shown.as_ref().map(|(volume, roi)| VolumeSource { volume, roi: roi.as_deref() });
    let unit = set.as_ref().map(|set| set.unit).or(volume.as_ref().map(Volume::unit)).unwrap_or_default();
    let range = intensities(set.as_ref(), volume.as_ref());
    let first = match (&set, &volume, &roi) {
        (Some(set), ..) => Intensities::of_set(set).suiting_preset(unit),
        (None, Some(volume), Some(roi)) => Intensities::of_region(volume, roi).suiting_preset(unit),
        _ => transfer::first(unit),
    };
    let mut look = arguments.look(console, set.as_ref(), range, first, row.own_functions)?;
    if let Some(set) = &set {
        warn_of_unseen(set, &look, row.own_functions, arguments.tf.is_some());
    }
    warn_of_unheeded(arguments, row, &look);
    // A frame as it is rendered, and as it is written: over a background, in bytes, with a depth.
    let pixels: u64 = size.iter().map(|&n| u64::from(n)).product();
    memory::require(pixels.saturating_mul(BYTES_A_PIXEL), "a picture of this --size")?;
    let gpu = arguments.device.boot()?;
    let error =
        set.as_ref().filter(|_| arguments.error).map(|set| arguments.measured(&gpu, set)).transpose()?;
    let error_range = error.as_ref().map_or(0.0, |error| arguments.error_range.unwrap_or(error.range));
    if let Some(error) = &error {
        look = error.look(&look, error_range);
    }
    let mut scene = Scene::with_precision(&gpu, set.as_ref(), source.as_ref(), &look, arguments.precision)?;
    if let Some(budget) = arguments.splat_budget {
        scene.set_splat_budget(Some(budget as usize))?;
    }
    let camera = arguments.camera(&scene)?;
    let budget = arguments.field_memory.map(|bytes| FieldBudget { bytes, camera: Some(camera) });
    let settings = Settings {
        depth: arguments.output.wants_depth(),
        step: arguments.step.unwrap_or(row.step),
        cell: arguments.cell,
        decoding: DecodeOptions { pitch: arguments.pitch, edges: arguments.edges, budget },
        classification: arguments.classification.0,
        precise: true,
        ..Settings::new(size)
    };
    let preparing = Waiting::on("preparing the scene");
    if let (Some(error), Some(splats)) = (&error, &scene.splats) {
        let (classes, origin) = (error.clone(), scene.origin);
        splats.decoding_objects(&gpu, settings.decoding, move |at| classes.class(at + origin))?(&mut |_| ())?;
    }
    let mut renderer = Renderer::new(&gpu, row, &scene, &settings)?;
    drop(preparing);
    let measured = error.as_ref().map(|error| tell_error(error, error_range, console));
    let start = Instant::now();
    // The frames of a turntable are counted instead.
    let _rendering = arguments.turntable.turntable.is_none().then(|| Waiting::on("rendering"));
    let oriented = volume.as_ref().is_none_or(|v| v.oriented);
    let colours = match &error {
        Some(error) => Some(error_bar(error_range, error.unit)),
        None => arguments.colour_bar.then(|| colour_bar(&look.transfer, range, unit)).flatten(),
    };
    let told = frames::Told { oriented, colours };
    let count = frames::render(arguments, console, &mut renderer, &scene, camera, &told)?;
    let seconds = start.elapsed().as_secs_f64() / f64::from(count);
    arguments.report(console, row, &gpu, &scene, &files, count, seconds, measured)?;
    Ok(0)
}

/// Says by what error surfaces are coloured, up to `error_range`, and returns it for `--json`.
fn tell_error(error: &ShownError, error_range: f64, console: &Console) -> ErrorOutput {
    let figures = &error.figures;
    console.say(&format!(
        "the error is below {:.1}{unit} in 99 % of the voxels, {:.1}{unit} in the mean, of {} voxels; full blue is \
         {:.1}{unit} too low, full red as much too high",
        figures.p99_hu,
        figures.mean_error_hu,
        error.voxels,
        error_range,
        unit = error.unit,
    ));
    ErrorOutput {
        voxels: error.voxels,
        mean_error_hu: figures.mean_error_hu,
        p99_hu: figures.p99_hu,
        range_hu: error_range,
    }
}

/// Warns of what the user asks for and this mode does not show.
fn warn_of_unheeded(arguments: &RenderArguments, row: &ModeRow, look: &Look) {
    if arguments.object.iter().any(ObjectChange::has_function) && !row.own_functions {
        tracing::warn!(
            "mode {} shows all objects by one transfer function; --mode decoded knows tf=",
            row.name
        );
    }
    if look.depends_on_gradient() && !row.gradient_opacity {
        tracing::warn!("mode {} shows no gradient opacity; modes volume and decoded do", row.name);
    }
    if arguments.occlusion.is_some_and(|occlusion| occlusion > 0.0) {
        if !row.occlusion {
            tracing::warn!("mode {} shows no ambient occlusion; modes volume and decoded do", row.name);
        } else if !look.transfer.material.shade {
            tracing::warn!("--occlusion has no effect: this transfer function is unlit; add --shade on");
        }
    }
}

/// Number of steps of a colour bar.
const STEPS: usize = 256;

/// Returns the bar of the colours of what is shown; `None` if nothing is.
fn colour_bar(function: &TransferFunction, range: [f64; 2], unit: Unit) -> Option<ColourBar> {
    let [low, high] = function.shown_in(range)?;
    let at = |share: f64| low + share * (high - low);
    let colours = (0..STEPS).map(|i| function.at(at((i as f64 + 0.5) / STEPS as f64)).0.as_vec3().into());
    let labels =
        [(0.0, ""), (0.5, ""), (1.0, unit.text())].map(|(share, unit)| format!("{:.0}{unit}", at(share)));
    Some(ColourBar { colours: colours.collect(), labels })
}

/// Returns the bar of the colours of errors that end at ±`range`.
fn error_bar(range: f64, unit: &str) -> ColourBar {
    let colours = (0..STEPS).map(|i| fidelity::diverging(2.0 * (i as f64 + 0.5) / STEPS as f64 - 1.0));
    let labels = [format!("-{range}"), "0".to_owned(), format!("+{range}{unit}")];
    ColourBar { colours: colours.collect(), labels }
}

impl RenderArguments {
    /// Returns the arguments with a volume among the files of splats as the volume.
    ///
    /// # Errors
    /// If there are two volumes, or a region of none.
    fn sorted(&self) -> Result<Self> {
        let (volumes, splats): (Vec<PathBuf>, _) = self.splats.iter().cloned().partition(|p| is_volume(p));
        let mut volumes = self.volume.iter().cloned().chain(volumes);
        let volume = volumes.next();
        if let Some(other) = volumes.next() {
            return Err(Error::new(Kind::Usage, "VGS-CLI-098", "a second volume")
                .file(&other)
                .help("render one volume at a time"));
        }
        let region = self.region.roi.is_some() || self.region.roi_threshold.is_some();
        if region && volume.is_none() {
            return Err(Error::new(
                Kind::Usage,
                "VGS-CLI-099",
                "a region, and no volume that it is a part of",
            )
            .help("give the volume, too; splats are shown whole"));
        }
        Ok(RenderArguments { splats, volume, ..self.clone() })
    }

    /// Returns width and height, pixels.
    ///
    /// # Errors
    /// If it is too large, or if its format cannot tell its size in print.
    fn pixels(&self) -> Result<[u32; 2]> {
        if !self.size.is_sound(self.dpi) {
            let [width, height] = self.size.pixels(self.dpi);
            let message = format!("a picture of {width} x {height} pixels; 16384 are the most");
            return Err(
                Error::new(Kind::Usage, "VGS-CLI-140", message).help("choose a smaller --size or --dpi")
            );
        }
        let output = &self.output.output;
        if self.size.printed(self.dpi).is_some() && !file::of_extension(output)?.dpi {
            return Err(Error::new(Kind::Usage, "VGS-CLI-141", "only a PNG tells its size in print")
                .file(output)
                .help("choose a name that ends in .png, or give --size in pixels and no --dpi"));
        }
        Ok(self.size.pixels(self.dpi))
    }

    fn mode_row(&self) -> Result<&'static ModeRow> {
        let name = self.mode.unwrap_or(if self.splats.is_empty() { OF_VOLUMES } else { "decoded" });
        let row = mode(name)?;
        if row.of_splats && self.splats.is_empty() {
            return Err(Error::new(Kind::Usage, "VGS-CLI-090", format!("--mode {name} renders splats"))
                .help("give a PLY, or --mode volume"));
        }
        if !row.of_splats && self.volume.is_none() {
            return Err(Error::new(Kind::Usage, "VGS-CLI-091", format!("--mode {name} renders a volume"))
                .help("give one, beside splats with --volume, and its mask with --roi"));
        }
        Ok(row)
    }

    /// Fails if a mode draws splats, and these are coded voxels.
    fn check_mode(&self, row: &'static ModeRow, set: Option<&SplatSet>) -> Result<()> {
        if !row.of_splats || row.name == "decoded" || set.is_none_or(|set| set.voxels.is_empty()) {
            return Ok(());
        }
        let message = format!("--mode {} draws splats, and the file has coded voxels", row.name);
        Err(Error::new(Kind::Usage, "VGS-CLI-169", message)
            .help("leave --mode out: mode decoded shows them; or fit splats: vgs fit"))
    }

    /// Returns the mode in which surfaces have the colours of their error.
    fn error_row(&self, row: &'static ModeRow, set: Option<&SplatSet>) -> Result<&'static ModeRow> {
        if self.volume.is_none() || set.is_none_or(|set| set.colours.is_some()) {
            return Err(Error::new(
                Kind::Usage,
                "VGS-CLI-155",
                "--error compares splats that have intensities with a volume",
            )
            .help(
                "give both: vgs render bones.ply --error --volume ct.nii.gz --roi bones.nii.gz -o error.png",
            ));
        }
        if self.mode.is_some() && row.name != "decoded" {
            return Err(Error::new(
                Kind::Usage,
                "VGS-CLI-156",
                format!("mode {} shows no colours of the error", row.name),
            )
            .help("leave --mode out: --error takes mode decoded"));
        }
        mode("decoded")
    }

    /// Measures a set against the volume, in its region.
    fn measured(&self, gpu: &Gpu, set: &SplatSet) -> Result<ShownError> {
        let (volume, roi) = self.read_volume()?;
        let (Some(volume), Some(path)) = (volume, &self.volume) else {
            return Err(Error::new(Kind::Internal, "VGS-CLI-157", "no volume to measure the error against"));
        };
        splat_files::warn_of_another_volume(set, &volume, path);
        let _measuring = Waiting::on("measuring the error");
        ShownError::new(gpu, set, &volume, roi.as_ref(), &mut |_| ())?.ok_or_else(|| {
            Error::new(
                Kind::BadData,
                "VGS-CLI-158",
                "the splats do not lie in the volume: they are of different scans, or one lost its position",
            )
            .file(path)
        })
    }

    /// Reads the volume and its region, if they are given.
    fn read_volume(&self) -> Result<(Option<Volume>, Option<Roi>)> {
        let Some(path) = &self.volume else { return Ok((None, None)) };
        let volume = volume_of(path, &self.read)?;
        let VolumeRegion { roi, roi_threshold, roi_label, cleaning } = &self.region;
        let threshold = (*roi_threshold, cleaning);
        let roi = region_of(&volume, &self.read, roi.as_deref(), threshold, roi_label.as_deref())?;
        Ok((Some(volume), roi))
    }

    /// Reads splats of any kind, from several files as one set; the volume only if one of them must be
    /// placed. Objects are named after the files.
    fn read_splats(&self) -> Result<SplatSet> {
        splat::read_all(&self.splats, || {
            let (volume, roi) = self.read_volume()?;
            Ok(volume.map(|volume| fit::place::place(&volume, roi.as_ref())))
        })
    }

    /// Returns the look that the flags ask for. `range` is the range of the intensities that are shown; some
    /// presets are stretched over it. Where no transfer function is asked for, several objects have the usual look of
    /// each, and anything else is shown through `first`.
    fn look(
        &self,
        console: &Console,
        splats: Option<&SplatSet>,
        range: [f64; 2],
        first: &str,
        own_functions: bool,
    ) -> Result<Look> {
        let there = splats.map(SplatSet::objects).unwrap_or_default();
        let usual = splats.filter(|_| self.tf.is_none()).and_then(UsualLook::of);
        let mut look = match &usual {
            Some(usual) => {
                let how = match own_functions {
                    true => "through a function for its kind",
                    false => {
                        "all through one function that shows every kind; --mode decoded gives each its own"
                    }
                };
                console.say(&format!(
                    "{} objects, each in its usual colour, {how} ({}); --tf CT-Bone shows all through that \
                     preset, --object NAME:colour=#rrggbb,opacity=0.3 or NAME:hidden \
                     changes one",
                    there.len(),
                    usual.summary()
                ));
                usual.look(&there)
            }
            None => Look::new(transfer::load(self.tf.as_deref().unwrap_or(first), range)?),
        };
        look.transfer = self.changed(look.transfer)?;
        self.light.warn_if_unlit(&look.transfer.material);
        for function in look.functions.values_mut() {
            *function = self.changed(function.clone())?;
        }
        look.light = self.light.light();
        look.clip = self.clip.iter().flat_map(|c| c.0.iter().copied()).collect();
        if self.object_colours {
            look.tint_objects(&there);
        }
        for change in
            self.object.iter().cloned().chain(self.hide_label.iter().map(|l| ObjectChange::hiding(l)))
        {
            change.apply(&there, &mut look, range)?;
        }
        Ok(look)
    }

    /// Returns a transfer function with what the flags change of it.
    fn changed(&self, mut transfer: TransferFunction) -> Result<TransferFunction> {
        if self.tf_shift != 0.0 {
            transfer = transfer.shifted(self.tf_shift)?;
        }
        if let Some(shade) = self.shade {
            transfer.material.shade = shade;
        }
        if let Some(occlusion) = self.occlusion {
            transfer.material.occlusion = occlusion;
        }
        self.light.change(&mut transfer.material);
        if let Some(GradientOpacity(points)) = &self.gradient_opacity {
            transfer = transfer.with_gradient_opacity(points.clone())?;
        }
        Ok(transfer)
    }

    fn camera(&self, scene: &Scene) -> Result<Camera> {
        let [low, high] = scene.bounds();
        let aspect = f64::from(self.size.pixels(self.dpi)[0]) / f64::from(self.size.pixels(self.dpi)[1]);
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
        error: Option<ErrorOutput>,
    ) -> Result<()> {
        let (splats, look) = (scene.splats.as_ref(), scene.look());
        let active = splats.map(|c| c.active_count()).transpose()?;
        if console.json {
            return console.json_data(&RenderOutput {
                outputs: files.iter().map(|p| p.display().to_string()).collect(),
                mode: row.name,
                transfer_function: look.transfer.name.clone(),
                size: self.size.pixels(self.dpi),
                splats: splats.map(|c| c.count),
                active_splats: active,
                objects: scene
                    .objects()
                    .iter()
                    .map(|o| ObjectOutput {
                        number: o.number,
                        name: o.name.clone(),
                        splats: o.splats,
                        transfer_function: look.function_of(o.number).name.clone(),
                        colour: look.objects.get(&o.number).and_then(|a| a.tint),
                    })
                    .collect(),
                frames,
                seconds_per_frame: seconds,
                device_bytes: gpu.memory_by_purpose().values().sum(),
                device: gpu.description().name.clone(),
                driver: gpu.description().driver.clone(),
                error,
            });
        }
        if let (Some(splats), Some(active)) = (splats, active) {
            if splats.far > 0 && matches!(self.camera, View::Side(_)) {
                tracing::warn!(
                    "{} of {} splats lie far from all others, and the picture is framed without them; vgs convert \
                     --box leaves them out",
                    splats.far,
                    splats.count
                );
            }
            let verb = if self.splat_budget.is_some() { "are rendered" } else { "can be seen" };
            if splats.count > 0 {
                console.say(&format!("{active} of {} splats {verb}", splats.count));
            }
        }
        for ((purpose, heap), bytes) in gpu.memory_account() {
            tracing::info!("{heap} memory for {purpose}: {:.1} MB", bytes as f64 * 1e-6);
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

/// Returns the least and the greatest intensity of what is rendered.
fn intensities(set: Option<&SplatSet>, volume: Option<&Volume>) -> [f64; 2] {
    let range = match (set, volume) {
        (Some(set), _) => set.intensity_range(),
        (None, Some(volume)) => volume.min_max().map(|(low, high)| [f64::from(low), f64::from(high)]),
        (None, None) => None,
    };
    range.unwrap_or([0.0, 1.0])
}

/// Objects that a warning names; of more it tells the number.
const NAMED: usize = 3;

/// Warns of the objects that are not hidden and of which the transfer function shows next to nothing. In modes without
/// functions of objects' own, `own_functions` is false and that of the scene counts. `asked` is true if the user has
/// chosen it.
fn warn_of_unseen(set: &SplatSet, look: &Look, own_functions: bool, asked: bool) {
    let (objects, unit) = (set.objects(), set.unit.text());
    let unseen: Vec<String> = objects
        .iter()
        .zip(Intensities::of_objects(set))
        .filter_map(|(object, intensities)| {
            let shown = look.objects.get(&object.number).is_none_or(|a| a.visible && a.opacity > 0.0);
            let [low, high] = intensities.middle_half().filter(|_| shown)?;
            let function = if own_functions { look.function_of(object.number) } else { &look.transfer };
            let seen = intensities.are_seen(function);
            (!seen).then(|| format!("{}, mostly {low:.0} to {high:.0}{unit}", object.name))
        })
        .collect();
    let (function, all) = (&look.transfer.name, objects.len());
    let help = match asked && all > 1 {
        true => "leave --tf out to show every kind, or choose another --tf",
        false => "choose another --tf, or --tf-shift",
    };
    match &unseen[..] {
        [] => {}
        [one] => tracing::warn!("{one}, is barely visible: {function} is transparent for most of it; {help}"),
        some => {
            let more = match some.len().saturating_sub(NAMED) {
                0 => String::new(),
                more => format!(" and {more} more"),
            };
            let count = some.len();
            let named = some[..count.min(NAMED)].join("; ");
            tracing::warn!(
                "{count} of {all} objects are barely visible, since {function} is transparent for most of their splats ({named}{more}); {help}"
            );
        }
    }
}
