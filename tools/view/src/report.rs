//! What a session of the viewer measured: how soon something was seen, how soon an edit was.

use std::time::Instant;

use serde::Serialize;

/// What was measured from start to end.
#[derive(Clone, Debug, Serialize)]
pub struct WindowReport {
    #[serde(skip)]
    since: Instant,
    /// From the start of the program to the first frame of the window, ms.
    pub first_frame_ms: Option<f64>,
    /// From the start of the program to the first frame with a picture of what was opened, ms.
    pub first_picture_ms: Option<f64>,
    /// Frames that were shown.
    pub frames: u64,
    /// Pictures that were rendered: a frame of which only panels changed has none.
    pub pictures: u64,
    /// From the first event of an edit of the look to the frame that shows it, ms each.
    pub edits_ms: Vec<f64>,
    /// Times of the pictures, ms each.
    pub pictures_ms: Vec<f64>,
}

/// Values that are kept of each kind; a long session must not fill the memory.
const KEPT: usize = 10_000;

impl WindowReport {
    /// Of a program that was started then.
    pub fn new(since: Instant) -> Self {
        WindowReport {
            since,
            first_frame_ms: None,
            first_picture_ms: None,
            frames: 0,
            pictures: 0,
            edits_ms: Vec::new(),
            pictures_ms: Vec::new(),
        }
    }

    /// A frame was shown; `edited` is when the edit of the look that it shows began, if it shows one.
    pub fn shown(&mut self, with_picture: bool, edited: Option<Instant>) {
        let ms = self.since.elapsed().as_secs_f64() * 1e3;
        self.frames += 1;
        self.first_frame_ms.get_or_insert(ms);
        if with_picture {
            self.first_picture_ms.get_or_insert(ms);
        }
        if let Some(begun) = edited
            && self.edits_ms.len() < KEPT
        {
            self.edits_ms.push(begun.elapsed().as_secs_f64() * 1e3);
        }
    }

    /// A picture took so long, ms.
    pub fn rendered(&mut self, ms: f64) {
        self.pictures += 1;
        if self.pictures_ms.len() < KEPT {
            self.pictures_ms.push(ms);
        }
    }
}
