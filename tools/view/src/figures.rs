//! Formats figures for people.

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
    }
}
