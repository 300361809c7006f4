//! Stable least-significant-digit radix sort of (u32 key, u32 value) pairs, 6 bits a pass, without subgroup
//! operations and without a readback: the number of pairs is read from a buffer.

use shaders_glsl as glsl;
use shaders_glsl::radix::{DIGIT_BITS, RADIX_BLOCK};
use shaders_glsl::types::RadixParams;

use super::{Scan, Work};
use base::error::Result;
use gpu::{Buffer, Gpu, Kernel, Recorder};

/// Pairs that one workgroup moves.
const BLOCK: usize = RADIX_BLOCK as usize;

/// The sort with its buffers; the caller writes keys and values into [`RadixSort::input`].
pub struct RadixSort {
    count: Kernel,
    scatter: Kernel,
    scan: Scan,
    table: Buffer<u32>,
    offsets: Buffer<u32>,
    keys: [Buffer<u32>; 2],
    values: [Buffer<u32>; 2],
    blocks: usize,
}

impl RadixSort {
    /// Creates a sort of at most `capacity` pairs.
    pub fn new(gpu: &Gpu, capacity: usize) -> Result<Self> {
        let blocks = capacity.div_ceil(BLOCK).max(1);
        let table = blocks << DIGIT_BITS;
        let pairs = |name: &str| gpu.buffer::<u32>(name, "sorting", capacity);
        Ok(RadixSort {
            count: Kernel::new(gpu, &glsl::RADIX_COUNT, &[])?,
            scatter: Kernel::new(gpu, &glsl::RADIX_SCATTER, &[])?,
            scan: Scan::new(gpu, table)?,
            table: gpu.buffer("radix digit table", "sorting", table)?,
            offsets: gpu.buffer("radix digit offsets", "sorting", table + 1)?,
            keys: [pairs("pair keys A")?, pairs("pair keys B")?],
            values: [pairs("pair values A")?, pairs("pair values B")?],
            blocks,
        })
    }

    /// Returns the greatest number of pairs that can be sorted.
    pub fn capacity(&self) -> usize {
        self.keys[0].len()
    }

    /// Returns the work of a sort by `bits` bits, whatever it sorts.
    pub fn work(&self, bits: u32) -> Work {
        let digits = u64::from(bits.div_ceil(DIGIT_BITS));
        Work {
            room: self.capacity() as u64,
            digits,
            table: (self.blocks << DIGIT_BITS) as u64,
            ..Work::default()
        }
    }

    /// Returns the buffers for the unsorted keys and values.
    pub fn input(&mut self) -> (&mut Buffer<u32>, &mut Buffer<u32>) {
        let ([keys, _], [values, _]) = (&mut self.keys, &mut self.values);
        (keys, values)
    }

    /// Records the sort of the first `counts[count_index]` pairs by keys of at most `bits` bits. Returns
    /// sorted keys and values.
    pub fn record(
        &mut self,
        recorder: &mut Recorder,
        counts: &Buffer<u32>,
        count_index: usize,
        bits: u32,
    ) -> (&Buffer<u32>, &Buffer<u32>) {
        let mut from = 0;
        for shift in (0..bits).step_by(DIGIT_BITS as usize) {
            let params = RadixParams {
                shift,
                blocks: self.blocks as u32,
                count_index: count_index as u32,
                capacity: self.capacity() as u32,
            };
            recorder
                .pass(&self.count)
                .read("counts", counts)
                .read("keys", &self.keys[from])
                .write("table", &mut self.table)
                .push(&params)
                .dispatch(self.blocks as u32);
            self.scan.record(recorder, &self.table, self.blocks << DIGIT_BITS, &mut self.offsets);
            let ([keys_a, keys_b], [values_a, values_b]) = (&mut self.keys, &mut self.values);
            let (keys_from, keys_to, values_from, values_to) = if from == 0 {
                (&*keys_a, keys_b, &*values_a, values_b)
            } else {
                (&*keys_b, keys_a, &*values_b, values_a)
            };
            recorder
                .pass(&self.scatter)
                .read("counts", counts)
                .read("keys", keys_from)
                .read("values", values_from)
                .read("offsets", &self.offsets)
                .write("sorted_keys", keys_to)
                .write("sorted_values", values_to)
                .push(&params)
                .dispatch(self.blocks as u32);
            from = 1 - from;
        }
        (&self.keys[from], &self.values[from])
    }

    /// Returns the keys after a [`RadixSort::record`] with the same `bits`.
    pub fn sorted_keys(&self, bits: u32) -> &Buffer<u32> {
        &self.keys[(bits.div_ceil(DIGIT_BITS) % 2) as usize]
    }

    /// Returns the values after a [`RadixSort::record`] with the same `bits`.
    pub fn sorted_values(&self, bits: u32) -> &Buffer<u32> {
        &self.values[(bits.div_ceil(DIGIT_BITS) % 2) as usize]
    }
}
