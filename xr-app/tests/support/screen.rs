//! What is on a virtual screen (tools/xvfb).

use std::path::Path;

use engine::image::Image;

/// Returns the screen, from its file in the format of xwd: a header of big-endian words, colours, then rows
/// of four bytes a pixel, blue first. Nothing where the file is not whole yet.
pub fn shot(file: &Path) -> Option<Image> {
    let xwd = std::fs::read(file).ok()?;
    let word = |i: usize| Some(u32::from_be_bytes(*xwd.get(4 * i..)?.first_chunk()?) as usize);
    let (header, width, height, bits, row, colours) =
        (word(0)?, word(4)?, word(5)?, word(11)?, word(12)?, word(19)?);
    assert_eq!(bits, 32, "bits of a pixel");
    let rows = xwd.get(header + 12 * colours..).filter(|rows| rows.len() >= height * row)?;
    let texels = rows.chunks(row).take(height).flat_map(|row| row[..4 * width].as_chunks::<4>().0);
    let pixel = |&[b, g, r, _]: &[u8; 4]| [r, g, b, 255].map(|byte| f32::from(byte) / 255.0);
    Some(Image { size: [width, height], pixels: texels.map(pixel).collect() })
}
