//! `--max-error`: the march that is chosen keeps the error that was accepted, without wasting it.

mod common;

use std::path::Path;
use std::process::{Command, Output};
use std::sync::Arc;

use common::Watched;
use mesoshell::bench::pilot::{self, Trial};
use mesoshell::gpu::{DeviceChoice, Messages};
use mesoshell::method::{METHODS, Setup};
use mesoshell::metric;
use mesoshell::progress::{Interrupt, Progress, Silent};
use mesoshell::scene::{self, March, Scene};

fn load(name: &str, pixels: u32) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name).with_extension("toml");
    let size = format!("image.size=[{pixels}, {pixels}]");
    scene::load(&path, &[size], &Silent).unwrap_or_else(|error| panic!("{error:?}")).scene
}

/// Chooses for each of the errors in turn, with one cache, and returns what was chosen and the RMSE that it has at all pixels.
fn choose(name: &str, errors: &[f64]) -> Vec<(Trial, f64)> {
    let scene = load(name, 160);
    let reference = Watched::prepare("reference", &Arc::new(scene.clone())).render(&scene.view).image;
    let cache = tempfile::tempdir().unwrap();
    let messages = Messages::default();
    let progress: Arc<dyn Progress> = Arc::new(Silent);
    let setup = Setup {
        device: &DeviceChoice::Any,
        validation: Some(&messages),
        progress: &progress,
        interrupt: &Interrupt::default(),
    };
    let chosen = errors.iter().map(|&max_error| {
        let choose = || pilot::choose(&scene, max_error, &METHODS[0], Some(cache.path()), &setup).unwrap();
        let (first, again) = (choose(), choose());
        assert_eq!((first.trial, 0), (again.trial, again.measured), "what is known was measured again");
        let picture = |march| {
            let mut scene = scene.clone();
            first.apply(&mut scene);
            let scene = Arc::new(Scene { march, ..scene });
            Watched::prepare("shell", &scene).render(&scene.view).image
        };
        let rmse = |march| metric::compare(&picture(march), &reference).unwrap().rmse;
        // Half as many samples would not do, where there can be fewer.
        if let March::Default { step } = first.trial.march
            && step < 500.0
        {
            assert!(rmse(March::Default { step: 2.0 * step }) > max_error, "{name}: {first:?}");
        }
        (first.trial, rmse(first.trial.march))
    });
    let chosen = chosen.collect();
    assert!(messages.all().is_empty(), "{:?}", messages.all());
    chosen
}

/// Of the error accepted at least three tenths are used, and never more than all.
fn uses_what_is_accepted(name: &str) {
    let errors = [1e-2, 3e-3, 1e-3];
    for (max_error, (trial, rmse)) in errors.into_iter().zip(choose(name, &errors)) {
        println!("{name}: {max_error:.0e} accepted, {rmse:.2e} got, {trial:?}");
        assert!((0.3 * max_error..=max_error).contains(&rmse), "{name}: {max_error} accepted, {rmse} got");
        // Of 160 x 160 pixels a third is sampled: four standard errors are exceeded once in 16,000 times.
        let off = (trial.error.rmse - rmse).abs();
        assert!(off <= 4.0 * trial.error.standard_error, "{name}: {rmse}, {trial:?}");
    }
}

#[test]
fn fur_sphere() {
    uses_what_is_accepted("fur-sphere");
}

#[test]
fn fog_torus() {
    uses_what_is_accepted("fog-torus");
}

#[test]
fn weave_teapot() {
    uses_what_is_accepted("weave-teapot");
}

#[test]
fn rays_end_where_the_scene_says_unless_that_is_too_much() {
    let scene = load("fur-sphere", 32);
    let progress: Arc<dyn Progress> = Arc::new(Silent);
    let (device, interrupt) = (DeviceChoice::Any, Interrupt::default());
    let setup = Setup { device: &device, validation: None, progress: &progress, interrupt: &interrupt };
    let kept = |end_below, max_error| {
        let mut scene = Scene { end_below, ..scene.clone() };
        pilot::choose(&scene, max_error, &METHODS[0], None, &setup).unwrap().apply(&mut scene);
        scene.end_below
    };
    assert_eq!(kept(3e-3, 1e-2), 3e-3);
    assert_eq!(kept(4e-3, 1e-2), scene::END_BELOW);
    assert_eq!(kept(0.0, 1e-2), 0.0);
}

#[test]
fn a_very_small_error_takes_the_exact_plan() {
    let (trial, rmse) = choose("fur-sphere", &[1.5e-6])[0];
    assert_eq!(trial.march, March::Exact);
    assert!(rmse <= 1.5e-6, "{rmse}");
}

/// Renders the fog with those options in `folder`.
fn render(folder: &Path, options: &[&str]) -> Output {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/fog-torus.toml");
    let mut command = Command::new(env!("CARGO_BIN_EXE_mesoshell"));
    command.args(["render", "-o", "fog.png", "--size", "64x64", "--json"]).arg(scene).args(options);
    command.current_dir(folder).env("XDG_CACHE_HOME", folder.join("cache")).output().unwrap()
}

#[test]
fn the_command_line_tells_estimate_and_error() {
    let folder = tempfile::tempdir().unwrap();
    for is_known in [false, true] {
        let output = render(folder.path(), &["--max-error", "1e-3", "--verify"]);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        let accuracy = &json["accuracy"];
        let number = |value: &serde_json::Value| value.as_f64().unwrap_or_else(|| panic!("{json:#}"));
        assert_eq!(number(&accuracy["max_error"]), 1e-3);
        let (estimate, verified) = (number(&accuracy["estimate"]["rmse"]), number(&accuracy["verified"]));
        // All of so few pixels are sampled; the picture of the reference is rounded to f32.
        assert!((estimate - verified).abs() < 1e-7 && verified <= 1e-3, "{accuracy:#}");
        assert_eq!(accuracy["measured"] == 0, is_known, "{accuracy:#}");
    }
    for (asked, told) in [("3e-4", 3e-4), ("0.1", scene::END_BELOW)] {
        let end_below = format!("march.end_below={asked}");
        let output = render(folder.path(), &["--max-error", "1e-3", "-D", &end_below]);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(json["accuracy"]["end_below"].as_f64(), Some(told), "{json:#}");
    }
    // Nobody asked: nothing is said.
    let plain = render(folder.path(), &[]);
    assert!(plain.status.success() && !String::from_utf8_lossy(&plain.stdout).contains("accuracy"));
}

#[test]
fn what_cannot_be_chosen_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let mistakes: [(&[&str], &str); 6] = [
        (&["--max-error", "0"], "above 0"),
        (&["--max-error", "nan"], "above 0"),
        (&["--max-error", "1e-3", "--method", "reference"], "no march to choose"),
        (&["--max-error", "1e-3", "-D", "march.step=2"], "-D march.step=2"),
        (&["--verify"], "--max-error"),
        (&["--max-error", "1e-12"], "the best"),
    ];
    for (options, part) in mistakes {
        let output = render(folder.path(), options);
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{options:?}: {told}");
        assert!(told.contains(part), "{options:?}: {told}");
        assert!(!folder.path().join("fog.png").exists(), "{options:?}");
    }
}
