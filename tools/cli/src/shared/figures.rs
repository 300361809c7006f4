//! Formats figures, for people as text and tables, for scripts in JSON.

pub use engine::figures::{bytes, seconds};

/// Formats a PSNR. Over an empty range it is infinite without meaning anything, which the text says.
pub fn psnr(value: f64, [low, high]: [f32; 2]) -> String {
    match (value == f64::INFINITY, high > low) {
        (true, false) => "∞ (range 0)".to_owned(),
        (true, true) => "∞ (exact)".to_owned(),
        (false, _) => format!("{value:.2} dB"),
    }
}

/// Returns the heading of a column with the unit of its numbers, if they have one: `mean, HU`.
pub fn with_unit(name: &str, unit: &str) -> String {
    if unit.is_empty() { name.to_owned() } else { format!("{name},{unit}") }
}

/// Formats rows under headings as columns; empty columns on the right are trimmed.
pub fn table(heads: &[&str], rows: &[Vec<String>]) -> String {
    let width = |column: usize| {
        let cells = rows.iter().filter_map(|row| row.get(column)).map(|cell| cell.chars().count());
        cells.chain([heads[column].chars().count()]).max().unwrap_or_default()
    };
    let widths: Vec<usize> = (0..heads.len()).map(width).collect();
    let line = |cells: &mut dyn Iterator<Item = &str>| {
        let padded: Vec<String> = cells
            .zip(&widths)
            .map(|(cell, &w)| format!("{cell}{}", " ".repeat(w.saturating_sub(cell.chars().count()))))
            .collect();
        padded.join("  ").trim_end().to_owned() + "\n"
    };
    let mut out = line(&mut heads.iter().copied());
    for row in rows {
        out.push_str(&line(&mut row.iter().map(String::as_str)));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_for_people() {
        assert_eq!(psnr(f64::INFINITY, [5.0, 5.0]), "∞ (range 0)");
        assert_eq!(psnr(31.416, [0.0, 1.0]), "31.42 dB");
    }

    #[test]
    fn tables_align() {
        let text = table(&["", "b"], &[vec!["long".into(), "1".into()], vec!["ü".into(), String::new()]]);
        assert_eq!(text, "      b\nlong  1\nü\n");
    }
}
