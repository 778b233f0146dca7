//! A whole sweep, scene by scene, kept on disk after each round.

use std::path::{Path, PathBuf};

use super::environment::Environment;
use super::file::{check_writable, remove, write_whole};
use super::measure::{Subject, measure};
use super::remaining::Remaining;
use super::report::{csv, html};
use super::results::{Results, SceneResults};
use super::sweep::{Sweep, overrides};
use crate::gpu::Gpu;
use crate::method::{Entry, METHODS, Opened, Setup};
use crate::progress::Silent;
use crate::scene::{self, Sizes};
use crate::{Error, Result};

/// Where results go.
#[derive(Debug, Clone, Copy)]
pub struct Options<'a> {
    /// The folder of `results.json`, `results.csv` and `report.html`.
    pub out: &'a Path,
    /// The folder of the references' pictures.
    pub cache: &'a Path,
    /// Whether to go on with the `results.json` that is there.
    pub resume: bool,
}

/// What a sweep ended with.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// What was measured; `results.json` holds the same.
    pub results: Results,
    /// What the user should know, each a sentence.
    pub warnings: Vec<String>,
    /// The report in HTML.
    pub report: PathBuf,
}

/// Measures a sweep and writes its results.
///
/// `results.json` is written after each round of each scene: it keeps what was measured before an error or an interrupt.
///
/// # Errors
/// Whatever stands between a scene and its picture; [`Error::Usage`] where the results to resume are of another sweep or
/// device; [`Error::Output`].
pub fn run(sweep: &Sweep, options: &Options<'_>, setup: &Setup<'_>) -> Result<Outcome> {
    let json = options.out.join("results.json");
    let device = Gpu::open(setup.device, setup.validation)?.info().clone();
    let fresh = Results::new(sweep.clone(), Environment::here(&device));
    let mut results = match options.resume {
        true => resumed(&json, &fresh)?,
        false => fresh,
    };
    let overrides = overrides(sweep.size, &sweep.define);
    // What keeps a scene from being drawn, or results from being written, is told before anything is measured.
    setup.progress.stage("opening the device");
    let opened = opened(sweep, setup)?;
    for path in &sweep.scenes {
        setup.progress.stage(&format!("checking {}", path.display()));
        setup.interrupt.check()?;
        let admit = |sizes: &Sizes| opened.iter().try_for_each(|method| method.admit(sizes));
        scene::load_if(path, &overrides, &Silent, &admit)?;
    }
    drop(opened);
    // An earlier run's results stay until there are others.
    check_writable(&json)?;
    let [table, report] = ["results.csv", "report.html"].map(|name| options.out.join(name));

    let mut earlier = std::mem::take(&mut results.scenes).into_iter();
    results.complete = false;

    let mut warnings = Vec::new();
    let mut pictures = Vec::new();
    let remaining = Remaining::new(setup.progress.as_ref(), sweep.scenes.len());
    for path in &sweep.scenes {
        remaining.next_scene();
        remaining.stage(&format!("loading {}", path.display()));
        setup.interrupt.check()?;
        let loaded = scene::load(path, &overrides, &Silent)?;
        let subject = Subject {
            path,
            scene: &loaded.scene,
            backdrop: &loaded.backdrop,
            settings: &sweep.settings_of(loaded.samples),
            own_samples: sweep.paper_of_scene.then_some(loaded.samples),
            error_every: sweep.error_every,
            runs: sweep.runs as usize,
            cache: options.cache,
        };
        let finished = results.scenes.len();
        let begun = earlier.next();
        let mut keep = |scene: &SceneResults| {
            results.scenes.truncate(finished);
            results.scenes.push(scene.clone());
            results.scenes.extend(earlier.clone());
            // They would tell of another run.
            remove(&table)?;
            remove(&report)?;
            results.write(&json)
        };
        let (scene, of_scene) = measure(&subject, begun, setup, &remaining, &mut warnings, &mut keep)?;
        results.scenes.truncate(finished);
        results.scenes.push(scene);
        pictures.push(of_scene);
    }
    results.complete = true;

    results.write(&json)?;
    let lines = csv::table(&results);
    write_whole(&table, |file| std::io::Write::write_all(file, lines.as_bytes()))?;
    let page = html::page(&results, &pictures);
    write_whole(&report, |file| std::io::Write::write_all(file, page.as_bytes()))?;
    Ok(Outcome { results, warnings, report })
}

/// Every method of the sweep, without a scene.
fn opened(sweep: &Sweep, setup: &Setup<'_>) -> Result<Vec<Box<dyn Opened>>> {
    let used = |entry: &&Entry| sweep.settings.iter().any(|setting| setting.method == entry.name);
    METHODS.iter().filter(used).map(|entry| (entry.open)(setup)).collect()
}

/// The results in a file, if they are of the same sweep on the same device as `fresh`.
fn resumed(json: &Path, fresh: &Results) -> Result<Results> {
    let results = Results::read(json)?;
    let other = |what: &str| Error::Usage {
        message: format!("{}: its results are of another {what}", json.display()),
        help: Some("leave out --resume to measure from the beginning, or write to another folder".to_owned()),
    };
    if results.fingerprint != fresh.fingerprint {
        return Err(other("sweep"));
    }
    let device = |results: &Results| {
        let Environment { device, driver, version, commit, .. } = &results.environment;
        (device.clone(), driver.clone(), version.clone(), commit.clone())
    };
    if device(&results) != device(fresh) {
        return Err(other("device, version or commit"));
    }
    Ok(results)
}
