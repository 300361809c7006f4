//! The reader of binary glTF.

use std::io::{BufReader, Read, Seek, SeekFrom};
use std::ops::Range;

use glam::{DAffine3, DMat3, DVec3};
use serde_json::Value;

use super::document::{Document, Instance, damaged, packing};
use super::{AXES, HU, INTENSITY, LABEL, LOGIT, NAME, WIDENING};
use crate::activation::Activations;
use crate::harmonics::{MAX_DEGREE, SH0, basis_count};
use crate::mend::{Mended, bound_opacities, ordinary_field, reserve, zeros};
use crate::ordinary::finished;
use crate::ply::comments::{self, Stated};
use crate::ply::region::exceptions;
use crate::region::Stored;
use crate::space::transformed;
use crate::{Harmonics, PLY_LAYOUTS, ReadOptions, Splat, SplatSet, Summary, Unplaced, ply};
use base::error::{Error, Kind, Result};
use base::input::Input;
use base::memory;
use base::unit::Unit;

const MARK: &[u8; 4] = b"glTF";
const VERSION: u32 = 2;
/// Longest JSON that is read, bytes. That of splats takes a few thousand.
const LONGEST_JSON: u32 = 4 << 20;
/// Extensions that may be required: without any other the file would be misread.
const KNOWN: [&str; 2] = [NAME, "KHR_mesh_quantization"];
/// Least bytes of the place of a splat.
const PLACE_BYTES: u64 = 3;
const MILLIMETRES: f64 = 1e3;

/// Returns true if a file begins so.
pub fn sniff(start: &[u8]) -> bool {
    start.starts_with(MARK)
}

/// Reads a set, with intensities if the file has them, and otherwise with colours.
pub fn read(input: &Input, options: &ReadOptions) -> Result<Unplaced> {
    let Loaded { set, .. } = load(input, options)?;
    Ok(Unplaced { path: input.name().to_owned(), set, rows: None })
}

/// Reads a set and describes what the file holds.
pub fn describe(input: &Input, options: &ReadOptions) -> Result<Summary> {
    let Loaded { set, mended, bytes, layout, properties } = load(input, options)?;
    Ok(Summary {
        encoding: "binary glTF 2.0".to_owned(),
        elements: vec![("splat".to_owned(), (set.splats.len() + mended.dropped) as u64)],
        dropped: mended.dropped,
        widened: mended.widened,
        properties,
        ..Summary::of_set(&set, "glb", layout, bytes)
    })
}

struct Loaded {
    set: SplatSet,
    mended: Mended,
    bytes: u64,
    layout: &'static str,
    /// Names of the attributes.
    properties: Vec<String>,
}

fn load(input: &Input, options: &ReadOptions) -> Result<Loaded> {
    let path = input.name();
    let failed = |error| Error::io(path, "reading a splat file", &error);
    let file = input.open().map_err(failed)?;
    let bytes = file.length;
    let loaded = decoded(BufReader::new(file), bytes, options).map_err(|error| error.file(path))?;
    loaded.mended.tell(path, &loaded.set);
    if loaded.set.unit.is_physical() && loaded.layout == ply::ORDINARY {
        tracing::warn!(
            file = %path.display(),
            "the file has intensities, and not what vgs states beside them, so a Gaussian kernel, the mean as background \
             and no grid are assumed"
        );
    }
    Ok(loaded)
}

/// Returns the JSON and the place of the binary chunk, which may be empty.
fn chunks(source: &mut (impl Read + Seek), bytes: u64) -> Result<(Vec<u8>, Range<u64>)> {
    let ended = |_| damaged("the file ended in its header");
    let mut numbers = [[0; 4]; 5];
    source.read_exact(numbers.as_flattened_mut()).map_err(ended)?;
    let [mark, version, length, json, kind] = numbers;
    let [version, length, json] = [version, length, json].map(u32::from_le_bytes);
    if mark != *MARK || kind != *b"JSON" {
        return Err(damaged("the file does not begin as a binary glTF file does"));
    }
    if version != VERSION {
        let message = format!("version {version} of binary glTF, and version {VERSION} is read");
        return Err(Error::new(Kind::BadData, "VGS-GLB-002", message)
            .help("write it as glTF 2.0, with the program that it is from"));
    }
    if u64::from(length) > bytes {
        return Err(damaged(format!("the file says that it has {length} bytes, and has {bytes}")));
    }
    if json > LONGEST_JSON || u64::from(json) + 20 > u64::from(length) {
        return Err(damaged(format!("{json} bytes of JSON")));
    }
    let mut text = vec![0; json as usize];
    source.read_exact(&mut text).map_err(ended)?;
    let (start, end) = (20 + u64::from(json) + 8, u64::from(length));
    if start > end {
        return Ok((text, start..start));
    }
    let mut head = [[0; 4]; 2];
    source.read_exact(head.as_flattened_mut()).map_err(ended)?;
    let binary = u64::from(u32::from_le_bytes(head[0]));
    if head[1] != *b"BIN\0" || binary > end - start {
        return Err(damaged("the second chunk is not that of the buffer, or ends behind the file"));
    }
    Ok((text, start..start + binary))
}

/// What the file is read from.
struct Source<'a, S> {
    stream: &'a mut S,
    document: &'a Document,
    binary: Range<u64>,
}

impl<S: Read + Seek> Source<'_, S> {
    /// Passes the rows of an attribute to `each`; returns false if the primitive has none of this name.
    fn rows(
        &mut self,
        instance: &Instance,
        name: &str,
        components: usize,
        count: usize,
        each: impl FnMut(usize, [f32; 4]),
    ) -> Result<bool> {
        let Some(&index) = instance.primitive.attributes.get(name) else { return Ok(false) };
        let numbers = self.document.numbers(&self.binary, (name, index), components)?;
        if numbers.count != count {
            return Err(damaged(format!("attribute {name}: {} rows for {count} splats", numbers.count)));
        }
        numbers.read(self.stream, each).map_err(|error| damaged(format!("attribute {name}: {error}")))?;
        Ok(true)
    }
}

fn decoded(mut stream: impl Read + Seek, bytes: u64, options: &ReadOptions) -> Result<Loaded> {
    let (text, binary) = chunks(&mut stream, bytes)?;
    let document: Document = serde_json::from_slice(&text)
        .map_err(|error| damaged(format!("the JSON cannot be read: {error}")))?;
    drop(text);
    let unknown = document.extensions_required.iter().find(|name| !KNOWN.contains(&name.as_str()));
    if let Some(name) = unknown {
        return Err(unread_extension(name));
    }
    let instances = document.instances()?;
    if instances.is_empty() {
        let message = format!("no splats: no primitive of the scene has {NAME}");
        return Err(Error::new(Kind::BadData, "VGS-GLB-003", message)
            .help("meshes are not read; write splats with this extension, as a PLY or as SPZ"));
    }
    let counts = counts(&instances, &document, &binary, options)?;
    let total = counts.iter().sum::<usize>() as u64;
    let has = |name: &str| instances.iter().all(|i| i.primitive.attributes.contains_key(name));
    let intensity = [HU, INTENSITY].into_iter().find(|name| has(name));
    let labelled = has(LABEL);
    let mut source = Source { stream: &mut stream, document: &document, binary };
    let mut set = SplatSet::default();
    // Attributes may share their bytes, so the length of a file does not bound what is made of it.
    memory::require(total * size_of::<Splat>() as u64, &format!("{total} splats"))?;
    reserve(&mut set.splats, total as usize)?;
    let degrees = instances.iter().map(degree).collect::<Result<Vec<_>>>()?;
    if intensity.is_none() {
        let degree = degrees.iter().copied().max().unwrap_or(0);
        let coefficients = zeros(total as usize * 3 * basis_count(degree))?;
        set.colours = Some(Harmonics { degree, coefficients });
    }
    let mut labels = Some(zeros::<u8>(if labelled { total as usize } else { 0 })?).filter(|_| labelled);
    // Means are relative to the first node, so that f32 holds them.
    let origin = instances[0].affine.translation;
    set.origin_mm = AXES.transpose() * origin * MILLIMETRES;
    for ((instance, &count), &degree) in instances.iter().zip(&counts).zip(&degrees) {
        let first = set.splats.len();
        read_shapes(&mut source, instance, count, origin, &mut set.splats)?;
        if let Some(name) = intensity {
            read_intensities(&mut source, instance, name, count, &mut set.splats[first..])?;
        }
        if let Some(colours) = &mut set.colours {
            read_colours(&mut source, instance, degree, first..first + count, colours)?;
        }
        let mut wrong = false;
        if let Some(all) = &mut labels {
            source.rows(instance, LABEL, 1, count, |i, [label, ..]| {
                all[first + i] = label as u8;
                wrong |= f32::from(all[first + i]) != label;
            })?;
        }
        if wrong {
            tracing::warn!("the attribute {LABEL} is no whole number to 255 and was ignored");
            labels = None;
        }
    }
    set.labels = labels;
    let own = match &instances[..] {
        [one] => one.primitive.extras.as_ref().and_then(|extras| extras.get("vgs")),
        _ => None,
    };
    let stated = own.map(statements).transpose()?;
    let layout = if stated.is_some() { PLY_LAYOUTS[0].name } else { ply::ORDINARY };
    let mended = match intensity {
        None => {
            let mended = finished(&mut set, options.strict)?;
            set.label_names = stated.map(|stated| stated.label_names).unwrap_or_default();
            mended
        }
        Some(name) => {
            bound_opacities(&mut set.splats);
            let mut mended = Mended::of(&mut set, |_| None, options.strict)?;
            mended.widen(&mut set.splats);
            set.unit = if name == HU { Unit::Hu } else { Unit::Arbitrary };
            set.field = ordinary_field(&set.splats);
            if let Some(stated) = stated {
                let (_, form) = stated.form.unwrap_or_default();
                set = told(set, stated, &instances[0].affine);
                set.region = read_region(&mut source, own, &set, form)?;
            }
            mended
        }
    };
    let mut properties: Vec<_> = instances[0].primitive.attributes.keys().cloned().collect();
    properties.sort();
    Ok(Loaded { set, mended, bytes, layout, properties })
}

/// Returns the number of splats of each instance, and fails if they are more than are allowed or can be.
fn counts(
    instances: &[Instance],
    document: &Document,
    binary: &Range<u64>,
    options: &ReadOptions,
) -> Result<Vec<usize>> {
    let mut counts = Vec::new();
    let mut total = 0;
    for instance in instances {
        check_attributes(instance)?;
        let place = ("POSITION", instance.primitive.attributes["POSITION"]);
        let count = document.numbers(binary, place, 3)?.count;
        counts.push(count);
        total += count as u64;
    }
    if total > options.max_splats {
        let message = format!("{total} splats, at most {} are allowed", options.max_splats);
        return Err(
            Error::new(Kind::BadData, "VGS-GLB-005", message).help("divide the file into smaller ones")
        );
    }
    if total.saturating_mul(PLACE_BYTES) > binary.end - binary.start {
        let message = format!("{total} splats, since nodes show the same ones again and again");
        return Err(Error::new(Kind::BadData, "VGS-GLB-006", message)
            .help("write each splat once, with the program that it is from"));
    }
    Ok(counts)
}

fn unread_extension(name: &str) -> Error {
    Error::new(Kind::BadData, "VGS-GLB-004", format!("the file needs {name:?}, which is not read"))
        .help("write it without, with the program that it is from: splats as plain attributes")
}

/// Fails if attributes are missing that splats must have.
fn check_attributes(instance: &Instance) -> Result<()> {
    let own = |name: &str| format!("{NAME}:{name}");
    let needed = ["ROTATION", "SCALE", "OPACITY", "SH_DEGREE_0_COEF_0"].map(own);
    let there = |name: &str| instance.primitive.attributes.contains_key(name);
    let missing: Vec<_> = ["POSITION"]
        .into_iter()
        .chain(needed.iter().map(String::as_str))
        .filter(|name| !there(name))
        .collect();
    if missing.is_empty() {
        return Ok(());
    }
    match packing(instance.splatting) {
        Some(name) => Err(unread_extension(name)),
        None => Err(damaged(format!("splats without the attributes {}", missing.join(", ")))),
    }
}

/// Returns the degree of the harmonics; a degree is there as a whole or not at all.
fn degree(instance: &Instance) -> Result<u8> {
    let there = |name: String| instance.primitive.attributes.contains_key(&name);
    let mut degree = 0;
    for next in 1..=MAX_DEGREE {
        let found = (0..=2 * next).filter(|k| there(format!("{NAME}:SH_DEGREE_{next}_COEF_{k}"))).count();
        match found {
            0 => break,
            all if all == 2 * usize::from(next) + 1 => degree = next,
            _ => return Err(damaged(format!("harmonics of degree {next} of which some are missing"))),
        }
    }
    Ok(degree)
}

/// Appends the splats of an instance: places relative to `origin`, metres along the axes of the file, become mm RAS.
fn read_shapes<S: Read + Seek>(
    source: &mut Source<S>,
    instance: &Instance,
    count: usize,
    origin: DVec3,
    splats: &mut Vec<Splat>,
) -> Result<()> {
    let DAffine3 { matrix3, translation } = instance.affine;
    let [x, y, z] = [matrix3.x_axis, matrix3.y_axis, matrix3.z_axis];
    if !instance.affine.is_finite() || matrix3.determinant() <= 1e-30 * x.length() * y.length() * z.length() {
        return Err(damaged("a node mirrors or flattens its splats"));
    }
    let first = splats.len();
    splats.resize(first + count, Splat::default());
    let own = &mut splats[first..];
    source.rows(instance, "POSITION", 3, count, |i, [x, y, z, _]| own[i].mean = [x, y, z])?;
    source.rows(instance, &format!("{NAME}:ROTATION"), 4, count, |i, [x, y, z, w]| {
        own[i].rotation = [w, x, y, z];
    })?;
    source
        .rows(instance, &format!("{NAME}:SCALE"), 3, count, |i, [x, y, z, _]| own[i].set_scale([x, y, z]))?;
    source.rows(instance, &format!("{NAME}:OPACITY"), 1, count, |i, [opacity, ..]| {
        own[i].set_opacity(opacity)
    })?;
    let to_ras = AXES.transpose() * MILLIMETRES;
    let (linear, apart) = (to_ras * matrix3, to_ras * (translation - origin));
    for splat in own {
        *splat = transformed(splat, &linear, |x| linear * x + apart);
    }
    Ok(())
}

/// Reads the intensities of splats, with the opacities and widths that they had before they became colours.
fn read_intensities<S: Read + Seek>(
    source: &mut Source<S>,
    instance: &Instance,
    name: &str,
    count: usize,
    splats: &mut [Splat],
) -> Result<()> {
    source.rows(instance, name, 1, count, |i, [intensity, ..]| splats[i].intensity = intensity)?;
    source.rows(instance, LOGIT, 1, count, |i, [logit, ..]| splats[i].opacity_logit = logit)?;
    source.rows(instance, WIDENING, 1, count, |i, [factor, ..]| {
        splats[i].log_scale = splats[i].log_scale.map(|log| log - factor.ln());
    })?;
    Ok(())
}

/// Reads the colours of an instance, the rows `place` of all.
fn read_colours<S: Read + Seek>(
    source: &mut Source<S>,
    instance: &Instance,
    degree: u8,
    place: Range<usize>,
    colours: &mut Harmonics,
) -> Result<()> {
    let stride = colours.stride();
    let own = &mut colours.coefficients[place.start * stride..place.end * stride];
    for level in 0..=degree {
        let first = usize::from(level).pow(2);
        for k in first..basis_count(level) {
            let name = format!("{NAME}:SH_DEGREE_{level}_COEF_{}", k - first);
            source.rows(instance, &name, 3, place.len(), |i, [r, g, b, _]| {
                own[i * stride + 3 * k..][..3].copy_from_slice(&[r, g, b]);
            })?;
        }
    }
    let splatting = instance.splatting;
    if let Some(kernel) = splatting.kernel.as_deref().filter(|kernel| *kernel != "ellipse") {
        tracing::warn!("splats of the kernel {kernel:?} are shown as those of \"ellipse\"");
    }
    match splatting.color_space.as_deref() {
        Some("lin_rec709_display") => own.chunks_exact_mut(stride).for_each(encode),
        Some("srgb_rec709_display") | None => {}
        Some(other) => tracing::warn!("colours in {other:?} are taken for sRGB"),
    }
    let linear = instance.affine.matrix3;
    let rotation =
        DMat3::from_cols(linear.x_axis.normalize(), linear.y_axis.normalize(), linear.z_axis.normalize());
    let turned = Harmonics { degree: colours.degree, coefficients: own.to_vec() };
    own.copy_from_slice(&turned.turned(&(AXES.transpose() * rotation)).coefficients);
    Ok(())
}

/// Turns the coefficients of a colour in linear light to those of sRGB: exactly where it does not depend on the
/// direction, and to first order in what does.
fn encode(coefficients: &mut [f32]) {
    for channel in 0..3 {
        let light = (0.5 + SH0 * coefficients[channel]).clamp(0.0, 1.0);
        let (value, slope) = if light <= 0.003_130_8 {
            (12.92 * light, 12.92)
        } else {
            (1.055 * light.powf(1.0 / 2.4) - 0.055, 1.055 / 2.4 * light.powf(1.0 / 2.4 - 1.0))
        };
        coefficients[channel] = (value - 0.5) / SH0;
        coefficients.iter_mut().skip(3 + channel).step_by(3).for_each(|c| *c *= slope);
    }
}

/// Returns what this program has stated beside the splats.
fn statements(own: &Value) -> Result<Stated> {
    let lines = own.get("statements").and_then(Value::as_array);
    let lines: Option<Vec<String>> =
        lines.and_then(|lines| lines.iter().map(|line| Some(line.as_str()?.to_owned())).collect());
    comments::read(&lines.ok_or_else(|| damaged("extras.vgs has no lines of statements"))?)
}

/// Returns `set` with what is stated beside its splats. Where the node is no longer where the file was written with
/// it, the grid has moved with the splats.
fn told(set: SplatSet, stated: Stated, node: &DAffine3) -> SplatSet {
    let to_ras = DAffine3::from_mat3(AXES.transpose() * MILLIMETRES);
    let written = DAffine3::from_translation(AXES * stated.origin_mm.unwrap_or_default() / MILLIMETRES);
    let moved = to_ras * *node * written.inverse() * to_ras.inverse();
    let grid = stated.grid().map(|mut grid| {
        if !moved.abs_diff_eq(DAffine3::IDENTITY, 1e-9) {
            grid.world_from_voxel = moved * grid.world_from_voxel;
        }
        grid
    });
    SplatSet {
        field: stated.field(&set.field),
        unit: stated.unit.filter(|unit| unit.is_physical()).unwrap_or(set.unit),
        iterations: stated.iterations,
        grid,
        volume_crc32: stated.volume_crc32,
        form: stated.form.unwrap_or_default().0,
        label_names: stated.label_names,
        ..set
    }
}

/// Reads the region of a set from the views that `extras.vgs` names.
fn read_region<S: Read + Seek>(
    source: &mut Source<S>,
    own: Option<&Value>,
    set: &SplatSet,
    form: &'static str,
) -> Result<Option<crate::Region>> {
    let mut stored = Stored { form, bytes: read_view(source, own, "region")?, ..Stored::default() };
    if let (Some(bytes), Some(grid)) = (read_view(source, own, "exceptions")?, &set.grid) {
        stored.exceptions =
            exceptions(&bytes, grid).map_err(|what| damaged(format!("the exceptions: {what}")))?;
    }
    stored.region(set)?.map_err(damaged)
}

/// Reads the view that `extras.vgs` names so; `None` if it names none.
fn read_view<S: Read + Seek>(
    source: &mut Source<S>,
    own: Option<&Value>,
    name: &str,
) -> Result<Option<Vec<u8>>> {
    let Some(view) = own.and_then(|own| own.get(name)).and_then(Value::as_u64) else { return Ok(None) };
    let wrong = |what: String| damaged(format!("the bytes of its {name}: {what}"));
    let place = source.document.view(&source.binary, view as usize).map_err(wrong)?;
    let mut bytes = Vec::new();
    let stream = &mut *source.stream;
    stream
        .seek(SeekFrom::Start(place.start))
        .and_then(|_| stream.take(place.end - place.start).read_to_end(&mut bytes))
        .map_err(|error| wrong(error.to_string()))?;
    if bytes.len() as u64 != place.end - place.start {
        return Err(wrong("the file ended before them".to_owned()));
    }
    Ok(Some(bytes))
}

#[cfg(test)]
mod tests;
