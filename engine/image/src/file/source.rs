//! An open file of a picture.

use std::fs::File;
use std::io::{self, BufReader};
use std::path::Path;

use base::input;
use base::{Error, Kind, Result};

/// Largest ratio of compression. DEFLATE, the densest packing in these formats, cannot exceed it, so a larger
/// claim is known to be false before anything is allocated.
const MAX_RATIO: u64 = 1032;

/// An open file.
pub(super) struct Source {
    pub(super) reader: BufReader<File>,
    /// Size of the file, bytes.
    pub(super) stored: u64,
}

impl Source {
    /// Opens a file and notes its length.
    pub(super) fn open(path: &Path) -> Result<Self> {
        let failed = |e: &io::Error| Error::io(path, "reading a picture", e);
        let file = input::open(path).map_err(|e| failed(&e))?;
        let stored = file.metadata().map_err(|e| failed(&e))?.len();
        Ok(Source { reader: BufReader::with_capacity(1 << 18, file), stored })
    }
}

/// Refuses a picture size whose `unpacked` bytes cannot come from a file of `stored` bytes.
pub(super) fn expect(size: [usize; 2], unpacked: u64, stored: u64) -> Result<()> {
    let most = stored.saturating_mul(MAX_RATIO);
    if unpacked > most {
        let [width, height] = size;
        let message = format!(
            "declares {width} x {height} pixels, {unpacked} bytes, but {stored} bytes hold at most {most}"
        );
        return Err(Error::new(Kind::BadData, "VGS-IMG-011", message)
            .help("the file was cut short or its header is wrong"));
    }
    Ok(())
}
