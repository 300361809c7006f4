//! An adaptive binary range coder: integers in, as many bytes as they are surprising out.
//!
//! The coder is that of LZMA (32-bit range, carries resolved by delaying bytes); the probability of a bit is
//! the Krichevsky-Trofimov estimate of what was seen under its model, which follows slow changes. Only
//! integers are used, so every machine reads what any has written.

/// Range below which a byte is shifted out.
const TOP: u32 = 1 << 24;
/// Bits of a probability.
const PROBABILITY_BITS: u32 = 15;
/// A bit's probability moves by one part in at least this many, once that many have been seen.
const MEMORY: u16 = 250;

/// The probability of one bit, learned from the bits seen so far.
#[derive(Clone, Copy, Debug)]
pub struct Bit {
    /// Probability of a 0 in 1/65536.
    zero: u16,
    /// Number of bits seen, up to [`MEMORY`].
    seen: u16,
}

impl Bit {
    /// A bit of which nothing is known.
    pub const EVEN: Bit = Bit { zero: 1 << 15, seen: 0 };

    /// Returns the probability of a 0 in 1/65536.
    pub fn zero(self) -> u32 {
        u32::from(self.zero)
    }

    /// Returns where a range is divided: the part of a 0, neither empty nor whole.
    fn bound(self, range: u32) -> u32 {
        (range >> PROBABILITY_BITS) * u32::from(self.zero >> 1).clamp(32, (1 << PROBABILITY_BITS) - 32)
    }

    /// Learns a bit that was seen.
    pub fn learn(&mut self, bit: bool) {
        let (at, target) = (i32::from(self.zero), if bit { 0 } else { 65535 });
        self.zero = (at + (target - at) * 2 / (2 * i32::from(self.seen) + 3)) as u16;
        self.seen = (self.seen + 1).min(MEMORY);
    }
}

/// Models of the bits of a number of a fixed number of bits: one for each prefix.
#[derive(Clone, Debug)]
pub struct Tree {
    bits: u32,
    nodes: Vec<Bit>,
}

impl Tree {
    /// Creates the models of the numbers 0 to `last`, at most 65535.
    pub fn new(last: u32) -> Self {
        let bits = 32 - last.leading_zeros();
        assert!(bits <= 16, "{last} is too many for a tree");
        Tree { bits, nodes: vec![Bit::EVEN; 1 << bits] }
    }
}

/// Writes bits, or reads them: what walks over the same decisions for both is written once.
pub trait Channel {
    /// Writes `bit` and returns it, or reads a bit and returns that. `zero` is the probability of a 0 in
    /// 1/65536, neither 0 nor 65536.
    fn bit(&mut self, bit: bool, zero: u32) -> bool;
}

impl Channel for Encoder {
    fn bit(&mut self, bit: bool, zero: u32) -> bool {
        self.divided((self.range >> 16) * zero, bit)
    }
}

impl Channel for Decoder<'_> {
    fn bit(&mut self, _: bool, zero: u32) -> bool {
        self.divided((self.range >> 16) * zero)
    }
}

/// Writes bits.
#[derive(Debug)]
pub struct Encoder {
    low: u64,
    range: u32,
    /// The last byte that a carry may still change, and the number of 255s behind it.
    pending: Option<u8>,
    full: usize,
    out: Vec<u8>,
}

impl Default for Encoder {
    fn default() -> Self {
        Encoder { low: 0, range: u32::MAX, pending: None, full: 0, out: Vec::new() }
    }
}

impl Encoder {
    /// Writes a number of the range of `tree`.
    pub fn number(&mut self, tree: &mut Tree, number: u32) {
        let mut node = 1;
        for k in (0..tree.bits).rev() {
            let bit = number >> k & 1 == 1;
            self.modelled(&mut tree.nodes[node], bit);
            node = node << 1 | usize::from(bit);
        }
    }

    /// Writes a bit under its model.
    pub fn modelled(&mut self, model: &mut Bit, bit: bool) {
        let bound = model.bound(self.range);
        model.learn(bit);
        self.divided(bound, bit);
    }

    /// Writes a bit, `bound` being the part of the range that a 0 has.
    fn divided(&mut self, bound: u32, bit: bool) -> bool {
        if bit {
            self.low += u64::from(bound);
            self.range -= bound;
        } else {
            self.range = bound;
        }
        self.shift();
        bit
    }

    /// Writes one of `count` equally likely numbers, `count` at most 65536.
    pub fn even(&mut self, number: u32, count: u32) {
        self.range /= count;
        self.low += u64::from(self.range) * u64::from(number);
        self.shift();
    }

    fn shift(&mut self) {
        while self.range < TOP {
            self.range <<= 8;
            self.byte();
        }
    }

    /// Moves the upper byte of `low` out.
    fn byte(&mut self) {
        let carry = self.low > u64::from(u32::MAX);
        let top = (self.low >> 24) as u8;
        if top == 255 && !carry {
            self.full += 1;
        } else {
            if let Some(pending) = self.pending {
                self.out.push(pending.wrapping_add(u8::from(carry)));
            }
            let filler = if carry { 0 } else { 255 };
            self.out.extend(std::iter::repeat_n(filler, self.full));
            (self.full, self.pending) = (0, Some(top));
        }
        self.low = (self.low & 0x00ff_ffff) << 8;
    }

    /// Returns the bytes.
    pub fn finish(mut self) -> Vec<u8> {
        for _ in 0..5 {
            self.byte();
        }
        self.out
    }
}

/// Reads what an [`Encoder`] wrote. Other bytes give other numbers, each within its range.
#[derive(Debug)]
pub struct Decoder<'a> {
    code: u32,
    range: u32,
    bytes: std::slice::Iter<'a, u8>,
    /// Number of bytes that were asked for beyond the end.
    beyond: usize,
}

impl<'a> Decoder<'a> {
    /// Creates a reader of `bytes`.
    pub fn new(bytes: &'a [u8]) -> Self {
        let mut decoder = Decoder { code: 0, range: u32::MAX, bytes: bytes.iter(), beyond: 0 };
        for _ in 0..4 {
            decoder.code = decoder.code << 8 | decoder.byte();
        }
        decoder
    }

    /// Reads a number of the range of `tree`.
    pub fn number(&mut self, tree: &mut Tree) -> u32 {
        let mut node = 1;
        for _ in 0..tree.bits {
            let bit = self.modelled(&mut tree.nodes[node]);
            node = node << 1 | usize::from(bit);
        }
        node as u32 - (1 << tree.bits)
    }

    /// Reads a bit under its model.
    pub fn modelled(&mut self, model: &mut Bit) -> bool {
        let bit = self.divided(model.bound(self.range));
        model.learn(bit);
        bit
    }

    /// Reads a bit, `bound` being the part of the range that a 0 has.
    fn divided(&mut self, bound: u32) -> bool {
        let bit = self.code >= bound;
        if bit {
            self.code -= bound;
            self.range -= bound;
        } else {
            self.range = bound;
        }
        self.shift();
        bit
    }

    /// Reads one of `count` equally likely numbers.
    pub fn even(&mut self, count: u32) -> u32 {
        self.range /= count;
        let number = (self.code / self.range).min(count - 1);
        self.code -= number * self.range;
        self.shift();
        number
    }

    /// Returns true if more was read than was written.
    pub fn is_beyond(&self) -> bool {
        self.beyond > 0
    }

    fn shift(&mut self) {
        while self.range < TOP {
            self.range <<= 8;
            self.code = self.code << 8 | self.byte();
        }
    }

    fn byte(&mut self) -> u32 {
        self.bytes.next().map_or_else(
            || {
                self.beyond += 1;
                0
            },
            |&byte| u32::from(byte),
        )
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    use super::*;

    /// Writes numbers of both kinds and returns the bytes.
    fn written(numbers: &[(u32, u32)], last: u32) -> Vec<u8> {
        let (mut encoder, mut tree) = (Encoder::default(), Tree::new(last));
        for &(number, count) in numbers {
            if count == 0 {
                encoder.number(&mut tree, number);
            } else {
                encoder.even(number, count);
            }
        }
        encoder.finish()
    }

    #[test]
    fn what_was_written_is_read() {
        let mut rng = Pcg64::seed_from_u64(3);
        for (last, length) in [(0, 50), (1, 3000), (6, 0), (255, 1), (1000, 20_000), (65535, 500)] {
            for rare in [0.0, 0.02, 1.0] {
                let numbers: Vec<(u32, u32)> = (0..length)
                    .map(|_| match rng.random_bool(0.5) {
                        true => (if rng.random_bool(rare) { rng.random_range(0..=last) } else { last }, 0),
                        false => {
                            let count = 1 << rng.random_range(0..17u32);
                            (rng.random_range(0..count), count)
                        }
                    })
                    .collect();
                let bytes = written(&numbers, last);
                let (mut decoder, mut tree) = (Decoder::new(&bytes), Tree::new(last));
                for &(number, count) in &numbers {
                    let read = if count == 0 { decoder.number(&mut tree) } else { decoder.even(count) };
                    assert_eq!(read, number, "{last} {rare}");
                }
                assert!(!decoder.is_beyond());
            }
        }
    }

    #[test]
    fn bits_of_given_probabilities_are_read() {
        let mut rng = Pcg64::seed_from_u64(9);
        let bits: Vec<(bool, u32)> = (0..30_000)
            .map(|_| {
                let zero = [1, 24, 20_000, 65_535][rng.random_range(0..4)];
                (rng.random_range(0..65_536) >= zero, zero)
            })
            .collect();
        let mut encoder = Encoder::default();
        bits.iter().for_each(|&(bit, zero)| assert_eq!(encoder.bit(bit, zero), bit));
        let bytes = encoder.finish();
        let mut decoder = Decoder::new(&bytes);
        assert!(bits.iter().all(|&(bit, zero)| decoder.bit(false, zero) == bit));
        assert!(!decoder.is_beyond() && bytes.len() < 1000, "{} bytes", bytes.len());
    }

    #[test]
    fn the_length_is_the_entropy() {
        let mut rng = Pcg64::seed_from_u64(5);
        // Two dice: 3.27 bits.
        let numbers: Vec<_> =
            (0..50_000).map(|_| (rng.random_range(0..6u32) + rng.random_range(0..6u32), 0)).collect();
        let bits = written(&numbers, 10).len() as f64 * 8.0 / numbers.len() as f64;
        assert!((3.26..3.31).contains(&bits), "{bits} bits");
        let ten: Vec<_> = (0..10_000).map(|_| (rng.random_range(0..10), 10)).collect();
        let bits = written(&ten, 1).len() as f64 * 8.0 / ten.len() as f64;
        assert!((3.32..3.34).contains(&bits), "{bits} bits");
        let same = written(&vec![(7, 0); 100_000], 200).len();
        assert!(same < 1200, "{same} bytes");
    }

    #[test]
    fn any_bytes_give_numbers_in_their_range() {
        let mut rng = Pcg64::seed_from_u64(7);
        for length in [0, 3, 40] {
            let bytes: Vec<u8> = (0..length).map(|_| rng.random_range(0..=255)).collect();
            let (mut decoder, mut tree) = (Decoder::new(&bytes), Tree::new(100));
            for _ in 0..200 {
                assert!(decoder.number(&mut tree) < 128 && decoder.even(60_000) < 60_000);
            }
            assert!(decoder.is_beyond());
        }
    }
}
