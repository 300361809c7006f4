//! How large splats are, how far they reach, and which intensities occur where they reach.

use glam::{DVec3, UVec3, Vec3};
use rayon::prelude::*;

use splat::{Activations, Splat, SplatSet, far_splats};

/// Greatest number of cells of the grid that finds intervals.
const MOST_CELLS: f64 = 4e6;
/// One in so many splats, at either end of an axis, may lie far from all others.
const FAR_SHARE: usize = 200;
/// q at half a standard deviation.
const CORE_Q: f64 = 0.25;

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

/// Returns the half size of the box around each splat's support, in the unit of the splats.
pub(super) fn reaches(splats: &[Splat], support_q: f64) -> Vec<Vec3> {
    splats.par_iter().map(|splat| splat.reach(support_q).as_vec3()).collect()
}

/// Returns the corners of the box around the splats of a set without their tails and without those that lie far from all
/// others, mm RAS: what a picture of all of them frames ([`Scene::bounds`](super::Scene::bounds)).
pub fn bounds(set: &SplatSet) -> [DVec3; 2] {
    let corners = match of_region(set) {
        Some(corners) => corners,
        None => cores(&set.splats, &far_splats(&set.splats)),
    };
    corners.map(|corner| corner + set.origin_mm)
}

/// Returns the corners of the box around the voxels of a set's region, mm in its space; `None` if it has no voxels.
pub(super) fn of_region(set: &SplatSet) -> Option<[DVec3; 2]> {
    let (region, grid) = (set.region.as_ref()?, set.grid?);
    let [first, end] = region.bounds().map(|at| DVec3::from_array(at.map(f64::from)) - 0.5);
    (region.voxel_count() > 0).then_some(())?;
    let corner = |k: usize| {
        let part = DVec3::new((k & 1) as f64, (k >> 1 & 1) as f64, (k >> 2) as f64);
        grid.world_from_voxel.transform_point3(first + part * (end - first)) - set.origin_mm
    };
    let around = |[low, high]: [DVec3; 2], x: DVec3| [low.min(x), high.max(x)];
    Some((0..8).map(corner).fold([DVec3::INFINITY, DVec3::NEG_INFINITY], around))
}

/// Returns the corners of the box around the cores of all splats but the rows `far`.
pub(super) fn cores(splats: &[Splat], far: &[usize]) -> [DVec3; 2] {
    if far.is_empty() {
        return box_around(splats, &reaches(splats, CORE_Q));
    }
    let near: Vec<Splat> =
        (0..splats.len()).filter(|i| far.binary_search(i).is_err()).map(|i| splats[i]).collect();
    box_around(&near, &reaches(&near, CORE_Q))
}

/// Returns the corners of the box around all splats, each of which has this half size around its mean.
pub(super) fn box_around(splats: &[Splat], reach: &[Vec3]) -> [DVec3; 2] {
    if splats.is_empty() {
        return [DVec3::splat(-1.0), DVec3::ONE];
    }
    let mut corners = [DVec3::INFINITY, DVec3::NEG_INFINITY];
    for (splat, &reach) in splats.iter().zip(reach) {
        let mean = Vec3::from_array(splat.mean);
        corners = [corners[0].min((mean - reach).as_dvec3()), corners[1].max((mean + reach).as_dvec3())];
    }
    corners
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
    let CellGrid { low, edge, cells } = CellGrid::around(splats, typical.into());
    let span = |i: usize| {
        let mean = Vec3::from_array(splats[i].mean);
        let at = |x: Vec3| ((x.as_dvec3() - low) / edge).floor().max(DVec3::ZERO).as_uvec3().min(cells - 1);
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

/// A regular grid of cells over most of the splats. Splats that lie or reach beyond it count in its outermost
/// cells.
struct CellGrid {
    /// Corner at which the first cell begins, in the unit of the splats.
    low: DVec3,
    /// Edge of a cell.
    edge: f64,
    /// Number of cells along each axis; at most [`MOST_CELLS`] in all.
    cells: UVec3,
}

impl CellGrid {
    /// Creates a grid of cells as large as a typical splat reaches, or larger if there would be too many.
    fn around(splats: &[Splat], typical: f64) -> Self {
        let (mut low, mut extent) = (DVec3::ZERO, DVec3::ZERO);
        for axis in 0..3 {
            let mut places: Vec<f32> = splats.iter().map(|splat| splat.mean[axis]).collect();
            places.sort_unstable_by(f32::total_cmp);
            let last = places.len().saturating_sub(1);
            let at = |i: usize| places.get(i).copied().map_or(0.0, f64::from);
            // One splat far away must not make the cells of all others large.
            let (from, to) = (at(last / FAR_SHARE), at(last - last / FAR_SHARE));
            let beyond = to - from + typical;
            low[axis] = at(0).max(from - beyond);
            extent[axis] = at(last).min(to + beyond) - low[axis];
        }
        let count = |edge: f64| (extent / edge).floor() + 1.0;
        let mut edge = typical.max(f64::from(f32::MIN_POSITIVE));
        while count(edge).element_product() > MOST_CELLS {
            edge *= 1.25;
        }
        CellGrid { low, edge, cells: count(edge).as_uvec3() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn splat(mean: [f32; 3], intensity: f32) -> Splat {
        Splat { mean, intensity, rotation: [1.0, 0.0, 0.0, 0.0], ..Splat::default() }
    }

    /// Creates a block of splats, one apart, with intensities that grow along x.
    fn block() -> Vec<Splat> {
        (0..4096).map(|i| [i % 16, i / 16 % 16, i / 256].map(|v| v as f32)).map(|m| splat(m, m[0])).collect()
    }

    #[test]
    fn one_splat_far_away_changes_nothing_for_the_others() {
        let near = block();
        let reach = |count| vec![Vec3::splat(1.0); count];
        let wanted = intervals(&near, &reach(near.len()));
        for far in [1e4, 1e11, 1e13, -1e30, f32::MAX] {
            for axis in 0..3 {
                let mut mean = [8.0; 3];
                mean[axis] = far;
                let all = [near.clone(), vec![splat(mean, 99.0)]].concat();
                let grid = CellGrid::around(&all, 1.0);
                assert!(grid.cells.as_dvec3().element_product() <= MOST_CELLS, "{far}");
                let found = intervals(&all, &reach(all.len()));
                let wider = found.iter().zip(&wanted).filter(|(a, b)| a != b).count();
                assert!(wider < near.len() / 2, "{far} along {axis}: {wider} of {}", near.len());
                assert!(found.iter().zip(&wanted).all(|(a, b)| a[0] <= b[0] && a[1] >= b[1]), "{far}");
            }
        }
    }

    #[test]
    fn cells_are_bounded_whatever_the_splats_are() {
        for (places, typical) in [
            (vec![[-f32::MAX; 3], [f32::MAX; 3]], 1.0),
            (vec![[0.0; 3], [1e12, 1.0, 1.0]], 1e-30),
            (vec![[0.0; 3]], 0.0),
            (vec![], 1.0),
        ] {
            let splats: Vec<_> = places.into_iter().map(|mean| splat(mean, 1.0)).collect();
            let grid = CellGrid::around(&splats, typical);
            assert!(grid.cells.min_element() > 0 && grid.cells.as_dvec3().element_product() <= MOST_CELLS);
            assert!(grid.edge > 0.0 && grid.low.is_finite());
        }
    }
}
