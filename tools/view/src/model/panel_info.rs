//! Information for the panels, anew for each frame.

use std::collections::{BTreeMap, VecDeque};

use engine::fidelity::ShownError;
use engine::render::{Intensities, SplatKind};
use glam::{DVec2, DVec3};

use crate::model::fit_plan::FitStatus;
use crate::model::histogram::Histogram;
use crate::model::region::RegionSize;
use crate::model::state::{SplatMode, Subject};
use crate::model::thumbnails::Thumbnails;

/// Number of frames in the statistics.
pub const FRAMES: usize = 120;

/// The error of the splats against the volume, as far as it is known.
#[derive(Clone, Copy, Debug)]
pub enum Measured<'a> {
    /// There is nothing to compare.
    Nothing,
    /// It has not been measured yet.
    Later,
    /// The splats lie nowhere in the volume, or it could not be measured.
    Nowhere,
    /// It was measured.
    Found(&'a ShownError),
}

impl<'a> Measured<'a> {
    /// Returns the error, if it was measured.
    pub fn found(self) -> Option<&'a ShownError> {
        match self {
            Measured::Found(error) => Some(error),
            _ => None,
        }
    }
}

/// Facts about the data and the frames that panels show.
pub struct PanelInfo<'a> {
    /// Corners of the box around the scene, mm RAS; `None` without a scene.
    pub bounds: Option<[DVec3; 2]>,
    /// Least and greatest intensity of the scene, HU for CT.
    pub range: [f64; 2],
    /// Text behind an intensity: " HU" for CT, empty for what has no unit.
    pub unit: &'a str,
    /// True if the orientation of the patient is known.
    pub oriented: bool,
    /// Number of splats, coded voxels included; `None` without any.
    pub splats: Option<usize>,
    /// Kind of the splats; `None` without splats.
    pub kind: Option<SplatKind>,
    /// True if the splats have a region, whose edges can be smooth.
    pub has_region: bool,
    /// Standard deviation of the middle splat along its shortest axis, mm, once they are on the device: the unit of
    /// steps in mode slab.
    pub sigma_mm: Option<f64>,
    /// Number of splats that are deleted.
    pub deleted: usize,
    /// True if there are splats beside them.
    pub beside: bool,
    /// True if there is a volume.
    pub volume: bool,
    /// Number of splats of each row of [`crate::ViewState::objects`].
    pub object_splats: &'a [usize],
    /// Intensities of each row of [`crate::ViewState::objects`], as soon as they are known.
    pub object_intensities: &'a [Intensities],
    /// Histogram of the splats' intensities, as soon as it is computed.
    pub splat_histogram: Option<&'a Histogram>,
    /// Histogram of the volume's intensities within its region, as soon as it is computed.
    pub volume_histogram: Option<&'a Histogram>,
    /// Error of the splats against the volume.
    pub error: Measured<'a>,
    /// True if the picture has the colours of the error.
    pub error_shown: bool,
    /// True if the splats are those of a fit that no file has yet.
    pub fitted: bool,
    /// The fit beside the window, if there is one.
    pub fit: Option<&'a FitStatus>,
    /// Size of the volume's region; `None` without a region.
    pub region: Option<RegionSize>,
    /// Corners of the box around the whole volume, mm RAS; `None` without a volume.
    pub volume_bounds: Option<[DVec3; 2]>,
    /// Number of the data: another one whenever something was read or closed.
    pub data: u64,
    /// True if the picture has a lower quality than it will have at rest.
    pub draft: bool,
    /// Small pictures of the scene by presets, where a window makes them.
    pub thumbnails: Option<&'a Thumbnails>,
    /// Frame times, passes, memory.
    pub statistics: &'a Statistics,
    /// Name of what is being loaded or written, and the part of it that is done (0 to 1), if known.
    pub progress: Option<(&'a str, Option<f32>)>,
    /// Returns the depth at a place of the picture (fractions from its upper left corner), mm along the
    /// viewing direction; `None` if nothing is seen there, or if it is not known while the picture changes.
    pub depth: &'a dyn Fn(DVec2) -> Option<f64>,
    /// Returns the intensity at a point, mm RAS; `None` outside of the data.
    pub sample: &'a dyn Fn(DVec3) -> Option<f64>,
    /// Returns the intensity at a point, mm RAS, where splats beside the others are seen; `None` outside of the data.
    pub sample_beside: &'a dyn Fn(DVec3) -> Option<f64>,
    /// Returns the intensity at a point, mm RAS, of the whole volume, and the weight of its region there, 0 to 1;
    /// `None` outside of the volume.
    pub sample_whole: &'a dyn Fn(DVec3) -> Option<(f64, f64)>,
}

impl PanelInfo<'_> {
    /// Returns true if there are data of a subject.
    pub fn has(&self, subject: Subject) -> bool {
        match subject {
            Subject::Splats => self.splats.is_some_and(|count| count > 0),
            Subject::Beside => self.beside,
            Subject::Volume => self.volume,
        }
    }

    /// Returns the modes that show the splats as they are meant; empty without splats.
    pub fn modes(&self) -> Vec<SplatMode> {
        self.kind.map(SplatMode::of_kind).unwrap_or_default()
    }

    /// Returns true if there is something to show side by side with the splats.
    pub fn has_two(&self) -> bool {
        self.has(Subject::Splats) && (self.beside || self.volume)
    }
}

static NO_STATISTICS: Statistics = Statistics::new();

impl Default for PanelInfo<'_> {
    /// Returns the information when nothing is open.
    fn default() -> Self {
        PanelInfo {
            bounds: None,
            range: [0.0, 1.0],
            unit: "",
            oriented: true,
            splats: None,
            kind: None,
            has_region: false,
            sigma_mm: None,
            deleted: 0,
            beside: false,
            volume: false,
            object_splats: &[],
            object_intensities: &[],
            splat_histogram: None,
            volume_histogram: None,
            error: Measured::Nothing,
            error_shown: false,
            fitted: false,
            fit: None,
            region: None,
            volume_bounds: None,
            data: 0,
            draft: false,
            thumbnails: None,
            statistics: &NO_STATISTICS,
            progress: None,
            depth: &|_| None,
            sample: &|_| None,
            sample_beside: &|_| None,
            sample_whole: &|_| None,
        }
    }
}

/// Frame times, their passes, and memory.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Statistics {
    /// Name of the device and its driver.
    pub device: String,
    /// The last [`FRAMES`] times of pictures that were rendered, ms, the latest last.
    frames_ms: VecDeque<f64>,
    /// Device time of each pass of the last picture, ms, the slowest first.
    pub passes: Vec<(String, f64)>,
    /// Number of splats that the look can show.
    pub active_splats: Option<usize>,
    /// Bytes of device memory by purpose.
    pub memory: BTreeMap<&'static str, u64>,
    /// Distance of slabs or samples that the user has chosen ([`crate::model::state::Quality::step`]).
    pub step: Option<f64>,
}

impl Statistics {
    /// Creates the statistics before the first frame.
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

    /// Adds the time of a picture, ms.
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

    /// Returns the time that a share of the last frames stayed within, ms: 0.5 gives the median. `None`
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
