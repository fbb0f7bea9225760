//! The memory of this process as reported by Linux; 0 on other systems.

/// Bytes resident now.
pub fn resident() -> u64 {
    field("VmRSS:")
}

/// The most bytes resident at a time since `restart_peak`.
pub fn peak() -> u64 {
    field("VmHWM:")
}

/// Resets the peak.
pub fn restart_peak() {
    // If the file cannot be written, peaks count from the start of the process.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

fn field(name: &str) -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix(name)).unwrap_or_default();
    line.split_whitespace().next().and_then(|kib| kib.parse::<u64>().ok()).unwrap_or_default() * 1024
}
