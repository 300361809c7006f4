//! Lists the Vulkan devices and whether vgs can use them (`vgs devices`).

use engine::gpu::{self, DeviceDescription, HeapKind};

use crate::shared::console::Console;
use crate::shared::failure::Stop;
use crate::shared::figures::{bytes, table};

/// Returns what is free in the largest heap of the device.
fn free(device: &DeviceDescription) -> String {
    let near = device.heaps.iter().filter(|heap| heap.kind != HeapKind::Host);
    near.max_by_key(|heap| heap.bytes).and_then(|heap| heap.free).map_or_else(|| "?".to_owned(), bytes)
}

/// Runs the command.
pub fn run(console: &Console) -> Result<u8, Stop> {
    let devices = gpu::devices()?;
    if console.json {
        console.json_data(&serde_json::json!({ "devices": devices }))?;
        return Ok(0);
    }
    if devices.is_empty() {
        console.say("no Vulkan device was found; tools/vgs brings a software driver");
    }
    let row = |d: &DeviceDescription| {
        let state = match d.missing.as_slice() {
            [] => "usable".to_owned(),
            missing => format!("lacks {}", missing.join(", ")),
        };
        vec![
            d.index.to_string(),
            d.name.clone(),
            d.kind.to_owned(),
            d.driver.clone(),
            d.api.clone(),
            bytes(d.memory_bytes),
            free(d),
            state,
        ]
    };
    let heads = ["", "device", "kind", "driver", "Vulkan", "memory", "free", "state"];
    console.data(&table(&heads, &devices.iter().map(row).collect::<Vec<_>>()))?;
    Ok(0)
}
