//! Lays out the whole picture: slices of CT, splats and difference above shaded views of both, with their
//! scales.

use std::path::Path;

use engine::Result;
use engine::image::{Align, shortened};
use engine::output::write_atomic;

use super::canvas::{Canvas, Colour, TITLE, WORDS};
use super::slices::{self, PANEL};
use super::solid::Solids;
use super::subject::{Subject, diverging, grey};

const GAP: usize = 16;
const MARGIN: usize = 24;
const WIDTH: usize = 2 * MARGIN + 3 * PANEL + 2 * GAP;
/// Width of a colour bar, pixels.
const BAR: usize = 260;

const BACKGROUND: Colour = [20, 21, 24];
const TEXT: Colour = [235, 235, 235];
const DIM_TEXT: Colour = [166, 172, 182];

/// Width of a shaded view, and its greatest height, pixels.
pub const SOLID: [usize; 2] = [(WIDTH - 2 * MARGIN - GAP) / 2, 560];

/// Draws the picture and writes it as PNG. `title` is its first line, `lines` are the ones below.
pub fn write(
    path: &Path,
    force: bool,
    subject: &Subject,
    solids: &Solids,
    title: &str,
    lines: &[String],
) -> Result<()> {
    let canvas = compose(subject, solids, title, lines);
    write_atomic(path, force, |out| canvas.write_png(out))
}

fn compose(subject: &Subject, solids: &Solids, title: &str, lines: &[String]) -> Canvas {
    let solid_width = SOLID[0];
    let (rows, scale) = slices::layout(subject);

    let head = MARGIN + 30 + 22 * lines.len() + 14;
    let first_row = head + 26;
    let slices_end = first_row + rows.iter().map(|h| h + GAP).sum::<usize>();
    let solids_top = slices_end + 52 + 30;
    let height = solids_top + solids.height() + 60 + MARGIN;
    let mut canvas = Canvas::new(WIDTH, height, BACKGROUND);

    canvas.text([MARGIN, MARGIN], TITLE, Align::Left, TEXT, &shortened(title, TITLE, WIDTH - 2 * MARGIN));
    for (i, line) in lines.iter().enumerate() {
        canvas.text(
            [MARGIN, MARGIN + 34 + 22 * i],
            WORDS,
            Align::Left,
            DIM_TEXT,
            &shortened(line, WORDS, WIDTH - 2 * MARGIN),
        );
    }
    let left: [usize; 3] = std::array::from_fn(|i| MARGIN + i * (PANEL + GAP));
    for (name, x) in slices::columns(subject.name).iter().zip(left) {
        canvas.text([x + PANEL / 2, head], WORDS, Align::Middle, TEXT, name);
    }
    let mut top = first_row;
    for (row, height) in rows.iter().enumerate() {
        slices::draw_row(&mut canvas, subject, row, left, top, scale);
        top += height + GAP;
    }

    let ([low, high], unit) = (subject.window(), subject.unit);
    let hu = |v: f32| format!("{v:.0}");
    let middle = (left[0] + left[1] + PANEL) / 2;
    bar(&mut canvas, [middle, slices_end], [&hu(low), "", &format!("{}{unit}", hu(high))], |t| {
        grey(t as f32)
    });
    let ends = [&format!("-{}", hu(subject.difference)), "0", &format!("+{}{unit}", hu(subject.difference))];
    bar(&mut canvas, [left[2] + PANEL / 2, slices_end], ends.map(|t| t as &str), |t| {
        diverging(2.0 * t as f32 - 1.0)
    });

    let seen = solids.transfer();
    let solid_names = [format!("{} in the region, {seen}", subject.name), format!("splats, {seen}")];
    for (i, name) in solid_names.iter().enumerate() {
        let x = MARGIN + i * (solid_width + GAP);
        canvas.text([x + solid_width / 2, solids_top - 26], WORDS, Align::Middle, TEXT, name);
        solids.draw(&mut canvas, i, [x, solids_top], BACKGROUND);
    }
    let [low, high] = subject.percentiles.map(hu);
    let end = solids_top + solids.height() + 16;
    bar(&mut canvas, [WIDTH / 2, end], [&low, "", &format!("{high}{unit}")], |t| solids.ramp(t));
    canvas
}

/// Draws a horizontal colour bar with labels at its ends and its middle; `at` is the middle of its top edge.
fn bar(canvas: &mut Canvas, at: [usize; 2], labels: [&str; 3], colour: impl Fn(f64) -> Colour) {
    let x = at[0] - BAR / 2;
    canvas.image([x, at[1]], [BAR, 12], |column, _| colour(column as f64 / (BAR - 1) as f64));
    for (share, label) in labels.into_iter().enumerate() {
        canvas.text([x + share * BAR / 2, at[1] + 18], WORDS, Align::Middle, DIM_TEXT, label);
    }
}
