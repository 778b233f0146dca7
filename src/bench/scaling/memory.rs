//! What the process holds in memory, where the system tells: Linux, by proc(5).

use std::fs;

/// The bytes that are in memory now.
pub fn now() -> Option<u64> {
    status("VmRSS:")
}

/// The most bytes that were in memory since [`forget_peak`].
pub fn peak() -> Option<u64> {
    status("VmHWM:")
}

/// Lets [`peak`] begin anew, from what is in memory now. Where the system refuses it goes on from where it was.
pub fn forget_peak() {
    // See proc(5), /proc/pid/clear_refs; a larger peak is no error.
    let _ = fs::write("/proc/self/clear_refs", "5");
}

fn status(name: &str) -> Option<u64> {
    bytes(&fs::read_to_string("/proc/self/status").ok()?, name)
}

/// What a line of /proc/pid/status says.
fn bytes(status: &str, name: &str) -> Option<u64> {
    let line = status.lines().find_map(|line| line.strip_prefix(name))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(1024 * kibibytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_tells_bytes() {
        let status = "Name:\tmesoshell\nVmHWM:\t    1234 kB\nVmRSS:\t    1000 kB\n";
        assert_eq!((bytes(status, "VmHWM:"), bytes(status, "VmRSS:")), (Some(1234 << 10), Some(1000 << 10)));
        assert_eq!(bytes(status, "VmSwap:"), None);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn the_peak_is_no_less_than_what_is_held() {
        let held = now().unwrap();
        assert!(held > 1 << 20 && peak().unwrap() >= held);
    }
}
