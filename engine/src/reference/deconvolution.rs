//! `deconvolve_points` and `deconvolve_splats`: the medium that each splat draws in mode alpha.

use glam::{DVec3, DVec4};

use crate::passes::Lists;
use crate::passes::deconvolution::{Points, ROUNDS, index_of, profile_of};
use crate::transfer::Table;

/// Greatest extinction, 1/mm.
const MOST_EXTINCTION: f64 = 0.7;
const LEAST_DRAWN: f64 = 1e-9;
const LEAST_MEDIUM: f64 = 1e-7;
/// A round multiplies by no less and no more than these.
const FACTORS: [f64; 2] = [0.05, 8.0];

/// Returns extinction times colour, and extinction, 1/mm, of each splat after `rounds` rounds.
pub fn media(points: &Points, table: &Table, rounds: u32) -> Vec<DVec4> {
    let wanted: Vec<DVec4> =
        points.values.iter().map(|&[v, o, _]| medium(table, v.into(), o.into())).collect();
    let first = means(points, &wanted);
    let mut media: Vec<DVec4> = first
        .iter()
        .zip(&points.beginnings)
        .map(|(mean, &[share, _])| (*mean * f64::from(share)).max(DVec4::splat(LEAST_MEDIUM)))
        .collect();
    for round in 1..rounds {
        let ratios: Vec<DVec4> = (wanted.iter().enumerate())
            .map(|(i, wanted)| {
                let drawn: DVec4 =
                    pairs(&points.of_points, i).map(|(splat, profile)| media[splat] * profile).sum();
                *wanted / drawn.max(DVec4::splat(LEAST_DRAWN))
            })
            .collect();
        for (medium, mean) in media.iter_mut().zip(means(points, &ratios)) {
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

/// Returns the mean of the points' rows over what each splat draws.
fn means(points: &Points, rows: &[DVec4]) -> Vec<DVec4> {
    let lists = &points.of_splats;
    let mean = |splat| {
        let of_each =
            pairs(lists, splat).map(|(i, profile)| (rows[i], profile * f64::from(points.values[i][2])));
        let (sum, whole) =
            of_each.fold((DVec4::ZERO, 0.0), |(sum, whole), (row, w)| (sum + row * w, whole + w));
        if whole > 0.0 { sum / whole } else { DVec4::ZERO }
    };
    (0..lists.len()).map(mean).collect()
}

/// Returns the index and the profile of each pair of a list.
fn pairs(lists: &Lists, list: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
    lists.of(list).iter().map(|&pair| (index_of(pair), f64::from(profile_of(pair))))
}
