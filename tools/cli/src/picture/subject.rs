//! Data of the picture: CT, region and splats on the part of the grid around the region, and the colours of
//! values.

use engine::Result;
use engine::fidelity;
use engine::fit::evaluate::FieldSample;
use engine::gpu::Gpu;
use engine::rasterize::visit_shown;
use engine::splat::SplatSet;
use engine::volume::trilinear;
use engine::volume::{Roi, Volume};
use glam::{DAffine3, DVec3};

use super::canvas::Colour;

/// Number of voxels that are shown around the region.
const MARGIN: usize = 6;

/// All data on one grid: the box of the region with a margin.
pub struct Subject {
    /// CT; NaN and infinities are replaced by the least value.
    pub ct: Volume,
    /// Region of interest.
    pub roi: Roi,
    /// Field V̂ of the splats.
    pub hu: Vec<f32>,
    /// Occupancy O of the splats.
    pub occupancy: Vec<f32>,
    /// Place where the slices meet, voxels of this grid.
    pub centre: DVec3,
    /// True if the slices mark the place where they meet.
    pub marked: bool,
    /// 3rd and 96th percentile of the HU in the region, so that metal and a few specks do not set the scale.
    pub percentiles: [f32; 2],
    /// Name of the volume.
    pub name: &'static str,
    /// Text behind an intensity.
    pub unit: &'static str,
    /// 98th percentile of |V̂ - V| in the region, rounded up to 1, 2 or 5 times a power of ten.
    pub difference: f32,
}

impl Subject {
    /// Cuts out the box and evaluates the splats on it. The slices meet at the voxel `at` of the volume (its
    /// index), or in the middle of the region.
    pub fn new(gpu: &Gpu, set: &SplatSet, volume: &Volume, roi: &Roi, at: Option<usize>) -> Result<Self> {
        let (low, size) = bounds(roi);
        let cut = |samples: &[f32]| -> Vec<f32> {
            let mut out = Vec::with_capacity(size.iter().product());
            for z in low[2]..low[2] + size[2] {
                for y in low[1]..low[1] + size[1] {
                    let row = volume.index(low[0], y, z);
                    out.extend_from_slice(&samples[row..row + size[0]]);
                }
            }
            out
        };
        let shift = DVec3::from_array(low.map(|n| n as f64));
        let mut ct = Volume {
            size,
            world_from_voxel: volume.world_from_voxel * DAffine3::from_translation(shift),
            samples: cut(&volume.samples),
            oriented: volume.oriented,
            labels: Default::default(),
            frame_of_reference: volume.frame_of_reference.clone(),
            stated_unit: volume.stated_unit,
            part_of: None,
        };
        let least = ct.min_max().map_or(0.0, |range| range.0);
        ct.samples.iter_mut().filter(|v| !v.is_finite()).for_each(|v| *v = least);
        let roi = Roi { size, weight: cut(&roi.weight), soft: roi.soft };

        let mut hu = vec![set.field.background; ct.len()];
        let mut occupancy = vec![0.0; ct.len()];
        visit_shown(gpu, set, &ct, |index, s: &FieldSample| {
            hu[index] = s.hu;
            occupancy[index] = s.occupancy;
        })?;

        let mut inside: Vec<f32> = marked(&roi).map(|i| ct.samples[i]).collect();
        let mut errors: Vec<f32> = marked(&roi).map(|i| (hu[i] - ct.samples[i]).abs()).collect();
        let place = |i: usize| {
            let [nx, ny, _] = volume.size;
            DVec3::new((i % nx) as f64, (i / nx % ny) as f64, (i / (nx * ny)) as f64) - shift
        };
        let centre = at.map_or_else(|| centre_of_mass(&roi), place);
        Ok(Subject {
            percentiles: [percentile(&mut inside, 0.03), percentile(&mut inside, 0.96)],
            name: if volume.is_ct() { "CT" } else { "volume" },
            unit: volume.unit().text(),
            difference: round_up(percentile(&mut errors, 0.98)),
            centre,
            marked: at.is_some(),
            ct,
            roi,
            hu,
            occupancy,
        })
    }

    /// Returns the HU at black and at white.
    pub fn window(&self) -> [f32; 2] {
        let [low, high] = self.percentiles;
        let span = (high - low).max(1.0);
        // The surroundings are mostly darker than what was chosen for the fit.
        [(low - 0.6 * span).round(), (high + 0.1 * span).round()]
    }

    /// Returns the voxels of the region.
    pub fn region(&self) -> impl Iterator<Item = DVec3> {
        let [nx, ny, _] = self.roi.size;
        marked(&self.roi)
            .map(move |i| DVec3::new((i % nx) as f64, (i / nx % ny) as f64, (i / (nx * ny)) as f64))
    }

    /// Returns a trilinear sample of any quantity on this grid.
    pub fn sample(&self, values: &[f32], voxel: DVec3) -> f32 {
        trilinear(self.ct.size, voxel, |i| f64::from(values[i])) as f32
    }

    /// Returns V̂ - V at a voxel.
    pub fn error(&self, voxel: DVec3) -> f32 {
        self.sample(&self.hu, voxel) - self.sample(&self.ct.samples, voxel)
    }

    /// Returns the grey of a value in the window, 0 to 1.
    pub fn grey(&self, hu: f32) -> f32 {
        let [low, high] = self.window();
        ((hu - low) / (high - low)).clamp(0.0, 1.0)
    }
}

/// Returns the colour of a difference from -1 to 1.
pub fn diverging(t: f32) -> Colour {
    fidelity::diverging(f64::from(t)).map(|c| (255.0 * c).round() as u8)
}

/// Returns a grey from 0 to 1 as a colour.
pub fn grey(value: f32) -> Colour {
    [(value.clamp(0.0, 1.0) * 255.0).round() as u8; 3]
}

fn marked(roi: &Roi) -> impl Iterator<Item = usize> {
    roi.weight.iter().enumerate().filter(|(_, w)| **w >= 0.5).map(|(i, _)| i)
}

/// Returns the first voxel and the size of the box of the region with its margin.
fn bounds(roi: &Roi) -> ([usize; 3], [usize; 3]) {
    let [nx, ny, _] = roi.size;
    let (mut low, mut high) = (roi.size, [0; 3]);
    for (i, _) in roi.weight.iter().enumerate().filter(|(_, w)| **w > 0.0) {
        let voxel = [i % nx, i / nx % ny, i / (nx * ny)];
        for axis in 0..3 {
            low[axis] = low[axis].min(voxel[axis]);
            high[axis] = high[axis].max(voxel[axis]);
        }
    }
    let low = low.map(|n| n.saturating_sub(MARGIN));
    (low, std::array::from_fn(|a| (high[a] + MARGIN + 1).min(roi.size[a]) - low[a]))
}

fn centre_of_mass(roi: &Roi) -> DVec3 {
    let [nx, ny, _] = roi.size;
    let (mut sum, mut weight) = (DVec3::ZERO, 0.0);
    for (i, &w) in roi.weight.iter().enumerate().filter(|(_, w)| **w > 0.0) {
        let voxel = [i % nx, i / nx % ny, i / (nx * ny)].map(|n| n as f64);
        sum += DVec3::from_array(voxel) * f64::from(w);
        weight += f64::from(w);
    }
    // A region has weight somewhere.
    (sum / weight).round()
}

fn percentile(values: &mut [f32], share: f64) -> f32 {
    if values.is_empty() {
        return 0.0;
    }
    let index = ((values.len() - 1) as f64 * share).round() as usize;
    *values.select_nth_unstable_by(index, f32::total_cmp).1
}

/// Returns the least of 1, 2, 5, 10, ... that is not below `value`.
fn round_up(value: f32) -> f32 {
    let mut decade = 1.0;
    loop {
        for step in [1.0, 2.0, 5.0] {
            if value <= step * decade || decade > 1e30 {
                return step * decade;
            }
        }
        decade *= 10.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_are_round_and_colours_end_where_they_should() {
        for (value, scale) in [(0.0, 1.0), (1.1, 2.0), (3.0, 5.0), (51.0, 100.0), (f32::NAN, 1e31)] {
            assert!((round_up(value) / scale - 1.0).abs() < 0.2, "{value}");
        }
        assert_eq!(diverging(0.0), [244; 3]);
        assert_eq!((diverging(-9.0), diverging(9.0)), ([8, 76, 168], [184, 24, 32]));
        assert_eq!(percentile(&mut [3.0, 1.0, 2.0], 0.5), 2.0);
    }
}
