//! `vgs-xr`: splats in a headset.
#![forbid(unsafe_code)]

use std::process::ExitCode;

use clap::Parser as _;
use xr_app::HeadsetArguments;

fn main() -> ExitCode {
    match xr_app::run(&HeadsetArguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("error[{}]: {e}", e.code);
            if !e.help.is_empty() {
                eprintln!("  help: {}", e.help);
            }
            ExitCode::from(e.kind.exit_code())
        }
    }
}
