//! Samples as the device stores them, for tests that write them from the host.

use bytemuck::Pod;
use engine::passes::Storage;
use reference::half;

/// Both storages.
pub const STORAGES: [Storage; 2] = [Storage::Full, Storage::Mixed];

/// Returns a number as a storage keeps it.
pub fn kept(storage: Storage, v: f32) -> f32 {
    match storage {
        Storage::Full => v,
        Storage::Mixed => half(f64::from(v)) as f32,
    }
}

/// Packs `Reconstruction`s or `Adjoint`s into words; the inverse of [`Storage::unpack`].
pub fn pack<T: Pod>(storage: Storage, samples: &[T]) -> Vec<u32> {
    let rows: &[[f32; 2]] = bytemuck::cast_slice(samples);
    match storage {
        Storage::Full => rows.as_flattened().iter().map(|v| v.to_bits()).collect(),
        Storage::Mixed => rows.iter().map(|&[a, b]| half_bits(a) | half_bits(b) << 16).collect(),
    }
}

/// Returns the bits of the nearest half.
fn half_bits(v: f32) -> u32 {
    let v = kept(Storage::Mixed, v);
    let size = if v.abs() < 2f32.powi(-14) {
        (v.abs() * 2f32.powi(24)) as u32
    } else {
        (v.abs().to_bits() >> 13) - (112 << 10)
    };
    size | u32::from(v.is_sign_negative()) << 15
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_packed_is_unpacked() {
        let rows = [[0.0f32, -0.0], [1.0, -2.5], [6e-8, 1e-5], [65504.0, -1e9], [0.333, 6.1e-5]];
        for storage in STORAGES {
            let wanted = rows.map(|row| row.map(|v| kept(storage, v).to_bits()));
            let got = storage.unpack::<[f32; 2]>(&pack(storage, &rows));
            assert_eq!(got.iter().map(|row| row.map(f32::to_bits)).collect::<Vec<_>>(), wanted);
        }
    }
}
