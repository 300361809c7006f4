//! How a scene of several objects looks as long as nobody has said so: each object in the colour that is usual for its
//! name, through a transfer function for its kind, so that every object is seen.
//!
//! Labels of a CT hold bone, soft tissue and lungs at once, and no single preset is meant for all of them: CT-Bone
//! shows the bones alone. Here an object's own label says what it is, so its function need not tell tissues apart: it
//! shows all of a bone, marrow included, and lets light through lungs, fat and skin, which would hide the rest.

use std::collections::{BTreeMap, BTreeSet};

use super::intensities::Intensities;
use super::look::{Appearance, Look};
use base::unit::Unit;
use splat::{Object, SplatSet, StructureKind, kind_of_structure, usual_colours};
use transfer::{ColourPoint, Material, OpacityPoint, TransferFunction, preset};

/// Name of the function of the scene, which shows at each intensity what that of some object shows there.
const ALL_KINDS: &str = "By kind";
/// Name of the function of an object whose kind says nothing, or hides it.
const OWN_RANGE: &str = "Own range";

/// How surfaces are lit: as those of soft tissue.
const MATERIAL: Material =
    Material { shade: true, ambient: 0.25, diffuse: 0.8, specular: 0.12, power: 10.0, occlusion: 0.0 };

/// Opacity per mm over intensity, HU.
type Opacities = &'static [(f64, f64)];

/// Function of each kind of structure: its name, and what it shows.
const FUNCTIONS: [(StructureKind, &str, Opacities); 11] = [
    (StructureKind::Organ, "Organ", &[(-60.0, 0.0), (0.0, 0.2), (40.0, 0.5)]),
    (StructureKind::Vessel, "Vessel", &[(-30.0, 0.0), (20.0, 0.25), (60.0, 0.6)]),
    (StructureKind::Bone, "Bone", &[(-120.0, 0.0), (0.0, 0.08), (150.0, 0.4), (400.0, 0.8)]),
    (
        StructureKind::Lung,
        "Lung",
        &[(-1000.0, 0.0), (-950.0, 0.007), (-700.0, 0.012), (-400.0, 0.03), (0.0, 0.08)],
    ),
    (StructureKind::Airway, "Airway", &[(-1000.0, 0.3), (-500.0, 0.3), (0.0, 0.1)]),
    (StructureKind::Muscle, "Muscle", &[(-60.0, 0.0), (0.0, 0.15), (50.0, 0.4)]),
    (StructureKind::Nerve, "Nerve", &[(-60.0, 0.0), (0.0, 0.2), (30.0, 0.5)]),
    (StructureKind::Lesion, "Lesion", &[(-100.0, 0.0), (0.0, 0.3), (40.0, 0.6)]),
    (StructureKind::Fat, "Fat", &[(-200.0, 0.0), (-140.0, 0.01), (100.0, 0.015)]),
    (StructureKind::Skin, "Skin", &[(-500.0, 0.0), (-200.0, 0.008), (100.0, 0.008)]),
    (StructureKind::Implant, "Implant", &[(0.0, 0.0), (500.0, 0.5), (2000.0, 0.9)]),
];

/// Opacity per mm of an object's darkest splats and of its middle ones, through a function of its own range.
const OWN_OPACITIES: [f64; 2] = [0.1, 0.4];
/// Share of an object's splats that are darker than its darkest ones.
const DARKEST: f64 = 0.05;

/// How one object looks.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjectLook {
    /// What it is, by its name.
    pub kind: StructureKind,
    /// Its colour, from 0 to 1.
    pub tint: [f32; 3],
    /// Its transfer function.
    pub function: TransferFunction,
}

/// How the objects of a scene look as long as nobody has said so.
#[derive(Clone, Debug, PartialEq)]
pub struct UsualLook {
    /// Function of the scene, for modes in which objects have none of their own: at each intensity the greatest opacity
    /// of all of them.
    pub transfer: TransferFunction,
    /// The looks of the objects, in their order.
    pub objects: Vec<ObjectLook>,
}

impl UsualLook {
    /// Returns the look of a set of objects of at least two names; `None` for a set of fewer, or of splats with colours of
    /// their own, which are shown through a preset. Splats without a label are no object here.
    pub fn of(set: &SplatSet) -> Option<Self> {
        let objects = set.objects();
        let named = objects.iter().filter(|object| object.number > 0).map(|object| &object.name);
        if named.collect::<BTreeSet<_>>().len() < 2 || set.colours.is_some() || !set.unit.is_physical() {
            return None;
        }
        let names = objects.iter().map(|object| object.name.as_str());
        Some(Self::of_objects(names, &Intensities::of_objects(set), set.unit))
    }

    /// Returns the look of objects of these names and intensities, which are numbers of `unit`. Objects whose
    /// intensities are not among them have none. Those of one name look alike.
    pub fn of_objects<'a>(
        names: impl Iterator<Item = &'a str> + Clone,
        intensities: &[Intensities],
        unit: Unit,
    ) -> Self {
        let colours = colours(intensities, unit);
        let none = Intensities::default();
        let own = intensities.iter().chain(std::iter::repeat(&none));
        let mut of_name: BTreeMap<&str, Vec<&Intensities>> = BTreeMap::new();
        names.clone().zip(own).for_each(|(name, own)| of_name.entry(name).or_default().push(own));
        let functions: BTreeMap<_, _> = of_name
            .into_iter()
            .map(|(name, own)| {
                let kind = kind_of_structure(name);
                (name, (kind, function_of(kind, &Intensities::of_all(&own), unit, &colours)))
            })
            .collect();
        let look = |(name, tint)| {
            let (kind, function) = functions[name].clone();
            ObjectLook { kind, tint, function }
        };
        let objects: Vec<_> = names.clone().zip(usual_colours(names)).map(look).collect();
        let transfer = of_all(objects.iter().map(|object| &object.function), colours);
        UsualLook { transfer, objects }
    }

    /// Returns the look of a scene, without clip planes. `objects` are those of the set.
    pub fn look(&self, objects: &[Object]) -> Look {
        let rows = || objects.iter().map(|object| object.number).zip(&self.objects);
        let appearance = |look: &ObjectLook| Appearance { tint: Some(look.tint), ..Appearance::default() };
        Look {
            objects: rows().map(|(number, look)| (number, appearance(look))).collect(),
            functions: rows().map(|(number, look)| (number, look.function.clone())).collect(),
            ..Look::new(self.transfer.clone())
        }
    }

    /// Returns how many objects there are under each heading, the most first: "bones 24, organs 12".
    pub fn summary(&self) -> String {
        let mut counts: Vec<(&str, usize)> = Vec::new();
        for object in &self.objects {
            let heading = object.kind.heading();
            match counts.iter_mut().find(|(known, _)| *known == heading) {
                Some((_, count)) => *count += 1,
                None => counts.push((heading, 1)),
            }
        }
        counts.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
        let words = counts.iter().map(|(heading, count)| format!("{} {count}", heading.to_lowercase()));
        words.collect::<Vec<_>>().join(", ")
    }

    /// Returns true if a function of this name is one that objects or scenes have here.
    pub fn has_function(name: &str) -> bool {
        name == ALL_KINDS || name == OWN_RANGE || FUNCTIONS.iter().any(|(_, known, _)| *known == name)
    }
}

/// Returns the colours of all functions here, for objects without a colour of their own.
fn colours(intensities: &[Intensities], unit: Unit) -> Vec<ColourPoint> {
    let ends = intensities.iter().filter_map(|own| Some([own.of_share(0.0)?, own.of_share(1.0)?]));
    let range = ends.fold(None, |range: Option<[f32; 2]>, [low, high]| {
        Some(range.map_or([low, high], |[a, b]| [a.min(low), b.max(high)]))
    });
    let name = if unit == Unit::Hu { "CT-Soft-Tissue" } else { transfer::FIRST_WITHOUT_HU };
    let preset = preset(name).expect("a test makes every preset");
    preset.over(range.unwrap_or_default().map(f64::from)).colours().to_vec()
}

/// Returns the function that shows an object: that of its kind, if it does.
fn function_of(
    kind: StructureKind,
    own: &Intensities,
    unit: Unit,
    colours: &[ColourPoint],
) -> TransferFunction {
    let row = FUNCTIONS.iter().find(|(known, ..)| *known == kind).filter(|_| unit == Unit::Hu);
    let of_kind = row.map(|(_, name, opacities)| function(name, colours.to_vec(), opacities.to_vec()));
    of_kind.filter(|function| own.are_seen(function)).unwrap_or_else(|| of_range(own, colours))
}

/// Returns a function that shows all intensities of an object but the very darkest.
fn of_range(own: &Intensities, colours: &[ColourPoint]) -> TransferFunction {
    let at = |share| own.of_share(share).map_or(0.0, f64::from);
    let [dark, middle, bright] = [at(DARKEST), at(0.5), at(1.0 - DARKEST)];
    // Where all are alike, the ramp has the width of rounding at least.
    let width = (0.25 * (bright - dark)).max(1e-3 * dark.abs()).max(1e-3);
    let [first, second] = OWN_OPACITIES;
    let opacities = vec![(dark - width, 0.0), (dark, first), (middle.max(dark + width), second)];
    function(OWN_RANGE, colours.to_vec(), opacities)
}

/// Returns the function that shows at the points of all functions what the most opaque of them does.
fn of_all<'a>(
    functions: impl Iterator<Item = &'a TransferFunction>,
    colours: Vec<ColourPoint>,
) -> TransferFunction {
    let mut different: Vec<&TransferFunction> = Vec::new();
    for function in functions {
        if !different.contains(&function) {
            different.push(function);
        }
    }
    let mut places: Vec<f64> = different.iter().flat_map(|f| f.opacities()).map(|p| p.intensity).collect();
    places.sort_by(f64::total_cmp);
    places.dedup();
    let most = |v: f64| different.iter().map(|function| function.at(v).1).fold(0.0, f64::max);
    let opacities =
        if places.is_empty() { vec![(0.0, 0.0)] } else { places.into_iter().map(|v| (v, most(v))).collect() };
    function(ALL_KINDS, colours, opacities)
}

fn function(name: &str, colours: Vec<ColourPoint>, opacities: Vec<(f64, f64)>) -> TransferFunction {
    let opacities = opacities.into_iter().map(|(intensity, opacity)| OpacityPoint { intensity, opacity });
    TransferFunction::new(name, colours, opacities.collect(), MATERIAL)
        .expect("points are finite, and opacities are between 0 and 1")
}

#[cfg(test)]
mod tests {
    use super::*;
    use splat::Splat;

    /// Returns a set of objects, each with the intensities of its splats.
    fn set(objects: &[(&str, &[f32])], unit: Unit) -> SplatSet {
        let mut set = SplatSet { labels: Some(Vec::new()), unit, ..SplatSet::default() };
        for (number, (name, intensities)) in (1..).zip(objects) {
            set.splats.extend(intensities.iter().map(|&intensity| Splat { intensity, ..Splat::default() }));
            set.labels.as_mut().expect("labels").extend(intensities.iter().map(|_| number));
            set.label_names.push((number, (*name).to_owned()));
        }
        set
    }

    const TORSO: [(&str, &[f32]); 9] = [
        ("liver", &[40.0, 50.0, 60.0]),
        ("fatty liver", &[-30.0, -20.0, -10.0]),
        ("aorta", &[35.0, 40.0, 45.0]),
        ("vertebrae_L3", &[-60.0, 120.0, 200.0, 500.0]),
        ("lung_upper_lobe_left", &[-900.0, -850.0, -700.0]),
        ("trachea", &[-1010.0, -980.0]),
        ("torso_fat", &[-110.0, -100.0]),
        ("stomach", &[-950.0, -940.0, -930.0]),
        ("something", &[-512.0, -510.0, -500.0]),
    ];

    #[test]
    fn every_object_is_seen_through_its_own_function_and_through_that_of_the_scene() {
        for unit in [Unit::Hu, Unit::Arbitrary] {
            let set = set(&TORSO, unit);
            let usual = UsualLook::of(&set).expect("nine objects");
            for (own, (look, (name, _))) in
                Intensities::of_objects(&set).iter().zip(usual.objects.iter().zip(TORSO))
            {
                assert!(own.are_seen(&look.function), "{name}: {:?}", look.function);
                assert!(own.are_seen(&usual.transfer), "{name}: {:?}", usual.transfer);
                assert!(UsualLook::has_function(&look.function.name));
            }
            assert!(UsualLook::has_function(&usual.transfer.name) && !UsualLook::has_function("CT-Bone"));
        }
    }

    #[test]
    fn kinds_have_their_functions_where_those_show_them() {
        let names = |unit| {
            let usual = UsualLook::of(&set(&TORSO, unit)).expect("nine objects");
            usual.objects.iter().map(|object| object.function.name.clone()).collect::<Vec<_>>()
        };
        // A stomach full of air is no soft tissue.
        let of_ct = ["Organ", "Organ", "Vessel", "Bone", "Lung", "Airway", "Fat", OWN_RANGE, OWN_RANGE];
        assert_eq!(names(Unit::Hu), of_ct);
        assert_eq!(names(Unit::Arbitrary), [OWN_RANGE; 9], "HU say nothing of an MR");
    }

    #[test]
    fn the_scene_shows_what_some_object_shows() {
        let usual = UsualLook::of(&set(&TORSO, Unit::Hu)).expect("nine objects");
        for v in (-1100..1500).map(f64::from) {
            let most = usual.objects.iter().map(|o| o.function.at(v).1).fold(0.0, f64::max);
            assert!(usual.transfer.at(v).1 >= most - 1e-12, "{v}");
        }
        assert_eq!(usual.transfer.at(400.0).1, 0.8, "where bone is the most opaque");
    }

    #[test]
    fn one_object_and_coloured_splats_look_as_before() {
        assert_eq!(UsualLook::of(&set(&TORSO[..1], Unit::Hu)), None);
        assert_eq!(UsualLook::of(&set(&TORSO, Unit::Luminance)), None);
        let mut rest = set(&TORSO[..1], Unit::Hu);
        rest.splats.push(Splat::default());
        rest.labels.as_mut().expect("labels").push(0);
        assert_eq!(UsualLook::of(&rest), None, "what has no label is no object");
        assert_eq!(UsualLook::of(&SplatSet::default()), None);
    }

    #[test]
    fn objects_of_one_name_look_alike() {
        let blocks = [("femur", &[100.0, 300.0][..]), ("femur", &[600.0, 900.0])];
        assert_eq!(UsualLook::of(&set(&blocks, Unit::Hu)), None, "one structure in two parts");
        for unit in [Unit::Hu, Unit::Arbitrary] {
            let with_liver = set(&[blocks[0], TORSO[0], blocks[1]], unit);
            let usual = UsualLook::of(&with_liver).expect("two structures");
            assert_eq!(usual.objects[0], usual.objects[2]);
            assert_ne!(usual.objects[0].tint, usual.objects[1].tint);
            for own in Intensities::of_objects(&with_liver) {
                assert!(own.are_seen(&usual.transfer), "{unit:?}");
            }
        }
    }

    #[test]
    fn a_look_is_by_numbers_and_a_summary_by_headings() {
        let set = set(&TORSO, Unit::Hu);
        let usual = UsualLook::of(&set).expect("nine objects");
        let look = usual.look(&set.objects());
        assert_eq!((look.objects.len(), look.functions.len()), (9, 9));
        assert_eq!(look.functions[&4].name, "Bone");
        assert_eq!(look.objects[&1].tint, Some(usual.objects[0].tint));
        assert_eq!(
            usual.summary(),
            "organs 3, lungs and airways 2, heart and vessels 1, bones 1, fat and skin 1, others 1"
        );
        let none = UsualLook::of_objects(std::iter::empty(), &[], Unit::Hu);
        assert!(none.objects.is_empty() && none.transfer.visible().is_none());
    }
}
