//! The exceptions of files of version 1: voxels on the other side of the mask than their splats say, along a Morton
//! curve.

use super::coder::{Decoder, Tree};
use super::morton::{self, Gaps};
use crate::Grid;
use crate::region::Exception;

/// Reads `count` exceptions of a grid; `None` if the bytes are none.
pub fn decode(bytes: &[u8], count: usize, grid: &Grid) -> Option<Vec<Exception>> {
    let mut found = Vec::new();
    found.try_reserve_exact(count).ok()?;
    let (mut gaps, mut insides, mut input) = (Gaps::default(), insides(), Decoder::new(bytes));
    let (mut last, mut before) = (0, false);
    for k in 0..count {
        let code = gaps.read(last, &mut input)?;
        let inside = input.number(&mut insides[usize::from(before)]) == 1;
        let place = morton::place(code);
        let within = (0..3).all(|axis| place[axis] < u64::from(grid.size[axis]));
        let twice = k > 0 && code == last;
        if !within || twice || input.is_beyond() {
            return None;
        }
        found.push(Exception { voxel: place.map(|index| index as u32), inside });
        (last, before) = (code, inside);
    }
    Some(found)
}

/// Returns the models of whether an exception is inside, by whether the one before it is.
fn insides() -> [Tree; 2] {
    [Tree::new(1), Tree::new(1)]
}
