use std::fs;
use std::path::PathBuf;

use super::*;

/// Every colour and opacity that 8 bits tell apart in some pattern, with one transparent pixel.
fn picture() -> Image {
    let pixel = |i: usize| {
        let a = (i % 6) as f32 / 5.0;
        [a * (i % 7) as f32 / 6.0, a * (i % 4) as f32 / 3.0, a * 0.2, a]
    };
    Image { size: [7, 5], pixels: (0..35).map(pixel).collect() }
}

fn near(a: &Image, b: &Image, bound: f32) {
    assert_eq!(a.size, b.size);
    for (i, (p, q)) in a.pixels.iter().zip(&b.pixels).enumerate() {
        assert!(p.iter().zip(q).all(|(p, q)| (p - q).abs() <= bound), "pixel {i}: {p:?}, {q:?}");
    }
}

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Folder(tempfile::tempdir().unwrap())
    }

    fn at(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }
}

/// A PNG of any kind, as other programs write it.
fn foreign_png(
    size: [u32; 2],
    colour: ::png::ColorType,
    depth: ::png::BitDepth,
    palette: Option<&'static [u8]>,
    data: &[u8],
) -> Vec<u8> {
    let mut out = Vec::new();
    let mut encoder = ::png::Encoder::new(&mut out, size[0], size[1]);
    encoder.set_color(colour);
    encoder.set_depth(depth);
    if let Some(palette) = palette {
        encoder.set_palette(palette);
    }
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(data).unwrap();
    writer.finish().unwrap();
    out
}

#[test]
fn a_png_comes_back() {
    let (folder, image) = (Folder::new(), picture());
    let (transparent, opaque) = (folder.at("a.png"), folder.at("b.PNG"));
    write(&transparent, &image, None, &WriteOptions::default()).unwrap();
    let back = read(&transparent).unwrap();
    assert_eq!(back.depth, None);
    near(&back.image, &image, 1.01 / 510.0);
    let background = Some([0.0, 0.5, 1.0]);
    write(&opaque, &image, None, &WriteOptions { background, force: false }).unwrap();
    near(&read(&opaque).unwrap().image, &image.over([0.0, 0.5, 1.0]), 1.01 / 510.0);
    // Opaque files have three channels: their colour type, after the header's size, is 2.
    assert_eq!([fs::read(&opaque).unwrap()[25], fs::read(&transparent).unwrap()[25]], [2, 6]);
    let again = folder.at("c.png");
    write(&again, &image, None, &WriteOptions::default()).unwrap();
    assert_eq!(fs::read(&again).unwrap(), fs::read(&transparent).unwrap());
}

#[test]
fn values_outside_of_the_range_are_clamped() {
    let folder = Folder::new();
    let pixels = vec![[-1.0, 2.0, f32::NAN, 1.0], [f32::INFINITY, 0.5, 0.0, 1.0]];
    write(folder.at("a.png"), &Image { size: [2, 1], pixels }, None, &WriteOptions::default()).unwrap();
    let back = read(folder.at("a.png")).unwrap().image.pixels;
    assert_eq!(back[0], [0.0, 1.0, 0.0, 1.0]);
    assert_eq!(back[1][0], 1.0);
}

#[test]
fn pngs_of_other_programs_are_read() {
    use ::png::{BitDepth as B, ColorType as C};
    let folder = Folder::new();
    let third = 21845.0 / 65535.0;
    type Row<'a> = (C, B, Option<&'static [u8]>, &'a [u8], [f32; 4]);
    let rows: &[Row<'_>] = &[
        (C::Grayscale, B::One, None, &[0b1000_0000], [1.0, 1.0, 1.0, 1.0]),
        (C::Grayscale, B::Four, None, &[0x30], [0.2, 0.2, 0.2, 1.0]),
        (C::Grayscale, B::Sixteen, None, &[0x55, 0x55], [third, third, third, 1.0]),
        (C::GrayscaleAlpha, B::Eight, None, &[255, 51], [0.2, 0.2, 0.2, 0.2]),
        (C::Rgb, B::Sixteen, None, &[0, 0, 255, 255, 0x55, 0x55], [0.0, 1.0, third, 1.0]),
        (C::Rgba, B::Eight, None, &[255, 0, 102, 51], [0.2, 0.0, 0.08, 0.2]),
        (C::Indexed, B::Two, Some(&[0, 0, 0, 255, 0, 51]), &[0b0100_0000], [1.0, 0.0, 0.2, 1.0]),
    ];
    for (colour, depth, palette, data, expected) in rows {
        fs::write(folder.at("a.png"), foreign_png([1, 1], *colour, *depth, *palette, data)).unwrap();
        let image = read(folder.at("a.png")).unwrap().image;
        near(&image, &Image { size: [1, 1], pixels: vec![*expected] }, 1e-6);
    }
}

#[test]
fn an_animation_holds_its_frames() {
    let folder = Folder::new();
    let (path, size) = (folder.at("a.png"), [3, 2]);
    let animation = Animation { size, frames: 3, frames_per_second: 25, loops: 2 };
    let options = WriteOptions { background: Some([0.0; 3]), force: false };
    let frame = |i: u32| Ok(Image::new(size, [i as f32 / 5.0, 0.0, 0.0, 1.0]));
    write_animation(&path, &animation, &options, frame).unwrap();
    near(&read(&path).unwrap().image, &Image::new(size, [0.0, 0.0, 0.0, 1.0]), 0.0);
    let mut reader = ::png::Decoder::new(BufReader::new(File::open(&path).unwrap())).read_info().unwrap();
    let control = reader.info().animation_control.unwrap();
    assert_eq!((control.num_frames, control.num_plays), (3, 2));
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    for i in 0..3 {
        reader.next_frame(&mut bytes).unwrap();
        let control = reader.info().frame_control.unwrap();
        assert_eq!((control.delay_num, control.delay_den), (1, 25));
        assert_eq!(bytes[..3], [51 * i, 0, 0]);
    }
    // A frame that fails takes nothing away and leaves nothing behind.
    let before = fs::read(&path).unwrap();
    let force = WriteOptions { force: true, ..options };
    let stop = |i: u32| if i == 1 { Err(Error::new(Kind::Temporary, "T", "lost")) } else { frame(i) };
    assert_eq!(write_animation(&path, &animation, &force, stop).unwrap_err().code, "T");
    assert_eq!((fs::read(&path).unwrap(), fs::read_dir(folder.0.path()).unwrap().count()), (before, 1));
    for wrong in [Animation { frames: 0, ..animation }, Animation { frames_per_second: 0, ..animation }] {
        assert_eq!(write_animation(&path, &wrong, &force, frame).unwrap_err().code, "VGS-IMG-020");
    }
}

#[test]
fn what_is_no_picture_is_refused() {
    let folder = Folder::new();
    let good = foreign_png([4, 3], ::png::ColorType::Rgb, ::png::BitDepth::Eight, None, &[77; 36]);
    // A header that claims more pixels than are allowed, or than the file can hold, with its right checksum.
    let claiming = |width: u32, height: u32| {
        let mut file = good.clone();
        file[16..20].copy_from_slice(&width.to_be_bytes());
        file[20..24].copy_from_slice(&height.to_be_bytes());
        let sum = crc(&file[12..29]);
        file[29..33].copy_from_slice(&sum.to_be_bytes());
        file
    };
    assert_eq!(claiming(4, 3), good, "the checksum is the right one");
    let mut flipped = good.clone();
    let data = good.windows(4).position(|w| w == b"IDAT").unwrap();
    flipped[data + 8] ^= 0x55;
    let cases: &[(&str, Vec<u8>, &str)] = &[
        ("empty", vec![], "VGS-IMG-012"),
        ("text", b"a picture".to_vec(), "VGS-IMG-012"),
        ("magic", good[..8].to_vec(), "VGS-IMG-022"),
        ("header", good[..20].to_vec(), "VGS-IMG-022"),
        ("cut", good[..good.len() - 20].to_vec(), "VGS-IMG-022"),
        ("flipped", flipped, "VGS-IMG-022"),
        ("huge", claiming(1 << 30, 1 << 30), "VGS-IMG-002"),
        ("empty rows", claiming(0, 3), "VGS-IMG-022"),
        ("bomb", claiming(1 << 14, 1 << 14), "VGS-IMG-011"),
    ];
    for (name, content, code) in cases {
        fs::write(folder.at(name), content).unwrap();
        let error = read(folder.at(name)).unwrap_err();
        assert_eq!((error.kind, error.code), (Kind::BadData, *code), "{name}: {error}");
        assert!(error.file.is_some(), "{name}");
    }
    assert_eq!(read(folder.at("none")).unwrap_err().kind, Kind::Missing);
    assert_eq!(read(folder.0.path()).unwrap_err().code, "VGS-IMG-010");
}

fn crc(bytes: &[u8]) -> u32 {
    let mut hash = flate2::Crc::new();
    hash.update(bytes);
    hash.sum()
}

#[test]
fn places_and_formats_that_cannot_be_written() {
    let (folder, image) = (Folder::new(), picture());
    let plain = WriteOptions::default();
    let kind = |name: &str, image: &Image, depth: Option<&[f32]>| {
        write(folder.at(name), image, depth, &plain).map_err(|e| (e.kind, e.code))
    };
    assert_eq!(kind("a.jpg", &image, None), Err((Kind::Usage, "VGS-IMG-014")));
    assert_eq!(kind("a", &image, None), Err((Kind::Usage, "VGS-IMG-014")));
    assert_eq!(kind("a.png", &image, Some(&[1.0; 35])), Err((Kind::Usage, "VGS-IMG-013")));
    assert_eq!(kind("a.png", &Image::new([0, 4], [0.0; 4]), None), Err((Kind::BadData, "VGS-IMG-001")));
    assert_eq!(kind("a.png", &image, None), Ok(()));
    assert_eq!(kind("a.png", &image, None), Err((Kind::CannotCreate, "VGS-OUT-001")));
    write(folder.at("a.png"), &image, None, &WriteOptions { force: true, ..plain }).unwrap();
}
