//! How large splats are and how far they reach.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::splat::{Activations, Splat};

/// Most cells of the grid that intervals are found with.
const MOST_CELLS: f64 = 4e6;

/// Returns the standard deviation of the middle splat along its shortest axis; 1 without splats.
pub(super) fn middle_sigma(splats: &[Splat]) -> f64 {
    let mut shortest: Vec<f32> =
        splats.iter().map(|s| s.scale().into_iter().fold(f32::INFINITY, f32::min)).collect();
    let middle = shortest.len() / 2;
    match shortest.is_empty() {
        true => 1.0,
        false => f64::from(*shortest.select_nth_unstable_by(middle, f32::total_cmp).1),
    }
}

/// Returns the half sizes of the boxes around the supports, in the unit of the splats.
pub(super) fn reaches(splats: &[Splat], support_q: f64) -> Vec<Vec3> {
    splats
        .par_iter()
        .map(|splat| {
            let axes = splat.axes();
            let scale = DVec3::from_array(splat.scale().map(f64::from));
            let squares = (0..3).map(|k| (axes.col(k) * scale[k]).powf(2.0)).sum::<DVec3>();
            (squares * support_q).powf(0.5).as_vec3()
        })
        .collect()
}

/// Returns the bounds of the field within the support of each splat: least and greatest intensity of all
/// splats whose boxes share a cell of a regular grid with its own.
pub(super) fn intervals(splats: &[Splat], reach: &[Vec3]) -> Vec<[f32; 2]> {
    let mut sizes: Vec<f32> = reach.iter().map(|r| r.max_element()).collect();
    if sizes.is_empty() {
        return Vec::new();
    }
    let middle = sizes.len() / 2;
    let typical = *sizes.select_nth_unstable_by(middle, f32::total_cmp).1;
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for splat in splats {
        let mean = Vec3::from_array(splat.mean);
        (low, high) = (low.min(mean), high.max(mean));
    }
    // What reaches beyond the box of the centres falls into its outermost cells.
    let extent = high - low;
    let volume =
        f64::from(extent.x + typical) * f64::from(extent.y + typical) * f64::from(extent.z + typical);
    let edge = typical.max((volume / MOST_CELLS).cbrt() as f32).max(f32::MIN_POSITIVE);
    let cells = (extent / edge).floor().as_uvec3() + 1;
    let span = |i: usize| {
        let mean = Vec3::from_array(splats[i].mean);
        let at = |x: Vec3| ((x - low) / edge).floor().max(Vec3::ZERO).as_uvec3().min(cells - 1);
        (at(mean - reach[i]), at(mean + reach[i]))
    };
    let each = |i: usize, visit: &mut dyn FnMut(usize)| {
        let (from, to) = span(i);
        for z in from.z..=to.z {
            for y in from.y..=to.y {
                for x in from.x..=to.x {
                    visit(((z * cells.y + y) * cells.x + x) as usize);
                }
            }
        }
    };
    let join = |a: [f32; 2], b: [f32; 2]| [a[0].min(b[0]), a[1].max(b[1])];
    let mut bounds = vec![[f32::INFINITY, f32::NEG_INFINITY]; (cells.x * cells.y * cells.z) as usize];
    for (i, splat) in splats.iter().enumerate() {
        each(i, &mut |cell| bounds[cell] = join(bounds[cell], [splat.intensity; 2]));
    }
    (0..splats.len())
        .into_par_iter()
        .map(|i| {
            let mut own = [splats[i].intensity; 2];
            each(i, &mut |cell| own = join(own, bounds[cell]));
            own
        })
        .collect()
}
