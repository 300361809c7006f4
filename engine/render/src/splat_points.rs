//! What mode alpha needs to know of the field, evaluated once for a scene: its gradients at the centres of
//! the splats, by which they are lit, and V and O at points in them, from which extinctions and colours are
//! found for each transfer function ([`passes::Deconvolution`]).
//!
//! Alpha draws Σ e (1 − q/6)^{3/2}. It does not draw e κ for this reason: O is flat wherever splats lie close,
//! and falls off only where W nears w₀, far outside; the wider bump follows it better, and its integral along
//! a ray has no root. A splat begins with the share a / (W + w₀), at its centre, of the medium around it.

use glam::{DAffine3, DVec3, Vec3};
use rayon::prelude::*;
use shaders_glsl::types::Centre;

use super::bumps::{Bump, Cells, POINTS};
use super::decoded::Decoded;
use base::error::{Error, Kind, Result};
use passes::Lists;
use passes::deconvolution::{MOST_ROWS, Points, index_of, pair, weight_of};
use splat::{Field, Splat};

/// Greatest number of splats that are listed at a point; ten times what fits have there.
const MOST_AT_A_POINT: usize = 128;
/// Profile below which a splat is not listed at a point, so that a fifth of the pairs need not be visited.
const LEAST_PROFILE: f32 = 0.05;
/// Number of splats at a point, at the least: where so many would be too many pairs, fewer points are tried at
/// once.
const LEAST_AT_A_POINT: usize = 8;
/// Greatest number of pairs, so that a list fits in 128 MiB, which all devices bind.
const MOST_PAIRS: usize = 1 << 25;

/// The field at the centres, and points in the splats.
#[derive(Default)]
pub(super) struct SplatPoints {
    pub(super) centres: Vec<Centre>,
    pub(super) points: Points,
}

/// Returns the field in some splats. Of splats that were fitted for a grid it is the decoded one.
///
/// # Errors
/// If there are more splats than [`MOST_ROWS`].
pub(super) fn splat_points(
    splats: &[Splat],
    field: &Field,
    decoded: Option<&Decoded>,
) -> Result<SplatPoints> {
    if splats.len() > MOST_ROWS {
        let message = format!("{} splats are too many for mode alpha, which shows {MOST_ROWS}", splats.len());
        return Err(Error::new(Kind::Usage, "VGS-RENDER-027", message).help("choose another --mode"));
    }
    if splats.is_empty() {
        return Ok(SplatPoints::default());
    }
    let bumps: Vec<Bump> = splats.par_iter().map(|s| Bump::new(s, field)).collect();
    let decoded = decoded.map(|decoded| (decoded, decoded.scene_from_voxel.inverse()));
    let medium = Medium { bumps: &bumps, field, decoded };
    Ok(medium.points_with(MOST_PAIRS))
}

/// Splats, and where their V and O come from.
struct Medium<'a> {
    bumps: &'a [Bump],
    field: &'a Field,
    /// The decoded field, with the map from the scene to its voxels.
    decoded: Option<(&'a Decoded, DAffine3)>,
}

/// The field that splats add up to at a place.
struct Sum {
    /// W and Σ w (c − b), and their gradients.
    weight: f64,
    value: f64,
    weight_slope: DVec3,
    value_slope: DVec3,
}

/// What is found in a cell.
#[derive(Default)]
struct Found {
    /// Centres of the splats whose means lie in it, with their shares.
    centres: Vec<(u32, Centre, f32)>,
    /// V and O at its points, and the volumes that they stand for.
    values: Vec<[f32; 2]>,
    volumes: Vec<f32>,
    /// Number of pairs of each of its points, and the pairs.
    counts: Vec<u32>,
    pairs: Vec<u32>,
}

impl Medium<'_> {
    /// Returns the field at the centres and at as many points a splat as have at most `most` pairs in all. Where
    /// one point a splat has more, each lists the splats that draw most there.
    fn points_with(&self, most: usize) -> SplatPoints {
        let splats = self.bumps.len();
        for count in [POINTS, POINTS / 2, 1] {
            if count * splats > MOST_ROWS || count * splats * LEAST_AT_A_POINT > most {
                continue;
            }
            let made = self.points(count, MOST_AT_A_POINT);
            if made.points.of_points.rows.len() <= most {
                return made;
            }
        }
        self.points(1, (most / splats).clamp(1, MOST_AT_A_POINT))
    }

    /// Returns the field at the centres, and at `count` points in each splat, which list at most `most` splats.
    /// Points are numbered by cells, so that those that follow each other list the same splats.
    fn points(&self, count: usize, most: usize) -> SplatPoints {
        let place = |bump: &Bump| {
            std::iter::once(bump.mean).chain(bump.points().into_iter().take(count)).collect::<Vec<_>>()
        };
        let places: Vec<Vec3> = self.bumps.par_iter().flat_map_iter(place).collect();
        let cells = Cells::new(self.bumps, &places);
        let found: Vec<Found> = (0..cells.count())
            .into_par_iter()
            .map(|cell| self.cell(&cells, cell, &places, [1 + count, most]))
            .collect();
        let mut made = SplatPoints {
            centres: vec![Centre::default(); self.bumps.len()],
            points: Points { shares: vec![0.0; self.bumps.len()], ..Points::default() },
        };
        let Points { values, of_points, of_splats, shares } = &mut made.points;
        let mut volumes: Vec<f32> = Vec::new();
        for part in found {
            for (splat, centre, share) in part.centres {
                (made.centres[splat as usize], shares[splat as usize]) = (centre, share);
            }
            values.extend(part.values);
            volumes.extend(part.volumes);
            for count in part.counts {
                of_points.ends.push(of_points.ends.last().copied().unwrap_or(0) + count);
            }
            of_points.rows.extend(part.pairs);
        }
        // The weight of a point in a splat's mean: the profile there, times the volume that the point stands for.
        let visit = |take: &mut dyn FnMut(usize, f32, u32)| {
            for (point, volume) in volumes.iter().enumerate() {
                for &pair in of_points.of(point) {
                    take(index_of(pair), weight_of(pair) * volume, point as u32);
                }
            }
        };
        let mut greatest = vec![0.0f32; self.bumps.len()];
        visit(&mut |splat, weight, _| greatest[splat] = greatest[splat].max(weight));
        *of_splats = Lists::new(self.bumps.len(), |take| {
            visit(&mut |splat, weight, point| take(splat, pair(point, weight / greatest[splat])));
        });
        made
    }

    /// Returns what there is in a cell. `of_splat` places belong to each splat, its centre and its points; a point
    /// lists at most `most` splats.
    fn cell(&self, cells: &Cells, cell: usize, places: &[Vec3], [of_splat, most]: [usize; 2]) -> Found {
        let (members, inside) = (cells.members.of(cell), cells.inside.of(cell));
        let mut found = Found::default();
        let mut drawn: Vec<(f32, u32)> = Vec::new();
        for &at in inside {
            let place = places[at as usize];
            let splat = at as usize / of_splat;
            if (at as usize).is_multiple_of(of_splat) {
                let sum = self.sum(members, place, |_, _| ());
                let w0 = f64::from(self.field.occupancy_w0);
                let share = f64::from(self.bumps[splat].amplitude) / (sum.weight + w0);
                found.centres.push((splat as u32, self.centre(&sum, place), share as f32));
                continue;
            }
            drawn.clear();
            // Points are dense where small splats are, so each stands for as much as there is room for it.
            let mut density = 0.0;
            let sum = self.sum(members, place, |bump, profile| {
                drawn.push((profile, bump));
                density += 1.0 / self.bumps[bump as usize].volume();
            });
            if drawn.len() > most {
                drawn.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
                drawn.truncate(most);
            }
            let (value, occupancy) = match self.decoded {
                Some((decoded, map)) => decoded.trilinear(map.transform_point3(place.as_dvec3())),
                None => sum.value_and_occupancy(self.field),
            };
            found.values.push([value as f32, occupancy as f32]);
            found.volumes.push((1.0 / density) as f32);
            found.counts.push(drawn.len() as u32);
            found.pairs.extend(drawn.iter().map(|&(profile, bump)| pair(bump, profile)));
        }
        found
    }

    /// Adds up the bumps of a cell at a place, and calls `draw` for each that is drawn there.
    fn sum(&self, members: &[u32], place: Vec3, mut draw: impl FnMut(u32, f32)) -> Sum {
        let mut sum = Sum { weight: 0.0, value: 0.0, weight_slope: DVec3::ZERO, value_slope: DVec3::ZERO };
        for &i in members {
            let bump = &self.bumps[i as usize];
            let Some(u) = bump.whitened(place) else { continue };
            let profile = Bump::profile(u);
            if profile > LEAST_PROFILE {
                draw(i, profile);
            }
            let q = f64::from(u.length_squared());
            let kappa = self.field.kernel.value(q);
            if kappa > 0.0 {
                let [a, c] = [bump.amplitude, bump.intensity].map(f64::from);
                let uphill = (bump.whitening.transpose() * -u).as_dvec3();
                let slope = uphill * (a * self.field.kernel.slope(q));
                sum.weight += a * kappa;
                sum.value += a * kappa * c;
                sum.weight_slope += slope;
                sum.value_slope += slope * c;
            }
        }
        sum
    }

    /// Returns the gradients at a place where the sum is known.
    fn centre(&self, sum: &Sum, place: Vec3) -> Centre {
        if let Some((decoded, map)) = self.decoded {
            // By central differences over a voxel on each side, as in mode decoded.
            let at = map.transform_point3(place.as_dvec3());
            let slope = |of: fn((f64, f64)) -> f64| {
                let part = |k: usize| {
                    let [up, down] =
                        [1.0, -1.0].map(|side| of(decoded.trilinear(at + DVec3::AXES[k] * side)));
                    0.5 * (up - down)
                };
                let along = DVec3::from_array(std::array::from_fn(part));
                (map.matrix3.transpose() * along).as_vec3().to_array()
            };
            return Centre { slope: slope(|(v, o)| v * o), occupancy_slope: slope(|(_, o)| o) };
        }
        let [epsilon, w0] = [self.field.epsilon, self.field.occupancy_w0].map(f64::from);
        let (value, occupancy) = sum.value_and_occupancy(self.field);
        let inverse = 1.0 / (sum.weight + epsilon);
        let value_slope = (sum.value_slope - sum.weight_slope * (sum.value * inverse)) * inverse;
        let occupancy_slope = sum.weight_slope * (w0 / (sum.weight + w0).powi(2));
        Centre {
            slope: (value_slope * occupancy + occupancy_slope * value).as_vec3().to_array(),
            occupancy_slope: occupancy_slope.as_vec3().to_array(),
        }
    }
}

impl Sum {
    fn value_and_occupancy(&self, field: &Field) -> (f64, f64) {
        let [epsilon, w0, background] = [field.epsilon, field.occupancy_w0, field.background].map(f64::from);
        (background + self.value / (self.weight + epsilon), self.weight / (self.weight + w0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use splat::Activations as _;
    use splat::kernel::KERNELS;

    /// Creates splats of different shapes in a box of 20 mm.
    fn splats(count: u32) -> Vec<Splat> {
        let mut state = 7u32;
        let mut next = |low: f32, high: f32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            low + (high - low) * (state >> 8) as f32 / (1 << 24) as f32
        };
        let mut splat = |_| Splat {
            mean: std::array::from_fn(|_| next(-10.0, 10.0)),
            opacity_logit: next(-2.0, 3.0),
            rotation: splat::activation::normalised([1.0, next(-1.0, 1.0), next(-1.0, 1.0), next(-1.0, 1.0)]),
            log_scale: std::array::from_fn(|_| next(-0.3, 1.0)),
            intensity: next(-100.0, 900.0),
        };
        (0..count).map(&mut splat).collect()
    }

    /// Returns V and O at a point, from all splats.
    fn field_at(splats: &[Splat], field: &Field, x: DVec3) -> (f64, f64) {
        let (mut w, mut s) = (0.0, 0.0);
        for splat in splats {
            let d = splat.axes().transpose() * (x - Vec3::from_array(splat.mean).as_dvec3());
            let q = (d / DVec3::from_array(splat.scale().map(f64::from))).length_squared();
            let peak = field.kernel.peak(splat.log_scale.map(f64::from));
            let weight = f64::from(splat.opacity()) * peak * field.kernel.value(q);
            w += weight;
            s += weight * f64::from(splat.intensity - field.background);
        }
        let v = f64::from(field.background) + s / (w + f64::from(field.epsilon));
        (v, w / (w + f64::from(field.occupancy_w0)))
    }

    #[test]
    fn the_field_and_its_slopes_are_those_of_all_splats() {
        for row in &KERNELS {
            let field = Field { kernel: row.kernel, background: 30.0, ..Field::default() };
            let splats = splats(300);
            let found = splat_points(&splats, &field, None).expect("points").centres;
            for (splat, found) in splats.iter().zip(found).step_by(7) {
                let x = Vec3::from_array(splat.mean).as_dvec3();
                let (_, o) = field_at(&splats, &field, x);
                let step = 1e-3;
                let slope = |of: &dyn Fn(f64, f64) -> f64| {
                    DVec3::from_array(std::array::from_fn(|k| {
                        let at = |side: f64| {
                            let (v, o) = field_at(&splats, &field, x + DVec3::AXES[k] * (side * step));
                            of(v, o)
                        };
                        (at(1.0) - at(-1.0)) / (2.0 * step)
                    }))
                };
                let wanted = slope(&|v, o| v * o);
                let got = Vec3::from_array(found.slope).as_dvec3();
                assert!(
                    got.distance(wanted) < 1e-2 * (1.0 + wanted.length()),
                    "{}: {got} for {wanted}",
                    row.name
                );
                let wanted = slope(&|_, o| o);
                let got = Vec3::from_array(found.occupancy_slope).as_dvec3();
                assert!(
                    got.distance(wanted) < 2e-3 * (o + wanted.length()),
                    "{}: {got} for {wanted}",
                    row.name
                );
            }
        }
    }

    #[test]
    fn points_hold_the_field_and_list_what_is_drawn_there() {
        let field = Field { background: -20.0, ..Field::default() };
        let splats = splats(200);
        let Points { values, of_points, of_splats, .. } =
            splat_points(&splats, &field, None).expect("points").points;
        assert_eq!((values.len(), of_points.len(), of_splats.len()), (800, 800, 200));
        // Each splat has its own four points, at the mean of q in what it draws.
        let places: Vec<Vec3> = splats.iter().flat_map(|s| Bump::new(s, &field).points()).collect();
        let q = |splat: &Splat, place: Vec3| {
            Bump::new(splat, &field).whitened(place).map_or(f32::INFINITY, Vec3::length_squared)
        };
        assert!((0..800).all(|i| (q(&splats[i / 4], places[i]) - 3.6).abs() < 1e-2));
        let mut left: Vec<usize> = (0..800).collect();
        for (point, [v, o]) in values.iter().enumerate() {
            // Points are found again by their value, since they are numbered anew.
            let (at, _) = left
                .iter()
                .enumerate()
                .map(|(at, &i)| {
                    let (value, occupancy) = field_at(&splats, &field, places[i].as_dvec3());
                    (at, (value - f64::from(*v)).abs() + 1e3 * (occupancy - f64::from(*o)).abs())
                })
                .min_by(|a, b| a.1.total_cmp(&b.1))
                .expect("a point");
            let place = places[left.swap_remove(at)];
            let (value, occupancy) = field_at(&splats, &field, place.as_dvec3());
            assert!((value - f64::from(*v)).abs() < 1e-2 && (occupancy - f64::from(*o)).abs() < 1e-4);
            let drawn = |s: &Splat| (1.0 - q(s, place) / 6.0).max(0.0).powf(1.5);
            let listed = of_points.of(point);
            let wanted: Vec<usize> = (0..200).filter(|&i| drawn(&splats[i]) > LEAST_PROFILE).collect();
            let mut found: Vec<usize> = listed.iter().map(|pair| (pair >> 8) as usize).collect();
            found.sort_unstable();
            assert_eq!(found, wanted);
            for pair in listed {
                let splat = (pair >> 8) as usize;
                let profile = (pair & 255) as f32 / 255.0;
                assert!((profile - drawn(&splats[splat])).abs() < 1.0 / 255.0);
                assert!(of_splats.of(splat).iter().any(|&back| index_of(back) == point));
            }
        }
        assert_eq!(of_points.rows.len(), of_splats.rows.len());
        let greatest = |splat| of_splats.of(splat).iter().map(|&pair| weight_of(pair)).fold(0.0, f32::max);
        assert!((0..200).all(|splat| greatest(splat) == 1.0), "weights are relative to the greatest");
    }

    #[test]
    fn many_splats_in_one_place_do_not_take_the_memory_of_all_their_pairs() {
        let one = splats(1)[0];
        let Points { of_points, .. } =
            splat_points(&[one; 3000], &Field::default(), None).expect("points").points;
        assert!((0..of_points.len()).all(|i| of_points.of(i).len() == MOST_AT_A_POINT));
        // Of fewer pairs there are fewer points, then fewer splats at each: what is not listed is not drawn.
        let field = Field::default();
        let bumps = vec![Bump::new(&one, &field); 3000];
        let medium = Medium { bumps: &bumps, field: &field, decoded: None };
        for (most, points) in
            [(12_000 * 128, 12_000), (6_000 * 128, 6_000), (3_000 * 128, 3_000), (9_000, 3_000)]
        {
            let Points { of_points, of_splats, .. } = medium.points_with(most).points;
            assert_eq!((of_points.len(), of_points.rows.len()), (points, most));
            assert_eq!(of_splats.rows.len(), most);
        }
    }

    #[test]
    fn the_order_of_splats_changes_only_rounding() {
        let field = Field::default();
        let forward = splats(400);
        let backward: Vec<Splat> = forward.iter().rev().copied().collect();
        let [a, b] = [&forward, &backward].map(|s| splat_points(s, &field, None).expect("points"));
        for (a, b) in a.points.shares.iter().zip(b.points.shares.iter().rev()) {
            assert!((a - b).abs() <= 1e-5 * a, "{a} {b}");
        }
        assert!(splat_points(&[], &field, None).expect("no points").centres.is_empty());
    }
}
