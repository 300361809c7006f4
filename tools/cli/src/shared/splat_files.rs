//! Reads and writes splats in any layout, with the volume that places them if one is needed.

use std::path::Path;

use clap::Args;
use engine::fit::place::place;
use engine::splat::{self, PLY_LAYOUTS, PlyLayout, SplatSet, Unplaced, WriteOptions};
use engine::volume::{Roi, Volume};
use engine::{Error, Kind, Result};

/// Flags for writing splats.
#[derive(Args, Clone, Copy, Debug)]
#[command(next_help_heading = "Output")]
pub struct LayoutArguments {
    /// What the numbers of the PLY stand for: vgs (mm RAS and HU, what every command reads), inria (the same in
    /// rows of 62 floats, for programs that know no others), or reference, that of the paper's authors for their
    /// viewer; commands then need the volume beside it
    #[arg(long, value_name = "LAYOUT", default_value = PLY_LAYOUTS[0].name, value_parser = layout)]
    ply_layout: &'static PlyLayout,
}

impl LayoutArguments {
    /// Returns the options with which splats of this volume and region are written.
    pub fn options(self, volume: &Volume, roi: &Roi, force: bool) -> WriteOptions<'static> {
        WriteOptions {
            layout: self.ply_layout,
            place: Some(place(volume, Some(roi))),
            made_of: None,
            live: None,
            force,
        }
    }
}

/// Parses the name of a layout.
pub fn layout(text: &str) -> std::result::Result<&'static PlyLayout, String> {
    PlyLayout::named(text).ok_or_else(|| {
        let names: Vec<_> =
            PLY_LAYOUTS.iter().map(|layout| format!("{} ({})", layout.name, layout.about)).collect();
        format!("known: {}", names.join("; "))
    })
}

/// Reads splats; an error if they have no intensity in HU.
pub fn read_with_intensity(path: &Path) -> Result<Unplaced> {
    let splats = splat::read_some(path)?;
    if !splats.unit().is_physical() {
        let message = "these splats have a colour but no intensity: there is nothing to compare with HU";
        return Err(Error::new(Kind::BadData, "VGS-CLI-041", message)
            .file(path)
            .help("use splats from `vgs fit`, or a PLY with a property `intensity` or `hu`"));
    }
    Ok(splats)
}

/// Warns if the volume read from `path` is not the one that splats were fitted to.
pub fn warn_of_another_volume(set: &SplatSet, volume: &Volume, path: &Path) {
    let Some(fitted) = set.volume_crc32 else { return };
    let found = volume.crc32();
    if fitted != found {
        tracing::warn!(
            "the splats were fitted to another volume than {} is, or it is read with other options: the CRC-32 of \
             its samples is {found:08x}, and the splats name {fitted:08x}",
            path.display()
        );
    }
}

/// Writes the splats of a fit, and warns of what the layout does not store.
pub fn write(path: &Path, set: &SplatSet, options: &WriteOptions) -> Result<()> {
    splat::write_as(path, set, options)?;
    for loss in options.layout.losses(set, options.place.as_ref()) {
        tracing::warn!("{}: the layout {} is without {loss}", path.display(), options.layout.name);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layouts_are_called_by_their_names() {
        for row in PLY_LAYOUTS {
            assert_eq!(layout(row.name).map(|found| found.name), Ok(row.name));
        }
        let error = layout("authors").expect_err("no such layout");
        assert!(error.contains("vgs (") && error.contains("reference ("), "{error}");
    }
}
