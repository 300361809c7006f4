//! Gathering and scattering of rows of any buffer by a list of indices.

use bytemuck::Pod;
use shaders_glsl as glsl;
use shaders_glsl::types::RowParams;

use base::error::Result;
use gpu::{Buffer, Gpu, Kernel, Recorder};

/// The kernels that gather and scatter rows.
pub struct Rows {
    gather: Kernel,
    scatter: Kernel,
}

impl Rows {
    /// Creates the kernels, for rows of any type.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Rows {
            gather: Kernel::new(gpu, &glsl::GATHER_ROWS, &[])?,
            scatter: Kernel::new(gpu, &glsl::SCATTER_ROWS, &[])?,
        })
    }

    /// Records `gathered[i] = rows[indices[first + i]]` for all of `gathered`.
    pub fn gather<T: Pod>(
        &self,
        recorder: &mut Recorder,
        rows: &Buffer<T>,
        indices: &Buffer<u32>,
        first: usize,
        gathered: &mut Buffer<T>,
    ) {
        let (params, words) = params::<T>(gathered.len(), first);
        recorder
            .pass(&self.gather)
            .read_words("rows", rows)
            .read("indices", indices)
            .write_words("gathered", gathered)
            .push(&params)
            .dispatch_over(words);
    }

    /// Records `rows[indices[first + i]] = gathered[i]` for all of `gathered`; these indices must differ.
    pub fn scatter<T: Pod>(
        &self,
        recorder: &mut Recorder,
        gathered: &Buffer<T>,
        indices: &Buffer<u32>,
        first: usize,
        rows: &mut Buffer<T>,
    ) {
        let (params, words) = params::<T>(gathered.len(), first);
        recorder
            .pass(&self.scatter)
            .read_words("gathered", gathered)
            .read("indices", indices)
            .write_words("rows", rows)
            .push(&params)
            .dispatch_over(words);
    }
}

/// Returns the push constants, and the number of words, for `count` rows.
fn params<T>(count: usize, first: usize) -> (RowParams, u32) {
    let words = size_of::<T>() / size_of::<u32>();
    (RowParams { count: count as u32, words: words as u32, first: first as u32 }, (count * words) as u32)
}
