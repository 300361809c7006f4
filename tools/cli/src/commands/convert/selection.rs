//! Which of the splats the flags select.

use engine::splat::{self, Object, ReadOptions, SplatSet};
use engine::{Error, Kind};
use glam::DVec3;

use super::arguments::{ConvertArguments, ObjectFlag};
use crate::shared::failure::Stop;
use crate::shared::flags::Corners;

/// A selection of splats.
pub struct Selection {
    inside: Option<Corners>,
    outside: Option<Corners>,
    /// Numbers of the objects; `None` for all.
    objects: Option<Vec<u8>>,
}

impl Selection {
    /// Returns what the flags select of splats with these objects; `None` if they say nothing.
    ///
    /// # Errors
    /// Returns the errors of [`Object::called`].
    pub fn of(arguments: &ConvertArguments, objects: &[Object]) -> engine::Result<Option<Self>> {
        let chosen = arguments.object.iter().filter_map(|flag| match flag {
            ObjectFlag::Chosen(name) => Some(name),
            ObjectFlag::Shown(_) => None,
        });
        let mut numbers = Vec::new();
        for name in chosen {
            numbers.extend(Object::called(objects, name)?.iter().map(|object| object.number));
        }
        let selection = Selection {
            inside: arguments.inside,
            outside: arguments.outside_box,
            objects: (!numbers.is_empty()).then_some(numbers),
        };
        let Selection { inside, outside, objects } = &selection;
        let says_nothing = inside.is_none() && outside.is_none() && objects.is_none();
        Ok(Some(selection).filter(|_| !says_nothing))
    }

    /// Returns true if it has a splat of the object with this number whose mean is there, mm RAS.
    pub fn has(&self, number: u8, mean: DVec3) -> bool {
        self.inside.is_none_or(|corners| holds(corners, mean))
            && self.outside.is_none_or(|corners| !holds(corners, mean))
            && self.objects.as_ref().is_none_or(|numbers| numbers.contains(&number))
    }
}

/// Returns true if the box has this place, its borders included.
fn holds(corners: Corners, place: DVec3) -> bool {
    place.cmpge(corners.0[0]).all() && place.cmple(corners.0[1]).all()
}

/// Returns the error of a selection that has none of so many splats.
pub fn nothing(arguments: &ConvertArguments, count: usize) -> Error {
    let message = format!("none of {count} splats or voxels is selected");
    let places = splat::describe(arguments.first(), &ReadOptions::default()).ok();
    let help = match places.and_then(|summary| summary.bounding_box_mm) {
        Some([low, high]) => format!("they lie between {low:.1?} and {high:.1?} mm RAS"),
        None => "give another --box or --object".to_owned(),
    };
    Error::new(Kind::NothingToDo, "VGS-CLI-131", message).file(arguments.first()).help(help)
}

/// Returns the splats of `set` that the flags select; all if they say nothing.
pub fn selected(arguments: &ConvertArguments, set: SplatSet) -> Result<SplatSet, Stop> {
    let Some(selection) = Selection::of(arguments, &set.objects())? else { return Ok(set) };
    let part = set.part(|number, mean| selection.has(number, mean));
    if part.is_empty() {
        return Err(nothing(arguments, set.count()).into());
    }
    Ok(part)
}
