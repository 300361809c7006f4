//! Splats that lie far from all others, as a fit or an editor leaves one now and then: a picture that has them in it
//! shows nothing else.

use glam::DVec3;

use super::Splat;

/// Fewest splats of which some can be far from the others.
const FEWEST: usize = 8;
/// One in so many splats may be far, and one of fewer.
const FAR_SHARE: usize = 100;
/// A splat is far if it lies so many times as far from the middle as the others do.
const FAR_TIMES: f64 = 10.0;

/// Returns the rows of splats that lie far from all others, ascending.
pub fn far_splats(splats: &[Splat]) -> Vec<usize> {
    if splats.len() < FEWEST {
        return Vec::new();
    }
    let middle: [f64; 3] = std::array::from_fn(|axis| {
        let mut places: Vec<f32> = splats.iter().map(|splat| splat.mean[axis]).collect();
        let half = places.len() / 2;
        f64::from(*places.select_nth_unstable_by(half, f32::total_cmp).1)
    });
    let middle = DVec3::from_array(middle);
    let distance = |splat: &Splat| (DVec3::from_array(splat.mean.map(f64::from)) - middle).length();
    let mut distances: Vec<f64> = splats.iter().map(distance).collect();
    let kept = splats.len() - 1 - (splats.len() / FAR_SHARE).max(1);
    let others = *distances.select_nth_unstable_by(kept, f64::total_cmp).1;
    let limit = FAR_TIMES * others;
    if limit == 0.0 {
        return Vec::new();
    }
    (0..splats.len()).filter(|&i| distance(&splats[i]) > limit).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(mean: [f32; 3]) -> Splat {
        Splat { mean, ..Splat::default() }
    }

    #[test]
    fn one_of_thirty_is_far_and_the_ends_of_a_leg_are_not() {
        let mut splats: Vec<Splat> =
            (0..30).map(|i| at([(i % 3) as f32, (i / 3) as f32 * 10.0, 900.0])).collect();
        assert!(far_splats(&splats).is_empty(), "a leg");
        for far in [1e4, -1e6, 1e30, f32::MAX] {
            splats.insert(7, at([0.0, far, 900.0]));
            assert_eq!(far_splats(&splats), [7], "{far}");
            splats.remove(7);
        }
        // Two parts of a body, one of them small.
        splats.extend((0..3).map(|i| at([i as f32, 1500.0, 900.0])));
        assert!(far_splats(&splats).is_empty(), "a part of a tenth");
        assert!(far_splats(&vec![at([1.0; 3]); 40]).is_empty(), "all in one place");
        assert!(far_splats(&[at([0.0; 3]), at([1e9; 3])]).is_empty(), "two are two");
    }
}
