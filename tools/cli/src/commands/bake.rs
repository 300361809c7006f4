//! Bakes what a transfer function shows of splats into colours for other viewers (`vgs bake`).

use std::collections::BTreeMap;
use std::iter::once;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use engine::bake::{BakeState, Baked, Options, Progress, bake, check};
use engine::output::write_atomic;
use engine::render::{Look, ObjectChange};
use engine::splat::{self, PlyLayout, ReadOptions, SplatSet, WriteOptions};
use engine::{Error, Kind};

use crate::report::curve;
use crate::shared::console::Console;
use crate::shared::failure::Stop;
use crate::shared::figures::{bytes, seconds};
use crate::shared::flags::{Clip, DeviceArguments, duration, on_off};
use crate::shared::inputs::InputRecord;
use crate::shared::interrupted::{self, state_path};
use crate::shared::light::LightArguments;
use crate::shared::looks::{self, look_of};
use crate::shared::outputs;
use crate::shared::signals::Signals;
use crate::shared::splat_files::layout;
use crate::shared::waiting::Waiting;

/// Bakes what a transfer function shows of splats into colours and opacities, for viewers that know no intensities
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct BakeArguments {
    /// The splats, with HU
    #[arg(value_name = "SPLATS")]
    splats: PathBuf,
    /// The file: .ply, .spz, which is small, .sog (for PlayCanvas), or .glb (glTF with KHR_gaussian_splatting). The curve is
    /// beside it, .csv and .svg
    #[arg(short, long, value_name = "OUT", help_heading = "Output")]
    output: PathBuf,
    /// Replaces an output that exists
    #[arg(short, long, help_heading = "Output")]
    force: bool,
    /// Goes on from OUT.state, which Ctrl-C leaves: to the file of baking that never stopped, bit for bit. Outputs are replaced
    #[arg(long, help_heading = "Output")]
    resume: bool,
    /// Puts the splats with their HU into an .spz as well (its version 4): vgs opens it with a live transfer function,
    /// other viewers show the colours, where they know that version
    #[arg(long, help_heading = "Output")]
    live: bool,
    /// How a PLY is laid out: vgs, what most programs read, or inria (rows of 62 floats, for programs that know no others)
    #[arg(long, value_name = "LAYOUT", default_value = "vgs", value_parser = layout, help_heading = "Output")]
    ply_layout: &'static PlyLayout,
    /// Transfer function: a preset, a file, or window:WIDTH,LEVEL, as in `vgs render` [default: of several objects the usual
    /// look of each; of one CT-Bone, or MR-Default without HU; where that shows nothing, a preset that does]
    #[arg(long, value_name = "PRESET|FILE", help_heading = "Picture")]
    tf: Option<String>,
    /// Lights surfaces, or not; as the transfer function says by default
    #[arg(long, value_name = "on|off", value_parser = on_off, help_heading = "Picture")]
    shade: Option<bool>,
    /// How an object is shown, as in `vgs render`: NAME:colour=#rrggbb, opacity=0..1, tf=CT-Bone, hidden; may be repeated
    #[arg(long, value_name = "NAME|N:HOW,...", help_heading = "Picture")]
    object: Vec<ObjectChange>,
    /// Gives each object its usual colour, as in `vgs render`
    #[arg(long, help_heading = "Picture")]
    object_colours: bool,
    /// Cuts away, as in `vgs render`: x<MM, x>MM and the like, or box:X0,Y0,Z0,X1,Y1,Z1 keeps a box; may be repeated
    #[arg(long, value_name = "PLANE|BOX", allow_hyphen_values = true, help_heading = "Picture")]
    clip: Vec<Clip>,
    #[command(flatten)]
    light: LightArguments,
    /// Steps, a picture each; 0 for the colours and opacities that are found without pictures
    #[arg(long, value_name = "N", default_value_t = Options::default().iterations, help_heading = "Quality")]
    iterations: u32,
    /// Most time for the steps, as 30s or 5m
    #[arg(long, value_name = "TIME", value_parser = duration, help_heading = "Quality")]
    time_budget: Option<Duration>,
    /// Most splats: of more the most important are kept, of fewer some are split where the pictures ask for it [default: twice
    /// as many as the transfer function shows]
    #[arg(long, value_name = "N", help_heading = "Quality", value_parser = clap::value_parser!(u32).range(1..))]
    max_splats: Option<u32>,
    /// Pictures, all around, that the splats are fitted to
    #[arg(long, value_name = "N", default_value_t = Options::default().views, help_heading = "Quality")]
    views: usize,
    /// Width and height of these pictures, pixels; the splats are made for pictures of 1024 either way
    #[arg(long, value_name = "PIXELS", default_value_t = Options::default().size, help_heading = "Quality")]
    size: u32,
    /// Degree of the harmonics by which colours depend on the direction, 0 to 3 [default: 3 with a
    /// light that turns with the camera, 2 with one of the patient, else 0]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(0..=3), help_heading = "Quality")]
    degree: Option<u8>,
    /// Seed of the order of the pictures; the same seed on the same device gives the same file, but with --time-budget
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = "Quality")]
    seed: u64,
    #[command(flatten)]
    device: DeviceArguments,
}

const EXAMPLES: &str = "\
Examples:
  vgs bake bones.ply -o bones-baked.ply
  vgs bake bones.vgs -o bones.spz --tf CT-Bones-Steep --shade off
  vgs bake bones.vgs -o bones.spz --headlight            a light that colours hold better than one from aside
  vgs bake bones.vgs -o bones.spz --live                 for vgs with any --tf, too
  vgs bake bones.vgs -o bones.spz --resume               goes on after Ctrl-C
  vgs bake organs.ply -o organs.glb --object-colours --max-splats 20000 --time-budget 1m

What other viewers draw of the file is what `vgs render` shows in mode decoded, as near as splats of fixed colours
come: the PSNR that is told is that of views between those which were fitted. Without --live the file has no HU: keep
the splats that it is made of.";

/// Runs the command.
pub fn run(arguments: &BakeArguments, console: &Console) -> Result<u8, Stop> {
    let (splats, output) = (&arguments.splats, &arguments.output);
    let curves = [".csv", ".svg"].map(|ending| outputs::beside(output, ending));
    let state = state_path(output);
    let force = arguments.force || arguments.resume;
    if !force {
        interrupted::check_none_left(std::slice::from_ref(&state))?;
    }
    let written: &[PathBuf] = if arguments.iterations > 0 { &curves } else { &[] };
    let written: Vec<&Path> =
        [output.as_path()].into_iter().chain(written.iter().map(PathBuf::as_path)).collect();
    outputs::check(&written, &[splats], force)?;
    let set = splat::read(splats, &ReadOptions::default())?;
    splat::check_held(output, &SplatSet::default())?;
    if arguments.live {
        splat::check_live(output)?;
    }
    if splat::rounds(output) {
        let message = "a .vgs holds no colours, and baked splats have nothing else";
        return Err(Error::new(Kind::Usage, "VGS-CLI-173", message)
            .file(output)
            .help("write a .ply, .spz, .sog or .glb")
            .into());
    }
    check(&set).map_err(|error| error.file(splats))?;
    let look = arguments.look(&set)?;
    let options = arguments.options();
    options.check()?;
    let notes = arguments.notes(&look)?;
    let resumed = if arguments.resume { Some(read_state(&state, &notes)?) } else { None };
    let signals = Signals::install()?;
    let gpu = arguments.device.boot()?;
    let baked = {
        let mut waiting = (false, Waiting::on("rendering the pictures that are wanted"));
        signals.defer_first_signal();
        bake(&gpu, &set, &look, &options, resumed.as_ref(), &mut |progress| {
            match *progress {
                Progress::Rendering(done, all) => waiting.1.at(done as f64 / all.max(1) as f64),
                Progress::Training(_, share) => {
                    if !waiting.0 {
                        waiting = (true, Waiting::on("fitting the splats to the pictures"));
                    }
                    waiting.1.at(share);
                }
            }
            match signals.exit_code() {
                Some(_) => ControlFlow::Break(()),
                None => ControlFlow::Continue(()),
            }
        })
        .map_err(|error| error.file(splats))?
    };
    let live = arguments.live.then(|| look.shown_part(&set));
    let write =
        WriteOptions { layout: arguments.ply_layout, live: live.as_ref(), force, ..WriteOptions::default() };
    splat::write_as(output, &baked.set, &write)?;
    let curve = &baked.report.curve;
    if baked.report.steps > 0 {
        let name = splats.file_name().unwrap_or_default().to_string_lossy();
        let title = format!("{name} by {}", look.transfer.name);
        let texts = [curve::csv_of_baking(curve), curve::svg_of_baking(curve, &title)?];
        for (path, text) in curves.iter().zip(&texts) {
            write_atomic(path, force, |out| out.write_all(text.as_bytes()))?;
        }
    }
    match &baked.unfinished {
        Some(unfinished) => {
            unfinished.write(&state, &interrupted::notes_text(&notes)?, true)?;
            let steps = format!("{} of {} steps", unfinished.steps, options.iterations);
            console.say(&format!(
                "{}: {steps} are done; the same command with --resume goes on",
                state.display()
            ));
        }
        // It is finished, or given up with --force.
        None => drop(std::fs::remove_file(&state)),
    }
    arguments.tell(console, &look, &baked)?;
    Ok(signals.exit_code().unwrap_or(0))
}

/// Reads the state of the command that has these notes.
fn read_state(path: &Path, notes: &Notes) -> engine::Result<BakeState> {
    if !path.exists() {
        return Err(interrupted::nothing_to_resume(path.to_owned()));
    }
    let (state, text) = BakeState::read(path)?;
    let then: Notes = serde_json::from_str(&text).map_err(|e| interrupted::bad_notes(path, &e))?;
    let changed: Vec<_> = notes
        .iter()
        .filter(|(name, now)| then.get(*name) != Some(now))
        .map(|(name, now)| match (name.as_str(), then.get(name)) {
            ("look" | "file of splats", _) | (_, None) => format!("the {name} differs"),
            (_, Some(was)) => format!("{name} was {was} and is now {now}"),
        })
        .collect();
    if changed.is_empty() { Ok(state) } else { Err(interrupted::of_other_work(path, &changed.join(", "))) }
}

/// Notes in a state: all that decides on what is baked, by name.
type Notes = BTreeMap<String, String>;

impl BakeArguments {
    fn notes(&self, look: &Look) -> engine::Result<Notes> {
        let Options { views, size, iterations, time_budget, max_splats, degree, seed, .. } = self.options();
        let numbers = [
            ("--views", format!("{views}")),
            ("--size", format!("{size}")),
            ("--iterations", format!("{iterations}")),
            ("--time-budget", format!("{time_budget:?}")),
            ("--max-splats", format!("{max_splats:?}")),
            ("--degree", format!("{degree:?}")),
            ("--seed", format!("{seed}")),
            ("look", format!("{look:?}")),
            ("file of splats", InputRecord::of(&self.splats)?.sha256),
        ];
        Ok(numbers.map(|(name, value)| (name.to_owned(), value)).into())
    }

    fn options(&self) -> Options {
        Options {
            views: self.views,
            size: self.size,
            iterations: self.iterations,
            time_budget: self.time_budget,
            max_splats: self.max_splats.map(|most| most as usize),
            degree: self.degree,
            seed: self.seed,
            ..Options::default()
        }
    }

    fn look(&self, set: &SplatSet) -> engine::Result<Look> {
        let mut look = look_of(set, self.tf.as_deref())?;
        look.light = self.light.light();
        for function in once(&mut look.transfer).chain(look.functions.values_mut()) {
            let material = &mut function.material;
            material.shade = self.shade.unwrap_or(material.shade);
            self.light.change(material);
        }
        self.light.warn_if_unlit(&look.transfer.material);
        looks::change(&mut look, set, self.object_colours, &self.object, &self.clip)?;
        Ok(look)
    }

    fn tell(&self, console: &Console, look: &Look, baked: &Baked) -> engine::Result<()> {
        let report = &baked.report;
        let size = std::fs::metadata(&self.output).map_or(0, |found| found.len());
        let count = baked.set.splats.len();
        if console.json {
            return console.json_data(&serde_json::json!({
                "output": self.output, "splats": count, "bytes": size, "hidden": baked.hidden,
                "transfer_function": look.transfer.name, "iterations": report.steps,
                "psnr_before_db": report.before, "psnr_db": report.after,
                "rendering_s": report.rendering_s, "training_s": report.training_s,
            }));
        }
        if report.steps == 0 && self.iterations > 0 {
            console.say("no step was done: colours and opacities are those of vgs convert --tf");
        } else if let [first, .., last] = &report.curve[..] {
            console.say(&format!(
                "{:.1} dB on {} views that were not fitted, {:.1} in the worst; {:.1} before {} steps",
                last.psnr_db,
                report.after.len(),
                last.worst_psnr_db,
                first.psnr_db,
                report.steps
            ));
        }
        console.say(&format!(
            "{}: {count} splats, {} ({:.1} bytes each), {} for pictures and {} for steps; {} HU",
            self.output.display(),
            bytes(size),
            size as f64 / count.max(1) as f64,
            seconds(report.rendering_s),
            seconds(report.training_s),
            if self.live { "vgs reads from it the splats with" } else { "without" },
        ));
        Ok(())
    }
}
