//! The command line of vgs: lists the commands, and hands the arguments to one of them.
//!
//! `commands` has one module for each; they use `report` (the texts and files at the end of a command) and
//! `picture` (the comparison as PNG), and all of these use `shared`. No module uses one of those before it,
//! and no command uses another.
#![forbid(unsafe_code)]

mod commands;
mod picture;
mod report;
mod shared;

use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

use shared::console::{Console, TalkArguments};
use shared::failure::{self, Stop};
use shared::help;
use shared::signals;
use shared::version::VERSION;

/// Volumetric Gaussian splatting: splats with physical intensities of regions of a CT or MR
#[derive(Parser)]
#[command(name = "vgs", version = VERSION, after_help = AFTER_HELP, max_term_width = 110)]
struct Cli {
    #[command(flatten)]
    talk: TalkArguments,
    #[command(subcommand)]
    command: Command,
}

const AFTER_HELP: &str = "\
A flag wins over the environment (VGS_ and the flag's name, as VGS_DEVICE),
that over --config, that over --quality, that over --profile.

Exit codes: 0 done, 2 wrong usage, 3 nothing to do, 65 bad input, 66 input
missing, 69 no usable device, 70 fault of this program or a fit that diverged,
71 out of memory, 73 output cannot be created, 74 reading or writing failed,
75 try again (device lost or full, output locked), 130 and 143 stopped by a
signal with what was reached written.

Volumes: folders and zips of DICOM slices, NIfTI (.nii, .nii.gz, .hdr and
.img), NRRD (.nrrd, .nhdr), MetaImage (.mha, .mhd), NumPy arrays (.npy) and
InVesalius projects (.inv3). Masks also: DICOM segmentations and RT structures.
Splats: PLY and .vgs. Pictures: PNG and EXR. Pages: HTML. For looking, not for diagnosis.";

#[derive(Subcommand)]
enum Command {
    Fit(Box<commands::fit::FitArguments>),
    Batch(commands::fit::BatchArguments),
    Blocks(commands::blocks::BlocksArguments),
    Eval(commands::eval::EvalArguments),
    Rasterize(commands::rasterize::RasterizeArguments),
    Render(Box<commands::render::RenderArguments>),
    #[cfg(feature = "window")]
    View(commands::view::ViewArguments),
    #[cfg(feature = "window")]
    Pack(commands::pack::PackArguments),
    Compare(commands::compare::CompareArguments),
    Stats(commands::stats::StatsArguments),
    Info(commands::info::InfoArguments),
    #[cfg(feature = "window")]
    Convert(Box<commands::convert::ConvertArguments>),
    Bake(commands::bake::BakeArguments),
    Page(commands::page::PageArguments),
    /// Lists the Vulkan devices of this machine
    Devices,
    Explain(commands::explain::ExplainArguments),
    Phantom(commands::phantom::PhantomArguments),
    Completions(commands::completions::CompletionsArguments),
    Man(commands::man::ManArguments),
}

fn main() -> ExitCode {
    #[cfg(feature = "window")]
    let start = std::time::Instant::now();
    failure::guard(|| {
        signals::survive_file_limits()?;
        signals::end_without_memory()?;
        failure::refuse_dash(std::env::args_os())?;
        let cli = parse()?;
        let console = Console::new(&cli.talk);
        console.start_logging();
        match cli.command {
            Command::Fit(arguments) => commands::fit::run(&arguments, &console),
            Command::Batch(arguments) => commands::fit::batch(&arguments, &console),
            Command::Blocks(arguments) => commands::blocks::run(&arguments, &console),
            Command::Eval(arguments) => commands::eval::run(&arguments, &console),
            Command::Rasterize(arguments) => commands::rasterize::run(&arguments, &console),
            Command::Render(arguments) => commands::render::run(&arguments, &console),
            #[cfg(feature = "window")]
            Command::View(arguments) => commands::view::run(&arguments, start),
            #[cfg(feature = "window")]
            Command::Pack(arguments) => commands::pack::run(&arguments, &console),
            Command::Compare(arguments) => commands::compare::run(&arguments, &console),
            Command::Stats(arguments) => commands::stats::run(&arguments, &console),
            Command::Info(arguments) => commands::info::run(&arguments, &console),
            #[cfg(feature = "window")]
            Command::Convert(arguments) => commands::convert::run(&arguments, &console),
            Command::Bake(arguments) => commands::bake::run(&arguments, &console),
            Command::Page(arguments) => commands::page::run(&arguments, &console),
            Command::Phantom(arguments) => commands::phantom::run(&arguments, &console),
            Command::Explain(arguments) => commands::explain::run(&arguments, &console),
            Command::Devices => commands::devices::run(&console),
            Command::Completions(arguments) => {
                commands::completions::run(&arguments, command_line(), &console)
            }
            Command::Man(arguments) => commands::man::run(&arguments, command_line(), &console),
        }
    })
}

/// Parses the command line. Help and version are printed here and stop the program with success.
fn parse() -> Result<Cli, Stop> {
    let matches = help::shortened(command_line()).try_get_matches().map_err(Stop::Arguments)?;
    Cli::from_arg_matches(&matches).map_err(Stop::Arguments)
}

/// Returns the whole command line.
fn command_line() -> clap::Command {
    Cli::command()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        help::shortened(command_line()).debug_assert();
    }
}
