//! `mesoshell gallery`: many scenes rendered, timed, compared, and shown on one page.

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

use clap::Args;
use mesoshell::Result;
use mesoshell::bench::gallery::{self, Options, Outcome, Results, SceneResults, Verdict};
use mesoshell::gpu::DeviceChoice;
use mesoshell::method::Setup;
use mesoshell::progress::{Interrupt, Progress};
use mesoshell::value::PictureSize;

use super::progress::{Line, listen};
use super::render::size;
use super::{Talk, output};

/// Render scenes and whole folders of them, compare each with the reference, and show them on one page
#[derive(Args)]
pub struct Arguments {
    /// Scene files, or folders of them
    #[arg(required = true, value_name = "SCENE|FOLDER")]
    scenes: Vec<PathBuf>,
    /// Folder of index.html, contact-sheet.png and the pictures
    #[arg(long, short, default_value = "out/gallery", value_name = "DIR")]
    output: PathBuf,
    /// Width and height in pixels, instead of the scenes'
    #[arg(long, value_name = "WxH", value_parser = size)]
    size: Option<PictureSize>,
    /// Compare pictures as large as fit into this with the reference
    #[arg(long, value_name = "WxH", value_parser = size, default_value = "256x256")]
    reference_size: PictureSize,
    /// Compare nothing
    #[arg(long, conflicts_with = "reference_size")]
    no_reference: bool,
    /// Folder where the reference's pictures are kept; by default `cache` in the gallery's folder
    #[arg(long, value_name = "DIR")]
    cache: Option<PathBuf>,
    /// The device: its number in `mesoshell devices`, a part of its name, or its UUID
    #[arg(long)]
    device: Option<DeviceChoice>,
}

/// The exit code of the first scene that cannot be rendered; else 1 where one is above its bound.
///
/// # Errors
/// No device, no scene, or a gallery that cannot be written.
pub fn run(arguments: Arguments, talk: Talk) -> Result<ExitCode> {
    let scenes = gallery::scenes(&arguments.scenes)?;
    let interrupt = Interrupt::default();
    listen(&interrupt);
    let progress: Arc<dyn Progress> = Arc::new(Line::new(talk));
    let device = arguments.device.unwrap_or_default();
    let cache = arguments.cache.unwrap_or_else(|| arguments.output.join("cache"));
    let pixels = |PictureSize(size): PictureSize| size.map(|side| side.0);
    let options = Options {
        out: &arguments.output,
        cache: &cache,
        size: arguments.size.map(pixels),
        reference_size: (!arguments.no_reference).then(|| pixels(arguments.reference_size)),
    };
    let setup = Setup { device: &device, validation: None, progress: &progress, interrupt: &interrupt };
    let outcome = gallery::run(&scenes, &options, &setup);
    drop(progress); // The progress line is wiped before anything else is said.
    let Outcome { results, failures, warnings, page } = outcome?;
    for warning in &warnings {
        talk.warn(warning);
    }
    let code = failures.first().map(|(_, error)| error.exit_code());
    for (scene, error) in failures {
        output::complain(&format!("{} cannot be rendered:", scene.display()));
        output::complain(&format!("{:?}", miette::Report::new(error)));
    }
    talk.result(&results, || format!("{}{}", tables(&results), page.display()))?;
    let is_above = results.scenes.iter().any(|scene| scene.verdict == Verdict::Failed);
    Ok(code.unwrap_or(u8::from(is_above)).into())
}

/// A table for each folder, in Markdown.
fn tables(results: &Results) -> String {
    let table = |(group, scenes): (String, &[SceneResults])| {
        let lines: String = scenes.iter().map(line).collect();
        format!(
            "{group}\n\n| scene | tetrahedra | size | load (ms) | frame (ms) | RMSE | bound | verdict |\n\
             |---|---|---|---|---|---|---|---|\n{lines}\n"
        )
    };
    results.groups().map(table).collect()
}

fn line(scene: &SceneResults) -> String {
    let (name, verdict) = (scene.name(), scene.verdict.told());
    let Some(drawn) = &scene.drawn else { return format!("| {name} | | | | | | | {verdict} |\n") };
    let error = match &drawn.error {
        Some(error) => format!("{:.1e} | {:.0e}", error.metrics.rmse, drawn.bound),
        None => "|".to_owned(),
    };
    format!(
        "| {name} | {} | {}x{} | {:.0} | {:.0} | {error} | {verdict} |\n",
        drawn.tetrahedra, drawn.width, drawn.height, drawn.load_milliseconds, drawn.frame_milliseconds
    )
}
