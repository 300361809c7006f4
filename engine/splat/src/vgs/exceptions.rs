//! Exceptions as bytes: along a Morton curve, since they lie in heaps on the faces of the mask.

use super::coder::{Decoder, Encoder, Tree};
use super::morton::{self, Gaps};
use crate::{Exception, Grid};

/// Returns the bytes of exceptions.
pub fn encode(exceptions: &[Exception]) -> Vec<u8> {
    if exceptions.is_empty() {
        return Vec::new();
    }
    let code = |exception: &Exception| morton::code(exception.voxel.map(u64::from));
    let mut ordered: Vec<_> = exceptions.iter().map(|e| (code(e), e.inside)).collect();
    ordered.sort_unstable();
    let (mut gaps, mut insides, mut out) = (Gaps::default(), insides(), Encoder::default());
    let (mut last, mut before) = (0, false);
    for (code, inside) in ordered {
        gaps.write(code - last, &mut out);
        out.number(&mut insides[usize::from(before)], u32::from(inside));
        (last, before) = (code, inside);
    }
    out.finish()
}

/// Reads `count` exceptions of a grid, and returns them in ascending order of z, y, x; `None` if the bytes are
/// none.
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
        let [x, y, z] = place.map(|index| u16::try_from(index).ok());
        found.push(Exception { voxel: [x?, y?, z?], inside });
        (last, before) = (code, inside);
    }
    found.sort_unstable_by_key(|exception| exception.index(grid));
    Some(found)
}

/// Returns the models of whether an exception is inside, by whether the one before it is.
fn insides() -> [Tree; 2] {
    [Tree::new(1), Tree::new(1)]
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::*;

    #[test]
    fn exceptions_come_back_and_are_small() {
        let grid = Grid { size: [300, 40, 65_535], world_from_voxel: DAffine3::IDENTITY };
        let sheet = (0..9000u64).map(|i| (i * 7 % 300) + 300 * (i % 40) + 12_000 * (i / 300));
        let all: Vec<u64> = sheet.chain([12_000 * 65_534]).collect();
        let mut all: Vec<_> =
            all.iter().filter_map(|&index| Exception::at(index, index % 3 == 0, &grid)).collect();
        all.sort_unstable_by_key(|exception| exception.index(&grid));
        all.dedup();
        for count in [0, 1, 2, all.len()] {
            let some = &all[..count];
            let bytes = encode(some);
            assert_eq!(decode(&bytes, count, &grid).as_deref(), Some(some));
            assert!(bytes.len() <= 16 + 2 * count, "{} bytes for {count}", bytes.len());
            if count > 2 {
                assert_eq!(decode(&bytes[..bytes.len() / 2], count, &grid), None, "half of the bytes");
                let small = Grid { size: [300, 40, 20], ..grid };
                assert_eq!(decode(&bytes, count, &small), None, "voxels beyond the grid");
            }
        }
    }
}
