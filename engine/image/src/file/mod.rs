//! Files of pictures: a format is one module with `read` and `write`, and one row of [`FORMATS`].
//!
//! | file | what is there |
//! |---|---|
//! | `format` | [`Format`]: what a row has; [`Picture`]: what a file holds |
//! | `formats` | [`FORMATS`], and [`read`] and [`write()`] by them |
//! | `png`, `exr` | the formats |
//! | `source` | an open file |

mod exr;
mod format;
mod formats;
mod png;
mod source;

pub use format::{Format, Picture, WriteOptions};
pub use formats::{FORMATS, of_extension, read, write};
pub use png::{Animation, encode as encode_png, write_animation};

#[cfg(test)]
mod tests;
