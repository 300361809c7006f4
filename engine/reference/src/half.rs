//! Numbers as mixed storage keeps them: the nearest f16. `include/storage.glsl` does the same on the bits.

/// Greatest f16.
pub const HALF_MAX: f64 = 65504.0;

/// Rounds to the nearest f16, ties to even; beyond the greatest f16 returns ±[`HALF_MAX`].
pub fn half(v: f64) -> f64 {
    let size = v.abs().min(HALF_MAX);
    if v.is_nan() || size == 0.0 {
        return v;
    }
    // Eleven digits from the first one on, but none behind the 24th place.
    let exponent = size.log2().floor().max(-14.0);
    let step = (exponent - 10.0).exp2();
    ((size / step).round_ties_even() * step).copysign(v)
}

/// Returns half a step of the f16 around a number: the most that [`half()`] changes it by, up to
/// [`HALF_MAX`].
pub fn half_step(v: f64) -> f64 {
    (v.abs().log2().floor().max(-14.0) - 11.0).exp2()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_go_to_the_nearest_half() {
        let rows = [
            (0.0, 0.0),
            (1.0, 1.0),
            (1.0 + 2f64.powi(-11), 1.0),                       // a tie, to even
            (1.0 + 3.0 * 2f64.powi(-11), 1.0 + 2f64.powi(-9)), // a tie, to even
            (-1.0 - 1.1 * 2f64.powi(-11), -1.0 - 2f64.powi(-10)),
            (2047.9, 2048.0),
            (65503.0, 65504.0),
            (1e30, HALF_MAX),
            (f64::NEG_INFINITY, -HALF_MAX),
            (2f64.powi(-24), 2f64.powi(-24)),
            (2f64.powi(-25), 0.0),
            (1.6 * 2f64.powi(-24), 2f64.powi(-23)),
            (2f64.powi(-14) * 0.9999, 2f64.powi(-14)),
        ];
        for (v, want) in rows {
            assert_eq!(half(v), want, "{v}");
            if v.abs() <= HALF_MAX {
                assert!((half(v) - v).abs() <= half_step(v), "{v}");
            }
        }
        assert!(half(f64::NAN).is_nan());
    }
}
