//! On what a measurement was made.

use std::process::{Command, Stdio};
use std::time::SystemTime;

use serde::{Deserialize, Serialize};

use crate::gpu::DeviceInfo;

/// The machine and the program.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Environment {
    /// When it began: UTC, RFC 3339.
    pub date: String,
    /// Of this crate.
    pub version: String,
    /// The commit of the working directory's repository, if there is one, with `+` where files differ from it.
    pub commit: Option<String>,
    /// The Vulkan device.
    pub device: String,
    /// Its driver and that one's version.
    pub driver: String,
    /// The Vulkan version of the device.
    pub vulkan: String,
    /// The processor's name, where the system tells it.
    pub processor: Option<String>,
    /// Threads that may run at once.
    pub cores: usize,
    /// The operating system and the architecture.
    pub os: String,
}

impl Environment {
    /// Here and now, with that device.
    pub fn here(device: &DeviceInfo) -> Self {
        let os = value_of("/etc/os-release", "PRETTY_NAME", '=');
        let os = os.unwrap_or_else(|| std::env::consts::OS.to_owned());
        Self {
            date: humantime::format_rfc3339_seconds(SystemTime::now()).to_string(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            commit: commit(),
            device: device.name.clone(),
            driver: device.driver.clone(),
            vulkan: device.api_version.clone(),
            processor: value_of("/proc/cpuinfo", "model name", ':'),
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            os: format!("{os}, {}", std::env::consts::ARCH),
        }
    }

    /// Names and values for people.
    pub fn rows(&self) -> Vec<(&'static str, String)> {
        let cores = format!("{} cores", self.cores);
        let processor = self.processor.as_ref().map_or(cores.clone(), |name| format!("{name}, {cores}"));
        let mut rows = vec![
            ("date", self.date.clone()),
            ("device", self.device.clone()),
            ("driver", format!("{}, Vulkan {}", self.driver, self.vulkan)),
            ("processor", processor),
            ("system", self.os.clone()),
            ("mesoshell", self.version.clone()),
        ];
        rows.extend(self.commit.clone().map(|commit| ("commit", commit)));
        rows
    }
}

/// The value of the first line `key separator value` of a system's text file.
fn value_of(path: &str, key: &str, separator: char) -> Option<String> {
    let text = std::fs::read_to_string(path).ok()?;
    let mut lines = text.lines().filter_map(|line| line.split_once(separator));
    let (_, value) = lines.find(|(found, _)| found.trim() == key)?;
    Some(value.trim().trim_matches('"').to_owned())
}

fn commit() -> Option<String> {
    let git = |arguments: &[&str]| {
        let output = Command::new("git").args(arguments).stdin(Stdio::null()).output().ok()?;
        let text = String::from_utf8(output.stdout).ok()?;
        output.status.success().then(|| text.trim().to_owned())
    };
    let commit = git(&["rev-parse", "--short=12", "HEAD"])?;
    let changed =
        git(&["status", "--porcelain", "--untracked-files=no"]).is_some_and(|text| !text.is_empty());
    Some(if changed { commit + "+" } else { commit })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_found_by_their_key() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("os-release");
        std::fs::write(&path, "NAME=\"X\"\nPRETTY_NAME=\"X 1 (one)\"\nmodel name\t: fast: 9\n").unwrap();
        let path = path.to_str().unwrap();
        assert_eq!(value_of(path, "PRETTY_NAME", '=').as_deref(), Some("X 1 (one)"));
        assert_eq!(value_of(path, "model name", ':').as_deref(), Some("fast: 9"));
        assert_eq!(value_of(path, "VERSION", '='), None);
        assert_eq!(value_of("nowhere", "NAME", '='), None);
    }
}
