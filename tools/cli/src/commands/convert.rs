//! Writes splats in another format (`vgs convert`).

use std::path::PathBuf;

use clap::Args;
use engine::splat::{self, ReadOptions};

use crate::shared::console::Console;
use crate::shared::failure::Stop;
use crate::shared::figures::bytes;

/// Writes splats in another format; the extension of the output names it
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct ConvertArguments {
    /// The splats
    #[arg(value_name = "SPLATS")]
    splats: PathBuf,
    /// The file: .vgs, which is small and rounded, or .ply for other programs
    #[arg(short, long, value_name = "OUT", help_heading = "Output")]
    output: PathBuf,
    /// Replaces an output that exists
    #[arg(short, long, help_heading = "Output")]
    force: bool,
}

const EXAMPLES: &str = "\
Examples:
  vgs convert bones.ply -o bones.vgs
  vgs convert bones.vgs -o bones.ply";

/// Runs the command.
pub fn run(arguments: &ConvertArguments, console: &Console) -> Result<u8, Stop> {
    let set = splat::read(&arguments.splats, &ReadOptions::default())?;
    splat::write(&arguments.output, &set, arguments.force)?;
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
