//! What panels are told, anew for each frame.

use std::collections::{BTreeMap, VecDeque};

use glam::{DVec2, DVec3};

use crate::histogram::Histogram;

/// How many frames the statistics look back.
pub const FRAMES: usize = 120;

/// What is there, and how it is going.
pub struct PanelInfo<'a> {
    /// Corners of the box around the scene, mm RAS; none without a scene.
    pub bounds: Option<[DVec3; 2]>,
    /// Least and greatest intensity of the scene, HU for CT.
    pub range: [f64; 2],
    /// What follows an intensity in texts: " HU" for CT, nothing for what has no unit.
    pub unit: &'a str,
    /// True if it is known how the patient lies.
    pub oriented: bool,
    /// How many splats there are; none without splats.
    pub splats: Option<usize>,
    /// True if there is a volume.
    pub volume: bool,
    /// How many splats each row of [`crate::ViewState::objects`] has.
    pub object_splats: &'a [usize],
    /// Intensities of the splats, as soon as they are counted.
    pub splat_histogram: Option<&'a Histogram>,
    /// Intensities of the volume within its region, as soon as they are counted.
    pub volume_histogram: Option<&'a Histogram>,
    /// True if the picture is less than it will be at rest.
    pub draft: bool,
    /// Frame times, passes, memory.
    pub statistics: &'a Statistics,
    /// What is being loaded or written, and how much of it is done, 0 to 1, where that is known.
    pub progress: Option<(&'a str, Option<f32>)>,
    /// Depth at a place of the picture (fractions from its upper left corner), mm along the viewing
    /// direction; nothing where nothing is seen, or where it is not known while the picture changes.
    pub depth: &'a dyn Fn(DVec2) -> Option<f64>,
    /// Intensity at a point, mm RAS; nothing outside of what is there.
    pub sample: &'a dyn Fn(DVec3) -> Option<f64>,
}

static NO_STATISTICS: Statistics = Statistics::new();

impl Default for PanelInfo<'_> {
    /// Nothing is open.
    fn default() -> Self {
        PanelInfo {
            bounds: None,
            range: [0.0, 1.0],
            unit: "",
            oriented: true,
            splats: None,
            volume: false,
            object_splats: &[],
            splat_histogram: None,
            volume_histogram: None,
            draft: false,
            statistics: &NO_STATISTICS,
            progress: None,
            depth: &|_| None,
            sample: &|_| None,
        }
    }
}

/// How fast frames are, what they are made of and what they take.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Statistics {
    /// Name of the device and its driver.
    pub device: String,
    /// The last [`FRAMES`] times of pictures that were rendered, ms, the latest last.
    frames_ms: VecDeque<f64>,
    /// Device time of each pass of the last picture, ms, the slowest first.
    pub passes: Vec<(String, f64)>,
    /// Splats that the look can show.
    pub active_splats: Option<usize>,
    /// Bytes of device memory by purpose.
    pub memory: BTreeMap<&'static str, u64>,
    /// What the frame budget made of the quality: distance of slabs or samples as rendered last.
    pub step: Option<f64>,
}

impl Statistics {
    /// Before the first frame.
    pub const fn new() -> Self {
        Statistics {
            device: String::new(),
            frames_ms: VecDeque::new(),
            passes: Vec::new(),
            active_splats: None,
            memory: BTreeMap::new(),
            step: None,
        }
    }

    /// A picture took so long, ms.
    pub fn frame(&mut self, ms: f64) {
        if self.frames_ms.len() == FRAMES {
            self.frames_ms.pop_front();
        }
        self.frames_ms.push_back(ms);
    }

    /// Returns the times of the last pictures, ms, the latest last.
    pub fn frames_ms(&self) -> impl ExactSizeIterator<Item = f64> {
        self.frames_ms.iter().copied()
    }

    /// Returns the time that such a share of the last frames stayed within, ms: 0.5 is the median. Nothing
    /// before the first frame.
    pub fn percentile_ms(&self, share: f64) -> Option<f64> {
        let mut sorted: Vec<f64> = self.frames_ms().collect();
        sorted.sort_by(f64::total_cmp);
        // Nearest rank: the smallest time that at least that share of the frames does not exceed.
        let rank = (share * sorted.len() as f64).ceil() as usize;
        sorted.get(rank.saturating_sub(1)).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_of_the_last_frames() {
        let mut statistics = Statistics::new();
        assert_eq!(statistics.percentile_ms(0.5), None);
        for i in 0..500 {
            statistics.frame(f64::from(i));
        }
        assert_eq!(statistics.frames_ms().len(), FRAMES);
        assert_eq!(statistics.percentile_ms(0.5), Some(439.0));
        assert_eq!(statistics.percentile_ms(0.95), Some(493.0));
        assert_eq!(statistics.percentile_ms(1.0), Some(499.0));
        assert_eq!(statistics.percentile_ms(0.0), Some(380.0));
    }
}
