//! The file: a mark, a header in JSON, the region, what is coded of it, the layers.

use std::io::Read;
use std::path::Path;

use flate2::Crc;
use glam::DAffine3;
use serde::{Deserialize, Serialize};

use super::exceptions;
use super::lattice::Lattice;
use super::layers::{self, COLUMNS, Models, Row};
use super::rounding::{Cells, Rounding, Steps};
use super::values;
use crate::mend::Mended;
use crate::region::Stored;
use crate::voxels::{LARGEST_BOUND, LARGEST_CODE, Precision, Sites};
use crate::{
    Field, Form, Grid, Kernel, ReadOptions, Region, Splat, SplatSet, Summary, Unplaced, Voxels, WriteOptions,
    by_importance, defect,
};
use base::error::{Error, Kind, Result};
use base::input::Input;
use base::memory;
use base::unit::Unit;

/// The first bytes of a file; they tell when it went through a program that changes line ends.
pub const MARK: [u8; 8] = *b"\x89VGS\r\n\x1a\n";
/// Versions of the format that are read; the last is written. Version 1 has exceptions instead of a region.
const VERSIONS: std::ops::RangeInclusive<u32> = 1..=2;
/// Most bytes of a header.
const LONGEST_HEADER: u32 = 1 << 20;
/// Most splats of a byte: a writer adds zeros where it would have more.
const MOST_A_BYTE: u64 = 16;
/// Host bytes that a splat takes while it is read.
const HOST_BYTES_A_SPLAT: u64 = 128;
/// Host bytes that a voxel of the box around the region takes while what is coded is read.
const HOST_BYTES_A_CODED_VOXEL: u64 = 16;
/// A set of at least this many splats is cut into layers: an eighth, a quarter, the rest.
const LAYERED: usize = 4096;

/// What a file states before its layers.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    program: String,
    note: String,
    kernel: String,
    background: f32,
    epsilon: f32,
    occupancy_w0: f32,
    /// Name of the [`Unit`].
    intensity: String,
    iterations: Option<u32>,
    grid: Option<GridHeader>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    volume_crc32: Option<u32>,
    form: String,
    labels: bool,
    label_names: Vec<(u8, String)>,
    /// Rows of the map from the lattice's space to mm RAS.
    affine: [f64; 12],
    steps: Steps,
    cells: Cells,
    ranges: [[i32; 2]; COLUMNS],
    /// The region; `count` is the number of its voxels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    region: Option<Part>,
    /// V of the region's voxels, in place of splats.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    voxels: Vec<VoxelsHeader>,
    layers: Vec<Part>,
    /// What version 1 has for a region.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    exceptions: Option<Part>,
}

impl Header {
    /// Returns the number of splats in all layers.
    fn declared(&self) -> u64 {
        self.layers.iter().fold(0, |sum, part| sum.saturating_add(part.count))
    }
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct GridHeader {
    size: [u32; 3],
    affine: [f64; 12],
}

/// What is stated of the coded voxels of a fit.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct VoxelsHeader {
    fit: u8,
    /// The intensity that a code of 1 stands for.
    step: f64,
    /// Greatest error of a code.
    bound: u32,
    /// True if the intensities were whole numbers.
    whole: bool,
    /// The slabs, the lowest first; `count` is the number of their voxels of region and rim.
    slabs: Vec<Part>,
}

impl VoxelsHeader {
    /// Returns the header and the bytes of the voxels of a set's fit.
    fn of(voxels: &Voxels, set: &SplatSet) -> Option<(Self, Vec<u8>)> {
        let (region, grid) = (set.region.as_ref()?, set.grid?);
        let sites = Sites::of(region, voxels.fit, grid.size);
        let codes: Option<Vec<i32>> = sites.voxels().map(|voxel| voxels.code(voxel.map(i64::from))).collect();
        let Precision { step, codes: bound, whole } = voxels.precision;
        let slabs = values::encode(&codes?, values::Shape::of(&sites), bound);
        let count = |k: usize| values::count(values::Shape::of(&sites), k);
        let parts = slabs.iter().enumerate().map(|(k, slab)| Part::of(count(k), slab)).collect();
        Some((VoxelsHeader { fit: voxels.fit, step, bound, whole, slabs: parts }, slabs.concat()))
    }

    fn precision(&self) -> Option<Precision> {
        let possible = self.bound < LARGEST_BOUND
            && (1e-30..1e30).contains(&self.step)
            && (!self.whole || self.step == 1.0);
        possible.then_some(Precision { step: self.step, codes: self.bound, whole: self.whole })
    }

    /// Reads the voxels of a region from the bytes of the slabs.
    fn read(&self, slabs: &[&[u8]], region: &Region, grid: &Grid) -> Option<Voxels> {
        let precision = self.precision()?;
        let sites = Sites::of(region, self.fit, grid.size);
        let codes = values::decode(slabs, values::Shape::of(&sites), self.bound)?;
        codes.iter().all(|code| code.abs() <= LARGEST_CODE).then_some(())?;
        Some(Voxels::of_codes(self.fit, precision, sites, &codes))
    }
}

/// A part of the file after the header.
#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Part {
    count: u64,
    bytes: u64,
    crc32: u32,
}

impl Part {
    fn of(count: usize, bytes: &[u8]) -> Self {
        Part { count: count as u64, bytes: bytes.len() as u64, crc32: crc32(bytes) }
    }
}

fn crc32(bytes: &[u8]) -> u32 {
    let mut crc = Crc::new();
    crc.update(bytes);
    crc.sum()
}

/// Returns true if a file begins with these bytes.
pub fn sniff(start: &[u8]) -> bool {
    start.starts_with(&MARK)
}

/// Writes `set` atomically.
///
/// # Errors
/// [`Kind::NothingToDo`] without splats, [`Kind::Usage`] for a set with colours, which this format does not
/// hold.
pub fn write(path: &Path, set: &SplatSet, options: &WriteOptions) -> Result<()> {
    let bytes = encode(set).map_err(|error| error.file(path))?;
    base::output::write_atomic(path, options.force, |out| out.write_all(&bytes))
}

/// Returns the size in bytes of the file that [`write()`] makes of `set`.
pub fn bytes(set: &SplatSet, _options: &WriteOptions) -> Result<u64> {
    Ok(encode(set)?.len() as u64)
}

/// Returns the file that [`write()`] makes of `set`.
///
/// # Errors
/// Those of [`write()`] that do not come from the disk.
pub fn encode(set: &SplatSet) -> Result<Vec<u8>> {
    if set.colours.is_some() {
        let message = "splats with colours, and a .vgs file holds splats with intensities";
        return Err(Error::new(Kind::Usage, "VGS-FILE-001", message).help("write a .ply"));
    }
    crate::ply::check(set)?;
    let affine = set.grid.map_or(DAffine3::from_translation(set.origin_mm), |grid| grid.world_from_voxel);
    let splats = set.to_voxel(&affine);
    let unusable = || Error::new(Kind::Internal, "VGS-FILE-002", "these splats cannot be rounded");
    let label = |i: usize| set.labels.as_ref().map_or(0, |labels| labels[i]);
    let rows = |rounding: &Rounding| {
        let lattice = Lattice::new(rounding.steps)?;
        let row = |(i, splat)| Row::of(splat, label(i), &lattice, &rounding.cells);
        let mut rows = splats.iter().enumerate().map(row).collect::<Option<Vec<_>>>()?;
        // What is rounded decides the order, so that it does not depend on how the set came here.
        rows.sort_unstable();
        let rounded = rows.iter().map(|row| Some(row.splat(&lattice, &rounding.cells)?.0));
        let order = by_importance(&rounded.collect::<Option<Vec<_>>>()?, &set.field);
        Some(order.into_iter().map(|i| rows[i as usize]).collect::<Vec<_>>())
    };
    // Splats that were moved since may lie beyond the cells.
    let as_they_are = set.rounding.and_then(|rounding| Some((rounding, rows(&rounding)?)));
    let (rounding, mut rows) = as_they_are
        .or_else(|| {
            let fine = Rounding::fine(&splats);
            Some((fine, rows(&fine)?))
        })
        .ok_or_else(unusable)?;
    let ranges = layers::ranges(&rows);
    let mut models = Models::new(&ranges).ok_or_else(unusable)?;
    let mut payload = set.region.as_ref().map(Region::encode).unwrap_or_default();
    let region = set.region.as_ref().map(|region| Part::of(region.voxel_count(), &payload));
    let mut voxels = Vec::new();
    for of in &set.voxels {
        let (header, bytes) = VoxelsHeader::of(of, set).ok_or_else(unusable)?;
        payload.extend(bytes);
        voxels.push(header);
    }
    let mut parts = Vec::new();
    let ends = if rows.is_empty() {
        Vec::new()
    } else if rows.len() < LAYERED {
        vec![rows.len()]
    } else {
        vec![rows.len() / 8, rows.len() * 3 / 8, rows.len()]
    };
    let mut begin = 0;
    for end in ends {
        let mut layer = layers::encode(&mut rows[begin..end], &mut models);
        let least = ((end - begin) as u64).div_ceil(MOST_A_BYTE) as usize;
        layer.resize(layer.len().max(least), 0);
        parts.push(Part::of(end - begin, &layer));
        payload.extend(layer);
        begin = end;
    }
    let header = Header {
        program: format!("vgs {}", env!("CARGO_PKG_VERSION")),
        note: "not for diagnosis".to_owned(),
        kernel: set.field.kernel.name().to_owned(),
        background: set.field.background,
        epsilon: set.field.epsilon,
        occupancy_w0: set.field.occupancy_w0,
        intensity: set.unit.name().to_owned(),
        iterations: set.iterations,
        grid: set.grid.map(|grid| GridHeader { size: grid.size, affine: grid.rows() }),
        volume_crc32: set.volume_crc32,
        form: set.form_name().to_owned(),
        labels: set.labels.is_some(),
        label_names: set.label_names.clone(),
        affine: Grid { size: [1; 3], world_from_voxel: affine }.rows(),
        steps: rounding.steps,
        cells: rounding.cells,
        ranges,
        region,
        voxels,
        layers: parts,
        exceptions: None,
    };
    let header = serde_json::to_vec(&header).map_err(|_| unusable())?;
    let mut out = MARK.to_vec();
    for number in [*VERSIONS.end(), header.len() as u32, crc32(&header)] {
        out.extend(number.to_le_bytes());
    }
    out.extend(header);
    out.extend(payload);
    Ok(out)
}

/// Reads a set.
pub fn read(input: &Input, options: &ReadOptions) -> Result<Unplaced> {
    let Loaded { set, .. } = load(input, options)?;
    Ok(Unplaced { path: input.name().to_owned(), set, rows: None })
}

/// Reads a set from the bytes of a file. Returns it with the number of its splats that were too thin and are widened.
///
/// # Errors
/// [`Kind::BadData`] for bytes that are damaged or not those of such a file.
pub fn decode(bytes: &[u8], options: &ReadOptions) -> Result<(SplatSet, usize)> {
    decoded(bytes, options).map(|loaded| (loaded.set, loaded.mended.widened))
}

/// Reads a set and describes what the file holds.
pub fn describe(input: &Input, options: &ReadOptions) -> Result<Summary> {
    let Loaded { set, header, mended, bytes } = load(input, options)?;
    let payload: u64 = header.layers.iter().map(|part| part.bytes).sum();
    let slabs = || header.voxels.iter().flat_map(|voxels| &voxels.slabs);
    let coded: u64 = slabs().chain(&header.region).map(|part| part.bytes).sum();
    let names = ["mean", "shape", "opacity", "intensity"];
    Ok(Summary {
        encoding: match set.region.as_ref().filter(|_| !set.voxels.is_empty()) {
            Some(region) => format!(
                "voxels coded in {} slabs, {:.3} bytes each",
                slabs().count(),
                coded as f64 / region.voxel_count().max(1) as f64
            ),
            None => format!(
                "{} layers, {:.2} bytes a splat",
                header.layers.len(),
                payload as f64 / set.splats.len().max(1) as f64
            ),
        },
        dropped: mended.dropped,
        widened: mended.widened,
        elements: vec![("splat".to_owned(), set.splats.len() as u64)]
            .into_iter()
            .chain(header.region.map(|region| ("region".to_owned(), region.count)))
            .chain((!set.voxels.is_empty()).then(|| ("slab".to_owned(), slabs().count() as u64)))
            .chain(header.exceptions.map(|part| ("exception".to_owned(), part.count)))
            .collect(),
        properties: names
            .iter()
            .map(|name| (*name).to_owned())
            .chain(header.labels.then(|| "label".to_owned()))
            .collect(),
        ..Summary::of_set(&set, "vgs", "vgs", bytes)
    })
}

struct Loaded {
    set: SplatSet,
    header: Header,
    mended: Mended,
    bytes: u64,
}

fn load(input: &Input, options: &ReadOptions) -> Result<Loaded> {
    let path = input.name();
    let failed = |error| Error::io(path, "reading a splat file", &error);
    let mut file = input.open().map_err(failed)?;
    let length = file.length;
    memory::require(length, "the file")?;
    let mut bytes = Vec::new();
    Read::by_ref(&mut file).take(length).read_to_end(&mut bytes).map_err(failed)?;
    let loaded = decoded(&bytes, options).map_err(|error| error.file(path))?;
    loaded.mended.tell(path, &loaded.set);
    Ok(loaded)
}

fn damaged(what: impl Into<String>) -> Error {
    Error::new(Kind::BadData, "VGS-FILE-003", what)
        .help("the file is damaged, or no .vgs file: get it again from where it was made")
}

fn decoded(bytes: &[u8], options: &ReadOptions) -> Result<Loaded> {
    let (header, rest) = beginning(bytes, options)?;
    let Frame { field, form: (form, form_name), affine, grid } = stated(&header)?;
    let mut payload = Payload { rest };
    let mut stored = Stored { form: form_name, ..Stored::default() };
    if let Some(part) = &header.region {
        stored.bytes = Some(payload.sound(part, "the region is not as it was written")?.to_vec());
    }
    let mut slabs: Vec<Vec<&[u8]>> = Vec::new();
    for voxels in &header.voxels {
        let read = |part| payload.sound(part, "the coded voxels are not as they were written");
        slabs.push(voxels.slabs.iter().map(read).collect::<Result<_>>()?);
    }
    let (mut found, missing) = layers_of(&header, &mut payload)?;
    if missing > 0 {
        let declared = header.declared();
        let message = format!("the file ends early: {missing} of {declared} splats are missing");
        if options.strict || found.is_empty() {
            return Err(damaged(message));
        }
        tracing::warn!("{message}; what is there is shown, coarser");
    } else if let (Some(part), Some(grid)) = (&header.exceptions, &grid) {
        let broken = "the exceptions are not as they were written";
        let bytes = payload.sound(part, broken)?;
        stored.exceptions =
            exceptions::decode(bytes, part.count as usize, grid).ok_or_else(|| damaged(broken))?;
    }
    if options.strict && !payload.rest.is_empty() {
        return Err(damaged(format!("{} bytes follow its end", payload.rest.len())));
    }
    let read = found.len();
    found.retain(|(splat, _)| defect(splat).is_none());
    let dropped = read - found.len();
    if options.strict && dropped > 0 {
        return Err(damaged(format!("{dropped} splats cannot be used")));
    }
    let labels = header.labels.then(|| found.iter().map(|(_, label)| *label).collect());
    let splats: Vec<_> = found.into_iter().map(|(splat, _)| splat).collect();
    let mut set = SplatSet::from_voxel(&splats, &affine, field);
    let mut mended = Mended { dropped, ..Mended::default() };
    mended.widen(&mut set.splats);
    set.unit = Unit::from_name(&header.intensity).unwrap_or_default();
    set.labels = labels;
    set.label_names.clone_from(&header.label_names);
    set.iterations = header.iterations;
    set.grid = grid;
    set.volume_crc32 = header.volume_crc32;
    set.form = form;
    set.rounding = Some(Rounding { steps: header.steps, cells: header.cells });
    set.region = stored.region(&set)?.map_err(damaged)?;
    set.voxels = coded(&header, &slabs, &set)?;
    let names_ascend = set.label_names.is_sorted_by(|a, b| a.0 < b.0);
    if !names_ascend || crate::ply::check(&set).is_err() {
        return Err(damaged("the header states what no set can have"));
    }
    Ok(Loaded { set, header, mended, bytes: bytes.len() as u64 })
}

/// Reads the header, and returns it with what follows it.
fn beginning<'a>(bytes: &'a [u8], options: &ReadOptions) -> Result<(Header, &'a [u8])> {
    let word = |at: usize| {
        let word = bytes.get(at..at + 4)?.first_chunk()?;
        Some(u32::from_le_bytes(*word))
    };
    let start = sniff(bytes).then(|| word(8).zip(word(12)).zip(word(16))).flatten();
    let Some(((version, length), crc)) = start else {
        return Err(damaged("the file ends in its first 20 bytes"));
    };
    if !VERSIONS.contains(&version) {
        let last = VERSIONS.end();
        let message =
            format!("version {version} of the .vgs format, and this program reads those up to {last}");
        return Err(Error::new(Kind::BadData, "VGS-FILE-004", message).help("use a newer vgs"));
    }
    let text = (length <= LONGEST_HEADER).then(|| bytes.get(20..20 + length as usize)).flatten();
    let text = text
        .filter(|text| crc32(text) == crc)
        .ok_or_else(|| damaged("the header is not as it was written"))?;
    let header: Header = serde_json::from_slice(text)
        .map_err(|error| damaged(format!("the header cannot be read: {error}")))?;
    let declared = header.declared();
    if declared > options.max_splats {
        let message = format!("{declared} splats, and {} are allowed", options.max_splats);
        return Err(
            Error::new(Kind::BadData, "VGS-FILE-005", message).help("raise the limit, or take another file")
        );
    }
    let possible = |part: &Part| part.count <= part.bytes.saturating_mul(MOST_A_BYTE);
    if !header.layers.iter().chain(&header.exceptions).all(possible) {
        return Err(damaged("more splats than so few bytes can hold"));
    }
    memory::require(declared * HOST_BYTES_A_SPLAT, &format!("{declared} splats"))?;
    Ok((header, &bytes[20 + length as usize..]))
}

/// What follows the header, as far as it has not been read.
struct Payload<'a> {
    rest: &'a [u8],
}

impl<'a> Payload<'a> {
    /// Returns the bytes of the next part; `None` if the file ends in it.
    fn take(&mut self, part: &Part) -> Option<&'a [u8]> {
        let (found, after) = self.rest.split_at_checked(usize::try_from(part.bytes).ok()?)?;
        self.rest = after;
        Some(found)
    }

    /// Returns the bytes of the next part, and fails with `what` if they are not those that were written.
    fn sound(&mut self, part: &Part, what: &str) -> Result<&'a [u8]> {
        self.take(part).filter(|bytes| crc32(bytes) == part.crc32).ok_or_else(|| damaged(what))
    }
}

/// Reads the splats of the layers that are there, with their labels, and returns how many splats are missing.
fn layers_of(header: &Header, payload: &mut Payload<'_>) -> Result<(Vec<(Splat, u8)>, u64)> {
    let lattice = Lattice::new(header.steps).ok_or_else(|| damaged("a step is out of range"))?;
    let mut models = Models::new(&header.ranges).ok_or_else(|| damaged("a range is out of range"))?;
    if header.cells.side_log2.unsigned_abs() > 200 {
        return Err(damaged("the cells are out of range"));
    }
    let (mut found, mut missing) = (Vec::new(), 0u64);
    for (index, part) in header.layers.iter().enumerate() {
        let Some(layer) = payload.take(part).filter(|_| missing == 0) else {
            missing += part.count;
            continue;
        };
        let broken =
            || damaged(format!("layer {} of {} is not as it was written", index + 1, header.layers.len()));
        if crc32(layer) != part.crc32 {
            return Err(broken());
        }
        let count = part.count as usize;
        found.extend(layers::decode(layer, count, &mut models, &lattice, &header.cells).ok_or_else(broken)?);
    }
    Ok((found, missing))
}

/// Reads the coded voxels of a set that has its region.
fn coded(header: &Header, slabs: &[Vec<&[u8]>], set: &SplatSet) -> Result<Vec<Voxels>> {
    if header.voxels.is_empty() {
        return Ok(Vec::new());
    }
    let broken = || damaged("the coded voxels cannot be read");
    let (Some(region), Some(grid)) = (&set.region, &set.grid) else { return Err(broken()) };
    // Each takes the whole box, so a header must not ask for more of them than there are fits.
    let has_objects = |fit: u8| region.objects().iter().any(|object| object.fit == fit);
    let known = header.voxels.iter().all(|voxels| has_objects(voxels.fit));
    if !known || !header.voxels.is_sorted_by(|a, b| a.fit < b.fit) {
        return Err(broken());
    }
    let [first, end] = region.bounds();
    let around: u64 = (0..3).map(|k| u64::from(end[k] - first[k]) + 2).product();
    let boxes = around.saturating_mul(header.voxels.len() as u64);
    memory::require(boxes.saturating_mul(HOST_BYTES_A_CODED_VOXEL), "the coded voxels")?;
    let read = header.voxels.iter().zip(slabs).map(|(voxels, slabs)| voxels.read(slabs, region, grid));
    read.collect::<Option<Vec<_>>>().ok_or_else(broken)
}

/// What a header states of a set.
struct Frame {
    field: Field,
    /// The form and its name.
    form: (Form, &'static str),
    /// Map from the lattice's space to mm RAS.
    affine: DAffine3,
    grid: Option<Grid>,
}

fn stated(header: &Header) -> Result<Frame> {
    let kernel = Kernel::from_name(&header.kernel).ok_or_else(|| damaged("the kernel is not known"))?;
    let form = Form::from_name(&header.form).ok_or_else(|| damaged("the form is not known"))?;
    let field = Field {
        kernel,
        background: header.background,
        epsilon: header.epsilon,
        occupancy_w0: header.occupancy_w0,
    };
    let frame = Grid::from_rows([1; 3], header.affine);
    let grid = header.grid.as_ref().map(|grid| Grid::from_rows(grid.size, grid.affine));
    let sound = [Some(frame), grid].iter().flatten().all(|grid| grid.defect().is_none());
    let known = Unit::from_name(&header.intensity).is_some();
    let reachable = header.affine.iter().all(|v| v.abs() < 1e12);
    (sound && known && reachable)
        .then_some(())
        .ok_or_else(|| damaged("the header states what no set can have"))?;
    Ok(Frame { field, form, affine: frame.world_from_voxel, grid })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Splat;
    use crate::ply;
    use crate::region::tests::region_of;

    fn set(count: usize) -> SplatSet {
        let splats = (0..count)
            .map(|i| {
                let at = |k: usize| ((i * (7 + 4 * k) + k * i * i) % 97) as f32 * 0.3;
                Splat {
                    mean: [at(0), at(1), at(2)],
                    opacity_logit: at(1) * 0.1 - 1.0,
                    rotation: [1.0, at(2) * 0.1, -0.3, at(0) * 0.05],
                    log_scale: [at(0) * 0.02, 0.2 - at(1) * 0.03, 0.1],
                    intensity: at(2) * 40.0 - 200.0,
                }
            })
            .collect();
        let world_from_voxel = DAffine3::from_scale(glam::DVec3::new(-0.7, 0.7, 2.0));
        let grid = Grid { size: [60, 50, 40], world_from_voxel };
        SplatSet {
            splats,
            origin_mm: glam::DVec3::new(3.0, -7.0, 9.0),
            grid: Some(grid),
            form: Form::Grid,
            labels: Some((0..count).map(|i| (i % 4) as u8).collect()),
            label_names: vec![(1, "one".to_owned()), (3, "three".to_owned())],
            iterations: Some(12),
            region: Some(region_of(&[([5, 0, 0], 1), ([6, 0, 0], 3), ([0, 0, 3], 1)])),
            ..SplatSet::default()
        }
    }

    #[test]
    fn a_set_comes_back_with_all_that_it_states() {
        for count in [1, 40, 6000] {
            let set = set(count);
            let bytes = encode(&set).expect("a set");
            let read = decoded(&bytes, &ReadOptions { strict: true, ..ReadOptions::default() })
                .expect("the file")
                .set;
            let blank = |set: &SplatSet| SplatSet {
                splats: Vec::new(),
                labels: None,
                origin_mm: glam::DVec3::ZERO,
                rounding: None,
                ..set.clone()
            };
            assert_eq!(blank(&read), blank(&set));
            assert_eq!(read.label_counts(), set.label_counts());
            assert_eq!(encode(&read).expect("a set"), bytes, "the same when it is written again");
            let mean = |set: &SplatSet| {
                let sum: glam::DVec3 = set
                    .splats
                    .iter()
                    .map(|s| glam::DVec3::from_array(s.mean.map(f64::from)) + set.origin_mm)
                    .sum();
                sum / set.splats.len() as f64
            };
            assert!(mean(&read).distance(mean(&set)) < 0.02, "{} {}", mean(&read), mean(&set));
            if count == 6000 {
                let ply = ply::bytes(&set, &WriteOptions::default()).expect("a set");
                assert!((bytes.len() as u64) < ply / 5, "{} of {ply} bytes", bytes.len());
            }
        }
    }

    #[test]
    fn the_first_layers_are_a_coarser_scene_and_damage_is_found() {
        let bytes = encode(&set(6000)).expect("a set");
        let lenient = ReadOptions::default();
        let strict = ReadOptions { strict: true, ..lenient };
        let half = &bytes[..bytes.len() / 2];
        let coarse = decoded(half, &lenient).expect("two layers").set;
        assert_eq!((coarse.splats.len(), coarse.region), (2250, set(1).region));
        assert_eq!(decoded(half, &strict).err().expect("short").code, "VGS-FILE-003");
        assert!(decoded(&bytes[..900], &lenient).is_err(), "no layer is whole");
        let longer = [&bytes[..], b"more"].concat();
        assert!(decoded(&longer, &lenient).is_ok() && decoded(&longer, &strict).is_err(), "what follows");
        for at in 0..bytes.len().min(4000) {
            let mut changed = bytes.clone();
            changed[at] ^= 1 << (at % 8);
            let found = decoded(&changed, &lenient);
            assert!(found.is_err(), "a changed bit at byte {at} is not seen");
        }
    }

    /// Written by version 0.3.0 of the program, of the PLY beside it.
    const FIRST_VERSION: &[u8] = include_bytes!("first-version.vgs");
    const ITS_PLY: &[u8] = include_bytes!("../ply/tests/second-element.ply");

    #[test]
    fn files_of_version_1_have_the_region_that_their_exceptions_make() {
        let strict = ReadOptions { strict: true, ..ReadOptions::default() };
        let set = decoded(FIRST_VERSION, &strict).expect("an earlier file of ours").set;
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("it.ply");
        std::fs::write(&path, ITS_PLY).expect("written");
        let ply = crate::read(&path, &strict).expect("an earlier file of ours");
        assert_eq!((set.splats.len(), &set.label_names, set.grid), (40, &ply.label_names, ply.grid));
        let inside = |set: &SplatSet| {
            let region = set.region.as_ref().expect("found from splats and exceptions");
            region.voxels().map(|(voxel, _)| voxel).collect::<Vec<_>>()
        };
        assert!(inside(&set).len() > 500);
        assert_eq!(inside(&set), inside(&ply), "the splats are rounded, the mask is not");
        let again = decoded(&encode(&set).expect("a set"), &strict).expect("a file of today").set;
        assert_eq!((&again.region, &again.splats), (&set.region, &set.splats));
        let short = &FIRST_VERSION[..FIRST_VERSION.len() - 40];
        assert!(decoded(short, &ReadOptions::default()).is_err(), "its exceptions are cut off");
    }

    #[test]
    fn what_the_format_does_not_hold_is_refused() {
        let colours = crate::Harmonics { degree: 0, coefficients: vec![0.0; 9] };
        let coloured = SplatSet { colours: Some(colours), unit: Unit::Luminance, ..set(3) };
        assert_eq!(encode(&coloured).expect_err("colours").code, "VGS-FILE-001");
        let mut newer = encode(&set(3)).expect("a set");
        newer[8] = 3;
        assert_eq!(decoded(&newer, &ReadOptions::default()).err().expect("newer").code, "VGS-FILE-004");
        let few = ReadOptions { max_splats: 2, ..ReadOptions::default() };
        let bytes = encode(&set(3)).expect("a set");
        assert_eq!(decoded(&bytes, &few).err().expect("too many").code, "VGS-FILE-005");
    }
}
