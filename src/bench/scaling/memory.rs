//! What the process holds in memory, where the system tells: Linux.

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
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix(name))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(1024 * kibibytes)
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn what_is_held_counts() {
        let before = now().unwrap();
        let held = vec![1u8; 64 << 20];
        assert!(now().unwrap() >= before + (60 << 20) && peak().unwrap() >= before + (60 << 20));
        assert_eq!(held[12345], 1);
    }
}
