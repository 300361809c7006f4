use std::fs::{self, File};
use std::io::BufReader;
use std::path::PathBuf;

use super::*;
use crate::Image;
use base::{Error, Kind};

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
    write(&opaque, &image, None, &WriteOptions { background, ..WriteOptions::default() }).unwrap();
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
fn an_exr_comes_back_with_its_depth() {
    let (folder, mut image) = (Folder::new(), picture());
    image.pixels[8] = [1.75, -0.25, 0.5, 0.75]; // Nothing is clamped.
    let depth: Vec<f32> = (0..35).map(|i| if i % 5 == 0 { f32::INFINITY } else { 0.1 * i as f32 }).collect();
    let plain = WriteOptions::default();
    write(folder.at("a.exr"), &image, None, &plain).unwrap();
    write(folder.at("b.exr"), &image, Some(&depth), &plain).unwrap();
    write(folder.at("c.exr"), &image, Some(&depth), &plain).unwrap();
    let [a, b] = ["a.exr", "b.exr"].map(|name| read(folder.at(name)).unwrap());
    near(&a.image, &image, 1e-6);
    assert_eq!((a.depth, b.image), (None, a.image));
    assert_eq!(b.depth, Some(depth));
    assert_eq!(fs::read(folder.at("b.exr")).unwrap(), fs::read(folder.at("c.exr")).unwrap());
    let background = Some([0.5, 0.5, 0.5]);
    write(folder.at("d.exr"), &image, None, &WriteOptions { background, ..WriteOptions::default() }).unwrap();
    near(&read(folder.at("d.exr")).unwrap().image, &image.over([0.5; 3]), 1e-6);
}

/// What other programs see in such a file: linear light, premultiplied.
#[test]
fn an_exr_holds_linear_light() {
    let folder = Folder::new();
    let image = Image { size: [2, 1], pixels: vec![[0.25, 0.01, 0.5, 0.5], [0.0; 4]] };
    write(folder.at("a.exr"), &image, Some(&[7.5, 1e9]), &WriteOptions::default()).unwrap();
    let file = ::exr::prelude::read_first_flat_layer_from_file(folder.at("a.exr")).unwrap();
    let channels = &file.layer_data.channel_data.list;
    let values: Vec<(String, Vec<f32>)> =
        channels.iter().map(|c| (c.name.to_string(), c.sample_data.values_as_f32().collect())).collect();
    // sRGB 0.5, 0.02 and 1 as linear light, times the opacity.
    let expected = [("A", 0.5), ("B", 0.5), ("G", 0.5 * 0.02 / 12.92), ("R", 0.5 * 0.214_041_14), ("Z", 7.5)];
    assert_eq!(values.len(), expected.len());
    for ((name, found), (expected_name, expected)) in values.iter().zip(expected) {
        assert_eq!(name, expected_name);
        assert!((f64::from(found[0]) - expected).abs() < 1e-6, "{name}: {}", found[0]);
        assert_eq!(found[1], if name == "Z" { 1e9 } else { 0.0 });
    }
}

/// Halves, and no opacity.
#[test]
fn exrs_of_other_programs_are_read() {
    use ::exr::prelude::{WritableImage, f16};
    let folder = Folder::new();
    let write = |name: &str, value: f32| {
        let channels = ::exr::image::SpecificChannels::rgb(|_: ::exr::math::Vec2<usize>| {
            (f16::from_f32(value), f16::ZERO, f16::ONE)
        });
        ::exr::prelude::Image::from_channels((3, 2), channels).write().to_file(folder.at(name)).unwrap();
    };
    write("a.exr", 0.214_041);
    near(&read(folder.at("a.exr")).unwrap().image, &Image::new([3, 2], [0.5, 0.0, 1.0, 1.0]), 3e-4);
    write("nan.exr", f32::NAN);
    assert_eq!(read(folder.at("nan.exr")).unwrap_err().code, "VGS-IMG-025");
    let grey = ::exr::image::SpecificChannels::build()
        .with_channel("Y")
        .with_pixel_fn(|_: ::exr::math::Vec2<usize>| (1.0_f32,));
    ::exr::prelude::Image::from_channels((3, 2), grey).write().to_file(folder.at("grey.exr")).unwrap();
    assert_eq!(read(folder.at("grey.exr")).unwrap_err().code, "VGS-IMG-024");
}

/// Bytes that were altered or are missing: an error or a picture of the same size, and no panic.
#[test]
fn damaged_files_are_no_panic() {
    let folder = Folder::new();
    let image = Image::new([40, 30], [0.2, 0.1, 0.4, 0.5]);
    for name in ["a.png", "a.exr"] {
        let depth = vec![1.5; 1200];
        let depth = name.ends_with("exr").then_some(depth.as_slice());
        write(folder.at(name), &image, depth, &WriteOptions::default()).unwrap();
        let good = fs::read(folder.at(name)).unwrap();
        let (damaged, whole) = (folder.at("damaged"), read(folder.at(name)).unwrap());
        // Some file systems flush a file that is written over; a new one they do not.
        let put = |bytes: &[u8]| {
            let _ = fs::remove_file(&damaged);
            fs::write(&damaged, bytes).unwrap();
        };
        for place in 0..good.len().min(700) {
            for value in [0xff, good[place] ^ 0x80] {
                let mut bad = good.clone();
                bad[place] = value;
                put(&bad);
                if let Err(error) = read(&damaged) {
                    assert!(matches!(error.kind, Kind::BadData), "{name}, byte {place}: {error}");
                }
            }
            put(&good[..place]);
            // Where only the end mark is missing, all pixels are there.
            assert!(read(&damaged).map_or(true, |picture| picture == whole), "{name} cut to {place} bytes");
        }
    }
}

/// A decoder that takes whole colours for granted panics at such a palette.
#[test]
fn a_palette_of_parts_of_colours_is_damage() {
    use ::png::{BitDepth, ColorType};
    let folder = Folder::new();
    let path = folder.at("a.png");
    static PALETTE: [u8; 3 * 257] = [90; 3 * 257];
    for bytes in [1, 2, 3, 4, 11, 13, 767, 768, 769, 771] {
        let palette = &PALETTE[..bytes];
        let file = foreign_png([5, 4], ColorType::Indexed, BitDepth::Eight, Some(palette), &[0; 20]);
        fs::write(&path, file).unwrap();
        match read(&path) {
            Ok(picture) => assert!(bytes % 3 == 0 && bytes <= 768 && picture.image.size == [5, 4], "{bytes}"),
            Err(error) => {
                assert!(bytes % 3 != 0 || bytes > 768, "{bytes}: {error}");
                assert_eq!((error.kind, error.code), (Kind::BadData, "VGS-IMG-022"), "{bytes}");
            }
        }
    }
}

#[test]
fn an_animation_holds_its_frames() {
    let folder = Folder::new();
    let (path, size) = (folder.at("a.png"), [3, 2]);
    let animation = Animation { size, frames: 3, frames_per_second: 25, loops: 2 };
    let options = WriteOptions { background: Some([0.0; 3]), ..WriteOptions::default() };
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
    assert_eq!(read(folder.0.path()).unwrap_err().code, "VGS-IO-002");
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
