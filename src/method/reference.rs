//! The f64 reference as a method: see [`crate::reference`].

use std::sync::Arc;

use super::{Method, Setup};
use crate::Result;
use crate::frame::Frame;
use crate::progress::{Interrupt, Progress};
use crate::scene::{Scene, Sizes, View};

struct Opened {
    progress: Arc<dyn Progress>,
    interrupt: Interrupt,
}

struct Reference {
    scene: Arc<Scene>,
    opened: Opened,
}

/// Needs no device.
///
/// # Errors
/// None.
pub fn open(setup: &Setup<'_>) -> Result<Box<dyn super::Opened>> {
    Ok(Box::new(Opened { progress: setup.progress.clone(), interrupt: setup.interrupt.clone() }))
}

impl super::Opened for Opened {
    fn admit(&self, _: &Sizes) -> Result<()> {
        Ok(())
    }

    fn device(&self) -> String {
        "cpu".into()
    }

    fn prepare(self: Box<Self>, scene: Arc<Scene>) -> Result<Box<dyn Method>> {
        Ok(Box::new(Reference { scene, opened: *self }))
    }
}

impl Method for Reference {
    fn render(&mut self, view: &View) -> Result<Frame> {
        let Opened { progress, interrupt } = &self.opened;
        crate::reference::render(&self.scene, view, progress.as_ref(), interrupt)
    }

    fn update(&mut self, scene: Arc<Scene>) -> Result<()> {
        self.scene = scene;
        Ok(())
    }

    fn forget(&mut self) {}
}
