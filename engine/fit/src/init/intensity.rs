//! The first intensity of a splat: the volume at its mean, or averaged over its footprint.

use glam::{DMat3, DVec3};

use super::density::{Density, trilinear};
use splat::{Activations, Splat};
use volume::Volume;

/// Returns the intensity of a splat in voxel space. This is the trilinear sample of the volume at its mean,
/// or of the smoothed volume where that is not finite. If `footprint` is above 0 and the geometric mean of
/// the splat's scales (voxels) is not below it, this is the mean of the finite voxels within one standard
/// deviation, if there are any.
pub(super) fn intensity(volume: &Volume, density: &Density, splat: &Splat, footprint: f32) -> f32 {
    let wide = || splat.log_scale.iter().sum::<f32>() / 3.0 >= footprint.ln();
    if footprint > 0.0
        && wide()
        && let Some(mean) = footprint_mean(volume, splat)
    {
        return mean;
    }
    let sample = trilinear(&volume.samples, volume.size, splat.mean);
    if sample.is_finite() { sample } else { density.smoothed(splat.mean) }
}

/// Returns the mean of the finite voxels whose centres lie within a whitened distance of 1; nothing if there
/// is none.
fn footprint_mean(volume: &Volume, splat: &Splat) -> Option<f32> {
    let mean = DVec3::from_array(splat.mean.map(f64::from));
    let scale = DVec3::from_array(splat.scale().map(f64::from));
    let axes = splat.axes();
    // u = S⁻¹Rᵀd; the box of |u| ≤ 1 reaches as far as the rows of RS are long.
    let whitening = DMat3::from_diagonal(scale.recip()) * axes.transpose();
    let reach = (axes * DMat3::from_diagonal(scale)).transpose();
    let reach = [reach.x_axis, reach.y_axis, reach.z_axis].map(DVec3::length);
    // Voxels of an axis from `low` to `high`.
    let range = |axis: usize, low: f64, high: f64| {
        let end = (high + 1.0).floor().clamp(0.0, volume.size[axis] as f64) as usize;
        low.ceil().max(0.0) as usize..end
    };
    let around = |axis: usize| range(axis, mean[axis] - reach[axis], mean[axis] + reach[axis]);
    // Along a row u moves by this much per voxel, and |u|² ≤ 1 holds between the roots of a parabola.
    let step = whitening.x_axis;
    let (mut sum, mut count) = (0.0, 0u32);
    for z in around(2) {
        for y in around(1) {
            let start = whitening * DVec3::new(0.0, y as f64 - mean.y, z as f64 - mean.z);
            let middle = -start.dot(step) / step.length_squared();
            let inside = 1.0 - (start + step * middle).length_squared();
            if inside < 0.0 {
                continue;
            }
            let half = (inside / step.length_squared()).sqrt();
            for x in range(0, mean.x + middle - half, mean.x + middle + half) {
                let sample = volume.samples[volume.index(x, y, z)];
                if sample.is_finite() {
                    sum += f64::from(sample);
                    count += 1;
                }
            }
        }
    }
    (count > 0).then(|| (sum / f64::from(count)) as f32)
}
