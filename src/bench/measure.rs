//! One scene measured: a warm-up of every point, the reference, then rounds. In a round every point is timed once, so
//! that a machine that drifts hurts all points alike.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use super::cache;
use super::remaining::Remaining;
use super::results::{Point, SceneResults};
use super::sweep::Setting;
use crate::fingerprint::Fingerprint;
use crate::frame::{Backdrop, Frame, Image};
use crate::method::{self, Method, Setup};
use crate::progress::{Progress, Silent};
use crate::scene::Scene;
use crate::{Error, Result, metric};

/// A scene to be measured.
pub struct Subject<'a> {
    /// The scene file, for its name.
    pub path: &'a Path,
    /// The scene.
    pub scene: &'a Scene,
    /// On which its picture is laid.
    pub backdrop: &'a Backdrop,
    /// The points.
    pub settings: &'a [Setting],
    /// Of the paper's plan, if that is measured with as many as the scene says.
    pub own_samples: Option<u32>,
    /// Errors are those of one pixel of every square of so many by so many.
    pub error_every: u32,
    /// Timed frames of each point.
    pub runs: usize,
    /// The references' folder.
    pub cache: &'a Path,
}

/// The pictures of a scene that a report shows.
#[derive(Debug, Clone)]
pub struct Pictures {
    /// By the reference.
    pub reference: Image,
    /// By the points of least and of largest error: see [`SceneResults::best_and_worst`].
    pub best_and_worst: [Image; 2],
    /// On which they are laid.
    pub backdrop: Backdrop,
}

/// A prepared point.
struct Contender {
    method: Box<dyn Method>,
    warm_up: Frame,
    /// Of the warm-up.
    milliseconds: f64,
}

/// Measures a scene, or goes on with `earlier` results of it where they are of the same picture. `keep` is called with
/// the results after each round.
///
/// # Errors
/// As [`Method::render`] and [`cache::reference`]; whatever `keep` fails with.
pub fn measure(
    subject: &Subject<'_>,
    earlier: Option<SceneResults>,
    setup: &Setup<'_>,
    remaining: &Remaining<'_>,
    warnings: &mut Vec<String>,
    keep: &mut dyn FnMut(&SceneResults) -> Result<()>,
) -> Result<(SceneResults, Pictures)> {
    let scene = subject.scene;
    if scene.view.width.min(scene.view.height) < subject.error_every {
        return Err(Error::Usage {
            message: format!(
                "{}: a picture of {} x {} pixels has no square of {} pixels a side",
                subject.path.display(),
                scene.view.width,
                scene.view.height,
                subject.error_every
            ),
            help: Some("make size larger, or error_every smaller".to_owned()),
        });
    }
    let name = subject.path.file_stem().unwrap_or_default().to_string_lossy();
    let fingerprint = Fingerprint::of_reference(scene, &scene.view, subject.error_every);
    let earlier = earlier.filter(|earlier| {
        let same = earlier.fingerprint == fingerprint && earlier.own_samples == subject.own_samples;
        if !same {
            warnings
                .push(format!("{} has changed: it is measured from the beginning", subject.path.display()));
        }
        same
    });

    // What is complete needs no more than its two pictures.
    let complete = earlier.as_ref().filter(|earlier| earlier.rounds() >= subject.runs);
    let wanted: Vec<usize> = match complete {
        Some(complete) => complete.best_and_worst().to_vec(),
        None => (0..subject.settings.len()).collect(),
    };
    let rounds_left = subject.runs - earlier.as_ref().map_or(0, |earlier| earlier.rounds().min(subject.runs));

    remaining.stage(&format!("{name}: warming up"));
    let mut contenders = Vec::new();
    for &index in &wanted {
        let contender = Contender::prepare(scene, &subject.settings[index], setup)?;
        for warning in &contender.warm_up.report.warnings {
            let warning = format!("{}: {warning}", subject.path.display());
            if !warnings.contains(&warning) {
                warnings.push(warning);
            }
        }
        contenders.push(contender);
    }
    let seconds_a_round = 1e-3 * contenders.iter().map(|contender| contender.milliseconds).sum::<f64>();
    let seconds_of_rounds = seconds_a_round * rounds_left as f64;

    let progress = remaining.reference(&name, seconds_of_rounds);
    let reference = cache::reference(
        scene,
        subject.error_every,
        &fingerprint,
        subject.cache,
        warnings,
        &progress,
        setup.interrupt,
    )?;

    let mut results = match earlier {
        Some(earlier) => earlier,
        None => SceneResults {
            scene: subject.path.to_owned(),
            width: scene.view.width,
            height: scene.view.height,
            tetrahedra: scene.shell.topology.tetrahedra.len() as u64,
            fingerprint,
            reference_milliseconds: reference.milliseconds,
            reference_reused: reference.reused,
            own_samples: subject.own_samples,
            curves: Vec::new(),
            points: points(subject, &contenders, &reference.image)?,
        },
    };

    let mut frames = 0..rounds_left * contenders.len();
    for round in subject.runs - rounds_left..subject.runs {
        remaining.stage(&format!("{name}: round {} of {}", round + 1, subject.runs));
        for (contender, point) in contenders.iter_mut().zip(&mut results.points) {
            contender.method.forget();
            let start = Instant::now();
            let frame = contender.method.render(&scene.view)?;
            point.push(1e3 * start.elapsed().as_secs_f64(), &frame.report.stages);
            frames.next();
            remaining.scene_left(seconds_a_round * frames.len() as f64 / wanted.len() as f64);
        }
        results.conclude();
        keep(&results)?;
    }

    let pictures = results.best_and_worst().map(|index| {
        let position = wanted.iter().position(|&wanted| wanted == index).expect("warmed up above");
        contenders[position].warm_up.image.thinned(subject.error_every)
    });
    let backdrop = subject.backdrop.clone();
    Ok((results, Pictures { reference: reference.image, best_and_worst: pictures, backdrop }))
}

impl Contender {
    /// Prepares the method, and renders the frame that does not count: in it pipelines are compiled and buffers made.
    fn prepare(scene: &Scene, setting: &Setting, setup: &Setup<'_>) -> Result<Self> {
        let scene = Arc::new(Scene { march: setting.march, ..scene.clone() });
        let entry = method::by_name(&setting.method).expect("checked when the sweep was read");
        let silent: Arc<dyn Progress> = Arc::new(Silent);
        let mut method = entry.prepare(scene.clone(), &Setup { progress: &silent, ..*setup })?;
        let start = Instant::now();
        let warm_up = method.render(&scene.view)?;
        Ok(Self { method, warm_up, milliseconds: 1e3 * start.elapsed().as_secs_f64() })
    }
}

/// Points without a run. The picture is the same in every run, so that of the warm-up stands for all.
fn points(subject: &Subject<'_>, contenders: &[Contender], reference: &Image) -> Result<Vec<Point>> {
    let background = subject.backdrop.flat_colour();
    let point = |(setting, contender): (&Setting, &Contender)| {
        let metrics = metric::compare_over(
            &contender.warm_up.image.thinned(subject.error_every),
            reference,
            background,
        )?
        .metrics;
        Ok(Point::new(setting.clone(), &metrics))
    };
    subject.settings.iter().zip(contenders).map(point).collect()
}
