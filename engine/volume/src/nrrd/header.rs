//! The header of an NRRD file: its lines, and the fields that describe the storage of the voxels.

use std::collections::BTreeMap;

use crate::elements::{self, Element};
use crate::fields::FieldRow;
use crate::source::Source;
use crate::text_header::{Lines, excerpt};
use base::{Error, Kind, Result};

/// The most axes that the format allows.
const MAX_AXES: usize = 16;

/// Every type of the format that is one number, by all of its names.
pub(super) const TYPES: [(&Element, &[&str]); 10] = [
    (&elements::INT8, &["signed char", "int8", "int8_t"]),
    (&elements::UINT8, &["uchar", "unsigned char", "uint8", "uint8_t"]),
    (&elements::INT16, &["short", "short int", "signed short", "signed short int", "int16", "int16_t"]),
    (&elements::UINT16, &["ushort", "unsigned short", "unsigned short int", "uint16", "uint16_t"]),
    (&elements::INT32, &["int", "signed int", "int32", "int32_t"]),
    (&elements::UINT32, &["uint", "unsigned int", "uint32", "uint32_t"]),
    (
        &elements::INT64,
        &[
            "longlong",
            "long long",
            "long long int",
            "signed long long",
            "signed long long int",
            "int64",
            "int64_t",
        ],
    ),
    (&elements::UINT64, &["ulonglong", "unsigned long long", "unsigned long long int", "uint64", "uint64_t"]),
    (&elements::FLOAT32, &["float"]),
    (&elements::FLOAT64, &["double"]),
];

/// What is done with the fields of the format.
pub(crate) const FIELDS: &[FieldRow] = &[
    FieldRow::needed(
        "type",
        "type of the voxels: single numbers of 1 to 8 bytes",
        &["block", "char", "int12", ""],
    ),
    FieldRow::needed("dimension", "number of axes, 1 to 16", &["0", "17", "-3", "three"]),
    FieldRow::needed("sizes", "size of each axis, the fastest first", &["3 2", "3 2 0", "3 2 -2", "3 2 two"]),
    FieldRow::needed("encoding", "raw, gzip or text", &["hex", "bzip2", "zip"]),
    FieldRow::with_default(
        "endian",
        "byte order; not used for single bytes and text",
        "refused, where the order of bytes matters",
        &["middle", ""],
    ),
    FieldRow::with_default(
        "space",
        "the patient's axes",
        "left and right cannot be told: a note",
        &["left-posterior", "LPSS", ""],
    ),
    FieldRow::with_default(
        "space dimension",
        "number of axes of the space",
        "that of the vectors",
        &["2", "x"],
    ),
    FieldRow::with_default(
        "space directions",
        "vector of each axis, or none",
        "orientation unknown, spacings are used: a note",
        &[
            "(1,0,0) (0,1,0)",
            "(1,0,0) (0,1,0) (0,0,two)",
            "(1,0,0) (0,1,0) (0,nan,1)",
            "(1,0,0) (0,1,0) (0,0)",
        ],
    ),
    FieldRow::with_default(
        "space origin",
        "place of the first voxel",
        "0, 0, 0: a note",
        &["1 2 3", "(1,2)", "(0,nan,0)"],
    ),
    FieldRow::with_default(
        "space units",
        "unit of each axis of the space",
        "mm",
        &["\"parsec\" \"mm\" \"mm\"", "\"mm\""],
    ),
    FieldRow::with_default(
        "spacings",
        "distance of voxels, without space directions; nan says that there is none",
        "1 mm: a note",
        &["1 2", "1 2 x", "1 0 1", "1 inf 1", "1,5 1 1"],
    ),
    FieldRow::with_default(
        "units",
        "unit of each axis, without space directions",
        "mm",
        &["\"parsec\" \"mm\" \"mm\"", "\"mm\""],
    ),
    FieldRow::with_default(
        "axis mins",
        "lower end of each axis, without space directions; nan says that there is none",
        "the first voxel is at 0",
        &["1 2", "1 2 x", "0 0 inf"],
    ),
    FieldRow::with_default(
        "axis maxs",
        "upper end of each axis, for a spacing that is not given",
        "none",
        &["1 2", "1 2 x", "0 0 inf"],
    ),
    FieldRow::with_default(
        "centerings",
        "whether the ends of an axis are those of cells or nodes",
        "nodes",
        &["cells cell cell", "cell"],
    ),
    FieldRow::with_default(
        "kinds",
        "which axes are in space",
        "the space directions say it, or the first three are",
        &["domain domain", "domain domain dommain"],
    ),
    FieldRow::with_default(
        "data file",
        "the one file of the voxels, in the folder of the header or below",
        "the voxels follow the header",
        &["LIST", "%03d.raw 1 10 1", "../a.raw", ""],
    ),
    FieldRow::with_default("line skip", "lines before the voxels", "0", &["x", "-1", "1.5"]),
    FieldRow::with_default(
        "byte skip",
        "bytes before the voxels; below 0, of plain raw voxels alone, from the end",
        "0",
        &["x", "1.5"],
    ),
    FieldRow::unused(
        "old min",
        "not applied, as in ITK and pynrrd: voxels are read as they are stored, with a note",
    ),
    FieldRow::unused("old max", "as old min"),
    FieldRow::unused("min", "not used: the voxels say it"),
    FieldRow::unused("max", "not used: the voxels say it"),
    FieldRow::unused("block size", "not used: of a type that is refused"),
    FieldRow::unused("content", "not used: text for people"),
    FieldRow::unused("labels", "not used: text for people"),
    FieldRow::with_default(
        "sample units",
        "HU or Hounsfield: values are HU; any other text is not used",
        "the values tell",
        &[],
    ),
    FieldRow::unused("thicknesses", "not used: voxels go on at their distances"),
    FieldRow::unused("measurement frame", "not used: numbers have no direction"),
    FieldRow::unused("number", "not used: the sizes say it"),
];

/// Other names of fields.
const SHORT_NAMES: [&str; 1] = ["centers"];

/// The fields and keys of a header, not yet checked.
#[derive(Debug, Default)]
pub(super) struct Header {
    /// Fields by their names in lower case and without spaces.
    pub fields: BTreeMap<String, String>,
    keys: BTreeMap<String, String>,
}

/// Encoding of the voxels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Raw,
    Gzip,
    Text,
}

pub(super) fn bad(code: &'static str, message: impl Into<String>) -> Error {
    Error::new(Kind::BadData, code, message)
}

/// Returns the error of a header whose voxels are in several files.
pub(super) fn several_files(name: &str) -> Error {
    let message = format!("the voxels are in several files ('data file: {}')", excerpt(name));
    bad("VGS-NRD-017", message)
        .help("write the volume as one file (teem: unu save -f nrrd -i IN.nhdr -o OUT.nrrd)")
}

impl Header {
    /// Reads the lines up to the empty one.
    pub fn read(source: &mut Source) -> Result<Header> {
        let mut lines = Lines::new(source);
        let magic = lines.next()?.unwrap_or_default();
        if !matches!(magic.trim_end(), "NRRD0001" | "NRRD0002" | "NRRD0003" | "NRRD0004" | "NRRD0005") {
            let message = format!("begins with '{}' instead of NRRD0001 to NRRD0005", excerpt(&magic));
            return Err(bad("VGS-NRD-001", message).help("write the volume anew as NRRD0005, or as NIfTI"));
        }
        let mut header = Header::default();
        while let Some(line) = lines.next()? {
            if line.is_empty() {
                return Ok(header);
            }
            header.add(&line).map_err(|what| {
                let message = format!("line {} of the header {what}: '{}'", lines.number, excerpt(&line));
                bad("VGS-NRD-002", message).help("correct the header, or export the volume again")
            })?;
            // The names of the files follow, and nothing else.
            if let Some(files) = header.field("data file").filter(|files| files.starts_with("LIST")) {
                return Err(several_files(files));
            }
        }
        // A header whose voxels are in another file may end with its file.
        if header.field("data file").is_some() {
            return Ok(header);
        }
        Err(bad("VGS-NRD-003", "the file ends inside the header: no empty line, and no 'data file' field")
            .help("the file was cut short; copy it again"))
    }

    fn add(&mut self, line: &str) -> std::result::Result<(), &'static str> {
        if line.starts_with('#') {
            return Ok(());
        }
        let (name, value) = line.split_once(':').ok_or("is neither a field, a key nor a comment")?;
        if let Some(value) = value.strip_prefix('=') {
            self.keys.insert(name.trim().to_owned(), value.trim().to_owned());
            return Ok(());
        }
        match self.fields.insert(without_spaces(&name.to_lowercase()), value.trim().to_owned()) {
            None => Ok(()),
            Some(_) => Err("gives a field a second time"),
        }
    }

    /// Returns a field by its name in lower case.
    pub fn field(&self, name: &str) -> Option<&str> {
        self.fields.get(&without_spaces(name)).map(String::as_str)
    }

    /// Refuses a field whose name is one letter away from that of the format; notes any other that the format does not
    /// know, which is not used.
    pub fn check_names(&self, notes: &mut Vec<String>) -> Result<()> {
        let known = || FIELDS.iter().map(|row| row.name).chain(SHORT_NAMES);
        for name in self.fields.keys() {
            if known().any(|known| without_spaces(known) == *name) {
                continue;
            }
            let meant = known().find(|known| strsim::osa_distance(name, &without_spaces(known)) == 1);
            if let Some(meant) = meant {
                let message =
                    format!("the format has no field '{}'; did the writer mean '{meant}'?", excerpt(name));
                return Err(
                    bad("VGS-NRD-019", message).help("correct the header, or export the volume again")
                );
            }
            notes.push(format!("the format has no field '{}': it is ignored", excerpt(name)));
        }
        Ok(())
    }

    pub fn needed(&self, name: &str) -> Result<&str> {
        self.field(name).ok_or_else(|| {
            bad("VGS-NRD-004", format!("the header has no field '{name}', which is needed"))
                .help("export the volume again")
        })
    }

    pub fn element(&self) -> Result<&'static Element> {
        let text = self.needed("type")?;
        let name = text.split_whitespace().collect::<Vec<_>>().join(" ").to_lowercase();
        TYPES
            .iter()
            .find(|(_, names)| names.contains(&name.as_str()))
            .map(|(element, _)| *element)
            .ok_or_else(|| {
                let what = if name == "block" { "made of opaque bytes" } else { "no type of the format" };
                bad("VGS-NRD-005", format!("'type' is '{}', {what}", excerpt(text)))
                    .help("a volume of single integers or real numbers is needed, such as short or float")
            })
    }

    pub fn encoding(&self) -> Result<Encoding> {
        let text = self.needed("encoding")?;
        match text.to_lowercase().as_str() {
            "raw" => Ok(Encoding::Raw),
            "gzip" | "gz" => Ok(Encoding::Gzip),
            "text" | "txt" | "ascii" => Ok(Encoding::Text),
            _ => Err(bad("VGS-NRD-006", format!("'encoding' is '{}', which is not read", excerpt(text)))
                .help("write the file with encoding raw or gzip (teem: unu save -f nrrd -e gzip)")),
        }
    }

    pub fn is_big_endian(&self, element: &Element, encoding: Encoding) -> Result<bool> {
        let text = self.field("endian").map(str::to_lowercase);
        match text.as_deref() {
            Some("little") => Ok(false),
            Some("big") => Ok(true),
            _ if element.bytes == 1 || encoding == Encoding::Text => Ok(false),
            other => {
                let found = excerpt(other.unwrap_or("missing"));
                let message = format!("'endian' is {found}; {} voxels need little or big", element.name);
                Err(bad("VGS-NRD-007", message)
                    .help("add 'endian: little' to the header if a PC has written the file"))
            }
        }
    }

    /// Returns the size of each axis, the fastest first.
    pub fn sizes(&self) -> Result<Vec<usize>> {
        let (dimension, text) = (self.needed("dimension")?, self.needed("sizes")?);
        let sizes: Option<Vec<usize>> =
            text.split_whitespace().map(|n| n.parse().ok().filter(|&n| n > 0)).collect();
        let rank = dimension.parse::<usize>().ok().filter(|n| (1..=MAX_AXES).contains(n));
        match (rank, sizes) {
            (Some(rank), Some(sizes)) if sizes.len() == rank => Ok(sizes),
            _ => {
                let (dimension, text) = (excerpt(dimension), excerpt(text));
                let message = format!(
                    "'dimension' is {dimension} and 'sizes' is {text}; as many positive numbers are needed"
                );
                Err(bad("VGS-NRD-008", message).help("the header is damaged: export the volume again"))
            }
        }
    }

    /// Returns the names of the segments of a label map of 3D Slicer by their values.
    pub fn labels(&self, volumes: usize) -> Result<BTreeMap<i32, String>> {
        let mut labels = BTreeMap::new();
        let mut is_segmentation = false;
        for (key, name) in &self.keys {
            let Some(segment) = key.strip_prefix("Segment").and_then(|k| k.strip_suffix("_Name")) else {
                continue;
            };
            if segment.is_empty() || !segment.bytes().all(|b| b.is_ascii_digit()) {
                continue;
            }
            is_segmentation = true;
            // Slicer before 4.11 wrote no values: the voxels of a segment were 1, in a layer of their own.
            let value = self.keys.get(&format!("Segment{segment}_LabelValue")).map_or("1", String::as_str);
            let Ok(value) = value.parse() else {
                let message =
                    format!("Segment{segment}_LabelValue is '{}'; a whole number is needed", excerpt(value));
                return Err(bad("VGS-NRD-012", message)
                    .help("export the segmentation again, as a label map (NIfTI or NRRD)"));
            };
            labels.insert(value, unescaped(name));
        }
        if is_segmentation && volumes > 1 {
            let message = format!(
                "a segmentation of {} layers, since its segments overlap; one layer is needed",
                volumes
            );
            return Err(bad("VGS-NRD-013", message).help(
                "in 3D Slicer, export it as a label map: Segmentations, Export to files, NIfTI or NRRD",
            ));
        }
        Ok(labels)
    }
}

/// Returns a name without its spaces: the format has some names with and without.
fn without_spaces(name: &str) -> String {
    name.chars().filter(|c| !c.is_whitespace()).collect()
}

/// Returns the value of a key with the format's escapes resolved.
fn unescaped(value: &str) -> String {
    value.replace("\\n", " ").replace("\\\\", "\\").replace(char::is_control, " ").trim().to_owned()
}
