//! Names by which users choose among numbered things, as labels and objects, and names that they mistype.

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

/// Things up to which an error lists all that there are; of more it names a few that are similar.
pub const FEW: usize = 8;
/// Most names that are suggested.
const SUGGESTED: usize = 3;

/// Returns the beginning of advice for a user who asked for an unknown name of many: "did you mean X or Y? " with a few
/// that are similar, or nothing.
pub fn meant_of_many<'a>(asked: &str, names: impl Iterator<Item = &'a str> + Clone) -> String {
    match similar(asked, names).as_slice() {
        [] => String::new(),
        similar => format!("did you mean {}? ", similar.join(" or ")),
    }
}

/// Returns a few names that a user may have meant by `asked`: the [nearest](nearest) one, and those that have it as a
/// part.
fn similar<'a>(asked: &str, names: impl Iterator<Item = &'a str> + Clone) -> Vec<&'a str> {
    let lower = asked.to_lowercase();
    let part = |name: &&str| lower.chars().count() > 1 && name.to_lowercase().contains(&lower);
    let mut found: Vec<&str> = nearest(asked, names.clone()).into_iter().collect();
    for name in names.filter(part) {
        if found.len() < SUGGESTED && !found.contains(&name) {
            found.push(name);
        }
    }
    found
}

/// A thing that is chosen by its number or by one of its names.
pub type Numbered<'a> = (i32, Vec<&'a str>);

/// Returns the numbers of those of `things` that a user means by `asked`. The first of these that finds any counts:
/// its number, a name as it stands, a name in either case, `all`, a range of numbers (`1-24`), and a pattern of
/// names in either case, in which `*` stands for any letters and `?` for one.
pub fn chosen(asked: &str, things: &[Numbered<'_>]) -> Vec<i32> {
    let numbers = |wanted: &dyn Fn(i32) -> bool| -> Vec<i32> {
        things.iter().map(|(number, _)| *number).filter(|&number| wanted(number)).collect()
    };
    let named = |wanted: &dyn Fn(&str) -> bool| -> Vec<i32> {
        let found = things.iter().filter(|(_, names)| names.iter().any(|name| wanted(name)));
        found.map(|(number, _)| *number).collect()
    };
    let ways: [&dyn Fn() -> Vec<i32>; 6] = [
        &|| asked.parse().map_or(Vec::new(), |asked: i32| numbers(&|number| number == asked)),
        &|| named(&|name| name == asked),
        &|| named(&|name| name.to_lowercase() == asked.to_lowercase()),
        &|| if asked.eq_ignore_ascii_case("all") { numbers(&|_| true) } else { Vec::new() },
        &|| range(asked).map_or(Vec::new(), |range| numbers(&|number| range.contains(&number))),
        &|| match asked.contains(['*', '?']) {
            true => named(&|name| has_pattern(&name.to_lowercase(), &asked.to_lowercase())),
            false => Vec::new(),
        },
    ];
    ways.iter().map(|way| way()).find(|found| !found.is_empty()).unwrap_or_default()
}

/// Parses a range of numbers from 0 on, as `1-24`.
fn range(text: &str) -> Option<std::ops::RangeInclusive<i32>> {
    let (first, last) = text.split_once('-')?;
    let number = |text: &str| text.trim().parse().ok().filter(|&number: &i32| number >= 0);
    Some(number(first)?..=number(last)?)
}

/// Returns true if `name` has the form of a pattern, in which `*` stands for any letters and `?` for one.
fn has_pattern(name: &str, pattern: &str) -> bool {
    let (name, pattern): (Vec<char>, Vec<char>) = (name.chars().collect(), pattern.chars().collect());
    // The places in both, and those to go back to where the letters after the last star did not fit.
    let (mut n, mut p, mut back) = (0, 0, None);
    while n < name.len() {
        match pattern.get(p) {
            Some('*') => {
                p += 1;
                back = Some((p, n));
            }
            Some(&letter) if letter == '?' || letter == name[n] => (n, p) = (n + 1, p + 1),
            _ => match &mut back {
                Some((after, from)) => {
                    *from += 1;
                    (p, n) = (*after, *from);
                }
                None => return false,
            },
        }
    }
    pattern[p..].iter().all(|&letter| letter == '*')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn things_are_chosen_by_numbers_names_ranges_and_patterns() {
        let things: Vec<Numbered<'_>> = vec![
            (1, vec!["rib_left_1"]),
            (2, vec!["rib_left_2"]),
            (3, vec!["Rib_right_1"]),
            (7, vec!["all"]),
            (8, vec!["1-3"]),
            (12, vec!["kidney_left", "a/kidney_left"]),
            (13, vec![]),
        ];
        for (asked, expected) in [
            ("2", &[2][..]),
            ("13", &[13]),
            ("5", &[]),
            ("RIB_left_2", &[2]),
            ("rib_*", &[1, 2, 3]),
            ("*_LEFT", &[12]),
            ("*_left*", &[1, 2, 12]),
            ("rib_????_1", &[1]),
            ("a/*", &[12]),
            ("*", &[1, 2, 3, 7, 8, 12]),
            ("2-12", &[2, 3, 7, 8, 12]),
            ("14-99", &[]),
            ("5-2", &[]),
            ("-3", &[]),
            ("rib", &[]),
            ("", &[]),
            // A name as it stands comes before what it would stand for.
            ("all", &[7]),
            ("1-3", &[8]),
        ] {
            assert_eq!(chosen(asked, &things), expected, "{asked}");
        }
        assert_eq!(chosen("ALL", &things[..3]), [1, 2, 3]);
        let twice: Vec<Numbered<'_>> = vec![(1, vec!["Liver"]), (2, vec!["liver"]), (3, vec!["liver"])];
        assert_eq!(chosen("liver", &twice), [2, 3], "the name as it stands, and all that have it");
        assert_eq!(chosen("LIVER", &twice), [1, 2, 3]);
    }

    #[test]
    fn similar_names_are_the_nearest_and_those_with_a_part() {
        let names = ["rib_left_1", "rib_left_2", "rib_right_1", "liver"];
        let names = || ["rib_left_3"].into_iter().chain(names);
        assert_eq!(similar("lver", names()), ["liver"]);
        assert_eq!(similar("RIB", names()), ["rib_left_3", "rib_left_1", "rib_left_2"], "no more than three");
        assert_eq!(meant_of_many("left_1", names()), "did you mean rib_left_1? ");
        assert_eq!(meant_of_many("right", names()), "did you mean rib_right_1? ");
        assert!(meant_of_many("spleen", names()).is_empty());
        assert!(similar("r", names()).is_empty(), "one letter is no part");
    }

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
