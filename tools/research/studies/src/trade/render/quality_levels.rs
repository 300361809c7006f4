//! Chooses the quality levels of the frame budget from what was measured.

use std::fmt::Write;

use engine::render::SplatKind;

use super::averages::Averages;
use super::plan::Choice;

use crate::trade::front::{Point, front};

/// Greatest cost of a quality level as a part of the one above it: with smaller steps the controller would go
/// up and down between levels whose difference is hidden by noise.
const STEP: f64 = 0.85;

/// Returns the quality levels for splats of this kind: from the best choice down along the front of PSNR
/// against cost.
pub fn levels_of(kind: SplatKind, rows: &[Averages]) -> Vec<Averages> {
    let best = Choice::best(kind);
    let Some(first) = rows.iter().find(|row| row.choice == best) else { return Vec::new() };
    let fits = |choice: &Choice| {
        choice.can_be_level()
            && choice.of_grid == best.of_grid
            && (kind != SplatKind::Coloured || choice.mode == best.mode)
    };
    let mut cheaper: Vec<&Averages> =
        rows.iter().filter(|row| fits(&row.choice) && row.cost < first.cost).collect();
    let points: Vec<Point> = cheaper.iter().map(|row| Point { cost: row.cost, gain: row.psnr }).collect();
    let mut on = front(&points).into_iter();
    cheaper.retain(|_| on.next().unwrap_or(false));
    cheaper.sort_by(|a, b| b.cost.total_cmp(&a.cost));
    let mut levels = vec![first.clone()];
    for row in cheaper {
        if levels.last().is_some_and(|last| row.cost <= STEP * last.cost) {
            levels.push(row.clone());
        }
    }
    levels
}

/// Writes the quality levels as TOML, as `engine::render::quality_levels` reads it.
pub fn toml(rows: &[Averages], device: &str) -> String {
    let mut out = format!(
        "# The levels of engine::render::quality_levels, the best first. Written by \
         `studies trade render --levels`,\n\
         # which measured them on\n\
         # {device}.\n\
         # field: splats that are right between the voxels, too; grid: those fitted for a CT's grid; \
         coloured: standard\n\
         # 3DGS files (measured with the first). coarseness: distance of slabs, standard deviations, or of \
         samples, voxels.\n\
         # cost: of a frame, relative to the first level; psnr: against the CT, dB, mean over cases, transfer \
         functions\n\
         # and views.\n"
    );
    for kind in SplatKind::ALL {
        let levels = levels_of(kind, rows);
        let whole = levels.first().map_or(1.0, |row| row.cost);
        for row in levels {
            let quality = row.choice.quality();
            // Writing to a string cannot fail.
            let _ = write!(
                out,
                "\n[[{}]]\nmode = \"{}\"\nresolution = {:?}\ncoarseness = {:?}\ncost = {:.3}\npsnr = {:.2}\n",
                kind.name(),
                row.choice.mode,
                quality.resolution,
                quality.coarseness,
                row.cost / whole,
                row.psnr
            );
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(choice: Choice, cost: f64, psnr: f64) -> Averages {
        Averages {
            choice,
            cost,
            ms: 10.0 * cost,
            device_ms: cost,
            psnr,
            worst_psnr: psnr,
            ssim: 0.9,
            flip: 0.1,
        }
    }

    #[test]
    fn quality_levels_follow_the_front_in_steps() {
        let field = Choice::best(SplatKind::Field);
        let alpha = |resolution: f64| Choice { resolution, ..Choice::usual("alpha") };
        let rows = [
            row(Choice::usual("exact"), 5.0, 40.0),
            row(field.clone(), 1.0, 38.0),
            // Hardly cheaper than the first.
            row(Choice { step: 1.5, ..field.clone() }, 0.9, 37.0),
            row(Choice { step: 2.0, ..field.clone() }, 0.7, 36.0),
            // Dearer and worse.
            row(alpha(1.0), 0.75, 30.0),
            row(alpha(0.7), 0.4, 29.0),
            // Cannot be a quality level.
            row(Choice { packed: true, ..field.clone() }, 0.5, 37.9),
            row(alpha(0.5), 0.2, 25.0),
            // Leaves something out.
            row(Choice { splats: 0.3, ..field.clone() }, 0.3, 35.0),
            // Other splats.
            row(Choice::best(SplatKind::Grid), 0.5, 45.0),
            row(Choice::of_grid(), 0.3, 40.0),
            // Finer than the best level.
            row(Choice { step: 0.1, resolution: 0.5, ..Choice::of_grid() }, 0.2, 39.0),
        ];
        let costs = |kind| levels_of(kind, &rows).iter().map(|r| r.cost).collect::<Vec<_>>();
        assert_eq!(costs(SplatKind::Field), [1.0, 0.7, 0.4, 0.2]);
        assert_eq!(costs(SplatKind::Grid), [0.5, 0.3]);
        assert_eq!(costs(SplatKind::Coloured), [0.75, 0.4, 0.2]);
        let read: toml::Table = toml(&rows, "a device").parse().expect("TOML");
        assert_eq!(read["field"].as_array().map(Vec::len), Some(4));
        assert_eq!(read["field"][1]["coarseness"].as_float(), Some(2.0));
        assert_eq!(read["grid"][0]["coarseness"].as_float(), Some(0.25));
        assert_eq!(read["grid"][1]["cost"].as_float(), Some(0.6));
        assert!(levels_of(SplatKind::Field, &rows[2..]).is_empty(), "no levels without the first");
    }
}
