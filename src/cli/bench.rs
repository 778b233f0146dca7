//! `mesoshell bench`: run time and error of the default plan at falling steps, scene by scene.

use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;
use mesoshell::bench::{self, StepPoint};
use mesoshell::gpu::DeviceChoice;
use mesoshell::method::Setup;
use mesoshell::progress::{Interrupt, Progress};
use mesoshell::{Result, scene};
use serde::Serialize;

use super::Talk;
use super::progress::{Line, listen};

/// Measure time against error: the shell method at several steps, compared with the reference
#[derive(Args)]
pub struct Arguments {
    /// Scene files
    #[arg(required = true)]
    scenes: Vec<PathBuf>,
    /// Texels a sample, for each row of the table
    #[arg(long, value_delimiter = ',', default_values_t = [2.0, 1.0, 0.5, 0.25, 0.125])]
    steps: Vec<f64>,
    /// Frames timed a row; the median counts
    #[arg(long, default_value_t = 3)]
    runs: usize,
    /// Set a key of every scene: -D image.size=[256,256]
    #[arg(short = 'D', value_name = "KEY=VALUE")]
    define: Vec<String>,
    /// The device: its number in `mesoshell devices`, a part of its name, or its UUID
    #[arg(long)]
    device: Option<DeviceChoice>,
}

/// The rows of one scene.
#[derive(Serialize)]
struct Measured {
    scene: PathBuf,
    points: Vec<StepPoint>,
}

/// # Errors
/// Whatever stands between a scene and its picture.
pub fn run(arguments: Arguments, talk: Talk) -> Result<()> {
    let interrupt = Interrupt::default();
    listen(&interrupt);
    let progress: Arc<dyn Progress> = Arc::new(Line::new(talk));
    let device = arguments.device.clone().unwrap_or_default();
    let setup = Setup { device: &device, validation: None, progress: &progress, interrupt: &interrupt };
    let mut measured = Vec::new();
    for path in &arguments.scenes {
        let scene = Arc::new(scene::load(path, &arguments.define, progress.as_ref())?.scene);
        let reference = bench::reference(&scene, &setup)?;
        let points = bench::steps(&scene, &reference, &arguments.steps, arguments.runs.max(1), &setup)?;
        measured.push(Measured { scene: path.clone(), points });
    }
    drop(progress); // The progress line is wiped before anything else is said.
    talk.result(&measured, || {
        let mut table =
            "| scene | step (texels) | time (ms) | RMSE | 99.9 % | max |\n|---|---|---|---|---|---|\n"
                .to_owned();
        for Measured { scene, points } in &measured {
            let name = scene.file_stem().unwrap_or_default().to_string_lossy();
            for StepPoint { step, milliseconds, metrics } in points {
                table += &format!(
                    "| {name} | {step} | {milliseconds:.0} | {:.1e} | {:.1e} | {:.1e} |\n",
                    metrics.rmse, metrics.p999, metrics.max
                );
            }
        }
        table.trim_end().to_owned()
    })
}
