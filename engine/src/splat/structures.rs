//! The colours in which anatomical structures are usually drawn, by words of their names.
//!
//! Names are those of label maps, as TotalSegmentator and 3D Slicer write them: `kidney_left`, `portal vein and
//! splenic vein`, `vertebrae_L3`. The colours are near those of 3D Slicer's table of anatomy, which its users
//! know. Structures without a known word get colours in turn, which people of all kinds of colour vision can
//! tell apart (Okabe and Ito 2008).

/// Beginnings of words and the colour of the structures that they name. The first row that fits counts, so a
/// vein of an organ stands before the organ.
const STRUCTURES: [(&[&str], [u8; 3]); 29] = [
    (&["brain", "cerebr", "cerebell", "hippocamp", "white", "grey", "gray"], [250, 250, 225]),
    (&["vein", "vena", "venous", "cava", "portal"], [0, 151, 206]),
    (&["aort", "arter", "iliaca", "carotid", "subclavian", "brachiocephalic", "vessel"], [216, 55, 60]),
    (&["atri", "ventricle", "heart", "myocard", "pericard"], [206, 110, 84]),
    (&["tumo", "lesion", "cyst", "metasta", "nodule"], [144, 238, 144]),
    (&["vertebra", "sacrum", "spine"], [226, 202, 134]),
    (&["rib", "sternum", "costal", "clavic", "scapula"], [253, 232, 158]),
    (
        &[
            "bone", "skull", "crani", "mandib", "hip", "pelvi", "femur", "humerus", "radius", "ulna",
            "tibia", "fibula",
        ],
        [241, 214, 145],
    ),
    (&["tooth", "teeth"], [255, 250, 220]),
    (&["liver", "hepat"], [221, 130, 101]),
    (&["spleen"], [157, 108, 162]),
    (&["kidney", "renal"], [185, 102, 83]),
    (&["adrenal"], [244, 186, 150]),
    (&["pancrea"], [249, 180, 111]),
    (&["gall", "bile", "biliary"], [139, 150, 98]),
    (&["stomach", "gastr"], [216, 132, 105]),
    (&["duoden", "bowel", "intestin", "jejun", "ileum"], [205, 167, 142]),
    (&["colon", "rectum", "sigmoid"], [204, 168, 143]),
    (&["esophag", "oesophag"], [211, 171, 143]),
    (&["urinary", "bladder", "ureter"], [222, 154, 132]),
    (&["prostat", "uter", "ovar", "testi"], [230, 158, 140]),
    (&["lung", "pulmon"], [197, 165, 145]),
    (&["trachea", "bronch", "airway"], [182, 228, 255]),
    (&["thyroid", "thymus", "gland"], [62, 162, 114]),
    (&["cord", "nerve"], [244, 214, 49]),
    (&["muscle", "gluteus", "iliopsoas", "autochthon", "psoas"], [192, 104, 88]),
    (&["fat", "adipose"], [230, 220, 70]),
    (&["skin", "body", "face"], [177, 122, 101]),
    (&["implant", "metal", "screw", "stent", "catheter", "electrode"], [148, 173, 190]),
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

/// Returns the colour, from 0 to 1, of the structure of this name; `turn` counts the objects of a scene and
/// decides where the name says nothing.
pub fn usual_colour(name: &str, turn: usize) -> [f32; 3] {
    let name = name.to_lowercase();
    let words = || name.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty());
    let named = |beginnings: &[&str]| words().any(|word| beginnings.iter().any(|b| word.starts_with(b)));
    let row = STRUCTURES.iter().find(|(beginnings, _)| named(beginnings));
    row.map_or(IN_TURN[turn % IN_TURN.len()], |(_, colour)| *colour).map(|b| f32::from(b) / 255.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn structures_have_their_colours_and_others_take_turns() {
        let of = |name: &str| usual_colour(name, 0).map(|c| (c * 255.0).round() as u8);
        // Names of TotalSegmentator and of other maps, beside the row that is meant.
        for (name, word) in [
            ("kidney_left", "kidney"),
            ("portal_vein_and_splenic_vein", "vein"),
            ("inferior_vena_cava", "vena"),
            ("Aorta", "aort"),
            ("iliac_artery_right", "arter"),
            ("pulmonary_vein", "vein"),
            ("lung_upper_lobe_left", "lung"),
            ("vertebrae_L3", "vertebra"),
            ("rib_right_7", "rib"),
            ("heart_atrium_left", "atri"),
            ("gallbladder", "gall"),
            ("urinary_bladder", "urinary"),
            ("small_bowel", "bowel"),
            ("set/liver", "liver"),
            ("spinal_cord", "cord"),
            ("gluteus_maximus_left", "gluteus"),
            ("costal_cartilages", "costal"),
            ("thyroid_gland", "thyroid"),
            ("skull", "skull"),
            ("hip_left", "hip"),
            ("left hippocampus", "hippocamp"),
        ] {
            let row = STRUCTURES.iter().find(|(words, _)| words.contains(&word)).expect("a row");
            assert_eq!(of(name), row.1, "{name}");
        }
        let unknown: Vec<_> = (0..8).map(|turn| usual_colour("label 12", turn)).collect();
        assert_eq!(unknown[0], unknown[7]);
        assert!((1..7).all(|i| unknown[..i].iter().all(|c| *c != unknown[i])), "{unknown:?}");
    }
}
