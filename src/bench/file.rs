//! Result files that are there whole or not at all.

use std::io::{self, BufWriter, Write};
use std::path::Path;

use tempfile::NamedTempFile;

use crate::frame::file::file_beside;
use crate::{Error, Result};

/// Writes a file beside its final name and then renames it, so that an end at any time leaves the old file or the
/// new one. Folders that are missing are made.
///
/// # Errors
/// [`Error::Output`].
pub fn write_whole(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&mut NamedTempFile>) -> io::Result<()>,
) -> Result<()> {
    let failed = |error: io::Error| Error::Output {
        path: path.to_owned(),
        message: format!("cannot be written: {error}"),
        help: Some("check the folder's permissions and the space on its disk".to_owned()),
    };
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).map_err(failed)?;
    }
    let mut file = file_beside(path)?;
    let mut writer = BufWriter::new(&mut file);
    write(&mut writer).and_then(|()| writer.flush()).map_err(failed)?;
    drop(writer);
    file.persist(path).map_err(|error| failed(error.error))?;
    Ok(())
}
