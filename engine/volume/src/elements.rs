//! The types in which files store single real voxels, and their conversion to f64.

use half::f16;

/// Decodes little- or big-endian elements and passes each to a callback.
pub(super) type Decode = fn(bytes: &[u8], big_endian: bool, each: &mut dyn FnMut(f64));

/// A type of voxels that are single real numbers.
#[derive(Debug)]
pub(super) struct Element {
    /// Name for messages, such as "int16".
    pub name: &'static str,
    /// Bytes of one voxel.
    pub bytes: usize,
    /// True if f32 may not hold every value exactly.
    pub wide_integer: bool,
    /// Decoder of the bytes.
    pub decode: Decode,
}

macro_rules! element {
    ($constant:ident, $name:literal, $t:ty, $wide:literal) => {
        pub(super) const $constant: Element = Element {
            name: $name,
            bytes: size_of::<$t>(),
            wide_integer: $wide,
            decode: |bytes, big, each| {
                for chunk in bytes.as_chunks::<{ size_of::<$t>() }>().0 {
                    each(if big { <$t>::from_be_bytes(*chunk) } else { <$t>::from_le_bytes(*chunk) } as f64);
                }
            },
        };
    };
}

element!(INT8, "int8", i8, false);
element!(UINT8, "uint8", u8, false);
element!(INT16, "int16", i16, false);
element!(UINT16, "uint16", u16, false);
element!(INT32, "int32", i32, true);
element!(UINT32, "uint32", u32, true);
element!(INT64, "int64", i64, true);
element!(UINT64, "uint64", u64, true);
element!(FLOAT32, "float32", f32, false);
element!(FLOAT64, "float64", f64, false);

pub(super) const FLOAT16: Element = Element {
    name: "float16",
    bytes: 2,
    wide_integer: false,
    decode: |bytes, big, each| {
        for chunk in bytes.as_chunks::<2>().0 {
            each(if big { f16::from_be_bytes(*chunk) } else { f16::from_le_bytes(*chunk) }.to_f64());
        }
    },
};
