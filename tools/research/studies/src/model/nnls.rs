//! Non-negative least squares (Lawson and Hanson 1974, chapter 23) on the normal equations, for a handful of
//! unknowns.

/// Most steps, after which the solution stays as it is. Each step frees an unknown, and may fix others at 0
/// again.
const MOST_STEPS: usize = 200;
/// Size, relative to the scale of the problem, that a gradient or an unknown must exceed so as not to count
/// as a rounding error; also the ridge of [`solve`].
const TINY: f64 = 1e-10;

/// Returns the x ≥ 0 that minimises |A x − y|², where `rows` are the rows of A. Columns that are zero
/// everywhere get 0.
///
/// # Panics
/// Panics if rows differ in length or are not as many as `y` has numbers.
pub fn nnls(rows: &[Vec<f64>], y: &[f64]) -> Vec<f64> {
    assert_eq!(rows.len(), y.len(), "a row for each number");
    let Some(n) = rows.first().map(Vec::len) else { return Vec::new() };
    assert!(rows.iter().all(|row| row.len() == n), "rows of one length");
    // Columns are scaled to length 1: the units of the terms differ by many powers of ten.
    let norms: Vec<f64> = (0..n).map(|k| rows.iter().map(|row| row[k].powi(2)).sum::<f64>().sqrt()).collect();
    let inverse: Vec<f64> = norms.iter().map(|&l| if l > 0.0 { 1.0 / l } else { 0.0 }).collect();
    let dot = |i: usize, j: usize| rows.iter().map(|r| r[i] * r[j]).sum::<f64>() * inverse[i] * inverse[j];
    let gram: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| dot(i, j)).collect()).collect();
    let target: Vec<f64> =
        (0..n).map(|k| rows.iter().zip(y).map(|(r, y)| r[k] * y).sum::<f64>() * inverse[k]).collect();
    let scale = y.iter().map(|y| y * y).sum::<f64>().sqrt();
    let mut x = vec![0.0; n];
    let mut free = vec![false; n];
    for _ in 0..MOST_STEPS {
        let slope = |k: usize| target[k] - (0..n).map(|j| gram[k][j] * x[j]).sum::<f64>();
        let best =
            (0..n).filter(|&k| !free[k] && norms[k] > 0.0).max_by(|&a, &b| slope(a).total_cmp(&slope(b)));
        let Some(taken) = best.filter(|&k| slope(k) > TINY * scale) else { break };
        free[taken] = true;
        loop {
            let wanted = solve(&gram, &target, &free);
            // Moves as far as no unknown becomes negative; unknowns that reach zero there are fixed.
            let part = (0..n)
                .filter(|&k| free[k] && wanted[k] <= 0.0)
                .map(|k| x[k] / (x[k] - wanted[k]))
                .fold(1.0, f64::min);
            for k in 0..n {
                x[k] += part * (wanted[k] - x[k]);
            }
            if part >= 1.0 {
                break;
            }
            for k in 0..n {
                if free[k] && x[k] <= TINY * scale {
                    (free[k], x[k]) = (false, 0.0);
                }
            }
        }
    }
    x.iter().zip(&inverse).map(|(x, inverse)| x * inverse).collect()
}

/// Returns the unconstrained solution over the `free` columns, with 0 in the others. It uses Gaussian
/// elimination with a ridge, which keeps linearly dependent columns apart.
fn solve(gram: &[Vec<f64>], target: &[f64], free: &[bool]) -> Vec<f64> {
    let at: Vec<usize> = (0..free.len()).filter(|&k| free[k]).collect();
    let n = at.len();
    let mut m: Vec<Vec<f64>> = at
        .iter()
        .map(|&i| {
            at.iter().map(|&j| gram[i][j] + if i == j { TINY } else { 0.0 }).chain([target[i]]).collect()
        })
        .collect();
    for k in 0..n {
        let pivot = (k..n).max_by(|&a, &b| m[a][k].abs().total_cmp(&m[b][k].abs())).unwrap_or(k);
        m.swap(k, pivot);
        let row = m[k].clone();
        for below in &mut m[k + 1..] {
            let factor = below[k] / row[k];
            below.iter_mut().zip(&row).skip(k).for_each(|(b, r)| *b -= factor * r);
        }
    }
    let mut x = vec![0.0; free.len()];
    for k in (0..n).rev() {
        let rest: f64 = (k + 1..n).map(|j| m[k][j] * x[at[j]]).sum();
        x[at[k]] = (m[k][n] - rest) / m[k][k];
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a number that looks random and is the same in every run.
    fn noise(n: usize) -> f64 {
        ((n as f64 * 12.9898).sin() * 43758.5453).fract().abs()
    }

    #[test]
    fn numbers_are_found_again_and_none_is_negative() {
        // Units as far apart as those of evaluations and of dispatches.
        let units = [1e9, 1e5, 1.0, 1e6];
        let rows: Vec<Vec<f64>> =
            (0..40).map(|i| (0..4).map(|k| units[k] * noise(i * 4 + k)).collect()).collect();
        let truth = [3e-9, 0.0, 2.5, 4e-6];
        let y: Vec<f64> = rows.iter().map(|r| r.iter().zip(truth).map(|(a, x)| a * x).sum()).collect();
        for (got, wanted) in nnls(&rows, &y).iter().zip(truth) {
            assert!((got - wanted).abs() <= 1e-6 * wanted.max(1e-9), "{got} {wanted}");
        }
        // One true number is negative: it gets 0, and the others are no worse than any other choice near by.
        let truth = [3e-9, -2e-5, 2.5, 4e-6];
        let y: Vec<f64> = rows.iter().map(|r| r.iter().zip(truth).map(|(a, x)| a * x).sum()).collect();
        let found = nnls(&rows, &y);
        let error = |x: &[f64]| -> f64 {
            rows.iter()
                .zip(&y)
                .map(|(r, y)| (r.iter().zip(x).map(|(a, x)| a * x).sum::<f64>() - y).powi(2))
                .sum()
        };
        assert!(found.iter().all(|&x| x >= 0.0) && found[1] == 0.0, "{found:?}");
        for k in 0..4 {
            for step in [-1e-3, 1e-3] {
                let mut other = found.clone();
                other[k] = (other[k] + step / units[k]).max(0.0);
                assert!(error(&other) >= error(&found) * (1.0 - 1e-9), "{k} {step}");
            }
        }
    }

    #[test]
    fn columns_that_say_nothing_or_the_same_do_no_harm() {
        let rows: Vec<Vec<f64>> = (1..9).map(|i| vec![0.0, f64::from(i), 2.0 * f64::from(i)]).collect();
        let y: Vec<f64> = (1..9).map(|i| 10.0 * f64::from(i)).collect();
        let x = nnls(&rows, &y);
        assert!(x[0] == 0.0 && (x[1] + 2.0 * x[2] - 10.0).abs() < 1e-6, "{x:?}");
        assert!(nnls(&[], &[]).is_empty());
        assert_eq!(nnls(&[vec![1.0]], &[-1.0]), [0.0]);
    }
}
