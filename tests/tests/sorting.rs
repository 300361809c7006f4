//! Prefix sum and radix sort whole, against the standard library.

use engine::gpu::Gpu;
use engine::passes::{RadixSort, Scan};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngSeed};
use rand::RngExt;
use reference::{radix, scan};
use vgs_tests::Device;
use vgs_tests::scene::random;

fn check_scan(gpu: &Gpu, values: &[u32]) {
    let count = values.len();
    let input = gpu.upload("values", "test", values).unwrap();
    let mut offsets = gpu.buffer("offsets", "test", count + 1).unwrap();
    let mut scan_pass = Scan::new(gpu, count).unwrap();
    let mut recorder = gpu.record().unwrap();
    scan_pass.record(&mut recorder, &input, count, &mut offsets);
    gpu.wait(recorder.submit().unwrap()).unwrap();
    assert!(offsets.read().unwrap() == scan::scan(values), "the prefix sum of {count} values is wrong");
}

/// Sorts the first `count` of the keys, cut to `bits` bits, in buffers for all of them.
fn check_sort(gpu: &Gpu, keys: &[u32], count: usize, bits: u32) {
    let keys: Vec<u32> = keys.iter().map(|key| key & (u32::MAX >> (32 - bits))).collect();
    let keys = keys.as_slice();
    let places: Vec<u32> = (0..keys.len() as u32).map(|i| i ^ 0x5555).collect();
    let counts = gpu.upload("counts", "test", &[count as u32]).unwrap();
    let mut sort = RadixSort::new(gpu, keys.len()).unwrap();
    let (key_buffer, value_buffer) = sort.input();
    key_buffer.write_range(0, keys).unwrap();
    value_buffer.write_range(0, &places).unwrap();
    let mut recorder = gpu.record().unwrap();
    let (sorted_keys, sorted_values) = sort.record(&mut recorder, &counts, 0, bits);
    gpu.wait(recorder.submit().unwrap()).unwrap();
    let count = count.min(keys.len());
    let (wanted_keys, wanted_values) = radix::sort(&keys[..count], &places[..count], bits);
    let got = (sorted_keys.read_range(0, count).unwrap(), sorted_values.read_range(0, count).unwrap());
    assert!(got.0 == wanted_keys, "{count} keys of {bits} bits are not in order");
    assert!(
        got.1 == wanted_values,
        "{count} pairs of {bits} bits: a value is not with its key, or not stable"
    );
}

#[test]
fn prefix_sums_of_every_size() {
    let gpu = Device::boot();
    let mut rng = random(1);
    for count in [0, 1, 2, 255, 4096, 4097, 1_000_000, 1_048_576] {
        let values: Vec<u32> = (0..count).map(|_| rng.random_range(0..1000)).collect();
        check_scan(&gpu, &values);
    }
    check_scan(&gpu, &vec![0; 5000]);
    check_scan(&gpu, &vec![u32::MAX; 5000]);
}

#[test]
fn a_million_keys() {
    let gpu = Device::boot();
    let mut rng = random(2);
    let keys: Vec<u32> = (0..1_000_000).map(|_| rng.random_range(0..5000)).collect();
    check_sort(&gpu, &keys, keys.len(), 13);
    let keys: Vec<u32> = (0..1_000_000).map(|_| rng.random_range(0..=u32::MAX)).collect();
    check_sort(&gpu, &keys, 999_999, 32);
}

#[test]
fn keys_that_are_hard_to_sort() {
    let gpu = Device::boot();
    let n = 10_000u32;
    let rows: [(&str, Vec<u32>); 8] = [
        ("none", vec![0]),
        ("two", vec![5, 4]),
        ("all equal", vec![63; n as usize]),
        ("all the largest", vec![u32::MAX; n as usize]),
        ("ascending", (0..n).collect()),
        ("descending", (0..n).rev().collect()),
        ("two values in turn", (0..n).map(|i| i % 2 * 0x8000_0000).collect()),
        ("digits that mirror each other", (0..n).map(|i| (i & 63) << 6 | (63 - (i & 63))).collect()),
    ];
    for (name, keys) in rows {
        println!("{name}");
        let counts =
            if name == "none" { vec![0, 1] } else { vec![keys.len(), keys.len() - 1, keys.len() + 99] };
        for count in counts {
            for bits in [1, 6, 7, 12, 32] {
                check_sort(&gpu, &keys, count, bits);
            }
        }
    }
}

#[test]
fn any_list() {
    let gpu = Device::boot();
    let config =
        Config { cases: 40, rng_seed: RngSeed::Fixed(3), failure_persistence: None, ..Config::default() };
    proptest!(config, |(
        keys in prop::collection::vec(prop_oneof![any::<u32>(), 0u32..70], 1..9000),
        bits in 1u32..=32,
        part in 0.0..1.1,
    )| {
        check_sort(&gpu, &keys, (keys.len() as f64 * part) as usize, bits);
        check_scan(&gpu, &keys);
    });
}
