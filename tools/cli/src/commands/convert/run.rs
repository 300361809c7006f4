//! Runs `vgs convert`, and writes files of splats.

use std::path::{Path, PathBuf};

use engine::render::Look;
use engine::splat::{self, ReadOptions, SplatSet, WriteOptions};
use engine::{Error, Kind};
use view::io::loaded_splats::LoadedSplats;
use view::io::saving::{self, Ready};
use view::model::state::{ViewState, is_session};

use super::again::{fitted_again, given_back};
use super::arguments::{ConvertArguments, ObjectFlag};
use super::coded::{self, is_of_volume};
use super::page;
use super::selection::selected;
use crate::shared::console::Console;
use crate::shared::failure::Stop;
use crate::shared::figures::bytes;
use crate::shared::inputs::is_volume;
use crate::shared::outputs;
use crate::shared::waiting::Waiting;

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
    let (splats, output) = (arguments.first(), &arguments.output);
    if arguments.live {
        splat::check_live(output)?;
    }
    if is_of_volume(splats)? {
        return coded::run(arguments, console);
    }
    refuse_volume(splats, output)?;
    arguments.check()?;
    let session = is_session(splats).then(|| arguments.session()).transpose()?;
    let mut inputs: Vec<&Path> = arguments.splats.iter().map(PathBuf::as_path).collect();
    inputs.extend(session.iter().flat_map(|state| &state.files.splats).map(PathBuf::as_path));
    inputs.extend(arguments.like.as_deref());
    inputs.extend(arguments.volume.as_deref());
    inputs.extend(arguments.roi.as_deref());
    outputs::check(&[output], &inputs, arguments.force)?;
    if arguments.writes_page() {
        return page::write(arguments, session, console);
    }
    let mut report = Report::default();
    let (mut set, look) = match session {
        Some(state) => arguments.of_session(state, &mut report)?,
        None => {
            let set = splat::read(splats, &ReadOptions::default())?;
            report.whole = set.count();
            (set, None)
        }
    };
    if let Some(original) = &arguments.like {
        set = given_back(arguments, set, original)?;
    }
    splat::check_held(output, &set)?;
    if !set.voxels.is_empty() && (arguments.tf.is_some() || arguments.volume.is_some()) {
        let message = "--tf and --volume are for splats, and these are coded voxels";
        return Err(Error::new(Kind::Usage, "VGS-CLI-170", message)
            .file(splats)
            .help("leave them out, or fit splats to the volume: vgs fit")
            .into());
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
    report.left_out = report.whole - ready.set.count() - ready.hidden;
    let colours = |flag: &ObjectFlag| matches!(flag, ObjectFlag::Shown(change) if change.changes_colour());
    if !coloured && (arguments.object_colours || arguments.object.iter().any(colours)) {
        tracing::warn!(
            "{}: colours, opacities and functions of objects are not in it; add --tf, or write a .glb, .spz or .sog",
            output.display()
        );
    }
    if coloured {
        (report.transfer_function, report.hidden) = (Some(look.transfer.name.clone()), ready.hidden);
        report.of_each = !look.functions.is_empty();
    }
    let live = arguments.live.then(|| look.shown_part(&set));
    let options = WriteOptions {
        layout: arguments.ply_layout,
        live: live.as_ref(),
        force: arguments.force,
        ..WriteOptions::default()
    };
    ready.write(output, &options)?;
    tell(arguments, console, &report, &ready)
}

/// Says what was written.
fn tell(arguments: &ConvertArguments, console: &Console, report: &Report, ready: &Ready) -> Result<u8, Stop> {
    let (splats, output) = (arguments.first(), &arguments.output);
    let Report { whole, left_out, ref transfer_function, of_each, hidden } = *report;
    let size = |path: &Path| std::fs::metadata(path).map_or(0, |found| found.len());
    let (before, after) = (size(splats), size(output));
    let count = ready.set.count();
    let what = if ready.set.splats.is_empty() { "voxels" } else { "splats" };
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
        console.say(&format!("{left_out} of {whole} {what} are not selected"));
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
        "{}: {count} {what}, {} ({:.1} bytes each); it was {}",
        output.display(),
        bytes(after),
        after as f64 / count.max(1) as f64,
        bytes(before),
    ));
    if ready.made_of.is_some() || arguments.live {
        console.say("vgs reads them from it with HU, kernel, grid and labels");
    } else if splat::is_coloured(output) && transfer_function.is_some() {
        console.say("it is without HU, kernel, grid and labels, so keep the splats that it is made of");
    }
    Ok(0)
}

impl ConvertArguments {
    /// Returns the splats that a session has left, and how it shows them.
    fn of_session(
        &self,
        mut state: ViewState,
        report: &mut Report,
    ) -> Result<(SplatSet, Option<Look>), Stop> {
        let read = |path: &PathBuf| Ok((path.clone(), splat::read_some(path)?.placed(None)?));
        let files = state.files.splats.iter().map(read).collect::<engine::Result<Vec<_>>>()?;
        if files.is_empty() {
            return Err(self.without_splats().into());
        }
        let mut loaded = LoadedSplats::join(files)?;
        report.whole = loaded.set.count();
        if !state.deleted.is_empty() {
            loaded = loaded.without(&state.deleted);
        }
        state.set_objects(loaded.objects.iter().map(|(row, ..)| row.clone()).collect());
        let (set, numbers) = loaded.of_files();
        let look = state.look(&numbers)?;
        Ok((set, Some(look)))
    }
}

/// Returns the splats that a look shows, as the output holds them.
fn prepared(
    arguments: &ConvertArguments,
    set: &SplatSet,
    look: &Look,
    coloured: bool,
) -> Result<Ready, Stop> {
    let (splats, output) = (arguments.first(), &arguments.output);
    let ready = if coloured {
        let gpu = arguments.device.boot()?;
        let _waiting = Waiting::on("finding the colours of the splats");
        saving::ready(&gpu, set, look, output, arguments.tf.is_some()).map_err(|error| error.file(splats))?
    } else {
        Ready { set: look.shown_part(set), made_of: None, hidden: 0 }
    };
    if !ready.set.is_empty() {
        return Ok(ready);
    }
    if ready.hidden == 0 {
        let message = format!("none of {} splats or voxels is shown", set.count());
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
