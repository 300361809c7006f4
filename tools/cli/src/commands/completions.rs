//! Prints the scripts that shells need to complete the arguments of vgs (`vgs completions`).

use clap::{Args, Command};
use clap_complete::Shell;

use crate::shared::console::Console;
use crate::shared::failure::Stop;

/// Prints a script with which a shell completes commands and flags
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct CompletionsArguments {
    /// The shell
    #[arg(value_enum)]
    shell: Shell,
}

const EXAMPLES: &str = "\
Examples:
  vgs completions bash > ~/.local/share/bash-completion/completions/vgs
  vgs completions zsh > ~/.zfunc/_vgs          with ~/.zfunc in fpath, before compinit
  vgs completions fish > ~/.config/fish/completions/vgs.fish
  vgs completions powershell >> $PROFILE";

/// Runs the command; `vgs` is the whole command line.
pub fn run(arguments: &CompletionsArguments, mut vgs: Command, console: &Console) -> Result<u8, Stop> {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut vgs, "vgs", &mut script);
    let script = String::from_utf8_lossy(&script);
    if console.json {
        let shell = arguments.shell.to_string();
        console.json_data(&serde_json::json!({ "shell": shell, "script": script }))?;
    } else {
        console.data(&script)?;
    }
    Ok(0)
}
