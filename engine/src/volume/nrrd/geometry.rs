//! The axes of an NRRD file: which of them are in space, and where they lie in the patient.

use glam::{DAffine3, DVec3};

use super::header::{Header, bad};
use crate::Result;
use crate::volume::affine::{RAS_FROM_LPS, grid};
use crate::volume::text_header::{excerpt, reals};

/// The spaces of a patient, by both of their names, with the sign that takes each of their axes to RAS.
const SPACES: [(&str, &str, DVec3); 3] = [
    ("right-anterior-superior", "ras", DVec3::ONE),
    ("left-anterior-superior", "las", DVec3::new(-1.0, 1.0, 1.0)),
    ("left-posterior-superior", "lps", RAS_FROM_LPS),
];

/// The spaces that do not refer to a patient.
const OTHER_SPACES: [&str; 3] = ["scanner-xyz", "3d-right-handed", "3d-left-handed"];

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
        let Some(text) = self.field("spacedirections") else { return Ok(None) };
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
        let kinds: Vec<String> =
            self.field("kinds").unwrap_or_default().split_whitespace().map(str::to_lowercase).collect();
        let kind = |axis: usize| kinds.get(axis).map_or("none", String::as_str);
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
        let origin = match self.field("spaceorigin") {
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
        let units = DVec3::from_array(self.millimetres("spaceunits", [0, 1, 2], notes));
        let columns =
            axes.spatial.map(|a| units * directions.get(a).copied().flatten().unwrap_or(DVec3::ZERO));
        Ok((grid(columns, units * origin, signs), oriented))
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
        Err(bad("VGS-NRD-014", format!("the space is '{}', which is not known", excerpt(text)))
            .help(format!("known spaces: {}, {}", known.join(", "), OTHER_SPACES.join(", "))))
    }

    /// Returns the affine of a header without directions.
    fn affine_of_spacings(&self, axes: &Axes, rank: usize, notes: &mut Vec<String>) -> Result<DAffine3> {
        let millimetres = self.millimetres("units", axes.spatial, notes);
        let list = |name: &str| match self.field(name).map(|text| (text, reals(text))) {
            None => Ok(vec![f64::NAN; rank]),
            Some((_, Some(found))) if found.len() == rank => Ok(found),
            Some((text, _)) => {
                let message = format!("'{name}' is '{}'; {rank} numbers are needed", excerpt(text));
                Err(bad("VGS-NRD-015", message).help("write nan where an axis has none"))
            }
        };
        let (spacings, mins) = (list("spacings")?, list("axismins")?);
        let centers = self.field("centers").or(self.field("centerings")).unwrap_or_default().to_lowercase();
        let centers: Vec<_> = centers.split_whitespace().collect();
        let (mut columns, mut origin) = ([DVec3::ZERO; 3], DVec3::ZERO);
        for (place, &axis) in axes.spatial.iter().enumerate() {
            let mut spacing = spacings.get(axis).copied().unwrap_or(f64::NAN);
            if spacing.is_nan() {
                notes.push(format!("axis {axis} has no spacing: it is taken as 1 mm"));
                spacing = 1.0;
            }
            if spacing < 0.0 {
                notes.push(format!("the spacing of axis {axis} is {spacing}: its sign is ignored"));
            }
            if spacing == 0.0 || spacing.is_infinite() {
                let message = format!("the spacing of axis {axis} is {spacing}; a length is needed");
                return Err(
                    bad("VGS-NRD-016", message).help("the header is damaged: export the volume again")
                );
            }
            let min = mins.get(axis).copied().filter(|m| m.is_finite()).unwrap_or(0.0);
            // The lower end of a cell is half a voxel before its centre.
            let half = if mins.get(axis).is_some_and(|m| m.is_finite()) && centers.get(axis) == Some(&"cell")
            {
                spacing.abs() / 2.0
            } else {
                0.0
            };
            let scale = millimetres.get(place).copied().unwrap_or(1.0);
            if let Some(column) = columns.get_mut(place) {
                *column = DVec3::AXES[place] * spacing.abs() * scale;
                origin += DVec3::AXES[place] * (min + half) * scale;
            }
        }
        Ok(grid(columns, origin, DVec3::ONE))
    }

    /// Returns the length in millimetres of the units of three axes, from a field of quoted names.
    fn millimetres(&self, field: &str, axes: [usize; 3], notes: &mut Vec<String>) -> [f64; 3] {
        let names: Vec<&str> = self.field(field).unwrap_or_default().split('"').skip(1).step_by(2).collect();
        axes.map(|axis| match names.get(axis).map_or("", |name| name.trim()) {
            "" | "mm" | "millimeter" | "millimeters" | "millimetre" | "millimetres" => 1.0,
            "um" | "µm" | "μm" | "micron" | "microns" | "micrometer" | "micrometers" => 1e-3,
            "cm" => 10.0,
            "m" => 1e3,
            other => {
                notes.push(format!("the unit '{}' is not known: it is taken as mm", excerpt(other)));
                1.0
            }
        })
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
    (!is_time && !direction.is_nan()).then_some(direction)
}
