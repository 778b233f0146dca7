//! Draws every scene at every size.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use super::memory;
use super::report::{csv, html};
use super::results::{Point, Results, SCHEMA, SeriesResults};
use super::sweep::{Measure, Series, Sweep};
use crate::bench::file::{check_writable, write_whole};
use crate::bench::results::add_stages;
use crate::bench::{Environment, Options};
use crate::gpu::Gpu;
use crate::method::{METHODS, Opened, Setup};
use crate::progress::{Progress, Silent};
use crate::scene::{self, Scene, Sizes};
use crate::{Error, Result};

/// What a benchmark of scaling ended with.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// What was measured; `scaling.json` holds the same.
    pub results: Results,
    /// What the user should know, each a sentence.
    pub warnings: Vec<String>,
    /// The report in HTML.
    pub report: PathBuf,
}

/// Measures a sweep and writes `scaling.json`, `scaling.csv` and `scaling.html`; [`Options::resume`] and [`Options::cache`] are not
/// read.
///
/// # Errors
/// Whatever stands between a scene and its picture; [`Error::Output`].
pub fn run(sweep: &Sweep, options: &Options<'_>, setup: &Setup<'_>) -> Result<Outcome> {
    let device = Gpu::open(setup.device, setup.validation)?.info().clone();
    check_writable(&options.out.join("scaling.json"))?;
    let mut results = Results {
        schema: SCHEMA,
        sweep: sweep.clone(),
        environment: Environment::here(&device),
        series: Vec::new(),
    };
    let mut warnings = Vec::new();
    for (index, series) in sweep.series.iter().enumerate() {
        let part = |done: usize| {
            (index as f64 + done as f64 / series.sizes.len() as f64) / sweep.series.len() as f64
        };
        let mut points = Vec::new();
        for (done, size) in series.sizes.iter().enumerate() {
            setup.progress.stage(&format!("{}: size {} of {}", series.name, done + 1, series.sizes.len()));
            setup.progress.fraction(part(done));
            setup.interrupt.check()?;
            let overrides: Vec<String> = sweep.define.iter().chain(size).cloned().collect();
            let of_size = |error: Error| error.of(&format!("{}, {}", series.name, size.join(", ")));
            points.push(measure(series, &overrides, sweep.runs, setup, &mut warnings).map_err(of_size)?);
        }
        results.series.push(SeriesResults::new(&series.name, series.of, points));
    }
    let write = |name: &str, bytes: &[u8]| {
        let path = options.out.join(name);
        write_whole(&path, |file| std::io::Write::write_all(file, bytes)).map(|()| path)
    };
    write("scaling.json", &serde_json::to_vec_pretty(&results).expect("numbers, strings and lists"))?;
    write("scaling.csv", csv(&results).as_bytes())?;
    let report = write("scaling.html", html(&results).as_bytes())?;
    Ok(Outcome { results, warnings, report })
}

/// One size.
fn measure(
    series: &Series,
    overrides: &[String],
    runs: u32,
    setup: &Setup<'_>,
    warnings: &mut Vec<String>,
) -> Result<Point> {
    let silent: Arc<dyn Progress> = Arc::new(Silent);
    let setup = Setup { progress: &silent, ..*setup };
    let before = memory::now();
    memory::forget_peak();
    let opened = (METHODS[0].open)(&setup)?;
    let admit = |sizes: &Sizes| Opened::admit(&*opened, sizes);
    let loaded = scene::load_if(&series.scene, overrides, &Silent, &admit)?;
    let scene = Arc::new(loaded.scene);
    let mut point = Point::new(size_of(series.of, &scene));
    add_stages(&mut point.stages, &loaded.stages);
    let mut method = opened.prepare(scene.clone())?;
    // In the first pipelines are compiled and buffers made.
    let warm_up = method.render(&scene.view)?;
    point.memory = memory::peak().zip(before).map(|(peak, before)| peak.saturating_sub(before));
    for warning in warm_up.report.warnings {
        let warning = format!("{}: {warning}", series.name);
        if !warnings.contains(&warning) {
            warnings.push(warning);
        }
    }
    for _ in 0..runs {
        setup.interrupt.check()?;
        method.forget();
        let start = Instant::now();
        let frame = method.render(&scene.view)?;
        point.frame.push(1e3 * start.elapsed().as_secs_f64());
        add_stages(&mut point.stages, &frame.report.stages);
    }
    Ok(point)
}

fn size_of(measure: Measure, scene: &Scene) -> u64 {
    match measure {
        Measure::Tetrahedra => scene.shell.topology.tetrahedra.len() as u64,
        Measure::Pixels => u64::from(scene.view.width) * u64::from(scene.view.height),
        Measure::Texels => scene.volume.levels[0].texels.len() as u64,
    }
}
