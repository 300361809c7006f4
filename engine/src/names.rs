//! Names that users mistype.

/// The longest name that is compared; a longer one is no mistyped name.
const LONGEST: usize = 64;

/// Returns the name that was probably meant by `asked`: the one with the fewest errors of typing (letters
/// inserted, left out, replaced, or two of them exchanged), if these are fewer than half of its letters.
pub fn nearest<'a>(asked: &str, names: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    if asked.len() > LONGEST {
        return None;
    }
    let asked = asked.to_lowercase();
    let near = names.map(|name| (strsim::osa_distance(&asked, &name.to_lowercase()), name));
    near.filter(|(errors, name)| 2 * errors < name.chars().count())
        .min_by_key(|(errors, _)| *errors)
        .map(|(_, name)| name)
}

/// Returns the beginning of advice for a user who asked for an unknown name: "did you mean X? ", or nothing.
pub fn meant<'a>(asked: &str, names: impl Iterator<Item = &'a str>) -> String {
    nearest(asked, names).map(|name| format!("did you mean {name}? ")).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_few_errors_are_forgiven() {
        let known = || ["preview", "standard", "fine", "exact"].into_iter();
        for (asked, expected) in
            [("fien", "fine"), ("FINE", "fine"), ("standart", "standard"), ("extact", "exact")]
        {
            assert_eq!(nearest(asked, known()), Some(expected), "{asked}");
        }
        for asked in ["", "x", "best", &"fine".repeat(100)] {
            assert_eq!(nearest(asked, known()), None, "{asked}");
        }
        assert_eq!(
            (meant("fien", known()).as_str(), meant("?", known()).as_str()),
            ("did you mean fine? ", "")
        );
    }
}
