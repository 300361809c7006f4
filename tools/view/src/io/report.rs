//! Measurements of a session of the viewer: how soon a picture was shown, and how soon an edit.

use std::time::Instant;

use engine::gpu::Hitches;
use serde::Serialize;

/// Measurements from start to end.
#[derive(Clone, Debug, Serialize)]
pub struct WindowReport {
    #[serde(skip)]
    since: Instant,
    /// Time from the start of the program to the first frame of the window, ms.
    pub first_frame_ms: Option<f64>,
    /// Time from the start of the program to the first frame with a picture of what was opened, ms.
    pub first_picture_ms: Option<f64>,
    /// Time from the start of the program to the first frame with a picture in full quality, ms.
    pub full_picture_ms: Option<f64>,
    /// Number of frames that were shown.
    pub frames: u64,
    /// Number of pictures that were rendered; a frame in which only panels changed has none.
    pub pictures: u64,
    /// Time from the first event of each edit of the look to the frame that shows it, ms.
    pub edits_ms: Vec<f64>,
    /// Device time of each picture, ms.
    pub pictures_ms: Vec<f64>,
    /// Time that the window's thread was busy with each frame, or for more than a millisecond between two, ms.
    pub busy_ms: Vec<f64>,
    /// What the frames of drags made of the device.
    pub drags: Drags,
}

/// What frames in which something is dragged made of the device. The first of a drag may create what the others use.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Drags {
    /// Those of `busy_ms` while a button was held.
    pub busy_ms: Vec<f64>,
    /// Number of the frames that began a picture.
    pub frames: u64,
    /// Number of those that allocated memory.
    pub allocating: u64,
    /// Number of those that waited for the device.
    pub waiting: u64,
    /// Number of those that created pipelines.
    pub compiling: u64,
}

/// Greatest number of values of each kind that are kept, so that a long session does not fill the memory.
const KEPT: usize = 10_000;

impl WindowReport {
    /// Starts the measurements of a program that was started at `since`.
    pub fn new(since: Instant) -> Self {
        WindowReport {
            since,
            first_frame_ms: None,
            first_picture_ms: None,
            full_picture_ms: None,
            frames: 0,
            pictures: 0,
            edits_ms: Vec::new(),
            pictures_ms: Vec::new(),
            busy_ms: Vec::new(),
            drags: Drags::default(),
        }
    }

    /// Notes that a frame was shown, with a picture or without one, and with a draft if so. `edited` is the beginning of the edit of the look that it shows, if it
    /// shows one.
    pub fn shown(&mut self, with_picture: bool, draft: bool, edited: Option<Instant>) {
        let ms = self.since.elapsed().as_secs_f64() * 1e3;
        self.frames += 1;
        self.first_frame_ms.get_or_insert(ms);
        if with_picture {
            self.first_picture_ms.get_or_insert(ms);
            if !draft {
                self.full_picture_ms.get_or_insert(ms);
            }
        }
        if let Some(begun) = edited
            && self.edits_ms.len() < KEPT
        {
            self.edits_ms.push(begun.elapsed().as_secs_f64() * 1e3);
        }
    }

    /// Notes for how long the window's thread was busy since `begun`, and whether a button was `held`.
    pub fn busy(&mut self, begun: Instant, held: bool) {
        let ms = begun.elapsed().as_secs_f64() * 1e3;
        let lists = [Some(&mut self.busy_ms), Some(&mut self.drags.busy_ms).filter(|_| held)];
        lists.into_iter().flatten().filter(|list| list.len() < KEPT).for_each(|list| list.push(ms));
    }

    /// Notes a frame of a drag, by what had happened on the device before it and after it.
    pub fn dragged(&mut self, before: Hitches, after: Hitches) {
        self.drags.frames += 1;
        self.drags.allocating += u64::from(after.allocations > before.allocations);
        self.drags.waiting += u64::from(after.waits > before.waits);
        self.drags.compiling += u64::from(after.pipelines > before.pipelines);
    }

    /// Notes the device time of a picture, ms.
    pub fn rendered(&mut self, ms: f64) {
        self.pictures += 1;
        if self.pictures_ms.len() < KEPT {
            self.pictures_ms.push(ms);
        }
    }
}
