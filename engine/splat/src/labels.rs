//! Labels: the structure of a label map that each splat of a set belongs to.

use serde::Serialize;

use super::SplatSet;

/// Longest name of a label in bytes, so that the names of all labels fit into the header of a file.
const NAME_BYTES: usize = 120;

/// A label with its name and its number of splats.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct LabelCount {
    /// The label; 0 stands for no label.
    pub label: u8,
    /// The name of the label, if it has one.
    pub name: Option<String>,
    /// Number of splats with this label.
    pub splats: usize,
}

/// Returns `text` as the name of a label: one line of words with single spaces between them, without control
/// characters, cut off after 120 bytes. The name may be empty.
pub fn label_name(text: &str) -> String {
    let printable = |c: char| if c.is_control() { ' ' } else { c };
    let text: String = text.chars().map(printable).collect();
    let mut name = text.split_whitespace().collect::<Vec<_>>().join(" ");
    let end = (0..=NAME_BYTES.min(name.len())).rfind(|&at| name.is_char_boundary(at)).unwrap_or(0);
    name.truncate(end);
    name.truncate(name.trim_end().len());
    name
}

impl SplatSet {
    /// Returns the labels of the splats with their names and counts, ascending; empty if the set has no
    /// labels. A small structure may have voxels of the region and no splat.
    pub fn label_counts(&self) -> Vec<LabelCount> {
        if self.labels.is_none() {
            return Vec::new();
        }
        let mut counts = [0usize; 256];
        let has_voxels = |label| self.region.as_ref().is_some_and(|region| region.fit_of(label).is_some());
        for &label in self.labels.iter().flatten() {
            counts[usize::from(label)] += 1;
        }
        let name = |label| self.label_names.iter().find(|(l, _)| *l == label).map(|(_, name)| name.clone());
        (0..=u8::MAX)
            .zip(counts)
            .filter(|&(label, splats)| splats > 0 || has_voxels(label))
            .map(|(label, splats)| LabelCount { label, name: name(label), splats })
            .collect()
    }

    /// Returns why the labels or their names cannot be written, or `None` if they can.
    pub(super) fn label_defect(&self) -> Option<&'static str> {
        let count = |labels: &Vec<u8>| labels.len() == self.splats.len();
        let name = |(_, name): &(u8, String)| !name.is_empty() && *name == label_name(name);
        let conditions = [
            (self.labels.as_ref().is_none_or(count), "there is not one label for every splat"),
            (self.label_names.iter().all(name), "the name of a label is not one line of text"),
            (self.label_names.is_sorted_by(|a, b| a.0 < b.0), "the labels with names do not ascend"),
            (self.label_names.iter().all(|(label, _)| *label > 0), "label 0 has a name"),
        ];
        conditions.iter().find_map(|&(good, why)| (!good).then_some(why))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Splat;

    #[test]
    fn names_are_one_line_of_bounded_length() {
        for (text, name) in [
            ("liver", "liver"),
            (" left\tatrial \r\n appendage ", "left atrial appendage"),
            ("\u{1b}[31mred\u{0}", "[31mred"),
            ("Größe\u{2028}1", "Größe 1"),
            (" \n", ""),
        ] {
            assert_eq!(label_name(text), name, "{text:?}");
            assert_eq!(label_name(name), name, "cleaning twice changes nothing");
        }
        for long in ["ß".repeat(200), "ab ".repeat(100), format!("a{}", "\u{1f600}".repeat(99))] {
            let name = label_name(&long);
            assert!((115..=120).contains(&name.len()) && long.starts_with(&name), "{name}");
            assert_eq!(label_name(&name), name);
        }
    }

    #[test]
    fn counts_and_defects() {
        let mut set = SplatSet { splats: vec![Splat::default(); 4], ..SplatSet::default() };
        assert!(set.label_counts().is_empty() && set.label_defect().is_none());
        set.labels = Some(vec![5, 0, 255, 5]);
        set.label_names = vec![(5, "liver".into()), (7, "aorta".into())];
        let expected = [(0, None, 1), (5, Some("liver"), 2), (255, None, 1)];
        let expected =
            expected.map(|(label, name, splats)| LabelCount { label, name: name.map(str::to_owned), splats });
        assert_eq!(set.label_counts(), expected);
        assert_eq!(set.label_defect(), None);
        for (names, word) in [
            (vec![(7, "a".to_owned()), (5, "b".to_owned())], "ascend"),
            (vec![(5, "a".to_owned()), (5, "b".to_owned())], "ascend"),
            (vec![(5, "two\nlines".to_owned())], "one line"),
            (vec![(5, String::new())], "one line"),
            (vec![(0, "none".to_owned())], "label 0"),
        ] {
            let broken = SplatSet { label_names: names, ..set.clone() };
            assert!(broken.label_defect().is_some_and(|why| why.contains(word)), "{word}");
        }
        set.labels = Some(vec![1; 3]);
        assert!(set.label_defect().is_some_and(|why| why.contains("one label for every splat")));
    }
}
