//! Padding: the value that scanners write where they have measured nothing, far below that of air.

use engine::volume::{Roi, Volume};

/// Greatest value that counts as padding, HU: no reconstruction of air is as low, with all its noise.
const MOST: f32 = -1500.0;
/// Least part of all voxels that padding has; a few voxels below it are artefacts.
const SHARE: f64 = 1e-4;

/// The padding of a volume.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Padding {
    value: f32,
    voxels: usize,
}

impl Padding {
    /// Returns the padding of a volume: its least value, if that is no HU of anything and many voxels have it.
    pub fn of(volume: &Volume) -> Option<Padding> {
        let (value, _) = volume.min_max()?;
        if value > MOST {
            return None;
        }
        let voxels = volume.samples.iter().filter(|&&v| v == value).count();
        (voxels as f64 >= SHARE * volume.len() as f64).then_some(Padding { value, voxels })
    }

    /// Warns of padding in a region: figures and fits then count it as tissue.
    pub fn warn_of_region(&self, volume: &Volume, roi: &Roi) {
        let within = volume.samples.iter().zip(&roi.weight).filter(|&(&v, &m)| m > 0.0 && v == self.value);
        let within = within.count();
        if within > 0 {
            tracing::warn!(
                "{within} voxels of the region hold {}, the padding of the scan, and their errors count: leave them \
                 out of the mask",
                self.value
            );
        }
    }

    /// Warns of a PSNR over the range of a whole volume, which begins at the padding.
    pub fn warn_of_range(&self, [low, high]: [f32; 2]) {
        if low == self.value {
            tracing::warn!(
                "the range of the PSNR, {low} to {high}, begins at the padding that {} voxels hold: give that of the \
                 scan itself, as -1024,{high}",
                self.voxels
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::*;

    #[test]
    fn what_many_voxels_hold_far_below_air_is_padding() {
        let of = |samples: Vec<f32>| Padding::of(&Volume::new([10, 10, 10], DAffine3::IDENTITY, samples));
        let mut samples = vec![40.0; 1000];
        assert_eq!(of(samples.clone()), None);
        samples[..300].fill(-1024.0);
        assert_eq!(of(samples.clone()), None, "air");
        samples[..200].fill(-3024.0);
        assert_eq!(of(samples.clone()), Some(Padding { value: -3024.0, voxels: 200 }));
        samples[0] = -3030.0;
        assert_eq!(of(samples), Some(Padding { value: -3030.0, voxels: 1 }), "one in a thousand");
        let large = Volume::new([100, 100, 2], DAffine3::IDENTITY, {
            let mut samples = vec![0.0; 20_000];
            samples[7] = -2000.0;
            samples
        });
        assert_eq!(Padding::of(&large), None, "an artefact");
    }
}
