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

/// Formats seconds since 1970 as a date, 2026-01-31T12:00:00Z (H. Hinnant, "chrono-compatible low-level date algorithms",
/// civil_from_days).
pub fn utc(seconds: u64) -> String {
    let (days, time) = (seconds / 86400, seconds % 86400);
    let shifted = days + 719_468;
    let (era, day_of_era) = (shifted / 146_097, shifted % 146_097);
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month_from_march = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month_from_march + 2) / 5 + 1;
    let month = if month_from_march < 10 { month_from_march + 3 } else { month_from_march - 9 };
    let year = year_of_era + era * 400 + u64::from(month <= 2);
    let (hour, minute, second) = (time / 3600, time / 60 % 60, time % 60);
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}Z")
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

    #[test]
    fn dates() {
        for (seconds, date) in [
            (0, "1970-01-01T00:00:00Z"),
            (951_782_399, "2000-02-28T23:59:59Z"),
            (951_782_400, "2000-02-29T00:00:00Z"),
            (1_767_225_599, "2025-12-31T23:59:59Z"),
            (4_107_542_400, "2100-03-01T00:00:00Z"),
        ] {
            assert_eq!(utc(seconds), date);
        }
    }
}
