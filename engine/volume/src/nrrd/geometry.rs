//! The axes of an NRRD file: which of them are in space, and where they lie in the patient.

use glam::{DAffine3, DVec3};

use super::header::{Header, bad};
use crate::affine::{RAS_FROM_LPS, grid};
use crate::text_header::{excerpt, reals};
use base::Result;

/// The spaces of a patient, by both of their names, with the sign that takes each of their axes to RAS.
const SPACES: [(&str, &str, DVec3); 3] = [
    ("right-anterior-superior", "ras", DVec3::ONE),
    ("left-anterior-superior", "las", DVec3::new(-1.0, 1.0, 1.0)),
    ("left-posterior-superior", "lps", RAS_FROM_LPS),
];

/// The spaces that do not refer to a patient.
const OTHER_SPACES: [&str; 3] = ["scanner-xyz", "3d-right-handed", "3d-left-handed"];

/// Part by which a spacing and the length of a direction may differ, by rounding.
const SAME_LENGTH: f64 = 1e-3;

/// The kinds of axes of the format, in lower case.
const KINDS: [&str; 33] = [
    "domain",
    "space",
    "time",
    "list",
    "point",
    "vector",
    "covariant-vector",
    "normal",
    "stub",
    "scalar",
    "complex",
    "2-vector",
    "3-color",
    "rgb-color",
    "hsv-color",
    "xyz-color",
    "4-color",
    "rgba-color",
    "3-vector",
    "3-gradient",
    "3-normal",
    "4-vector",
    "quaternion",
    "2d-symmetric-matrix",
    "2d-masked-symmetric-matrix",
    "2d-matrix",
    "2d-masked-matrix",
    "3d-symmetric-matrix",
    "3d-masked-symmetric-matrix",
    "3d-matrix",
    "3d-masked-matrix",
    "???",
    "none",
];

/// The axes of the voxels: three in space, and perhaps one of a series.
#[derive(Debug)]
pub(super) struct Axes {
    pub size: [usize; 3],
    /// Indices of the three axes in space among all axes.
    spatial: [usize; 3],
    pub volumes: usize,
    /// Number of consecutive values of one volume.
    pub run: usize,
}

impl Header {
    /// Returns the `space directions`, one for each of `rank` axes; `None` if the header has none.
    pub fn directions(&self, rank: usize) -> Result<Option<Vec<Option<DVec3>>>> {
        if let Some(text) = self.field("space dimension")
            && !["3", "4"].contains(&text)
        {
            let message = format!("'space dimension' is '{}'; 3, or 4 with time, is needed", excerpt(text));
            return Err(
                bad("VGS-NRD-022", message).help("export the volume again, in the space of the patient")
            );
        }
        let Some(text) = self.field("space directions") else { return Ok(None) };
        match vectors(text).filter(|found| found.len() == rank) {
            Some(found) => Ok(Some(found.into_iter().map(|v| v.and_then(in_space)).collect())),
            None => {
                let message = format!(
                    "'space directions' is '{}'; a vector of three numbers, or none, is needed for each of {rank} axes",
                    excerpt(text)
                );
                Err(bad("VGS-NRD-009", message)
                    .help("the space must have three dimensions, or four with time"))
            }
        }
    }

    /// Determines which axes are in space and which is that of a series.
    pub fn axes(&self, sizes: &[usize], directions: Option<&[Option<DVec3>]>) -> Result<Axes> {
        let kinds = self.words("kinds", sizes.len(), |word| KINDS.contains(&word))?;
        let kind =
            |axis: usize| kinds.as_ref().and_then(|kinds| kinds.get(axis)).map_or("none", String::as_str);
        let direction = |axis: usize| directions.and_then(|d| d.get(axis).copied().flatten());
        let (mut spatial, mut series) = (Vec::new(), Vec::new());
        for (axis, &size) in sizes.iter().enumerate() {
            let in_space = match (directions, kind(axis)) {
                (Some(_), _) => direction(axis).is_some(),
                // As in NIfTI, the first three axes are in space if the header does not say.
                (None, "domain" | "space" | "none" | "???") => spatial.len() < 3,
                (None, _) => false,
            };
            let is_number = matches!(
                kind(axis),
                "domain" | "space" | "time" | "list" | "scalar" | "stub" | "none" | "???"
            );
            if !in_space && !is_number && size > 1 {
                let message =
                    format!("axis {axis} has {size} numbers of kind {} a voxel", excerpt(kind(axis)));
                return Err(bad("VGS-NRD-010", message)
                    .help("colours and vectors have no HU: write one component as a volume of its own"));
            }
            if in_space {
                spatial.push(axis);
            } else if size > 1 {
                series.push(axis);
            }
        }
        let (Ok(spatial), true) = (<[usize; 3]>::try_from(spatial.as_slice()), series.len() <= 1) else {
            let (space, more) = (spatial.len(), series.len());
            let message = format!(
                "of the axes of sizes {sizes:?}, {space} are in space and {more} of the others are longer than 1; \
                 three and at most one are needed"
            );
            return Err(bad("VGS-NRD-011", message).help("write one volume as a file of its own"));
        };
        let size = spatial.map(|axis| sizes.get(axis).copied().unwrap_or(1));
        let volumes = series.first().and_then(|&axis| sizes.get(axis)).copied().unwrap_or(1);
        let before = series.first().copied().unwrap_or(0);
        // The layout checks the product of all sizes; a product that is too large here is too large there.
        let run = sizes.iter().take(before).fold(1_usize, |n, &s| n.saturating_mul(s));
        Ok(Axes { size, spatial, volumes, run })
    }

    /// Returns the affine to RAS, mm, and true if the header says how the patient lies.
    pub fn affine(
        &self,
        axes: &Axes,
        rank: usize,
        directions: Option<&[Option<DVec3>]>,
        notes: &mut Vec<String>,
    ) -> Result<(DAffine3, bool)> {
        let Some(directions) = directions else {
            notes.push(
                "there are no space directions: the orientation is unknown, left and right cannot be told"
                    .into(),
            );
            return Ok((self.affine_of_spacings(axes, rank, notes)?, false));
        };
        let (signs, oriented) = self.signs(notes)?;
        self.check_spacings(axes, rank, directions, notes)?;
        let origin = match self.field("space origin") {
            None => {
                notes.push("there is no space origin: the first voxel is taken to be at 0, 0, 0".into());
                DVec3::ZERO
            }
            Some(text) => match vectors(text).as_deref() {
                Some(&[Some([x, y, z, _])]) => DVec3::new(x, y, z),
                _ => {
                    let message = format!("'space origin' is '{}'; three numbers are needed", excerpt(text));
                    return Err(bad("VGS-NRD-009", message).help("write it as (0,0,0)"));
                }
            },
        };
        let units = self.millimetres("space units", &[3, 4], [0, 1, 2])?;
        let columns =
            axes.spatial.map(|a| units * directions.get(a).copied().flatten().unwrap_or(DVec3::ZERO));
        Ok((grid(columns, units * origin, signs), oriented))
    }

    /// Refuses spacings that say something else than the directions, and notes what is not used beside these.
    fn check_spacings(
        &self,
        axes: &Axes,
        rank: usize,
        directions: &[Option<DVec3>],
        notes: &mut Vec<String>,
    ) -> Result<()> {
        let spacings = self.per_axis("spacings", rank)?;
        for axis in axes.spatial {
            let length = directions.get(axis).copied().flatten().map_or(f64::NAN, DVec3::length);
            let spacing = spacings.get(axis).map_or(f64::NAN, |spacing| spacing.abs());
            if (spacing - length).abs() > SAME_LENGTH * length.max(spacing) {
                let message = format!(
                    "'spacings' of axis {axis} is {spacing}, and its vector in 'space directions' is {length} long; one \
                     length is needed"
                );
                return Err(bad("VGS-NRD-023", message)
                    .help("leave 'spacings' out of the header if the directions are right"));
            }
        }
        for name in ["units", "axis mins", "axis maxs"] {
            if self.field(name).is_some() {
                notes.push(format!("'{name}' is not used, since there are space directions"));
            }
        }
        Ok(())
    }

    /// Returns the sign that takes each axis of the space to RAS, and true if the space is that of a patient.
    fn signs(&self, notes: &mut Vec<String>) -> Result<(DVec3, bool)> {
        let Some(text) = self.field("space") else {
            notes.push("there is no space: left and right cannot be told".into());
            return Ok((DVec3::ONE, false));
        };
        let name = text.to_lowercase();
        // With time as a fourth axis, the names end in -time or in t.
        let name = name.strip_suffix("-time").unwrap_or(&name);
        let name = name.strip_suffix('t').filter(|_| name.len() == 4).unwrap_or(name);
        if let Some((.., signs)) = SPACES.iter().find(|(long, short, _)| name == *long || name == *short) {
            return Ok((*signs, true));
        }
        if OTHER_SPACES.contains(&name) {
            notes.push(format!(
                "the space is {name}, which does not say how the patient lies: its axes are taken as they are, left \
                 and right cannot be told"
            ));
            return Ok((DVec3::ONE, false));
        }
        let known: Vec<_> = SPACES.iter().map(|(long, ..)| *long).collect();
        Err(bad("VGS-NRD-014", format!("'space' is '{}', which is not known", excerpt(text))).help(format!(
            "known spaces: {}, {}",
            known.join(", "),
            OTHER_SPACES.join(", ")
        )))
    }

    /// Returns the numbers of a field, one for each of `rank` axes: NaN where there is none.
    fn per_axis(&self, name: &str, rank: usize) -> Result<Vec<f64>> {
        match self.field(name).map(|text| (text, reals(text))) {
            None => Ok(vec![f64::NAN; rank]),
            Some((_, Some(found))) if found.len() == rank && !found.iter().any(|v| v.is_infinite()) => {
                Ok(found)
            }
            Some((text, _)) => {
                let message = format!("'{name}' is '{}'; {rank} finite numbers are needed", excerpt(text));
                Err(bad("VGS-NRD-015", message).help("write nan where an axis has none"))
            }
        }
    }

    /// Returns the words of a field, one for each of `rank` axes, in lower case; `None` if there is no such field.
    /// `known` says whether a word is one of the format.
    fn words(&self, name: &str, rank: usize, known: impl Fn(&str) -> bool) -> Result<Option<Vec<String>>> {
        let Some(text) = self.field(name) else { return Ok(None) };
        let words: Vec<String> = text.split_whitespace().map(str::to_lowercase).collect();
        let unknown = words.iter().find(|word| !known(word.as_str()));
        if unknown.is_none() && words.len() == rank {
            return Ok(Some(words));
        }
        let why =
            unknown.map_or(String::new(), |word| format!(", of which '{}' is not known", excerpt(word)));
        let message =
            format!("'{name}' is '{}'{why}; a word for each of {rank} axes is needed", excerpt(text));
        Err(bad("VGS-NRD-020", message).help("write ??? where nothing is known of an axis"))
    }

    /// Returns the affine of a header without directions.
    fn affine_of_spacings(&self, axes: &Axes, rank: usize, notes: &mut Vec<String>) -> Result<DAffine3> {
        let millimetres = self.millimetres("units", &[rank], axes.spatial)?;
        let [spacings, mins, maxs] =
            ["spacings", "axis mins", "axis maxs"].map(|name| self.per_axis(name, rank));
        let (spacings, mins, maxs) = (spacings?, mins?, maxs?);
        let name = if self.field("centers").is_some() { "centers" } else { "centerings" };
        let centers = self.words(name, rank, |word| ["cell", "node", "???", "none"].contains(&word))?;
        let center =
            |axis: usize| centers.as_ref().and_then(|words| words.get(axis)).map_or("???", String::as_str);
        let number = |of: &[f64], axis: usize| of.get(axis).copied().filter(|v| !v.is_nan());
        let (mut columns, mut origin) = ([DVec3::ZERO; 3], DVec3::ZERO);
        for (place, &axis) in axes.spatial.iter().enumerate() {
            let (min, steps) = (number(&mins, axis), axes.size[place] as f64);
            let span = min.zip(number(&maxs, axis)).map(|(min, max)| max - min);
            let spacing = match (number(&spacings, axis), span, center(axis)) {
                (Some(spacing), ..) => spacing,
                (None, Some(span), "cell") => span / steps,
                (None, Some(span), "node") if steps > 1.0 => span / (steps - 1.0),
                (None, Some(_), found) => {
                    let message = format!(
                        "axis {axis} has 'axis mins' and 'axis maxs', no 'spacings', and is centered '{found}'; cell or \
                         node is needed"
                    );
                    return Err(
                        bad("VGS-NRD-024", message).help("add 'spacings' or 'centerings' to the header")
                    );
                }
                (None, None, _) => {
                    notes.push(format!("axis {axis} has no spacing: it is taken as 1 mm"));
                    1.0
                }
            };
            if spacing < 0.0 {
                notes.push(format!(
                    "the spacing of axis {axis} is {spacing}: the axis runs the other way, as in ITK"
                ));
            }
            if spacing == 0.0 {
                let message = format!("'spacings' of axis {axis} is {spacing}; a length is needed");
                return Err(
                    bad("VGS-NRD-016", message).help("the header is damaged: export the volume again")
                );
            }
            // The lower end of a cell is half a voxel before its centre.
            let half = if min.is_some() && center(axis) == "cell" { spacing / 2.0 } else { 0.0 };
            let scale = millimetres[place];
            columns[place] = DVec3::AXES[place] * spacing * scale;
            origin += DVec3::AXES[place] * (min.unwrap_or(0.0) + half) * scale;
        }
        Ok(grid(columns, origin, DVec3::ONE))
    }

    /// Returns the length in millimetres of the units of three `axes` in a field, which has one of the `counts` of units;
    /// quotes may be left out. Without the field all are mm. The units of other axes, as of time, do not matter.
    fn millimetres(&self, field: &str, counts: &[usize], axes: [usize; 3]) -> Result<DVec3> {
        let Some(text) = self.field(field) else { return Ok(DVec3::ONE) };
        let wrong = |why: String| {
            bad("VGS-NRD-021", format!("'{field}' is '{}'; {why}", excerpt(text)))
                .help("write \"mm\" for each axis, or leave the field out")
        };
        let names: Vec<&str> = match text.contains('"') {
            true => text.split('"').skip(1).step_by(2).map(str::trim).collect(),
            false => text.split_whitespace().collect(),
        };
        if !counts.contains(&names.len()) {
            return Err(wrong(format!("one unit for each axis is needed, and there are {}", names.len())));
        }
        let length = |axis: usize| match names.get(axis).copied().unwrap_or_default() {
            "" | "???" | "none" | "mm" | "millimeter" | "millimeters" | "millimetre" | "millimetres" => {
                Ok(1.0)
            }
            "nm" => Ok(1e-6),
            "um" | "µm" | "μm" | "micron" | "microns" | "micrometer" | "micrometers" => Ok(1e-3),
            "cm" => Ok(10.0),
            "m" | "meter" | "meters" | "metre" | "metres" => Ok(1e3),
            other => Err(wrong(format!("the unit '{}' is not known", excerpt(other)))),
        };
        let [x, y, z] = axes.map(length);
        Ok(DVec3::new(x?, y?, z?))
    }
}

/// Parses the vectors of a line such as "(1,0,0) none (0,1,0)", of three or four numbers each; `None` if it
/// is something else.
fn vectors(text: &str) -> Option<Vec<Option<[f64; 4]>>> {
    let mut found = Vec::new();
    let mut rest = text.trim();
    while !rest.is_empty() {
        if let Some(inside) = rest.strip_prefix('(') {
            let (numbers, after) = inside.split_once(')')?;
            let numbers: Option<Vec<f64>> = numbers.split(',').map(|n| n.trim().parse().ok()).collect();
            let vector = match *numbers?.as_slice() {
                [x, y, z] => [x, y, z, 0.0],
                [x, y, z, time] => [x, y, z, time],
                _ => return None,
            };
            found.push(Some(vector));
            rest = after.trim_start();
        } else {
            let end = rest.find(|c: char| c.is_whitespace() || c == '(').unwrap_or(rest.len());
            let (word, after) = rest.split_at(end);
            if !word.eq_ignore_ascii_case("none") {
                return None;
            }
            found.push(None);
            rest = after.trim_start();
        }
    }
    Some(found)
}

/// Returns the part of a vector that is in space; `None` for the axis of time, and for NaN, with which some
/// writers mark an axis without a direction.
fn in_space([x, y, z, time]: [f64; 4]) -> Option<DVec3> {
    let direction = DVec3::new(x, y, z);
    let is_time = direction == DVec3::ZERO && time != 0.0;
    let is_none = direction.to_array().iter().all(|v| v.is_nan());
    (!is_time && !is_none).then_some(direction)
}
