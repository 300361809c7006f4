//! Files of splat sets in any of the [`FORMATS`].

use std::io::Read;
use std::path::Path;

use super::format::{Format, ReadOptions, Reader, SNIFF_BYTES, Summary, WriteOptions};
use super::{Place, SplatSet, Unplaced, glb, join, parts, ply, sog, spz, stem, vgs};
use base::error::{Error, Kind, Result};
use base::input::Input;

/// Every format of splat sets.
pub const FORMATS: &[Format] = &[
    Format {
        name: "ply",
        rounds: false,
        coloured: false,
        physical: true,
        voxels: false,
        live: false,
        reader: Reader { sniff: ply::sniff, read: ply::read, describe: ply::describe },
        write: ply::write,
        bytes: ply::bytes,
    },
    Format {
        name: "vgs",
        rounds: true,
        coloured: false,
        physical: true,
        voxels: true,
        live: false,
        reader: Reader { sniff: vgs::sniff, read: vgs::read, describe: vgs::describe },
        write: vgs::write,
        bytes: vgs::bytes,
    },
    Format {
        name: "spz",
        rounds: false,
        coloured: true,
        physical: false,
        voxels: false,
        live: true,
        reader: Reader { sniff: spz::sniff, read: spz::read, describe: spz::describe },
        write: spz::write,
        bytes: spz::bytes,
    },
    Format {
        name: "sog",
        rounds: false,
        coloured: true,
        physical: false,
        voxels: false,
        live: false,
        reader: Reader { sniff: sog::sniff, read: sog::read, describe: sog::describe },
        write: sog::write,
        bytes: sog::bytes,
    },
    Format {
        name: "glb",
        rounds: false,
        coloured: true,
        physical: true,
        voxels: false,
        live: false,
        reader: Reader { sniff: glb::sniff, read: glb::read, describe: glb::describe },
        write: glb::write,
        bytes: glb::bytes,
    },
];

/// A format of other programs that is told apart, and not read.
struct Foreign {
    name: &'static str,
    extension: &'static str,
    /// The first bytes that a file may have; empty if the format has no mark of its own.
    begins: &'static [&'static [u8]],
    /// True if splat-transform makes a PLY of it.
    converted: bool,
}

const FOREIGN: [Foreign; 3] = [
    Foreign { name: "a SPLAT file", extension: "splat", begins: &[b""], converted: true },
    Foreign { name: "a KSPLAT file", extension: "ksplat", begins: &[b""], converted: true },
    Foreign { name: "glTF as text", extension: "gltf", begins: &[b"{", b"\xef\xbb\xbf{"], converted: false },
];

impl Foreign {
    /// Returns the format of other programs that a file has by its name and first bytes, if it is one of these.
    fn of(path: &Path, start: &[u8]) -> Option<&'static Foreign> {
        let extension = path.extension()?.to_str()?;
        FOREIGN.iter().find(|foreign| {
            !start.is_empty()
                && foreign.extension.eq_ignore_ascii_case(extension)
                && foreign.begins.iter().any(|mark| start.starts_with(mark))
        })
    }
}

/// Returns true if a file that begins with `start` holds splats: in one of the [`FORMATS`] that are read, or in
/// a format of other programs that the readers refuse by its name.
pub fn is_splats(path: &Path, start: &[u8]) -> bool {
    FORMATS.iter().any(|format| (format.reader.sniff)(start)) || Foreign::of(path, start).is_some()
}

/// Reads a splat set from a path, or from an [`Input::of`] a reader; the content of the file decides on the format, not
/// its name. Refuses a file whose splats only a volume can place; [`read_unplaced`] reads these, too.
pub fn read(input: impl Into<Input>, options: &ReadOptions) -> Result<SplatSet> {
    read_unplaced(input, options)?.placed(None)
}

/// Reads a splat set that a volume may still have to place.
pub fn read_unplaced(input: impl Into<Input>, options: &ReadOptions) -> Result<Unplaced> {
    let input = input.into();
    (sniffed(&input)?.read)(&input, options)
}

/// Reads the splats of a file as [`read_unplaced`] does, and refuses a file without usable splats.
pub fn read_some(input: impl Into<Input>) -> Result<Unplaced> {
    let splats = read_unplaced(input, &ReadOptions::default())?;
    if splats.is_empty() {
        let message = "the file holds no usable splat";
        return Err(Error::new(Kind::BadData, "VGS-SPLAT-005", message).file(&splats.path));
    }
    Ok(splats)
}

/// Reads one or several files as one set, whose objects are named after the files, of blocks after their folder. Calls
/// `place` at most once, for the volume of splats that only a volume can place.
pub fn read_all(
    inputs: impl IntoIterator<Item: Into<Input>>,
    place: impl FnOnce() -> Result<Option<Place>>,
) -> Result<SplatSet> {
    let mut place = Some(place);
    let mut found = None;
    let mut sets = Vec::new();
    for input in inputs {
        let splats = read_some(input)?;
        if splats.needs_volume()
            && let Some(place) = place.take()
        {
            found = place()?;
        }
        let name = stem(&splats.path);
        sets.push((name, splats.placed(found.as_ref())?));
    }
    join(parts(sets)?.into_iter().map(|part| (part.name, part.set)).collect())
}

/// Reads a splat file and describes what it holds; the content of the file decides on the format, not its
/// name.
pub fn describe(input: impl Into<Input>, options: &ReadOptions) -> Result<Summary> {
    let input = input.into();
    (sniffed(&input)?.describe)(&input, options)
}

/// Writes `set` in the format that the extension of `path` names; replaces an existing file only if `force`
/// is set.
pub fn write(path: &Path, set: &SplatSet, force: bool) -> Result<()> {
    write_as(path, set, &WriteOptions { force, ..WriteOptions::default() })
}

/// Writes `set` in the format that the extension of `path` names, with the given options.
pub fn write_as(path: &Path, set: &SplatSet, options: &WriteOptions) -> Result<()> {
    check_held(path, set)?;
    if options.live.is_some() {
        check_live(path)?;
    }
    (named(path)?.write)(path, set, options)
}

/// Returns the size in bytes of the file that [`write_as()`] makes of `set`.
pub fn file_bytes(path: &Path, set: &SplatSet, options: &WriteOptions) -> Result<u64> {
    (named(path)?.bytes)(set, options)
}

/// Returns true if the format that the extension of `path` names rounds the splats.
pub fn rounds(path: &Path) -> bool {
    named(path).is_ok_and(|format| format.rounds)
}

/// Returns true if the format that the extension of `path` names holds colours, for programs that draw splats as
/// they are.
pub fn is_coloured(path: &Path) -> bool {
    named(path).is_ok_and(|format| format.coloured)
}

/// Returns true if the format that the extension of `path` names holds intensities.
pub fn is_physical(path: &Path) -> bool {
    named(path).is_ok_and(|format| format.physical)
}

/// Fails if no format has the extension of `path`, or if it does not hold the coded voxels of a set.
///
/// # Errors
/// [`Kind::Usage`].
pub fn check_held(path: &Path, set: &SplatSet) -> Result<()> {
    let format = named(path)?;
    if set.voxels.is_empty() || format.voxels {
        return Ok(());
    }
    let message = "coded voxels, and this format holds splats";
    Err(Error::new(Kind::Usage, "VGS-SPLAT-013", message)
        .file(path)
        .help("write a .vgs or a page (.html), or fit splats to the volume: vgs fit"))
}

/// Fails if the format that the extension of `path` names cannot hold a fit beside splats with colours
/// ([`WriteOptions::live`]).
///
/// # Errors
/// [`Kind::Usage`].
pub fn check_live(path: &Path) -> Result<()> {
    if named(path).is_ok_and(|format| format.live) {
        return Ok(());
    }
    let message = "only an SPZ file holds the fit beside splats with colours";
    Err(Error::new(Kind::Usage, "VGS-SPZ-004", message)
        .file(path)
        .help("give a name that ends in .spz, or leave out --live"))
}

/// Returns the format that the extension of `path` names.
fn named(path: &Path) -> Result<&'static Format> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
    FORMATS.iter().find(|format| format.name.eq_ignore_ascii_case(extension)).ok_or_else(|| {
        Error::new(Kind::Usage, "VGS-SPLAT-002", format!("no splat format is called {extension:?}"))
            .file(path)
            .help(format!("use one of these extensions: {}", extensions()))
    })
}

fn sniffed(input: &Input) -> Result<&'static Reader> {
    let path = input.name();
    let mut start = Vec::new();
    input
        .open()
        .and_then(|file| file.take(SNIFF_BYTES).read_to_end(&mut start))
        .map_err(|error| Error::io(path, "reading a splat file", &error))?;
    let found = FORMATS.iter().map(|format| &format.reader).find(|reader| (reader.sniff)(&start));
    found.ok_or_else(|| {
        if let Some(Foreign { name, extension, converted, .. }) = Foreign::of(path, &start) {
            let help = if *converted {
                ply::convert_help(extension)
            } else {
                "write it as a .glb, which is one file, with the program that it is from".to_owned()
            };
            let message = format!("{name}, which vgs does not read");
            return Error::new(Kind::BadData, "VGS-SPLAT-006", message).file(path).help(help);
        }
        let found = if start.is_empty() { "the file is empty" } else { "not a splat file" };
        Error::new(Kind::BadData, "VGS-SPLAT-001", found)
            .file(path)
            .help(format!("known splat formats: {}", extensions()))
    })
}

fn extensions() -> String {
    FORMATS.iter().map(|format| format.name).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
pub mod tests {
    use std::io::Cursor;

    use super::*;
    use crate::Splat;
    use crate::ordinary::tests::coloured;

    /// Reads a file from a path and from memory, which must give the same, and returns that.
    pub fn read_both(
        read: fn(&Input, &ReadOptions) -> Result<Unplaced>,
        bytes: &[u8],
        options: &ReadOptions,
    ) -> Result<SplatSet> {
        let read = |input: Input| read(&input, options)?.placed(None);
        let file = tempfile::NamedTempFile::new().expect("a file");
        let path = file.path().to_owned();
        std::fs::write(&path, bytes).expect("written");
        let found = read(Input::from(&path));
        // From here on nothing can be read by the name.
        drop(file);
        let again = read(Input::of(Cursor::new(bytes.to_vec()), &path));
        assert_eq!(format!("{again:?}"), format!("{found:?}"));
        found
    }

    #[test]
    fn every_format_is_read_from_memory_as_from_a_file() {
        let any: fn(&Input, &ReadOptions) -> _ = |input, options| read_unplaced(input, options);
        let folder = tempfile::tempdir().expect("a temporary folder");
        for format in FORMATS {
            let path = folder.path().join("a").with_extension(format.name);
            let mut set = coloured();
            if !format.coloured {
                (set.colours, set.unit) = (None, SplatSet::default().unit);
            }
            write(&path, &set, false).expect(format.name);
            let bytes = std::fs::read(&path).expect("the file");
            assert_eq!(read_both(any, &bytes, &ReadOptions::default()).expect(format.name).splats.len(), 60);
            let strict = ReadOptions { strict: true, ..ReadOptions::default() };
            for end in [0, 1, 30, bytes.len() / 2, bytes.len() - 1] {
                let error = read_both(any, &bytes[..end], &strict).expect_err(format.name);
                assert_eq!(
                    (error.kind, error.file.is_some()),
                    (Kind::BadData, true),
                    "{}: {error}",
                    format.name
                );
            }
            let input = Input::of(Cursor::new(bytes), "of memory");
            let summary = describe(&input, &strict).expect(format.name);
            assert_eq!((summary.format, summary.splats), (format.name, 60));
            let set = read_all([input], || Ok(None)).expect(format.name);
            assert_eq!(set.objects()[0].name, "of memory");
        }
    }

    #[test]
    fn a_file_is_known_by_its_content_and_written_by_its_extension() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let at = |name: &str| folder.path().join(name);
        let set = SplatSet {
            splats: vec![Splat { rotation: [1.0, 0.0, 0.0, 0.0], ..Splat::default() }],
            ..SplatSet::default()
        };
        write(&at("a.PLY"), &set, false).expect("the extension in capitals is the same format");
        let length = std::fs::metadata(at("a.PLY")).expect("a file").len();
        assert_eq!(
            file_bytes(&at("b.ply"), &set, &WriteOptions::default()).expect("a format"),
            length,
            "known before it is written"
        );
        std::fs::rename(at("a.PLY"), at("a.dat")).expect("renaming");
        assert_eq!(read(at("a.dat"), &ReadOptions::default()).expect("a PLY by content"), set);
        assert_eq!(write(&at("a.splat"), &set, false).expect_err("no such format").code, "VGS-SPLAT-002");

        for (name, content) in [("empty", ""), ("text", "hello")] {
            std::fs::write(at(name), content).expect("writing");
            let error = describe(at(name), &ReadOptions::default()).expect_err(name);
            assert_eq!((error.kind, error.code), (Kind::BadData, "VGS-SPLAT-001"), "{name}");
        }
        for (name, content) in [("a.GLTF", &b"{\"asset\":"[..]), ("a.splat", b"1234")] {
            std::fs::write(at(name), content).expect("writing");
            assert!(is_splats(&at(name), content), "{name}");
            let error = describe(at(name), &ReadOptions::default()).expect_err(name);
            assert_eq!((error.kind, error.code), (Kind::BadData, "VGS-SPLAT-006"), "{name}");
            assert_eq!(error.help.contains("splat-transform"), name != "a.GLTF", "{}", error.help);
        }
        assert!(!is_splats(&at("a.zip"), b"PK\x03\x04") && !is_splats(&at("a.spz"), b"plain"));
        // A mean that is no number cannot be used.
        let names = "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3";
        let properties: String = names.split(' ').map(|name| format!("property float {name}\n")).collect();
        let header = format!("ply\nformat ascii 1.0\nelement vertex 1\n{properties}end_header\n");
        std::fs::write(at("none.ply"), header + "nan 0 0 0 0 0 0 0 0 0 1 0 0 0\n").expect("writing");
        let error = read_all(&[at("a.dat"), at("none.ply")], || Ok(None)).expect_err("nothing to see");
        assert_eq!((error.kind, error.code), (Kind::BadData, "VGS-SPLAT-005"));
        let both =
            read_all(&[at("a.dat"), at("a.dat")], || panic!("nothing needs a volume")).expect("two files");
        let names: Vec<_> = both.objects().into_iter().map(|object| object.name).collect();
        assert_eq!((both.splats.len(), names), (2, vec!["a".to_owned(), "a".to_owned()]));
        let missing = read(at("missing"), &ReadOptions::default()).expect_err("no such file");
        assert_eq!(missing.kind, Kind::Missing);
    }
}
