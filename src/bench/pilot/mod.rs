//! The pilot: from the error that a user accepts to the coarsest march that meets it.
//!
//! [`choose`] renders the view at one march after another and compares each picture with the f64 reference at a random
//! [`Sample`] of its pixels, until [`search`] has found the march. What the trials showed is kept under the fingerprint of all
//! that it depends on, so that the same view is not measured twice.

mod sample;
pub mod search;
mod trials;

use std::path::Path;
use std::sync::Arc;

pub use sample::{Estimate, Sample};
use search::Next;
use serde::{Deserialize, Serialize};
use trials::Trials;

use crate::fingerprint::Fingerprint;
use crate::gpu::{Gpu, shaders};
use crate::method::{Entry, Setup};
use crate::progress::{Progress, Silent};
use crate::reference::Reference;
use crate::scene::{END_BELOW, March, Scene};
use crate::{Error, Result};

/// What feeds the shaders.
const METHOD_CODE: [&str; 8] = [
    include_str!("../../method/shell/constants.rs"),
    include_str!("../../method/shell/lit.rs"),
    include_str!("../../method/shell/mod.rs"),
    include_str!("../../method/shell/outline.rs"),
    include_str!("../../method/shell/plan.rs"),
    include_str!("../../method/shell/seen.rs"),
    include_str!("../../method/shell/volume.rs"),
    include_str!("../../volume/proximity.rs"),
];

/// A march, and how far from the reference it was found to be.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Trial {
    /// What was tried.
    pub march: March,
    /// Its error.
    pub error: Estimate,
}

/// What was chosen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Choice {
    /// The coarsest march that meets the error, and its own.
    pub trial: Trial,
    /// How many marches were measured for it now; the others were known.
    pub measured: usize,
    /// The scene's [`Scene::end_below`], or the default where that alone might take too much of the error.
    pub end_below: f64,
}

impl Choice {
    /// The scene as it is to be rendered.
    pub fn apply(&self, scene: &mut Scene) {
        (scene.march, scene.end_below) = (self.trial.march, self.end_below);
    }
}

/// A scene's `end_below` is not kept where so many times that is above the error accepted. One that followed from the error would
/// make trials for one error worthless for another.
const LEAST_BELOW: f64 = 3.0;

/// The coarsest march by which `method` renders the scene's own view with an RMSE (linear premultiplied RGBA, all pixels) of at
/// most `max_error`; `scene.march` is not read, and `scene.end_below` is the default where it is above a third of that. Known trials
/// are taken from `cache`, a folder, and kept there.
///
/// # Errors
/// [`Error::Usage`] where no march meets the error; as [`Method::render`](crate::method::Method::render); [`Error::Output`]
/// where trials cannot be kept.
pub fn choose(
    scene: &Scene,
    max_error: f64,
    method: &Entry,
    cache: Option<&Path>,
    setup: &Setup<'_>,
) -> Result<Choice> {
    let is_kept = LEAST_BELOW * scene.end_below <= max_error;
    let end_below = if is_kept { scene.end_below } else { scene.end_below.min(END_BELOW) };
    let scene = &Scene { end_below, ..scene.clone() };
    let mut trials = Trials::load(cache, fingerprint(scene, method, setup)?);
    let mut sample: Option<Sample> = None;
    let mut measured = 0;
    loop {
        match search::next(trials.all(), max_error) {
            Next::Done(trial) => return Ok(Choice { trial, measured, end_below }),
            Next::Impossible(best) => {
                return Err(Error::Usage {
                    message: format!(
                        "no march meets an error of {max_error:e}: the best, {}, has one of {:.1e}",
                        best.march, best.error.rmse
                    ),
                    // A tenth more than written with two digits is never too little.
                    help: Some(format!("accept {:.1e} or more", 1.1 * best.error.upper())),
                });
            }
            Next::Try(march) => {
                setup.interrupt.check()?;
                let sample = match &mut sample {
                    Some(sample) => sample,
                    none => {
                        setup.progress.stage("pilot: integrating some pixels");
                        let reference = Reference::new(scene, &scene.view);
                        none.insert(Sample::draw(
                            &reference,
                            &scene.view,
                            setup.progress.as_ref(),
                            setup.interrupt,
                        )?)
                    }
                };
                setup.progress.stage(&format!("pilot: trying {march}"));
                let silent: Arc<dyn Progress> = Arc::new(Silent);
                let tried = Arc::new(Scene { march, ..scene.clone() });
                let mut method = method.prepare(tried, &Setup { progress: &silent, ..*setup })?;
                let frame = method.render(&scene.view)?;
                trials.add(Trial { march, error: sample.estimate(&frame.image) })?;
                measured += 1;
            }
        }
    }
}

/// Of all that a trial's error depends on but the march: the picture, the method, its shaders and the device.
fn fingerprint(scene: &Scene, method: &Entry, setup: &Setup<'_>) -> Result<Fingerprint> {
    let device = Gpu::open(setup.device, setup.validation)?.info().clone();
    let of_reference = Fingerprint::of_reference(scene, &scene.view, 1).to_string();
    let mut builder = Fingerprint::builder("pilot");
    let ways = format!("{:?} {} {:?}", scene.traversal, scene.end_below, scene.skips);
    for text in [&of_reference, method.name, &device.name, &device.driver, &ways] {
        builder = builder.bytes(text.as_bytes());
    }
    for shader in shaders::ALL.iter().flat_map(|family| family.all()) {
        builder = builder.numbers(shader.words());
    }
    for code in METHOD_CODE {
        builder = builder.bytes(code.as_bytes());
    }
    Ok(builder.finish())
}
