//! Formats figures, for people as text and tables, for scripts in JSON.

use serde::Serializer;

/// Serialises infinity, which JSON lacks, as "inf".
pub fn decibel<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    if *value == f64::INFINITY { serializer.serialize_str("inf") } else { serializer.serialize_f64(*value) }
}

/// Formats a PSNR. Over an empty range it is infinite without meaning anything, which the text says.
pub fn psnr(value: f64, [low, high]: [f32; 2]) -> String {
    match (value == f64::INFINITY, high > low) {
        (true, false) => "∞ (range 0)".to_owned(),
        (true, true) => "∞ (exact)".to_owned(),
        (false, _) => format!("{value:.2} dB"),
    }
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

/// Formats bytes in a unit that people read.
pub fn bytes(n: u64) -> String {
    let n = n as f64;
    let row = [(1e9, "GB"), (1e6, "MB"), (1e3, "kB")].into_iter().find(|(unit, _)| n >= *unit);
    match row {
        Some((unit, name)) => format!("{:.1} {name}", n / unit),
        None => format!("{n:.0} bytes"),
    }
}

/// Formats seconds in units that people read.
pub fn seconds(s: f64) -> String {
    match s {
        s if !s.is_finite() => "?".to_owned(),
        s if s < 0.1 => format!("{:.0} ms", 1e3 * s),
        s if s < 10.0 => format!("{s:.1} s"),
        s if s < 120.0 => format!("{s:.0} s"),
        s if s < 7200.0 => format!("{:.0} min {:02.0} s", (s / 60.0).floor(), (s % 60.0).floor()),
        s => format!("{:.0} h {:02.0} min", (s / 3600.0).floor(), (s % 3600.0 / 60.0).floor()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_for_people() {
        for (n, text) in [(12, "12 bytes"), (2_500_000, "2.5 MB"), (7_000_000_000, "7.0 GB")] {
            assert_eq!(bytes(n), text);
        }
        for (s, text) in
            [(0.02, "20 ms"), (1.26, "1.3 s"), (61.2, "61 s"), (150.0, "2 min 30 s"), (1e4, "2 h 46 min")]
        {
            assert_eq!(seconds(s), text);
        }
        assert_eq!(psnr(f64::INFINITY, [5.0, 5.0]), "∞ (range 0)");
        assert_eq!(psnr(31.416, [0.0, 1.0]), "31.42 dB");
    }

    #[test]
    fn tables_align() {
        let text = table(&["", "b"], &[vec!["long".into(), "1".into()], vec!["ü".into(), String::new()]]);
        assert_eq!(text, "      b\nlong  1\nü\n");
    }
}
