//! Pictures: files, measures of difference, lettering.
//!
//! | file | what is there |
//! |---|---|
//! | `image` | [`Image`]: what a renderer shows and what all else here works on |
//! | `file` | [`read`] and [`write()`]: PNG and OpenEXR, a row of [`file::FORMATS`] each |
//! | `measure`, `flip` | how different two pictures are |
//! | `difference` | a picture of the difference |
//! | `lettering`, `font` | writing on pictures, and the outlines of letters |
//! | `annotate` | [`annotate()`]: what a medical picture must say |
#![forbid(unsafe_code)]

pub mod annotate;
pub mod difference;
pub mod file;
pub mod flip;
pub mod font;
mod image;
pub mod lettering;
pub mod measure;

pub use annotate::{Annotation, ColourBar, annotate, orientation_labels};
pub use difference::{DifferenceMap, difference_picture};
pub use file::{Picture, WriteOptions, read, write};
pub use flip::{Flip, flip};
pub use image::{Image, MAX_PIXELS};
pub use lettering::{Align, Ink, line_height, shortened, text_width};
pub use measure::{Difference, largest_difference, psnr, ssim};
