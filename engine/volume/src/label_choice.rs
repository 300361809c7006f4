//! Which labels of a label map are meant: by number, name, range, pattern, or all.

use std::collections::{BTreeMap, BTreeSet};
use std::str::FromStr;

use super::Volume;
use super::mask_values::{label_of, unquoted};
use base::names::{self, Numbered};
use base::{Error, Kind, Result};

/// More labels than any atlas has; a file with more is an image.
const MAX_LABELS: usize = 1000;
/// What a choice of labels may be made of.
pub(super) const FORMS: &str = "choose labels by number or name (5,aorta), range (1-24), pattern (rib_*) or all; a name \
                     with a comma stands in quotes";

/// The choice of labels of a label map that make up the region.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum LabelChoice {
    /// The mask as it is, which must be binary or soft.
    #[default]
    Whole,
    /// The union of what these stand for, as [`names::chosen`] says: numbers, names of [`Volume::labels`] (in either case
    /// if only one is meant so), ranges, patterns or `all`.
    Labels(Vec<String>),
}

impl LabelChoice {
    /// Returns the numbers that are chosen of these labels, given by number and name; none if the mask is used as a
    /// whole. What stands for none of them is left out.
    ///
    /// # Errors
    /// [`Kind::Usage`] if a name may mean several.
    pub fn numbers<'a>(&self, labels: impl Iterator<Item = (i32, &'a str)>) -> Result<Vec<i32>> {
        let LabelChoice::Labels(asked) = self else { return Ok(Vec::new()) };
        let labels: Vec<Numbered<'_>> = labels.map(|(number, name)| (number, vec![name])).collect();
        let numbers: Result<Vec<_>> = asked.iter().map(|asked| numbers_of(asked, &labels)).collect();
        Ok(numbers?.into_iter().flatten().collect())
    }

    /// Returns the numbers of the labels of a mask, or of a part of one, that each entry of the choice stands for; what
    /// has no voxel there is left out.
    ///
    /// # Errors
    /// [`Kind::Usage`] if a name may mean several, or the mask has too many values to be labels.
    pub fn present_in(&self, mask: &Volume) -> Result<Vec<Vec<i32>>> {
        let LabelChoice::Labels(asked) = self else { return Ok(Vec::new()) };
        let Some(present) = present_labels(mask) else {
            return Err(lacks(mask, "has no label", &asked.join(",")));
        };
        let name = |label: &i32| mask.labels.get(label).map(String::as_str).into_iter().collect();
        let labels: Vec<Numbered<'_>> = present.keys().map(|label| (*label, name(label))).collect();
        asked.iter().map(|asked| numbers_of(asked, &labels)).collect()
    }
}

/// Returns the numbers that an entry of a choice stands for among these labels, as [`names::chosen`] says.
///
/// # Errors
/// [`Kind::Usage`] if it differs in case only from several names.
fn numbers_of(asked: &str, labels: &[Numbered<'_>]) -> Result<Vec<i32>> {
    let found = names::chosen(asked, labels);
    let named = labels.iter().flat_map(|(number, names)| names.iter().map(|name| (*number, *name)));
    let alike: Vec<_> = named.filter(|(_, name)| name.to_lowercase() == asked.to_lowercase()).collect();
    let is_meant = alike.iter().any(|(_, name)| *name == asked) || asked.parse::<i32>().is_ok();
    match alike.as_slice() {
        [first, rest @ ..] if !is_meant && rest.iter().any(|other| other.1 != first.1) => {
            let list: Vec<_> = alike.iter().map(|(number, name)| format!("{number} {name}")).collect();
            let message = format!("'{asked}' may mean {}", list.join(", "));
            Err(Error::new(Kind::Usage, "VGS-ROI-018", message)
                .help("give the number, or the name as it is written there"))
        }
        _ => Ok(found),
    }
}

impl FromStr for LabelChoice {
    type Err = Error;

    /// Parses `N|name,...`. A name with a comma stands in quotes: `"kidney, left",5`.
    fn from_str(text: &str) -> Result<Self> {
        let labels = unquoted(text);
        if labels.iter().any(String::is_empty) {
            let message = format!("'{text}' is no list of labels");
            return Err(Error::new(Kind::Usage, "VGS-ROI-001", message).help(FORMS));
        }
        Ok(LabelChoice::Labels(labels))
    }
}

/// Returns the labels in a mask of whole numbers with their voxel counts, zero left out; `None` if there are
/// too many to be labels.
pub(super) fn present_labels(mask: &Volume) -> Option<BTreeMap<i32, usize>> {
    let mut counts = BTreeMap::new();
    for label in mask.samples.iter().map(|&v| label_of(v)).filter(|&label| label != 0) {
        *counts.entry(label).or_insert(0) += 1;
        if counts.len() > MAX_LABELS {
            return None;
        }
    }
    Some(counts)
}

/// Tells which labels the mask has: all of a few, else those that may have been meant by `asked`, and where the rest
/// is listed.
pub(super) fn there_are(mask: &Volume, asked: &str) -> String {
    let Some(present) = present_labels(mask) else { return "it has too many values to be labels".into() };
    let entry = |(label, count): (&i32, &usize)| match mask.labels.get(label) {
        Some(name) => format!("{label} {name} ({count} voxels)"),
        None => format!("{label} ({count} voxels)"),
    };
    if present.len() <= names::FEW {
        return format!("it has {}", present.iter().map(entry).collect::<Vec<_>>().join(", "));
    }
    let names = present.keys().filter_map(|label| mask.labels.get(label)).map(String::as_str);
    let meant = names::meant_of_many(asked, names);
    format!("{meant}`vgs info` of the mask lists its {} labels", present.len())
}

/// Returns the error of a choice that the mask does not have, and why.
fn lacks(mask: &Volume, why: &str, asked: &str) -> Error {
    let message = format!("the mask {why} '{asked}'");
    Error::new(Kind::Usage, "VGS-ROI-010", message).help(there_are(mask, asked))
}

/// Returns the numbers of the labels of a mask that are chosen by `asked`.
pub(super) fn resolve(asked: &[String], mask: &Volume) -> Result<Vec<i32>> {
    let present = present_labels(mask);
    // A name without a voxel is known as well, and not taken for another one.
    let known: BTreeSet<i32> =
        mask.labels.keys().chain(present.iter().flat_map(BTreeMap::keys)).copied().collect();
    let names = |label: i32| mask.labels.get(&label).map(String::as_str).into_iter().collect();
    let known: Vec<Numbered<'_>> = known.into_iter().map(|label| (label, names(label))).collect();
    let is_there = |label: &i32| present.as_ref().is_none_or(|present| present.contains_key(label));
    let mut chosen = Vec::new();
    for asked in asked {
        let found = match (numbers_of(asked, &known)?, asked.parse()) {
            // Of a mask with too many labels to be counted a number is believed.
            (found, Ok(number)) if found.is_empty() && present.is_none() => vec![number],
            (found, _) => found,
        };
        let before = chosen.len();
        chosen.extend(found.iter().copied().filter(is_there));
        if chosen.len() == before {
            let why = if found.is_empty() { "has no label" } else { "has no voxel of the label" };
            return Err(lacks(mask, why, asked));
        }
    }
    Ok(chosen)
}
