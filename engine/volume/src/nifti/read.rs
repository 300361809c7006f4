//! The voxels of a NIfTI file.

use super::open::{Opened, open};
use crate::source::reserve_samples;
use crate::{ReadOptions, Volume};
use base::input::Input;
use base::unit::Unit;
use base::{Error, Kind, Result};

/// Number of voxels that are decoded at a time.
const BLOCK: usize = 65536;

/// Reads one volume, as [`Volume::read`] does.
pub(crate) fn read(input: &Input, options: &ReadOptions) -> Result<Volume> {
    let Opened { header, labels, mut voxels, .. } = open(input, options)?;
    for note in &header.notes {
        tracing::warn!("{}: {note}", input.name().display());
    }
    let voxel_path = voxels.path.clone();
    let Some(decode) = header.datatype.decode else {
        let message = format!(
            "the datatype {} ({}) is not a scalar volume",
            header.datatype.name, header.datatype.code
        );
        return Err(Error::new(Kind::BadData, "VGS-NII-015", message)
            .help("a volume of single integers or real numbers is needed, such as int16 or float32"));
    };
    let volumes = header.volumes();
    let chosen = match options.volume_index {
        Some(i) if i < volumes => i,
        None if volumes == 1 => 0,
        asked => {
            let message = match asked {
                Some(i) => format!("there is no volume {i}: the file holds {volumes}"),
                None => format!("the file holds {volumes} volumes ({:?})", header.dims),
            };
            return Err(Error::new(Kind::Usage, "VGS-NII-016", message)
                .help(format!("choose --volume-index 0..{}", volumes - 1)));
        }
    };
    let one = header.volume_bytes();
    let end = header.vox_offset.saturating_add(one.saturating_mul(volumes as u64));
    let in_memory = 4 * header.voxels() as u64;
    voxels.expect(end, options.max_bytes)?;
    if in_memory > options.max_bytes {
        let message =
            format!("takes {in_memory} bytes in memory, more than the limit of {}", options.max_bytes);
        return Err(Error::new(Kind::BadData, "VGS-VOL-005", message)
            .help("if the size is right, raise the limit with --max-bytes"));
    }
    let before = one * chosen as u64;
    if voxels.skip(before)? < before {
        return Err(voxels.truncated(end, voxels.position));
    }
    let mut out = reserve_samples(header.voxels())?;
    let mut inexact = 0_usize;
    let mut overflow = None;
    let mut block = vec![0; header.voxels().min(BLOCK) * header.datatype.bytes];
    while out.len() < header.voxels() {
        let wanted = (header.voxels() - out.len()).min(BLOCK) * header.datatype.bytes;
        if voxels.read_some(&mut block[..wanted])? < wanted {
            return Err(voxels.truncated(end, voxels.position));
        }
        decode(&block[..wanted], header.big_endian, &mut |stored| {
            let value = header.scaling.map_or(stored, |(slope, inter)| slope * stored + inter);
            let sample = value as f32;
            inexact += usize::from(header.datatype.wide_integer && f64::from(stored as f32) != stored);
            if sample.is_infinite() && stored.is_finite() && overflow.is_none() {
                overflow = Some((out.len(), value));
            }
            out.push(sample);
        });
        if let Some((index, value)) = overflow {
            let message = format!("voxel {index} is {value:e}, beyond the range of 32-bit real numbers");
            return Err(Error::new(Kind::BadData, "VGS-NII-017", message)
                .help("such values are no HU: clip or rescale the volume first"));
        }
    }
    if inexact > 0 {
        let name = header.datatype.name;
        tracing::warn!(
            "{}: {inexact} {name} values lose precision as 32-bit real numbers",
            voxel_path.display()
        );
    }
    let after = one * (volumes - 1 - chosen) as u64;
    if voxels.skip(after)? < after {
        return Err(voxels.truncated(end, voxels.position));
    }
    let extra = voxels.finish(options.max_bytes)?;
    if extra > 0 {
        tracing::warn!("{}: {extra} bytes after the voxels are ignored", voxel_path.display());
    }
    Ok(Volume {
        oriented: header.affine_source != "pixdim",
        labels,
        stated_unit: header.is_mr().then_some(Unit::Arbitrary),
        ..Volume::new(header.size(), header.affine, out)
    })
}
