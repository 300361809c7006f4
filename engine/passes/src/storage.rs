//! The storage of the two numbers of a sample (W and V̂, or A and H) between the passes of a step; the
//! shaders' side is `include/storage.glsl`. Sums, and all numbers of a splat, are f32 in any case.

use bytemuck::Pod;
use serde::{Deserialize, Serialize};
use shaders_glsl::storage::{STORAGE_FULL, STORAGE_MIXED};

/// The way samples are stored between the passes of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[repr(u32)]
pub enum Storage {
    /// f32: two words a sample.
    Full = STORAGE_FULL,
    /// f16: one word a sample. Rounded to nearest; at most ±65504, so that there is no infinity.
    Mixed = STORAGE_MIXED,
}

impl Storage {
    /// Returns the number of words of one sample.
    pub fn words(self) -> usize {
        match self {
            Storage::Full => 2,
            Storage::Mixed => 1,
        }
    }

    /// Returns the number of bytes of one sample.
    pub fn bytes(self) -> usize {
        self.words() * size_of::<u32>()
    }

    /// Returns the samples in stored words: `Reconstruction`s or `Adjoint`s, two f32 each.
    ///
    /// # Panics
    /// If a sample is not two f32, or the words are not a whole number of samples.
    pub fn unpack<T: Pod>(self, words: &[u32]) -> Vec<T> {
        match self {
            Storage::Full => bytemuck::cast_slice(words).to_vec(),
            Storage::Mixed => words
                .iter()
                .map(|&w| bytemuck::cast([from_half(w as u16), from_half((w >> 16) as u16)]))
                .collect(),
        }
    }
}

/// Returns the value of the f16 with these bits.
fn from_half(bits: u16) -> f32 {
    let (exponent, fraction) = (i32::from(bits >> 10 & 31), f32::from(bits & 1023));
    let magnitude = match exponent {
        0 => fraction * 2f32.powi(-24),
        31 if fraction == 0.0 => f32::INFINITY,
        31 => f32::NAN,
        _ => (1024.0 + fraction) * 2f32.powi(exponent - 25),
    };
    if bits >> 15 == 0 { magnitude } else { -magnitude }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_are_read_as_ieee_754_has_them() {
        let rows = [
            (0x0000, 0.0),
            (0x0001, 2f32.powi(-24)),
            (0x03FF, 1023.0 * 2f32.powi(-24)),
            (0x0400, 2f32.powi(-14)),
            (0x3C00, 1.0),
            (0x3555, 0.333_251_95),
            (0xC000, -2.0),
            (0x7BFF, 65504.0),
            (0xFC00, f32::NEG_INFINITY),
        ];
        for (bits, want) in rows {
            assert_eq!(from_half(bits), want, "{bits:#06x}");
        }
        assert!(from_half(0x8000).is_sign_negative() && from_half(0x7E00).is_nan());
    }

    #[test]
    fn samples_are_unpacked_in_order() {
        let full = [1.5f32, -2.0, 0.25, 3.0];
        let words: Vec<u32> = full.iter().map(|v| v.to_bits()).collect();
        assert_eq!(Storage::Full.unpack::<[f32; 2]>(&words), [[1.5, -2.0], [0.25, 3.0]]);
        assert_eq!(
            Storage::Mixed.unpack::<[f32; 2]>(&[0xC000_3C00, 0x7BFF_0000]),
            [[1.0, -2.0], [0.0, 65504.0]]
        );
        assert_eq!((Storage::Full.bytes(), Storage::Mixed.bytes()), (8, 4));
    }
}
