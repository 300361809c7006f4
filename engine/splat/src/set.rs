//! A set of splats in the world.

use glam::DVec3;

use super::importance::by_importance;
use super::{Field, Form, Grid, Harmonics, Region, Rounding, Splat, Voxels};
use base::unit::Unit;

/// A fitted set of splats in world space, with all that is needed to evaluate its field.
#[derive(Clone, Debug, PartialEq)]
pub struct SplatSet {
    /// Means in mm, RAS, relative to `origin_mm`; ln σ in ln mm; intensity as `unit` says.
    pub splats: Vec<Splat>,
    /// Origin of the means in the world, mm RAS.
    pub origin_mm: DVec3,
    /// The field that the splats add up to.
    pub field: Field,
    /// What the intensities are numbers of.
    pub unit: Unit,
    /// The colours of a set of ordinary 3D Gaussian splatting; `None` if the splats have an intensity, which
    /// a transfer function colours.
    pub colours: Option<Harmonics>,
    /// The structure that each splat belongs to, by the labels of the label map that the set was fitted to; 0
    /// is none of them.
    pub labels: Option<Vec<u8>>,
    /// Names of labels, at most one for each, in ascending order; see [`label_name`](super::label_name).
    pub label_names: Vec<(u8, String)>,
    /// Iterations of the fit that made the set; `None` if unknown.
    pub iterations: Option<u32>,
    /// The grid of the volume that the set was fitted to; `None` if unknown.
    pub grid: Option<Grid>,
    /// Checksum (`Volume::crc32`) of that volume's samples; `None` if unknown.
    pub volume_crc32: Option<u32>,
    /// What the set was fitted for.
    pub form: Form,
    /// The voxels of the grid that are shown, of a set that was fitted to a binary mask or to labels; `None` if the
    /// occupancy of the splats says how much of each voxel is.
    pub region: Option<Region>,
    /// V of the region's voxels, for the fits of its objects that have it in place of splats; at most one for each,
    /// ascending.
    pub voxels: Vec<Voxels>,
    /// The lattice that the splats were rounded to; `None` if they were not.
    pub rounding: Option<Rounding>,
}

impl Default for SplatSet {
    /// Returns a set without splats whose intensities are HU.
    fn default() -> Self {
        SplatSet {
            splats: Vec::new(),
            origin_mm: DVec3::ZERO,
            field: Field::default(),
            unit: Unit::Hu,
            colours: None,
            labels: None,
            label_names: Vec::new(),
            iterations: None,
            grid: None,
            volume_crc32: None,
            form: Form::default(),
            region: None,
            voxels: Vec::new(),
            rounding: None,
        }
    }
}

impl SplatSet {
    /// Returns the name of the set's form in files: "field", "grid" or "region".
    pub fn form_name(&self) -> &'static str {
        self.form.name(self.region.is_some())
    }

    /// Returns true if there is nothing to show: neither splats nor coded voxels.
    pub fn is_empty(&self) -> bool {
        self.splats.is_empty() && self.voxels.is_empty()
    }

    /// Returns the coded voxels of an object of the region; `None` if its V is that of splats.
    pub fn voxels_of(&self, fit: u8) -> Option<&Voxels> {
        self.voxels.iter().find(|voxels| voxels.fit == fit)
    }

    /// Returns the number of splats and coded voxels.
    pub fn count(&self) -> usize {
        self.splats.len() + self.coded_count()
    }

    /// Returns the number of coded voxels of the region.
    pub fn coded_count(&self) -> usize {
        let Some(region) = self.region.as_ref().filter(|_| !self.voxels.is_empty()) else { return 0 };
        let counts = region.objects().iter().zip(region.counts());
        counts.filter(|(object, _)| self.voxels_of(object.fit).is_some()).map(|(_, count)| count).sum()
    }

    /// Returns number of the object and V of each coded voxel of the region.
    pub fn coded(&self) -> impl Iterator<Item = (u8, f64)> + '_ {
        let region = self.region.as_ref().filter(|_| !self.voxels.is_empty());
        region.into_iter().flat_map(Region::voxels).filter_map(|(voxel, object)| {
            let value = self.voxels_of(object.fit)?.at(voxel.map(i64::from))?;
            Some((object.number, value))
        })
    }

    /// Returns the least and the greatest intensity; `None` for an empty set.
    pub fn intensity_range(&self) -> Option<[f64; 2]> {
        let splats = self.splats.iter().map(|splat| [f64::from(splat.intensity); 2]);
        let all = splats.chain(self.coded().map(|(_, value)| [value; 2]));
        all.reduce(|[a, b], [low, high]| [a.min(low), b.max(high)])
    }

    /// Returns this set with all that `original` states beside its splats: for a file that another program has
    /// written anew without the comments of this one.
    pub fn with_statements_of(self, original: &SplatSet) -> SplatSet {
        SplatSet {
            origin_mm: original.origin_mm,
            field: original.field,
            unit: if self.unit.is_physical() { original.unit } else { self.unit },
            label_names: original.label_names.clone(),
            iterations: original.iterations,
            grid: original.grid,
            volume_crc32: original.volume_crc32,
            form: original.form,
            region: original.region.clone(),
            voxels: original.voxels.clone(),
            ..self
        }
    }

    /// Sorts the splats by importance, the most important first: the first n splats then represent the set as
    /// well as n splats can, for any n. The field stays the same.
    pub fn order_by_importance(&mut self) {
        let order = by_importance(&self.splats, &self.field);
        self.take(&order.iter().map(|&i| i as usize).collect::<Vec<_>>());
    }

    /// Keeps the first `count` splats.
    pub fn truncate(&mut self, count: usize) {
        self.take(&(0..count.min(self.splats.len())).collect::<Vec<_>>());
    }

    /// Keeps the splats of these `rows`, in this order.
    pub(super) fn take(&mut self, rows: &[usize]) {
        self.splats = rows.iter().map(|&i| self.splats[i]).collect();
        if let Some(labels) = &mut self.labels {
            *labels = rows.iter().map(|&i| labels[i]).collect();
        }
        if let Some(colours) = &mut self.colours {
            let stride = colours.stride();
            let of = |&i: &usize| colours.coefficients[i * stride..][..stride].iter().copied();
            colours.coefficients = rows.iter().flat_map(of).collect();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_most_important_splats_come_first_with_what_belongs_to_them() {
        let weighing = |opacity_logit, size: f32| Splat {
            opacity_logit,
            log_scale: [size, 0.0, -1.0],
            rotation: [1.0, 0.0, 0.0, 0.0],
            ..Splat::default()
        };
        let splats = vec![weighing(0.0, 0.0), weighing(0.0, 2.0), weighing(-9.0, 2.0), weighing(5.0, 2.0)];
        let coefficients = (0..12).map(|i| i as f32).collect();
        let mut set = SplatSet {
            splats: splats.clone(),
            labels: Some(vec![0, 1, 2, 3]),
            colours: Some(Harmonics { degree: 0, coefficients }),
            ..SplatSet::default()
        };
        set.order_by_importance();
        assert_eq!(set.labels.as_deref(), Some(&[3, 1, 0, 2][..]));
        assert_eq!(set.splats, [3, 1, 0, 2].map(|i| splats[i]));
        set.truncate(2);
        assert_eq!(set.labels.as_deref(), Some(&[3, 1][..]));
        assert_eq!(set.colours.expect("colours").coefficients, [9.0, 10.0, 11.0, 3.0, 4.0, 5.0]);
    }

    #[test]
    fn intensities_range_from_the_least_to_the_greatest() {
        let of = |intensity| Splat { intensity, ..Splat::default() };
        let mut set = SplatSet { splats: [3.0, -5.0, 80.0].map(of).to_vec(), ..SplatSet::default() };
        assert_eq!(set.intensity_range(), Some([-5.0, 80.0]));
        set.truncate(1);
        assert_eq!(set.intensity_range(), Some([3.0, 3.0]));
        set.truncate(0);
        assert_eq!(set.intensity_range(), None);
    }
}
