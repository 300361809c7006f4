//! Finds Pareto fronts.

/// Point with a cost and a gain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Cost; less is better.
    pub cost: f64,
    /// Gain; more is better.
    pub gain: f64,
}

/// Returns for each point whether it is on the front: no other gives as much for less, or more for as much.
/// Of equal points only the first is on the front. A point that has no finite cost, or whose gain is not a
/// number, is not on it.
pub fn front(points: &[Point]) -> Vec<bool> {
    let usable = |p: &Point| p.cost.is_finite() && !p.gain.is_nan();
    let beats = |i: usize, a: &Point, j: usize, b: &Point| {
        let equal = a.cost == b.cost && a.gain == b.gain;
        usable(a) && a.cost <= b.cost && a.gain >= b.gain && (!equal || i < j)
    };
    let beaten = |j: usize, b: &Point| points.iter().enumerate().any(|(i, a)| i != j && beats(i, a, j, b));
    points.iter().enumerate().map(|(j, b)| usable(b) && !beaten(j, b)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_another_beats_is_not_on_the_front() {
        let points = [
            (1.0, 10.0, true),
            (2.0, 12.0, true),
            // As dear as one that gives more; dearer than one that gives as much.
            (2.0, 11.0, false),
            (3.0, 12.0, false),
            (4.0, 30.0, true),
            // The same again.
            (1.0, 10.0, false),
            (f64::NAN, 50.0, false),
            (0.5, f64::NAN, false),
            // Equal pictures.
            (9.0, f64::INFINITY, true),
        ];
        let found = front(&points.map(|(cost, gain, _)| Point { cost, gain }));
        assert_eq!(found, points.map(|(.., wanted)| wanted));
        assert!(front(&[]).is_empty());
    }
}
