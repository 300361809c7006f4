//! Composes the eyes' pictures from what was rendered; with foveation, each eye's surround with the inset
//! over it.

use engine::Result;
use engine::gpu::{Drawing, Format, Gpu, Recorder};
use engine::render::Target;
use shaders_glsl as glsl;
use shaders_glsl::types::EyesParams;

use crate::headset::{Blend, FrameImages};
use crate::sight::{FADING, Inset, Mark};

/// Draws rendered pictures into those of a headset.
pub struct Composer {
    drawing: Drawing,
    depth: bool,
    /// Colour behind what was rendered, display-referred, premultiplied.
    background: [f32; 4],
    /// True if the drawing does not cover the old content of the picture.
    translucent: bool,
}

impl Composer {
    /// Creates a composer for pictures of a format, with or without depth. `background` is drawn behind what
    /// was rendered, unless the headset shows the room there. `foveated` says that the rendered views have
    /// insets.
    pub fn new(
        gpu: &Gpu,
        format: Format,
        depth: bool,
        blend: Blend,
        background: [f32; 3],
        foveated: bool,
    ) -> Result<Self> {
        let constants = [format.is_srgb(), foveated].map(u32::from);
        let [r, g, b] = background;
        let (fragment, formats) = match depth {
            true => (&glsl::EYES_DEPTH_FRAG, &[format, Format::D32f][..]),
            false => (&glsl::EYES_FRAG, &[format][..]),
        };
        Ok(Composer {
            drawing: Drawing::new(gpu, &glsl::EYES_VERT, fragment, &constants, formats, 2)?,
            depth,
            background: match blend {
                Blend::Opaque => [r, g, b, 1.0],
                Blend::Additive => [0.0, 0.0, 0.0, 1.0],
                Blend::Alpha => [0.0; 4],
            },
            translucent: blend == Blend::Alpha,
        })
    }

    /// Records the composition. `size` is the part of the target that was rendered, pixels; `range` are the
    /// distances of depths 0 and 1, mm. `insets` are the places of the insets, if this was created for them;
    /// `marks` are the places of the mark that the picture is a draft, if it is one.
    #[expect(clippy::too_many_arguments, reason = "what a picture is made of, once")]
    pub fn compose(
        &self,
        recorder: &mut Recorder,
        rendered: &Target,
        size: [u32; 2],
        range: [f32; 2],
        insets: Option<&[Inset; 2]>,
        marks: Option<&[Mark; 2]>,
        eyes: &mut FrameImages<'_>,
    ) {
        if self.translucent {
            recorder.clear_image(eyes.colour, [0.0; 4]);
        }
        let whole = rendered.size();
        let part = |axis: usize, less: f32| (size[axis] as f32 - less) / whole[axis] as f32;
        let mut drawing = recorder.draw(&self.drawing).sample("rendered", &rendered.colour);
        if self.depth {
            drawing = drawing.sample("depths", &rendered.depth);
        }
        drawing
            .push(&EyesParams {
                part: [part(0, 0.0), part(1, 0.0)],
                most: [part(0, 0.5), part(1, 0.5)],
                background: self.background,
                range,
                insets: insets
                    .map_or_else(Default::default, |insets| insets.map(|i| i.map(|part| part as f32))),
                fading: FADING as f32,
                marks: marks.map_or_else(Default::default, |marks| marks.map(|m| m.map(|part| part as f32))),
            })
            .vertices_over(&mut eyes.pictures(), 0..3);
    }
}
