//! The outline of a cutting plane: where it meets the box around the patient.

use engine::render::ClipPlane;
use glam::DVec3;

/// Half of the edge of the square that stands for a plane which does not meet the box, as a part of the box's
/// diagonal.
const BESIDE: f64 = 0.15;

/// Returns the corners of the polygon in which a plane meets a box from `low` to `high`, mm RAS, in their order
/// round it. Where the two do not meet, it is a square around the plane's point that is nearest to `at`, so
/// that the plane is seen beside the patient, too.
pub fn outline(plane: &ClipPlane, [low, high]: [DVec3; 2], at: DVec3) -> Vec<DVec3> {
    let normal = plane.normal;
    let above = |place: DVec3| normal.dot(place) - plane.offset;
    let (right, up) = normal.any_orthonormal_pair();
    let mut corners = Vec::with_capacity(6);
    for axis in 0..3 {
        let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
        for [i, j] in [[false, false], [false, true], [true, false], [true, true]] {
            let mut from = low;
            (from[a], from[b]) = (if i { high[a] } else { low[a] }, if j { high[b] } else { low[b] });
            let mut to = from;
            to[axis] = high[axis];
            let [before, after] = [above(from), above(to)];
            // An end that lies in the plane belongs to the edge that comes from above.
            if (before < 0.0) != (after < 0.0) {
                corners.push(from + (to - from) * (before / (before - after)));
            }
        }
    }
    if corners.len() < 3 {
        let nearest = at - normal * above(at);
        let half = BESIDE * (high - low).length();
        return [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
            .map(|[x, y]| nearest + (right * x + up * y) * half)
            .to_vec();
    }
    let middle = corners.iter().sum::<DVec3>() / corners.len() as f64;
    let turn = |place: &DVec3| (*place - middle).dot(up).atan2((*place - middle).dot(right));
    corners.sort_by(|one, other| turn(one).total_cmp(&turn(other)));
    corners
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOX: [DVec3; 2] = [DVec3::new(-10.0, 0.0, 100.0), DVec3::new(30.0, 20.0, 160.0)];

    fn plane(normal: DVec3, through: DVec3) -> ClipPlane {
        let normal = normal.normalize();
        ClipPlane { normal, offset: normal.dot(through) }
    }

    fn length(corners: &[DVec3]) -> f64 {
        let next = corners.iter().cycle().skip(1);
        corners.iter().zip(next).map(|(a, b)| a.distance(*b)).sum()
    }

    #[test]
    fn a_plane_across_the_box_is_a_rectangle() {
        let middle = (BOX[0] + BOX[1]) * 0.5;
        for (normal, around) in [(DVec3::X, 160.0), (DVec3::NEG_Y, 200.0), (DVec3::Z, 120.0)] {
            let corners = outline(&plane(normal, middle), BOX, DVec3::ZERO);
            assert_eq!(corners.len(), 4);
            assert!((length(&corners) - around).abs() < 1e-9, "in their order: {}", length(&corners));
        }
    }

    #[test]
    fn corners_lie_on_the_plane_and_on_the_box() {
        let middle = (BOX[0] + BOX[1]) * 0.5;
        for (normal, count) in [
            (DVec3::ONE / (BOX[1] - BOX[0]), 6),
            (DVec3::new(1.0, 1.0, 0.0), 4),
            (DVec3::new(0.1, 0.2, 1.0), 4),
        ] {
            let cut = plane(normal, middle);
            let corners = outline(&cut, BOX, DVec3::ZERO);
            assert_eq!(corners.len(), count, "{corners:?}");
            for corner in corners {
                assert!((cut.normal.dot(corner) - cut.offset).abs() < 1e-9);
                let on_face = (0..3).any(|i| corner[i] == BOX[0][i] || corner[i] == BOX[1][i]);
                let inside = corner.cmpge(BOX[0] - 1e-9).all() && corner.cmple(BOX[1] + 1e-9).all();
                assert!(on_face && inside, "{corner}");
            }
        }
    }

    #[test]
    fn beside_the_box_it_is_a_square_at_the_hand() {
        let hand = DVec3::new(200.0, 5.0, 120.0);
        let cut = plane(DVec3::X, DVec3::new(190.0, 0.0, 0.0));
        let corners = outline(&cut, BOX, hand);
        let middle = corners.iter().sum::<DVec3>() / 4.0;
        assert!(middle.distance(DVec3::new(190.0, 5.0, 120.0)) < 1e-9, "{middle}");
        let edge = 0.3 * (BOX[1] - BOX[0]).length();
        assert!(corners.len() == 4 && (length(&corners) - 4.0 * edge).abs() < 1e-9);
    }
}
