//! `gather_rows`, `scatter_rows`: rows of `words` words by a list of indices.

/// Gathers rows: returns `rows[indices[i]]`, one after the other.
pub fn gather_rows(rows: &[u32], indices: &[u32], words: usize) -> Vec<u32> {
    indices.iter().flat_map(|&i| rows[i as usize * words..][..words].iter().copied()).collect()
}

/// Puts `gathered[i]` at `rows[indices[i]]`.
pub fn scatter_rows(gathered: &[u32], indices: &[u32], words: usize, rows: &mut [u32]) {
    for (from, &i) in gathered.chunks(words).zip(indices) {
        rows[i as usize * words..][..words].copy_from_slice(from);
    }
}
