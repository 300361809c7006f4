//! Comparison of two lists of numbers: an absolute and a relative bound, and a share of outliers where a
//! threshold may fall either way. The worst error is always printed, so that a bound can be judged by the
//! measured errors.

/// Bound of the distance between two numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bound {
    /// |got - want| may be this much plus `relative` · |want|.
    pub absolute: f64,
    /// See `absolute`.
    pub relative: f64,
    /// Share of the numbers that may exceed this bound.
    pub outlier_share: f64,
    /// Absolute bound that outliers keep.
    pub outlier_limit: f64,
}

impl Bound {
    /// Creates a bound without outliers.
    pub const fn new(absolute: f64, relative: f64) -> Self {
        Bound { absolute, relative, outlier_share: 0.0, outlier_limit: 0.0 }
    }

    /// Returns the same bound, which up to `share` of the numbers may exceed as long as they keep the
    /// absolute bound `limit`.
    #[must_use]
    pub const fn outliers(self, share: f64, limit: f64) -> Self {
        Bound { outlier_share: share, outlier_limit: limit, ..self }
    }
}

/// Result of a comparison.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// Number of numbers that were compared.
    pub count: usize,
    /// Largest |got - want|.
    pub worst_absolute: f64,
    /// Largest |got - want| as a multiple of what the bound allows there; above 1 it is an outlier.
    pub worst: f64,
    /// Index, number and wanted number of `worst`.
    pub worst_at: (usize, f64, f64),
    /// Number of outliers: those that exceed the bound.
    pub outliers: usize,
    /// Number of outliers that exceed their own limit.
    pub beyond: usize,
}

/// Compares pairs (got, want). A NaN on either side agrees with nothing; equal infinities agree.
pub fn compare(bound: Bound, pairs: impl IntoIterator<Item = (f64, f64)>) -> Comparison {
    let mut report = Comparison {
        count: 0,
        worst_absolute: 0.0,
        worst: 0.0,
        worst_at: (0, 0.0, 0.0),
        outliers: 0,
        beyond: 0,
    };
    for (index, (got, want)) in pairs.into_iter().enumerate() {
        report.count += 1;
        if got == want {
            continue;
        }
        let error = (got - want).abs();
        let error = if error.is_nan() { f64::INFINITY } else { error };
        let allowed = bound.absolute + bound.relative * want.abs();
        let share = if allowed > 0.0 && allowed.is_finite() { error / allowed } else { f64::INFINITY };
        report.worst_absolute = report.worst_absolute.max(error);
        if share > report.worst {
            report.worst = share;
            report.worst_at = (index, got, want);
        }
        if share > 1.0 {
            report.outliers += 1;
            report.beyond += usize::from(error > bound.outlier_limit);
        }
    }
    report
}

impl Comparison {
    /// Returns true if the numbers agree within `bound`.
    pub fn holds(&self, bound: Bound) -> bool {
        self.beyond == 0 && self.outliers as f64 <= bound.outlier_share * self.count as f64
    }
}

/// Compares pairs (got, want), prints the worst error and panics if they do not agree within `bound`, or if
/// there are none to compare.
pub fn assert_close(what: &str, bound: Bound, pairs: impl IntoIterator<Item = (f64, f64)>) {
    let report = compare(bound, pairs);
    let (index, got, want) = report.worst_at;
    println!(
        "{what}: {} numbers, worst error {:.3} of the bound ({got:e} for {want:e} at {index}), {:.2e} absolute, \
         {} outliers",
        report.count, report.worst, report.worst_absolute, report.outliers
    );
    assert!(report.count > 0, "{what}: nothing was compared");
    assert!(report.holds(bound), "{what}: beyond {bound:?}: {report:?}");
}

#[cfg(test)]
mod tests {
    use super::*;

    fn holds(bound: Bound, pairs: &[(f64, f64)]) -> bool {
        compare(bound, pairs.iter().copied()).holds(bound)
    }

    #[test]
    fn absolute_and_relative_bounds_add() {
        let bound = Bound::new(0.1, 0.01);
        assert!(holds(bound, &[(1.1, 1.0), (0.1, 0.0), (101.0, 100.0), (-101.0, -100.0)]));
        assert!(!holds(bound, &[(1.12, 1.0)]));
        assert!(!holds(bound, &[(0.11, 0.0)]));
        assert!(!holds(bound, &[(101.2, 100.0)]));
        assert!(holds(Bound::new(0.0, 0.0), &[(2.0, 2.0), (0.0, -0.0)]));
        assert!(!holds(Bound::new(0.0, 0.0), &[(2.0, 2.0 + 1e-15)]));
    }

    #[test]
    fn outliers_are_few_and_limited() {
        let bound = Bound::new(1e-6, 0.0).outliers(0.25, 0.5);
        assert!(holds(bound, &[(0.0, 0.0), (0.0, 0.0), (0.0, 0.0), (0.4, 0.0)]));
        assert!(!holds(bound, &[(0.0, 0.0), (0.0, 0.0), (0.4, 0.0), (0.4, 0.0)]), "half is too many");
        assert!(!holds(bound, &[(0.0, 0.0), (0.0, 0.0), (0.0, 0.0), (0.6, 0.0)]), "one is too far off");
    }

    #[test]
    fn a_number_that_is_not_finite_agrees_with_itself_only_if_it_is_infinite() {
        let bound = Bound::new(1e9, 1.0);
        assert!(!holds(bound, &[(f64::NAN, 0.0)]));
        assert!(!holds(bound, &[(0.0, f64::NAN)]));
        assert!(!holds(bound, &[(f64::NAN, f64::NAN)]));
        assert!(!holds(bound, &[(f64::INFINITY, 1.0)]));
        assert!(!holds(bound, &[(1.0, f64::INFINITY)]));
        assert!(holds(bound, &[(f64::INFINITY, f64::INFINITY)]));
        assert!(!holds(bound.outliers(1.0, 1e300), &[(f64::NAN, 0.0)]), "nor as an outlier");
    }

    #[test]
    fn the_worst_is_reported() {
        let report = compare(Bound::new(1.0, 0.0), [(1.0, 1.0), (5.0, 2.0), (0.0, 0.5)]);
        assert_eq!((report.count, report.outliers, report.worst), (3, 1, 3.0));
        assert_eq!(report.worst_at, (1, 5.0, 2.0));
    }

    #[test]
    #[should_panic(expected = "nothing was compared")]
    fn comparing_nothing_is_an_error() {
        assert_close("nothing", Bound::new(1.0, 0.0), []);
    }
}
