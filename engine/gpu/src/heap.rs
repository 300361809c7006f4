//! The heaps of a device's memory, and what is free in them.

use std::fmt;

use ash::vk;
use serde::Serialize;

/// Who reaches the memory of a heap, and how fast.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum HeapKind {
    /// The device alone: the memory of a discrete GPU.
    Device,
    /// Device and host, both at full speed: unified memory, or a discrete GPU's through a resizable bar.
    Shared,
    /// The host; the device reaches it over its bus.
    Host,
}

impl HeapKind {
    /// Returns the kind of memory with these properties.
    pub(super) fn of(properties: vk::MemoryPropertyFlags) -> Self {
        let is_local = properties.contains(vk::MemoryPropertyFlags::DEVICE_LOCAL);
        match is_local && properties.contains(vk::MemoryPropertyFlags::HOST_VISIBLE) {
            true => HeapKind::Shared,
            false if is_local => HeapKind::Device,
            false => HeapKind::Host,
        }
    }
}

impl fmt::Display for HeapKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            HeapKind::Device => "device",
            HeapKind::Shared => "shared",
            HeapKind::Host => "host",
        })
    }
}

/// A heap.
#[derive(Clone, Debug, Serialize)]
pub struct Heap {
    /// Who reaches it.
    pub kind: HeapKind,
    /// Its size, bytes.
    pub bytes: u64,
    /// Bytes that this process may still take, other programs considered; absent where the driver does not tell
    /// (`VK_EXT_memory_budget`).
    pub free: Option<u64>,
}

/// Asks for the heaps of a device; `tells` is true if it has `VK_EXT_memory_budget`.
pub(super) fn heaps(instance: &ash::Instance, physical: vk::PhysicalDevice, tells: bool) -> Vec<Heap> {
    let mut budget = vk::PhysicalDeviceMemoryBudgetPropertiesEXT::default();
    let mut two = vk::PhysicalDeviceMemoryProperties2::default();
    if tells {
        two = two.push_next(&mut budget);
    }
    // SAFETY: a query on a physical device of this instance; the chained struct lives until it returns.
    unsafe { instance.get_physical_device_memory_properties2(physical, &mut two) };
    let memory = two.memory_properties;
    let kind = |heap: u32| {
        let types = memory.memory_types_as_slice().iter().filter(|t| t.heap_index == heap);
        HeapKind::of(types.fold(vk::MemoryPropertyFlags::empty(), |all, t| all | t.property_flags))
    };
    (0..memory.memory_heap_count)
        .map(|i| {
            let index = i as usize;
            let free = budget.heap_budget[index].saturating_sub(budget.heap_usage[index]);
            Heap { kind: kind(i), bytes: memory.memory_heaps[index].size, free: tells.then_some(free) }
        })
        .collect()
}

/// Returns the most bytes that are free in one of the heaps for memory of the device, or else of the host; nothing
/// if no driver tells.
pub(super) fn most_free(heaps: &[Heap], of_device: bool) -> Option<u64> {
    let suits = |heap: &&Heap| match of_device {
        true => heap.kind != HeapKind::Host,
        false => heap.kind != HeapKind::Device,
    };
    heaps.iter().filter(suits).filter_map(|heap| heap.free).max()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_follow_from_the_properties() {
        let (local, visible) = (vk::MemoryPropertyFlags::DEVICE_LOCAL, vk::MemoryPropertyFlags::HOST_VISIBLE);
        assert_eq!(HeapKind::of(local), HeapKind::Device);
        assert_eq!(HeapKind::of(local | visible), HeapKind::Shared);
        assert_eq!(HeapKind::of(visible), HeapKind::Host);
    }

    #[test]
    fn room_is_looked_for_where_an_object_may_lie() {
        let heap = |kind, free| Heap { kind, bytes: 100, free };
        let discrete = [heap(HeapKind::Device, Some(80)), heap(HeapKind::Host, Some(20))];
        assert_eq!([true, false].map(|of_device| most_free(&discrete, of_device)), [Some(80), Some(20)]);
        let bar = [&discrete[..], &[heap(HeapKind::Shared, Some(30))]].concat();
        assert_eq!([true, false].map(|of_device| most_free(&bar, of_device)), [Some(80), Some(30)]);
        assert_eq!(most_free(&[heap(HeapKind::Shared, None)], true), None);
    }
}
