//! The PLY reader, for files of this program and of others.

use std::io::{BufRead, BufReader, Read, Seek};

use ply_rs::ply::{ElementDef, PropertyType};

use super::header::{Header, bad, check_count, quoted};
use super::layout::{INRIA, PLY_LAYOUTS};
use super::names::{
    COLOUR_PROPERTIES, EXCEPTION_ELEMENT, INTENSITY_ELEMENT, INTENSITY_PROPERTY, LABEL_PROPERTY,
    REGION_ELEMENT, rest_property,
};
use super::rows::{self, Column};
use super::{comments, reference, region, veg};
use crate::activation::ANISOTROPY_LIMIT;
use crate::harmonics::{MAX_BASIS, MAX_DEGREE, basis_count, luminance};
use crate::mend::{Mended, bound_opacities, ordinary_field, zeros};
use crate::region::Stored;
use crate::{Grid, Harmonics, ReadOptions, Splat, SplatSet, Summary, Unplaced};
use base::error::{Error, Result};
use base::input::Input;
use base::unit::Unit;

/// Properties that hold a physical intensity; the first that an element has counts.
const INTENSITY_PROPERTIES: [&str; 2] = ["hu", INTENSITY_PROPERTY];

/// The properties of a splat, in the order of its first 11 floats.
const SPLAT_PROPERTIES: [&str; INTENSITY_SLOT] =
    ["x", "y", "z", "opacity", "rot_0", "rot_1", "rot_2", "rot_3", "scale_0", "scale_1", "scale_2"];

/// The scales, of which 2D Gaussian splatting has the first two: its splats are discs across their third axis.
const FLAT: [&str; 3] = ["scale_0", "scale_1", "scale_2"];

/// The layout name of ordinary 3D Gaussian splatting.
pub const ORDINARY: &str = "3dgs";

/// That of 2D Gaussian splatting.
const DISCS: &str = "2dgs";

/// Position of the intensity among the floats of a [`Splat`].
const INTENSITY_SLOT: usize = 11;
const SPLAT_SLOTS: usize = INTENSITY_SLOT + 1;
const LABEL_SLOT: usize = SPLAT_SLOTS;
/// Position of the first value that is kept beside the splats.
const BEYOND_SLOT: usize = LABEL_SLOT + 1;
/// Floats of a row: those of a splat, its label and, if there is no intensity, those of its harmonics, of
/// degree 0 or of the highest.
const GREY_SLOTS: usize = BEYOND_SLOT + 3;
const ALL_SLOTS: usize = BEYOND_SLOT + 3 * MAX_BASIS;

/// Reads a splat set; the text of the module above says what is accepted.
pub fn read(input: &Input, options: &ReadOptions) -> Result<Unplaced> {
    let Loaded { set, rows, .. } = open(input, options)?;
    Ok(Unplaced { path: input.name().to_owned(), set, rows })
}

/// Reads a splat set and describes what the file holds.
pub fn describe(input: &Input, options: &ReadOptions) -> Result<Summary> {
    let Loaded { set, rows, header, mended, bytes, layout, intensity_01_range } = open(input, options)?;
    let vertex =
        ["vertex", veg::SPLATS].into_iter().find_map(|name| header.element(name)).map(|(_, element)| element);
    let summary = Summary::of_set(&set, "ply", layout, bytes);
    let (placed, known) = (rows.is_none(), rows.as_ref().is_none_or(|rows| rows.has_hu));
    Ok(Summary {
        encoding: header.encoding.to_string(),
        dropped: mended.dropped,
        widened: mended.widened,
        elements: header.elements.iter().map(|e| (e.name.clone(), e.count as u64)).collect(),
        properties: vertex.map(|e| e.properties.keys().cloned().collect()).unwrap_or_default(),
        intensity_range: summary.intensity_range.filter(|_| known),
        intensity_01_range,
        bounding_box_mm: summary.bounding_box_mm.filter(|_| placed),
        index_box_mm: summary.bounding_box_mm.filter(|_| !placed),
        ..summary
    })
}

/// The content of a file, with the details that only [`describe`] needs.
pub(super) struct Loaded {
    pub set: SplatSet,
    /// Further values of the splats, if a volume must place them.
    pub rows: Option<reference::Rows>,
    pub header: Header,
    pub mended: Mended,
    pub bytes: u64,
    pub layout: &'static str,
    pub intensity_01_range: Option<[f32; 2]>,
}

fn open(input: &Input, options: &ReadOptions) -> Result<Loaded> {
    let path = input.name();
    let failed = |error| Error::io(path, "reading a splat file", &error);
    let file = input.open().map_err(failed)?;
    let bytes = file.length;
    let loaded = load(BufReader::new(file), bytes, options).map_err(|error| error.file(path))?;
    loaded.mended.tell(path, &loaded.set);
    if loaded.set.unit.is_physical() && loaded.layout == ORDINARY {
        let file = path.display();
        tracing::warn!(
            %file,
            "the file has intensities and no comments `vgs.`, so a Gaussian kernel, the mean as background and no grid \
             are assumed; if vgs wrote it and another program has changed it since, `vgs convert FILE --like ORIGINAL \
             -o OUT.ply` takes them from the original"
        );
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
    if let Some(splats) = veg::splats(&header) {
        let (set, mended) = veg::load(&mut source, &header, splats, bytes, options)?;
        let layout = veg::NAME;
        return Ok(Loaded { set, rows: None, header, mended, bytes, layout, intensity_01_range: None });
    }
    let stated = comments::read(&header.comments)?;
    let plan = Plan::of(&header, &stated, options)?;
    header.check_rows(plan.last, bytes, options.strict)?;
    let fixed = plan.vertex.properties.contains_key(&rest_property(3 * MAX_BASIS - 4));
    let Content { splats, mut beyond, labels, mut stored } = plan.read(&mut source, &header)?;
    let Plan { layout, grid, beside_has_label, .. } = plan;
    let (form, form_name) = stated.form.unwrap_or_default();
    stored.form = form_name;

    let ours = header.comments.iter().any(|comment| comment.trim_start().starts_with("vgs."));
    let labels = labels.taken(ours || beside_has_label)?;
    let by_reference = layout.source == Source::Reference;
    let mut rows = by_reference.then(|| reference::Rows {
        intensity_01: std::mem::take(&mut beyond),
        has_hu: layout.has_hu,
        ours: stated.reference,
    });
    let mut set = SplatSet {
        origin_mm: stated.origin_mm.unwrap_or_default(),
        unit: if layout.source == Source::Colour { Unit::Luminance } else { stated.unit.unwrap_or_default() },
        iterations: stated.iterations,
        grid,
        volume_crc32: stated.volume_crc32,
        form,
        colours: layout.degree.map(|degree| Harmonics { degree, coefficients: beyond }),
        labels,
        splats,
        ..SplatSet::default()
    };
    let mended = mend(&mut set, rows.as_mut(), options.strict)?;
    set.field = stated.field(&match &rows {
        Some(rows) => rows.field(&set.splats),
        None => ordinary_field(&set.splats),
    });
    if let Some(rows) = &rows {
        rows.check(&set.splats)?;
    }
    set.label_names = stated.label_names;
    set.region = stored.region(&set)?.map_err(|what| region::broken(REGION_ELEMENT, what))?;
    let layout = match (by_reference, ours) {
        (true, _) => reference::NAME,
        (false, true) if layout.source == Source::Element && fixed => INRIA,
        (false, true) => PLY_LAYOUTS[0].name,
        (false, false) if layout.flat => DISCS,
        (false, false) => ORDINARY,
    };
    let intensity_01_range = stated.intensity_01_range;
    Ok(Loaded { set, rows, header, mended, bytes, layout, intensity_01_range })
}

/// Mends what can be mended of splats, or of `rows` that a volume must place.
fn mend(set: &mut SplatSet, mut rows: Option<&mut reference::Rows>, strict: bool) -> Result<Mended> {
    if rows.is_none() {
        // There it is no logit.
        bound_opacities(&mut set.splats);
    }
    let part = |i: usize| {
        let finite = rows.as_ref().is_none_or(|rows| rows.intensity_01[i].is_finite());
        (!finite).then_some("a value is not finite")
    };
    let mut mended = Mended::of(set, part, strict)?;
    if let Some((rows, kept)) = rows.as_mut().zip(mended.kept.as_ref()) {
        rows.intensity_01 = kept.iter().map(|&i| rows.intensity_01[i]).collect();
    }
    // Lengths are in mm of the world only if the splats are placed.
    if rows.is_none() {
        mended.widen(&mut set.splats);
    }
    Ok(mended)
}

/// What is read of a file, as its header has it.
struct Plan<'a> {
    vertex_index: usize,
    vertex: &'a ElementDef,
    layout: Layout,
    /// Columns of the element beside the vertices, if there is one.
    beside: Option<Beside>,
    beside_has_label: bool,
    grid: Option<Grid>,
    /// Index of the last element that is read.
    last: usize,
}

/// The rows of a file.
struct Content {
    splats: Vec<Splat>,
    /// Floats of each row beyond those of a splat.
    beyond: Vec<f32>,
    labels: Labels,
    stored: Stored,
}

impl<'a> Plan<'a> {
    fn of(header: &'a Header, stated: &comments::Stated, options: &ReadOptions) -> Result<Plan<'a>> {
        let (vertex_index, vertex) = header.element("vertex").ok_or_else(|| {
            let names: Vec<_> = header.elements.iter().map(|e| quoted(&e.name)).collect();
            bad("VGS-PLY-013", format!("no element `vertex`; the file has: {}", names.join(", ")))
        })?;
        check_vertex(vertex, options)?;
        let element = header.element(INTENSITY_ELEMENT);
        let beside = element.map(|(_, element)| Beside::of(element, vertex.count)).transpose()?;
        let layout = if reference::is_layout(header, vertex, stated) {
            Layout::of_reference(vertex)?
        } else {
            Layout::of(vertex, beside.as_ref().is_some_and(Beside::has_intensity))?
        };
        // Without a grid these elements are another program's.
        let grid = stated.grid();
        let of_region =
            [REGION_ELEMENT, EXCEPTION_ELEMENT].map(|name| header.element(name).filter(|_| grid.is_some()));
        let read = of_region.into_iter().chain([element]).flatten();
        let last = read.map(|(index, _)| index).fold(vertex_index, usize::max);
        let beside_has_label = beside.as_ref().is_some_and(|beside| beside.label.is_some());
        Ok(Plan { vertex_index, vertex, layout, beside, beside_has_label, grid, last })
    }

    fn read(&self, source: &mut BufReader<impl Read + Seek>, header: &Header) -> Result<Content> {
        let Plan { layout, grid, .. } = self;
        let count = self.vertex.count;
        let mut splats = zeros::<Splat>(count)?;
        let mut beyond = zeros::<f32>(count.saturating_mul(layout.beyond()))?;
        let labelled = layout.has_label || self.beside_has_label;
        let mut labels = if labelled { Labels::of(zeros(count)?) } else { Labels::default() };
        let mut stored = Stored::default();
        for (index, element) in header.elements.iter().enumerate().take(self.last + 1) {
            if let Some(grid) = grid.as_ref().filter(|_| element.name == EXCEPTION_ELEMENT) {
                let bytes = region::read(source, header, element)?;
                stored.exceptions =
                    region::exceptions(&bytes, grid).map_err(|what| region::broken(&element.name, what))?;
            } else if grid.is_some() && element.name == REGION_ELEMENT {
                stored.bytes = Some(region::read(source, header, element)?);
            } else if index == self.vertex_index {
                let mut fill = |i: usize, row: &[f32]| {
                    layout.fill(&mut splats[i], &mut beyond, i, row);
                    if layout.has_label {
                        labels.set(i, row[LABEL_SLOT]);
                    }
                };
                let columns = &layout.columns;
                match layout.degree {
                    None | Some(0) => {
                        rows::read(source, header, element, columns, |i, row: &[f32; GREY_SLOTS]| {
                            fill(i, row);
                        })?;
                    }
                    Some(_) => {
                        rows::read(source, header, element, columns, |i, row: &[f32; ALL_SLOTS]| {
                            fill(i, row);
                        })?;
                    }
                }
            } else if let Some(beside) = self.beside.as_ref().filter(|_| element.name == INTENSITY_ELEMENT) {
                beside.read(source, header, element, &mut splats, &mut labels)?;
            } else {
                rows::skip(source, header, element)?;
            }
        }
        Ok(Content { splats, beyond, labels, stored })
    }
}

/// A property of the PLY into which SuperSplat packs splats.
const PACKED: &str = "packed_position";

/// Returns how to convert a file of other programs, with this extension, to one that is read.
pub(crate) fn convert_help(extension: &str) -> String {
    format!(
        "convert it to a PLY, for example with splat-transform (npm, @playcanvas/splat-transform): \
         splat-transform FILE.{extension} FILE.ply"
    )
}

/// Fails if the splats are packed as in SuperSplat, or there are too many.
fn check_vertex(vertex: &ElementDef, options: &ReadOptions) -> Result<()> {
    if vertex.properties.contains_key(PACKED) {
        let message = format!("the splats are packed (property `{PACKED}`): a compressed PLY of SuperSplat");
        return Err(bad("VGS-PLY-031", message).help(convert_help("compressed.ply")));
    }
    check_count(vertex, options.max_splats)
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
    /// The properties of the layout of the paper's authors.
    Reference,
}

/// The vertex properties that are read, and the slots that they go to.
struct Layout {
    /// Columns for the slots of a row: the 12 floats of a splat, its label, then the harmonics.
    columns: Vec<Column>,
    /// True if one of them is the label.
    has_label: bool,
    source: Source,
    /// Degree of the harmonics, if the file has colours instead of an intensity.
    degree: Option<u8>,
    /// True if a file of the paper's authors has their property `hu`.
    has_hu: bool,
    /// True if the splats are the discs of 2D Gaussian splatting, which have no third scale.
    flat: bool,
}

impl Layout {
    fn of(vertex: &ElementDef, intensity_beside: bool) -> Result<Layout> {
        let position = |name: &str| vertex.properties.get_index_of(name);
        let intensity = INTENSITY_PROPERTIES.iter().find_map(|name| position(name));
        let source = match intensity {
            _ if intensity_beside => Source::Element,
            Some(_) => Source::Property,
            None => Source::Colour,
        };
        let flat = FLAT.map(|name| position(name).is_some()) == [true, true, false];
        let mut wanted: Vec<(&str, usize)> = SPLAT_PROPERTIES.into_iter().zip(0..).collect();
        wanted.truncate(SPLAT_PROPERTIES.len() - usize::from(flat));
        if source == Source::Colour {
            wanted.extend(COLOUR_PROPERTIES.into_iter().zip(BEYOND_SLOT..));
        }
        let mut columns = columns(vertex, &wanted)?;
        let label = position(LABEL_PROPERTY);
        columns.extend(label.map(|property| Column { property, slot: LABEL_SLOT }));
        let mut degree = None;
        match source {
            Source::Element => {}
            Source::Property => {
                columns.extend(intensity.map(|property| Column { property, slot: INTENSITY_SLOT }));
            }
            Source::Colour => degree = Some(rest_columns(vertex, &mut columns)?),
            // This layout is handled by `of_reference` below.
            Source::Reference => {}
        }
        Ok(Layout { columns, has_label: label.is_some(), source, degree, has_hu: false, flat })
    }

    /// Creates the layout of the paper's authors, in which `intensity_01` follows the floats of a splat.
    fn of_reference(vertex: &ElementDef) -> Result<Layout> {
        let mut wanted: Vec<(&str, usize)> = SPLAT_PROPERTIES.into_iter().zip(0..).collect();
        wanted.push((reference::INTENSITY_01, BEYOND_SLOT));
        let mut columns = columns(vertex, &wanted)?;
        let hu = vertex.properties.get_index_of("hu");
        columns.extend(hu.map(|property| Column { property, slot: INTENSITY_SLOT }));
        Ok(Layout {
            columns,
            has_label: false,
            source: Source::Reference,
            degree: None,
            has_hu: hu.is_some(),
            flat: false,
        })
    }

    /// Returns the number of floats of a row beyond those of the splat.
    fn beyond(&self) -> usize {
        match self.source {
            Source::Reference => 1,
            _ => self.degree.map_or(0, |degree| 3 * basis_count(degree)),
        }
    }

    /// Fills `splat` and its part of `beyond` from row `index`; an intensity that comes from its own element
    /// is kept.
    fn fill(&self, splat: &mut Splat, beyond: &mut [f32], index: usize, row: &[f32]) {
        let intensity = match self.source {
            Source::Element => splat.intensity,
            Source::Property | Source::Reference => row[INTENSITY_SLOT],
            Source::Colour => luminance(&row[BEYOND_SLOT..]),
        };
        let mut values: [f32; SPLAT_SLOTS] = std::array::from_fn(|slot| row[slot]);
        if self.flat {
            // As thin as a splat may be.
            let [a, b, thin] = &mut values[INTENSITY_SLOT - FLAT.len()..INTENSITY_SLOT] else { return };
            *thin = a.max(*b) - ANISOTROPY_LIMIT.ln();
        }
        *splat = Splat { intensity, ..bytemuck::cast(values) };
        let count = self.beyond();
        beyond[index * count..][..count].copy_from_slice(&row[BEYOND_SLOT..][..count]);
    }
}

/// Returns the columns of the `wanted` properties, which are given with their slots.
fn columns(vertex: &ElementDef, wanted: &[(&str, usize)]) -> Result<Vec<Column>> {
    let list = vertex.properties.values().find(|p| matches!(p.data_type, PropertyType::List(..)));
    if let Some(list) = list {
        return Err(bad("VGS-PLY-018", format!("vertex property `{}` is a list", quoted(&list.name))));
    }
    let position = |name: &str| vertex.properties.get_index_of(name);
    let missing: Vec<_> =
        wanted.iter().map(|&(name, _)| name).filter(|name| position(name).is_none()).collect();
    if !missing.is_empty() {
        return Err(bad("VGS-PLY-019", format!("missing vertex properties: {}", missing.join(", ")))
            .help("the file holds no Gaussian splats, or lacks both a colour (f_dc) and an intensity"));
    }
    let column = |&(name, slot): &(&str, usize)| Some(Column { property: position(name)?, slot });
    Ok(wanted.iter().filter_map(column).collect())
}

/// Adds the columns of the harmonics beyond degree 0 and returns the degree. A file stores them channel by
/// channel, so without the right number of them the start of green is unknown.
fn rest_columns(vertex: &ElementDef, columns: &mut Vec<Column>) -> Result<u8> {
    let present = vertex.properties.keys().filter(|name| name.starts_with("f_rest_")).count();
    let degree =
        (0..=MAX_DEGREE).find(|&degree| 3 * (basis_count(degree) - 1) == present).ok_or_else(|| {
            bad("VGS-PLY-024", format!("{present} properties f_rest, 0, 9, 24 or 45 were expected"))
                .help("write spherical harmonics of degree 0 to 3, all coefficients of a degree")
        })?;
    let per_channel = basis_count(degree) - 1;
    for index in 0..present {
        let name = rest_property(index);
        let property = vertex.properties.get_index_of(name.as_str()).ok_or_else(|| {
            bad("VGS-PLY-024", format!("{present} properties f_rest, but `{name}` is not one of them"))
                .help("they count from 0 without gaps")
        })?;
        let (channel, k) = (index / per_channel, 1 + index % per_channel);
        columns.push(Column { property, slot: BEYOND_SLOT + 3 * k + channel });
    }
    Ok(degree)
}

/// Positions of intensity and label in the element beside the vertices.
struct Beside {
    intensity: Option<usize>,
    label: Option<usize>,
}

impl Beside {
    fn of(element: &ElementDef, splat_count: usize) -> Result<Beside> {
        if element.count != splat_count {
            let message = format!("{} intensities for {splat_count} splats", element.count);
            return Err(bad("VGS-PLY-020", message));
        }
        let scalar = |name: &str| {
            let (index, _, property) = element.properties.get_full(name)?;
            matches!(property.data_type, PropertyType::Scalar(_)).then_some(index)
        };
        let beside = Beside {
            intensity: INTENSITY_PROPERTIES.iter().find_map(|name| scalar(name)),
            label: scalar(LABEL_PROPERTY),
        };
        if beside.intensity.is_none() && beside.label.is_none() {
            return Err(bad(
                "VGS-PLY-021",
                format!(
                    "element `{INTENSITY_ELEMENT}` has no property `intensity`, `hu` or `{LABEL_PROPERTY}`"
                ),
            ));
        }
        Ok(beside)
    }

    fn has_intensity(&self) -> bool {
        self.intensity.is_some()
    }

    fn read(
        &self,
        source: &mut impl BufRead,
        header: &Header,
        element: &ElementDef,
        splats: &mut [Splat],
        labels: &mut Labels,
    ) -> Result<()> {
        let column = |property: Option<usize>, slot| property.map(|property| Column { property, slot });
        let columns: Vec<_> = column(self.intensity, 0).into_iter().chain(column(self.label, 1)).collect();
        rows::read(source, header, element, &columns, |i, &[intensity, label]: &[f32; 2]| {
            if self.has_intensity() {
                splats[i].intensity = intensity;
            }
            if self.label.is_some() {
                labels.set(i, label);
            }
        })
    }
}

/// The labels of a file while it is read.
#[derive(Default)]
struct Labels {
    /// The labels, `None` if the file has none.
    all: Option<Vec<u8>>,
    /// The first splat whose label is no whole number to 255, and that label.
    wrong: Option<(usize, f32)>,
}

impl Labels {
    fn of(all: Vec<u8>) -> Self {
        Labels { all: Some(all), wrong: None }
    }

    fn set(&mut self, index: usize, value: f32) {
        let Some(all) = &mut self.all else { return };
        all[index] = value as u8;
        if f32::from(all[index]) != value {
            self.wrong.get_or_insert((index, value));
        }
    }

    /// Returns the labels. If one is wrong, this fails for a file of this program (`ours`); in a file of
    /// others the property means something else, and there are no labels.
    fn taken(self, ours: bool) -> Result<Option<Vec<u8>>> {
        let Some((index, label)) = self.wrong else { return Ok(self.all) };
        let message = format!("splat {index} has the label {label}, whole numbers to 255 are allowed");
        if ours {
            return Err(bad("VGS-PLY-025", message).help("number the labels from 1 to 255; 0 is none"));
        }
        tracing::warn!("{message}: the property `{LABEL_PROPERTY}` was ignored");
        Ok(None)
    }
}
