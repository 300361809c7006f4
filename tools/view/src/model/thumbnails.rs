//! Small pictures of the scene, one for each preset of the transfer function.

use std::collections::BTreeMap;

use egui::{ColorImage, Context, TextureHandle, TextureOptions};
use engine::image::Image;
use engine::transfer::PRESETS;
use glam::DVec3;

use crate::model::orbit::Orbit;
use crate::model::state::{Clip, Object, Subject, ViewState};

/// Width and height of a thumbnail, pixels.
pub const SIZE: [u32; 2] = [96, 72];

/// What all thumbnails show.
#[derive(Clone, Debug, PartialEq)]
pub struct Seen {
    data: u64,
    shown: Subject,
    orbit: Orbit,
    clip: Clip,
    objects: Vec<Object>,
    background: DVec3,
}

impl Seen {
    /// Returns what the state shows of the data of this number, whatever its transfer function.
    pub fn of(state: &ViewState, data: u64) -> Self {
        Seen {
            data,
            shown: state.shown,
            orbit: state.orbit,
            clip: state.clip.clone(),
            objects: state.objects.clone(),
            background: state.background,
        }
    }
}

/// The thumbnails, which are made one after the other while a list shows them.
#[derive(Default)]
pub struct Thumbnails {
    seen: Option<Seen>,
    made: BTreeMap<&'static str, TextureHandle>,
    /// True if a list has shown them since the last one was made.
    pub wanted: bool,
}

impl Thumbnails {
    /// Returns the name of a preset whose thumbnail is to be made; `None` if none is wanted or lacking. Those that
    /// show something else than `seen` are dropped.
    pub fn next(&mut self, seen: Seen) -> Option<&'static str> {
        if !std::mem::take(&mut self.wanted) {
            return None;
        }
        if self.seen.as_ref() != Some(&seen) {
            self.made.clear();
            self.seen = Some(seen);
        }
        PRESETS.iter().map(|preset| preset.name).find(|name| !self.made.contains_key(name))
    }

    /// Adds the thumbnail of a preset.
    pub fn add(&mut self, context: &Context, preset: &'static str, picture: &Image) {
        let bytes = picture.pixels.iter().flat_map(|pixel| &pixel[..3]);
        let bytes: Vec<u8> = bytes.map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8).collect();
        let image = ColorImage::from_rgb(picture.size, &bytes);
        let name = format!("thumbnail of {preset}");
        self.made.insert(preset, context.load_texture(name, image, TextureOptions::LINEAR));
    }

    /// Returns the thumbnail of a preset, if it is made.
    pub fn of(&self, preset: &str) -> Option<&TextureHandle> {
        self.made.get(preset)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thumbnails_are_made_while_they_are_wanted_and_anew_when_something_else_is_seen() {
        let function = engine::transfer::load("CT-Bone", [-1000.0, 2000.0]).expect("a preset");
        let mut state = ViewState::new(&function);
        let mut thumbnails = Thumbnails::default();
        let context = Context::default();
        assert_eq!(thumbnails.next(Seen::of(&state, 1)), None, "nobody looks");
        let picture = Image { size: [2, 1], pixels: vec![[0.5, 2.0, -1.0, 1.0]; 2] };
        let make_all = |thumbnails: &mut Thumbnails, seen: &Seen| {
            let mut count = 0;
            loop {
                thumbnails.wanted = true;
                let Some(name) = thumbnails.next(seen.clone()) else { return count };
                thumbnails.add(&context, name, &picture);
                count += 1;
            }
        };
        assert_eq!(make_all(&mut thumbnails, &Seen::of(&state, 1)), PRESETS.len());
        assert!(PRESETS.iter().all(|preset| thumbnails.of(preset.name).is_some()));
        state.transfer.shift = 7.0;
        assert_eq!(make_all(&mut thumbnails, &Seen::of(&state, 1)), 0, "each has a function of its own");
        assert_eq!(make_all(&mut thumbnails, &Seen::of(&state, 2)), PRESETS.len(), "other data");
        state.orbit.azimuth_deg += 1.0;
        assert_eq!(make_all(&mut thumbnails, &Seen::of(&state, 2)), PRESETS.len(), "from elsewhere");
    }
}
