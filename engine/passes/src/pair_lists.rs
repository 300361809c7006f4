//! Pairs of a splat and a list that it belongs to (a brick, or a tile and a block of planes). The pairs are
//! summed up and sorted by list, and the first pair of each list is found. Counting and emitting them is the
//! caller's business.

use shaders_glsl as glsl;
use shaders_glsl::types::RangeParams;

use super::{RadixSort, Scan, Work};
use base::error::Result;
use gpu::{Buffer, Gpu, Kernel, Recorder};

/// Sorts pairs into lists.
pub(super) struct PairLists {
    gpu: Gpu,
    ranges: Kernel,
    scan: Scan,
    sort: RadixSort,
    /// Number of pairs of each row, written by the caller.
    pub(super) counts: Buffer<u32>,
    /// Number of pairs before each row; the last element is the number of all pairs.
    pub(super) offsets: Buffer<u32>,
    /// First pair of each list, and the total.
    pub(super) starts: Buffer<u32>,
}

impl PairLists {
    /// Creates buffers for `rows` rows of splats and `lists` lists, with room for a first guess of pairs.
    pub(super) fn new(gpu: &Gpu, rows: usize, lists: usize) -> Result<Self> {
        Ok(PairLists {
            gpu: gpu.clone(),
            ranges: Kernel::new(gpu, &glsl::BRICK_RANGES, &[])?,
            scan: Scan::new(gpu, rows)?,
            sort: RadixSort::new(gpu, (rows * 8).max(4096))?,
            counts: gpu.buffer("pair counts", "sorting", rows)?,
            offsets: gpu.buffer("pair offsets", "sorting", rows + 1)?,
            starts: gpu.buffer("pair starts", "sorting", lists + 1)?,
        })
    }

    /// Resizes for another number of rows; the room for pairs stays. Nothing may be in flight.
    pub(super) fn resize(&mut self, rows: usize) -> Result<()> {
        self.scan = Scan::new(&self.gpu, rows)?;
        self.counts = self.gpu.buffer("pair counts", "sorting", rows)?;
        self.offsets = self.gpu.buffer("pair offsets", "sorting", rows + 1)?;
        Ok(())
    }

    /// Returns the number of pairs that fit the buffers.
    pub(super) fn capacity(&self) -> usize {
        self.sort.capacity()
    }

    /// Returns the greatest number of pairs that this device sorts if a buffer of the caller's holds `bound`.
    pub(super) fn most(&self, bound: usize) -> usize {
        let workgroups = self.gpu.limits().workgroups as usize;
        bound.min(workgroups * glsl::BRICK_RANGES.width() as usize - 1)
    }

    /// Resizes for `capacity` pairs. Nothing may be in flight.
    pub(super) fn make_room(&mut self, capacity: usize) -> Result<()> {
        self.sort = RadixSort::new(&self.gpu, capacity)?;
        Ok(())
    }

    /// Records the sums over the counts of `rows` rows; the total is copied to `totals[index]`.
    pub(super) fn sum(
        &mut self,
        recorder: &mut Recorder,
        rows: usize,
        totals: &mut Buffer<u32>,
        index: usize,
    ) {
        self.scan.record(recorder, &self.counts, rows, &mut self.offsets);
        recorder.copy(&self.offsets, rows, totals, index, 1);
    }

    /// Returns the buffer of each row's first pair, and the buffers for unsorted keys and values.
    pub(super) fn input(&mut self) -> (&Buffer<u32>, &mut Buffer<u32>, &mut Buffer<u32>) {
        let (keys, values) = self.sort.input();
        (&self.offsets, keys, values)
    }

    /// Records the sort of the pairs of `rows` rows by keys of at most `bits` bits, and the search for the
    /// first pair of each of the lists.
    pub(super) fn sort(&mut self, recorder: &mut Recorder, rows: usize, bits: u32, lists: u32) {
        let capacity = self.capacity() as u32;
        let (keys, _) = self.sort.record(recorder, &self.offsets, rows, bits);
        recorder
            .pass(&self.ranges)
            .read("pair_offsets", &self.offsets)
            .read("keys", keys)
            .write("starts", &mut self.starts)
            .push(&RangeParams { slot_count: lists, count_index: rows as u32, capacity })
            .dispatch_over(capacity + 1);
    }

    /// Returns the keys after a [`PairLists::sort`] with the same `bits`.
    pub(super) fn keys(&self, bits: u32) -> &Buffer<u32> {
        self.sort.sorted_keys(bits)
    }

    /// Returns the values after a [`PairLists::sort`] with the same `bits`.
    pub(super) fn values(&self, bits: u32) -> &Buffer<u32> {
        self.sort.sorted_values(bits)
    }

    /// Returns the work of a sort by `bits` bits.
    pub(super) fn work(&self, bits: u32) -> Work {
        self.sort.work(bits)
    }
}

/// Returns the number of bits of the largest key, which marks a pair of no list.
pub(super) fn key_bits(lists: usize) -> u32 {
    usize::BITS - lists.leading_zeros()
}
