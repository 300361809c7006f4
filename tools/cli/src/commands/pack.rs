//! Packs a session with all of its files into a zip (`vgs pack`).

use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;
use view::io::pack::{Contents, pack};
use view::model::state::ViewState;

use crate::shared::console::Console;
use crate::shared::failure::Stop;
use crate::shared::figures::bytes;
use crate::shared::outputs;
use crate::shared::progress::Steps;

/// Packs a session of the window with all of its files into one zip, to be sent
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct PackArguments {
    /// The session (TOML), as `vgs view` writes it
    #[arg(value_name = "SESSION")]
    session: PathBuf,
    /// The zip
    #[arg(short, long, value_name = "OUT.zip", help_heading = "Output")]
    output: PathBuf,
    /// Replaces an output that exists
    #[arg(short, long, help_heading = "Output")]
    force: bool,
}

const EXAMPLES: &str = "\
Examples:
  vgs pack session.toml -o case.zip
  vgs view case.zip                    opens it as it is, or after unpacking

Files that are not where the session says are looked for beside it. Of a DICOM folder the series that is shown
is packed; its files name the patient. The same files make the same bytes.";

/// Output of `--json`.
#[derive(Serialize)]
struct PackOutput {
    output: String,
    files: usize,
    bytes: u64,
    dicom: bool,
}

/// Runs the command.
pub fn run(arguments: &PackArguments, console: &Console) -> Result<u8, Stop> {
    let PackArguments { session, output, force } = arguments;
    let state = ViewState::read(session)?;
    let files = state.files.all().map(PathBuf::as_path);
    let inputs: Vec<&Path> = files.chain([session.as_path()]).collect();
    outputs::check(&[output], &inputs, *force)?;
    let mut steps = Steps::new(console, "percent", 100);
    let mut progress = |part: f32| steps.done((part * 100.0) as u64);
    let Contents { files, bytes: size, has_dicom } = pack(&state, output, *force, &mut progress)?;
    if has_dicom {
        tracing::warn!("{}: the DICOM files in it name the patient", output.display());
    }
    let output = output.display().to_string();
    if console.json {
        console.json_data(&PackOutput { output, files, bytes: size, dicom: has_dicom })?;
    } else {
        console.say(&format!("written: {output} (the session and {files} files, {})", bytes(size)));
    }
    Ok(0)
}
