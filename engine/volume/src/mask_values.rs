//! What the values of a mask stand for, and the parts of a text that chooses among its labels.

use super::Volume;
use base::{Error, Kind};

/// How far a whole number may be from itself, after a scaling or a resampling in single precision.
pub(super) const ROUNDING: f32 = 1e-3;

/// Returns the label that a sample stands for.
pub(super) fn label_of(sample: f32) -> i32 {
    sample.round() as i32
}

/// Returns true if a sample is a whole number, but for the rounding of a scaled or resampled file: 0.9999999 is.
pub(super) fn is_whole(sample: f32) -> bool {
    (sample - sample.round()).abs() <= ROUNDING
}

/// Returns the error of a label map with values between labels.
pub(super) fn between_labels(mask: &Volume, between: usize) -> Error {
    let value = mask.samples.iter().copied().find(|&v| !is_whole(v)).unwrap_or_default();
    let message = format!(
        "{between} of {} values of the mask lie between labels, such as {value}: it has been interpolated",
        mask.len()
    );
    Error::new(Kind::BadData, "VGS-ROI-020", message)
        .help("resample the label map again, by nearest neighbour; or use one label of it as a soft mask from 0 to 1")
}

/// Returns the parts of a list with commas between, without the quotes around some of them. A quote that has no end is a
/// part of its own, as it stands.
pub(super) fn unquoted(text: &str) -> Vec<String> {
    let mut parts = Vec::new();
    let mut rest = text.trim();
    loop {
        let quoted = rest.chars().next().filter(|c| matches!(c, '"' | '\'')).and_then(|quote| {
            let (inside, after) = rest[1..].split_once(quote)?;
            let after = after.trim_start();
            (after.is_empty() || after.starts_with(',')).then_some((inside, after))
        });
        let (part, after) = quoted.unwrap_or_else(|| rest.split_at(rest.find(',').unwrap_or(rest.len())));
        parts.push(part.trim().to_owned());
        match after.strip_prefix(',') {
            Some(next) => rest = next.trim_start(),
            None => return parts,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_numbers_may_be_a_rounding_away_from_themselves() {
        for (value, label) in
            [(0.999_999_9, 1), (2.9999, 3), (-1e-7, 0), (254.999_98, 255), (7.0, 7), (-3.0, -3)]
        {
            assert!(is_whole(value) && label_of(value) == label, "{value}");
        }
        for value in [0.5, 2.49, 2.998, f32::NAN, f32::INFINITY] {
            assert!(!is_whole(value), "{value}");
        }
    }

    #[test]
    fn quotes_keep_the_commas_of_a_name() {
        for (text, expected) in [
            ("5, aorta", &["5", "aorta"][..]),
            (r#""kidney, left",5"#, &["kidney, left", "5"]),
            ("'a,b' , \"c\"", &["a,b", "c"]),
            ("it's, 5\" wire", &["it's", "5\" wire"]),
            ("\"open, 5", &["\"open", "5"]),
            ("", &[""]),
            ("1,,2", &["1", "", "2"]),
            ("\"a\",", &["a", ""]),
        ] {
            assert_eq!(unquoted(text), expected, "{text}");
        }
    }
}
