//! `deconvolve_points` and `deconvolve_splats`: the medium that each splat draws in mode alpha.

use glam::{DVec3, DVec4};
use shader_interface::deconvolution::ROUNDS;

use transfer::Table;

/// Greatest extinction, 1/mm.
const MOST_EXTINCTION: f64 = 0.7;
const LEAST_DRAWN: f64 = 1e-9;
const MOST_RATIO: f64 = 64.0;
const LEAST_MEDIUM: f64 = 1e-7;
/// A round multiplies by no less and no more than these.
const FACTORS: [f64; 2] = [0.05, 8.0];

/// A list of indices with weights.
pub type List = Vec<(usize, f64)>;

/// Points in splats.
pub struct Points<'a> {
    /// V and O at each point.
    pub values: &'a [[f32; 2]],
    /// For each point the splats that are drawn there, with their profiles.
    pub of_points: &'a [List],
    /// For each splat the points at which it is drawn, with their weights in its mean.
    pub of_splats: &'a [List],
    /// Share of the medium around it with which each splat begins.
    pub shares: &'a [f32],
}

/// Returns extinction times colour, and extinction, 1/mm, of each splat after `rounds` rounds.
pub fn media(points: &Points<'_>, table: &Table, rounds: u32) -> Vec<DVec4> {
    let wanted: Vec<DVec4> = points.values.iter().map(|&[v, o]| medium(table, v.into(), o.into())).collect();
    let first = means(points.of_splats, &wanted);
    let begin = |(mean, &share): (&DVec4, &f32)| {
        if mean.w > 0.0 { (*mean * f64::from(share)).max(DVec4::splat(LEAST_MEDIUM)) } else { DVec4::ZERO }
    };
    let mut media: Vec<DVec4> = first.iter().zip(points.shares).map(begin).collect();
    for round in 1..rounds.min(ROUNDS + 1) {
        let ratio = |(wanted, splats): (&DVec4, &List)| {
            let drawn: DVec4 = splats.iter().map(|&(splat, profile)| media[splat] * profile).sum();
            (*wanted / drawn.max(DVec4::splat(LEAST_DRAWN))).min(DVec4::splat(MOST_RATIO))
        };
        let ratios: Vec<DVec4> = wanted.iter().zip(points.of_points).map(ratio).collect();
        for (medium, mean) in media.iter_mut().zip(means(points.of_splats, &ratios)) {
            let factor = mean.clamp(DVec4::splat(FACTORS[0]), DVec4::splat(FACTORS[1]));
            *medium *= if round < ROUNDS { factor * factor } else { factor };
        }
    }
    media
}

/// Returns the medium that a function makes of V and O: extinction times colour, and extinction, 1/mm.
fn medium(table: &Table, value: f64, occupancy: f64) -> DVec4 {
    let (colour, extinction): (DVec3, f64) = table.point(value);
    let extinction = (-(1.0 - occupancy * (1.0 - (-extinction).exp())).ln()).min(MOST_EXTINCTION);
    colour.extend(1.0) * extinction
}

/// Returns the weighted mean of the rows of each list; 0 of an empty one.
fn means(lists: &[List], rows: &[DVec4]) -> Vec<DVec4> {
    let mean = |list: &List| {
        let sum: DVec4 = list.iter().map(|&(i, weight)| rows[i] * weight).sum();
        let whole: f64 = list.iter().map(|&(_, weight)| weight).sum();
        if whole > 0.0 { sum / whole } else { DVec4::ZERO }
    };
    lists.iter().map(mean).collect()
}
