//! A number near a prediction as decisions: is it there, on which side, how many cells away, where in its cell.
//!
//! Numbers are multiples of `step`, so that they stay what they are when they are coded again, among other
//! neighbours. Cells are of 2^k steps, about half as wide as the errors expected. How probable a decision is follows
//! from how often it came in the same context.

use super::coder::{Bit, Channel};

/// Bits of predictions and sizes behind the point.
pub const POINT: u32 = 6;
/// Largest size of a number.
pub const LARGEST: i64 = 1 << 28;
/// Number of contexts: the levels of an error, by the number of faces that are not inside, in the region and in its rim.
pub const CONTEXTS: usize = 2 * 7 * 32;
/// Classes of how far the prediction is from the number of the lattice nearest to it.
const OFFS: usize = 3;
/// Kinds of decisions: whether a number is outside the middle cell, the side, and from 2 on whether it is
/// farther than so many cells; then the first division of a cell, by its side, and all others.
const KINDS: usize = 24;
const HALVES: usize = 20;
const OTHERS: usize = 23;
/// Beyond this many cells, the rest is written as a number.
const FAR: i64 = 18;
const EVEN: u32 = 1 << 15;
/// Smallest probability of a decision, in 1/65536.
const LEAST: u32 = 24;

/// What is known of a number before it is decided.
pub struct Expected {
    /// The prediction and the size of its error, in 1/2^[`POINT`].
    pub prediction: i64,
    pub size: i64,
    /// What it has in common with others, below [`CONTEXTS`].
    pub context: usize,
}

/// What was learned of decisions.
pub struct Decisions {
    bits: Vec<[Bit; KINDS]>,
}

impl Default for Decisions {
    fn default() -> Self {
        Decisions { bits: vec![[Bit::EVEN; KINDS]; CONTEXTS * OFFS] }
    }
}

impl Decisions {
    /// Writes the number of the lattice nearest to `wanted`, or reads one, and returns it; `None` if it is
    /// larger than any.
    pub fn number<C: Channel>(&mut self, c: &mut C, e: &Expected, step: i64, wanted: i64) -> Option<i64> {
        let predicted = ((e.prediction + (1 << (POINT - 1))) >> POINT).clamp(-LARGEST / 2, LARGEST / 2);
        let centre = (predicted + step / 2).div_euclid(step) * step;
        // What lies on the side of the prediction is likelier, however that side is called.
        let off = predicted - centre;
        let sign = if off < 0 { -1 } else { 1 };
        let e = &Expected {
            context: e.context * OFFS + (off.abs() * 2 * OFFS as i64 / (step + 1)) as usize,
            ..*e
        };
        let bits = (0..26).find(|bits| step << (bits + POINT + 1) >= e.size).unwrap_or(26);
        let half = 1 << bits >> 1;
        let wanted = sign * (wanted - centre + step / 2).div_euclid(step) + half;
        let cell = self.cell(c, e, wanted >> bits)?;
        let most = ((2 * LARGEST / step) >> bits) + 2;
        if cell.abs() > most {
            return None;
        }
        let mut index = cell << bits;
        for bit in (0..bits).rev() {
            let first = bit + 1 == bits;
            let kind = if first { (HALVES as i64 + 1 + cell.signum()) as usize } else { OTHERS };
            index |= i64::from(self.decide(c, e, kind, wanted >> bit & 1 == 1)) << bit;
        }
        let number = centre + sign * (index - half) * step;
        (number.abs() <= LARGEST).then_some(number)
    }

    fn cell<C: Channel>(&mut self, c: &mut C, e: &Expected, wanted: i64) -> Option<i64> {
        if !self.decide(c, e, 0, wanted != 0) {
            return Some(0);
        }
        let up = self.decide(c, e, 1, wanted > 0);
        let mut far = 1;
        while far < FAR && self.decide(c, e, 1 + far as usize, wanted.abs() > far) {
            far += 1;
        }
        if far == FAR {
            far += rest(c, wanted.abs() - far)?;
        }
        Some(if up { far } else { -far })
    }

    fn decide<C: Channel>(&mut self, c: &mut C, e: &Expected, kind: usize, bit: bool) -> bool {
        let model = &mut self.bits[e.context][kind];
        let bit = c.bit(bit, model.zero().clamp(LEAST, 65_536 - LEAST));
        model.learn(bit);
        bit
    }
}

/// Writes or reads a number that nothing is known of: how many bits it has, and they.
fn rest<C: Channel>(c: &mut C, number: i64) -> Option<i64> {
    let number = number.max(0) + 1;
    let mut bits = 0;
    while c.bit(number >> bits > 1, EVEN) {
        bits += 1;
        if bits > 30 {
            return None;
        }
    }
    Some((0..bits).rev().fold(1, |read, bit| read << 1 | i64::from(c.bit(number >> bit & 1 == 1, EVEN))) - 1)
}
