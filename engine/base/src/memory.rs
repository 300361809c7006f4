//! Host memory: how much is available, checked before a size from a file or a flag is allocated.

use crate::error::{Error, Kind, Result};

/// Bytes that need no asking whether they are there: asking takes longer than taking them.
const LITTLE: u64 = 1 << 20;

/// Returns the bytes that a program may still allocate without swapping; `None` if the system does not tell.
pub fn available() -> Option<u64> {
    from_meminfo(&std::fs::read_to_string("/proc/meminfo").ok()?)
}

/// Fails with [`Kind::HostMemory`] if `bytes` for `what` are more than is available. Where the system does
/// not tell, the allocation itself has to fail.
pub fn require(bytes: u64, what: &str) -> Result<()> {
    match (bytes > LITTLE).then(available).flatten() {
        Some(there) if bytes > there => {
            let message = format!(
                "{what} need {:.1} GB of memory, and {:.1} GB are available",
                bytes as f64 * 1e-9,
                there as f64 * 1e-9
            );
            Err(Error::new(Kind::HostMemory, "VGS-MEM-001", message)
                .help("ask for less, or end other programs; nothing was begun"))
        }
        _ => Ok(()),
    }
}

/// Parses the line "MemAvailable:   123456 kB" (Linux, proc(5)) and returns the number in bytes.
fn from_meminfo(text: &str) -> Option<u64> {
    let rest = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    let kilobytes: u64 = rest.trim().strip_suffix("kB")?.trim().parse().ok()?;
    kilobytes.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_too_much_is_refused_before_it_is_taken() {
        let text = "MemTotal:       24684132 kB\nMemFree:        20 kB\nMemAvailable:   23495472 kB\n";
        assert_eq!(from_meminfo(text), Some(23_495_472 * 1024));
        assert_eq!(from_meminfo("MemTotal: 1 kB\n"), None);
        assert_eq!(from_meminfo("MemAvailable: lots\n"), None);
        require(1, "a byte").expect("a byte");
        if available().is_some() {
            let error = require(u64::MAX, "all splats").expect_err("more than there can be");
            assert_eq!((error.kind, error.code), (Kind::HostMemory, "VGS-MEM-001"));
            assert!(error.message.starts_with("all splats need 18446744073.7 GB"), "{error}");
        }
    }
}
