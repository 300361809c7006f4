//! What the splats stand for at a point: the field, evaluated on the host for whatever is under the cursor.

use engine::splat::{Activations, Field, Splat, SplatSet};
use glam::{DMat3, DVec3, UVec3};

/// Most cells of the grid.
const MOST_CELLS: f64 = 4e6;
/// Splats that reach more cells than this are asked at every point instead.
const FEW: usize = 64;

/// The field of a splat set at single points. Splats are listed by the cells of a grid, so that a point asks only those whose
/// boxes may hold it.
pub struct Probe {
    field: Field,
    origin: DVec3,
    splats: Vec<Ellipsoid>,
    grid: Grid,
    /// Where the splats of each cell begin in `listed`; one more than there are cells.
    starts: Vec<u32>,
    listed: Vec<u32>,
    /// Those that reach many cells.
    large: Vec<u32>,
}

/// Cells over the box of a set, x fastest.
struct Grid {
    low: DVec3,
    /// Edges of a cell, mm.
    edge: DVec3,
    size: UVec3,
}

impl Grid {
    /// Cells twice as large as the mean splat, so that most splats reach a few.
    fn over(splats: &[Ellipsoid]) -> Self {
        let count = splats.len().max(1) as f64;
        let mut mean = DVec3::ZERO;
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for s in splats {
            mean += s.reach * (2.0 / count);
            (low, high) = (low.min(s.mean - s.reach), high.max(s.mean + s.reach));
        }
        let extent = if splats.is_empty() { DVec3::ZERO } else { high - low };
        let mut edge = (2.0 * mean).max(DVec3::splat(f64::MIN_POSITIVE));
        let cells = (extent / edge + 1.0).element_product();
        if cells > MOST_CELLS {
            edge = edge.max(extent / MOST_CELLS.cbrt().floor());
        }
        Grid { low, edge, size: (extent / edge).floor().as_uvec3() + 1 }
    }

    fn len(&self) -> usize {
        self.size.element_product() as usize
    }

    /// The cell of a point; beyond the grid the nearest one.
    fn cell(&self, x: DVec3) -> UVec3 {
        ((x - self.low) / self.edge).floor().max(DVec3::ZERO).as_uvec3().min(self.size - 1)
    }

    fn index(&self, cell: UVec3) -> usize {
        ((cell.z * self.size.y + cell.y) * self.size.x + cell.x) as usize
    }

    /// The cells that a splat's box reaches.
    fn reached(&self, splat: &Ellipsoid) -> impl Iterator<Item = usize> {
        let [from, to] = [splat.mean - splat.reach, splat.mean + splat.reach].map(|x| self.cell(x));
        let row = move |y, z| (from.x..=to.x).map(move |x| self.index(UVec3::new(x, y, z)));
        (from.z..=to.z).flat_map(move |z| (from.y..=to.y).flat_map(move |y| row(y, z)))
    }
}

/// A splat as the field needs it.
struct Ellipsoid {
    /// mm in the space of the set.
    mean: DVec3,
    /// S⁻¹Rᵀ: x - mean to the whitened distance.
    whitening: DMat3,
    /// Half size of the box around the support, mm.
    reach: DVec3,
    /// a of w = a κ(q).
    amplitude: f64,
    /// Relative to the background.
    intensity: f64,
}

/// V̂ and O at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// V̂, HU for CT.
    pub intensity: f64,
    /// O, 0 to 1.
    pub occupancy: f64,
}

impl Probe {
    /// Of a set; its splats are copied.
    pub fn new(set: &SplatSet) -> Self {
        let splats: Vec<Ellipsoid> = set.splats.iter().map(|s| ellipsoid(s, &set.field)).collect();
        let grid = Grid::over(&splats);
        // Counts, prefix sums, then the splats themselves.
        let mut starts = vec![0u32; grid.len() + 1];
        let mut large = Vec::new();
        for (i, splat) in splats.iter().enumerate() {
            if grid.reached(splat).nth(FEW).is_some() {
                large.push(i as u32);
            } else {
                grid.reached(splat).for_each(|cell| starts[cell + 1] += 1);
            }
        }
        for i in 0..grid.len() {
            starts[i + 1] += starts[i];
        }
        let mut next = starts.clone();
        let mut listed = vec![0; starts[grid.len()] as usize];
        let mut is_large = large.iter().copied().peekable();
        for (i, splat) in splats.iter().enumerate() {
            if is_large.next_if_eq(&(i as u32)).is_some() {
                continue;
            }
            for cell in grid.reached(splat) {
                listed[next[cell] as usize] = i as u32;
                next[cell] += 1;
            }
        }
        Probe { field: set.field, origin: set.origin_mm, splats, grid, starts, listed, large }
    }

    /// The field at a point, mm RAS; nothing where no splat reaches.
    pub fn at(&self, x_mm: DVec3) -> Option<Reading> {
        let x = x_mm - self.origin;
        if !x.is_finite() || self.splats.is_empty() {
            return None;
        }
        // A point beyond the grid asks the nearest cell, whose splats do not reach it.
        let cell = self.grid.index(self.grid.cell(x));
        let [from, to] = [self.starts[cell], self.starts[cell + 1]];
        let (mut weight, mut sum) = (0.0, 0.0);
        for &i in self.listed[from as usize..to as usize].iter().chain(&self.large) {
            let splat = &self.splats[i as usize];
            if (x - splat.mean).abs().cmple(splat.reach).all() {
                let q = (splat.whitening * (x - splat.mean)).length_squared();
                let w = splat.amplitude * self.field.kernel.value(q);
                weight += w;
                sum += w * splat.intensity;
            }
        }
        let [epsilon, w0, background] =
            [self.field.epsilon, self.field.occupancy_w0, self.field.background].map(f64::from);
        (weight > 0.0).then(|| Reading {
            intensity: background + sum / (weight + epsilon),
            occupancy: weight / (weight + w0),
        })
    }
}

fn ellipsoid(splat: &Splat, field: &Field) -> Ellipsoid {
    let axes = splat.axes();
    let log_scale = splat.log_scale.map(f64::from);
    let scale = DVec3::from_array(log_scale).exp();
    let squares = (0..3).map(|k| (axes.col(k) * scale[k]).powf(2.0)).sum::<DVec3>();
    Ellipsoid {
        mean: DVec3::from_array(splat.mean.map(f64::from)),
        whitening: DMat3::from_diagonal(scale.recip()) * axes.transpose(),
        reach: (squares * field.kernel.support_q()).map(f64::sqrt),
        amplitude: field.kernel.peak(log_scale) / (1.0 + (-f64::from(splat.opacity_logit)).exp()),
        intensity: f64::from(splat.intensity) - f64::from(field.background),
    }
}

#[cfg(test)]
mod tests {
    use engine::reference;
    use engine::reference::eye::Eye;
    use engine::reference::slab::{Sums, field_at, seen};
    use engine::splat::Kernel;

    use super::*;

    /// Numbers from 0 to 1, the same each time.
    fn numbers(mut seed: u64) -> impl FnMut() -> f32 {
        move || {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (seed >> 40) as f32 / (1u64 << 24) as f32
        }
    }

    fn set(kernel: Kernel, count: usize) -> SplatSet {
        let mut next = numbers(7);
        let splats = (0..count)
            .map(|_| {
                let mut splat = Splat {
                    mean: [40.0 * next(), 60.0 * next(), 20.0 + 300.0 * next()],
                    rotation: [next() - 0.5, next() - 0.5, next() - 0.5, next() - 0.5],
                    intensity: 1000.0 * next() - 300.0,
                    ..Splat::default()
                };
                splat.set_opacity(next());
                splat.set_scale([0.5 + 4.0 * next(), 0.5 + 4.0 * next(), 0.5 + 4.0 * next()]);
                splat
            })
            .collect();
        let field = Field { kernel, background: -100.0, ..Field::default() };
        SplatSet { splats, origin_mm: DVec3::new(5.0, -7.0, 1000.0), field, ..SplatSet::default() }
    }

    #[test]
    fn it_is_the_field_of_the_twin() {
        for kernel in [Kernel::Compact, Kernel::Gaussian, Kernel::Density] {
            let set = set(kernel, 400);
            let probe = Probe::new(&set);
            let eye = Eye { position: DVec3::ZERO, turn: DMat3::IDENTITY, tangents: [0.0; 4] };
            // Twins take unit quaternions.
            let twin = |s: &Splat| {
                let twin = reference::Splat::from(s);
                reference::Splat { rotation: twin.rotation.normalize(), ..twin }
            };
            let background = f64::from(set.field.background);
            let all: Vec<_> =
                set.splats.iter().filter_map(|s| seen(&twin(s), &eye, kernel, background)).collect();
            assert_eq!(all.len(), set.splats.len());
            let mut next = numbers(3);
            let mut inside = 0;
            for _ in 0..2000 {
                let x =
                    DVec3::new(f64::from(next()) * 50.0, f64::from(next()) * 70.0, f64::from(next()) * 340.0);
                let Sums { w, s, .. } = field_at(&all, kernel, x);
                let found = probe.at(x + set.origin_mm);
                assert_eq!(found.is_some(), w > 0.0, "{x}");
                let Some(found) = found else { continue };
                inside += 1;
                let v = -100.0 + s / (w + f64::from(set.field.epsilon));
                let o = w / (w + f64::from(set.field.occupancy_w0));
                assert!((found.intensity - v).abs() < 1e-6, "{x}: {} {v}", found.intensity);
                assert!((found.occupancy - o).abs() < 1e-9, "{x}");
            }
            assert!(inside > 200, "{inside} points within splats");
        }
    }

    #[test]
    fn beyond_the_splats_is_nothing() {
        let probe = Probe::new(&set(Kernel::Compact, 50));
        for x in [DVec3::splat(1e9), DVec3::splat(-1e9), DVec3::NAN, DVec3::INFINITY] {
            assert_eq!(probe.at(x), None, "{x}");
        }
        assert_eq!(Probe::new(&SplatSet::default()).at(DVec3::ZERO), None);
    }

    #[test]
    fn splats_are_listed_a_few_times() {
        let mut set = set(Kernel::Compact, 3000);
        // One that reaches through all cells, as a fit may have.
        set.splats[0].set_scale([300.0; 3]);
        let probe = Probe::new(&set);
        assert_eq!(probe.large, [0]);
        let most = probe.starts.windows(2).map(|w| w[1] - w[0]).max().unwrap_or(0) as usize;
        assert!(probe.listed.len() < 8 * set.splats.len() && most < set.splats.len() / 5, "{most}");
    }
}
