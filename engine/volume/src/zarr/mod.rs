//! OME-Zarr (0.4 and 0.5): an image in chunks, at several resolutions, in a folder or in one zip file.
//!
//! A group says in its attributes which arrays are the image, finest first, and how their indices become lengths. The
//! crate `zarrs` reads arrays of Zarr 2 and 3: chunks, shards, codecs. A chunk that is missing is the array's fill value,
//! as Zarr has it. The standard knows lengths along the axes, and no patient: without anatomical directions (RFC 4) of
//! all axes the orientation is unknown. What [`write()`] writes also has the whole affine, as an attribute of its own.
//! Format: <https://ngff.openmicroscopy.org/0.5>.
//!
//! | file | what is there |
//! |---|---|
//! | `store` | the files of a folder or of a zip, with limits |
//! | `multiscale` | the attributes: axes, resolutions, lengths, directions |
//! | `array` | one resolution, read by boxes |
//! | `write` | the writer |

mod array;
mod multiscale;
mod store;
#[cfg(test)]
mod tests;
mod write;

use std::sync::Arc;

use zarrs::group::Group;

use self::array::Resolution;
pub(super) use self::multiscale::FIELDS;
use self::multiscale::Image;
use self::store::{Store, bad};
pub(super) use self::store::{is_store, sniff};
pub use self::write::write;
use super::voxel_source::VoxelSource;
use super::{Level, ReadOptions};
use base::input::Input;
use base::{Error, Kind, Result};

/// Name of the format.
pub const NAME: &str = "OME-Zarr";

/// Opens one volume, as [`Volume::open`](super::Volume::open) does.
pub(super) fn open(input: &Input, options: &ReadOptions) -> Result<Box<dyn VoxelSource>> {
    let (store, image) = image_of(input, options)?;
    let count = image.levels.len();
    let level = options.level.unwrap_or(0);
    let Some(chosen) = image.levels.get(level) else {
        let message = format!("there is no level {level}: the image has {count}, from 0, the finest");
        return Err(Error::new(Kind::Usage, "VGS-ZAR-006", message)
            .help("choose one of them with --level; `vgs info` lists them"));
    };
    for note in &image.notes {
        tracing::warn!("{}: {note}", input.name().display());
    }
    Ok(Box::new(Resolution::open(&store, &image, chosen, options)?))
}

/// Returns the resolutions of an image, finest first.
///
/// # Errors
/// [`Kind::Missing`], [`Kind::BadData`] or [`Kind::Io`].
pub(super) fn levels(input: impl Into<Input>) -> Result<Vec<Level>> {
    let input = input.into();
    let options = ReadOptions { volume_index: Some(0), ..ReadOptions::default() };
    let (store, image) = image_of(&input, &options)?;
    image
        .levels
        .iter()
        .map(|level| Ok(Resolution::open(&store, &image, level, &options)?.summary()))
        .collect()
}

fn image_of(input: &Input, options: &ReadOptions) -> Result<(Arc<Store>, Image)> {
    let store = Arc::new(Store::open(input, options)?);
    let group = Group::open(Arc::clone(&store), "/").map_err(|e| {
        bad("VGS-ZAR-001", format!("no group of Zarr with an image: {e}"))
            .help("give the folder above the arrays, whose zarr.json or .zattrs has 'multiscales'")
    })?;
    let image = Image::of(group.attributes(), || store.groups())?;
    Ok((store, image))
}
