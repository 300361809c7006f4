//! The prefix sum, the radix sort and the sum of all rows, kernel by kernel. (`sorting` in the folder above tests them whole.)

use engine::gpu::Kernel;
use rand::RngExt;
use reference::{loss, radix, scan};
use shaders_glsl::radix::DIGIT_BITS;
use shaders_glsl::types::{RadixParams, ScanParams, SumParams};
use vgs_tests::scene::random;
use vgs_tests::{Bound, Device, assert_close};

use super::run;

const SCAN_BLOCK: usize = shaders_glsl::scan::SCAN_BLOCK as usize;
const RADIX_BLOCK: usize = shaders_glsl::radix::RADIX_BLOCK as usize;
const SIZES: [usize; 9] = [1, 2, 15, 17, 4095, 4096, 4097, 9000, 300_000];

fn values(count: usize) -> Vec<u32> {
    let mut rng = random(count as u64);
    // Sums wrap round, which no kernel may notice.
    (0..count).map(|_| rng.random_range(0..=u32::MAX)).collect()
}

pub fn scan_sums() {
    let gpu = Device::boot();
    let kernel = Kernel::new(&gpu, &shaders_glsl::SCAN_SUMS, &[]).unwrap();
    for count in SIZES {
        let values = values(count);
        let input = gpu.upload("values", "test", &values).unwrap();
        let blocks = count.div_ceil(SCAN_BLOCK);
        let mut sums = gpu.buffer::<u32>("sums", "test", blocks).unwrap();
        run(&gpu, |r| {
            let params = ScanParams { count: count as u32 };
            r.pass(&kernel)
                .read("values", &input)
                .write("block_sums", &mut sums)
                .push(&params)
                .dispatch(blocks as u32);
        });
        assert_eq!(sums.read().unwrap(), scan::scan_sums(&values, SCAN_BLOCK), "{count} values");
    }
}

pub fn scan_offsets() {
    let gpu = Device::boot();
    let kernel = Kernel::new(&gpu, &shaders_glsl::SCAN_OFFSETS, &[]).unwrap();
    for count in SIZES {
        let sums = values(count);
        let mut buffer = gpu.upload("sums", "test", &sums).unwrap();
        run(&gpu, |r| {
            r.pass(&kernel)
                .write("block_sums", &mut buffer)
                .push(&ScanParams { count: count as u32 })
                .dispatch(1);
        });
        assert_eq!(buffer.read().unwrap(), scan::scan_offsets(&sums), "{count} sums");
    }
}

pub fn scan_apply() {
    let gpu = Device::boot();
    let kernel = Kernel::new(&gpu, &shaders_glsl::SCAN_APPLY, &[]).unwrap();
    for count in SIZES {
        let data = values(count);
        let blocks = count.div_ceil(SCAN_BLOCK);
        let offsets = values(blocks);
        let input = gpu.upload("values", "test", &data).unwrap();
        let sums = gpu.upload("sums", "test", &offsets).unwrap();
        let mut out = gpu.buffer::<u32>("offsets", "test", count + 1).unwrap();
        run(&gpu, |r| {
            r.pass(&kernel)
                .read("values", &input)
                .read("block_sums", &sums)
                .write("offsets", &mut out)
                .push(&ScanParams { count: count as u32 })
                .dispatch(blocks as u32);
        });
        assert_eq!(out.read().unwrap(), scan::scan_apply(&data, &offsets, SCAN_BLOCK), "{count} values");
    }
}

/// Where keys are only part of what the buffers could hold, the rest must not be looked at.
const KEY_COUNTS: [(usize, usize); 6] =
    [(0, 1), (1, 5000), (2, 2), (2048, 2048), (2049, 6000), (50_000, 50_000)];

pub fn radix_count() {
    let gpu = Device::boot();
    let kernel = Kernel::new(&gpu, &shaders_glsl::RADIX_COUNT, &[]).unwrap();
    for (count, capacity) in KEY_COUNTS {
        for shift in [0, 6, 30] {
            let keys = values(capacity);
            let blocks = capacity.div_ceil(RADIX_BLOCK);
            let counts = gpu.upload("counts", "test", &[77, count as u32]).unwrap();
            let input = gpu.upload("keys", "test", &keys).unwrap();
            let mut table = gpu.buffer::<u32>("table", "test", blocks << DIGIT_BITS).unwrap();
            let params =
                RadixParams { shift, blocks: blocks as u32, count_index: 1, capacity: capacity as u32 };
            run(&gpu, |r| {
                r.pass(&kernel)
                    .read("counts", &counts)
                    .read("keys", &input)
                    .write("table", &mut table)
                    .push(&params)
                    .dispatch(blocks as u32);
            });
            let expected = radix::radix_count(&keys[..count], shift, DIGIT_BITS, RADIX_BLOCK, blocks);
            assert_eq!(table.read().unwrap(), expected, "{count} of {capacity} keys, shift {shift}");
        }
    }
}

pub fn radix_scatter() {
    let gpu = Device::boot();
    let kernel = Kernel::new(&gpu, &shaders_glsl::RADIX_SCATTER, &[]).unwrap();
    for (count, capacity) in KEY_COUNTS {
        for shift in [0, 12, 30] {
            let keys = values(capacity);
            let places: Vec<u32> = (0..capacity as u32).collect();
            let blocks = capacity.div_ceil(RADIX_BLOCK);
            let table = radix::radix_count(&keys[..count], shift, DIGIT_BITS, RADIX_BLOCK, blocks);
            let counts = gpu.upload("counts", "test", &[count as u32]).unwrap();
            let key_buffer = gpu.upload("keys", "test", &keys).unwrap();
            let value_buffer = gpu.upload("values", "test", &places).unwrap();
            let offsets = gpu.upload("table", "test", &scan::scan(&table)).unwrap();
            let mut sorted_keys = gpu.upload("sorted keys", "test", &vec![9; capacity]).unwrap();
            let mut sorted_values = gpu.upload("sorted values", "test", &vec![9; capacity]).unwrap();
            let params =
                RadixParams { shift, blocks: blocks as u32, count_index: 0, capacity: capacity as u32 };
            run(&gpu, |r| {
                r.pass(&kernel)
                    .read("counts", &counts)
                    .read("keys", &key_buffer)
                    .read("values", &value_buffer)
                    .read("offsets", &offsets)
                    .write("sorted_keys", &mut sorted_keys)
                    .write("sorted_values", &mut sorted_values)
                    .push(&params)
                    .dispatch(blocks as u32);
            });
            let (mut keys, mut values) =
                radix::radix_scatter(&keys[..count], &places[..count], shift, DIGIT_BITS);
            keys.resize(capacity, 9);
            values.resize(capacity, 9);
            assert_eq!(sorted_keys.read().unwrap(), keys, "{count} of {capacity} keys, shift {shift}");
            assert_eq!(sorted_values.read().unwrap(), values, "{count} of {capacity} values, shift {shift}");
        }
    }
}

pub fn sum_triples() {
    let gpu = Device::boot();
    let kernel = Kernel::new(&gpu, &shaders_glsl::SUM_TRIPLES, &[]).unwrap();
    for count in SIZES {
        let mut rng = random(count as u64);
        let rows: Vec<[f32; 3]> =
            (0..count).map(|_| std::array::from_fn(|k| rng.random_range(0.0..(1 + k) as f32))).collect();
        let rows64: Vec<_> = rows.iter().map(|row| row.map(f64::from)).collect();
        let input = gpu.upload("rows", "test", &rows).unwrap();
        let mut total = gpu.buffer::<[f32; 3]>("total", "test", 1).unwrap();
        run(&gpu, |r| {
            let params = SumParams { count: count as u32 };
            r.pass(&kernel).read("partials", &input).write("total", &mut total).push(&params).dispatch(1);
        });
        let (found, wanted) = (total.read().unwrap()[0], loss::sum_triples(&rows64));
        let pairs = (0..3).map(|k| (f64::from(found[k]), wanted[k]));
        assert_close(&format!("sum_triples, {count} rows"), Bound::new(0.0, 3e-6), pairs);
    }
}
