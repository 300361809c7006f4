//! The rungs of the frame budget's ladder, from what was measured.

use std::fmt::Write;

use super::plan::Choice;
use super::report::Row;
use crate::trade::front::{Point, front};

/// A rung costs at most this part of the one above it: with smaller steps the controller would go up and down among rungs
/// whose difference its scatter hides.
const STEP: f64 = 0.8;

/// The ladder: from the usual slabs down along the front of PSNR against cost, as far as it goes.
pub fn rungs(rows: &[Row]) -> Vec<Row> {
    let Some(first) = rows.iter().find(|row| row.choice == Choice::usual("slab")) else { return Vec::new() };
    let mut cheaper: Vec<&Row> =
        rows.iter().filter(|row| row.choice.is_rung() && row.cost < first.cost).collect();
    let points: Vec<Point> = cheaper.iter().map(|row| Point { cost: row.cost, gain: row.psnr }).collect();
    let mut on = front(&points).into_iter();
    cheaper.retain(|_| on.next().unwrap_or(false));
    cheaper.sort_by(|a, b| b.cost.total_cmp(&a.cost));
    let mut ladder = vec![first.clone()];
    for row in cheaper {
        if ladder.last().is_some_and(|last| row.cost <= STEP * last.cost) {
            ladder.push(row.clone());
        }
    }
    ladder
}

/// As `engine::render::LADDER` reads it.
pub fn toml(rungs: &[Row], device: &str) -> String {
    let mut out = format!(
        "# The rungs of engine::render::LADDER, the best first. Written by `bench trade render --ladder`, which measured them on\n\
         # {device}.\n\
         # cost: of a frame, relative to the first rung; psnr: against the CT, dB, mean over cases, transfer functions and views.\n"
    );
    let whole = rungs.first().map_or(1.0, |row| row.cost);
    for row in rungs {
        let quality = row.choice.quality();
        // Writing to a string cannot fail.
        let _ = write!(
            out,
            "\n[[rung]]\nmode = \"{}\"\nresolution = {:?}\ncoarseness = {:?}\nsplats = {:?}\ncost = {:.3}\npsnr = {:.2}\n",
            row.choice.mode,
            quality.resolution,
            quality.coarseness,
            quality.splats,
            row.cost / whole,
            row.psnr
        );
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(choice: Choice, cost: f64, psnr: f64) -> Row {
        Row { choice, cost, ms: 10.0 * cost, device_ms: cost, psnr, worst_psnr: psnr, ssim: 0.9, flip: 0.1 }
    }

    #[test]
    fn a_ladder_follows_the_front_in_steps() {
        let slab = Choice::usual("slab");
        let alpha = |resolution: f64| Choice { resolution, ..Choice::usual("alpha") };
        let rows = [
            row(Choice::usual("exact"), 5.0, 40.0),
            row(slab.clone(), 1.0, 38.0),
            // Hardly cheaper than the slabs.
            row(Choice { step: 1.5, ..slab.clone() }, 0.9, 37.0),
            row(Choice { step: 2.0, ..slab.clone() }, 0.7, 36.0),
            // Dearer and worse.
            row(alpha(1.0), 0.75, 30.0),
            row(alpha(0.7), 0.4, 29.0),
            // Cannot be a rung.
            row(Choice { packed: true, ..slab.clone() }, 0.5, 37.9),
            row(alpha(0.5), 0.2, 25.0),
        ];
        let ladder = rungs(&rows);
        assert_eq!(ladder.iter().map(|r| r.cost).collect::<Vec<_>>(), [1.0, 0.7, 0.4, 0.2]);
        let text = toml(&ladder, "a device");
        let read: toml::Table = text.parse().expect("TOML");
        assert_eq!(read["rung"].as_array().map(Vec::len), Some(4));
        assert_eq!(read["rung"][1]["coarseness"].as_float(), Some(2.0));
        assert!(rungs(&rows[2..]).is_empty(), "no ladder without its first rung");
    }
}
