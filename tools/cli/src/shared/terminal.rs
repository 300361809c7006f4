//! Stderr as a terminal: tells whether it shows colours, removes what is not safe to write to it, and keeps
//! text and progress bars apart.

use std::io::{self, IsTerminal};
use std::sync::OnceLock;
use std::time::Duration;

use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Returns true if stderr may get colours and moving bars.
pub fn stderr_has_colour() -> bool {
    let no = std::env::var_os("NO_COLOR").is_some_and(|v| !v.is_empty());
    let dumb = std::env::var_os("TERM").is_some_and(|v| v == "dumb");
    !no && !dumb && io::stderr().is_terminal()
}

/// Escapes control characters that a file or a path may have brought into a text, also those that turn the direction of
/// writing; line breaks stay.
pub fn clean(text: &str) -> String {
    text.chars()
        .flat_map(|c| {
            let (keep, escaped) =
                if is_obeyed(c) && c != '\n' { (None, Some(c.escape_default())) } else { (Some(c), None) };
            keep.into_iter().chain(escaped.into_iter().flatten())
        })
        .collect()
}

fn is_obeyed(c: char) -> bool {
    c.is_control() || matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// Least time between plain lines of progress.
pub const LINE_EVERY: Duration = Duration::from_secs(5);
/// Number of positions of a bar.
pub const STEPS: u64 = 1000;

/// Adds a bar of [`STEPS`] positions to the terminal.
pub fn bar() -> ProgressBar {
    let style = ProgressStyle::with_template("{bar:20} {percent:>3}% {wide_msg}")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    bars().add(ProgressBar::new(STEPS).with_style(style))
}

/// Returns the progress bars of this program; at most one is shown on stderr.
pub fn bars() -> &'static MultiProgress {
    static TERMINAL: OnceLock<MultiProgress> = OnceLock::new();
    TERMINAL.get_or_init(|| {
        let target =
            if stderr_has_colour() { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        MultiProgress::with_draw_target(target)
    })
}

/// Runs `write`, which writes to stderr, while the bar is hidden.
pub fn suspend_bars(write: impl FnOnce()) {
    bars().suspend(write);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_shown_and_not_obeyed() {
        assert_eq!(clean("a\u{1b}[31mb\nc\u{7}ü"), "a\\u{1b}[31mb\nc\\u{7}ü");
    }
}
