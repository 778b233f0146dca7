//! Files that are read: regular ones, and no more of them than they can be worth. A device such as /dev/zero never ends, and a
//! pipe that nobody writes to never even opens.

use std::fs::File;
use std::io::{Error, ErrorKind, Read, Result};
use std::path::Path;

/// The longest text that a person writes: a scene, a recipe, a sweep; in bytes.
pub const LONGEST_TEXT: u64 = 1 << 20;

/// DEFLATE, the densest compression of any file that is read, turns no byte into more (a match of 258 bytes takes at least two
/// bits).
pub const MAX_DEFLATE_RATIO: u64 = 1032;

/// A regular file, open for reading, and its length in bytes.
///
/// # Errors
/// Those of the system, and one that says that it is no regular file.
pub fn open(path: &Path) -> Result<(File, u64)> {
    // Asked before it is opened: to open a pipe is to wait for its writer.
    if !path.metadata()?.is_file() {
        return Err(Error::other("it is no regular file"));
    }
    let file = File::open(path)?;
    let length = file.metadata()?.len();
    Ok((file, length))
}

/// The whole of a regular file of at most `most` bytes.
///
/// # Errors
/// As [`open`], and one that tells a longer file.
pub fn bytes(path: &Path, most: u64) -> Result<Vec<u8>> {
    let (file, length) = open(path)?;
    if length > most {
        return Err(too_long(most));
    }
    // As long as it was found to be: it may grow while it is read.
    let mut bytes = Vec::new();
    file.take(length).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// A text of at most [`LONGEST_TEXT`], from any kind of file: a pipe may bring what a program writes.
///
/// # Errors
/// Those of the system, and one that tells a longer text.
pub fn text(path: &Path) -> Result<String> {
    let mut text = String::new();
    File::open(path)?.take(LONGEST_TEXT + 1).read_to_string(&mut text)?;
    if text.len() as u64 > LONGEST_TEXT { Err(too_long(LONGEST_TEXT)) } else { Ok(text) }
}

fn too_long(most: u64) -> Error {
    Error::new(ErrorKind::FileTooLarge, format!("it is longer than {} MiB", most >> 20))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn what_never_ends_or_never_begins_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        for path in [Path::new("/dev/zero"), &pipe, folder.path()] {
            assert_eq!(open(path).unwrap_err().to_string(), "it is no regular file", "{}", path.display());
            assert!(bytes(path, u64::MAX).is_err());
        }
        assert_eq!(text(Path::new("/dev/zero")).unwrap_err().kind(), ErrorKind::FileTooLarge);
    }

    #[test]
    fn a_file_is_read_whole_up_to_its_bound() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        std::fs::write(&path, "12345").unwrap();
        assert_eq!(bytes(&path, 5).unwrap(), b"12345");
        assert_eq!(bytes(&path, 4).unwrap_err().kind(), ErrorKind::FileTooLarge);
        for (length, is_read) in [(LONGEST_TEXT, true), (LONGEST_TEXT + 1, false)] {
            std::fs::write(&path, vec![b' '; length as usize]).unwrap();
            assert_eq!(text(&path).is_ok(), is_read);
        }
    }
}
