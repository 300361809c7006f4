//! The exclusive prefix sum, as a whole (`scan`) and as its three kernels `scan_sums`, `scan_offsets` and
//! `scan_apply`.

/// Returns the exclusive prefix sum: `out[i] = values[0] + .. + values[i - 1]` for i in `0..=n`, wrapping as
/// u32 does.
pub fn scan(values: &[u32]) -> Vec<u32> {
    let mut out = vec![0u32];
    for &value in values {
        out.push(out[out.len() - 1].wrapping_add(value));
    }
    out
}

/// Returns the sum of each block of `block` values.
pub fn scan_sums(values: &[u32], block: usize) -> Vec<u32> {
    values.chunks(block).map(|chunk| chunk.iter().fold(0u32, |sum, &v| sum.wrapping_add(v))).collect()
}

/// Returns the sum before each block.
pub fn scan_offsets(sums: &[u32]) -> Vec<u32> {
    let mut out = scan(sums);
    out.pop();
    out
}

/// Returns the sum before each value, given the sum before each block, and the total at the end.
pub fn scan_apply(values: &[u32], block_offsets: &[u32], block: usize) -> Vec<u32> {
    let mut out = Vec::new();
    let mut total = 0;
    for (chunk, &offset) in values.chunks(block).zip(block_offsets) {
        let inner = scan(chunk);
        out.extend(inner[..chunk.len()].iter().map(|&v| v.wrapping_add(offset)));
        total = inner[chunk.len()].wrapping_add(offset);
    }
    out.push(total);
    out
}
