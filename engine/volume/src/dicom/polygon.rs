//! Polygons in the plane of a slice, in voxels.

use glam::DVec2;

/// Rounding of places that are written as decimal numbers, voxels.
pub(super) const ROUNDING: f64 = 1e-3;

/// A closed polygon, which may touch itself: a keyhole leads from an outline to a hole and back.
pub(super) struct Polygon {
    points: Vec<DVec2>,
    /// Corners of the box around it.
    pub low: DVec2,
    pub high: DVec2,
}

impl Polygon {
    /// Creates a polygon of points, at least one.
    pub fn new(points: Vec<DVec2>) -> Self {
        let low = points.iter().copied().fold(DVec2::INFINITY, DVec2::min);
        let high = points.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max);
        Polygon { points, low, high }
    }

    fn edges(&self) -> impl Iterator<Item = [DVec2; 2]> + '_ {
        let previous = self.points.iter().cycle().skip(self.points.len() - 1);
        previous.zip(&self.points).map(|(&a, &b)| [a, b])
    }

    /// Returns where the edges cross a row, in no order. An edge counts with its lower end only.
    pub fn crossings(&self, row: f64) -> impl Iterator<Item = f64> + '_ {
        self.edges()
            .filter(move |[a, b]| (a.y <= row) != (b.y <= row))
            .map(move |[a, b]| a.x + (row - a.y) / (b.y - a.y) * (b.x - a.x))
    }

    /// Calls `add` for the pixels of a slice of this size whose centres are on an edge.
    pub fn edge_pixels(&self, size: [usize; 2], mut add: impl FnMut(usize)) {
        self.edges().for_each(|edge| on_edge(edge, size, |column, row| add(column + size[0] * row)));
    }

    /// Returns true if a point is inside by the even-odd rule.
    fn contains(&self, point: DVec2) -> bool {
        self.crossings(point.y).filter(|&x| x > point.x).count() % 2 == 1
    }

    /// Returns true if a point is on an edge.
    fn touches(&self, point: DVec2) -> bool {
        self.edges().any(|[a, b]| {
            let along = b - a;
            let share = ((point - a).dot(along) / along.length_squared()).clamp(0.0, 1.0);
            let nearest = if along == DVec2::ZERO { a } else { a + share * along };
            nearest.distance(point) <= ROUNDING
        })
    }

    /// Returns true if the polygon lies wholly within another one, whose edges it may touch: no edges cross, no point is
    /// outside, and what it encloses is enclosed there.
    pub fn is_within(&self, other: &Polygon) -> bool {
        let margin = DVec2::splat(ROUNDING);
        if (self.low + margin).cmplt(other.low).any() || (self.high - margin).cmpgt(other.high).any() {
            return false;
        }
        let inside = |&point: &DVec2| other.touches(point) || other.contains(point);
        self.points.iter().all(inside)
            && !self.edges().any(|edge| other.edges().any(|own| cross(edge, own)))
            && self.inner_point().is_some_and(|point| other.contains(point))
    }

    /// Returns a point inside: midway through the widest part of a row, of some rows the one where that is widest.
    fn inner_point(&self) -> Option<DVec2> {
        const ROWS: usize = 8;
        let height = self.high.y - self.low.y;
        let spans = (0..ROWS).flat_map(|i| {
            // Not at a place where points are likely.
            let row = self.low.y + height * (i as f64 + 0.4871) / ROWS as f64;
            let mut crossings: Vec<f64> = self.crossings(row).collect();
            crossings.sort_by(f64::total_cmp);
            let middle = move |pair: &[f64]| (pair[1] - pair[0], DVec2::new((pair[0] + pair[1]) / 2.0, row));
            crossings.chunks_exact(2).map(middle).collect::<Vec<_>>()
        });
        spans.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, point)| point)
    }
}

/// Returns true if two edges cross, by more than rounding.
fn cross([a, b]: [DVec2; 2], [c, d]: [DVec2; 2]) -> bool {
    // Distances of a point from the line through two others, to either side.
    let side = |from: DVec2, to: DVec2, point: DVec2| {
        (to - from).perp_dot(point - from) / (to - from).length().max(f64::MIN_POSITIVE)
    };
    let apart = |x: f64, y: f64| x.min(y) < -ROUNDING && x.max(y) > ROUNDING;
    apart(side(a, b, c), side(a, b, d)) && apart(side(c, d, a), side(c, d, b))
}

/// Calls `add` for the pixels of a slice of this size whose centres are on an edge.
fn on_edge([a, b]: [DVec2; 2], size: [usize; 2], mut add: impl FnMut(usize, usize)) {
    // Along the longer side of the edge there is at most one pixel for each step.
    let along = usize::from((b - a).abs().y > (b - a).abs().x);
    let across = 1 - along;
    let length = b[along] - a[along];
    let last = size.map(|n| n as f64 - 1.0);
    let end = (a[along].max(b[along]) + ROUNDING).floor().min(last[along]);
    let mut step = (a[along].min(b[along]) - ROUNDING).ceil().max(0.0);
    while step <= end {
        let share = if length == 0.0 { 0.0 } else { ((step - a[along]) / length).clamp(0.0, 1.0) };
        let at = a[across] + share * (b[across] - a[across]);
        let pixel = at.round();
        if (at - pixel).abs() <= ROUNDING && (0.0..=last[across]).contains(&pixel) {
            let mut place = [0; 2];
            (place[along], place[across]) = (step as usize, pixel as usize);
            add(place[0], place[1]);
        }
        step += 1.0;
    }
}
