//! Numerical stability under stress: cases that are hard on floating-point numbers, each with a derived bound.
//!
//! A [`Case`] renders or builds something hostile, on its own, and yields the worst value that it saw; the bound stands beside
//! the case with its derivation. `mesoshell stress` runs the long form of all, `cargo test --test stress` the short one.
//! What rounding in f32 alone may do to a picture is derived once, in [`compare`].

pub mod compare;
mod feature;
mod geometry;
mod input;
mod invariance;
mod medium;
mod repeat;
pub mod scenes;

use std::sync::Arc;

use serde::Serialize;

use crate::Result;
use crate::frame::{Frame, Image};
use crate::method::{self, Method, Setup};
use crate::scene::{Scene, Traversal, View};

/// How much of a case is run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Extent {
    /// Few views, small pictures.
    Quick,
    /// All.
    Full,
}

/// What a case may use.
#[derive(Clone, Copy)]
pub struct Stand<'a> {
    /// Device, validation, progress and interrupt.
    pub setup: Setup<'a>,
    /// See [`Extent`].
    pub extent: Extent,
}

/// One thing that may go wrong, and how far it may.
pub struct Case {
    /// As given to `--filter`.
    pub name: &'static str,
    /// What the numbers count or measure.
    pub measure: &'static str,
    /// The largest value that passes; the case says why.
    pub bound: f64,
    /// The worst value seen. Infinite where there is no telling.
    pub worst: fn(&Stand<'_>) -> Result<f64>,
}

/// What a case came to.
#[derive(Debug, Clone, Serialize)]
pub struct Outcome {
    /// See [`Case::name`].
    pub case: &'static str,
    /// See [`Case::measure`].
    pub measure: &'static str,
    /// See [`Case::bound`].
    pub bound: f64,
    /// The worst value seen; infinite (`null` in JSON) where there is no telling.
    pub worst: f64,
    /// Whether the worst value is within the bound.
    pub passed: bool,
}

/// All cases, in the order in which they are run.
pub fn cases() -> impl Iterator<Item = &'static Case> {
    [geometry::CASES, feature::CASES, medium::CASES, invariance::CASES, input::CASES, repeat::CASES]
        .into_iter()
        .flatten()
}

impl Case {
    /// Runs the case.
    ///
    /// # Errors
    /// As [`Method::render`]; a value beyond the bound is no error.
    pub fn run(&self, stand: &Stand<'_>) -> Result<Outcome> {
        let worst = (self.worst)(stand)?;
        let Self { name: case, measure, bound, .. } = *self;
        Ok(Outcome { case, measure, bound, worst, passed: worst <= bound })
    }
}

impl Stand<'_> {
    /// One of two numbers, by extent.
    fn either<T>(&self, quick: T, full: T) -> T {
        match self.extent {
            Extent::Quick => quick,
            Extent::Full => full,
        }
    }

    /// The `shell` method with this scene.
    fn prepare(&self, scene: &Arc<Scene>) -> Result<Box<dyn Method>> {
        self.setup.interrupt.check()?;
        method::shell::open(&self.setup)?.prepare(scene.clone())
    }

    /// What the `shell` method makes of the scene's own view.
    fn frame(&self, scene: &Arc<Scene>) -> Result<Frame> {
        self.prepare(scene)?.render(&scene.view)
    }

    /// The worst [`excess`](compare::excess) of several views of a scene, walked and sorted.
    fn excess(&self, scene: &Arc<Scene>, views: &[View]) -> Result<f64> {
        let mut worst = 0.0f64;
        for traversal in [Traversal::Walk, Traversal::Sort] {
            let scene = Arc::new(Scene { traversal, ..(**scene).clone() });
            let mut method = self.prepare(&scene)?;
            for view in views {
                let image = method.render(view)?.image;
                worst = worst.max(compare::excess(&scene, view, &image));
            }
        }
        Ok(worst)
    }
}

/// The alpha of every pixel.
fn alpha(image: &Image) -> Vec<f64> {
    image.rgba.iter().map(|pixel| f64::from(pixel[3])).collect()
}
