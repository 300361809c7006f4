//! Small files of text that users give: read whole, and no further than any of them is long.

use std::io::{self, ErrorKind, Read};
use std::path::Path;

/// The most bytes of a configuration or a camera; those of this program have some thousand.
const MOST_BYTES: u64 = 1 << 20;

/// Reads a file of text.
///
/// # Errors
/// [`ErrorKind::InvalidData`] for a file that is longer than any that makes sense (a device may have no end), or no
/// UTF-8.
pub fn text_of(path: &Path) -> io::Result<String> {
    let mut bytes = Vec::new();
    engine::input::open(path)?.take(MOST_BYTES + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > MOST_BYTES {
        return Err(io::Error::new(ErrorKind::InvalidData, format!("longer than {MOST_BYTES} bytes")));
    }
    let no_text = |e: std::string::FromUtf8Error| {
        let message = format!("not text: byte {} is not UTF-8", e.utf8_error().valid_up_to());
        io::Error::new(ErrorKind::InvalidData, message)
    };
    String::from_utf8(bytes).map_err(no_text)
}
