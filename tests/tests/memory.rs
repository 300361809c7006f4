//! Device memory: what is free bounds what is taken, and the account says where it lies.

use engine::Kind;
use engine::gpu::{GpuOptions, HeapKind};
use vgs_tests::Device;

/// Bytes that are taken as free.
const FREE: u64 = 20 << 20;

#[test]
fn large_objects_take_no_more_than_is_free() {
    let gpu = Device::boot_with(GpuOptions { free_limit: Some(FREE), ..GpuOptions::default() });
    let words = |bytes: u64| bytes as usize / 4;
    let refused = gpu.buffer::<u32>("samples", "test", words(FREE) + 1).err().expect("too large");
    assert_eq!((refused.kind, refused.code), (Kind::Temporary, "VGS-GPU-033"));
    let told = refused.to_string();
    assert!(told.contains("samples") && told.contains(&FREE.to_string()), "{told}");
    assert!(gpu.memory_by_purpose().values().all(|&bytes| bytes == 0), "nothing was taken");
    let taken = gpu.buffer::<u32>("samples", "test", words(FREE)).expect("as large as what is free");
    assert_eq!(gpu.memory_by_purpose()["test"], FREE);
    drop(taken);
}

#[test]
fn the_account_says_in_which_heap_memory_lies() {
    let gpu = Device::boot();
    let near = gpu.upload("values", "near", &[1u32; 1000]).expect("a buffer");
    let read = gpu.readback::<u32>("values", 1000).expect("a buffer");
    let account = gpu.memory_account();
    let kinds = |purpose: &str| -> Vec<HeapKind> {
        account.iter().filter(|((p, _), bytes)| *p == purpose && **bytes > 0).map(|((_, k), _)| *k).collect()
    };
    assert_eq!(kinds("near").len(), 1, "{account:?}");
    assert_ne!(kinds("near"), [HeapKind::Host], "passes use memory that is near to the device");
    assert_ne!(kinds("staging"), [HeapKind::Device], "the host reads it");
    let heaps = gpu.heaps();
    assert!(heaps.iter().any(|heap| kinds("near").contains(&heap.kind)), "{heaps:?}");
    for heap in &heaps {
        assert!(heap.bytes > 0 && heap.free.is_none_or(|free| free <= heap.bytes), "{heap:?}");
    }
    let sum = |rows: &mut dyn Iterator<Item = u64>| rows.sum::<u64>();
    assert_eq!(
        sum(&mut account.values().copied()),
        sum(&mut gpu.memory_by_purpose().values().copied()),
        "both accounts are of the same bytes"
    );
    drop((near, read));
}
