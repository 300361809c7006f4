//! Compares pictures or volumes, depending on the first file.

use super::arguments::CompareArguments;
use super::{pictures, volumes};
use crate::shared::console::Console;
use crate::shared::failure::Stop;

/// Runs the command.
pub fn run(arguments: &CompareArguments, console: &Console) -> Result<u8, Stop> {
    if arguments.of_volumes() {
        volumes::compare(arguments, console)
    } else {
        pictures::compare(arguments, console)
    }
}
