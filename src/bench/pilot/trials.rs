//! The trials of one picture, kept in a file under its fingerprint.

use std::io::Write;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::super::file::write_whole;
use super::Trial;
use crate::Result;
use crate::fingerprint::Fingerprint;

const FORMAT: &str = "mesoshell pilot 1";

/// The file.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Contents {
    format: String,
    fingerprint: Fingerprint,
    trials: Vec<Trial>,
}

/// What was tried, here and in runs before.
pub struct Trials {
    path: Option<PathBuf>,
    contents: Contents,
}

impl Trials {
    /// Those in `folder` under that fingerprint. A file that is damaged counts as none: its trials are measured again.
    pub fn load(folder: Option<&Path>, fingerprint: Fingerprint) -> Self {
        let path = folder.map(|folder| folder.join(format!("{fingerprint}.pilot")));
        let known = path.as_ref().and_then(|path| {
            let text = std::fs::read(path).ok()?;
            let contents: Contents = serde_json::from_slice(&text).ok()?;
            (contents.format == FORMAT && contents.fingerprint == fingerprint).then_some(contents)
        });
        let none = Contents { format: FORMAT.to_owned(), fingerprint, trials: Vec::new() };
        Self { path, contents: known.unwrap_or(none) }
    }

    /// In the order in which they were made.
    pub fn all(&self) -> &[Trial] {
        &self.contents.trials
    }

    /// Adds one, and keeps all.
    ///
    /// # Errors
    /// [`Error::Output`](crate::Error::Output).
    pub fn add(&mut self, trial: Trial) -> Result<()> {
        self.contents.trials.push(trial);
        let Some(path) = &self.path else { return Ok(()) };
        // JSON has no infinity.
        if !trial.error.rmse.is_finite() {
            return Ok(());
        }
        let json = serde_json::to_vec_pretty(&self.contents).expect("numbers and strings");
        write_whole(path, |file| file.write_all(&json))
    }
}

#[cfg(test)]
mod tests {
    use super::super::Estimate;
    use super::*;
    use crate::scene::March;

    fn fingerprint(text: &str) -> Fingerprint {
        Fingerprint::builder("test").bytes(text.as_bytes()).finish()
    }

    #[test]
    fn trials_are_found_again_and_damaged_ones_are_not() {
        let folder = tempfile::tempdir().unwrap();
        let load = |text| Trials::load(Some(folder.path()), fingerprint(text));
        let trial = Trial {
            march: March::Default { step: 0.7 },
            error: Estimate { rmse: 1e-3, standard_error: f64::MIN_POSITIVE },
        };
        let mut trials = load("a");
        trials.add(trial).unwrap();
        trials.add(Trial { march: March::Exact, ..trial }).unwrap();
        assert_eq!(load("a").all(), trials.all());
        assert!(load("b").all().is_empty());
        let path = trials.path.unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        for damaged in [&text[1..], "", &text.replace("pilot 1", "pilot 0")] {
            std::fs::write(&path, damaged).unwrap();
            assert!(load("a").all().is_empty());
        }
    }
}
