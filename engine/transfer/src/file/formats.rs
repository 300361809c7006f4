//! The formats of transfer functions, and what a user may type to name a function.

use std::io::Read;
use std::path::Path;

use super::entry::{Entry, broken};
use super::{paraview, slicer_xml, vp, vp_json};
use crate::presets::known_names;
use crate::{PRESETS, TransferFunction, WINDOW_OPACITY, WINDOWS, window, window_level};
use base::error::{Error, Kind, Result};

/// The largest file that is read, in bytes; all presets of Slicer together take 12 kB.
pub(super) const MAX_BYTES: u64 = 4 << 20;

/// A file format of transfer functions, a row of [`FORMATS`].
pub struct Format {
    /// Name for messages.
    pub name: &'static str,
    /// Lower-case endings of file names, with the dot.
    pub extensions: &'static [&'static str],
    /// Returns true if a text is of this format.
    sniff: fn(&str) -> bool,
    read: fn(&str) -> Result<Vec<Entry>>,
    /// Returns the text of a file with this function; `None` if the format is only read.
    write: Option<fn(&TransferFunction) -> String>,
    /// True if control points from 0 to 1 are shares of the range of the data.
    shares: bool,
}

/// Every format; the content decides which one a file has.
pub const FORMATS: &[Format] = &[
    Format {
        name: "Slicer volume property, JSON",
        extensions: &[".vp.json"],
        sniff: vp_json::sniff,
        read: vp_json::read,
        write: Some(vp_json::write),
        shares: false,
    },
    Format {
        name: "Slicer presets",
        extensions: &[".xml", ".mrml"],
        sniff: slicer_xml::sniff,
        read: slicer_xml::read,
        write: None,
        shares: false,
    },
    Format {
        name: "Slicer volume property",
        extensions: &[".vp"],
        sniff: vp::sniff,
        read: vp::read,
        write: None,
        shares: false,
    },
    Format {
        name: "ParaView colour map",
        extensions: &[".json"],
        sniff: paraview::sniff,
        read: paraview::read,
        write: None,
        shares: true,
    },
];

/// Returns the transfer function that a user names, as with `--tf`: a preset, `window:W,L`,
/// `window:W,L,OPACITY`, `window:NAME`, or a file, with `:NAME` after it if it holds several functions.
/// `data` is the least and the greatest intensity of what is shown, for functions in shares of that range.
///
/// # Errors
/// [`Kind::Usage`] if nothing has that name, with advice on what would do; otherwise as [`read`].
pub fn load(spec: &str, data: [f64; 2]) -> Result<TransferFunction> {
    if let Some(preset) = PRESETS.iter().find(|p| p.name.eq_ignore_ascii_case(spec)) {
        return Ok(preset.over(data));
    }
    if let Some(rest) = spec.strip_prefix("window:") {
        return parse_window(rest);
    }
    // A colon may also be part of the path.
    if Path::new(spec).exists() {
        return read(spec, None, data);
    }
    if let Some((path, name)) = spec.rsplit_once(':')
        && Path::new(path).exists()
    {
        return read(path, Some(name), data);
    }
    let looks_like_a_path = spec.contains(['/', '\\']) || extension_of(&spec.to_lowercase()).is_some();
    let (kind, message) = if looks_like_a_path {
        (Kind::Missing, format!("there is no file {spec:?}"))
    } else {
        (Kind::Usage, format!("there is no transfer function {spec:?}"))
    };
    Err(Error::new(kind, "VGS-TF-006", message).help(format!(
        "{}; or name a file ({}; FILE:NAME where it holds several), or window:WIDTH,LEVEL",
        known_names(spec),
        known_extensions(|_| true)
    )))
}

/// Reads the function called `name`, or the first one, from a file in one of the [`FORMATS`]. `data` as in
/// [`load`].
///
/// # Errors
/// [`Kind::Missing`], [`Kind::Io`], [`Kind::BadData`] (not a known format, or not well formed),
/// [`Kind::Usage`] if the file has no function of that name; the error lists those that it has.
pub fn read(path: impl AsRef<Path>, name: Option<&str>, data: [f64; 2]) -> Result<TransferFunction> {
    let path = path.as_ref();
    let text = text_of(path)?;
    let (format, mut tf) = parse(&text, name).map_err(|e| e.file(path))?;
    if tf.name.is_empty() {
        tf.name = stem(path);
    }
    let [low, high] = tf.extent();
    if format.shares && low >= 0.0 && high <= 1.0 && data[1] - data[0] > 2.0 {
        tracing::warn!("{}: from 0 to 1, so stretched over {} to {}", path.display(), data[0], data[1]);
        tf = tf.stretched([0.0, 1.0], data).map_err(|e| e.file(path))?;
    }
    Ok(tf)
}

/// Writes a transfer function atomically, in the format that the name of the file asks for.
///
/// # Errors
/// [`Kind::Usage`] if the ending belongs to no format that is written; else as
/// [`base::output::write_atomic`].
pub fn save(tf: &TransferFunction, path: impl AsRef<Path>, force: bool) -> Result<()> {
    let path = path.as_ref();
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    let Some(write) = extension_of(&name).and_then(|format| format.write) else {
        let message = "transfer functions are not written in the format of this name";
        return Err(Error::new(Kind::Usage, "VGS-TF-011", message)
            .file(path)
            .help(format!("end the name in {}", known_extensions(|f| f.write.is_some()))));
    };
    let text = write(tf);
    base::output::write_atomic(path, force, |out| out.write_all(text.as_bytes()))
}

/// Returns the format whose extension is the longest that a lower-case file name ends in.
fn extension_of(name: &str) -> Option<&'static Format> {
    let endings = FORMATS.iter().flat_map(|f| f.extensions.iter().map(move |e| (f, *e)));
    endings.filter(|(_, e)| name.ends_with(e)).max_by_key(|(_, e)| e.len()).map(|(f, _)| f)
}

fn known_extensions(which: impl Fn(&Format) -> bool) -> String {
    let formats = FORMATS.iter().filter(|f| which(f));
    formats.flat_map(|f| f.extensions).copied().collect::<Vec<_>>().join(" ")
}

/// Returns the file name without the extension of its format.
fn stem(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let lower = name.to_lowercase();
    let ending =
        FORMATS.iter().flat_map(|f| f.extensions).filter(|e| lower.ends_with(**e)).map(|e| e.len()).max();
    // Lower case may have another length outside of ASCII; then the name stays whole.
    let end = name.len().saturating_sub(ending.unwrap_or(0));
    name.get(..end).unwrap_or(&name).to_owned()
}

fn text_of(path: &Path) -> Result<String> {
    let io = |e: &std::io::Error| Error::io(path, "reading the transfer function", e);
    let file = base::input::open(path).map_err(|e| io(&e))?;
    let mut bytes = Vec::new();
    file.take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(|e| io(&e))?;
    if bytes.len() as u64 > MAX_BYTES {
        let message = format!("larger than {MAX_BYTES} bytes, so not a file of transfer functions");
        return Err(Error::new(Kind::BadData, "VGS-TF-010", message).file(path));
    }
    String::from_utf8(bytes).map_err(|e| {
        broken(format!("not a text in UTF-8: byte {}", e.utf8_error().valid_up_to()))
            .file(path)
            .help("save the file as UTF-8")
    })
}

/// Parses a text and returns its format and the function called `name`, or the first one.
pub(super) fn parse(text: &str, name: Option<&str>) -> Result<(&'static Format, TransferFunction)> {
    // Some editors begin UTF-8 with a byte order mark.
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let Some(format) = FORMATS.iter().find(|f| (f.sniff)(text)) else {
        let what = if text.trim().is_empty() {
            "the file is empty"
        } else {
            "not a transfer function in a known format"
        };
        let known: Vec<_> =
            FORMATS.iter().map(|f| format!("{} ({})", f.name, f.extensions.join(" "))).collect();
        return Err(
            Error::new(Kind::BadData, "VGS-TF-007", what).help(format!("known: {}", known.join(", ")))
        );
    };
    let mut entries = (format.read)(text)?;
    let names: Vec<_> = entries.iter().map(|e| e.name.clone()).filter(|n| !n.is_empty()).collect();
    let index = match name {
        None if entries.is_empty() => {
            return Err(broken(format!("a file of the kind {}, without a transfer function", format.name)));
        }
        None => {
            if entries.len() > 1 {
                tracing::warn!("the file holds {} transfer functions; the first one is taken", entries.len());
            }
            0
        }
        Some(name) => entries.iter().position(|e| e.name.eq_ignore_ascii_case(name)).ok_or_else(|| {
            let message = format!("the file has no transfer function {name:?}");
            let help = if names.is_empty() { "it has none with a name".to_owned() } else { listed(&names) };
            Error::new(Kind::Usage, "VGS-TF-009", message).help(help)
        })?,
    };
    Ok((format, entries.swap_remove(index).function?))
}

/// Returns a list of the names in a file, at most the first hundred.
fn listed(names: &[String]) -> String {
    let more = if names.len() > 100 { ", ..." } else { "" };
    format!("it has {}{more}", names[..names.len().min(100)].join(", "))
}

/// Parses "W,L", "W,L,OPACITY" or the name of a window and returns its grey ramp.
fn parse_window(text: &str) -> Result<TransferFunction> {
    if let Some(named) = window(text) {
        let mut tf = window_level(named.width, named.level, WINDOW_OPACITY)?;
        tf.name = format!("{} window", named.name);
        return Ok(tf);
    }
    let numbers: Option<Vec<f64>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some([width, level]) => window_level(*width, *level, WINDOW_OPACITY),
        Some([width, level, opacity]) => window_level(*width, *level, *opacity),
        _ => {
            let names: Vec<_> = WINDOWS.iter().map(|w| w.name).collect();
            Err(Error::new(Kind::Usage, "VGS-TF-005", format!("there is no window {text:?}")).help(format!(
                "write window:WIDTH,LEVEL in HU (and ,OPACITY per mm), or one of window:{}",
                names.join(", window:")
            )))
        }
    }
}
