//! What lies between thick slices: a finer pitch along the one axis along which voxels are much longer.
//!
//! Every slice of the volume stays as it is, bit for bit; between two of them come [`FinerSlices::factor`] - 1 others,
//! by one cubic along the line on which a structure goes from slice to slice ([`Displacements`]): the monotone one of
//! Fritsch and Butland ("A method for constructing local monotone piecewise cubic interpolants", 1984), which stays
//! within the range of the two slices there.
//!
//! - **Intensities** are interpolated as they are.
//! - **Binary masks and labels** are interpolated by shape (Raya and Udupa, "Shape-based interpolation of
//!   multidimensional objects", 1990): by the signed distance of each pixel to the outline in its slice, mm. Inside is
//!   what is at least 0, and of several labels the one that lies deepest counts.
//! - **Soft masks** are interpolated linearly on that line.
//!
//! Nothing is added before the first slice and after the last.

mod displacement;
mod grid;

use std::borrow::Cow;
use std::ops::Range;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

pub use displacement::Displacements;
pub use grid::FinerSlices;

use super::distance::lower_envelope;
use super::{Roi, Volume};

/// Pixels beside a region, in its slice, that still count as near it: as far as fits look around it, and more.
const MARGIN: usize = 8;
/// Greatest distance that counts, in slices: what lies deeper ends no farther from its last slice, so that the tip of
/// one rib does not depend on how far the next rib is.
const REACH: f64 = 1.5;

/// What lies between the slices of a volume whose voxels are much longer along one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BetweenSlices {
    /// Other slices: intensities by a cubic, masks by their shape.
    #[default]
    Smooth,
    /// Nothing: neighbours are interpolated linearly where they are shown.
    Linear,
}

impl BetweenSlices {
    /// Every value with its name in files and flags.
    pub const NAMES: [(&'static str, BetweenSlices); 2] =
        [("smooth", BetweenSlices::Smooth), ("linear", BetweenSlices::Linear)];

    /// Returns the finer grid of a volume; `None` if there is none to be made.
    pub fn finer(self, volume: &Volume) -> Option<FinerSlices> {
        match self {
            BetweenSlices::Smooth => FinerSlices::of(volume.size, &volume.world_from_voxel),
            BetweenSlices::Linear => None,
        }
    }

    /// Returns a volume and its region as they are shown: on the finer grid, if there is one. If memory does not hold
    /// that, they are shown as they are, with a warning.
    pub fn shown<'a>(
        self,
        volume: &'a Volume,
        roi: Option<&'a Roi>,
    ) -> (Cow<'a, Volume>, Option<Cow<'a, Roi>>) {
        let plain = (Cow::Borrowed(volume), roi.map(Cow::Borrowed));
        let Some(finer) = self.finer(volume) else { return plain };
        if let Err(error) = finer.require_memory() {
            tracing::warn!("shown with steps from slice to slice: {error}");
            return plain;
        }
        let along = Displacements::of(&finer, volume);
        let fine = finer.volume(volume, roi, &along);
        let roi = roi.map(|roi| Cow::Owned(finer.roi(roi, &fine, &along)));
        (Cow::Owned(fine), roi)
    }
}

impl FinerSlices {
    /// Returns the volume with more slices. A voxel between two of which one is not finite is NaN. Of a region only what
    /// is near it is interpolated, by which a fit or a picture of it is the same; the rest has the values of the slice
    /// below.
    ///
    /// # Panics
    /// If the volume or the region has another size.
    pub fn volume(&self, volume: &Volume, roi: Option<&Roi>, along: &Displacements) -> Volume {
        assert_eq!(volume.size, self.coarse_size, "a volume of the grid");
        let near = roi.map(|roi| self.near_region(roi, along));
        let samples = self.fill(&volume.samples, |below, t, pixel| {
            let is_near = |slice| near.as_ref().is_none_or(|near| near[self.index(slice, pixel)]);
            if !is_near(below) && !is_near(below + 1) {
                return volume.samples[self.index(below, pixel)];
            }
            let near = |by| self.near(&volume.samples, below, t, pixel, by);
            let found = cubic(near(along.at(below, pixel)), t);
            // Beside a hole a line may lead into it where the column does not.
            if found.is_finite() { found as f32 } else { cubic(near([0.0; 2]), t) as f32 }
        });
        Volume {
            size: self.size(),
            world_from_voxel: self.world_from_voxel(),
            samples,
            oriented: volume.oriented,
            labels: volume.labels.clone(),
            frame_of_reference: volume.frame_of_reference.clone(),
            stated_unit: Some(volume.unit()),
            part_of: None,
        }
    }

    /// Returns the region with more slices, without the voxels at which `finer`, the [volume](Self::volume) with more
    /// slices, is not finite.
    ///
    /// # Panics
    /// If the region or the volume has another size.
    pub fn roi(&self, roi: &Roi, finer: &Volume, along: &Displacements) -> Roi {
        assert_eq!((roi.size, finer.size), (self.coarse_size, self.size()), "a region of the grid");
        let mut weight = if roi.soft {
            self.fill(&roi.weight, |below, t, pixel| {
                let [_, b, c, _] = self.near(&roi.weight, below, t, pixel, along.at(below, pixel));
                (b + (c - b) * t).clamp(0.0, 1.0) as f32
            })
        } else {
            let mask: Vec<u8> = roi.weight.par_iter().map(|&w| u8::from(w > 0.0)).collect();
            self.labels(&mask, along).into_par_iter().map(f32::from).collect()
        };
        weight.par_iter_mut().zip(&finer.samples).filter(|(_, v)| !v.is_finite()).for_each(|(w, _)| *w = 0.0);
        Roi { size: self.size(), weight, soft: roi.soft }
    }

    /// Returns labels (0: none) with more slices. Each label is interpolated by its own shape; where several are, the
    /// one counts whose outline is farthest.
    ///
    /// # Panics
    /// If there is not one label for every voxel of the grid.
    pub fn labels(&self, values: &[u8], along: &Displacements) -> Vec<u8> {
        let boxes = self.boxes(values);
        let is_there = |label: &u8| boxes.iter().any(|of_slice| of_slice[usize::from(*label)].is_some());
        let labels: Vec<u8> = (1..=u8::MAX).filter(is_there).collect();
        // The slices that are there already have their labels; between them none has one yet.
        let mut out = self.fill(values, |_, _, _| 0);
        let mut deepest = if labels.len() > 1 { vec![0.0f32; out.len()] } else { Vec::new() };
        for label in labels {
            let Some(shape) = Shape::of(self, values, label, &boxes, along.most) else { continue };
            let (inner, fine) = (self.inner(), self.size()[self.axis]);
            let place = |out: &mut [u8], mut deepest: Option<&mut [f32]>, chunk: usize| {
                let (o, slice) = (chunk / fine, chunk % fine);
                let (below, t) = self.between(slice);
                if t == 0.0 || !shape.is_in(below) && !shape.is_in(below + 1) {
                    return;
                }
                shape.each_column(o * inner..(o + 1) * inner, |column, pixel| {
                    let depth = cubic(shape.near(below, t, pixel, along.at(below, pixel)), t) as f32;
                    let at = column - o * inner;
                    let wins = match &mut deepest {
                        Some(deepest) => depth > deepest[at] || depth == 0.0 && out[at] == 0,
                        None => true,
                    };
                    if depth >= 0.0 && wins {
                        out[at] = label;
                        if let Some(deepest) = &mut deepest {
                            deepest[at] = depth;
                        }
                    }
                });
            };
            if deepest.is_empty() {
                out.par_chunks_mut(inner).enumerate().for_each(|(chunk, out)| place(out, None, chunk));
            } else {
                out.par_chunks_mut(inner)
                    .zip(deepest.par_chunks_mut(inner))
                    .enumerate()
                    .for_each(|(chunk, (out, deepest))| place(out, Some(deepest), chunk));
            }
        }
        out
    }

    /// Returns true for each voxel of the grid beside which, in its slice, there is something of a region.
    fn near_region(&self, roi: &Roi, along: &Displacements) -> Vec<bool> {
        assert_eq!(roi.size, self.coarse_size, "a region of the grid");
        let mut near: Vec<bool> = roi.weight.par_iter().map(|&w| w > 0.0).collect();
        for (k, axis) in self.across().into_iter().enumerate() {
            let reach = 2 * along.most[k] + MARGIN;
            let (stride, count) =
                (self.coarse_size[..axis].iter().product::<usize>(), self.coarse_size[axis]);
            near.par_chunks_mut(stride * count).for_each(|lines| {
                for first in 0..stride {
                    let line: Vec<usize> = (0..count).filter(|i| lines[first + i * stride]).collect();
                    for at in line {
                        for i in at.saturating_sub(reach)..(at + reach + 1).min(count) {
                            lines[first + i * stride] = true;
                        }
                    }
                }
            });
        }
        near
    }

    /// Returns the values of the four nearest slices on the line through a pixel of the slice that lies `t` above slice
    /// `below`, which goes `by` pixels from one to the next; NaN beyond the first and the last slice.
    fn near(&self, values: &[f32], below: usize, t: f64, pixel: [usize; 2], by: [f32; 2]) -> [f64; 4] {
        let (size, count) = (self.slice_size(), self.coarse_size[self.axis]);
        NEAR.map(|slice| match nearby(below, slice, count) {
            Some(there) => {
                bilinear(size, on_line(pixel, by, slice, t), |pixel| values[self.index(there, pixel)])
            }
            None => f64::NAN,
        })
    }

    /// Returns the box of each label in each slice.
    fn boxes(&self, values: &[u8]) -> Vec<Vec<Option<Box2>>> {
        let [row, rows] = self.slice_size();
        let of_slice = |slice: usize| {
            let mut found: Vec<Option<Box2>> = vec![None; 1 << u8::BITS];
            for pixel in (0..rows).flat_map(|y| (0..row).map(move |x| [x, y])) {
                let label = usize::from(values[self.index(slice, pixel)]);
                if label > 0 {
                    let pixel = pixel.map(|at| at..at + 1);
                    let there = &mut found[label];
                    *there = Some(there.take().map_or(pixel.clone(), |b| around(&b, &pixel)));
                }
            }
            found
        };
        (0..self.coarse_size[self.axis]).into_par_iter().map(of_slice).collect()
    }

    /// Returns the values of the finer grid: those of `values` where it has a slice, and elsewhere `between` of the
    /// slice below, the distance from it in slices, and the pixel.
    fn fill<T: Copy + Default + Send + Sync>(
        &self,
        values: &[T],
        between: impl Fn(usize, f64, [usize; 2]) -> T + Sync,
    ) -> Vec<T> {
        let count = self.coarse_size[self.axis];
        assert_eq!(values.len(), self.coarse_size.iter().product::<usize>(), "a value for every voxel");
        let (inner, fine, [row, _]) = (self.inner(), self.size()[self.axis], self.slice_size());
        let mut out = vec![T::default(); self.size().iter().product()];
        out.par_chunks_mut(inner).enumerate().for_each(|(chunk, out)| {
            let (o, slice) = (chunk / fine, chunk % fine);
            let (below, t) = self.between(slice);
            if t == 0.0 {
                out.copy_from_slice(&values[(o * count + below) * inner..][..inner]);
                return;
            }
            for (column, out) in (o * inner..).zip(out) {
                *out = between(below, t, [column % row, column / row]);
            }
        });
        out
    }
}

/// Returns where the line through a pixel of the slice that lies `t` above another one meets the slice that is `slice`
/// above that; it goes `by` pixels from one slice to the next.
fn on_line(pixel: [usize; 2], by: [f32; 2], slice: isize, t: f64) -> [f64; 2] {
    let up = slice as f64 - t;
    std::array::from_fn(|k| pixel[k] as f64 + up * f64::from(by[k]))
}

/// Returns the bilinear sample of a slice of this size, clamped to its edge. A pixel counts only if it has weight.
fn bilinear(size: [usize; 2], at: [f64; 2], value: impl Fn([usize; 2]) -> f32) -> f64 {
    let low = |k: usize| at[k].clamp(0.0, size[k] as f64 - 1.0) as usize;
    let part = |k: usize| (at[k].clamp(0.0, size[k] as f64 - 1.0)).fract();
    let ([x, y], [fx, fy]) = ([low(0), low(1)], [part(0), part(1)]);
    let lerp = |a: f64, t: f64, b: &dyn Fn() -> f64| if t == 0.0 { a } else { a + (b() - a) * t };
    let row = |y: usize| lerp(f64::from(value([x, y])), fx, &|| f64::from(value([x + 1, y])));
    lerp(row(y), fy, &|| row(y + 1))
}

/// The four nearest slices, from the one below.
const NEAR: [isize; 4] = [-1, 0, 1, 2];

/// Returns the slice that is `by` slices from another one, if there is one.
fn nearby(slice: usize, by: isize, count: usize) -> Option<usize> {
    slice.checked_add_signed(by).filter(|&slice| slice < count)
}

/// First and last but one pixel along the two axes of a slice.
type Box2 = [Range<usize>; 2];

/// Returns the box around two others.
fn around(a: &Box2, b: &Box2) -> Box2 {
    std::array::from_fn(|k| a[k].start.min(b[k].start)..a[k].end.max(b[k].end))
}

/// Returns the monotone cubic through `b` at 0 and `c` at 1, at `t`, with `a` at -1 and `d` at 2: it stays between b
/// and c. Its slope at b and c is the harmonic mean of those to the neighbours on both sides, or 0 where these have
/// not the same sign; a neighbour beyond that is not finite does not count, and NaN is returned where b or c is not.
fn cubic([a, b, c, d]: [f64; 4], t: f64) -> f64 {
    if !(b.is_finite() && c.is_finite()) {
        return f64::NAN;
    }
    let middle = c - b;
    let slope = |beside: f64| match beside.is_finite() {
        true if beside * middle > 0.0 => 2.0 * beside * middle / (beside + middle),
        true => 0.0,
        false => middle,
    };
    let (at_b, at_c) = (slope(b - a), slope(d - c));
    let (t2, t3) = (t * t, t * t * t);
    let value = b + (3.0 * t2 - 2.0 * t3) * middle + (t3 - 2.0 * t2 + t) * at_b + (t3 - t2) * at_c;
    // Only rounding can lead out of the range.
    value.clamp(b.min(c), b.max(c))
}

/// A binary shape: the signed distance of each pixel to its outline, slice by slice, in the box that holds it.
struct Shape {
    /// Columns of the box, along the two axes of a slice.
    columns: Box2,
    /// Pixels of a row of a slice.
    row: usize,
    /// Signed distances of each slice, mm, positive inside; `None` where the slice has nothing of the shape.
    slices: Vec<Option<Vec<f32>>>,
    /// Greatest distance, mm; its negative stands for a slice without the shape.
    reach: f64,
}

impl Shape {
    /// Returns the shape of a label, of which these are the boxes in each slice, for lines that go at most `most` pixels
    /// from one slice to the next; `None` if no voxel has it.
    fn of(
        grid: &FinerSlices,
        values: &[u8],
        label: u8,
        boxes: &[Vec<Option<Box2>>],
        most: [usize; 2],
    ) -> Option<Shape> {
        let boxes: Vec<&Option<Box2>> = boxes.iter().map(|of_slice| &of_slice[usize::from(label)]).collect();
        let whole = boxes.iter().copied().flatten().cloned().reduce(|a, b| around(&a, &b))?;
        let (size, spacing) = (grid.slice_size(), grid.spacing_mm());
        let pixel_mm = grid.across().map(|axis| spacing[axis]);
        let reach = REACH * spacing[grid.axis];
        // A line through a pixel near the shape meets the slices beyond its neighbours twice as far away. Of any pixel in
        // the box of the shape the nearest one outside of the shape lies within one more pixel on each side.
        let wider = |k: usize| {
            let by = 4 * most[k] + 1;
            whole[k].start.saturating_sub(by)..(whole[k].end + by).min(size[k])
        };
        let columns = [wider(0), wider(1)];
        let (width, height) = (columns[0].len(), columns[1].len());
        let pixel = |i: usize| [columns[0].start + i % width, columns[1].start + i / width];
        let of_slice = |slice: usize| {
            boxes[slice].as_ref()?;
            let mask: Vec<bool> =
                (0..width * height).map(|i| values[grid.index(slice, pixel(i))] == label).collect();
            let to = |side: bool| distances(&mask, side, width, pixel_mm);
            let signed = |(out, into): (f32, f32)| (out - into).clamp(-reach as f32, reach as f32);
            Some(to(false).into_iter().zip(to(true)).map(signed).collect())
        };
        let slices = (0..boxes.len()).into_par_iter().map(of_slice).collect();
        Some(Shape { columns, row: size[0], slices, reach })
    }

    /// Returns true if a slice has something of the shape.
    fn is_in(&self, slice: usize) -> bool {
        self.slices.get(slice).is_some_and(Option::is_some)
    }

    /// Returns the distances in the four nearest slices on a line, as [`FinerSlices::near`], mm.
    fn near(&self, below: usize, t: f64, pixel: [usize; 2], by: [f32; 2]) -> [f64; 4] {
        let size = [self.columns[0].len(), self.columns[1].len()];
        let pixel = [pixel[0] - self.columns[0].start, pixel[1] - self.columns[1].start];
        NEAR.map(|slice| match nearby(below, slice, self.slices.len()).map(|there| &self.slices[there]) {
            Some(Some(distances)) => {
                bilinear(size, on_line(pixel, by, slice, t), |[x, y]| distances[y * size[0] + x])
            }
            Some(None) => -self.reach,
            None => f64::NAN,
        })
    }

    /// Calls `each` with every column of `range` in the box, and its pixel.
    fn each_column(&self, range: Range<usize>, mut each: impl FnMut(usize, [usize; 2])) {
        let [across, up] = &self.columns;
        let first = up.start.max(range.start / self.row);
        let last = up.end.min((range.end - 1) / self.row + 1);
        for y in first..last {
            let low = range.start.max(y * self.row + across.start);
            let high = range.end.min(y * self.row + across.end);
            for column in low..high {
                each(column, [column - y * self.row, y]);
            }
        }
    }
}

/// Returns the distance of each pixel of a slice to the nearest one of `side` in `mask`, mm, for rows of `width`
/// pixels and these distances of neighbours along and across a row; infinite if there is none.
fn distances(mask: &[bool], side: bool, width: usize, spacing: [f64; 2]) -> Vec<f32> {
    let mut parabolas = Vec::new();
    let mut squared: Vec<f32> = mask.iter().map(|&is| if is == side { 0.0 } else { f32::INFINITY }).collect();
    squared.chunks_mut(width).for_each(|row| lower_envelope(row, spacing[0], &mut parabolas));
    let mut line = vec![0.0; mask.len() / width];
    for x in 0..width {
        line.iter_mut().zip(squared[x..].iter().step_by(width)).for_each(|(to, from)| *to = *from);
        lower_envelope(&mut line, spacing[1], &mut parabolas);
        line.iter().zip(squared[x..].iter_mut().step_by(width)).for_each(|(from, to)| *to = from.sqrt());
    }
    squared
}

#[cfg(test)]
mod tests;
