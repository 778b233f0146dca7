//! How long-running work tells its progress, and how it is told to stop.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::{Error, Result};

/// Hears of the stages of a run; the command line draws them, a library user may ignore them.
pub trait Progress: Send + Sync {
    /// A new stage begins: a few words in the present tense, such as `"sorting tetrahedra"`.
    fn stage(&self, name: &str);
    /// The part of the current stage that is done, 0 to 1; may be called from any thread.
    fn fraction(&self, done: f64);
}

/// Hears nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Progress for Silent {
    fn stage(&self, _name: &str) {}
    fn fraction(&self, _done: f64) {}
}

/// A flag, shared between threads, by which a run is asked to stop.
#[derive(Debug, Clone, Default)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Asks every run that holds this flag to stop at its next check.
    pub fn set(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether the run was asked to stop.
    pub fn is_set(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// # Errors
    /// [`Error::Interrupted`] once the flag is set.
    pub fn check(&self) -> Result<()> {
        if self.is_set() { Err(Error::Interrupted) } else { Ok(()) }
    }
}
