//! Writes the help as manual pages (`vgs man`).

use std::path::{Path, PathBuf};

use clap::{Args, Command};
use clap_mangen::Man;
use engine::Result;
use engine::output::write_atomic;

use crate::shared::console::Console;
use crate::shared::failure::Stop;
use crate::shared::outputs;
use crate::shared::version::NUMBER;

/// Writes manual pages: vgs.1, and one for each command
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct ManArguments {
    /// Folder of the pages, made if missing
    folder: PathBuf,
    /// Replaces pages that exist
    #[arg(short, long, help_heading = "Output")]
    force: bool,
}

const EXAMPLES: &str = "\
Examples:
  vgs man ~/.local/share/man/man1
  vgs man pages && man pages/vgs-fit.1";

/// Runs the command; `vgs` is the whole command line.
pub fn run(arguments: &ManArguments, vgs: Command, console: &Console) -> std::result::Result<u8, Stop> {
    let pages = pages(vgs, &arguments.folder);
    let files: Vec<&Path> = pages.iter().map(|(path, _)| path.as_path()).collect();
    outputs::make_folder(&arguments.folder)?;
    outputs::check(&files, &[], arguments.force)?;
    for (path, page) in &pages {
        write_page(path, page, arguments.force)?;
    }
    if console.json {
        let files: Vec<_> = files.iter().map(|path| path.display().to_string()).collect();
        console.json_data(&serde_json::json!({ "outputs": files }))?;
    } else {
        console.say(&format!("written: {} pages in {}", files.len(), arguments.folder.display()));
    }
    Ok(0)
}

/// Returns the pages of a command and of its subcommands, with their files.
fn pages(vgs: Command, folder: &Path) -> Vec<(PathBuf, Man)> {
    let mut vgs = vgs.disable_help_subcommand(true);
    // This gives subcommands their full names, as vgs-fit.
    vgs.build();
    let shown = vgs.get_subcommands().filter(|command| !command.is_hide_set()).cloned();
    let commands: Vec<Command> = std::iter::once(vgs.clone()).chain(shown).collect();
    let page = |command| {
        let page = Man::new(command).source(format!("vgs {NUMBER}")).manual("vgs");
        (folder.join(page.get_filename()), page)
    };
    commands.into_iter().map(page).collect()
}

fn write_page(path: &Path, page: &Man, force: bool) -> Result<()> {
    write_atomic(path, force, |mut out| page.render(&mut out))
}
