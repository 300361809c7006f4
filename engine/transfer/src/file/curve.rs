//! Curves between two control points that are not straight lines.
//!
//! VTK gives every control point a midpoint and a sharpness, which bend the line to the next one (see
//! `vtkPiecewiseFunction`): the value half way between both is reached at the midpoint, and a sharpness from
//! 0 to 1 leads from the straight line over an S to a step. Straight lines and steps are kept exactly; an S,
//! and whatever else bends, is sampled.

/// Number of parts into which a curve is cut; the worst error of an S is below 1 percent of its height.
const PARTS: usize = 64;
/// VTK draws a straight line for a sharpness below the first of these, and a step for one above the second.
const STRAIGHT: f64 = 0.01;
const STEP: f64 = 0.99;
/// VTK keeps midpoints away from both ends by this much.
const MARGIN: f64 = 1e-5;

/// A control point as VTK has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node<V> {
    pub x: f64,
    pub value: V,
    /// Place between this node and the next at which half of the change is reached; 0.5 is straight.
    pub midpoint: f64,
    /// Sharpness of the change: 0 is a straight line, 1 a step.
    pub sharpness: f64,
}

impl<V> Node<V> {
    pub fn straight(x: f64, value: V) -> Self {
        Node { x, value, midpoint: 0.5, sharpness: 0.0 }
    }
}

/// Converts nodes, in any order, to points that straight lines join. `mix` returns the value at a share of
/// the way from one value to another. If `bent` is set, straight lines are sampled too, because `mix` (or
/// what is done to the points) is not linear.
pub fn straightened<V: Copy>(
    mut nodes: Vec<Node<V>>,
    bent: bool,
    mix: impl Fn(V, V, f64) -> V,
) -> Vec<(f64, V)> {
    if !nodes.is_sorted_by(|a, b| a.x.total_cmp(&b.x).is_le()) {
        tracing::warn!("the control points are not in order of intensity: sorted, as VTK does");
        nodes.sort_by(|a, b| a.x.total_cmp(&b.x));
    }
    let mut points = Vec::with_capacity(nodes.len());
    let mut before: Option<(f64, Node<V>)> = None;
    for node in nodes {
        let mut x = node.x;
        if let Some((from, previous)) = before {
            if is_step(from, x) {
                x = from;
            } else {
                for (place, share) in between(previous.midpoint, previous.sharpness, bent) {
                    points.push((from + (x - from) * place, mix(previous.value, node.value, share)));
                }
            }
        }
        points.push((x, node.value));
        before = Some((x, node));
    }
    points
}

/// Returns true if two intensities are meant to be one: Slicer cannot hold two points at one intensity, and
/// moves the second by the last bit.
fn is_step(low: f64, high: f64) -> bool {
    high - low <= 1e-15 * low.abs().max(1e-290)
}

/// Returns the next greater number, to which Slicer moves the second point of a step.
pub fn just_above(x: f64) -> f64 {
    // Never a subnormal number.
    if x == 0.0 { f64::MIN_POSITIVE } else { x.next_up() }
}

/// Returns the points between two nodes: the place of each, from 0 to 1, and its share of the second value.
fn between(midpoint: f64, sharpness: f64, bent: bool) -> Vec<(f64, f64)> {
    if sharpness > STEP {
        let midpoint = midpoint.clamp(0.0, 1.0);
        return vec![(midpoint, 0.0), (midpoint, 1.0)];
    }
    let midpoint = midpoint.clamp(MARGIN, 1.0 - MARGIN);
    if bent || sharpness >= STRAIGHT {
        // Even parts on both sides of the midpoint, so that it is met.
        let half = PARTS / 2;
        let places = (1..PARTS).map(|i| {
            if i < half {
                midpoint * i as f64 / half as f64
            } else {
                midpoint + (1.0 - midpoint) * (i - half) as f64 / half as f64
            }
        });
        return places.map(|place| (place, share_at(place, midpoint, sharpness))).collect();
    }
    if midpoint == 0.5 { Vec::new() } else { vec![(midpoint, 0.5)] }
}

/// Returns the share of the second value at `place` between two nodes, for a `sharpness` below that of a
/// step.
fn share_at(place: f64, midpoint: f64, sharpness: f64) -> f64 {
    let even = if place < midpoint {
        0.5 * place / midpoint
    } else {
        0.5 + 0.5 * (place - midpoint) / (1.0 - midpoint)
    };
    if sharpness < STRAIGHT {
        return even;
    }
    // The place is moved towards the ends, and a Hermite curve with ever flatter ends goes through it.
    let power = 1.0 + 10.0 * sharpness;
    let s = if even < 0.5 {
        0.5 * (2.0 * even).powf(power)
    } else {
        1.0 - 0.5 * (2.0 * (1.0 - even)).powf(power)
    };
    let hermite = s * s * (3.0 - 2.0 * s);
    let ends = s * (s - 1.0) * (2.0 * s - 1.0);
    (hermite + (1.0 - sharpness) * ends).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(nodes: &[(f64, f64, f64, f64)]) -> Vec<(f64, f64)> {
        let nodes =
            nodes.iter().map(|&(x, value, midpoint, sharpness)| Node { x, value, midpoint, sharpness });
        straightened(nodes.collect(), false, |a, b, share| a + (b - a) * share)
    }

    #[test]
    fn straight_lines_and_steps_are_exact() {
        assert_eq!(points(&[(10.0, 1.0, 0.5, 0.0), (0.0, 0.0, 0.5, 0.0)]), [(0.0, 0.0), (10.0, 1.0)]);
        assert_eq!(
            points(&[(0.0, 0.0, 0.25, 0.0), (8.0, 1.0, 0.5, 0.0)]),
            [(0.0, 0.0), (2.0, 0.5), (8.0, 1.0)]
        );
        assert_eq!(
            points(&[(0.0, 0.0, 0.25, 1.0), (8.0, 1.0, 0.5, 0.0)]),
            [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (8.0, 1.0)]
        );
        // What Slicer does to the second point of a step is undone; order at one place stays.
        for x in [0.0, -3024.0, 0.7, 1e9] {
            let step =
                [(x, 0.0, 0.5, 0.0), (just_above(x), 1.0, 0.5, 0.0), (x + 1.0 + x.abs(), 0.5, 0.5, 0.0)];
            assert_eq!(points(&step), [(x, 0.0), (x, 1.0), (x + 1.0 + x.abs(), 0.5)]);
        }
    }

    #[test]
    fn an_s_is_close_to_its_formula() {
        for (midpoint, sharpness) in [(0.5, 0.05), (0.5, 0.5), (0.2, 0.3), (0.9, 0.9)] {
            let all = points(&[(0.0, 0.0, midpoint, sharpness), (1.0, 1.0, 0.5, 0.0)]);
            assert_eq!(all.len(), PARTS + 1);
            let mut worst = 0f64;
            for pair in all.windows(2) {
                let ((x0, y0), (x1, y1)) = (pair[0], pair[1]);
                assert!(x0 < x1 && y0 <= y1);
                for k in 0..16 {
                    let t = f64::from(k) / 16.0;
                    let truth = share_at(x0 + (x1 - x0) * t, midpoint, sharpness);
                    worst = worst.max((y0 + (y1 - y0) * t - truth).abs());
                }
            }
            assert!(worst < 0.01, "midpoint {midpoint}, sharpness {sharpness}: {worst}");
            assert!(all.iter().any(|p| (p.1 - 0.5).abs() < 1e-12 && (p.0 - midpoint).abs() < 1e-12));
        }
        // The curve as VTK has it: at a quarter with sharpness 0.5, s = 0.5^7 = 1/128.
        let s = 1.0f64 / 128.0;
        let vtk = 3.0 * s * s - 2.0 * s * s * s + 0.5 * ((s * s * s - 2.0 * s * s + s) + (s * s * s - s * s));
        assert!((share_at(0.25, 0.5, 0.5) - vtk).abs() < 1e-15);
    }
}
