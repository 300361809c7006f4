//! The choice of the device.

use super::DeviceDescription;
use base::error::{Error, Kind, Result};

/// Picks a device by index or part of the name if `wanted` is given, or else the fastest kind that can be
/// used.
pub(super) fn choose<'a>(
    list: &'a [DeviceDescription],
    wanted: Option<&str>,
) -> Result<&'a DeviceDescription> {
    let listing = || {
        list.iter()
            .map(|d| {
                let state = if d.missing.is_empty() {
                    "usable".to_owned()
                } else {
                    format!("lacks {}", d.missing.join(", "))
                };
                format!("\n    {}: {} ({}; {}): {state}", d.index, d.name, d.kind, d.driver)
            })
            .collect::<String>()
    };
    if list.is_empty() {
        return Err(Error::new(Kind::Unavailable, "VGS-GPU-004", "no Vulkan device was found")
            .help(super::boot::INSTALL));
    }
    let chosen = match wanted {
        // A number is an index and never a part of a name, such as that of a version in it.
        Some(text) => match text.parse::<usize>() {
            Ok(index) => list.iter().find(|d| d.index == index),
            Err(_) => list.iter().find(|d| d.name.to_lowercase().contains(&text.to_lowercase())),
        },
        None => list.iter().filter(|d| d.missing.is_empty()).min_by_key(|d| {
            ["discrete GPU", "integrated GPU", "virtual GPU", "CPU"]
                .iter()
                .position(|k| *k == d.kind)
                .unwrap_or(usize::MAX)
        }),
    };
    match chosen {
        Some(d) if d.missing.is_empty() => Ok(d),
        Some(d) => Err(Error::new(
            Kind::Unavailable,
            "VGS-GPU-005",
            format!("{} lacks {}", d.name, d.missing.join(", ")),
        )
        .help(format!("choose another device with --device:{}", listing()))),
        None => Err(Error::new(
            Kind::Unavailable,
            "VGS-GPU-006",
            match wanted {
                Some(text) => format!("no Vulkan device matches {text:?}"),
                None => "no Vulkan device has what is needed".to_owned(),
            },
        )
        .help(format!("found:{}", listing()))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn device(index: usize, name: &str, kind: &'static str, missing: &[&str]) -> DeviceDescription {
        DeviceDescription {
            index,
            name: name.into(),
            kind,
            driver: "test".into(),
            api: "1.3.0".into(),
            memory_bytes: 0,
            heaps: Vec::new(),
            subgroup_size: 8,
            max_storage_range: 1 << 27,
            missing: missing.iter().map(|&m| m.into()).collect(),
        }
    }

    #[test]
    fn the_fastest_usable_device_is_chosen_unless_the_user_says_otherwise() {
        let list = [
            device(0, "llvmpipe (LLVM 19.1.7)", "CPU", &[]),
            device(1, "Big GPU", "discrete GPU", &["feature scalarBlockLayout"]),
            device(2, "Small GPU", "integrated GPU", &[]),
        ];
        for (wanted, expect) in [(None, 2), (Some("0"), 0), (Some("pipe"), 0), (Some("small"), 2)] {
            assert_eq!(choose(&list, wanted).unwrap().index, expect, "{wanted:?}");
        }
        for wanted in ["1", "big", "none such", "7", "19"] {
            let e = choose(&list, Some(wanted)).unwrap_err();
            assert_eq!(e.kind, Kind::Unavailable);
            assert!(e.help.contains("llvmpipe"), "the help lists the devices: {}", e.help);
        }
        assert!(choose(&[], None).is_err());
    }
}
