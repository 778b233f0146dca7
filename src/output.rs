//! Files that appear whole or not at all: they are written beside their final name, and then renamed.

use std::path::Path;

use tempfile::NamedTempFile;

use crate::{Error, Result};

/// A file under a passing name in the directory of `path`, deleted unless it is [kept](keep).
///
/// # Errors
/// [`Error::Output`] where no file can be made there, or where `path` is there already and no file.
pub fn file_beside(path: &Path) -> Result<NamedTempFile> {
    // A rename would put a file in place of a device such as /dev/null.
    if path.exists() && !path.is_file() {
        return Err(error(path, "is there already, and is not a file".into())
            .with_help("name a file that may be replaced, or a new one"));
    }
    let directory = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    builder.prefix(".mesoshell-");
    #[cfg(unix)]
    {
        // As any other new file, not private as temporary files are by default; the umask still applies.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(directory).map_err(|failed| {
        let help = if directory.is_dir() {
            "check the directory's permissions and the space on its disk"
        } else {
            "make the directory first"
        };
        // The system's own words, without the passing name.
        let reason = std::io::Error::from(failed.kind());
        error(path, format!("no file can be made in {}: {reason}", directory.display())).with_help(help)
    })
}

/// Gives a [file beside](file_beside) `path` that name, in place of any file that has it.
///
/// # Errors
/// [`Error::Output`] where it cannot be renamed.
pub fn keep(file: NamedTempFile, path: &Path) -> Result<()> {
    file.persist(path).map_err(|failed| unwritable(path, &failed.error))?;
    Ok(())
}

/// An [`Error::Output`] without advice.
pub fn error(path: &Path, message: String) -> Error {
    Error::Output { path: path.to_owned(), message, help: None }
}

/// The system would not let a file be written.
pub fn unwritable(path: &Path, failed: &std::io::Error) -> Error {
    error(path, format!("cannot be written: {failed}"))
}
