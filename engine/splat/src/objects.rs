//! Objects: the parts of a set that are shown, hidden and coloured separately. They are the labels of the
//! set. [`join`] makes one set of several, so that parts of one body that were fitted separately lie in one
//! scene.
//!
//! A joined set is one field: where objects overlap, V̂ = b + Σ w (c − b) / (Σ w + ε) sums over all their
//! splats, as it does for the splats of one fit. That is right for parts of one body, which share the tissue
//! at their borders.

use std::borrow::Cow;
use std::collections::BTreeMap;

use glam::DVec3;

use super::harmonics::basis_count;
use super::{Field, Form, Harmonics, Region, RegionObject, SplatSet, Voxels, label_name};
use base::error::{Error, Kind, Result};
use base::names;

/// Most objects of a joined set: the number of labels other than 0.
pub const MOST_OBJECTS: usize = 255;

/// A part of a set with an appearance of its own: the splats of one label.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Object {
    /// Number of the object: the label of its splats, or 0 for splats without a label.
    pub number: u8,
    /// The name of the label, or a substitute for it; never empty.
    pub name: String,
    /// Number of splats.
    pub splats: usize,
}

impl Object {
    /// Returns the names by which it is called: its own, and the parts before and after its slash.
    fn names(&self) -> Vec<&str> {
        let parts = self.name.split_once('/').into_iter().flat_map(|(set, label)| [set, label]);
        [self.name.as_str()].into_iter().chain(parts).collect()
    }

    /// Returns those of `objects` that a user means by `name`, as [`names::chosen`] says: a number, a name or the part of
    /// one before or after its slash, a range, a pattern or `all`.
    ///
    /// # Errors
    /// [`Kind::Usage`] if there are none; the help names those that there are, or a few of many.
    pub fn called<'a>(objects: &'a [Object], name: &str) -> Result<Vec<&'a Object>> {
        let numbered: Vec<_> = objects.iter().map(|o| (i32::from(o.number), o.names())).collect();
        let numbers = names::chosen(name, &numbered);
        let found: Vec<_> = objects.iter().filter(|o| numbers.contains(&i32::from(o.number))).collect();
        if !found.is_empty() {
            return Ok(found);
        }
        let help = match objects {
            [] => "a volume has no objects; they are the labels and files of splats".to_owned(),
            few if few.len() <= names::FEW => {
                let known: Vec<_> = few.iter().map(|o| format!("{} ({})", o.name, o.number)).collect();
                format!("objects are labels and files; here there are {}", known.join(", "))
            }
            many => {
                let names = many.iter().map(|object| object.name.as_str());
                let meant = names::meant_of_many(name, names);
                format!("{meant}`vgs info` of the splats lists their {} labels", many.len())
            }
        };
        Err(Error::new(Kind::Usage, "VGS-SPLAT-010", format!("no object is called {name:?}")).help(help))
    }
}

impl SplatSet {
    /// Returns the objects in ascending order of their numbers. All splats of a set without labels are one
    /// object.
    pub fn objects(&self) -> Vec<Object> {
        if self.labels.is_none() {
            return vec![Object { number: 0, name: "splats".to_owned(), splats: self.splats.len() }];
        }
        let name = |number, name: Option<String>| match (number, name) {
            (_, Some(name)) => name,
            (0, None) => "unlabelled".to_owned(),
            (_, None) => format!("label {number}"),
        };
        let counts = self.label_counts().into_iter();
        counts.map(|c| Object { number: c.label, name: name(c.label, c.name), splats: c.splats }).collect()
    }
}

/// Joins all `sets`, each given with its name, into one. A set without labels becomes one object of that
/// name. A set that is alone keeps its labels; if there are several sets, each label becomes an object called
/// "set/label", and objects are numbered from 1 in the order of sets and labels.
///
/// The origin is the centre of the box of all means, in whole mm. The background is the mean of the
/// backgrounds of all splats: it weighs ε against Σ w in V̂, so where anything is visible it moves V̂ by a
/// small part of the difference of the backgrounds.
///
/// The grid and the volume's checksum are kept if all sets have the same one. If any set has a region, all get one: that
/// of a set without is where its occupancy is above ½. Each voxel of the regions shows the splats of one set, since splats reach beyond the region that they were fitted to. A
/// voxel of several regions is in the smallest object.
///
/// # Errors
/// [`Kind::BadData`] if the sets do not add up to one field: splats with intensities and splats with colours,
/// different kernels, different ε or w₀, a fit for a grid beside one that is not for the same grid. Also if
/// there are more than [`MOST_OBJECTS`] objects.
pub fn join(sets: Vec<(String, SplatSet)>) -> Result<SplatSet> {
    let Some(((first_name, first), others)) = sets.split_first() else { return Ok(SplatSet::default()) };
    let lead = sets.iter().find(|(_, set)| !set.splats.is_empty()).map_or(first, |(_, set)| set);
    for (name, set) in others {
        if let Some((what, help)) = discord(first, set).or_else(|| discord(lead, set)) {
            let message = format!("{first_name} and {name} cannot be one scene: {what}");
            return Err(Error::new(Kind::BadData, "VGS-SPLAT-003", message).help(help));
        }
    }
    let alone = sets.len() == 1;
    if alone && first.labels.is_some() {
        return Ok(sets.into_iter().next().map(|(_, set)| set).unwrap_or_default());
    }
    let Numbered { labels, names: label_names, of_set } = numbered(&sets)?;
    let colours = first.colours.is_some().then(|| joined_colours(&sets));
    let region = joined_region(&sets, &of_set)?;
    // Other objects may have taken all voxels of a set.
    let objects = region.as_ref().map(Region::objects).unwrap_or_default();
    let is_there = |fit: usize| objects.iter().any(|object| usize::from(object.fit) == fit);
    let voxels = sets
        .iter()
        .enumerate()
        .filter(|(fit, _)| is_there(*fit))
        .filter_map(|(fit, (_, set))| Some(Voxels { fit: fit as u8, ..set.voxels.first()?.clone() }));
    let (voxels, lead) = (voxels.collect(), lead.field);
    Ok(SplatSet { colours, labels: Some(labels), label_names, region, voxels, ..together(sets, lead) })
}

/// Returns the splats of all sets, with what they have in common and the field of `lead`, and without objects, colours and
/// coded voxels.
fn together(sets: Vec<(String, SplatSet)>, lead: Field) -> SplatSet {
    let Some(((_, first), others)) = sets.split_first() else { return SplatSet::default() };
    let shared = others.iter().all(|(_, set)| set.origin_mm == first.origin_mm);
    let all = |same: &dyn Fn(&SplatSet) -> bool| others.iter().all(|(_, set)| same(set));
    let joined = SplatSet {
        origin_mm: if shared { first.origin_mm } else { common_origin(&sets) },
        field: Field { background: mean_background(&sets), ..lead },
        unit: others.iter().fold(first.unit, |unit, (_, set)| unit.joined(set.unit)),
        iterations: first.iterations.filter(|_| all(&|set| set.iterations == first.iterations)),
        grid: first.grid.filter(|_| all(&|set| set.grid == first.grid)),
        volume_crc32: first.volume_crc32.filter(|_| all(&|set| set.volume_crc32 == first.volume_crc32)),
        form: first.form,
        ..SplatSet::default()
    };
    let moved = |(_, set): (String, SplatSet)| {
        let apart = set.origin_mm - joined.origin_mm;
        set.splats.into_iter().map(move |mut splat| {
            if apart != DVec3::ZERO {
                splat.mean = (DVec3::from_array(splat.mean.map(f64::from)) + apart).as_vec3().to_array();
            }
            splat
        })
    };
    SplatSet { splats: sets.into_iter().flat_map(moved).collect(), ..joined }
}

/// Returns blocks of one grid and one field that lie apart as one set, with the labels that they have.
pub(crate) fn merged(sets: Vec<SplatSet>) -> Result<SplatSet> {
    if sets.len() == 1 {
        return Ok(sets.into_iter().next().unwrap_or_default());
    }
    let sets: Vec<_> = sets.into_iter().map(|set| (String::new(), set)).collect();
    let lead = sets[0].1.field;
    let regions: Vec<Region> = sets.iter().filter_map(|(_, set)| set.region.clone()).collect();
    let region = region_of_all(&regions)?;
    let all: Vec<&Vec<u8>> = sets.iter().filter_map(|(_, set)| set.labels.as_ref()).collect();
    let labels = (!all.is_empty()).then(|| all.into_iter().flatten().copied().collect());
    let names = sets.iter().flat_map(|(_, set)| set.label_names.iter().cloned());
    let label_names = names.collect::<BTreeMap<_, _>>().into_iter().collect();
    Ok(SplatSet { labels, label_names, region: Some(region), ..together(sets, lead) })
}

/// Returns the regions of all sets as one, with the numbers that the joined set gives its objects; `None` if no set has
/// one.
fn joined_region(sets: &[(String, SplatSet)], of_set: &[[usize; 256]]) -> Result<Option<Region>> {
    if sets.iter().all(|(_, set)| set.region.is_none()) {
        return Ok(None);
    }
    let numbers = of_set.iter().map(|numbers| numbers.map(|number| number as u8));
    let of = |(fit, ((_, set), numbers)): (usize, (&(String, SplatSet), [u8; 256]))| {
        let renumbered = |_, object: RegionObject| {
            Some(RegionObject { number: numbers[usize::from(object.number)], fit: fit as u8 })
        };
        let region = match (&set.region, &set.grid) {
            (Some(region), _) => Some(Cow::Borrowed(region)),
            (None, Some(grid)) => Region::occupied(set, grid, &[])?.map(Cow::Owned),
            (None, None) => None,
        };
        Ok(region.and_then(|region| region.with_objects(renumbered)))
    };
    let regions: Result<Option<Vec<Region>>> = sets
        .iter()
        .zip(numbers)
        .enumerate()
        .map(of)
        .collect::<Result<Vec<_>>>()
        .map(|all| all.into_iter().collect());
    let Some(regions) = regions? else { return Ok(None) };
    region_of_all(&regions).map(Some)
}

/// Returns [`Region::joined`] of all.
fn region_of_all(regions: &[Region]) -> Result<Region> {
    Region::joined(regions)
        .ok_or_else(|| Error::new(Kind::Internal, "VGS-SPLAT-012", "objects without numbers"))
}

/// Returns why two sets do not add up to one field and what to do about it, or `None` if they do.
fn discord(a: &SplatSet, b: &SplatSet) -> Option<(String, &'static str)> {
    const FIT: &str = "fit both with the same --kernel, --epsilon and --occupancy-w0, or render them apart";
    let kind = |set: &SplatSet| match (&set.colours, set.unit.is_physical()) {
        (Some(_), _) => "colours",
        (None, true) => "intensities",
        (None, false) => "luminances",
    };
    if kind(a) != kind(b) {
        let what = format!("the splats of one have {}, those of the other {}", kind(a), kind(b));
        return Some((what, "render splats of vgs and splats of other programs apart"));
    }
    // Such a fit is not right between the voxels of its own grid, so two of them must share the grid.
    let of_grid = [a, b].map(|set| set.form != Form::Field);
    if of_grid == [true, true] && a.grid != b.grid {
        let what = "they were fitted for the voxels of different grids".to_owned();
        return Some((what, "fit both with --profile field, or render them apart"));
    }
    if of_grid[0] != of_grid[1] {
        let what =
            "one was fitted for the voxels of its grid, the other for the field between them too".to_owned();
        return Some((what, "fit both with the same --form, or render them apart"));
    }
    let is_joined = |set: &SplatSet| set.voxels.len() + usize::from(!set.splats.is_empty()) > 1;
    if !(a.voxels.is_empty() && b.voxels.is_empty()) && (is_joined(a) || is_joined(b)) {
        return Some(("one is joined itself".to_owned(), "give the files that it was made of"));
    }
    // What is coded has no field of its own.
    if a.splats.is_empty() || b.splats.is_empty() {
        return None;
    }
    let (a, b) = (&a.field, &b.field);
    if a.kernel != b.kernel {
        let [a, b] = [a, b].map(|field| field.kernel.row().name);
        return Some((format!("the kernel of one is {a}, that of the other {b}"), FIT));
    }
    let numbers = [("ε", a.epsilon, b.epsilon), ("w₀", a.occupancy_w0, b.occupancy_w0)];
    let (name, a, b) = numbers.into_iter().find(|(_, a, b)| a != b)?;
    Some((format!("{name} of one is {a}, that of the other {b}"), FIT))
}

/// The objects of a joined set.
struct Numbered {
    /// The number of each splat's object.
    labels: Vec<u8>,
    /// The names of the objects with their numbers.
    names: Vec<(u8, String)>,
    /// For each set, the number of the object of each of its labels; 0 for those without splats.
    of_set: Vec<[usize; 256]>,
}

fn numbered(sets: &[(String, SplatSet)]) -> Result<Numbered> {
    let (mut labels, mut names, mut of_set) = (Vec::new(), Vec::new(), Vec::new());
    for (name, set) in sets {
        let mut numbers = [0; 256];
        for object in set.objects() {
            let name = match set.labels {
                Some(_) => format!("{name}/{}", object.name),
                None => name.clone(),
            };
            names.push(match label_name(&name) {
                empty if empty.is_empty() => "splats".to_owned(),
                name => name,
            });
            numbers[usize::from(object.number)] = names.len();
        }
        if names.len() > MOST_OBJECTS {
            let message = format!("{} objects up to {name}; a scene can have {MOST_OBJECTS}", names.len());
            return Err(Error::new(Kind::BadData, "VGS-SPLAT-004", message)
                .help("give fewer files, or files of fewer labels"));
        }
        match &set.labels {
            Some(old) => labels.extend(old.iter().map(|&label| numbers[usize::from(label)] as u8)),
            None => labels.resize(labels.len() + set.splats.len(), numbers[0] as u8),
        }
        of_set.push(numbers);
    }
    Ok(Numbered { labels, names: (1..=u8::MAX).zip(names).collect(), of_set })
}

/// Returns the centre of the box of all means, rounded to whole mm, so that f32 means keep their digits; mm
/// RAS.
fn common_origin(sets: &[(String, SplatSet)]) -> DVec3 {
    let mut bounds = [DVec3::INFINITY, DVec3::NEG_INFINITY];
    for (_, set) in sets {
        for splat in &set.splats {
            let x = DVec3::from_array(splat.mean.map(f64::from)) + set.origin_mm;
            bounds = [bounds[0].min(x), bounds[1].max(x)];
        }
    }
    let centre = (bounds[0] + bounds[1]) * 0.5;
    if centre.is_finite() { centre.round() } else { DVec3::ZERO }
}

fn mean_background(sets: &[(String, SplatSet)]) -> f32 {
    let count: f64 = sets.iter().map(|(_, set)| set.splats.len() as f64).sum();
    let first = sets[0].1.field.background;
    if count == 0.0 || sets.iter().all(|(_, set)| set.field.background == first) {
        return first;
    }
    let sum: f64 = sets.iter().map(|(_, s)| f64::from(s.field.background) * s.splats.len() as f64).sum();
    (sum / count) as f32
}

/// Returns the colours of all sets at the highest degree of any set; coefficients that a set lacks are 0.
fn joined_colours(sets: &[(String, SplatSet)]) -> Harmonics {
    let colours = || sets.iter().filter_map(|(_, set)| set.colours.as_ref());
    let degree = colours().map(|c| c.degree).max().unwrap_or(0);
    let stride = 3 * basis_count(degree);
    let mut coefficients = Vec::new();
    for row in colours().flat_map(|c| c.coefficients.chunks(c.stride())) {
        let end = coefficients.len() + stride;
        coefficients.extend_from_slice(row);
        coefficients.resize(end, 0.0);
    }
    Harmonics { degree, coefficients }
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::*;
    use crate::Grid;
    use crate::region::tests::region_of;
    use crate::{Kernel, Splat};
    use base::unit::Unit;

    fn at(origin: DVec3, means: &[[f32; 3]]) -> SplatSet {
        let splat = |&mean: &[f32; 3]| Splat { mean, rotation: [1.0, 0.0, 0.0, 0.0], ..Splat::default() };
        SplatSet { splats: means.iter().map(splat).collect(), origin_mm: origin, ..SplatSet::default() }
    }

    fn named(sets: &[(&str, &SplatSet)]) -> Vec<(String, SplatSet)> {
        sets.iter().map(|&(name, set)| (name.to_owned(), set.clone())).collect()
    }

    #[test]
    fn what_is_joined_stays_where_it_was_and_is_told_apart() {
        let bones = at(DVec3::new(100.0, -20.0, 1000.0), &[[0.5, 0.0, 0.0], [1.5, 2.0, -3.0]]);
        let mut organs = at(DVec3::new(-50.0, 0.0, 900.0), &[[0.0; 3], [1.0; 3], [2.0; 3], [3.0; 3]]);
        organs.labels = Some(vec![5, 0, 9, 5]);
        organs.label_names = vec![(5, "liver".to_owned())];
        organs.field.background = 30.0;
        let joined = join(named(&[("bones", &bones), ("organs", &organs)])).expect("they fit together");
        let world =
            |set: &SplatSet, i: usize| DVec3::from_array(set.splats[i].mean.map(f64::from)) + set.origin_mm;
        for i in 0..6 {
            let before = if i < 2 { world(&bones, i) } else { world(&organs, i - 2) };
            assert!(world(&joined, i).distance(before) < 1e-5, "splat {i}");
        }
        let again = join(named(&[("bones", &bones), ("more", &bones)])).expect("they fit together");
        assert_eq!((again.origin_mm, &again.splats[2..]), (bones.origin_mm, &bones.splats[..]), "to the bit");
        assert_eq!(joined.labels, Some(vec![1, 1, 3, 2, 4, 3]));
        let objects: Vec<_> = joined.objects().into_iter().map(|o| (o.number, o.name, o.splats)).collect();
        let wanted =
            [(1, "bones", 2), (2, "organs/unlabelled", 1), (3, "organs/liver", 2), (4, "organs/label 9", 1)];
        assert_eq!(objects, wanted.map(|(number, name, splats)| (number, name.to_owned(), splats)));
        assert_eq!(joined.field.background, 20.0, "the mean of 2 at 0 and 4 at 30");
        assert_eq!(joined.label_defect(), None, "a file can hold it");
    }

    #[test]
    fn one_set_keeps_its_labels_and_gets_a_name_without_them() {
        let mut set = at(DVec3::ONE, &[[0.0; 3], [1.0; 3]]);
        assert_eq!(set.objects(), [Object { number: 0, name: "splats".into(), splats: 2 }]);
        let named_set = join(named(&[("bones", &set)])).expect("a set");
        assert_eq!(named_set.objects(), [Object { number: 1, name: "bones".into(), splats: 2 }]);
        assert_eq!((named_set.origin_mm, &named_set.splats), (set.origin_mm, &set.splats));
        set.labels = Some(vec![7, 7]);
        assert_eq!(join(named(&[("bones", &set)])).expect("a set"), set);
        assert_eq!(set.objects(), [Object { number: 7, name: "label 7".into(), splats: 2 }]);
        assert_eq!(join(Vec::new()).expect("nothing"), SplatSet::default());
    }

    #[test]
    fn colours_are_joined_at_the_highest_degree() {
        let mut low = at(DVec3::ZERO, &[[0.0; 3]]);
        low.unit = Unit::Luminance;
        let mut high = low.clone();
        low.colours = Some(Harmonics { degree: 0, coefficients: vec![1.0, 2.0, 3.0] });
        high.colours = Some(Harmonics { degree: 1, coefficients: (0..12u8).map(f32::from).collect() });
        let joined = join(named(&[("low", &low), ("high", &high)])).expect("two sets of colours");
        let colours = joined.colours.expect("colours");
        let direction = [0.6, 0.0, 0.8];
        for (i, set) in [low, high].iter().enumerate() {
            let before = set.colours.as_ref().expect("colours").colour(0, direction);
            assert_eq!(colours.colour(i, direction), before, "set {i}");
        }
    }

    #[test]
    fn fits_for_one_grid_go_together_and_so_do_their_regions() {
        let grid = |n: u32| Some(Grid { size: [n; 3], world_from_voxel: DAffine3::IDENTITY });
        let of = |size, voxels: &[([u32; 3], u8)]| SplatSet {
            grid: grid(size),
            form: Form::Grid,
            region: (!voxels.is_empty()).then(|| region_of(voxels)),
            ..at(DVec3::ZERO, &[[0.0; 3]])
        };
        let soft = of(4, &[]);
        let joined = join(named(&[("a", &soft), ("b", &soft)])).expect("one grid");
        assert_eq!((joined.form, joined.grid, joined.region), (Form::Grid, grid(4), None));
        let (a, b) = (of(4, &[([1, 0, 0], 0), ([2, 0, 0], 0), ([3, 0, 0], 0)]), of(4, &[([3, 0, 0], 0)]));
        let alone = join(named(&[("a", &a)])).expect("one set").region.expect("a region");
        assert_eq!(alone.objects(), [RegionObject { number: 1, fit: 0 }], "as its splats are numbered");
        let joined = join(named(&[("a", &a), ("b", &b)])).expect("one grid").region.expect("a region");
        let objects: Vec<_> = joined.voxels().map(|(_, object)| (object.number, object.fit)).collect();
        assert_eq!(objects, [(1, 0), (1, 0), (2, 1)], "the smaller object has what is in both");
        let mut labelled = of(4, &[([1, 0, 0], 5), ([2, 0, 0], 6)]);
        labelled.labels = Some(vec![5]);
        let joined = join(named(&[("a", &labelled), ("b", &b)])).expect("one grid");
        let names: Vec<_> = joined.objects().into_iter().map(|o| (o.number, o.name, o.splats)).collect();
        let named_so = |number, name: &str, splats| (number, name.to_owned(), splats);
        let expected = [named_so(1, "a/label 5", 1), named_so(2, "a/label 6", 0), named_so(3, "b", 1)];
        assert_eq!(names, expected, "a structure without splats has its voxels");
        // Two voxels, so far apart that no memory would hold the box around them.
        let one = of(1 << 20, &[([0; 3], 0)]);
        let [near, far] = [0, (1 << 20) - 1].map(|at| SplatSet {
            region: one.region.clone().map(|region| region.within([at; 3])),
            ..one.clone()
        });
        let joined =
            join(named(&[("near", &near), ("far", &far)])).expect("one grid").region.expect("a region");
        assert_eq!((joined.voxel_count(), joined.bounds()), (2, [[0; 3], [1 << 20; 3]]));
        let error = join(named(&[("a", &a), ("b", &of(5, &[([0; 3], 0)]))])).expect_err("two grids");
        assert!(
            error.message.contains("different grids") && error.help.contains("--profile field"),
            "{error}"
        );
        let joined = join(named(&[("a", &a), ("b", &soft)])).expect("a soft mask beside a binary one");
        assert!(joined.region.is_some_and(|region| region.objects().len() == 2), "where it is above a half");
    }

    #[test]
    fn sets_that_do_not_add_up_are_refused() {
        let set = at(DVec3::ZERO, &[[0.0; 3]]);
        let with = |change: &dyn Fn(&mut SplatSet)| {
            let mut other = set.clone();
            change(&mut other);
            other
        };
        let many = with(&|s| {
            s.splats = vec![s.splats[0]; 200];
            s.labels = Some((0..200).collect());
        });
        for (other, code, word) in [
            (with(&|s| s.field.kernel = Kernel::Gaussian), "VGS-SPLAT-003", "kernel"),
            (with(&|s| s.form = Form::Grid), "VGS-SPLAT-003", "the field between"),
            (with(&|s| s.field.epsilon *= 2.0), "VGS-SPLAT-003", "ε"),
            (with(&|s| s.field.occupancy_w0 *= 2.0), "VGS-SPLAT-003", "w₀"),
            (with(&|s| s.unit = Unit::Luminance), "VGS-SPLAT-003", "luminances"),
            (
                with(&|s| s.colours = Some(Harmonics { degree: 0, coefficients: vec![0.0; 3] })),
                "VGS-SPLAT-003",
                "colours",
            ),
        ] {
            let error = join(named(&[("a", &set), ("b", &other)])).expect_err(word);
            assert_eq!((error.kind, error.code), (Kind::BadData, code));
            assert!(error.message.contains(word) && error.message.starts_with("a and b"), "{error}");
        }
        let error = join(named(&[("a", &many), ("b", &many)])).expect_err("400 objects");
        assert_eq!(error.code, "VGS-SPLAT-004");
    }
}
