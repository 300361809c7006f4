//! Writes data to stdout and everything else to stderr; plain or as JSON; with colour only on a terminal.

use std::fmt;
use std::io::{self, Write};
use std::sync::{Mutex, PoisonError};

use clap::{ArgAction, Args};
use engine::{Error, Kind, Result};
use serde::Serialize;
use tracing::{Event, Level, Subscriber, field};
use tracing_subscriber::filter::LevelFilter;
use tracing_subscriber::fmt::format::Writer;
use tracing_subscriber::fmt::{FmtContext, FormatEvent, FormatFields, MakeWriter};
use tracing_subscriber::registry::LookupSpan;

use super::terminal::{self, clean, stderr_has_colour};
use super::waiting;

/// Flags for the amount and the form of output.
#[derive(Args, Clone, Debug)]
pub struct TalkArguments {
    /// Says errors only
    #[arg(short, long, global = true, conflicts_with = "verbose", help_heading = "Output")]
    pub quiet: bool,
    /// Says more; twice for the details
    #[arg(short, long, global = true, action = ArgAction::Count, help_heading = "Output")]
    pub verbose: u8,
    /// Results as one JSON object on stdout, messages as JSON objects on stderr; a number that is infinite or undefined is
    /// null
    #[arg(long, global = true, help_heading = "Output")]
    pub json: bool,
}

/// Destination and form of the results and messages of this run.
#[derive(Clone, Debug)]
pub struct Console {
    /// True if results and messages are JSON.
    pub json: bool,
    /// True if only errors are written.
    pub quiet: bool,
    verbose: u8,
}

impl Console {
    /// Creates the console that the flags ask for.
    pub fn new(talk: &TalkArguments) -> Self {
        Console { json: talk.json, quiet: talk.quiet, verbose: talk.verbose }
    }

    /// Creates a console that writes no results and nothing for people.
    pub fn silent() -> Self {
        Console { json: false, quiet: true, verbose: 0 }
    }

    /// Sends the log of the engine to stderr.
    pub fn start_logging(&self) {
        let level = match (self.quiet, self.verbose) {
            (true, _) => LevelFilter::ERROR,
            (_, 0) => LevelFilter::WARN,
            (_, 1) => LevelFilter::INFO,
            _ => LevelFilter::DEBUG,
        };
        if self.quiet || self.json {
            waiting::be_silent();
        }
        tracing_subscriber::fmt()
            .with_max_level(level)
            .event_format(Line { json: self.json, colour: !self.json && stderr_has_colour() })
            .with_writer(Stderr)
            .init();
    }

    /// Writes a result to stdout. A closed pipe is no error.
    pub fn data(&self, text: &str) -> Result<()> {
        let mut out = io::stdout().lock();
        written(out.write_all(text.as_bytes()).and_then(|()| out.flush()))
    }

    /// Writes a result to stdout as one line of JSON.
    pub fn json_data(&self, value: &impl Serialize) -> Result<()> {
        let line = serde_json::to_string(value).map_err(|e| {
            Error::new(Kind::Internal, "VGS-CLI-003", format!("a result cannot be written as JSON: {e}"))
        })?;
        self.data(&(line + "\n"))
    }

    /// Writes a message for people to stderr, but not under `--quiet` or `--json`.
    pub fn say(&self, text: &str) {
        if !self.quiet && !self.json {
            terminal::suspend_bars(|| {
                let _ = writeln!(io::stderr(), "{text}");
            });
        }
    }
}

/// Name of the case that messages are about.
static CASE: Mutex<String> = Mutex::new(String::new());

/// Messages are about a case until this is dropped.
pub struct AboutCase(());

/// Puts the name of a case before all messages.
pub fn about_case(name: &str) -> AboutCase {
    name.clone_into(&mut CASE.lock().unwrap_or_else(PoisonError::into_inner));
    AboutCase(())
}

impl Drop for AboutCase {
    fn drop(&mut self) {
        CASE.lock().unwrap_or_else(PoisonError::into_inner).clear();
    }
}

/// Returns the error of a failed write to stdout. A closed pipe is none: nobody reads on.
pub fn written(outcome: io::Result<()>) -> Result<()> {
    match outcome {
        Err(e) if e.kind() != io::ErrorKind::BrokenPipe => {
            Err(Error::new(Kind::Io, "VGS-CLI-002", format!("writing to standard output failed: {e}")))
        }
        _ => Ok(()),
    }
}

/// Writer to stderr that hides a progress bar while text is written, and never fails.
struct Stderr;

impl Write for Stderr {
    fn write(&mut self, buffer: &[u8]) -> io::Result<usize> {
        terminal::suspend_bars(|| {
            let _ = io::stderr().write_all(buffer);
        });
        Ok(buffer.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl MakeWriter<'_> for Stderr {
    type Writer = Stderr;

    fn make_writer(&self) -> Stderr {
        Stderr
    }
}

/// Format of log events, one line each: `warning: text`, or an object with `level` and `msg`.
struct Line {
    json: bool,
    colour: bool,
}

impl<S, N> FormatEvent<S, N> for Line
where
    S: Subscriber + for<'a> LookupSpan<'a>,
    N: for<'a> FormatFields<'a> + 'static,
{
    fn format_event(&self, _: &FmtContext<'_, S, N>, mut out: Writer<'_>, event: &Event<'_>) -> fmt::Result {
        let mut text = Text(String::new());
        event.record(&mut text);
        let (name, colour) = match *event.metadata().level() {
            Level::ERROR => ("error", "\x1b[1;31m"),
            Level::WARN => ("warning", "\x1b[1;33m"),
            Level::INFO => ("info", "\x1b[32m"),
            _ => ("debug", "\x1b[2m"),
        };
        let case = CASE.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if self.json {
            let mut line = serde_json::json!({ "level": name, "msg": text.0 });
            if !case.is_empty() {
                line["case"] = case.into();
            }
            return writeln!(out, "{line}");
        }
        if !case.is_empty() {
            text.0 = format!("{case}: {}", text.0);
        }
        let (start, end) = if self.colour { (colour, "\x1b[0m") } else { ("", "") };
        writeln!(out, "{start}{name}{end}: {}", clean(&text.0))
    }
}

/// Message of an event with its fields behind it.
struct Text(String);

impl field::Visit for Text {
    fn record_debug(&mut self, field: &field::Field, value: &dyn fmt::Debug) {
        use fmt::Write;
        let _ = match field.name() {
            "message" => write!(self.0, "{value:?}"),
            name => write!(self.0, " {name}={value:?}"),
        };
    }
}
