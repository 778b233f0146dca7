//! Standard output and standard error, whose reader may have gone.

use std::io::{ErrorKind, Write, stderr, stdout};

use mesoshell::{Error, Result};
use serde::Serialize;

use super::Talk;

impl Talk {
    /// Prints a result: `value` as JSON, or `text`, or nothing, as the user wants it.
    ///
    /// # Errors
    /// [`Error::Output`], unless the reader has merely gone.
    pub fn result(self, value: &impl Serialize, text: impl FnOnce() -> String) -> Result<()> {
        let text = match self {
            Self { quiet: true, .. } => return Ok(()),
            Self { json: true, .. } => serde_json::to_string_pretty(value).map_err(std::io::Error::from),
            Self { json: false, .. } => Ok(text()),
        };
        let written = text.and_then(|text| {
            let mut stdout = stdout().lock();
            stdout.write_all(text.trim_end().as_bytes())?;
            stdout.write_all(b"\n")?;
            stdout.flush()
        });
        match written {
            Err(error) if error.kind() != ErrorKind::BrokenPipe => {
                Err(Error::Output { path: "standard output".into(), message: error.to_string(), help: None })
            }
            _ => Ok(()),
        }
    }

    /// Prints what comes before a result, for people alone.
    ///
    /// # Errors
    /// As [`result`](Self::result).
    pub fn foreword(self, text: &str) -> Result<()> {
        if self.json { Ok(()) } else { self.result(&(), || text.to_owned()) }
    }

    /// Prints a warning, unless the user wants quiet.
    pub fn warn(self, warning: &str) {
        if !self.quiet {
            complain(&format!("warning: {warning}"));
        }
    }
}

/// Prints a line on standard error; where even that cannot be written there is nobody to tell.
pub fn complain(line: &str) {
    let _ = writeln!(stderr(), "{}", line.trim_end());
}
