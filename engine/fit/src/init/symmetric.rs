//! Eigenvectors of symmetric 3×3 matrices, which glam does not have, by cyclic Jacobi rotations in f64 (Golub
//! & Van Loan, 8.5): exact to rounding also for equal and vanishing eigenvalues, where closed forms lose
//! their vectors.

use glam::{DMat3, DVec3};

/// Rotations stop when the elements beside the diagonal are below this share of the matrix.
const DIAGONAL: f64 = 1e-15;
/// Maximum number of sweeps; a 3×3 matrix settles in about four.
const MAX_SWEEPS: usize = 12;

/// Returns the eigenvalues of the symmetric matrix `m` by ascending magnitude, and an orthonormal,
/// right-handed set of their eigenvectors as columns.
pub(super) fn eigen(m: &DMat3) -> (DVec3, DMat3) {
    let mut a = m.to_cols_array_2d();
    let mut vectors = [DVec3::X, DVec3::Y, DVec3::Z];
    let size = a.iter().flatten().map(|v| v * v).sum::<f64>().sqrt();
    for _ in 0..MAX_SWEEPS {
        let beside = a[0][1].abs().max(a[0][2].abs()).max(a[1][2].abs());
        if beside <= DIAGONAL * size {
            break;
        }
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if a[p][q] == 0.0 {
                continue;
            }
            let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
            let tangent = theta.signum() / (theta.abs() + theta.hypot(1.0));
            let cosine = 1.0 / tangent.hypot(1.0);
            let sine = tangent * cosine;
            let r = 3 - p - q;
            let (apq, arp, arq) = (a[p][q], a[r][p], a[r][q]);
            a[p][p] -= tangent * apq;
            a[q][q] += tangent * apq;
            a[p][q] = 0.0;
            a[q][p] = 0.0;
            a[r][p] = cosine * arp - sine * arq;
            a[p][r] = a[r][p];
            a[r][q] = sine * arp + cosine * arq;
            a[q][r] = a[r][q];
            let (vp, vq) = (vectors[p], vectors[q]);
            vectors[p] = cosine * vp - sine * vq;
            vectors[q] = sine * vp + cosine * vq;
        }
    }
    let mut order = [0, 1, 2];
    order.sort_by(|&i, &j| a[i][i].abs().total_cmp(&a[j][j].abs()));
    let [x, _, z] = order.map(|i| vectors[i]);
    (DVec3::from_array(order.map(|i| a[i][i])), DMat3::from_cols(x, z.cross(x), z))
}

#[cfg(test)]
mod tests {
    use glam::DQuat;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    use super::*;

    #[test]
    fn eigenvectors_are_found_again() {
        let mut rng = Pcg64::seed_from_u64(4);
        let mut unit = || rng.random_range(-1.0..1.0f64);
        for values in [
            [1.0, 2.0, 3.0],
            [-1.0, 2.0, -30.0],
            [0.0, 0.0, 5.0],
            [0.0, 0.0, 0.0],
            [2.0, 2.0, 2.0],
            [1e-9, 1.0, -1.0],
            [1e-20, 3e12, 1e30],
            [-7e-30, 8e-30, 9e-30],
        ] {
            for _ in 0..200 {
                let axes = DMat3::from_quat(DQuat::from_xyzw(unit(), unit(), unit(), unit()).normalize());
                let m = axes * DMat3::from_diagonal(DVec3::from_array(values)) * axes.transpose();
                // Symmetric to the bit, as the callers' matrices are.
                let m = (m + m.transpose()) * 0.5;
                let (found, vectors) = eigen(&m);
                let size = values.iter().fold(0.0f64, |s, v| s.max(v.abs()));
                for k in 0..3 {
                    assert!(
                        (found[k].abs() - values[k].abs()).abs() <= 1e-14 * size,
                        "{found} of {values:?}"
                    );
                    let error = m * vectors.col(k) - found[k] * vectors.col(k);
                    assert!(error.length() <= 1e-14 * size, "{values:?}: vector {k} off by {error}");
                }
                assert!((vectors.transpose() * vectors).abs_diff_eq(DMat3::IDENTITY, 1e-14));
                assert!((vectors.determinant() - 1.0).abs() < 1e-13);
            }
        }
    }
}
