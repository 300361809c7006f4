//! Tables of figures for people, as Markdown and JSON.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use engine::{Error, Kind, Result, output};
use serde::Serialize;

/// Table with column titles and rows of text.
#[derive(Serialize)]
pub struct Table {
    /// Title: what the table shows, device and driver.
    pub title: String,
    /// Column titles with their units.
    pub columns: Vec<&'static str>,
    /// Cells, as printed.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// Returns the table as GitHub Markdown, which the terminal shows, too.
    pub fn markdown(&self) -> String {
        let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
        let titles: Vec<String> = self.columns.iter().map(|&c| c.to_owned()).collect();
        let mut text = format!("{}\n\n{}", self.title, line(&titles));
        text += &format!("|{}\n", "---|".repeat(self.columns.len()));
        self.rows.iter().for_each(|r| text += &line(r));
        text
    }

    /// Returns the table as comma-separated values.
    pub fn csv(&self) -> String {
        let cell = |text: &str| {
            let quoted = text.contains([',', '"', '\n']);
            if quoted { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_owned() }
        };
        let line =
            |cells: &mut dyn Iterator<Item = &str>| cells.map(cell).collect::<Vec<_>>().join(",") + "\n";
        let mut text = line(&mut self.columns.iter().copied());
        for row in &self.rows {
            text += &line(&mut row.iter().map(String::as_str));
        }
        text
    }
}

/// Files that tables are written to, besides the terminal.
#[derive(Args)]
pub struct Outputs {
    /// Writes the tables as Markdown
    #[arg(long, value_name = "FILE")]
    pub markdown: Option<PathBuf>,
    /// Writes what was measured as JSON
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Replaces files
    #[arg(long)]
    pub force: bool,
}

impl Outputs {
    /// Prints all tables and writes them to the files that were asked for.
    pub fn finish(&self, tables: &[Table]) -> Result<()> {
        self.finish_with(tables, &tables)
    }

    /// Prints all tables and writes them to the files that were asked for; the JSON file holds `json`
    /// instead.
    pub fn finish_with(&self, tables: &[Table], json: &impl Serialize) -> Result<()> {
        let text = tables.iter().map(Table::markdown).collect::<Vec<_>>().join("\n");
        println!("{text}");
        if let Some(path) = &self.markdown {
            output::write_atomic(path, self.force, |w| w.write_all(text.as_bytes()))?;
        }
        if let Some(path) = &self.json {
            output::write_atomic(path, self.force, |w| {
                serde_json::to_writer_pretty(w, json).map_err(Into::into)
            })?;
        }
        Ok(())
    }
}

/// Returns a value as indented JSON.
///
/// # Errors
/// Returns [`Kind::Internal`] if it cannot be written as JSON.
pub fn json(value: &impl Serialize) -> Result<String> {
    serde_json::to_string_pretty(value)
        .map_err(|e| Error::new(Kind::Internal, "VGS-BEN-026", format!("writing JSON failed: {e}")))
}

/// Returns the exit code of a program, and prints its error if there is one.
pub fn exit(result: Result<()>) -> ExitCode {
    let Err(e) = result else { return ExitCode::SUCCESS };
    eprintln!("error[{}]: {e}", e.code);
    if !e.help.is_empty() {
        eprintln!("  help: {}", e.help);
    }
    ExitCode::from(e.kind.exit_code())
}
