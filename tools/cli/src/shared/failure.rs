//! Ends the program: errors as text or JSON on stderr, exit codes, and panics turned into errors.

use std::ffi::OsString;
use std::io::Write;
use std::panic::{self, AssertUnwindSafe};
use std::process::ExitCode;
use std::sync::Mutex;

use engine::{Error, Kind};
use serde::Serialize;

use super::console::written;
use super::terminal::{clean, stderr_has_colour};

/// Reason why a command did not run to its end.
pub enum Stop {
    /// The command line is wrong, or it asks for help or version.
    Arguments(clap::Error),
    /// The command failed.
    Failed(Error),
}

impl From<Error> for Stop {
    fn from(error: Error) -> Self {
        Stop::Failed(error)
    }
}

/// Error as JSON. The names are part of the interface.
#[derive(Serialize)]
struct ErrorReport<'a> {
    level: &'static str,
    code: &'a str,
    file: Option<String>,
    msg: &'a str,
    help: &'a str,
    exit: u8,
}

/// Place and text of the first panic, kept by the hook for [`guard`].
static PANIC: Mutex<Option<String>> = Mutex::new(None);

/// Runs a command, reports its error and returns its exit code. A command that returns a number exits with
/// that number.
pub fn guard(run: impl FnOnce() -> Result<u8, Stop>) -> ExitCode {
    panic::set_hook(Box::new(|info| {
        let text = match info.payload().downcast_ref::<&str>() {
            Some(text) => (*text).to_owned(),
            None => info.payload().downcast_ref::<String>().cloned().unwrap_or_default(),
        };
        let place = info.location().map(ToString::to_string).unwrap_or_default();
        let mut last = PANIC.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        last.get_or_insert(format!("{text} ({place})"));
    }));
    let code = match panic::catch_unwind(AssertUnwindSafe(run)) {
        Ok(Ok(code)) => code,
        Ok(Err(Stop::Arguments(error))) => refuse_arguments(&error),
        Ok(Err(Stop::Failed(error))) => report(&error),
        Err(_) => report(&fault()),
    };
    ExitCode::from(code)
}

/// Runs a part of a command that others go on after, with a panic turned into an error.
///
/// # Errors
/// Those of `run`, and [`fault`].
pub fn caught<T>(run: impl FnOnce() -> engine::Result<T>) -> engine::Result<T> {
    panic::catch_unwind(AssertUnwindSafe(run)).unwrap_or_else(|_| Err(fault()))
}

/// Returns the error of a panic.
pub fn fault() -> Error {
    let what = PANIC.lock().unwrap_or_else(std::sync::PoisonError::into_inner).take();
    let message = format!("a fault in vgs itself: {}", what.unwrap_or_default());
    Error::new(Kind::Internal, "VGS-CLI-070", message).help(
        "please report this message with the command and, if you can, the input; outputs that existed are untouched",
    )
}

/// Refuses arguments that name standard input or output by a dash, as a file: vgs reads files again and at many places,
/// and writes them whole or not at all.
///
/// # Errors
/// [`Kind::Usage`] if there is one.
pub fn refuse_dash(arguments: impl Iterator<Item = OsString>) -> engine::Result<()> {
    let is_dash = |argument: &OsString| {
        let text = argument.to_string_lossy();
        text == "-" || text == "-o-" || text.starts_with("-") && text.ends_with("=-")
    };
    if !arguments.skip(1).take_while(|argument| argument != "--").any(|argument| is_dash(&argument)) {
        return Ok(());
    }
    let message = "- stands for standard input or output, and vgs reads and writes files";
    Err(Error::new(Kind::Usage, "VGS-CLI-145", message)
        .help("name a file (./- if it is called so); --json writes figures to standard output"))
}

/// Returns true if messages are to be JSON. This is read from the raw arguments, since they may be what is
/// wrong.
fn wants_json() -> bool {
    std::env::args_os().skip(1).take_while(|a| a != "--").any(|a| a == "--json")
}

/// Prints what is wrong with the arguments, or the help that they ask for, and returns the exit code.
fn refuse_arguments(error: &clap::Error) -> u8 {
    let code = u8::try_from(error.exit_code()).unwrap_or(2);
    if code == 0 {
        // Standard output keeps the last line until it is flushed.
        let printed = written(error.print().and_then(|()| std::io::stdout().flush()));
        return printed.map_or_else(|error| report(&error), |()| code);
    }
    if !wants_json() {
        // Standard error may be closed; then nobody reads it.
        let _ = error.print();
        return code;
    }
    report_json(&of_arguments(error))
}

/// Returns the error of arguments that are wrong.
pub fn of_arguments(error: &clap::Error) -> Error {
    let text = error.render().to_string();
    let mut parts = text.trim_start_matches("error: ").split("\n\n");
    let message = parts.next().unwrap_or_default().trim();
    let help = parts.collect::<Vec<_>>().join(" ");
    let help = help.split_whitespace().collect::<Vec<_>>().join(" ");
    Error::new(Kind::Usage, "VGS-CLI-001", message).help(help)
}

/// Writes an error to stderr and returns its exit code.
fn report(error: &Error) -> u8 {
    if wants_json() {
        return report_json(error);
    }
    let (bold, plain) = if stderr_has_colour() { ("\x1b[1;31m", "\x1b[0m") } else { ("", "") };
    let text = clean(&error.to_string());
    let mut out = format!("{bold}error[{}]{plain}: {text}\n", error.code);
    if !error.help.is_empty() {
        out.push_str(&format!("  help: {}\n", clean(&error.help)));
    }
    let _ = std::io::stderr().write_all(out.as_bytes());
    error.kind.exit_code()
}

/// Writes an error to stderr as one line of JSON and returns its exit code.
fn report_json(error: &Error) -> u8 {
    let exit = error.kind.exit_code();
    let line = serde_json::to_string(&ErrorReport {
        level: "error",
        code: error.code,
        file: error.file.as_ref().map(|f| f.display().to_string()),
        msg: &error.message,
        help: &error.help,
        exit,
    });
    let _ = writeln!(std::io::stderr(), "{}", line.unwrap_or_default());
    exit
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dash_is_no_file() {
        let check = |line: &str| refuse_dash(line.split(' ').map(OsString::from));
        for refused in
            ["vgs info -", "vgs fit ct.nii -o -", "vgs stats a.ply --csv=-", "vgs render a.ply -o-"]
        {
            assert_eq!(check(refused).expect_err(refused).code, "VGS-CLI-145");
        }
        for taken in ["vgs info ./-", "vgs render a.ply --box=-1,2", "vgs info a- -v", "vgs info -- a=-"] {
            assert!(check(taken).is_ok(), "{taken}");
        }
    }

    #[test]
    fn every_way_to_end_has_its_exit_code() {
        let before = panic::take_hook();
        assert_eq!(guard(|| Ok(130)), ExitCode::from(130));
        assert_eq!(guard(|| Err(Error::new(Kind::NothingToDo, "T", "").into())), ExitCode::from(3));
        assert_eq!(guard(|| panic!("on purpose")), ExitCode::from(70));
        panic::set_hook(before);
    }
}
