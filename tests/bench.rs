//! Benchmarks from sweep to report: what is written, what is reused, and how an interrupted one goes on.

mod common;

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::sync::Arc;

use common::keys;
use mesoshell::bench::{self, Options, Outcome, Results, Sweep};
use mesoshell::gpu::DeviceChoice;
use mesoshell::method::Setup;
use mesoshell::progress::{Interrupt, Progress, Silent};
use mesoshell::{Error, Result};
use serde_json::Value;
use tempfile::TempDir;

const SCENE: &str = "\
mesh = { generator = 'sphere', segments = 8, rings = 4 }
shell = { thickness = 0.2 }
volume = { recipe = 'fog.toml' }
";

const SWEEP: &str = "\
scenes = ['a.toml', 'b.toml']
size = [32, 32]
runs = 2

[plans]
default = [2, 1, 0.5]
paper = [1]
";

/// A folder with a sweep of two small scenes.
fn desk() -> TempDir {
    let desk = tempfile::tempdir().unwrap();
    let fog = "recipe = 'fog'\nsize = [8, 8, 4]\n";
    let files = [
        ("sweep.toml", SWEEP),
        ("a.toml", SCENE),
        ("b.toml", &SCENE.replace("0.2", "0.3")),
        ("fog.toml", fog),
    ];
    for (name, text) in files {
        fs::write(desk.path().join(name), text).unwrap();
    }
    desk
}

/// Runs the desk's sweep; results go to `out` there.
fn run(desk: &TempDir, resume: bool, progress: Arc<dyn Progress>, interrupt: &Interrupt) -> Result<Outcome> {
    let sweep = Sweep::load(&desk.path().join("sweep.toml"))?;
    let (out, cache) = (desk.path().join("out"), desk.path().join("cache"));
    let setup = Setup { device: &DeviceChoice::Any, validation: None, progress: &progress, interrupt };
    bench::run(&sweep, &Options { out: &out, cache: &cache, resume }, &setup)
}

fn run_silently(desk: &TempDir, resume: bool) -> Outcome {
    run(desk, resume, Arc::new(Silent), &Interrupt::default()).unwrap_or_else(|error| panic!("{error:?}"))
}

/// Interrupts the run when a stage of that name begins.
struct StopAt(&'static str, Interrupt);

impl Progress for StopAt {
    fn stage(&self, name: &str) {
        if name == self.0 {
            self.1.set();
        }
    }

    fn fraction(&self, done: f64) {
        assert!((0.0..=1.0).contains(&done), "{done}");
    }
}

fn interrupted_at(desk: &TempDir, resume: bool, stage: &'static str) {
    let interrupt = Interrupt::default();
    let error = run(desk, resume, Arc::new(StopAt(stage, interrupt.clone())), &interrupt).unwrap_err();
    assert!(matches!(error, Error::Interrupted), "{error}");
}

fn kept(desk: &TempDir) -> Results {
    Results::read(&desk.path().join("out/results.json")).unwrap()
}

/// The times of each point of each scene.
fn times(results: &Results) -> Vec<Vec<Vec<f64>>> {
    let points =
        |scene: &bench::SceneResults| scene.points.iter().map(|point| point.time.runs.clone()).collect();
    results.scenes.iter().map(points).collect()
}

#[test]
fn a_sweep_is_measured_written_and_documented() {
    let desk = desk();
    let Outcome { results, warnings, report } = run_silently(&desk, false);
    assert!(results.complete && warnings.is_empty(), "{warnings:?}");
    assert!(results == kept(&desk), "the file says something else");
    for scene in &results.scenes {
        assert_eq!((scene.width, scene.height, scene.points.len(), scene.rounds()), (32, 32, 4, 2));
        assert!(!scene.reference_reused && scene.reference_milliseconds > 0.0);
        // Finer is better, and something is on the front.
        assert!(scene.points[0].rmse() > scene.points[2].rmse() && scene.points[2].rmse() > 0.0);
        assert!(scene.points.iter().any(|point| point.pareto));
        let order = scene.curves[0].order.unwrap();
        assert!((0.5..=3.0).contains(&order), "order {order}");
        for point in &scene.points {
            let of_stages: f64 = point
                .stages
                .iter()
                .filter(|stage| !stage.name.contains('.'))
                .map(|stage| stage.time.runs[0])
                .sum();
            assert!(of_stages > 0.0 && of_stages <= point.time.runs[0], "{of_stages} of {:?}", point.time);
        }
    }

    let documentation =
        fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/bench.md")).unwrap();
    let json = serde_json::from_slice(&fs::read(desk.path().join("out/results.json")).unwrap()).unwrap();
    let mut found = BTreeSet::new();
    keys(&json, &mut found);
    assert!(found.len() > 40, "{found:?}");
    let csv = fs::read_to_string(desk.path().join("out/results.csv")).unwrap();
    let columns: Vec<&str> = csv.lines().next().unwrap().split(',').collect();
    assert_eq!(csv.lines().count(), 1 + 2 * 4);
    assert!(csv.lines().all(|line| line.split(',').count() == columns.len()), "{csv}");
    let points = results.scenes.iter().flat_map(|scene| &scene.points);
    let stages: Vec<String> =
        points.flat_map(|point| &point.stages).map(|stage| format!("{}_ms", stage.name)).collect();
    let columns = columns.iter().filter(|column| !stages.iter().any(|stage| stage == *column));
    for key in found.iter().map(String::as_str).chain(columns.copied()) {
        assert!(documentation.contains(&format!("`{key}`")), "`{key}` is not documented");
    }
    assert!(stages.iter().all(|stage| csv.contains(stage.as_str())));

    let page = fs::read_to_string(report).unwrap();
    assert_eq!(
        (page.matches("<svg class=\"plot\"").count(), page.matches("<img src=\"data:").count()),
        (2, 10)
    );
    assert!(!page.contains("<script") && !page.contains("http"));

    // The second run computes no reference, until the medium has changed.
    let again = run_silently(&desk, false).results;
    assert!(again.scenes.iter().all(|scene| scene.reference_reused));
    assert_eq!(again.scenes[1].points[0].error, results.scenes[1].points[0].error);
    let scene = SCENE.replace("recipe = 'fog.toml'", "recipe = 'fog.toml', opacity_distance = 0.1");
    fs::write(desk.path().join("b.toml"), scene).unwrap();
    let results = run_silently(&desk, false).results;
    let reused: Vec<bool> = results.scenes.iter().map(|scene| scene.reference_reused).collect();
    assert_eq!(reused, [true, false]);
}

#[test]
fn an_interrupted_sweep_goes_on() {
    let desk = desk();
    interrupted_at(&desk, false, "a: round 2 of 2");
    let first = kept(&desk);
    assert!(!first.complete);
    assert_eq!((first.scenes.len(), first.scenes[0].rounds()), (1, 1));

    interrupted_at(&desk, true, "b: round 1 of 2");
    let second = kept(&desk);
    assert_eq!((second.scenes.len(), second.scenes[0].rounds(), second.complete), (1, 2, false));

    let outcome = run_silently(&desk, true);
    assert!(outcome.results.complete && outcome.report.is_file());
    let whole = times(&outcome.results);
    assert!(whole.iter().flatten().all(|runs| runs.len() == 2));
    // What had been measured was not measured again.
    let first: Vec<Vec<f64>> = times(&first).concat();
    assert_eq!(first.len(), 4);
    assert!(whole[0].iter().zip(&first).all(|(whole, first)| whole[0] == first[0]));
    assert_eq!(whole, times(&run_silently(&desk, true).results));

    // A scene that has changed is measured anew, the other is kept.
    fs::write(desk.path().join("b.toml"), SCENE.replace("0.2", "0.35")).unwrap();
    let changed = run_silently(&desk, true);
    assert!(
        changed.warnings.len() == 1 && changed.warnings[0].contains("has changed"),
        "{:?}",
        changed.warnings
    );
    let changed = times(&changed.results);
    assert!(changed[0] == whole[0] && changed[1] != whole[1]);

    // Another sweep does not go on with these results.
    fs::write(desk.path().join("sweep.toml"), SWEEP.replace("runs = 2", "runs = 3")).unwrap();
    let error = run(&desk, true, Arc::new(Silent), &Interrupt::default()).unwrap_err();
    assert!(matches!(error, Error::Usage { .. }) && error.to_string().contains("another sweep"), "{error}");
}

#[test]
fn the_last_scene_is_checked_before_the_first_is_measured() {
    let desk = desk();
    fs::write(desk.path().join("b.toml"), SCENE.replace("0.2", "-0.2")).unwrap();
    let error = run(&desk, false, Arc::new(Silent), &Interrupt::default()).unwrap_err();
    assert!(matches!(error, Error::Text { .. }), "{error}");
    assert!(!desk.path().join("out").exists());
}

fn mesoshell(desk: &TempDir, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_mesoshell"));
    command.args(arguments).current_dir(desk.path()).env("NO_COLOR", "1").stdin(Stdio::null());
    command.output().unwrap()
}

#[test]
fn scenes_are_measured_from_the_command_line() {
    let desk = desk();
    let size = "image.size=[16, 16]";
    let output =
        mesoshell(&desk, &["bench", "a.toml", "--steps", "1,0.5", "--runs", "1", "-D", size, "--json"]);
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(0), "{errors}");
    assert!(errors.contains("a: round 1 of 1, about "), "{errors}");
    let value: Value = serde_json::from_slice(&output.stdout).unwrap();
    let points = value["scenes"][0]["points"].as_array().unwrap();
    assert_eq!(points.iter().map(|point| point["step"].as_f64().unwrap()).collect::<Vec<_>>(), [1.0, 0.5]);
    assert_eq!(value["scenes"][0]["width"], 16);
    for file in ["results.json", "results.csv", "report.html"] {
        assert!(desk.path().join("out/bench").join(file).is_file(), "{file}");
    }
}

#[test]
fn mistakes_are_told() {
    let desk = desk();
    fs::write(desk.path().join("bad.toml"), SWEEP.replace("runs", "rums")).unwrap();
    let mistakes: [(&[&str], i32, &str); 8] = [
        (&["bad.toml"], 3, "bad.toml:3:1"),
        (&["nowhere.toml"], 3, "nowhere.toml"),
        (&["sweep.toml", "a.toml"], 2, "stands alone"),
        (&["sweep.toml", "--steps", "1"], 2, "sweep file"),
        (&["a.toml", "--steps", "0"], 2, "0.001"),
        (&["a.toml", "--samples", "0"], 2, "4096"),
        (&["a.toml", "--runs", "0"], 2, "1..=1000"),
        (&["sweep.toml", "--resume"], 3, "leave out --resume"),
    ];
    for (arguments, code, part) in mistakes {
        let output = mesoshell(&desk, &[&["bench", "--quiet"], arguments].concat());
        let errors = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {errors}");
        assert!(errors.contains(part), "{arguments:?}: {errors}");
    }
}
