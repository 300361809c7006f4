//! The visibility mask of a picture: the corners that a headset's lenses hide, or what another picture
//! covers. Modes of splats spend nothing on hidden patches.
//!
//! Hidden areas are triangles in tangents of the view (x/z to the right, y/z upwards), as headsets give them.
//! A picture has 64 x 64 patches, whatever its size in pixels; a patch is hidden if triangles cover all of
//! it. What remains of a patch is cut exactly, triangle by triangle, into convex pieces, so that triangles
//! may overlap and seams between them do not matter.

use glam::DVec2;
use shaders_glsl::types::{PATCH_WORDS, PATCHES};

use super::camera::Fov;

/// A triangle in tangents of the view.
pub type Triangle = [DVec2; 3];

/// Greatest part of a hidden patch that triangles may leave uncovered: more than the rounding of seams in 32
/// bits, far less than a pixel.
const LEFT: f64 = 1e-4;

/// The patches of a picture that no eye sees.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct VisibilityMask {
    pub(super) words: [u32; PATCH_WORDS],
}

impl Default for VisibilityMask {
    /// Returns the mask of a picture that is seen in full.
    fn default() -> Self {
        VisibilityMask { words: [0; PATCH_WORDS] }
    }
}

impl VisibilityMask {
    /// Creates the mask of a picture that covers `fov`: the hidden patches lie in the triangles. Triangles
    /// without an area, or with corners that are not finite, cover nothing.
    pub fn of(fov: &Fov, triangles: &[Triangle]) -> Self {
        let edge = PATCHES as f64;
        let zero = DVec2::new(fov.left, fov.up);
        let size = DVec2::new(fov.right, fov.down) - zero;
        let placed: Vec<Triangle> = triangles
            .iter()
            .map(|triangle| turned(triangle.map(|t| (t - zero) / size * edge)))
            .filter(|t| t.iter().all(|p| p.is_finite()) && area(t) > 0.0)
            .collect();
        let mut mask = VisibilityMask::default();
        for y in 0..PATCHES {
            for x in 0..PATCHES {
                let low = DVec2::new(x as f64, y as f64);
                if covered(low, &placed) {
                    mask.words[2 * y + x / 32] |= 1 << (x % 32);
                }
            }
        }
        mask
    }

    /// Returns true if a patch, counted from the upper left corner of the picture, is hidden.
    pub fn at(&self, [x, y]: [usize; 2]) -> bool {
        self.words[2 * y + x / 32] >> (x % 32) & 1 == 1
    }

    /// Returns the part of the picture that is hidden, 0 to 1.
    pub fn share(&self) -> f64 {
        let count: u32 = self.words.iter().map(|word| word.count_ones()).sum();
        f64::from(count) / (PATCHES * PATCHES) as f64
    }
}

/// Returns true if triangles cover the square from `low` to 1 beyond it along both axes.
fn covered(low: DVec2, triangles: &[Triangle]) -> bool {
    let high = low + 1.0;
    let mut left = vec![vec![low, DVec2::new(high.x, low.y), high, DVec2::new(low.x, high.y)]];
    for triangle in triangles {
        let [a, b, c] = *triangle;
        let beside = a.min(b).min(c).cmpge(high).any() || a.max(b).max(c).cmple(low).any();
        if !beside {
            left = left.iter().flat_map(|piece| outside(piece, triangle)).collect();
        }
    }
    left.iter().map(|piece| area(piece)).sum::<f64>() < LEFT
}

/// Returns the part of a convex piece that lies outside a triangle, in convex pieces: edge by edge the part
/// beyond it.
fn outside(piece: &[DVec2], triangle: &Triangle) -> Vec<Vec<DVec2>> {
    let mut rest = piece.to_vec();
    let mut out = Vec::new();
    for k in 0..3 {
        let (from, to) = (triangle[k], triangle[(k + 1) % 3]);
        out.push(within(&rest, to, from));
        rest = within(&rest, from, to);
    }
    out.retain(|piece| area(piece) > 0.0);
    out
}

/// Returns the part of a convex piece that lies on the inner side of an edge of a triangle with a positive
/// `area`.
fn within(piece: &[DVec2], from: DVec2, to: DVec2) -> Vec<DVec2> {
    let side = |p: DVec2| (to - from).perp_dot(p - from);
    let mut out = Vec::with_capacity(piece.len() + 1);
    for (k, &p) in piece.iter().enumerate() {
        let q = piece[(k + 1) % piece.len()];
        let (s, t) = (side(p), side(q));
        if s >= 0.0 {
            out.push(p);
        }
        if s * t < 0.0 {
            out.push(p.lerp(q, s / (s - t)));
        }
    }
    out
}

/// Returns the area of a polygon; negative if its corners go round the other way.
fn area(polygon: &[DVec2]) -> f64 {
    let next = polygon.iter().cycle().skip(1);
    polygon.iter().zip(next).map(|(p, q)| p.perp_dot(*q)).sum::<f64>() * 0.5
}

/// Returns the triangle with its corners in the order that makes its area positive.
fn turned([a, b, c]: Triangle) -> Triangle {
    if area(&[a, b, c]) < 0.0 { [a, c, b] } else { [a, b, c] }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FOV: Fov = Fov { left: -1.2, right: 0.8, up: 0.9, down: -1.1 };

    /// Returns a rectangle of tangents as two triangles that go round in different ways.
    fn rectangle(low: DVec2, high: DVec2) -> [Triangle; 2] {
        let (a, b) = (DVec2::new(high.x, low.y), DVec2::new(low.x, high.y));
        [[low, a, b], [high, a, b]]
    }

    /// Returns the mask of a rectangle of patches.
    fn patches([x0, y0]: [usize; 2], [x1, y1]: [usize; 2]) -> VisibilityMask {
        let mut mask = VisibilityMask::default();
        for (y, x) in (y0..y1).flat_map(|y| (x0..x1).map(move |x| (y, x))) {
            mask.words[2 * y + x / 32] |= 1 << (x % 32);
        }
        mask
    }

    /// Returns the tangents of a place of the picture, given in patches from its upper left corner.
    fn tangents(x: f64, y: f64) -> DVec2 {
        let part = DVec2::new(x, y) / PATCHES as f64;
        DVec2::new(FOV.left + (FOV.right - FOV.left) * part.x, FOV.up + (FOV.down - FOV.up) * part.y)
    }

    #[test]
    fn what_triangles_cover_is_hidden_and_no_more() {
        let nothing: &[Triangle] = &[];
        assert_eq!(VisibilityMask::of(&FOV, nothing), VisibilityMask::default());
        // Across the word, to the picture's edge, and a part of a patch more, which does not count.
        let low = rectangle(tangents(20.0, 10.0), tangents(41.0, 64.5));
        assert_eq!(VisibilityMask::of(&FOV, &low), patches([20, 10], [41, 64]));
        let more = rectangle(tangents(19.1, 9.1), tangents(41.9, 70.0));
        assert_eq!(VisibilityMask::of(&FOV, &more), patches([20, 10], [41, 64]));
        let all = rectangle(DVec2::splat(-9.0), DVec2::splat(9.0));
        assert_eq!(VisibilityMask::of(&FOV, &all).share(), 1.0);
        // A seam through patches, and triangles on top of each other.
        let two = [
            rectangle(tangents(4.0, 4.0), tangents(8.3, 9.0)),
            rectangle(tangents(8.3, 4.0), tangents(12.0, 9.0)),
        ];
        let over = [two[0], two[1], two[0]].concat();
        assert_eq!(VisibilityMask::of(&FOV, &over), patches([4, 4], [12, 9]));
        let line = [tangents(0.0, 0.0), tangents(30.0, 30.0), tangents(60.0, 60.0)];
        let broken = [tangents(0.0, 0.0), tangents(64.0, 0.0), DVec2::splat(f64::NAN)];
        assert_eq!(VisibilityMask::of(&FOV, &[line, broken]), VisibilityMask::default());
        let none = Fov { right: FOV.left, ..FOV };
        assert_eq!(VisibilityMask::of(&none, &all), VisibilityMask::default(), "a field without a width");
    }

    #[test]
    fn no_hidden_patch_has_a_place_outside_of_all_triangles() {
        let round = |k: usize| (k as f64 / 24.0 * std::f64::consts::TAU).sin_cos();
        let rim = |k: usize| {
            let (s, c) = round(k);
            tangents(32.0 + 31.0 * c, 32.0 + 31.0 * s)
        };
        let far = |k: usize| {
            let (s, c) = round(k);
            tangents(32.0 + 99.0 * c, 32.0 + 99.0 * s)
        };
        let ring: Vec<Triangle> =
            (0..24).flat_map(|k| [[rim(k), rim(k + 1), far(k)], [far(k), far(k + 1), rim(k + 1)]]).collect();
        let mask = VisibilityMask::of(&FOV, &ring);
        assert!((0.15..0.25).contains(&mask.share()), "{}", mask.share());
        for (y, x) in (0..PATCHES).flat_map(|y| (0..PATCHES).map(move |x| (y, x))) {
            let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]];
            let away = |[dx, dy]: [f64; 2]| (x as f64 + dx - 32.0).hypot(y as f64 + dy - 32.0);
            let nearest = corners.map(away).into_iter().fold(f64::INFINITY, f64::min);
            let inner = 31.0 * (std::f64::consts::PI / 24.0).cos();
            assert!(!mask.at([x, y]) || nearest > inner - 1e-3, "{x}, {y}");
            assert!(mask.at([x, y]) || nearest < 31.0, "{x}, {y}: {nearest}");
        }
    }
}
