//! Files of one name but for a number: `smoke.####.ktx2`.

use std::path::{Path, PathBuf};

use crate::{Error, Result};

/// The files that a name with a run of `#` in its last part stands for, by their numbers: at least as many digits as there are `#`.
/// `None` where it has none, or is itself the name of a file.
///
/// # Errors
/// [`Error::Input`] where the folder cannot be read, no file is there, or a number is missing between the first and the last.
pub(super) fn files(path: &Path) -> Result<Option<Vec<PathBuf>>> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let Some((before, rest)) = name.split_once('#').filter(|_| !path.exists()) else { return Ok(None) };
    let after = rest.trim_start_matches('#');
    let digits = 1 + rest.len() - after.len();
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let entries = std::fs::read_dir(folder)
        .map_err(|error| Error::input(path, format!("its folder cannot be read: {error}")))?;
    let mut found: Vec<(u64, PathBuf)> = Vec::new();
    for entry in entries.flatten() {
        let name = entry.file_name();
        let number = name.to_str().and_then(|name| name.strip_prefix(before)?.strip_suffix(after));
        let number =
            number.filter(|number| number.len() >= digits && number.bytes().all(|b| b.is_ascii_digit()));
        found.extend(number.and_then(|number| number.parse().ok()).map(|number| (number, entry.path())));
    }
    found.sort();
    if found.is_empty() {
        return Err(Error::input(path, "no file has this name with a number in place of the `#`")
            .with_help("write as many # as the numbers have digits at least"));
    }
    let numbers = found.iter().map(|(number, _)| number);
    if let Some((a, b)) = numbers.clone().zip(numbers.skip(1)).find(|(a, b)| *a + 1 != **b) {
        let message = match a == b {
            true => format!("there are two files of the number {a}"),
            false => format!("number {} is missing, between {a} and {b}", a + 1),
        };
        return Err(Error::input(path, message)
            .with_help("a sequence has a file for every number from its first to its last"));
    }
    Ok(Some(found.into_iter().map(|(_, path)| path).collect()))
}

/// When a frame is, and how what plays by itself goes on at its end.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moment {
    /// Seconds.
    pub time: f64,
    /// From the beginning again; else it stands still.
    pub loops: bool,
}

impl Moment {
    /// Which of `count` files of `rate` a second is shown, `time` seconds after the first.
    pub(super) fn file(self, count: usize, rate: f64, time: Option<f64>) -> usize {
        // A time that is a whole number of files, but for rounding, is the beginning of that file.
        let files = (time.unwrap_or(self.time) * rate + 1e-6).floor().max(0.0);
        let file = files as usize;
        if self.loops { file % count } else { file.min(count - 1) }
    }

    /// As [`Moment::file`], with the file that comes after it, and how far towards that it is, 0..1.
    pub(super) fn between(self, count: usize, rate: f64, time: Option<f64>) -> (usize, usize, f64) {
        let from = self.file(count, rate, time);
        let to = if self.loops { (from + 1) % count } else { (from + 1).min(count - 1) };
        let files = (time.unwrap_or(self.time) * rate).max(0.0);
        // What is a whole number but for rounding shows one file alone.
        let part = (files - (files + 1e-6).floor()).max(0.0);
        (from, to, if from == to { 0.0 } else { part })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_found_by_their_numbers() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        for name in ["a.9.x", "a.10.x", "a.08.x", "a.7b.x", "a.11.y", "b.1.x", "b.3.x", "c#.x"] {
            std::fs::write(path(name), "").unwrap();
        }
        let found = files(&path("a.#.x")).unwrap().unwrap();
        assert_eq!(found, [path("a.08.x"), path("a.9.x"), path("a.10.x")]);
        assert!(files(&path("c#.x")).unwrap().is_none(), "it is itself the name of a file");
        assert!(files(&path("a.x")).unwrap().is_none());
        for (name, part) in
            [("a.##.x", "number 9 is missing, between 8 and 10"), ("b.#.x", "number 2"), ("d.#.x", "no file")]
        {
            let error = files(&path(name)).unwrap_err().to_string();
            assert!(error.contains(part) && error.contains(name), "{error}");
        }
    }

    #[test]
    fn moments_have_files() {
        let file = |time: f64, loops: bool, own: Option<f64>| Moment { time, loops }.file(4, 10.0, own);
        assert_eq!([0.0, 0.09, 0.1, 0.3 - 1e-9, 0.3].map(|time| file(time, false, None)), [0, 0, 1, 3, 3]);
        assert_eq!([0.4, 0.55].map(|time| file(time, false, None)), [3, 3]);
        assert_eq!([0.4, 0.55].map(|time| file(time, true, None)), [0, 1]);
        assert_eq!(file(0.4, true, Some(0.2)), 2, "its own time");
        assert_eq!(file(0.0, false, Some(-1.0)), 0);
        let between = |time: f64, loops: bool| Moment { time, loops }.between(4, 8.0, None);
        assert_eq!(between(0.125 - 1e-9, false), (1, 2, 0.0), "but for rounding");
        assert_eq!(between(0.15625, false), (1, 2, 0.25));
        assert_eq!([between(0.40625, false), between(9.0, false)], [(3, 3, 0.0); 2]);
        assert_eq!(between(0.40625, true), (3, 0, 0.25));
    }
}
