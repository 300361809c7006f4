//! Codebooks: 256 numbers for which bytes stand.

/// Numbers of a codebook.
pub const CODES: usize = 256;
/// Lloyd's rounds: more make the squared errors of normal values less than 1 % smaller.
const ROUNDS: usize = 20;
/// Values that differ by less, of their range, are taken for one: a rotation of harmonics and back rounds them.
const SAME: f32 = 1e-6;

/// Returns [`CODES`] ascending numbers that stand for `values`, the least and the greatest value among them: the values
/// themselves where there are no more, and else numbers that make the squared errors small. No value is farther from the
/// nearest number than half the gap that it lies in, or [`SAME`].
pub fn codebook(mut values: Vec<f32>) -> Vec<f32> {
    values.sort_unstable_by(f32::total_cmp);
    let (Some(&first), Some(&last)) = (values.first(), values.last()) else { return vec![0.0; CODES] };
    let mut distinct = values.clone();
    distinct.dedup_by(|next, kept| *next - *kept <= (last - first) * SAME);
    if distinct.len() <= CODES {
        distinct.resize(CODES, last);
        return distinct;
    }
    let sums = running(values.iter().map(|&v| f64::from(v)));
    // Squared errors are least where numbers are as dense as the cube root of the density of values (Panter and Dite, 1951):
    // between two values that is the power of −1/3 of their gap.
    let gap = |pair: &[f32]| f64::from(pair[1]) - f64::from(pair[0]);
    let shares = running(values.windows(2).map(|pair| gap(pair).powf(2.0 / 3.0)));
    let begin = |i: usize| {
        let share = shares[shares.len() - 1] * i as f64 / (CODES - 1) as f64;
        let after = shares.partition_point(|&own| own < share).clamp(1, values.len() - 1);
        let part = (share - shares[after - 1]) / (shares[after] - shares[after - 1]).max(f64::MIN_POSITIVE);
        f64::from(values[after - 1]) + gap(&values[after - 1..=after]) * part.clamp(0.0, 1.0)
    };
    let mut codes: Vec<f64> = (0..CODES).map(begin).collect();
    for _ in 0..ROUNDS {
        let end = |pair: &[f64]| values.partition_point(|&v| f64::from(v) < 0.5 * (pair[0] + pair[1]));
        let ends: Vec<usize> = codes.windows(2).map(end).collect();
        for (code, pair) in codes[1..].iter_mut().zip(ends.windows(2)) {
            if pair[0] < pair[1] {
                *code = (sums[pair[1]] - sums[pair[0]]) / (pair[1] - pair[0]) as f64;
            }
        }
    }
    let mut codes: Vec<f32> = codes.into_iter().map(|code| code as f32).collect();
    (codes[0], codes[CODES - 1]) = (first, last);
    codes
}

/// Returns 0 and the sums of the first one, two and more numbers.
fn running(numbers: impl Iterator<Item = f64>) -> Vec<f64> {
    let sums = numbers.scan(0.0, |sum, v| {
        *sum += v;
        Some(*sum)
    });
    std::iter::once(0.0).chain(sums).collect()
}

/// Returns the index of the number that is nearest to `value`, of at most [`CODES`] ascending ones.
pub fn nearest(codes: &[f32], value: f32) -> u8 {
    let above = codes.partition_point(|&code| code < value).min(codes.len() - 1);
    let below = above.saturating_sub(1);
    let is_below = (value - codes[below]).abs() <= (codes[above] - value).abs();
    (if is_below { below } else { above }) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_values_are_exact_and_many_within_half_a_gap() {
        for values in [vec![2.5], vec![1.0, -3.0, 1.0, 0.125], (0..256).map(|i| (i * i) as f32).collect()] {
            let codes = codebook(values.clone());
            assert_eq!(codes.len(), CODES);
            assert!(values.iter().all(|&v| codes[usize::from(nearest(&codes, v))] == v), "{codes:?}");
        }
        // Even values, and values of which most lie together and one far away.
        let even: Vec<f32> = (0..10_000).map(|i| i as f32 / 9999.0).collect();
        let peaked: Vec<f32> = even.iter().map(|&v| 100.0 * (2.0 * v - 1.0).powi(7)).collect();
        for (values, most) in [(even, 1.0 / 255.0 / 12f64.sqrt() * 1.02), (peaked, 0.15)] {
            let codes = codebook(values.clone());
            assert!(codes.is_sorted() && (codes[0], codes[255]) == (values[0], values[9999]));
            let mut squares = 0.0;
            for &v in &values {
                let i = usize::from(nearest(&codes, v));
                let error = (v - codes[i]).abs();
                assert!(codes.iter().all(|code| (v - code).abs() >= error), "{v}");
                squares += f64::from(error).powi(2);
            }
            let rms = (squares / values.len() as f64).sqrt();
            assert!(rms <= most, "{rms} of {most}");
        }
    }
}
