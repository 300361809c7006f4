//! The stable sort of (key, value) pairs, as a whole (`sort`) and as its two kernels.

/// Sorts pairs by the lowest `bits` bits of the key; equal keys keep their order.
pub fn sort(keys: &[u32], values: &[u32], bits: u32) -> (Vec<u32>, Vec<u32>) {
    let mask = if bits >= 32 { u32::MAX } else { (1 << bits) - 1 };
    let mut pairs: Vec<(u32, u32)> = keys.iter().copied().zip(values.iter().copied()).collect();
    pairs.sort_by_key(|&(key, _)| key & mask);
    pairs.into_iter().unzip()
}

/// Returns the digit of `bits` bits from bit `shift` up.
fn digit(key: u32, shift: u32, bits: u32) -> usize {
    ((key >> shift) & ((1 << bits) - 1)) as usize
}

/// Returns how often each digit occurs in each block, `[digit][block]`, for a table of `blocks` blocks.
pub fn radix_count(keys: &[u32], shift: u32, bits: u32, block: usize, blocks: usize) -> Vec<u32> {
    let mut table = vec![0; blocks << bits];
    for (i, &key) in keys.iter().enumerate() {
        table[digit(key, shift, bits) * blocks + i / block] += 1;
    }
    table
}

/// Sorts pairs by one digit; equal digits keep their order.
pub fn radix_scatter(keys: &[u32], values: &[u32], shift: u32, bits: u32) -> (Vec<u32>, Vec<u32>) {
    let mut pairs: Vec<(u32, u32)> = keys.iter().copied().zip(values.iter().copied()).collect();
    pairs.sort_by_key(|&(key, _)| digit(key, shift, bits));
    pairs.into_iter().unzip()
}
