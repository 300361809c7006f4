//! The voxels of a NIfTI file.

use super::open::{Opened, open as open_file};
use crate::payload::{Layout, Packing, Payload};
use crate::voxel_source::{VoxelSource, opened, without_voxels};
use crate::{Grid, ReadOptions, Volume};
use base::input::Input;
use base::unit::Unit;
use base::{Error, Kind, Result};

/// Opens one volume, as [`Volume::open`] does.
pub(crate) fn open(input: &Input, options: &ReadOptions) -> Result<Box<dyn VoxelSource>> {
    let Opened { header, labels, voxels, .. } = open_file(input, options)?;
    for note in &header.notes {
        tracing::warn!("{}: {note}", input.name().display());
    }
    let Some(element) = header.datatype.element else {
        let message = format!(
            "the datatype {} ({}) is not a scalar volume",
            header.datatype.name, header.datatype.code
        );
        return Err(Error::new(Kind::BadData, "VGS-NII-015", message)
            .help("a volume of single integers or real numbers is needed, such as int16 or float32"));
    };
    let grid = Grid { size: header.size(), world_from_voxel: header.affine };
    let volumes = (header.volumes(), header.voxels());
    let mut layout = Layout::new(element, header.big_endian, grid.size, volumes, options)?;
    layout.scaling = header.scaling;
    let about = Volume {
        oriented: header.affine_source != "pixdim",
        labels,
        stated_unit: header.is_mr().then_some(Unit::Arbitrary),
        ..without_voxels()
    };
    let payload = Payload::new(voxels, Packing::Plain, options.lenient)?;
    opened(input, about, grid, (layout, payload), false, options)
}
