//! Paints what a picture tells into an image of any size, by the same code as on the screen.

use egui::epaint::ClippedPrimitive;
use egui::{Context, LayerId, RawInput, Rect, TexturesDelta, Vec2, ViewportId, pos2, vec2};
use engine::Result;
use engine::gpu::{self, Format, Gpu};
use engine::image::Image;

use crate::model::state::ViewState;
use crate::panels::annotations::{Ink, PictureOverlay, Told};
use crate::screen::painter::{Painter, Painting};

/// Least number of pixels per point: letters of fewer could not be read.
const LEAST_SCALE: f32 = 0.5;

/// Painter of what pictures of one size tell.
pub struct OverlayImage {
    gpu: Gpu,
    context: Context,
    painter: Painter,
    target: gpu::Image,
    size: [u32; 2],
    pixels_per_point: f32,
}

impl OverlayImage {
    /// Creates a painter for pictures of `size` pixels. `points` are width and height of the picture in the window:
    /// letters are as large against the picture as there.
    pub fn new(gpu: &Gpu, size: [u32; 2], points: [f32; 2]) -> Result<Self> {
        let scale = |i: usize| size[i] as f32 / points[i].max(1.0);
        Ok(OverlayImage {
            gpu: gpu.clone(),
            context: Context::default(),
            painter: Painter::new(gpu, Format::Rgba8)?,
            target: gpu.picture("what a picture tells", "panels", Format::Rgba8, size, 1)?,
            size,
            pixels_per_point: scale(0).min(scale(1)).max(LEAST_SCALE),
        })
    }

    /// Paints what a picture of this state tells, in this ink, on nothing.
    pub fn paint(&mut self, state: &ViewState, told: &Told<'_>, ink: Ink) -> Result<Image> {
        let [width, height] = self.size.map(|n| n as f32);
        let points = vec2(width, height) / self.pixels_per_point;
        let rect = Rect::from_min_size(pos2(0.0, 0.0), points);
        let aspect = f64::from(width) / f64::from(height);
        // The fonts have their size from the second frame on.
        for _ in 0..2 {
            let mut output = self.context.run_ui(self.input(rect), |ui| {
                let painter = ui.ctx().layer_painter(LayerId::background()).with_clip_rect(rect);
                let overlay = PictureOverlay { painter: &painter, rect, orbit: &state.orbit, aspect, ink };
                overlay.tell(state, told);
            });
            let shapes = std::mem::take(&mut output.shapes);
            let primitives = self.context.tessellate(shapes, self.pixels_per_point);
            let mut changes = std::mem::take(&mut output.textures_delta);
            let painted = self.paint_once(&primitives, points, &mut changes);
            // What a failure has left of them would be taken for a mistake.
            changes.clear();
            painted?;
        }
        let pixels = self.target.read::<[u8; 4]>()?;
        let share = |byte: u8| f32::from(byte) / 255.0;
        let size = self.size.map(|n| n as usize);
        Ok(Image { size, pixels: pixels.into_iter().map(|pixel| pixel.map(share)).collect() })
    }

    fn paint_once(
        &mut self,
        primitives: &[ClippedPrimitive],
        points: Vec2,
        changes: &mut TexturesDelta,
    ) -> Result<()> {
        let mut recorder = self.gpu.record()?;
        self.painter.update(&mut recorder, changes)?;
        recorder.clear_image(&self.target, [0.0; 4]);
        let painting = Painting { primitives, points: points.into() };
        self.painter.paint(&mut recorder, &painting, &mut self.target)?;
        let ticket = recorder.submit()?;
        self.gpu.wait(ticket)?;
        self.painter.forget(changes);
        Ok(())
    }

    fn input(&self, rect: Rect) -> RawInput {
        let mut input = RawInput { screen_rect: Some(rect), ..RawInput::default() };
        let viewport = input.viewports.entry(ViewportId::ROOT).or_default();
        viewport.native_pixels_per_point = Some(self.pixels_per_point);
        viewport.inner_rect = Some(Rect::from_min_size(rect.min, rect.size()));
        input
    }
}

/// Puts one premultiplied picture over another of the same size.
pub fn put_over(picture: &mut Image, above: &Image) {
    for (below, above) in picture.pixels.iter_mut().zip(&above.pixels) {
        let through = 1.0 - above[3];
        below.iter_mut().zip(above).for_each(|(below, above)| *below = above + through * *below);
    }
}
