//! Splats of a file, with its bytes where these may stand in a page as they are.

use std::io::Read;
use std::path::Path;

use engine::splat::{self, ReadOptions, SplatSet, vgs};
use engine::{Error, Result, input, memory};

/// Splats of a file.
#[derive(Clone, Debug)]
pub struct Source {
    /// Name of the file without its ending, as of [`splat::stem`]; tells splats apart that have no labels.
    pub stem: String,
    /// The splats.
    pub set: SplatSet,
    /// Bytes of a `.vgs` file that holds these splats and nothing else.
    pub file: Option<Vec<u8>>,
}

impl Source {
    /// Creates the source of splats that are in no file as they are.
    pub fn of(stem: impl Into<String>, set: SplatSet) -> Self {
        Source { stem: stem.into(), set, file: None }
    }

    /// Reads a file of splats in any format.
    ///
    /// # Errors
    /// Returns the errors of [`splat::read_some`], also for splats that only a volume can place.
    pub fn read(path: &Path) -> Result<Self> {
        let stem = splat::stem(path);
        match whole_file(path)? {
            Some((set, bytes)) => Ok(Source { file: Some(bytes), ..Source::of(stem, set) }),
            None => Ok(Source::of(stem, splat::read_some(path)?.placed(None)?)),
        }
    }
}

/// Returns the splats and the bytes of a `.vgs` file that holds these, of which nothing is missing and nothing has to be
/// mended, and nothing else; `None` for any other file.
fn whole_file(path: &Path) -> Result<Option<(SplatSet, Vec<u8>)>> {
    let failed = |error| Error::io(path, "reading a splat file", &error);
    let mut file = input::open(path).map_err(failed)?;
    let mut bytes = Vec::new();
    Read::by_ref(&mut file).take(vgs::MARK.len() as u64).read_to_end(&mut bytes).map_err(failed)?;
    if !vgs::sniff(&bytes) {
        return Ok(None);
    }
    memory::require(file.metadata().map_err(failed)?.len(), "the file")?;
    file.read_to_end(&mut bytes).map_err(failed)?;
    let strict = ReadOptions { strict: true, ..ReadOptions::default() };
    let found = vgs::decode(&bytes, &strict).ok().filter(|(set, widened)| *widened == 0 && !set.is_empty());
    Ok(found.map(|(set, _)| (set, bytes)))
}
