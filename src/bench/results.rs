//! What a sweep measured: the JSON file, which `docs/bench.md` describes key by key, and the statistics in it.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::environment::Environment;
use super::file::write_whole;
use super::sweep::{Setting, Sweep};
use super::{convergence, pareto};
use crate::fingerprint::Fingerprint;
use crate::frame::Stage;
use crate::metric::Metrics;
use crate::{Error, Result};

/// Of [`Results`]; another number means that keys have another meaning.
pub const SCHEMA: u32 = 1;

/// All that a sweep measured so far.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Results {
    /// [`SCHEMA`].
    pub schema: u32,
    /// Whether the sweep was measured to its end.
    pub complete: bool,
    /// What was asked for.
    pub sweep: Sweep,
    /// Of the sweep: results go on where it is the same.
    pub fingerprint: Fingerprint,
    /// On what it was measured.
    pub environment: Environment,
    /// In the sweep's order; those not reached yet are left out.
    pub scenes: Vec<SceneResults>,
}

/// What was measured of one scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SceneResults {
    /// The scene file.
    pub scene: PathBuf,
    /// In pixels.
    pub width: u32,
    /// In pixels.
    pub height: u32,
    /// Of the shell.
    pub tetrahedra: u64,
    /// Of the reference's picture: results go on where it is the same.
    pub fingerprint: Fingerprint,
    /// What the reference took to compute, in milliseconds.
    pub reference_milliseconds: f64,
    /// Whether the reference came from the cache.
    pub reference_reused: bool,
    /// Samples of the paper's plan, if that was measured with as many as the scene says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub own_samples: Option<u32>,
    /// One for each method and plan.
    pub curves: Vec<Curve>,
    /// In the order of the sweep's settings; that with the scene's own samples comes last.
    pub points: Vec<Point>,
}

/// The points of one method and plan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Curve {
    /// The method's name.
    pub method: String,
    /// The plan's name.
    pub plan: String,
    /// See [`convergence::order`].
    pub order: Option<f64>,
    /// The points that [`order`](Self::order) is fitted on.
    pub order_points: usize,
}

/// One method at one level of quality.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// What was measured.
    #[serde(flatten)]
    pub setting: Setting,
    /// Wall time of a whole frame, readback included.
    pub time: Timing,
    /// The parts of the frame's report, in their order; a dot makes a part of the stage before it.
    pub stages: Vec<StageTiming>,
    /// Every number of [`Metrics`] by its name; `None` is one that is not finite.
    pub error: BTreeMap<String, Option<f64>>,
    /// Whether no other point of the scene is as fast and as accurate: see [`pareto::front`].
    pub pareto: bool,
}

/// Times of the runs, in milliseconds.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Timing {
    /// The middle run, or the mean of the two in the middle; 0 without any run.
    pub median: f64,
    /// The run that 95 % of the runs do not exceed (nearest rank: of less than 20 runs the slowest).
    pub p95: f64,
    /// As they were measured, the warm-up left out.
    pub runs: Vec<f64>,
}

/// [`Timing`] of a stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StageTiming {
    /// As [`Stage::name`].
    pub name: String,
    /// Of the runs that had the stage.
    #[serde(flatten)]
    pub time: Timing,
}

impl Timing {
    /// Adds a run.
    pub fn push(&mut self, milliseconds: f64) {
        self.runs.push(milliseconds);
        let mut sorted = self.runs.clone();
        sorted.sort_by(f64::total_cmp);
        let count = sorted.len();
        self.median = 0.5 * (sorted[(count - 1) / 2] + sorted[count / 2]);
        self.p95 = sorted[(95 * count).div_ceil(100) - 1];
    }
}

/// Adds a run's stages to those of the runs before.
pub(super) fn add_stages(timings: &mut Vec<StageTiming>, stages: &[Stage]) {
    for Stage { name, milliseconds } in stages {
        if !timings.iter().any(|timing| timing.name == *name) {
            timings.push(StageTiming { name: name.clone(), time: Timing::default() });
        }
        let timing = timings.iter_mut().find(|timing| timing.name == *name).expect("just added");
        timing.time.push(*milliseconds);
    }
}

impl Point {
    /// A point without a run yet.
    pub fn new(setting: Setting, metrics: &Metrics) -> Self {
        let json = serde_json::to_value(metrics).expect("numbers");
        let numbers = json.as_object().expect("a struct").iter();
        let error = numbers.map(|(name, value)| (name.clone(), value.as_f64())).collect();
        Self { setting, time: Timing::default(), stages: Vec::new(), error, pareto: false }
    }

    /// Adds a run: the wall time of the frame, and the stages of its report.
    pub fn push(&mut self, milliseconds: f64, stages: &[Stage]) {
        self.time.push(milliseconds);
        add_stages(&mut self.stages, stages);
    }

    /// A number of [`error`](Self::error); infinite where it is not finite.
    pub fn error(&self, name: &str) -> f64 {
        self.error.get(name).copied().flatten().unwrap_or(f64::INFINITY)
    }

    /// The error that points are compared by.
    pub fn rmse(&self) -> f64 {
        self.error("rmse")
    }
}

impl SceneResults {
    /// The scene's name for people: its file's, without the extension.
    pub fn name(&self) -> String {
        self.scene.file_stem().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// Rounds that are done: every point has as many runs.
    pub fn rounds(&self) -> usize {
        self.points.iter().map(|point| point.time.runs.len()).min().unwrap_or(0)
    }

    /// The points of least and of largest error.
    pub fn best_and_worst(&self) -> [usize; 2] {
        let by_error = |&a: &usize, &b: &usize| self.points[a].rmse().total_cmp(&self.points[b].rmse());
        let indices = || 0..self.points.len();
        [indices().min_by(by_error).unwrap_or(0), indices().max_by(by_error).unwrap_or(0)]
    }

    /// The points of a curve.
    pub fn points_of(&self, curve: &Curve) -> impl Iterator<Item = &Point> {
        let (method, plan) = (curve.method.clone(), curve.plan.clone());
        self.points.iter().filter(move |point| point.setting.method == method && point.setting.plan() == plan)
    }

    /// Finds front and orders anew, after the points have changed.
    pub fn conclude(&mut self) {
        let points: Vec<_> = self.points.iter().map(|point| [point.time.median, point.rmse()]).collect();
        for (point, on_front) in self.points.iter_mut().zip(pareto::front(&points)) {
            point.pareto = on_front;
        }
        self.curves.clear();
        for (index, Point { setting, .. }) in self.points.iter().enumerate() {
            if self.points[..index].iter().any(|point| point.setting.shares_curve(setting)) {
                continue;
            }
            let curve = self.points.iter().filter(|point| point.setting.shares_curve(setting));
            let curve: Vec<_> = curve.map(|point| [point.setting.spacing(), point.rmse()]).collect();
            let (order, order_points) = convergence::order(&curve).unzip();
            self.curves.push(Curve {
                method: setting.method.clone(),
                plan: setting.plan().to_owned(),
                order,
                order_points: order_points.unwrap_or(0),
            });
        }
    }
}

impl Results {
    /// Nothing measured yet.
    pub fn new(sweep: Sweep, environment: Environment) -> Self {
        let fingerprint = sweep.fingerprint();
        Self { schema: SCHEMA, complete: false, sweep, fingerprint, environment, scenes: Vec::new() }
    }

    /// Reads what [`write`](Self::write) wrote.
    ///
    /// # Errors
    /// [`Error::Input`].
    pub fn read(path: &Path) -> Result<Self> {
        let help = "leave out --resume to measure from the beginning";
        let file = File::open(path)
            .map_err(|error| Error::input(path, format!("cannot be read: {error}")).with_help(help))?;
        let results: Self = serde_json::from_reader(BufReader::new(file)).map_err(|error| {
            Error::input(path, format!("is not what a benchmark wrote: {error}")).with_help(help)
        })?;
        if results.schema != SCHEMA {
            let message = format!("has schema {}, and this program knows {SCHEMA}", results.schema);
            return Err(Error::input(path, message).with_help(help));
        }
        Ok(results)
    }

    /// Writes the JSON file, whole or not at all.
    ///
    /// # Errors
    /// [`Error::Output`].
    pub fn write(&self, path: &Path) -> Result<()> {
        write_whole(path, |file| Ok(serde_json::to_writer_pretty(file, self)?))
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::scene::March;

    fn metrics(rmse: f64) -> Metrics {
        let mut metrics =
            crate::metric::compare(&crate::frame::Image::new(2, 2), &crate::frame::Image::new(2, 2)).unwrap();
        metrics.rmse = rmse;
        metrics
    }

    /// Three steps of an error of order 2, each twice as slow as the one before, and a useless point.
    pub(crate) fn results() -> Results {
        let sweep =
            "scenes = ['scenes/fog & fur.toml']\nruns = 2\n[plans]\ndefault = [1, 0.5, 0.25]\npaper = [1]";
        let sweep = Sweep::parse("sweep.toml", sweep.to_owned(), Path::new("")).unwrap();
        let points = sweep.settings.iter().zip([(10.0, 1e-2), (20.0, 2.5e-3), (40.0, 6.25e-4), (30.0, 0.1)]);
        let points = points.map(|(setting, (time, rmse))| {
            let mut point = Point::new(setting.clone(), &metrics(rmse));
            for time in [time, time + 1.0] {
                let stage = |name: &str, milliseconds| Stage { name: name.to_owned(), milliseconds };
                point.push(
                    time,
                    &[stage("order", 2.0), stage("order.search", 1.0), stage("march", time - 2.0)],
                );
            }
            point
        });
        let mut scene = SceneResults {
            scene: sweep.scenes[0].clone(),
            width: 2,
            height: 2,
            tetrahedra: 12,
            fingerprint: Fingerprint::builder("test").finish(),
            reference_milliseconds: 1234.0,
            reference_reused: true,
            own_samples: None,
            curves: Vec::new(),
            points: points.collect(),
        };
        scene.conclude();
        let environment = Environment {
            date: "2000-01-01T00:00:00Z".to_owned(),
            version: "0.0.0".to_owned(),
            commit: None,
            device: "a <device>".to_owned(),
            driver: "a driver".to_owned(),
            vulkan: "1.3".to_owned(),
            processor: None,
            cores: 2,
            os: "an OS".to_owned(),
        };
        Results { complete: true, scenes: vec![scene], ..Results::new(sweep, environment) }
    }

    #[test]
    fn statistics_are_those_of_the_runs() {
        let mut timing = Timing::default();
        for milliseconds in [5.0, 1.0, 9.0] {
            timing.push(milliseconds);
        }
        assert_eq!(
            (timing.median, timing.p95, timing.runs.as_slice()),
            (5.0, 9.0, [5.0, 1.0, 9.0].as_slice())
        );
        timing.push(7.0);
        assert_eq!(timing.median, 6.0);
        let mut many = Timing::default();
        for milliseconds in (1..=40).rev() {
            many.push(f64::from(milliseconds));
        }
        assert_eq!((many.median, many.p95), (20.5, 38.0));
    }

    #[test]
    fn front_and_orders_are_found() {
        let results = results();
        let scene = &results.scenes[0];
        assert_eq!(
            scene.points.iter().map(|point| point.pareto).collect::<Vec<_>>(),
            [true, true, true, false]
        );
        assert_eq!(scene.best_and_worst(), [2, 3]);
        let [default, paper] = scene.curves.as_slice() else { panic!("{:?}", scene.curves) };
        assert!((default.order.unwrap() - 2.0).abs() < 1e-12 && default.order_points == 3);
        assert_eq!((paper.plan.as_str(), paper.order, paper.order_points), ("paper", None, 0));
        assert_eq!((scene.points_of(default).count(), scene.points_of(paper).count()), (3, 1));
    }

    #[test]
    fn every_metric_is_there() {
        let point = &results().scenes[0].points[0];
        let json = serde_json::to_value(metrics(0.1)).unwrap();
        assert!(point.error.keys().eq(json.as_object().unwrap().keys()));
        // Equal images have an infinite PSNR, for which JSON has no number.
        assert_eq!((point.error["rmse"], point.error["psnr"]), (Some(1e-2), None));
        assert_eq!(point.error("psnr"), f64::INFINITY);
        assert_eq!(point.setting.march, March::Default { step: 1.0 });
    }

    #[test]
    fn a_file_comes_back_as_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new/results.json");
        let results = results();
        results.write(&path).unwrap();
        assert_eq!(Results::read(&path).unwrap(), results);
        let text = std::fs::read_to_string(&path).unwrap();
        for (from, to, part) in [
            ("\"schema\": 1", "\"schema\": 2", "schema 2"),
            ("{", "[", "not what"),
            ("\"points\"", "\"ponits\"", "points"),
        ] {
            assert!(text.contains(from));
            std::fs::write(&path, text.replacen(from, to, 1)).unwrap();
            let error = Results::read(&path).unwrap_err();
            assert!(matches!(error, Error::Input { .. }) && error.to_string().contains(part), "{error}");
        }
    }
}
