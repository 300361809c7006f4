//! Rows of figures as a table for people, Markdown, CSV and JSON.

use std::path::Path;

use engine::{Result, output};
use serde::Serialize;

/// A table: column titles with units, and rows of text.
#[derive(Serialize)]
pub struct Table {
    /// What it shows, device and driver.
    pub title: String,
    /// Column titles with their units.
    pub columns: Vec<&'static str>,
    /// Cells, as printed.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// GitHub Markdown, which is also what the terminal shows.
    pub fn markdown(&self) -> String {
        let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
        let titles: Vec<String> = self.columns.iter().map(|&c| c.to_owned()).collect();
        let mut text = format!("{}\n\n{}", self.title, line(&titles));
        text += &format!("|{}\n", "---|".repeat(self.columns.len()));
        self.rows.iter().for_each(|r| text += &line(r));
        text
    }
}

/// Prints all tables and writes them to the files that were asked for.
pub fn finish(tables: &[Table], markdown: Option<&Path>, json: Option<&Path>, force: bool) -> Result<()> {
    let text = tables.iter().map(Table::markdown).collect::<Vec<_>>().join("\n");
    println!("{text}");
    if let Some(path) = markdown {
        output::write_atomic(path, force, |w| w.write_all(text.as_bytes()))?;
    }
    if let Some(path) = json {
        output::write_atomic(path, force, |w| serde_json::to_writer_pretty(w, tables).map_err(Into::into))?;
    }
    Ok(())
}
