//! NIfTI datatypes: which exist, which are scalar, and how their bytes become f64.

/// Decodes little- or big-endian elements and hands them on.
type Decode = fn(bytes: &[u8], big_endian: bool, each: &mut dyn FnMut(f64));

/// One row of the table of datatypes.
#[derive(Debug)]
pub(super) struct Datatype {
    pub code: i16,
    pub name: &'static str,
    /// Bytes of one voxel; 0 where the standard has none.
    pub bytes: usize,
    /// True if f32 may not hold every value exactly.
    pub wide_integer: bool,
    /// How to read it, if it is one number that this program can use.
    pub decode: Option<Decode>,
}

macro_rules! decode {
    ($t:ty) => {
        Some(|bytes: &[u8], big: bool, each: &mut dyn FnMut(f64)| {
            for chunk in bytes.as_chunks::<{ size_of::<$t>() }>().0 {
                each(if big { <$t>::from_be_bytes(*chunk) } else { <$t>::from_le_bytes(*chunk) } as f64);
            }
        })
    };
}

const fn row(code: i16, name: &'static str, bytes: usize, decode: Option<Decode>) -> Datatype {
    Datatype { code, name, bytes, wide_integer: matches!(code, 8 | 768 | 1024 | 1280), decode }
}

/// Every datatype of the standard.
pub(super) const DATATYPES: &[Datatype] = &[
    row(0, "unknown", 0, None),
    row(1, "binary", 0, None),
    row(2, "uint8", 1, decode!(u8)),
    row(4, "int16", 2, decode!(i16)),
    row(8, "int32", 4, decode!(i32)),
    row(16, "float32", 4, decode!(f32)),
    row(32, "complex64", 8, None),
    row(64, "float64", 8, decode!(f64)),
    row(128, "RGB", 3, None),
    row(256, "int8", 1, decode!(i8)),
    row(512, "uint16", 2, decode!(u16)),
    row(768, "uint32", 4, decode!(u32)),
    row(1024, "int64", 8, decode!(i64)),
    row(1280, "uint64", 8, decode!(u64)),
    row(1536, "float128", 16, None),
    row(1792, "complex128", 16, None),
    row(2048, "complex256", 32, None),
    row(2304, "RGBA", 4, None),
];
