//! Formats numbers for tables.

/// Returns a dash, for a missing figure.
pub fn dash() -> String {
    "—".into()
}

/// Formats a PSNR in dB with two decimals.
pub fn db(psnr: f64) -> String {
    if psnr == f64::INFINITY { "∞".into() } else { format!("{psnr:.2}") }
}

/// Formats milliseconds with three digits or more.
pub fn ms(value: Option<f64>) -> String {
    match value {
        None => dash(),
        Some(v) if v >= 99.95 => format!("{v:.0}"),
        Some(v) if v >= 9.995 => format!("{v:.1}"),
        Some(v) => format!("{v:.2}"),
    }
}

/// Formats bytes as millions with three digits or more.
pub fn mb(bytes: u64) -> String {
    ms(Some(bytes as f64 / 1e6))
}

/// Formats a number with commas, as in 1,234,567.
pub fn thousands(value: u64) -> String {
    let digits = value.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}
