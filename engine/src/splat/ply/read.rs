//! Reading splat sets from PLY, ours and those of others.

use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::path::Path;

use glam::DVec3;
use ply_rs::ply::{ElementDef, PropertyType};

use super::header::{Header, bad, quoted};
use super::rows::{self, Column};
use super::{FORMAT, INTENSITY_ELEMENT, SH0, comments};
use crate::error::{Error, Kind, Result};
use crate::splat::{ReadOptions, Splat, SplatSet, Summary, defect};

/// Luminance of linear RGB (Rec. 709).
const LUMINANCE: [f32; 3] = [0.2126, 0.7152, 0.0722];

/// Properties that hold a physical intensity; the first that an element has counts.
const INTENSITY_PROPERTIES: [&str; 2] = ["hu", "intensity"];

/// The properties of a splat, in the order of its first 11 floats.
const SPLAT_PROPERTIES: [&str; INTENSITY_SLOT] =
    ["x", "y", "z", "opacity", "rot_0", "rot_1", "rot_2", "rot_3", "scale_0", "scale_1", "scale_2"];

/// The colour, where there is no intensity; it follows the splat's floats in a row.
const COLOUR_PROPERTIES: [&str; 3] = ["f_dc_0", "f_dc_1", "f_dc_2"];

/// Where the intensity stands among the floats of a [`Splat`].
const INTENSITY_SLOT: usize = 11;
const SPLAT_SLOTS: usize = INTENSITY_SLOT + 1;
const ROW_SLOTS: usize = SPLAT_SLOTS + COLOUR_PROPERTIES.len();

/// Reads a splat set; the module above says what is accepted.
pub fn read(path: &Path, options: &ReadOptions) -> Result<SplatSet> {
    Ok(open(path, options)?.set)
}

/// Reads a splat set and tells what the file holds.
pub fn describe(path: &Path, options: &ReadOptions) -> Result<Summary> {
    let Loaded { set, header, dropped, bytes } = open(path, options)?;
    let bounds = |value: fn(&Splat) -> [f32; 3]| {
        let first = value(set.splats.first()?);
        Some(set.splats.iter().map(value).fold([first; 2], |[low, high], v| {
            [std::array::from_fn(|k| low[k].min(v[k])), std::array::from_fn(|k| high[k].max(v[k]))]
        }))
    };
    let world = |mean: [f32; 3]| (DVec3::from_array(mean.map(f64::from)) + set.origin_mm).to_array();
    let vertex = header.element("vertex").map(|(_, element)| element);
    Ok(Summary {
        format: FORMAT.name,
        encoding: header.encoding.to_string(),
        file_bytes: bytes,
        splats: set.splats.len(),
        dropped,
        elements: header.elements.iter().map(|e| (e.name.clone(), e.count as u64)).collect(),
        properties: vertex.map(|e| e.properties.keys().cloned().collect()).unwrap_or_default(),
        kernel: set.field.kernel.name(),
        has_intensity: set.has_intensity,
        intensity_range: bounds(|splat| [splat.intensity; 3]).map(|range| range.map(|v| v[0])),
        bounding_box_mm: bounds(|splat| splat.mean).map(|corners| corners.map(world)),
        origin_mm: set.origin_mm.to_array(),
        background: set.field.background,
        epsilon: set.field.epsilon,
        occupancy_w0: set.field.occupancy_w0,
        iterations: set.iterations,
    })
}

/// A file's content with what only [`describe`] tells.
pub(super) struct Loaded {
    pub set: SplatSet,
    pub header: Header,
    pub dropped: usize,
    pub bytes: u64,
}

fn open(path: &Path, options: &ReadOptions) -> Result<Loaded> {
    let failed = |error| Error::io(path, "reading a splat file", &error);
    let file = File::open(path).map_err(failed)?;
    let bytes = file.metadata().map_err(failed)?.len();
    let loaded = load(BufReader::new(file), bytes, options).map_err(|error| error.file(path))?;
    let file = path.display();
    if loaded.dropped > 0 {
        tracing::warn!(%file, dropped = loaded.dropped, "unusable splats were dropped");
    }
    if loaded.set.splats.is_empty() {
        tracing::warn!(%file, "the file holds no usable splat");
    }
    if !loaded.set.has_intensity {
        tracing::info!(%file, "no intensity: transfer functions act on the luminance of the colour");
    }
    Ok(loaded)
}

/// Reads a PLY file of `bytes` bytes.
pub(super) fn load(
    mut source: BufReader<impl Read + Seek>,
    bytes: u64,
    options: &ReadOptions,
) -> Result<Loaded> {
    let header = Header::read(&mut source)?;
    let (vertex_index, vertex) = header.element("vertex").ok_or_else(|| {
        let names: Vec<_> = header.elements.iter().map(|e| quoted(&e.name)).collect();
        bad("VGS-PLY-013", format!("no element `vertex`; the file has: {}", names.join(", ")))
    })?;
    let beside = header.element(INTENSITY_ELEMENT);
    let layout = Layout::of(vertex, beside.is_some())?;
    if vertex.count as u64 > options.max_splats {
        let message = format!("{} splats, at most {} are allowed", vertex.count, options.max_splats);
        return Err(bad("VGS-PLY-014", message).help("raise the limit if the file is meant to be so big"));
    }
    let last = beside.map_or(vertex_index, |(index, _)| index.max(vertex_index));
    let payload_bytes = bytes.saturating_sub(header.payload_start);
    header.check_size(last, payload_bytes)?;
    match header.trailing_bytes(payload_bytes) {
        0 => {}
        extra if options.strict => {
            return Err(bad("VGS-PLY-023", format!("{extra} bytes follow the last row")));
        }
        extra => tracing::warn!(extra, "bytes behind the last row of a PLY file were ignored"),
    }
    let stated = comments::read(&header.comments)?;

    let mut splats: Vec<Splat> = Vec::new();
    splats.try_reserve_exact(vertex.count).map_err(|_| {
        let needed = vertex.count.saturating_mul(size_of::<Splat>());
        let message = format!("no memory for {} splats: {needed} bytes are needed", vertex.count);
        Error::new(Kind::HostMemory, "VGS-PLY-015", message)
    })?;
    splats.resize(vertex.count, Splat::default());
    for (index, element) in header.elements.iter().enumerate().take(last + 1) {
        if index == vertex_index {
            rows::read(&mut source, &header, element, &layout.columns, |i, row| {
                layout.fill(&mut splats[i], row);
            })?;
        } else if element.name == INTENSITY_ELEMENT {
            let columns = [Column { property: intensity_property(element, vertex.count)?, slot: 0 }];
            rows::read(&mut source, &header, element, &columns, |i, &[c]: &[f32; 1]| {
                splats[i].intensity = c;
            })?;
        } else {
            rows::skip(&mut source, &header, element)?;
        }
    }
    let dropped = drop_unusable(&mut splats, options.strict)?;

    let sum: f64 = splats.iter().map(|splat| f64::from(splat.intensity)).sum();
    let set = SplatSet {
        origin_mm: stated.origin_mm.unwrap_or_default(),
        field: stated.field((sum / splats.len().max(1) as f64) as f32),
        has_intensity: layout.source != Source::Colour && stated.physical.unwrap_or(true),
        iterations: stated.iterations,
        splats,
    };
    Ok(Loaded { set, header, dropped, bytes })
}

/// Where the intensity of a splat comes from.
#[derive(PartialEq)]
enum Source {
    /// The element [`INTENSITY_ELEMENT`].
    Element,
    /// A vertex property.
    Property,
    /// The luminance of the colour.
    Colour,
}

/// Which vertex property goes where.
struct Layout {
    /// To the slots of a row: the 12 floats of a splat, then the colour.
    columns: Vec<Column>,
    source: Source,
}

impl Layout {
    fn of(vertex: &ElementDef, intensity_beside: bool) -> Result<Layout> {
        let position = |name: &&str| vertex.properties.get_index_of(*name);
        let list = vertex.properties.values().find(|p| matches!(p.data_type, PropertyType::List(..)));
        if let Some(list) = list {
            return Err(bad("VGS-PLY-018", format!("vertex property `{}` is a list", quoted(&list.name))));
        }
        let intensity = INTENSITY_PROPERTIES.iter().find_map(position);
        let source = match intensity {
            _ if intensity_beside => Source::Element,
            Some(_) => Source::Property,
            None => Source::Colour,
        };
        let mut wanted: Vec<(&str, usize)> = SPLAT_PROPERTIES.into_iter().zip(0..).collect();
        if source == Source::Colour {
            wanted.extend(COLOUR_PROPERTIES.into_iter().zip(SPLAT_SLOTS..));
        }
        let missing: Vec<_> =
            wanted.iter().map(|&(name, _)| name).filter(|name| position(name).is_none()).collect();
        if !missing.is_empty() {
            return Err(bad("VGS-PLY-019", format!("missing vertex properties: {}", missing.join(", ")))
                .help("the file holds no Gaussian splats, or lacks both a colour (f_dc) and an intensity"));
        }
        let mut columns: Vec<Column> = wanted
            .iter()
            .filter_map(|(name, slot)| Some(Column { property: position(name)?, slot: *slot }))
            .collect();
        if source == Source::Property {
            columns.extend(intensity.map(|property| Column { property, slot: INTENSITY_SLOT }));
        }
        Ok(Layout { columns, source })
    }

    /// Takes over a row; an intensity that comes from its own element stays.
    fn fill(&self, splat: &mut Splat, row: &[f32; ROW_SLOTS]) {
        let intensity = match self.source {
            Source::Element => splat.intensity,
            Source::Property => row[INTENSITY_SLOT],
            Source::Colour => {
                LUMINANCE.iter().zip(&row[SPLAT_SLOTS..]).map(|(weight, dc)| weight * (0.5 + SH0 * dc)).sum()
            }
        };
        let values: [f32; SPLAT_SLOTS] = std::array::from_fn(|slot| row[slot]);
        *splat = Splat { intensity, ..bytemuck::cast(values) };
    }
}

/// The property of the intensity element that holds the value.
fn intensity_property(element: &ElementDef, splat_count: usize) -> Result<usize> {
    if element.count != splat_count {
        let message = format!("{} intensities for {splat_count} splats", element.count);
        return Err(bad("VGS-PLY-020", message));
    }
    let scalar = |name: &&str| {
        let (index, _, property) = element.properties.get_full(*name)?;
        matches!(property.data_type, PropertyType::Scalar(_)).then_some(index)
    };
    INTENSITY_PROPERTIES.iter().find_map(scalar).ok_or_else(|| {
        bad("VGS-PLY-021", format!("element `{INTENSITY_ELEMENT}` has no property `intensity` or `hu`"))
    })
}

/// Removes the splats that cannot be used and returns their number; with `strict`, the first is an error.
fn drop_unusable(splats: &mut Vec<Splat>, strict: bool) -> Result<usize> {
    if strict && let Some((index, why)) = splats.iter().enumerate().find_map(|(i, s)| Some((i, defect(s)?))) {
        return Err(bad("VGS-PLY-022", format!("splat {index} is unusable: {why}")));
    }
    let before = splats.len();
    splats.retain(|splat| defect(splat).is_none());
    Ok(before - splats.len())
}
