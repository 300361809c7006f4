//! More splats where the pictures ask for them.

use glam::{Mat3, Quat, Vec3};

use splat::{Activations, Splat};

/// Opacity below which a splat is given up, so that another can be split in its place.
const FAINT: f32 = 2.0 / 255.0;
/// Weight below which it is given up, in the mean one: it lies behind others from wherever it is seen.
const IDLE: f32 = 0.02;
/// Where the halves of a splat lie along its longest axis, and how long they are there, in its standard deviations. Both
/// together have its variance: 0.6² + 0.8² = 1.
const APART: f32 = 0.6;
const LENGTH: f32 = 0.8;

/// What becomes of the splats: for each of the new ones, the row that it comes from.
pub struct Split {
    pub splats: Vec<Splat>,
    pub rows: Vec<usize>,
}

/// Drops splats that can hardly be seen, and halves those of the greatest weights until there are `count`, or each is
/// halved. A half keeps the colour; its opacity is such that both together let as much pass as one did.
pub fn split(splats: &[Splat], weights: &[f32], count: usize) -> Split {
    let least = IDLE * weights.iter().filter(|weight| weight.is_finite()).sum::<f32>() / weights.len() as f32;
    let is_seen = |&i: &usize| splats[i].opacity() >= FAINT && weights[i] >= least;
    let mut kept: Vec<usize> = (0..splats.len()).filter(is_seen).collect();
    if kept.is_empty() {
        kept.push(0);
    }
    let mut order = kept.clone();
    // The row decides between equals, so that the result depends on nothing else.
    order.sort_by(|&a, &b| weights[b].total_cmp(&weights[a]).then(a.cmp(&b)));
    order.truncate(count.saturating_sub(kept.len()));
    let mut halved = vec![false; splats.len()];
    order.iter().for_each(|&i| halved[i] = true);
    let mut out = Split { splats: Vec::new(), rows: Vec::new() };
    for i in kept {
        let splat = splats[i];
        if !halved[i] {
            out.splats.push(splat);
            out.rows.push(i);
            continue;
        }
        let [w, x, y, z] = splat.rotation;
        let axes = Mat3::from_quat(Quat::from_xyzw(x, y, z, w).normalize());
        let longest = (0..3).fold(0, |a, b| if splat.log_scale[b] > splat.log_scale[a] { b } else { a });
        let step = axes.col(longest) * splat.log_scale[longest].exp() * APART;
        for side in [-1.0, 1.0] {
            let mut half = splat;
            half.mean = (Vec3::from_array(splat.mean) + step * side).to_array();
            half.log_scale[longest] += LENGTH.ln();
            half.set_opacity(1.0 - (1.0 - splat.opacity()).max(0.0).sqrt());
            out.splats.push(half);
            out.rows.push(i);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn splat(opacity: f32, scale: [f32; 3]) -> Splat {
        let mut splat =
            Splat { rotation: [1.0, 0.0, 0.0, 0.0], log_scale: scale.map(f32::ln), ..Splat::default() };
        splat.set_opacity(opacity);
        splat
    }

    #[test]
    fn the_heaviest_are_halved_along_their_longest_axis() {
        let mut splats = vec![splat(0.5, [1.0; 3]), splat(0.64, [1.0, 3.0, 2.0]), splat(0.001, [1.0; 3])];
        splats.push(splat(0.9, [1.0; 3]));
        let Split { splats: found, rows } = split(&splats, &[1.0, 2.0, 9.0, 0.01], 3);
        assert_eq!(rows, [0, 1, 1], "the faint one is gone, whatever its weight, and one that is not seen");
        assert_eq!(found[0], splats[0]);
        for (half, side) in found[1..].iter().zip([-1.0, 1.0]) {
            assert!((half.mean[1] - side * 1.8).abs() < 1e-6 && half.mean[0] == 0.0, "{:?}", half.mean);
            assert!((half.scale()[1] - 2.4).abs() < 1e-5 && (half.scale()[2] - 2.0).abs() < 1e-6);
            assert!((half.opacity() - 0.4).abs() < 1e-6, "0.6 · 0.6 passes, as 0.36 did");
        }
    }

    #[test]
    fn the_count_is_kept_to_and_never_none() {
        let splats = vec![splat(0.5, [1.0, 2.0, 1.0]); 10];
        let weights: Vec<f32> = (0..10).map(|i| 1.0 + i as f32).collect();
        for (count, found) in [(5, 10), (10, 10), (13, 13), (20, 20), (99, 20)] {
            assert_eq!(split(&splats, &weights, count).splats.len(), found);
        }
        assert_eq!(split(&splats, &weights, 11).rows.iter().filter(|&&row| row == 9).count(), 2);
        assert_eq!(split(&splats, &[0.0; 10], 10).splats.len(), 10, "nothing is known of any");
        assert_eq!(split(&[splat(0.001, [1.0; 3])], &[0.0], 5).rows, [0, 0]);
    }
}
