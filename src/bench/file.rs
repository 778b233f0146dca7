//! Result files, whole or not at all.

use std::io::{self, BufWriter, Write};
use std::path::Path;

use tempfile::NamedTempFile;

use crate::{Result, output};

/// Whether a file can be written there; folders that are missing are made, and a file that is there stays as it is.
///
/// # Errors
/// [`Error::Output`](crate::Error::Output).
pub fn check_writable(path: &Path) -> Result<()> {
    make_folder(path)?;
    output::file_beside(path).map(drop)
}

/// Removes a file, if it is there.
///
/// # Errors
/// [`Error::Output`](crate::Error::Output).
pub fn remove(path: &Path) -> Result<()> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(output::unwritable(path, &error)),
        _ => Ok(()),
    }
}

fn make_folder(path: &Path) -> Result<()> {
    let Some(folder) = path.parent() else { return Ok(()) };
    std::fs::create_dir_all(folder).map_err(|error| output::unwritable(path, &error))
}

/// Writes a file under a passing name and then gives it its own, so that an end at any time leaves the old file or the
/// new one. Folders that are missing are made.
///
/// # Errors
/// [`Error::Output`](crate::Error::Output).
pub fn write_whole(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&mut NamedTempFile>) -> io::Result<()>,
) -> Result<()> {
    make_folder(path)?;
    let mut file = output::file_beside(path)?;
    let mut writer = BufWriter::new(&mut file);
    write(&mut writer).and_then(|()| writer.flush()).map_err(|error| output::unwritable(path, &error))?;
    drop(writer);
    output::keep(file, path)
}
