//! Writes splats in another format (`vgs convert`).

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::Args;
use engine::fit::evaluate::between_slices_of;
use engine::fit::{FitConfig, FitForm, Problem, with_part_of_mask};
use engine::render::{Intensities, Look, ObjectChange, UsualLook};
use engine::splat::{self, Form, Grid, Object, PlyLayout, ReadOptions, SplatSet, WriteOptions};
use engine::{Error, Kind, transfer};
use glam::DVec3;
use view::io::loaded_splats::LoadedSplats;
use view::io::saving::{self, Ready};
use view::model::state::{ViewState, is_session};

use crate::shared::console::Console;
use crate::shared::failure::Stop;
use crate::shared::figures::bytes;
use crate::shared::flags::{Clip, Corners, DeviceArguments, pair};
use crate::shared::inputs::{Case, CleaningArguments, ReadArguments, RoiArguments, is_volume};
use crate::shared::outputs;
use crate::shared::splat_files::{layout, warn_of_another_volume};
use crate::shared::waiting::Waiting;

/// Writes splats in another format; the extension of the output names it
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct ConvertArguments {
    /// The splats; or a session of `vgs view` (.toml): what it shows of its splats, as it shows it
    #[arg(value_name = "SPLATS|SESSION")]
    splats: PathBuf,
    /// The splats as vgs wrote them, where SPLATS are what another program has made of these without the
    /// comments of vgs: kernel, background, grid and names of labels are taken from there
    #[arg(long, value_name = "ORIGINAL")]
    like: Option<PathBuf>,
    /// The file: .vgs, which is small and rounded, or .ply. For programs that draw splats and know no
    /// intensities: .spz, which is small, or .glb (glTF with KHR_gaussian_splatting), from which vgs reads the HU
    /// again
    #[arg(short, long, value_name = "OUT", help_heading = "Output")]
    output: PathBuf,
    /// How a PLY is laid out: vgs (HU as one more property, what most programs read), or inria (rows of 62
    /// floats, for programs that know no others)
    #[arg(long, value_name = "LAYOUT", default_value = "vgs", value_parser = worldly_layout, help_heading = "Output")]
    ply_layout: &'static PlyLayout,
    /// Gives the splats the colours and opacities of a transfer function in place of their HU, as .spz and .glb
    /// need it: a preset, a file, or window:WIDTH,LEVEL, as in `vgs render` [default for these: of several
    /// objects the usual look of each; of one CT-Bone, or MR-Default without HU; where that shows nothing of the
    /// splats, a preset that does]
    #[arg(long, value_name = "PRESET|FILE", help_heading = "Colours")]
    tf: Option<String>,
    /// Gives each object a colour of its own, the one that is usual for its name, as in `vgs render`
    #[arg(long, help_heading = "Colours")]
    object_colours: bool,
    /// Only what is on this side: x<MM, x>MM and the like are cut away, as in `vgs render`; may be repeated
    #[arg(long, value_name = "PLANE|BOX", allow_hyphen_values = true, help_heading = "Selection")]
    clip: Vec<Clip>,
    /// Only splats whose middle lies in this box, mm RAS
    #[arg(
        long = "box",
        value_name = "X0,Y0,Z0,X1,Y1,Z1",
        allow_hyphen_values = true,
        help_heading = "Selection"
    )]
    inside: Option<Corners>,
    /// Only splats whose middle lies outside of this box
    #[arg(long, value_name = "X0,Y0,Z0,X1,Y1,Z1", allow_hyphen_values = true, help_heading = "Selection")]
    outside_box: Option<Corners>,
    /// Only the splats of this object, by name or number, as `vgs info` lists them, or of several, by a range (1-24), a
    /// pattern (rib_*) or all. NAME:HOW chooses nothing and says how an object is shown, as in `vgs render`:
    /// colour=#rrggbb, opacity=0..1, tf=CT-Bone, hidden. May be repeated
    #[arg(long, value_name = "NAME|N|...[:HOW,...]", help_heading = "Selection")]
    object: Vec<ObjectFlag>,
    /// The volume that the splats were fitted to: a .vgs is then rounded more and fitted again to make up for
    /// it
    #[arg(long, value_name = "VOLUME", requires = "region", help_heading = "Fitting again",
          conflicts_with_all = ["inside", "outside_box", "object", "tf", "clip"])]
    volume: Option<PathBuf>,
    /// The mask of their fit
    #[arg(long, value_name = "MASK", requires = "volume", group = "region", help_heading = "Fitting again")]
    roi: Option<PathBuf>,
    /// Instead of a mask: the voxels from LOW to HIGH, HU
    #[arg(long, value_name = "LOW,HIGH", value_parser = pair, allow_hyphen_values = true, requires = "volume",
          group = "region", help_heading = "Fitting again")]
    roi_threshold: Option<[f32; 2]>,
    /// Which labels of the mask, by number or name
    #[arg(long, value_name = "N|NAME|...", requires = "roi", help_heading = "Fitting again")]
    roi_label: Option<String>,
    #[command(flatten)]
    read: ReadArguments,
    #[command(flatten)]
    device: DeviceArguments,
    /// Replaces an output that exists
    #[arg(short, long, help_heading = "Output")]
    force: bool,
}

const EXAMPLES: &str = "\
Examples:
  vgs convert bones.ply -o bones.vgs
  vgs convert bones.vgs -o bones.ply
  vgs convert bones.ply -o for-sibr.ply --ply-layout inria
  vgs convert body.ply -o kidney.vgs --object kidney_left --object kidney_right
  vgs convert bones.ply -o hip.ply --box=-150,-40,-900,0,80,-700
  vgs convert bones.ply -o bones.spz --tf CT-Bones-Steep
  vgs convert bones.ply -o bones.glb
  vgs convert bones.glb -o again.ply
  vgs convert organs.ply -o organs.glb --object-colours --object liver:opacity=0.3
  vgs convert session.toml -o scene.glb                  what the window showed
  vgs convert edited.ply --like bones.ply -o edited-bones.ply
  vgs convert bones.ply -o bones.vgs --volume ct.nii.gz --roi bones.nii.gz      a fifth smaller";

/// A value of `--object`: a choice of objects, or how they are shown.
#[derive(Clone, Debug)]
enum ObjectFlag {
    Chosen(String),
    Shown(ObjectChange),
}

impl FromStr for ObjectFlag {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.contains(':') {
            true => text.parse().map(ObjectFlag::Shown),
            false => Ok(ObjectFlag::Chosen(text.to_owned())),
        }
    }
}

/// What is told of a conversion.
#[derive(Default)]
struct Report {
    /// Number of splats that were there.
    whole: usize,
    /// Number of splats that the selection has left out.
    left_out: usize,
    /// The transfer function whose colours the splats have.
    transfer_function: Option<String>,
    /// True if objects have functions of their own.
    of_each: bool,
    /// Number of splats of which that function shows nothing; they are left out.
    hidden: usize,
}

/// Runs the command.
pub fn run(arguments: &ConvertArguments, console: &Console) -> Result<u8, Stop> {
    let ConvertArguments { splats, output, .. } = arguments;
    refuse_volume(splats, output)?;
    let session = is_session(splats).then(|| arguments.session()).transpose()?;
    let mut inputs = vec![splats.as_path()];
    inputs.extend(session.iter().flat_map(|state| &state.files.splats).map(PathBuf::as_path));
    inputs.extend(arguments.like.as_deref());
    inputs.extend(arguments.volume.as_deref());
    inputs.extend(arguments.roi.as_deref());
    outputs::check(&[output], &inputs, arguments.force)?;
    let mut report = Report::default();
    let (mut set, look) = match session {
        Some(state) => arguments.of_session(state, &mut report)?,
        None => {
            let set = splat::read(splats, &ReadOptions::default())?;
            report.whole = set.splats.len();
            (set, None)
        }
    };
    if let Some(original) = &arguments.like {
        set = given_back(arguments, set, original)?;
    }
    set = selected(arguments, set)?;
    let coloured = arguments.tf.is_some() || splat::is_coloured(output) && set.colours.is_none();
    let look = arguments.look(&set, look)?;
    let ready = match &arguments.volume {
        Some(volume) if !coloured => {
            let set = fitted_again(arguments, &set, volume)?;
            Ready { set, made_of: None, hidden: 0 }
        }
        _ => prepared(arguments, &set, &look, coloured)?,
    };
    report.left_out = report.whole - ready.set.splats.len() - ready.hidden;
    let colours = |flag: &ObjectFlag| matches!(flag, ObjectFlag::Shown(change) if change.changes_colour());
    if !coloured && (arguments.object_colours || arguments.object.iter().any(colours)) {
        tracing::warn!(
            "{}: colours, opacities and functions of objects are not in it; add --tf, or write a .glb or .spz",
            output.display()
        );
    }
    if coloured {
        (report.transfer_function, report.hidden) = (Some(look.transfer.name.clone()), ready.hidden);
        report.of_each = !look.functions.is_empty();
    }
    let options =
        WriteOptions { layout: arguments.ply_layout, force: arguments.force, ..WriteOptions::default() };
    ready.write(output, &options)?;
    tell(arguments, console, &report, &ready)
}

/// Says what was written.
fn tell(arguments: &ConvertArguments, console: &Console, report: &Report, ready: &Ready) -> Result<u8, Stop> {
    let ConvertArguments { splats, output, .. } = arguments;
    let Report { whole, left_out, ref transfer_function, of_each, hidden } = *report;
    let size = |path: &PathBuf| std::fs::metadata(path).map_or(0, |found| found.len());
    let (before, after) = (size(splats), size(output));
    let count = ready.set.splats.len();
    // A function that was asked for is not always one that suits.
    if hidden > count {
        tracing::warn!(
            "{} shows nothing of {hidden} of {} splats; choose another --tf",
            transfer_function.as_deref().unwrap_or_default(),
            hidden + count
        );
    }
    if console.json {
        console.json_data(&serde_json::json!({
            "output": output, "splats": count, "bytes_before": before, "bytes": after,
            "left_out": left_out, "transfer_function": transfer_function, "hidden": hidden,
        }))?;
        return Ok(0);
    }
    if left_out > 0 {
        console.say(&format!("{left_out} of {whole} splats are not selected"));
    }
    if let Some(name) = transfer_function {
        let hidden = match hidden {
            0 => String::new(),
            hidden => format!("; {hidden} splats of which it shows nothing are left out"),
        };
        let of = if of_each { "each object" } else { name };
        console.say(&format!("colours and opacities are those of {of}{hidden}"));
    }
    console.say(&format!(
        "{}: {count} splats, {} ({:.1} bytes a splat); it was {}",
        output.display(),
        bytes(after),
        after as f64 / count.max(1) as f64,
        bytes(before),
    ));
    if ready.made_of.is_some() {
        console.say("vgs reads them from it with HU, kernel, grid and labels");
    } else if splat::is_coloured(output) && transfer_function.is_some() {
        console.say("it is without HU, kernel, grid and labels, so keep the splats that it is made of");
    }
    Ok(0)
}

impl ConvertArguments {
    /// Reads the session.
    fn session(&self) -> engine::Result<ViewState> {
        if self.like.is_some() || self.volume.is_some() {
            let message = "--like and --volume are for splats, and this is a session";
            return Err(Error::new(Kind::Usage, "VGS-CLI-134", message)
                .file(&self.splats)
                .help("give the splats in place of the session"));
        }
        ViewState::read(&self.splats)
    }

    /// Returns the splats that a session has left, and how it shows them.
    fn of_session(
        &self,
        mut state: ViewState,
        report: &mut Report,
    ) -> Result<(SplatSet, Option<Look>), Stop> {
        let read = |path: &PathBuf| Ok((path.clone(), splat::read_some(path)?.placed(None)?));
        let files = state.files.splats.iter().map(read).collect::<engine::Result<Vec<_>>>()?;
        if files.is_empty() {
            return Err(Error::new(Kind::Usage, "VGS-CLI-135", "a session without splats")
                .file(&self.splats)
                .help("open splats in the window, and save the session again")
                .into());
        }
        let mut loaded = LoadedSplats::join(files)?;
        report.whole = loaded.set.splats.len();
        if !state.deleted.is_empty() {
            loaded = loaded.without(&self.device.boot()?, &state.deleted)?;
        }
        state.set_objects(loaded.objects.iter().map(|(row, ..)| row.clone()).collect());
        let (set, numbers) = loaded.of_files();
        let look = state.look(&numbers)?;
        Ok((set, Some(look)))
    }

    /// Returns the look of `set` that the flags ask for: that of the session, if there is one, with changes.
    fn look(&self, set: &SplatSet, session: Option<Look>) -> engine::Result<Look> {
        let range = set.intensity_range().unwrap_or([0.0, 1.0]);
        let given = self.tf.as_deref().map(|name| transfer::load(name, range)).transpose()?;
        let mut look = match (session, given) {
            (Some(look), None) => look,
            // One function for all, in place of those of the objects, too.
            (Some(look), Some(given)) => Look { transfer: given, functions: BTreeMap::new(), ..look },
            (None, Some(given)) => Look::new(given),
            (None, None) => match UsualLook::of(set) {
                Some(usual) => usual.look(&set.objects()),
                None => {
                    let suiting = Intensities::of_set(set).suiting_preset(set.unit);
                    Look::new(transfer::load(suiting, range)?)
                }
            },
        };
        let there = set.objects();
        if self.object_colours {
            look.tint_objects(&there);
        }
        for flag in &self.object {
            if let ObjectFlag::Shown(change) = flag {
                change.apply(&there, &mut look, range)?;
            }
        }
        look.clip.extend(self.clip.iter().flat_map(|clip| clip.0.iter().copied()));
        Ok(look)
    }
}

/// Returns the splats that a look shows, as the output holds them.
fn prepared(
    arguments: &ConvertArguments,
    set: &SplatSet,
    look: &Look,
    coloured: bool,
) -> Result<Ready, Stop> {
    let ConvertArguments { splats, output, .. } = arguments;
    let as_it_is = look.shown(set).len() == set.splats.len();
    let rounds = splat::rounds(output) && set.form == (Form::Grid { binary: true }) && set.rounding.is_none();
    if as_it_is && !coloured && !rounds {
        return Ok(Ready { set: set.clone(), made_of: None, hidden: 0 });
    }
    let gpu = arguments.device.boot()?;
    let _waiting =
        Waiting::on(if coloured { "finding the colours of the splats" } else { "finding the mask" });
    let ready =
        saving::ready(&gpu, set, look, output, arguments.tf.is_some()).map_err(|error| error.file(splats))?;
    if !ready.set.splats.is_empty() {
        return Ok(ready);
    }
    if ready.hidden == 0 {
        let message = format!("none of the {} splats is shown", set.splats.len());
        return Err(Error::new(Kind::NothingToDo, "VGS-CLI-136", message)
            .file(splats)
            .help("show an object, or move the clip planes")
            .into());
    }
    let [low, high] = set.intensity_range().unwrap_or_default();
    let message = format!(
        "{} shows none of these splats, which have {low:.0} to {high:.0}{}",
        look.transfer.name,
        set.unit.text()
    );
    Err(Error::new(Kind::NothingToDo, "VGS-CLI-132", message).file(splats).help("choose another --tf").into())
}

/// Refuses an output with the name of a volume, and tells which command makes one.
fn refuse_volume(splats: &Path, output: &Path) -> engine::Result<()> {
    let named = |name: &str| output.extension().is_some_and(|e| e.eq_ignore_ascii_case(name));
    if !is_volume(output) || splat::FORMATS.iter().any(|format| named(format.name)) {
        return Ok(());
    }
    let message = "convert writes splats, and this is the name of a volume";
    Err(Error::new(Kind::Usage, "VGS-CLI-130", message).file(output).help(format!(
        "a volume of splats: vgs rasterize {} --like VOLUME -o {}",
        splats.display(),
        output.display()
    )))
}

/// Parses the name of a layout that needs no volume.
fn worldly_layout(text: &str) -> Result<&'static PlyLayout, String> {
    match layout(text)? {
        found if found.needs_volume => {
            Err(format!("{text} needs the volume of the splats: vgs fit --ply-layout {text}"))
        }
        found => Ok(found),
    }
}

/// Returns true if the box has this place, its borders included.
fn holds(corners: Corners, place: DVec3) -> bool {
    place.cmpge(corners.0[0]).all() && place.cmple(corners.0[1]).all()
}

/// Returns the splats of `set` that the flags select; all if they say nothing.
fn selected(arguments: &ConvertArguments, set: SplatSet) -> Result<SplatSet, Stop> {
    let ConvertArguments { inside, outside_box, .. } = arguments;
    let chosen = arguments.object.iter().filter_map(|flag| match flag {
        ObjectFlag::Chosen(name) => Some(name),
        ObjectFlag::Shown(_) => None,
    });
    let chosen: Vec<_> = chosen.collect();
    if inside.is_none() && outside_box.is_none() && chosen.is_empty() {
        return Ok(set);
    }
    let objects = set.objects();
    let mut numbers = Vec::new();
    for name in &chosen {
        numbers.extend(Object::called(&objects, name)?.iter().map(|object| object.number));
    }
    let label = |i: usize| set.labels.as_ref().map_or(0, |labels| labels[i]);
    let part = set.selected(|i, mean| {
        inside.is_none_or(|corners| holds(corners, mean))
            && outside_box.is_none_or(|corners| !holds(corners, mean))
            && (chosen.is_empty() || numbers.contains(&label(i)))
    });
    if part.splats.is_empty() {
        let message = format!("none of the {} splats is selected", set.splats.len());
        let summary = splat::describe(&arguments.splats, &ReadOptions::default())?;
        let help = match summary.bounding_box_mm {
            Some([low, high]) => format!("they lie between {low:.1?} and {high:.1?} mm RAS"),
            None => "give another --box or --object".to_owned(),
        };
        return Err(Error::new(Kind::NothingToDo, "VGS-CLI-131", message)
            .file(&arguments.splats)
            .help(help)
            .into());
    }
    if part.form != (Form::Grid { binary: true }) || part.grid.is_none() {
        return Ok(part);
    }
    let gpu = arguments.device.boot()?;
    let _waiting = Waiting::on("finding the mask of the selection");
    Ok(with_part_of_mask(&gpu, &set, part)?)
}

/// Returns `set` with what another program has dropped with the comments of vgs, from the original.
fn given_back(arguments: &ConvertArguments, set: SplatSet, original: &Path) -> Result<SplatSet, Stop> {
    let ConvertArguments { splats, output, .. } = arguments;
    let summary = splat::describe(splats, &ReadOptions::default())?;
    if summary.layout != splat::ply::ORDINARY {
        let message = "the file states itself what --like would take from another";
        return Err(Error::new(Kind::Usage, "VGS-CLI-129", message)
            .file(splats)
            .help("leave out --like")
            .into());
    }
    let original = splat::read(original, &ReadOptions::default())?;
    if original.unit.is_physical() && !set.unit.is_physical() {
        tracing::warn!("{}: the other program has left no intensities but their grey", splats.display());
    }
    let exceptions = original.exceptions.len();
    let set = set.with_statements_of(&original);
    if set.exceptions.len() < exceptions {
        tracing::warn!(
            "{}: without the {exceptions} voxels that are exceptions of the occupancy, since the splats are no \
             longer as many",
            output.display()
        );
    }
    Ok(set)
}

/// Returns `set` rounded to a coarse lattice and fitted again to the volume and region of the flags.
fn fitted_again(arguments: &ConvertArguments, set: &SplatSet, volume: &Path) -> Result<SplatSet, Stop> {
    let region = RoiArguments {
        roi: arguments.roi.clone(),
        roi_threshold: arguments.roi_threshold,
        roi_label: arguments.roi_label.clone(),
        cleaning: CleaningArguments::default(),
    };
    let (case, _) = Case::read_labelled(volume, &arguments.read, &region)?;
    let between_slices = between_slices_of(set, &case.volume);
    let grid = match between_slices.finer(&case.volume) {
        Some(finer) => Grid::of_voxels(finer.size(), finer.world_from_voxel()),
        None => Grid::of_voxels(case.volume.size, case.volume.world_from_voxel),
    };
    if set.grid != Some(grid) {
        let message = format!("the splats were fitted on another grid than that of {}", volume.display());
        return Err(Error::new(Kind::Usage, "VGS-CLI-100", message)
            .file(&arguments.splats)
            .help("give the volume of their fit, or no --volume")
            .into());
    }
    warn_of_another_volume(set, &case.volume, volume);
    let config = FitConfig {
        kernel: set.field.kernel,
        epsilon: set.field.epsilon,
        occupancy_w0: set.field.occupancy_w0,
        between_slices,
        form: if set.form == Form::Field { FitForm::Field } else { FitForm::Grid },
        ..FitConfig::default()
    };
    let problem = Problem::new(&case.volume, &case.roi, &config)?;
    let gpu = arguments.device.boot()?;
    let waiting = Waiting::on("fitting the rounded splats again");
    let mut going = |share| {
        waiting.at(share);
        ControlFlow::Continue(())
    };
    let splats = set.to_voxel(&grid.world_from_voxel);
    let fitted = problem.rounded_set(&gpu, &splats, 0, &mut going)?;
    Ok(SplatSet {
        iterations: set.iterations,
        labels: set.labels.clone(),
        label_names: set.label_names.clone(),
        ..fitted
    })
}

#[cfg(test)]
mod tests {
    use engine::splat::PLY_LAYOUTS;

    use super::*;

    #[test]
    fn a_layout_that_needs_the_volume_is_refused() {
        let usable: Vec<_> =
            PLY_LAYOUTS.iter().filter_map(|row| worldly_layout(row.name).ok()).map(|row| row.name).collect();
        assert_eq!(usable, ["vgs", "inria"]);
    }
}
