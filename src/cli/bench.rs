//! `mesoshell bench`: run time against error, of a sweep or of some scenes.

mod antialiasing;
mod scaling;

use std::io::{IsTerminal, stderr};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use clap::Args;
use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressStyle};
use mesoshell::bench::{self, Levels, Options, Results, SceneResults, Speedup, Sweep, sweep};
use mesoshell::gpu::DeviceChoice;
use mesoshell::method::{METHODS, Setup};
use mesoshell::progress::{Interrupt, Progress};
use mesoshell::{Error, Result};

use super::progress::listen;
use super::{Talk, output};

/// Measure time against error: a sweep over scenes, methods and levels of quality, compared with the reference
#[derive(Args)]
pub struct Arguments {
    /// A sweep file (docs/bench.md lists its keys), or scene files
    #[arg(default_value = "benches/default.toml", value_name = "SWEEP|SCENE", conflicts_with = "suite")]
    files: Vec<PathBuf>,
    /// The sweep benches/NAME.toml
    #[arg(long, value_name = "NAME", value_parser = ["default", "antialiasing", "speed", "gate", "scaling"])]
    suite: Option<String>,
    /// Fail, with exit code 1, where a speed-up over the paper's plan is more than 15 % below that in this results.json
    #[arg(long, value_name = "FILE")]
    baseline: Option<PathBuf>,
    /// Steps of the default plan, in texels, for scene files: by default 2,1,0.5,0.25,0.125
    #[arg(long, value_delimiter = ',', value_name = "LIST")]
    steps: Option<Vec<f64>>,
    /// Samples in a tetrahedron by the paper's plan, for scene files: by default none
    #[arg(long, value_delimiter = ',', value_name = "LIST")]
    samples: Option<Vec<u32>>,
    /// Measure the exact plan too, for scene files
    #[arg(long)]
    exact: bool,
    /// Frames timed a point; by default as the sweep says, or 3
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=1000))]
    runs: Option<u32>,
    /// Folder of results.json, results.csv and report.html
    #[arg(long, short, default_value = "out/bench", value_name = "DIR")]
    output: PathBuf,
    /// Folder where the reference's pictures are kept; by default `cache` in the results' folder
    #[arg(long, value_name = "DIR")]
    cache: Option<PathBuf>,
    /// Go on with the results that an interrupted run left
    #[arg(long)]
    resume: bool,
    /// Set a key of every scene: -D image.size=[256,256]
    #[arg(short = 'D', value_name = "KEY=VALUE")]
    define: Vec<String>,
    /// The device: its number in `mesoshell devices`, a part of its name, or its UUID
    #[arg(long)]
    device: Option<DeviceChoice>,
}

/// The part of a speed-up by which it may fall below the baseline's.
const LOSS: f64 = 0.15;

/// Exit code 1 where a speed-up is below the baseline's.
///
/// # Errors
/// Whatever stands between a scene and its picture.
pub fn run(mut arguments: Arguments, talk: Talk) -> Result<ExitCode> {
    if let Some(name) = &arguments.suite {
        arguments.files = vec![Path::new("benches").join(format!("{name}.toml"))];
    }
    let baseline = arguments.baseline.as_deref().map(baseline).transpose()?;
    let antialiasing = antialiasing::sweep(&arguments)?;
    let scaling = scaling::sweep(&arguments)?;
    let sweep = (antialiasing.is_none() && scaling.is_none()).then(|| what(&arguments)).transpose()?;
    if let (Some(baseline), Some(sweep), Some(file)) = (&baseline, &sweep, &arguments.baseline)
        && baseline.fingerprint != sweep.fingerprint()
    {
        return Err(Error::input(
            file,
            "its results are of another sweep, or of other scenes, sizes or runs",
        )
        .with_help("measure a baseline by the same command"));
    }
    let interrupt = Interrupt::default();
    listen(&interrupt);
    let bar = Arc::new(Bar::new(talk));
    let progress: Arc<dyn Progress> = bar.clone();
    let device = arguments.device.clone().unwrap_or_default();
    let cache = arguments.cache.clone().unwrap_or_else(|| arguments.output.join("cache"));
    let options = Options { out: &arguments.output, cache: &cache, resume: arguments.resume };
    let setup = Setup { device: &device, validation: None, progress: &progress, interrupt: &interrupt };
    if let Some(sweep) = scaling {
        let outcome = bench::scaling::run(&sweep, &options, &setup);
        bar.bar.finish_and_clear();
        return scaling::tell(&outcome?, talk).map(|()| ExitCode::SUCCESS);
    }
    let Some(sweep) = sweep else {
        let sweep = antialiasing.expect("one of the two was read");
        let outcome = bench::antialiasing::run(&sweep, &options, &setup);
        bar.bar.finish_and_clear();
        return antialiasing::tell(&outcome?, talk).map(|()| ExitCode::SUCCESS);
    };
    let outcome = bench::run(&sweep, &options, &setup);
    bar.bar.finish_and_clear(); // The line is wiped before anything else is said.
    if matches!(outcome, Err(Error::Interrupted)) {
        let kept = Results::read(&arguments.output.join("results.json"));
        let is_begun = kept.is_ok_and(|kept| !kept.complete && kept.fingerprint == sweep.fingerprint());
        talk.warn(match is_begun {
            true => "what was measured is kept: go on with --resume",
            false => "nothing was measured yet",
        });
    }
    let outcome = outcome?;
    for warning in &outcome.warnings {
        talk.warn(warning);
    }
    let results = &outcome.results;
    talk.result(results, || {
        format!("{}\n\n{}{}", table(results), speedups(results), outcome.report.display())
    })?;
    let slower = baseline.map(|baseline| results.slower_than(&baseline, LOSS)).unwrap_or_default();
    for told in &slower {
        output::complain(&format!("slower than the baseline: {told}"));
    }
    Ok(if slower.is_empty() { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

/// Reads results with which others are to be compared.
fn baseline(file: &Path) -> Result<Results> {
    let help =
        "--baseline takes the results.json of an earlier run to its end, with the paper's plan beside others";
    let results = Results::read(file).map_err(|error| error.with_help(help))?;
    let mut speedups = results.scenes.iter().flat_map(SceneResults::speedups);
    match speedups.any(|speedup| speedup.ratio.is_some()) && results.complete {
        true => Ok(results),
        false => {
            Err(Error::input(file, "has no speed-ups to compare with, or was not finished").with_help(help))
        }
    }
}

/// The sweep that the files and options ask for.
fn what(arguments: &Arguments) -> Result<Sweep> {
    let usage =
        |message: &str, help: &str| Error::Usage { message: message.to_owned(), help: Some(help.to_owned()) };
    let levels_given = arguments.steps.is_some() || arguments.samples.is_some() || arguments.exact;
    let mut sweep = match arguments.files.as_slice() {
        [file] if arguments.suite.is_some() || sweep::is_sweep(file) => {
            if levels_given {
                return Err(usage(
                    "a sweep file says itself what is measured",
                    "change its [plans], or name scenes",
                ));
            }
            Sweep::load(file)?
        }
        files if files.iter().any(|file| sweep::is_sweep(file)) => {
            return Err(usage("a sweep file stands alone", "name either one sweep file or scene files"));
        }
        scenes => Sweep::of_scenes(scenes, &[METHODS[0].name], &levels(arguments)?),
    };
    sweep.runs = arguments.runs.unwrap_or(sweep.runs);
    sweep.define.extend(arguments.define.iter().cloned());
    Ok(sweep)
}

/// The levels for scene files.
fn levels(arguments: &Arguments) -> Result<Levels> {
    let steps = arguments.steps.clone().unwrap_or_else(|| match arguments.samples {
        Some(_) => Vec::new(),
        None => Levels::default().steps,
    });
    let samples = arguments.samples.clone().unwrap_or_default();
    let levels = Levels { steps, samples, paper_of_scene: false, exact: arguments.exact };
    levels.check().map(|()| levels)
}

/// A line for each point, in Markdown.
fn table(results: &Results) -> String {
    let mut table =
        "| scene | plan | level | time (ms) | RMSE | 99.9 % | max |\n|---|---|---|---|---|---|---|\n"
            .to_owned();
    for scene in &results.scenes {
        for point in &scene.points {
            table += &format!(
                "| {} | {} | {} | {:.0} | {:.1e} | {:.1e} | {:.1e} |\n",
                scene.name(),
                point.setting.plan(),
                point.setting.level(),
                point.time.median,
                point.rmse(),
                point.error("p999"),
                point.error("max")
            );
        }
    }
    table.trim_end().to_owned()
}

/// A line for each point of the paper's plan, and the means over the scenes; nothing where that is not measured.
fn speedups(results: &Results) -> String {
    let mut table = String::new();
    let mut counts = Vec::new();
    for scene in &results.scenes {
        for Speedup { samples, setting, ratio } in scene.speedups() {
            let level = setting.map_or_else(|| "none is as accurate".to_owned(), |setting| setting.level());
            let ratio = ratio.map_or_else(|| "-".to_owned(), |ratio| format!("{ratio:.1}"));
            table += &format!("| {} | {samples} | {level} | {ratio} |\n", scene.name());
            if !counts.contains(&samples) {
                counts.push(samples);
            }
        }
    }
    for samples in counts {
        if let Some(mean) = results.mean_speedup(Some(samples)) {
            table += &format!("| geometric mean | {samples} | | {mean:.1} |\n");
        }
    }
    if let Some(mean) = results.mean_speedup(None) {
        table += &format!("| geometric mean | as the scenes say | | {mean:.1} |\n");
    }
    if table.is_empty() {
        return table;
    }
    format!("| scene | paper's samples | as accurate | times as fast |\n|---|---|---|---|\n{table}\n")
}

/// How much of the sweep is done, what is measured now, and how long the rest takes: one line that is drawn over on a
/// terminal, else one line a stage.
struct Bar {
    bar: ProgressBar,
    prints_stages: bool,
    begun: Instant,
    /// What is measured now, and what part of all is done.
    now: Mutex<(String, f64)>,
}

impl Bar {
    fn new(talk: Talk) -> Self {
        let is_terminal = stderr().is_terminal();
        let target = match talk.quiet || !is_terminal {
            true => ProgressDrawTarget::hidden(),
            false => ProgressDrawTarget::stderr(),
        };
        let bar = ProgressBar::with_draw_target(Some(1000), target);
        let style = ProgressStyle::with_template("{bar:24.dim} {elapsed} {msg}").expect("a valid template");
        bar.set_style(style);
        bar.enable_steady_tick(Duration::from_millis(200));
        let prints_stages = !is_terminal && !talk.quiet;
        Self { bar, prints_stages, begun: Instant::now(), now: Mutex::new((String::new(), 0.0)) }
    }

    fn left(&self, done: f64) -> String {
        if done <= 0.0 {
            return String::new();
        }
        let left = self.begun.elapsed().as_secs_f64() * (1.0 - done) / done;
        // What has hardly begun may claim to take ages.
        format!(", about {} left", HumanDuration(Duration::from_secs_f64(left.min(1e9))))
    }
}

impl Progress for Bar {
    fn stage(&self, name: &str) {
        let mut now = self.now.lock().unwrap_or_else(PoisonError::into_inner);
        now.0 = name.to_owned();
        let message = format!("{name}{}", self.left(now.1));
        if self.prints_stages {
            output::complain(&message);
        }
        self.bar.set_message(message);
    }

    fn fraction(&self, done: f64) {
        let mut now = self.now.lock().unwrap_or_else(PoisonError::into_inner);
        now.1 = done.clamp(0.0, 1.0);
        self.bar.set_position((1000.0 * now.1) as u64);
        self.bar.set_message(format!("{}{}", now.0, self.left(now.1)));
    }
}
