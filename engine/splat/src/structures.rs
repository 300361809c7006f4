//! What anatomical structures are and in which colours they are usually drawn, by words of their names.
//!
//! Names are those of label maps, as TotalSegmentator and 3D Slicer write them: `kidney_left`, `portal vein and
//! splenic vein`, `vertebrae_L3`. The colours are near those of 3D Slicer's table of anatomy, which its users
//! know. Structures without a known word get colours in turn, which people of all kinds of colour vision can
//! tell apart (Okabe and Ito 2008).

use std::collections::HashMap;

use StructureKind::{Airway, Bone, Fat, Implant, Lesion, Lung, Muscle, Nerve, Organ, Other, Skin, Vessel};

/// Kind of a structure, which says what shows it well (`UsualLook` of crate `render`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum StructureKind {
    /// Organs of soft tissue, with stomach and bowel.
    Organ,
    /// Vessels and the heart.
    Vessel,
    /// Bones and cartilage.
    Bone,
    /// Lungs and their lobes.
    Lung,
    /// Airways, which hold air.
    Airway,
    /// Muscles and tendons.
    Muscle,
    /// Brain and nerves.
    Nerve,
    /// What does not belong there: tumours, cysts, bleeding.
    Lesion,
    /// Fat.
    Fat,
    /// Skin, or all of the body.
    Skin,
    /// Metal and other foreign bodies.
    Implant,
    /// A structure whose name says nothing.
    Other,
}

impl StructureKind {
    /// Returns the heading under which such structures stand together.
    pub fn heading(self) -> &'static str {
        match self {
            Organ => "Organs",
            Vessel => "Heart and vessels",
            Bone => "Bones",
            Lung | Airway => "Lungs and airways",
            Muscle => "Muscles",
            Nerve => "Brain and nerves",
            Lesion => "Lesions",
            Fat | Skin => "Fat and skin",
            Implant => "Implants",
            Other => "Others",
        }
    }
}

/// Beginnings of words, the colour of the structures that they name, and their kind. The first row that fits counts, so a
/// vein of an organ stands before the organ.
const STRUCTURES: [(&[&str], [u8; 3], StructureKind); 31] = [
    (
        &[
            "tumo", "lesion", "cyst", "metasta", "nodule", "bleed", "hemorr", "haemorr", "hematom",
            "haematom", "effusion", "thromb", "emboli", "aneurysm",
        ],
        [144, 238, 144],
        Lesion,
    ),
    (
        &[
            "brain",
            "cerebr",
            "cerebell",
            "hippocamp",
            "white",
            "grey",
            "gray",
            "gyrus",
            "thalam",
            "putamen",
            "caudate",
            "pallid",
            "amygdal",
            "pons",
        ],
        [250, 250, 225],
        Nerve,
    ),
    (&["vein", "vena", "venous", "cava", "portal"], [0, 151, 206], Vessel),
    (
        &[
            "aort",
            "arter",
            "iliaca",
            "carotid",
            "subclavian",
            "brachiocephalic",
            "celiac",
            "coeliac",
            "mesenteric",
            "coronar",
            "trunk",
            "vessel",
        ],
        [216, 55, 60],
        Vessel,
    ),
    (&["atri", "ventricle", "heart", "myocard", "pericard"], [206, 110, 84], Vessel),
    (
        &[
            "muscle",
            "muscul",
            "gluteus",
            "iliopsoas",
            "psoas",
            "autochthon",
            "quadricep",
            "sartorius",
            "tendon",
            "ligament",
            "diaphragm",
        ],
        [192, 104, 88],
        Muscle,
    ),
    (&["vertebra", "sacrum", "spine", "coccyx"], [226, 202, 134], Bone),
    (&["interverteb", "disc", "disk", "menisc", "cartilag"], [176, 190, 200], Bone),
    (&["rib", "sternum", "costal", "clavic", "scapula"], [253, 232, 158], Bone),
    (
        &[
            "bone", "skull", "crani", "mandib", "maxill", "zygom", "hip", "pelvi", "femur", "femor",
            "humerus", "radius", "ulna", "tibia", "fibula", "patella", "tarsal", "carpal", "metatars",
            "metacarp", "phalan", "talus", "calcan",
        ],
        [241, 214, 145],
        Bone,
    ),
    (&["tooth", "teeth"], [255, 250, 220], Bone),
    (&["liver", "hepat"], [221, 130, 101], Organ),
    (&["spleen"], [157, 108, 162], Organ),
    (&["kidney", "renal"], [185, 102, 83], Organ),
    (&["adrenal"], [244, 186, 150], Organ),
    (&["pancrea"], [249, 180, 111], Organ),
    (&["gall", "bile", "biliary"], [139, 150, 98], Organ),
    (&["stomach", "gastr"], [216, 132, 105], Organ),
    (&["duoden", "bowel", "intestin", "jejun", "ileum"], [205, 167, 142], Organ),
    (&["colon", "rectum", "sigmoid", "cecum", "caecum", "append"], [204, 168, 143], Organ),
    (&["esophag", "oesophag"], [211, 171, 143], Organ),
    (&["urinary", "bladder", "ureter", "urethra"], [222, 154, 132], Organ),
    (&["prostat", "uter", "ovar", "testi", "vagin", "seminal"], [230, 158, 140], Organ),
    (&["trachea", "bronch", "airway"], [182, 228, 255], Airway),
    (&["lung", "pulmon"], [197, 165, 145], Lung),
    (&["thyroid", "thymus", "gland", "parotid", "submandib", "lymph", "breast"], [62, 162, 114], Organ),
    (&["cord", "nerve", "optic"], [244, 214, 49], Nerve),
    (&["eye", "lens"], [194, 142, 170], Organ),
    (&["fat", "adipose", "subcutan"], [230, 220, 70], Fat),
    (&["skin", "body", "face"], [177, 122, 101], Skin),
    (&["implant", "metal", "screw", "stent", "catheter", "electrode", "prosthe"], [148, 173, 190], Implant),
];

/// Colours of structures that have no row.
const IN_TURN: [[u8; 3]; 7] = [
    [230, 159, 0],
    [86, 180, 233],
    [0, 158, 115],
    [240, 228, 66],
    [0, 114, 178],
    [213, 94, 0],
    [204, 121, 167],
];

/// Brightness of structures that share a colour, in turn: ribs and lobes that touch are told apart.
const SHADES: [f32; 3] = [1.0, 0.8, 0.9];

/// Returns the number of the first row that fits a name: the label of "file/label", or else all of it.
fn row_of(name: &str) -> Option<usize> {
    let label = name.rsplit_once('/').and_then(|(_, label)| row_of_words(label));
    label.or_else(|| row_of_words(name))
}

fn row_of_words(name: &str) -> Option<usize> {
    let name = name.to_lowercase();
    let words = || name.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty());
    let named = |beginnings: &[&str]| words().any(|word| beginnings.iter().any(|b| word.starts_with(b)));
    STRUCTURES.iter().position(|(beginnings, ..)| named(beginnings))
}

/// Returns the kind of the structure of this name.
pub fn kind_of_structure(name: &str) -> StructureKind {
    row_of(name).map_or(Other, |row| STRUCTURES[row].2)
}

/// Returns the colours, from 0 to 1, of the structures of these names, in their order. Structures of one row differ
/// in brightness; those without a row take the next colour of a few. Those of one name have one colour.
pub fn usual_colours<'a>(names: impl IntoIterator<Item = &'a str>) -> Vec<[f32; 3]> {
    let (mut taken, mut unknown) = ([0; STRUCTURES.len()], 0);
    let mut known = HashMap::new();
    let mut colour = |name| {
        let (colour, turn) = match row_of(name) {
            Some(row) => {
                taken[row] += 1;
                (STRUCTURES[row].1, taken[row] - 1)
            }
            None => {
                unknown += 1;
                (IN_TURN[(unknown - 1) % IN_TURN.len()], (unknown - 1) / IN_TURN.len())
            }
        };
        colour.map(|byte| f32::from(byte) / 255.0 * SHADES[turn % SHADES.len()])
    };
    names.into_iter().map(|name| *known.entry(name).or_insert_with(|| colour(name))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn structures_have_their_rows() {
        // Names of TotalSegmentator and of other maps, beside the row that is meant.
        for (name, word) in [
            ("kidney_left", "kidney"),
            ("kidney_cyst_left", "cyst"),
            ("portal_vein_and_splenic_vein", "vein"),
            ("inferior_vena_cava", "vena"),
            ("Aorta", "aort"),
            ("iliac_artery_right", "arter"),
            ("brachiocephalic_trunk", "trunk"),
            ("pulmonary_vein", "vein"),
            ("atrial_appendage_left", "atri"),
            ("lung_upper_lobe_left", "lung"),
            ("vertebrae_L3", "vertebra"),
            ("rib_right_7", "rib"),
            ("heart_atrium_left", "atri"),
            ("gallbladder", "gall"),
            ("urinary_bladder", "urinary"),
            ("small_bowel", "bowel"),
            ("bones and organs/liver", "liver"),
            ("liver/label 5", "liver"),
            ("spinal_cord", "cord"),
            ("gluteus_maximus_left", "gluteus"),
            ("costal_cartilages", "cartilag"),
            ("intervertebral_discs", "disc"),
            ("thyroid_gland", "thyroid"),
            ("skull", "skull"),
            ("hip_left", "hip"),
            ("left hippocampus", "hippocamp"),
            ("intermuscular_fat", "fat"),
            ("skeletal_muscle", "muscle"),
        ] {
            let row = STRUCTURES.iter().position(|(words, ..)| words.contains(&word)).expect("a row");
            assert_eq!(row_of(name), Some(row), "{name}");
        }
        assert_eq!(kind_of_structure("trachea"), Airway);
        assert_eq!(kind_of_structure("label 12"), Other);
    }

    /// Classes of TotalSegmentator's task "total", version 2, without ribs and vertebrae.
    #[rustfmt::skip]
    const TOTAL: &[&str] = &[
        "spleen", "kidney_right", "kidney_left", "gallbladder", "liver", "stomach", "pancreas",
        "adrenal_gland_right", "adrenal_gland_left", "lung_upper_lobe_left", "lung_lower_lobe_left",
        "lung_upper_lobe_right", "lung_middle_lobe_right", "lung_lower_lobe_right", "esophagus", "trachea",
        "thyroid_gland", "small_bowel", "duodenum", "colon", "urinary_bladder", "prostate", "kidney_cyst_left",
        "kidney_cyst_right", "sacrum", "heart", "aorta", "pulmonary_vein", "brachiocephalic_trunk",
        "subclavian_artery_right", "subclavian_artery_left", "common_carotid_artery_right",
        "common_carotid_artery_left", "brachiocephalic_vein_left", "brachiocephalic_vein_right",
        "atrial_appendage_left", "superior_vena_cava", "inferior_vena_cava", "portal_vein_and_splenic_vein",
        "iliac_artery_left", "iliac_artery_right", "iliac_vena_left", "iliac_vena_right", "humerus_left",
        "humerus_right", "scapula_left", "scapula_right", "clavicula_left", "clavicula_right", "femur_left",
        "femur_right", "hip_left", "hip_right", "spinal_cord", "gluteus_maximus_left", "gluteus_maximus_right",
        "gluteus_medius_left", "gluteus_medius_right", "gluteus_minimus_left", "gluteus_minimus_right",
        "autochthon_left", "autochthon_right", "iliopsoas_left", "iliopsoas_right", "brain", "skull",
        "sternum", "costal_cartilages",
    ];

    #[test]
    fn every_class_of_totalsegmentator_has_a_kind() {
        let ribs = (1..=12).flat_map(|i| ["left", "right"].map(|side| format!("rib_{side}_{i}")));
        let vertebrae = [("C", 7), ("T", 12), ("L", 5), ("S", 1)];
        let vertebrae = vertebrae.map(|(part, last)| (1..=last).map(move |i| format!("vertebrae_{part}{i}")));
        let plain = TOTAL.iter().map(|name| (*name).to_owned());
        let all: Vec<String> = plain.chain(ribs).chain(vertebrae.into_iter().flatten()).collect();
        assert_eq!(all.len(), 117);
        let count = |kind| all.iter().filter(|name| kind_of_structure(name) == kind).count();
        let kinds = [Organ, Vessel, Bone, Lung, Airway, Muscle, Nerve, Lesion, Other];
        assert_eq!(kinds.map(count), [16, 18, 63, 5, 1, 10, 2, 2, 0]);
    }

    #[test]
    fn those_of_one_row_differ_and_unknown_ones_take_turns() {
        let bytes = |names: &[&str]| -> Vec<[u8; 3]> {
            usual_colours(names.iter().copied())
                .iter()
                .map(|c| c.map(|v| (v * 255.0).round() as u8))
                .collect()
        };
        let found = bytes(&["liver", "rib_left_1", "rib_left_2", "spleen"]);
        assert_eq!((found[0], found[1], found[3]), ([221, 130, 101], [253, 232, 158], [157, 108, 162]));
        assert_ne!(found[1], found[2]);
        let names: Vec<String> = (0..8).map(|i| format!("label {i}")).collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let unknown = bytes(&names);
        assert!((1..8).all(|i| unknown[..i].iter().all(|c| *c != unknown[i])), "{unknown:?}");
    }
}
