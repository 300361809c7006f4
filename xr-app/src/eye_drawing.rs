//! A drawing over the pictures of both eyes, whatever their format, with or without depth.

use engine::Result;
use engine::gpu::{Drawing, Format, Gpu, Overlap};
use shaders_glsl::Shader;

use crate::headset::FrameImages;

/// Format of the colour of pictures; true if they have depth.
type PictureKind = (Format, bool);

/// A drawing over the pictures of a headset, and over those of another kind.
pub struct EyeDrawing {
    gpu: Gpu,
    shaders: [&'static Shader; 2],
    overlap: Overlap,
    kind: PictureKind,
    drawing: Drawing,
    /// Drawing for pictures of another kind, kept because recorded commands need it until they have run.
    other: Option<(PictureKind, Drawing)>,
}

impl EyeDrawing {
    /// Creates the drawing of a vertex and a fragment shader for pictures of this format, with or without
    /// depth, with a layer for each eye. Without depth everything is blended, whatever the overlap.
    pub fn new(
        gpu: &Gpu,
        shaders: [&'static Shader; 2],
        overlap: Overlap,
        format: Format,
        depth: bool,
    ) -> Result<Self> {
        let kind = (format, depth);
        let drawing = make(gpu, shaders, overlap, kind)?;
        Ok(EyeDrawing { gpu: gpu.clone(), shaders, overlap, kind, drawing, other: None })
    }

    /// Returns the drawing for these pictures. For pictures of another kind than the headset's a pipeline is
    /// created first.
    pub fn over(&mut self, eyes: &FrameImages<'_>) -> Result<&Drawing> {
        let kind = (eyes.colour.format(), eyes.depth.is_some());
        if kind != self.kind && self.other.as_ref().is_none_or(|(made, _)| *made != kind) {
            self.other = Some((kind, make(&self.gpu, self.shaders, self.overlap, kind)?));
        }
        Ok(match &self.other {
            Some((made, other)) if *made == kind => other,
            _ => &self.drawing,
        })
    }
}

fn make(
    gpu: &Gpu,
    shaders: [&'static Shader; 2],
    overlap: Overlap,
    (format, depth): PictureKind,
) -> Result<Drawing> {
    let linear = [u32::from(format.is_srgb())];
    let formats = [format, Format::D32f];
    let (formats, overlap) = if depth { (&formats[..], overlap) } else { (&formats[..1], Overlap::Blended) };
    Drawing::overlapping(gpu, shaders, &linear, formats, 2, overlap)
}
