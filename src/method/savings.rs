//! What leaving things out saves: measured, by drawing the scene with and without.

use std::sync::Arc;
use std::time::Instant;

use serde::Serialize;

use super::{Choice, Entry, Setup};
use crate::progress::{Progress, Silent};
use crate::scene::{Scene, Skip, Skips};
use crate::{Error, Result, metric};

/// Frames that are timed of each, after a first one that is not: the fastest counts.
const FRAMES: usize = 3;

/// What one thing that was left out has saved.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Saving {
    /// What was left out.
    pub skip: Skip,
    /// The time of a frame that leaves it out, from an eye that stays where it was, in milliseconds.
    pub with: f64,
    /// The same frame with nothing but this not left out.
    pub without: f64,
    /// How far apart, in milliseconds, frames were that are alike, of all that was measured: less than this is not known to be a saving.
    pub noise: f64,
    /// The largest difference of a channel, linear premultiplied, between the two.
    pub difference: f64,
}

/// Draws the scene's own view with everything left out that `scene.skips` allows, and again without each of those that `plan` says are
/// on, a few times each.
///
/// # Errors
/// As [`Method::render`](super::Method::render).
pub fn savings(entry: &Entry, plan: &[Choice], scene: &Scene, setup: &Setup<'_>) -> Result<Vec<Saving>> {
    let is_on = |skip: &Skip| plan.iter().any(|choice| choice.about == skip.name() && choice.chosen == "on");
    let on: Vec<Skip> = Skip::ALL.into_iter().filter(is_on).collect();
    if on.is_empty() {
        return Ok(Vec::new());
    }
    let silent: Arc<dyn Progress> = Arc::new(Silent);
    let setup_of_frames = Setup { progress: &silent, ..*setup };
    let draw = |skips: Skips| {
        let scene = Arc::new(Scene { skips, ..scene.clone() });
        let mut method = entry.prepare(scene.clone(), &setup_of_frames)?;
        let mut frame = method.render(&scene.view)?;
        let (mut fastest, mut slowest) = (f64::INFINITY, 0.0_f64);
        for _ in 0..FRAMES {
            let start = Instant::now();
            frame = method.render(&scene.view)?;
            let milliseconds = 1e3 * start.elapsed().as_secs_f64();
            (fastest, slowest) = (fastest.min(milliseconds), slowest.max(milliseconds));
        }
        Ok::<_, Error>((frame, fastest, slowest - fastest))
    };
    setup.progress.stage("measuring what was saved");
    let (frame, with, mut noise) = draw(scene.skips)?;
    let mut savings = Vec::new();
    for (index, &skip) in on.iter().enumerate() {
        setup.progress.fraction((index + 1) as f64 / (on.len() + 1) as f64);
        setup.interrupt.check()?;
        let off: Vec<Skip> =
            Skip::ALL.into_iter().filter(|&other| other == skip || !scene.skips.allow(other)).collect();
        let (other, without, apart) = draw(Skips::without(&off))?;
        noise = noise.max(apart);
        let difference = metric::compare(&frame.image, &other.image)?.max;
        savings.push(Saving { skip, with, without, noise: 0.0, difference });
    }
    Ok(savings.into_iter().map(|saving| Saving { noise, ..saving }).collect())
}
