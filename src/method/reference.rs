//! The f64 reference as a method: see [`crate::reference`].

use std::sync::Arc;

use super::{Method, Setup};
use crate::Result;
use crate::frame::Frame;
use crate::progress::{Interrupt, Progress};
use crate::scene::{Scene, View};

struct Reference {
    scene: Arc<Scene>,
    progress: Arc<dyn Progress>,
    interrupt: Interrupt,
}

/// Needs no device.
///
/// # Errors
/// None.
pub fn prepare(scene: Arc<Scene>, setup: &Setup<'_>) -> Result<Box<dyn Method>> {
    Ok(Box::new(Reference { scene, progress: setup.progress.clone(), interrupt: setup.interrupt.clone() }))
}

impl Method for Reference {
    fn render(&mut self, view: &View) -> Result<Frame> {
        crate::reference::render(&self.scene, view, self.progress.as_ref(), &self.interrupt)
    }
}
