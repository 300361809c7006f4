//! `splat_bounds`: the footprint of a splat and the number of bricks that its box touches.

use glam::{DMat3, DVec3};

use super::pairs::touched_slots;
use super::{Footprint, Samples, Splat};
use splat::Kernel;

/// Returns S⁻¹Rᵀ for a splat shaped in voxel space. It takes the distance from the mean to the whitened
/// distance along the splat's own axes.
pub fn whitening(splat: &Splat) -> DMat3 {
    stretched_whitening(splat, DVec3::ONE)
}

/// Returns S⁻¹RᵀD⁻¹ with D = diag(`stretch`): voxels along each axis per unit of the space in which the splat
/// has its shape.
pub fn stretched_whitening(splat: &Splat, stretch: DVec3) -> DMat3 {
    let inverse_scale = (-splat.log_scale).exp();
    let rotation = DMat3::from_quat(splat.rotation).transpose();
    DMat3::from_diagonal(inverse_scale) * rotation * DMat3::from_diagonal(stretch.recip())
}

/// Returns α.
pub fn opacity(splat: &Splat) -> f64 {
    1.0 / (1.0 + (-splat.opacity_logit).exp())
}

/// Returns a of w = a κ(q): α times the kernel's peak.
pub fn amplitude(splat: &Splat, kernel: Kernel) -> f64 {
    opacity(splat) * kernel.peak(splat.log_scale.to_array())
}

/// Returns the upper triangular T with |T d| = |M d| for every d: the R of a QR decomposition of M, its
/// diagonal positive.
pub fn triangular(m: &DMat3) -> DMat3 {
    // Modified Gram-Schmidt: column k of T holds the parts of column k of M along the directions found so
    // far.
    let mut columns = [m.x_axis, m.y_axis, m.z_axis];
    let mut t = [DVec3::ZERO; 3];
    for k in 0..3 {
        let length = columns[k].length();
        let direction = columns[k] / length;
        t[k][k] = length;
        for j in k + 1..3 {
            let along = direction.dot(columns[j]);
            t[j][k] = along;
            columns[j] -= along * direction;
        }
    }
    DMat3::from_cols(t[0], t[1], t[2])
}

/// Returns the half size of the axis-aligned box around the ellipsoid q = support: √(support · Σ_kk) on each
/// axis.
pub fn extent(splat: &Splat, support_q: f64) -> DVec3 {
    let axes = DMat3::from_quat(splat.rotation) * DMat3::from_diagonal(splat.log_scale.exp());
    let variance = axes.x_axis * axes.x_axis + axes.y_axis * axes.y_axis + axes.z_axis * axes.z_axis;
    (support_q * variance).map(f64::sqrt)
}

/// Returns the footprint of a splat that is shaped in voxel space.
pub fn footprint(splat: &Splat, kernel: Kernel) -> Footprint {
    stretched_footprint(splat, kernel, DVec3::ONE)
}

/// Returns the footprint of a splat that is shaped in a space whose unit is `stretch` voxels along each axis.
pub fn stretched_footprint(splat: &Splat, kernel: Kernel, stretch: DVec3) -> Footprint {
    Footprint {
        mean: splat.mean,
        amplitude: amplitude(splat, kernel),
        whitening: triangular(&stretched_whitening(splat, stretch)),
        intensity: splat.intensity,
        extent: (stretch * extent(splat, kernel.support_q())).min(DVec3::splat(kernel.row().reach)),
    }
}

/// Returns the number of bricks of the chunk that the box of a footprint, wider by `margin` voxels on each
/// side, touches.
pub fn brick_count(footprint: &Footprint, samples: &Samples, margin: f64) -> usize {
    touched_slots(footprint, samples, margin).len()
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;

    #[test]
    fn the_triangular_whitening_measures_the_same_distance() {
        for (i, log_scale) in
            [DVec3::ZERO, DVec3::new(2.0, -1.0, 0.5), DVec3::new(-4.0, 4.0, 0.0)].iter().enumerate()
        {
            let splat = Splat {
                mean: DVec3::ZERO,
                opacity_logit: 0.0,
                rotation: DQuat::from_xyzw(0.3, -0.4, 0.1 * i as f64, 0.8).normalize(),
                log_scale: *log_scale,
                intensity: 0.0,
            };
            let m = whitening(&splat);
            let t = triangular(&m);
            assert_eq!((t.x_axis.y, t.x_axis.z, t.y_axis.z), (0.0, 0.0, 0.0), "T is upper triangular");
            assert!(t.x_axis.x > 0.0 && t.y_axis.y > 0.0 && t.z_axis.z > 0.0, "its diagonal is positive");
            for d in [DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(1.0, -2.0, 3.0)] {
                let (got, want) = ((t * d).length_squared(), (m * d).length_squared());
                assert!((got - want).abs() <= 1e-10 * want, "{got} for {want}");
            }
            // The box touches the ellipsoid: the farthest point along x has q = support.
            let e = extent(&splat, 6.0);
            let covariance = m.inverse() * m.inverse().transpose();
            let farthest = covariance.x_axis / covariance.x_axis.x * e.x;
            assert!(((m * farthest).length_squared() - 6.0).abs() < 1e-8);
        }
    }
}
