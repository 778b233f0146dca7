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
}
