//! What a window shows, drawn into pictures of its format: pictures side by side over their background, and panels.

use egui::{Color32, Rect, pos2, vec2};
use engine::gpu::{Format, Gpu, Image};
use vgs_tests::Device;
use view::screen::composer::{Composer, Composition, Layer};
use view::screen::painter::{Painter, Painting};

const SIZE: [u32; 2] = [64, 48];

/// What a window's picture is: 8 bits a channel, red first where memory says so.
fn window(gpu: &Gpu, format: Format) -> Image {
    gpu.picture("window", "tests", format, SIZE, 1).expect("a picture")
}

fn plain(gpu: &Gpu, layers: u32, colours: &[[f32; 4]]) -> Image {
    let mut picture = gpu.picture("plain", "tests", Format::Rgba32f, [8, 8], layers).expect("a picture");
    let texels: Vec<[f32; 4]> = colours.iter().flat_map(|&colour| vec![colour; 64]).collect();
    picture.write(&texels).expect("texels");
    picture
}

fn texel(image: &Image, x: u32, y: u32) -> [u8; 4] {
    image.read::<[u8; 4]>().expect("texels")[(y * SIZE[0] + x) as usize]
}

/// sRGB of linear light (IEC 61966-2-1), as a byte.
fn srgb(light: f64) -> u8 {
    let v = if light <= 0.003_130_8 { 12.92 * light } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 };
    (v * 255.0).round() as u8
}

#[test]
fn two_pictures_lie_side_by_side_over_the_background() {
    let device = Device::boot();
    let gpu: &Gpu = &device;
    for format in [Format::Rgba8, Format::Bgra8, Format::Srgba8] {
        let mut shown = window(gpu, format);
        // Half covered: half of the background shines through.
        let red = plain(gpu, 1, &[[0.5, 0.0, 0.0, 0.5]]);
        let green = plain(gpu, 2, &[[0.0; 4], [0.0, 1.0, 0.0, 1.0]]);
        let composer = Composer::new(gpu, format).expect("a composer");
        let what = Composition {
            first: Layer { picture: &red, layer: 0, part: [1.0; 2] },
            second: Some(Layer { picture: &green, layer: 1, part: [1.0; 2] }),
            split: 32.0,
            area: [0.0, 0.0, 64.0, 48.0],
            place: [16.0, 8.0, 48.0, 40.0],
            background: [0.0, 0.0, 0.4],
        };
        let mut recorder = gpu.record().expect("a recorder");
        composer.compose(&mut recorder, &what, &mut shown);
        let ticket = recorder.submit().expect("submitted");
        gpu.wait(ticket).expect("finished");
        let order = |c: [u8; 4]| if format == Format::Bgra8 { [c[2], c[1], c[0], c[3]] } else { c };
        for (x, y, expect) in [
            (2, 2, [0, 0, 102, 255]),
            (24, 24, [128, 0, 51, 255]),
            (31, 24, [128, 0, 51, 255]),
            (32, 24, [0, 255, 0, 255]),
            (47, 39, [0, 255, 0, 255]),
            (48, 24, [0, 0, 102, 255]),
        ] {
            let found = order(texel(&shown, x, y));
            let near = found.iter().zip(expect).all(|(a, b)| a.abs_diff(b) <= 1);
            assert!(near, "{format:?} {x},{y}: {found:?} instead of {expect:?}");
        }
    }
}

#[test]
fn of_a_picture_rendered_coarsely_only_its_corner_is_seen() {
    let device = Device::boot();
    let gpu: &Gpu = &device;
    let mut shown = window(gpu, Format::Rgba8);
    let mut picture = gpu.picture("coarse", "tests", Format::Rgba32f, [8, 8], 1).expect("a picture");
    // Blue in the corner of 4 x 2 pixels, red left over from before everywhere else.
    let texel_of =
        |i: usize| if i % 8 < 4 && i / 8 < 2 { [0.0f32, 0.0, 1.0, 1.0] } else { [1.0, 0.0, 0.0, 1.0] };
    picture.write(&(0..64).map(texel_of).collect::<Vec<_>>()).expect("texels");
    let composer = Composer::new(gpu, Format::Rgba8).expect("a composer");
    let what = Composition {
        first: Layer { picture: &picture, layer: 0, part: [0.5, 0.25] },
        second: None,
        split: 0.0,
        area: [0.0, 0.0, 64.0, 48.0],
        place: [0.0, 0.0, 64.0, 48.0],
        background: [0.0; 3],
    };
    let mut recorder = gpu.record().expect("a recorder");
    composer.compose(&mut recorder, &what, &mut shown);
    let ticket = recorder.submit().expect("submitted");
    gpu.wait(ticket).expect("finished");
    let found = shown.read::<[u8; 4]>().expect("texels");
    assert!(found.iter().all(|&texel| texel == [0, 0, 255, 255]), "nothing of the rest bleeds in");
}

/// Runs egui for two frames, so that sizes have settled, and paints the second.
fn painted(gpu: &Gpu, format: Format, mut content: impl FnMut(&mut egui::Ui)) -> Image {
    let context = egui::Context::default();
    let points = vec2(SIZE[0] as f32, SIZE[1] as f32);
    let input = || egui::RawInput {
        screen_rect: Some(Rect::from_min_size(pos2(0.0, 0.0), points)),
        ..Default::default()
    };
    let mut painter = Painter::new(gpu, format).expect("a painter");
    let mut shown = window(gpu, format);
    for _ in 0..2 {
        let mut output = context.run_ui(input(), &mut content);
        let primitives = context.tessellate(std::mem::take(&mut output.shapes), 1.0);
        let painting = Painting { primitives: &primitives, points: points.into() };
        let mut recorder = gpu.record().expect("a recorder");
        painter.update(&mut recorder, &mut output.textures_delta).expect("textures");
        recorder.clear_image(&shown, [0.0, 0.0, 0.0, 1.0]);
        painter.paint(&mut recorder, &painting, &mut shown).expect("painted");
        let ticket = recorder.submit().expect("submitted");
        gpu.wait(ticket).expect("finished");
        painter.forget(&mut output.textures_delta);
    }
    shown
}

#[test]
fn panels_are_painted_where_egui_puts_them() {
    let device = Device::boot();
    let fill = Color32::from_rgb(200, 100, 50);
    for format in [Format::Rgba8, Format::Srgba8] {
        let shown = painted(&device, format, |ui| {
            let painter = ui.painter();
            painter.rect_filled(Rect::from_min_max(pos2(8.0, 8.0), pos2(40.0, 24.0)), 0.0, fill);
            // The right half of the next one is clipped away.
            let clipped = painter.with_clip_rect(Rect::from_min_max(pos2(0.0, 30.0), pos2(20.0, 48.0)));
            clipped.rect_filled(
                Rect::from_min_max(pos2(8.0, 32.0), pos2(40.0, 44.0)),
                0.0,
                Color32::from_black_alpha(0).gamma_multiply(1.0).additive(),
            );
            clipped.rect_filled(
                Rect::from_min_max(pos2(8.0, 32.0), pos2(40.0, 44.0)),
                0.0,
                Color32::from_rgba_premultiplied(0, 0, 128, 128),
            );
        });
        assert_eq!(texel(&shown, 20, 16), [200, 100, 50, 255], "{format:?}");
        assert_eq!(texel(&shown, 50, 16), [0, 0, 0, 255], "{format:?}");
        // Half covered blue: in sRGB numbers half of it, in light half of the light.
        let half = if format.is_srgb() { srgb(128.0 / 255.0) } else { 128 };
        let found = texel(&shown, 12, 38);
        assert!(found[2].abs_diff(half) <= 1, "{format:?}: {found:?}, not {half}");
        assert_eq!(texel(&shown, 24, 38), [0, 0, 0, 255], "clipped, {format:?}");
    }
}

#[test]
fn text_comes_from_the_texture() {
    let device = Device::boot();
    let shown = painted(&device, Format::Rgba8, |ui| {
        ui.painter().text(
            pos2(32.0, 24.0),
            egui::Align2::CENTER_CENTER,
            "R",
            egui::FontId::proportional(40.0),
            Color32::WHITE,
        );
    });
    let texels = shown.read::<[u8; 4]>().expect("texels");
    let white = texels.iter().filter(|t| t[0] > 250).count();
    let edge = texels.iter().filter(|t| (10..=245).contains(&t[0])).count();
    assert!(white > 60 && white < 1000, "{white} texels of the letter");
    assert!(edge > 20, "{edge} texels of its smooth edge");
}
