//! The one error type of the crate: each variant is one exit code of the command line.

use std::path::{Path, PathBuf};

use miette::{Diagnostic, NamedSource, SourceSpan};

/// Shorthand for results that carry an [`enum@Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Everything that can go wrong, told so that its reader knows what to change.
#[derive(Debug, thiserror::Error, Diagnostic)]
pub enum Error {
    /// The request itself makes no sense (exit code 2, as clap's own usage errors).
    #[error("{message}")]
    Usage {
        /// What was asked and why it cannot be.
        message: String,
        /// What to do instead.
        #[help]
        help: Option<String>,
    },
    /// A file that was to be read is missing, damaged or means something impossible (exit code 3).
    #[error("{}: {message}", path.display())]
    Input {
        /// The file.
        path: PathBuf,
        /// What is wrong with it, with the line where there is one.
        message: String,
        /// What to do about it.
        #[help]
        help: Option<String>,
    },
    /// A scene or recipe file with a spot that can be underlined (exit code 3).
    #[error("{message}")]
    Text {
        /// The text and its name.
        #[source_code]
        source_code: std::sync::Arc<NamedSource<String>>,
        /// The offending bytes.
        #[label("{label}")]
        span: SourceSpan,
        /// What is wrong.
        message: String,
        /// What is wrong, in the few words that fit under the spot.
        label: String,
        /// What to do about it.
        #[help]
        help: Option<String>,
    },
    /// No usable Vulkan device, or the device cannot do what the scene needs (exit code 4).
    #[error("{message}")]
    Device {
        /// What the device lacks.
        message: String,
        /// What to install or change.
        #[help]
        help: Option<String>,
    },
    /// The scene does not fit into memory, the device's or the machine's (exit code 5).
    #[error("{message}")]
    OutOfMemory {
        /// What was asked for, in bytes, and what there is.
        message: String,
        /// What to make smaller.
        #[help]
        help: Option<String>,
    },
    /// A result could not be written (exit code 6).
    #[error("{}: {message}", path.display())]
    Output {
        /// The file that was to be written.
        path: PathBuf,
        /// Why it could not be.
        message: String,
        /// What to do about it.
        #[help]
        help: Option<String>,
    },
    /// The user interrupted the run; nothing was left behind (exit code 130).
    #[error("interrupted")]
    Interrupted,
}

impl Error {
    /// An [`Error::Input`] without advice.
    pub fn input(path: impl AsRef<Path>, message: impl Into<String>) -> Self {
        Self::Input { path: path.as_ref().to_owned(), message: message.into(), help: None }
    }

    /// What it says and what it advises; `None` of an interrupt, which needs no words.
    fn words(&mut self) -> Option<(&mut String, &mut Option<String>)> {
        match self {
            Self::Usage { message, help }
            | Self::Input { message, help, .. }
            | Self::Text { message, help, .. }
            | Self::Device { message, help }
            | Self::OutOfMemory { message, help }
            | Self::Output { message, help, .. } => Some((message, help)),
            Self::Interrupted => None,
        }
    }

    /// The same error with advice in place of what advice it had.
    #[must_use]
    pub fn with_help(mut self, advice: impl Into<String>) -> Self {
        if let Some((_, help)) = self.words() {
            *help = Some(advice.into());
        }
        self
    }

    /// The same error, said to be of something: `"frame 12"`.
    #[must_use]
    pub fn of(mut self, what: &str) -> Self {
        if let Some((message, _)) = self.words() {
            *message = format!("{what}: {message}");
        }
        self
    }

    /// The exit code that the command line reports for this error.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Usage { .. } => 2,
            Self::Input { .. } | Self::Text { .. } => 3,
            Self::Device { .. } => 4,
            Self::OutOfMemory { .. } => 5,
            Self::Output { .. } => 6,
            Self::Interrupted => 130,
        }
    }
}
