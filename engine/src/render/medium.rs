//! The volume of a scene on the device.

use glam::DVec3;

use super::look::LookBuffers;
use crate::error::Result;
use crate::gpu::{Gpu, Recorder};
use crate::volume::{Roi, Volume};

/// A volume and where it is: outside the region there is nothing; without one all of the volume is there.
pub struct MediumSource<'a> {
    /// Intensities.
    pub volume: &'a Volume,
    /// The region whose mask is the occupancy.
    pub roi: Option<&'a Roi>,
}

impl MediumSource<'_> {
    /// Middle of the volume, whole mm RAS.
    pub(super) fn centre(&self) -> DVec3 {
        let [x, y, z] = self.volume.size.map(|n| (n as f64 - 1.0) * 0.5);
        self.volume.world_from_voxel.transform_point3(DVec3::new(x, y, z)).round()
    }
}

/// The volume on the device.
pub struct Medium {
    /// Least and greatest intensity.
    pub range: [f64; 2],
    /// Corners of the box around it, mm in the space of the scene.
    pub bounds: [DVec3; 2],
}

impl Medium {
    pub(super) fn new(_: &Gpu, source: &MediumSource<'_>, origin: DVec3) -> Result<Self> {
        let volume = source.volume;
        let last = DVec3::from_array(volume.size.map(|n| n as f64 - 0.5));
        let mut bounds = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        for corner in 0..8u32 {
            let at = |axis: u32| if corner >> axis & 1 == 1 { last[axis as usize] } else { -0.5 };
            let place = volume.world_from_voxel.transform_point3(DVec3::new(at(0), at(1), at(2))) - origin;
            bounds = [bounds[0].min(place), bounds[1].max(place)];
        }
        let stats = volume.gather_stats();
        Ok(Medium { range: [f64::from(stats.min), f64::from(stats.max)], bounds })
    }

    pub(super) fn record_occupancy(&mut self, _: &mut Recorder, _: &LookBuffers) {}
}
