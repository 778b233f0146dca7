//! Result files, whole or not at all.

use std::io::{self, BufWriter, Write};
use std::path::Path;

use tempfile::NamedTempFile;

use crate::{Result, output};

/// Writes a file under a passing name and then gives it its own, so that an end at any time leaves the old file or the
/// new one. Folders that are missing are made.
///
/// # Errors
/// [`Error::Output`](crate::Error::Output).
pub fn write_whole(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&mut NamedTempFile>) -> io::Result<()>,
) -> Result<()> {
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).map_err(|error| output::unwritable(path, &error))?;
    }
    let mut file = output::file_beside(path)?;
    let mut writer = BufWriter::new(&mut file);
    write(&mut writer).and_then(|()| writer.flush()).map_err(|error| output::unwritable(path, &error))?;
    drop(writer);
    output::keep(file, path)
}
