//! Measurements: run time against error.

use std::sync::Arc;

use serde::Serialize;

use crate::Result;
use crate::frame::{Frame, Image};
use crate::method::{self, Setup};
use crate::metric::{self, Metrics};
use crate::scene::{March, Scene};

/// The `default` plan at one step, against the reference.
#[derive(Debug, Clone, Serialize)]
pub struct StepPoint {
    /// Texels a sample: see [`March::Default`].
    pub step: f64,
    /// Time of the frame by its report, all stages, in milliseconds: median of the runs.
    pub milliseconds: f64,
    /// Error of linear premultiplied RGBA.
    #[serde(flatten)]
    pub metrics: Metrics,
}

/// The reference's picture of the scene's own view.
///
/// # Errors
/// [`Error::Interrupted`](crate::Error::Interrupted).
pub fn reference(scene: &Arc<Scene>, setup: &Setup<'_>) -> Result<Image> {
    Ok(render(scene, "reference", setup, 1)?.0.image)
}

/// Renders the scene with the `shell` method at each step, `runs` times after one that does not count, and
/// compares with `reference`.
///
/// # Errors
/// As [`Method::render`](method::Method::render).
pub fn steps(
    scene: &Arc<Scene>,
    reference: &Image,
    steps: &[f64],
    runs: usize,
    setup: &Setup<'_>,
) -> Result<Vec<StepPoint>> {
    steps
        .iter()
        .map(|&step| {
            let scene = Arc::new(Scene { march: March::Default { step }, ..Scene::clone(scene) });
            let (frame, milliseconds) = render(&scene, "shell", setup, runs)?;
            Ok(StepPoint { step, milliseconds, metrics: metric::compare(&frame.image, reference)? })
        })
        .collect()
}

/// The last of the frames, and the median of their times; with more than one run, the first of all is warm-up.
fn render(scene: &Arc<Scene>, name: &str, setup: &Setup<'_>, runs: usize) -> Result<(Frame, f64)> {
    let entry = method::by_name(name).expect("a name of the table");
    let mut method = entry.prepare(scene.clone(), setup)?;
    let mut frame = method.render(&scene.view)?;
    let mut times = Vec::new();
    for _ in 0..runs {
        if runs > 1 {
            frame = method.render(&scene.view)?;
        }
        let whole = frame.report.stages.iter().filter(|stage| !stage.name.contains('.'));
        times.push(whole.map(|stage| stage.milliseconds).sum::<f64>());
    }
    times.sort_by(f64::total_cmp);
    Ok((frame, times[times.len() / 2]))
}
