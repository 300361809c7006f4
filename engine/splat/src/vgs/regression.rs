//! A linear prediction that is learned on the way: least squares over the samples of late.
//!
//! The sums of products are kept in integers, older samples fading, and the weights follow their minimum by one
//! round of coordinate descent every few samples, so no step size is chosen and nothing can diverge.

/// Number of terms of a sample, a multiple of eight: they are multiplied eight at a time.
pub const TERMS: usize = 24;
/// Largest size of a term: [`FADE`] · 8 products of two such stay below 2^31.
pub const LARGEST: i64 = 2047;
/// Bits of a weight behind the point.
pub const WEIGHT_BITS: u32 = 16;
/// Largest size of a weight.
const WEIGHT: i64 = 4 << WEIGHT_BITS;
/// After this many samples, what was learned before loses an eighth.
const FADE: u32 = 32;
/// Weights are improved after every so many samples.
const ROUND: u32 = 4;
/// Strength of the pull of the weights to those given, in squares of a term.
const PULL: i64 = 1 << 17;

/// Weights of the terms, and what they are learned from.
pub struct Regression {
    products: [[i32; TERMS]; TERMS],
    wanted: [i32; TERMS],
    seen: u32,
    /// The weights, in 1/2^[`WEIGHT_BITS`].
    pub weights: [i32; TERMS],
}

impl Regression {
    /// Creates a prediction that has these weights at first.
    pub fn new(weights: [i32; TERMS]) -> Self {
        Regression { products: [[0; TERMS]; TERMS], wanted: [0; TERMS], seen: 0, weights }
    }

    /// Returns the weighted sum of terms.
    pub fn predict(&self, terms: &[i16; TERMS]) -> i64 {
        let sum: i64 = self.weights.iter().zip(terms).map(|(&w, &t)| i64::from(w) * i64::from(t)).sum();
        sum >> WEIGHT_BITS
    }

    /// Learns what the sum should have been. Weights that are not determined are those of `home`.
    pub fn learn(&mut self, terms: &[i16; TERMS], sum: i16, home: &[i32; TERMS]) {
        for ((row, wanted), &term) in self.products.iter_mut().zip(&mut self.wanted).zip(terms) {
            if term != 0 {
                for (product, &other) in row.iter_mut().zip(terms) {
                    *product += i32::from(term) * i32::from(other);
                }
                *wanted += i32::from(term) * i32::from(sum);
            }
        }
        self.seen = self.seen.wrapping_add(1);
        if self.seen.is_multiple_of(FADE) {
            self.products
                .as_flattened_mut()
                .iter_mut()
                .chain(&mut self.wanted)
                .for_each(|sum| *sum -= *sum >> 3);
        }
        if self.seen.is_multiple_of(ROUND) {
            self.round(home);
        }
    }

    /// Moves each weight in turn to where it is best while the others stay.
    fn round(&mut self, home: &[i32; TERMS]) {
        for (k, &home) in home.iter().enumerate() {
            let weight = i64::from(self.weights[k]);
            let row = self.products[k].iter().zip(&self.weights);
            let has: i64 = row.map(|(&product, &weight)| i64::from(product) * i64::from(weight)).sum();
            let lacks = (i64::from(self.wanted[k]) << WEIGHT_BITS) - has + PULL * (i64::from(home) - weight);
            let best = weight + lacks / (i64::from(self.products[k][k]) + PULL);
            self.weights[k] = best.clamp(-WEIGHT, WEIGHT) as i32;
        }
    }
}
