//! `mesoshell animate-check`: what a shell suffers in each frame of an animation.

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

use clap::Args;
use mesoshell::Result;
use mesoshell::film::FrameRange;
use mesoshell::frame::{Backdrop, file};
use mesoshell::gpu::DeviceChoice;
use mesoshell::instrument::{self, FrameResults, Options, Results, page};
use mesoshell::method::Setup;
use mesoshell::progress::{Interrupt, Progress};
use mesoshell::scene::Sequence;
use mesoshell::value::PictureSize;

use super::Talk;
use super::progress::{Line, listen};
use super::render::size;

/// Check every frame of an animation: inverted tetrahedra, stretch, overlap, order, pixels that pop
#[derive(Args)]
pub struct Arguments {
    /// The scene file; docs/animation-check.md says what is measured
    scene: PathBuf,
    /// Which frames: 1-120, 1-100x5, 3,5-10; by default all of the timeline
    #[arg(long, value_name = "RANGE", default_value = "all")]
    frames: FrameRange,
    /// Folder of index.html and results.json
    #[arg(long, short, value_name = "FOLDER")]
    output: Option<PathBuf>,
    /// Paint the stretch of the most deformed frame on the mesh
    #[arg(long, value_name = "FILE.png")]
    heatmap: Option<PathBuf>,
    /// Width and height in pixels, instead of the scene's
    #[arg(long, value_name = "WxH", value_parser = size)]
    size: Option<PictureSize>,
    /// Set a key of the scene: -D shell.thickness=0.2; may be given more than once
    #[arg(short = 'D', value_name = "KEY=VALUE")]
    define: Vec<String>,
    /// The device: its number in `mesoshell devices`, a part of its name, or its UUID
    #[arg(long)]
    device: Option<DeviceChoice>,
}

/// Exit code 1 where a frame has a fault.
///
/// # Errors
/// Whatever stands between the scene and its frames, or results that cannot be written.
pub fn run(arguments: Arguments, talk: Talk) -> Result<ExitCode> {
    let interrupt = Interrupt::default();
    listen(&interrupt);
    let progress: Arc<dyn Progress> = Arc::new(Line::new(talk));
    let checked = check(&arguments, &progress, &interrupt);
    drop(progress); // The progress line is wiped before anything else is said.
    let results = checked?;
    talk.result(&results, || told(&results))?;
    Ok(if results.is_clean() { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

fn check(arguments: &Arguments, progress: &Arc<dyn Progress>, interrupt: &Interrupt) -> Result<Results> {
    if let Some(heatmap) = &arguments.heatmap {
        file::check_writable(heatmap)?;
    }
    if let Some(folder) = &arguments.output {
        instrument::check_writable(folder)?;
    }
    let mut sequence = Sequence::open(&arguments.scene, &arguments.define, progress.as_ref())?;
    let device = arguments.device.clone().unwrap_or_default();
    let setup = Setup { device: &device, validation: None, progress, interrupt };
    let frames = arguments.frames.of(sequence.timeline())?;
    let options = Options {
        scene: &arguments.scene,
        frames: &frames,
        size: arguments.size.map(|PictureSize(size)| size.map(|side| side.0)),
    };
    let outcome = instrument::walk(&mut sequence, &options, &setup)?;
    if let Some(heatmap) = &arguments.heatmap {
        file::write(heatmap, &outcome.heatmap, &Backdrop::default())?;
    }
    if let Some(folder) = &arguments.output {
        instrument::write(folder, &outcome)?;
    }
    Ok(outcome.results)
}

/// A table of the frames, what is wrong with them, and what the thickness may be.
fn told(results: &Results) -> String {
    const TITLES: [&str; 12] = [
        "frame",
        "inverted",
        "slivers",
        "intersecting",
        "violations",
        "cycles",
        "pops",
        "least",
        "greatest",
        "shear",
        "thickness",
        "safe",
    ];
    let mut rows: Vec<Vec<String>> = vec![TITLES.map(str::to_owned).to_vec()];
    rows.extend(
        results
            .frames
            .iter()
            .map(|frame| [vec![frame.frame.to_string()], page::cells(frame).to_vec()].concat()),
    );
    let widths: Vec<usize> = (0..TITLES.len())
        .map(|column| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0))
        .collect();
    let mut text = String::new();
    for row in &rows {
        let cells: Vec<String> =
            row.iter().zip(&widths).map(|(cell, &width)| format!("{cell:>width$}")).collect();
        text += &format!("{}\n", cells.join("  "));
    }
    for frame in &results.frames {
        text += &faults(frame);
    }
    let faulty = results.frames.iter().filter(|frame| !frame.faults().is_empty()).count();
    text + &format!("{}\n{faulty} of {} frames have faults.", results.told_fold(), results.frames.len())
}

/// What is wrong with a frame, and the first place of each kind.
fn faults(frame: &FrameResults) -> String {
    let faults = frame.faults();
    if faults.is_empty() {
        return String::new();
    }
    let at = |[x, y, z]: [f64; 3]| format!("({x:.4}, {y:.4}, {z:.4})");
    let mut text = format!("frame {}: {}\n", frame.frame, faults.join(", "));
    if let Some(place) = frame.faults.inverted.first.first() {
        let (id, triangle, at) = (place.tetrahedron, place.triangle, at(place.centroid));
        text += &format!("  inverted: tetrahedron {id} on base triangle {triangle}, at {at}\n");
    }
    if let Some(pair) = frame.overlaps.first.first() {
        let ([a, b], at) = (pair.tetrahedra, at(pair.at));
        text += &format!("  intersecting: tetrahedra {a} and {b}, at {at}\n");
    }
    if let Some([x, y]) = frame.pops.as_ref().and_then(|pops| pops.first.first()) {
        text += &format!("  popping: pixel {x}, {y}\n");
    }
    text
}
