//! Names that a page may tell. Files are often named after patients, so the name of a file is in a page only where all of
//! its words are those of anatomy.

use std::collections::BTreeMap;

use crate::source::Source;

/// Title of a page whose objects do not name it.
const TITLE: &str = "Volume";
/// Most objects that a title names.
const MOST_NAMED: usize = 3;
/// Longest title, letters.
const LONGEST: usize = 120;

/// Words of anatomy and of its directions, as label maps have them (TotalSegmentator, 3D Slicer). Whole words alone count:
/// some names of people begin like these.
#[rustfmt::skip]
const WORDS: &[&str] = &[
    "abdomen", "abdominal", "adrenal", "airway", "airways", "all", "ankle", "anterior", "aorta", "arm", "arteries",
    "artery", "atrial", "atrium", "autochthon", "bladder", "body", "bone", "bones", "bowel", "brachiocephalic", "brain",
    "breast", "bronchi", "cardiac", "carotid", "cartilage", "cartilages", "cava", "cavity", "cerebellum", "cerebrum",
    "chest", "clavicle", "clavicula", "colon", "common", "coronary", "cortical", "costal", "cranium", "cyst", "disc",
    "discs", "duodenum", "elbow", "esophagus", "external", "eye", "face", "fat", "femoral", "femur", "fibula", "foot",
    "gallbladder", "gland", "gluteus", "hand", "head", "heart", "hip", "hips", "humerus", "iliac", "iliopsoas",
    "inferior", "internal", "intervertebral", "intestine", "jaw", "joint", "kidney", "kidneys", "knee", "large", "left",
    "leg", "lesion", "liver", "lobe", "lower", "lumbar", "lung", "lungs", "mandible", "maxilla", "maximus", "medius",
    "metal", "middle", "minimus", "muscle", "muscles", "myocardium", "neck", "nerve", "nodule", "oesophagus", "of",
    "optic", "organ", "organs", "pancreas", "patella", "pelvis", "portal", "posterior", "prostate", "pulmonary",
    "radius", "rectum", "renal", "rib", "ribs", "right", "sacrum", "scapula", "shoulder", "skeleton", "skin", "skull",
    "small", "soft", "spinal", "spine", "spleen", "splenic", "sternum", "stomach", "subclavian", "superior", "teeth",
    "thoracic", "thorax", "thyroid", "tibia", "tissue", "tissues", "tooth", "torso", "trachea", "trunk", "tumor",
    "tumour", "ulna", "upper", "urinary", "vascular", "vein", "veins", "vena", "ventricle", "vertebra", "vertebrae",
    "vessel", "vessels", "wrist", "and", "cord",
];

/// Returns true if all words of a name are those of anatomy, or such numbers as ribs and vertebrae have.
fn is_plain(name: &str) -> bool {
    let lower = name.to_lowercase();
    let mut words = lower.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).peekable();
    let is_number = |word: &str| {
        let digits = word.strip_prefix(['c', 't', 'l', 's']).unwrap_or(word);
        (1..=2).contains(&digits.len()) && digits.bytes().all(|c| c.is_ascii_digit())
    };
    let begins_with_a_word = words.peek().is_some_and(|first| WORDS.contains(first));
    begins_with_a_word && words.all(|word| WORDS.contains(&word) || is_number(word))
}

/// Returns the name of an object that is called after a file: that of the file if it is plain, or else one by the place of
/// the object among `count`.
pub fn of_file(stem: &str, place: usize, count: usize) -> String {
    match (is_plain(stem), count) {
        (true, _) => stem.to_owned(),
        (false, 1) => TITLE.to_owned(),
        (false, _) => format!("Object {}", place + 1),
    }
}

/// Returns the names of the objects of all sources, in their order: those of their labels, or of the file where there are
/// none. Of several with one name all but the first have a number.
pub fn of_objects(sources: &[Source]) -> Vec<String> {
    let mut names = Vec::new();
    for source in sources {
        for object in source.set.objects() {
            names.push(match source.set.labels {
                Some(_) => object.name,
                None => of_file(&source.stem, names.len(), sources.len()),
            });
        }
    }
    told_apart(names)
}

/// Returns names of which no two are the same.
pub fn told_apart(mut names: Vec<String>) -> Vec<String> {
    let mut seen = BTreeMap::new();
    for name in &mut names {
        let count = seen.entry(name.clone()).or_insert(0);
        *count += 1;
        if *count > 1 {
            *name = format!("{name} ({count})");
        }
    }
    names
}

/// Returns the title of a page: the one that was given, or the names of its objects where they are few and plain.
pub fn title(given: Option<&str>, objects: &[&str]) -> String {
    let given = given.map(|text| text.split_whitespace().collect::<Vec<_>>().join(" "));
    if let Some(title) = given.filter(|title| !title.is_empty()) {
        return title.chars().filter(|c| !c.is_control()).take(LONGEST).collect();
    }
    if objects.len() > MOST_NAMED || !objects.iter().all(|name| is_plain(name)) {
        return TITLE.to_owned();
    }
    let text = objects.join(", ").replace('_', " ");
    let mut letters = text.chars();
    letters.next().map_or(TITLE.to_owned(), |first| first.to_uppercase().chain(letters).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_words_of_anatomy_are_plain() {
        for plain in [
            "bones",
            "Kidney_left",
            "vertebrae_L3",
            "rib right 7",
            "soft-tissue",
            "portal_vein_and_splenic_vein",
        ] {
            assert!(is_plain(plain), "{plain}");
        }
        for other in [
            "",
            "mueller",
            "Mueller_bones",
            "19570203",
            "ct",
            "Heartfield",
            "bones 1957",
            "l3",
            "7",
            "Rib eiro",
        ] {
            assert!(!is_plain(other), "{other}");
        }
    }

    #[test]
    fn a_title_is_what_was_given_or_says_what_is_there() {
        for (given, objects, wanted) in [
            (Some("A  case\n of\u{7} mine "), &["bones"][..], "A case of mine"),
            (Some(" "), &["bones"], "Bones"),
            (None, &["kidney_left", "aorta"], "Kidney left, aorta"),
            (None, &["Mueller", "aorta"], "Volume"),
            (None, &["a", "b", "c", "d"], "Volume"),
            (None, &[], "Volume"),
        ] {
            assert_eq!(title(given, objects), wanted);
        }
        assert_eq!(title(Some(&"ü".repeat(500)), &[]).chars().count(), LONGEST);
    }

    #[test]
    fn objects_are_told_apart() {
        let names = ["a", "b", "a", "a"].map(str::to_owned).to_vec();
        assert_eq!(told_apart(names), ["a", "b", "a (2)", "a (3)"]);
        assert_eq!((of_file("bones", 3, 9), of_file("Mueller", 3, 9)), ("bones".into(), "Object 4".into()));
        assert_eq!(of_file("Mueller", 0, 1), "Volume");
    }
}
