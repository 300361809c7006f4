//! Writes splats in another format (`vgs convert`).

use std::path::PathBuf;

use clap::Args;
use engine::splat::{self, PlyLayout, ReadOptions, WriteOptions};
use engine::{Error, Kind};

use crate::shared::console::Console;
use crate::shared::failure::Stop;
use crate::shared::figures::bytes;
use crate::shared::splat_files::worldly_layout;

/// Writes splats in another format; the extension of the output names it
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct ConvertArguments {
    /// The splats
    #[arg(value_name = "SPLATS")]
    splats: PathBuf,
    /// The splats as vgs wrote them, where SPLATS are what another program has made of these without the
    /// comments of vgs: kernel, background, grid and names of labels are taken from there
    #[arg(long, value_name = "ORIGINAL")]
    like: Option<PathBuf>,
    /// The file: .vgs, which is small and rounded, or .ply for other programs
    #[arg(short, long, value_name = "OUT", help_heading = "Output")]
    output: PathBuf,
    /// How a PLY is laid out: vgs (HU as one more property, what most programs read), or inria (rows of 62
    /// floats, for programs that know no others)
    #[arg(long, value_name = "LAYOUT", default_value = "vgs", value_parser = worldly_layout, help_heading = "Output")]
    ply_layout: &'static PlyLayout,
    /// Replaces an output that exists
    #[arg(short, long, help_heading = "Output")]
    force: bool,
}

const EXAMPLES: &str = "\
Examples:
  vgs convert bones.ply -o bones.vgs
  vgs convert bones.vgs -o bones.ply
  vgs convert bones.ply -o for-sibr.ply --ply-layout inria
  vgs convert edited.ply --like bones.ply -o edited-bones.ply";

/// Runs the command.
pub fn run(arguments: &ConvertArguments, console: &Console) -> Result<u8, Stop> {
    let ConvertArguments { splats, like, output, force, ply_layout } = arguments;
    let mut set = splat::read(splats, &ReadOptions::default())?;
    if let Some(original) = like {
        let summary = splat::describe(splats, &ReadOptions::default())?;
        if summary.layout != splat::ply::ORDINARY {
            let message = "the file states itself what --like would take from another";
            return Err(Error::new(Kind::Usage, "VGS-CLI-129", message)
                .file(splats)
                .help("leave out --like")
                .into());
        }
        let original = splat::read(original, &ReadOptions::default())?;
        if original.has_intensity && !set.has_intensity {
            tracing::warn!("{}: the other program has left no intensities but their grey", splats.display());
        }
        let exceptions = original.exceptions.len();
        set = set.with_statements_of(&original);
        if set.exceptions.len() < exceptions {
            tracing::warn!(
                "{}: without the {exceptions} voxels that are exceptions of the occupancy, since the splats are no \
                 longer as many",
                output.display()
            );
        }
    }
    let options = WriteOptions { layout: ply_layout, place: None, force: *force };
    splat::write_as(output, &set, &options)?;
    let size = |path: &PathBuf| std::fs::metadata(path).map_or(0, |found| found.len());
    let (before, after) = (size(&arguments.splats), size(&arguments.output));
    let count = set.splats.len();
    if console.json {
        console.json_data(&serde_json::json!({
            "output": arguments.output, "splats": count, "bytes_before": before, "bytes": after,
        }))?;
    } else {
        console.say(&format!(
            "{}: {count} splats, {} ({:.1} bytes a splat); it was {}",
            arguments.output.display(),
            bytes(after),
            after as f64 / count.max(1) as f64,
            bytes(before),
        ));
    }
    Ok(0)
}
