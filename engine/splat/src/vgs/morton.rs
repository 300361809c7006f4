//! Places along a Morton curve, and the gaps between those that a file has.

use super::coder::{Decoder, Encoder, Tree};

/// Bits of an index along each axis.
pub const AXIS_BITS: u32 = 21;
/// Bits of a gap below its highest that have models.
const GAP_BITS: u32 = 2;

/// Returns the code of the place with these indices along x, y, z, each of [`AXIS_BITS`] bits.
pub fn code(place: [u64; 3]) -> u64 {
    (0..AXIS_BITS)
        .rev()
        .fold(0, |code, bit| place.iter().fold(code, |code, axis| code << 1 | (axis >> bit & 1)))
}

/// Returns the indices of a place.
pub fn place(code: u64) -> [u64; 3] {
    let axis = |k: u32| (0..AXIS_BITS).fold(0, |index, bit| index | (code >> (3 * bit + 2 - k) & 1) << bit);
    [axis(0), axis(1), axis(2)]
}

/// Models of the gaps between ascending codes.
pub struct Gaps {
    bits: Tree,
    /// For each number of bits of a gap, the models of those below the highest.
    next: Vec<Tree>,
}

impl Default for Gaps {
    fn default() -> Self {
        Gaps { bits: Tree::new(63), next: vec![Tree::new((1 << GAP_BITS) - 1); 65] }
    }
}

impl Gaps {
    /// Writes a gap.
    pub fn write(&mut self, gap: u64, out: &mut Encoder) {
        let bits = u64::BITS - gap.leading_zeros();
        out.number(&mut self.bits, bits);
        let mut rest = bits.saturating_sub(1);
        if rest > GAP_BITS {
            rest -= GAP_BITS;
            out.number(&mut self.next[bits as usize], (gap >> rest) as u32 & ((1 << GAP_BITS) - 1));
        }
        while rest > 0 {
            let piece = rest.min(16);
            rest -= piece;
            out.even((gap >> rest) as u32 & ((1 << piece) - 1), 1 << piece);
        }
    }

    /// Reads a gap, and returns the code after it; `None` if there is no such place.
    pub fn read(&mut self, after: u64, input: &mut Decoder<'_>) -> Option<u64> {
        let bits = input.number(&mut self.bits);
        let mut gap = u64::from(bits > 0);
        let mut rest = bits.saturating_sub(1);
        if rest > GAP_BITS {
            rest -= GAP_BITS;
            gap = gap << GAP_BITS | u64::from(input.number(&mut self.next[bits as usize]));
        }
        while rest > 0 {
            let piece = rest.min(16);
            rest -= piece;
            gap = gap << piece | u64::from(input.even(1 << piece));
        }
        after.checked_add(gap).filter(|&code| code < 1 << (3 * AXIS_BITS))
    }
}
