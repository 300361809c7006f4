//! Evaluates the field of splats on the host, at single points and along rays. For splats that are fitted
//! for a grid it is the field at the voxels around, interpolated, as mode decoded shows it.

use crate::Look;
use crate::extents::of_region;
use glam::{DAffine3, DMat3, DVec3, UVec3};
use splat::{self, Activations, Field, Form, Region, Splat, SplatSet};
use volume::spacing_of;

/// Greatest number of cells of the grid.
const MOST_CELLS: f64 = 4e6;
/// Splats that reach more cells than this are not listed by cells but tested at every point.
const FEW: usize = 64;
/// Share of the light that is gone where a ray meets something.
const MET: f64 = 0.5;
/// Distance of samples along a ray, as a part of the middle splat's shortest standard deviation.
const STEP: f64 = 0.5;
/// Least distance of samples, mm.
const LEAST_STEP: f64 = 0.05;

/// Field of a splat set at single points. Splats are listed by the cells of a grid, so that a point tests
/// only those whose boxes may hold it.
pub struct Probe {
    field: Field,
    origin: DVec3,
    /// Voxels at which the splats are right, if they are not right everywhere.
    voxels: Option<Box<Voxels>>,
    splats: Vec<Ellipsoid>,
    grid: Grid,
    /// First index into `listed` of each cell; one entry more than there are cells.
    starts: Vec<u32>,
    listed: Vec<u32>,
    /// Splats that reach many cells.
    large: Vec<u32>,
    /// Corners of the box around coded voxels, in the space of the set; `None` if there are none.
    coded: Option<[DVec3; 2]>,
    /// Distance of samples along a ray, mm.
    step: f64,
}

/// Voxels that the splats were fitted for.
struct Voxels {
    /// Transformation from mm in the space of the set to voxel indices.
    voxel_from_set: DAffine3,
    set_from_voxel: DAffine3,
    /// Index of the last voxel along each axis.
    last: DVec3,
    /// The voxels that are shown, if the splats do not say how much of each is.
    region: Option<Region>,
    /// V of those that have it in place of splats.
    coded: Vec<splat::Voxels>,
}

impl Voxels {
    fn of(set: &SplatSet) -> Option<Box<Self>> {
        let (Form::Grid, Some(grid)) = (set.form, set.grid) else { return None };
        let set_from_voxel = DAffine3::from_translation(-set.origin_mm) * grid.world_from_voxel;
        let last = UVec3::from_array(grid.size).as_dvec3() - 1.0;
        let voxel_from_set = set_from_voxel.inverse();
        let (region, coded) = (set.region.clone(), set.voxels.clone());
        Some(Box::new(Voxels { voxel_from_set, set_from_voxel, last, region, coded }))
    }

    /// Returns what is coded of a voxel; `None` if splats say what is there.
    fn coded(&self, voxel: DVec3, shown: &Shown) -> Option<Sample> {
        let voxel = voxel.to_array().map(|v| v as i64);
        let object = self.region.as_ref()?.at(voxel)?;
        let intensity = self.coded.iter().find(|coded| coded.fit == object.fit)?.at(voxel)?;
        let share = shown.0[usize::from(object.number)].unwrap_or(0.0);
        Some(Sample { intensity, occupancy: 1.0, share, object: object.number })
    }

    /// Returns what is shown at a voxel of the grid, of what the splats have there.
    fn shown(&self, voxel: DVec3, found: Sample) -> Sample {
        let Some(region) = &self.region else { return found };
        let object = region.at(voxel.to_array().map(|v| v as i64));
        let share = if found.occupancy > 0.0 { found.share / found.occupancy } else { 0.0 };
        match object {
            Some(object) => Sample { occupancy: 1.0, share, object: object.number, ..found },
            None => Sample { occupancy: 0.0, share: 0.0, ..found },
        }
    }
}

/// Field at a point.
#[derive(Clone, Copy, Default)]
struct Sample {
    intensity: f64,
    occupancy: f64,
    /// Occupancy times the opacities of the objects there.
    share: f64,
    /// Object of the splat with most weight there, whose transfer function counts.
    object: u8,
}

/// Returns the distances between which a ray is within a box, from 0 on.
fn range_within([low, high]: [DVec3; 2], from: DVec3, direction: DVec3) -> Option<[f64; 2]> {
    let (a, b) = ((low - from) / direction, (high - from) / direction);
    // A ray along a face has 0/0 there, which min and max ignore.
    let near = a.min(b).to_array().into_iter().fold(0.0, f64::max);
    let far = a.max(b).to_array().into_iter().fold(f64::INFINITY, f64::min);
    (near < far && far.is_finite()).then_some([near, far])
}

/// Cells over the box of a set, x fastest.
struct Grid {
    low: DVec3,
    /// Edges of a cell, mm.
    edge: DVec3,
    size: UVec3,
}

impl Grid {
    /// Creates a grid with cells twice as large as the mean splat, so that most splats reach a few.
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

    /// Returns the cell of a point; beyond the grid the nearest one.
    fn cell(&self, x: DVec3) -> UVec3 {
        ((x - self.low) / self.edge).floor().max(DVec3::ZERO).as_uvec3().min(self.size - 1)
    }

    fn index(&self, cell: UVec3) -> usize {
        ((cell.z * self.size.y + cell.y) * self.size.x + cell.x) as usize
    }

    /// Returns the distances between which a ray is within the grid, from 0 on.
    fn range(&self, from: DVec3, direction: DVec3) -> Option<[f64; 2]> {
        range_within([self.low, self.low + self.edge * self.size.as_dvec3()], from, direction)
    }

    /// Returns the cells that a splat's box reaches.
    fn reached(&self, splat: &Ellipsoid) -> impl Iterator<Item = usize> {
        let [from, to] = [splat.mean - splat.reach, splat.mean + splat.reach].map(|x| self.cell(x));
        let row = move |y, z| (from.x..=to.x).map(move |x| self.index(UVec3::new(x, y, z)));
        (from.z..=to.z).flat_map(move |z| (from.y..=to.y).flat_map(move |y| row(y, z)))
    }
}

/// Splat as the field needs it.
struct Ellipsoid {
    /// Mean, mm in the space of the set.
    mean: DVec3,
    /// Matrix S⁻¹Rᵀ, which maps x - mean to the whitened offset.
    whitening: DMat3,
    /// Half size of the box around the support, mm.
    reach: DVec3,
    /// Amplitude a of w = a κ(q).
    amplitude: f64,
    /// Intensity relative to the background.
    intensity: f64,
    /// Number of its object.
    object: u8,
}

/// Field V̂ and occupancy O at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Field V̂, HU for CT.
    pub intensity: f64,
    /// Occupancy O, 0 to 1.
    pub occupancy: f64,
}

/// Point at which a ray meets something.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance from the start of the ray, mm.
    pub distance_mm: f64,
    /// Point, mm RAS.
    pub at_mm: DVec3,
    /// Field V̂ of what is shown there, HU for CT.
    pub intensity: f64,
}

/// Opacity with which a look shows each object; `None` for hidden objects.
struct Shown([Option<f64>; 256]);

impl Shown {
    const ALL: Self = Shown([Some(1.0); 256]);

    fn of(look: &Look) -> Self {
        let mut shown = Self::ALL;
        for (&number, appearance) in &look.objects {
            shown.0[usize::from(number)] = appearance.visible.then(|| f64::from(appearance.opacity));
        }
        shown
    }
}

/// Sums over the splats at a point: of w, of w (c − b), and of w times the object's opacity; and the greatest w,
/// with its object.
#[derive(Default)]
struct Sums {
    weight: f64,
    intensity: f64,
    opacity: f64,
    greatest: f64,
    object: u8,
}

impl Probe {
    /// Creates a probe from a set; its splats are copied.
    pub fn new(set: &SplatSet) -> Self {
        let object = |i: usize| set.labels.as_ref().map_or(0, |labels| labels[i]);
        let rows = set.splats.iter().enumerate();
        let splats: Vec<Ellipsoid> = rows.map(|(i, s)| ellipsoid(s, &set.field, object(i))).collect();
        let grid = Grid::over(&splats);
        // First the counts, then prefix sums, then the splats themselves.
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
        let shortest = |s: &Splat| s.scale().into_iter().fold(f32::INFINITY, f32::min);
        let mut shortest: Vec<f32> = set.splats.iter().map(shortest).collect();
        let middle = shortest.len() / 2;
        let coded = of_region(set).filter(|_| !set.voxels.is_empty());
        let step = match shortest.is_empty() {
            true => {
                set.grid.map_or(LEAST_STEP, |grid| STEP * spacing_of(&grid.world_from_voxel).min_element())
            }
            false => STEP * f64::from(*shortest.select_nth_unstable_by(middle, f32::total_cmp).1),
        };
        let (field, origin, step) = (set.field, set.origin_mm, step.max(LEAST_STEP));
        Probe { field, origin, voxels: Voxels::of(set), splats, grid, starts, listed, large, coded, step }
    }

    /// Returns the field at a point, mm RAS; `None` if no splat reaches it.
    pub fn at(&self, x_mm: DVec3) -> Option<Reading> {
        let sample = self.sample(x_mm - self.origin, &Shown::ALL)?;
        Some(Reading { intensity: sample.intensity, occupancy: sample.occupancy })
    }

    /// Returns the first point of a ray that a look shows, from `from_mm` (RAS) on: the point where half of
    /// the light is gone. The opacity O(x) α(V̂(x)) per mm is that of the render modes of splats, which
    /// classify after adding up; clip planes cut, hidden objects leave their place to others.
    pub fn along(&self, from_mm: DVec3, direction: DVec3, look: &Look) -> Option<Hit> {
        let direction = direction.try_normalize().filter(|_| from_mm.is_finite())?;
        let mut range = self.range(from_mm - self.origin, direction)?;
        for plane in &look.clip {
            // The plane cuts where normal · x < offset.
            let (over, rise) = (plane.normal.dot(from_mm) - plane.offset, plane.normal.dot(direction));
            match rise {
                _ if rise > 0.0 => range[0] = range[0].max(-over / rise),
                _ if rise < 0.0 => range[1] = range[1].min(-over / rise),
                _ if over < 0.0 => return None,
                _ => {}
            }
        }
        let shown = Shown::of(look);
        let mut left = -MET.ln();
        let count = ((range[1] - range[0]) / self.step).ceil().max(0.0) as usize;
        for k in 0..count {
            let from = range[0] + k as f64 * self.step;
            let path = self.step.min(range[1] - from);
            let at = from_mm + direction * (from + 0.5 * path) - self.origin;
            let Some(Sample { intensity, share, object, .. }) = self.sample(at, &shown) else { continue };
            let share = share * look.function_of(object).at(intensity).1;
            // This is the optical depth of the stretch.
            let depth = -path * (1.0 - share).max(f64::MIN_POSITIVE).ln();
            if depth < left {
                left -= depth;
                continue;
            }
            let distance_mm = from + path * left / depth;
            return Some(Hit { distance_mm, at_mm: from_mm + direction * distance_mm, intensity });
        }
        None
    }

    /// Returns the distances between which a ray may meet something, from 0 on.
    fn range(&self, from: DVec3, direction: DVec3) -> Option<[f64; 2]> {
        let of_splats = self.grid.range(from, direction).filter(|_| !self.splats.is_empty());
        let of_coded = self.coded.and_then(|corners| range_within(corners, from, direction));
        match (of_splats, of_coded) {
            (Some(a), Some(b)) => Some([a[0].min(b[0]), a[1].max(b[1])]),
            (one, other) => one.or(other),
        }
    }

    /// Returns the field at a point in the space of the set; `None` if no splat reaches it.
    fn sample(&self, x: DVec3, shown: &Shown) -> Option<Sample> {
        let Some(voxels) = &self.voxels else { return self.sample_field(&self.sums(x, shown, false)) };
        let at = voxels.voxel_from_set.transform_point3(x);
        let (low, part) = (at.floor(), at - at.floor());
        let (mut mean, mut there, mut most) = (Sample::default(), 0.0, 0.0);
        for corner in 0..8u32 {
            let far = DVec3::from_array([0, 1, 2].map(|axis| f64::from(corner >> axis & 1)));
            let weight = (far * part + (1.0 - far) * (1.0 - part)).element_product();
            let voxel = low + far;
            // Beyond the grid there is nothing. Voxels of hidden objects stay theirs.
            let inside = voxel.cmpge(DVec3::ZERO).all() && voxel.cmple(voxels.last).all();
            let coded = voxels.coded(voxel, shown);
            let of_splats = || {
                let sums = self.sums(voxels.set_from_voxel.transform_point3(voxel), shown, true);
                let found = self.sample_field(&sums)?;
                Some(match inside {
                    true => voxels.shown(voxel, found),
                    false => Sample { occupancy: 0.0, share: 0.0, ..found },
                })
            };
            let Some(found) = coded.or_else(of_splats).filter(|_| weight > 1e-9) else { continue };
            // Beyond a region V is continued from inside.
            let counts = if voxels.region.is_some() { weight * found.occupancy } else { weight };
            there += counts;
            mean.intensity += counts * found.intensity;
            mean.occupancy += weight * found.occupancy;
            mean.share += weight * found.share;
            if weight * found.occupancy > most {
                (most, mean.object) = (weight * found.occupancy, found.object);
            }
        }
        // If no splat reaches a voxel, its neighbours' intensity is taken.
        (there > 0.0).then(|| Sample { intensity: mean.intensity / there, ..mean })
    }

    fn sample_field(&self, sums: &Sums) -> Option<Sample> {
        let all = sums.weight + f64::from(self.field.occupancy_w0);
        let background = f64::from(self.field.background);
        (sums.weight > 0.0).then(|| Sample {
            intensity: background + sums.intensity / (sums.weight + f64::from(self.field.epsilon)),
            occupancy: sums.weight / all,
            share: sums.opacity / all,
            object: sums.object,
        })
    }

    /// Returns the sums at a point in the space of the set; splats of hidden objects count only if `hidden`
    /// is true, with an opacity of 0.
    fn sums(&self, x: DVec3, shown: &Shown, hidden: bool) -> Sums {
        let mut sums = Sums::default();
        if !x.is_finite() || self.splats.is_empty() {
            return sums;
        }
        // A point beyond the grid asks the nearest cell, whose splats do not reach it.
        let cell = self.grid.index(self.grid.cell(x));
        let [from, to] = [self.starts[cell], self.starts[cell + 1]];
        for &i in self.listed[from as usize..to as usize].iter().chain(&self.large) {
            let splat = &self.splats[i as usize];
            let opacity = shown.0[usize::from(splat.object)];
            if opacity.is_none() && !hidden {
                continue;
            }
            if (x - splat.mean).abs().cmple(splat.reach).all() {
                let q = (splat.whitening * (x - splat.mean)).length_squared();
                let w = splat.amplitude * self.field.kernel.value(q);
                sums.weight += w;
                sums.intensity += w * splat.intensity;
                sums.opacity += w * opacity.unwrap_or(0.0);
                if w > sums.greatest {
                    (sums.greatest, sums.object) = (w, splat.object);
                }
            }
        }
        sums
    }
}

fn ellipsoid(splat: &Splat, field: &Field, object: u8) -> Ellipsoid {
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
        object,
    }
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
