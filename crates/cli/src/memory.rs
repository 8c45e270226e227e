//! How much memory the process has needed, and how much it can still have.

/// The most memory that this process has held at once, bytes: `VmHWM` of Linux. `None` elsewhere.
pub fn peak_memory_bytes() -> Option<u64> {
    read("/proc/self/status", "VmHWM:")
}

/// The memory that can be taken without anything being swapped out, bytes: `MemAvailable` of Linux. `None` elsewhere.
pub fn available_memory_bytes() -> Option<u64> {
    read("/proc/meminfo", "MemAvailable:")
}

fn read(file: &str, key: &str) -> Option<u64> {
    parse(&std::fs::read_to_string(file).ok()?, key)
}

fn parse(text: &str, key: &str) -> Option<u64> {
    let line = text.lines().find_map(|l| l.strip_prefix(key))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim_end().parse().ok()?;
    Some(kibibytes * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_high_water_mark_is_read() {
        assert_eq!(parse("VmPeak:\t  900 kB\nVmHWM:\t    512 kB\nVmRSS:\t 1 kB\n", "VmHWM:"), Some(512 * 1024));
        assert_eq!(parse("VmRSS:\t 1 kB\n", "VmHWM:"), None);
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn it_holds_what_was_allocated() {
        let before = peak_memory_bytes().unwrap();
        let block = std::hint::black_box(vec![1u8; before as usize + (8 << 20)]);
        assert!(peak_memory_bytes().unwrap() > block.len() as u64);
        assert!((1 << 20..1 << 50).contains(&available_memory_bytes().unwrap()));
    }
}
