//! The command line of vgs.
//!
//! One file for each command (`fit`, `eval`, `rasterize`, `render`, `compare`, `view`, `info`, `devices`, `phantom`): its flags,
//! and `run`. What they share: `inputs` (volume and region of interest), `settings` (hyper-parameters from flags,
//! environment and file), `optimise` (the loop of a fit), `report` (figures, run record, curve), `picture` (the
//! comparison as PNG), `splats` (their files in any layout), and the ways to talk: `console` (stdout and logs), `failure` (errors and exit codes),
//! `progress`, `signals`.
#![forbid(unsafe_code)]

mod arguments;
mod budget;
mod checkpoint;
mod clock;
mod compare;
mod console;
mod devices;
mod eval;
mod explain;
mod failure;
mod fit;
mod info;
mod inputs;
mod lock;
mod optimise;
mod outputs;
mod phantom;
mod picture;
mod progress;
mod rasterize;
mod render;
mod report;
mod settings;
mod signals;
mod splats;
mod view;

use arguments::Command;
use console::Console;

fn main() -> std::process::ExitCode {
    let start = std::time::Instant::now();
    failure::guard(|| {
        let cli = arguments::parse()?;
        let console = Console::new(&cli.talk);
        console.start_logging();
        match cli.command {
            Command::Fit(arguments) => fit::run(&arguments, &console),
            Command::Eval(arguments) => eval::run(&arguments, &console),
            Command::Rasterize(arguments) => rasterize::run(&arguments, &console),
            Command::Render(arguments) => render::run(&arguments, &console),
            Command::View(arguments) => view::run(&arguments, start),
            Command::Compare(arguments) => compare::run(&arguments, &console),
            Command::Info(arguments) => info::run(&arguments, &console),
            Command::Phantom(arguments) => phantom::run(&arguments, &console),
            Command::Devices => devices::run(&console),
        }
    })
}
