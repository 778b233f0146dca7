//! `mesoshell render`: from a scene file to a picture.

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser};
use mesoshell::film::{FrameRange, Names};
use mesoshell::frame::{Report, Stage, Stopwatch, file};
use mesoshell::gpu::{DeviceChoice, Messages};
use mesoshell::method::{self, Choice, METHODS, Saving, Setup};
use mesoshell::progress::{Interrupt, Progress};
use mesoshell::scene::{Loaded, Skip, View};
use mesoshell::value::PictureSize;
use mesoshell::{Error, Result};
use serde::Serialize;

use super::accuracy::{self, Accuracy};
use super::opening::open_and_load;
use super::progress::{Line, listen};
use super::{Talk, frames, table};

/// Render a scene to a picture
#[derive(Args)]
pub struct Arguments {
    /// The scene file; docs/scene.md lists its keys
    pub(super) scene: PathBuf,
    /// The picture: .png (sRGB, 8 bits) or .exr (linear, float), of several frames with #### or {frame:04} in its name; or a
    /// film: .gif, .apng, .y4m, or - for .y4m on standard output; by default the scene's name with .png, in the working
    /// directory
    #[arg(short, long, value_name = "FILE")]
    pub(super) output: Option<PathBuf>,
    /// Which frames of an animated scene: 1-120, 1-100x5, 3,5-10, all; by default the first, of a film all
    #[arg(long, value_name = "RANGE")]
    pub(super) frames: Option<FrameRange>,
    /// Render the frames again whose pictures are up to date
    #[arg(long)]
    pub(super) overwrite: bool,
    /// One of the scene's cameras, [cameras.NAME]
    #[arg(long, value_name = "NAME")]
    camera: Option<String>,
    /// Width and height in pixels, instead of the scene's
    #[arg(long, value_name = "WxH", value_parser = size)]
    pub(super) size: Option<PictureSize>,
    /// How the scene is rendered
    #[arg(long, default_value = METHODS[0].name, value_parser = methods())]
    pub(super) method: String,
    /// Set a key of the scene: -D shell.thickness=0.2; may be given more than once
    #[arg(short = 'D', value_name = "KEY=VALUE")]
    define: Vec<String>,
    /// Do not leave this out, although it could be; may be several, as A,B or given more than once, and replaces the scene's march.no_skip
    #[arg(long, value_name = "NAME", value_parser = skips(), value_delimiter = ',')]
    no_skip: Vec<String>,
    /// Tell which way is chosen for the scene and what is left out, and why; and then what came of it, and what each saves, for which
    /// the picture is drawn up to twenty times more
    #[arg(long)]
    pub(super) explain: bool,
    #[command(flatten)]
    pub(super) accuracy: accuracy::Arguments,
    /// The device: its number in `mesoshell devices`, a part of its name, or its UUID
    #[arg(long)]
    pub(super) device: Option<DeviceChoice>,
    /// Let the Vulkan validation layers watch; what they find is an error
    #[arg(long)]
    pub(super) validate: bool,
}

impl Arguments {
    /// What is laid over the scene.
    pub(super) fn overrides(&self) -> Vec<String> {
        let view = self.camera.iter().map(|name| format!("view={name:?}"));
        let no_skip = (!self.no_skip.is_empty()).then(|| format!("march.no_skip={:?}", self.no_skip));
        self.define.iter().cloned().chain(view).chain(no_skip).collect()
    }

    /// Pixels across and down, instead of the scene's.
    pub(super) fn pixels(&self) -> Option<[u32; 2]> {
        self.size.map(|PictureSize(size)| size.map(|side| side.0))
    }
}

/// Whatever the validation layers found is an error.
pub(super) fn check_messages(messages: Option<&Messages>) -> Result<()> {
    let messages = messages.map_or_else(Vec::new, Messages::all);
    if messages.is_empty() {
        return Ok(());
    }
    Err(Error::Device {
        message: format!("the validation layers object:\n{}", messages.join("\n")),
        help: None,
    })
}

/// What is printed with `--json`.
#[derive(Serialize)]
struct Rendered {
    scene: PathBuf,
    output: PathBuf,
    width: u32,
    height: u32,
    /// With `--explain`.
    #[serde(skip_serializing_if = "Option::is_none")]
    plan: Option<Vec<Choice>>,
    /// With `--explain`.
    #[serde(skip_serializing_if = "Option::is_none")]
    savings: Option<Vec<Saving>>,
    /// With `--max-error`.
    #[serde(skip_serializing_if = "Option::is_none")]
    accuracy: Option<Accuracy>,
    /// Its stages are those of the load, of the method's preparation, of the frame, and of writing.
    report: Report,
}

/// Exit code 1 where the picture's error was verified, and is too large.
///
/// # Errors
/// Whatever stands between the scene and its picture.
pub fn run(arguments: Arguments, talk: Talk) -> Result<ExitCode> {
    if frames::are_wanted(&arguments) {
        return frames::run(&arguments, talk);
    }
    if let Some(output) =
        arguments.output.as_deref().filter(|name| Names::new(name).is_ok_and(|names| names.differ()))
    {
        return Err(Error::Usage {
            message: format!(
                "{} has a place for the number of a frame, but one picture is asked for",
                output.display()
            ),
            help: Some("add --frames all, or the numbers of those that are wanted".into()),
        });
    }
    let interrupt = Interrupt::default();
    listen(&interrupt);
    let line = Arc::new(Line::new(talk));
    let rendered = render(&arguments, &line, &interrupt, talk);
    drop(line); // The progress line is wiped before anything else is said.
    let rendered = rendered?;
    for warning in &rendered.report.warnings {
        talk.warn(warning);
    }
    talk.result(&rendered, || {
        let Rendered { output, width, height, savings, accuracy, report, .. } = &rendered;
        let time = |stage: &Stage| format!("{:9.2} ms", stage.milliseconds);
        let stages = table(report.stages.iter().map(|stage| (stage.name.as_str(), time(stage))));
        let accuracy = accuracy.as_ref().map_or_else(String::new, Accuracy::told);
        let (method, device) = (&report.method, &report.device);
        let explained = savings.as_ref().map_or_else(String::new, |savings| explain(savings, report));
        format!("{}\n{method} on {device}, {width}x{height}\n{accuracy}{explained}{stages}", output.display())
    })?;
    let is_kept = rendered.accuracy.as_ref().is_none_or(Accuracy::is_kept);
    Ok(if is_kept { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

fn render(arguments: &Arguments, line: &Arc<Line>, interrupt: &Interrupt, talk: Talk) -> Result<Rendered> {
    let progress: &Arc<dyn Progress> = &(line.clone() as Arc<dyn Progress>);
    let scene = &arguments.scene;
    let output = arguments.output.clone().unwrap_or_else(|| {
        let mut name = scene.file_stem().unwrap_or("scene".as_ref()).to_owned();
        name.push(".png");
        name.into()
    });
    file::check_writable(&output)?;
    arguments.accuracy.check(&arguments.method, &arguments.define)?;

    let device = arguments.device.clone().unwrap_or_default();
    let messages = arguments.validate.then(Messages::default);
    let setup = Setup { device: &device, validation: messages.as_ref(), progress, interrupt };
    let entry = method::by_name(&arguments.method).expect("clap lets through the names of the table alone");
    let size = arguments.pixels();
    let (method, Loaded { scene: mut loaded, backdrop, mut stages, .. }, waited) =
        open_and_load(entry, &setup, scene, &arguments.overrides(), size)?;
    stages.push(waited);
    [loaded.view.width, loaded.view.height] = size.unwrap_or([loaded.view.width, loaded.view.height]);
    let view = loaded.view;
    interrupt.check()?;

    let mut watch = Stopwatch::start();
    let choice = arguments.accuracy.choose(&loaded, entry, &setup)?;
    let warning = choice.as_ref().and_then(|choice| choice.warning.clone());
    if let Some(choice) = &choice {
        choice.apply(&mut loaded);
        watch.lap("pilot");
    }
    let loaded = Arc::new(loaded);
    let mut method = method.prepare(loaded.clone())?;
    watch.lap("prepare");
    stages.extend(watch.finish());

    let plan = arguments.explain.then(|| method.plan());
    if let Some(plan) = &plan {
        let mut said = Ok(());
        line.aside(|| said = talk.foreword(&chosen(plan)));
        said?;
    }
    let mut frame = method.render(&view)?;
    frame.report.warnings.extend(warning);
    drop(method);
    check_messages(messages.as_ref())?;

    let mut watch = Stopwatch::start();
    let accuracy = choice.map(|choice| choice.accuracy(&loaded, &frame.image, &setup)).transpose()?;
    if accuracy.as_ref().is_some_and(|accuracy| accuracy.verified.is_some()) {
        watch.lap("verify");
    }
    progress.stage("writing the picture");
    file::write(&output, &frame.image, &backdrop)?;
    watch.lap("write");
    stages.append(&mut frame.report.stages);
    stages.extend(watch.finish());
    frame.report.stages = stages;
    let savings = plan.as_ref().map(|plan| method::savings(entry, plan, &loaded, &setup)).transpose()?;
    let View { width, height, .. } = view;
    Ok(Rendered {
        scene: scene.clone(),
        output,
        width,
        height,
        plan,
        savings,
        accuracy,
        report: frame.report,
    })
}

/// What is chosen.
fn chosen(plan: &[Choice]) -> String {
    if plan.is_empty() {
        return "chosen: nothing, for there is one way\n".to_owned();
    }
    let chosen = |choice: &Choice| format!("{:4}  {}", choice.chosen, choice.why);
    format!("chosen:\n{}", table(plan.iter().map(|choice| (choice.about, chosen(choice)))))
}

/// What came of it.
fn explain(savings: &[Saving], report: &Report) -> String {
    let saved = |saving: &Saving| {
        let Saving { with, without, noise, difference, .. } = saving;
        let saved = without - with;
        let certainty = match saved.abs() > *noise {
            true => String::new(),
            false => format!(" (no more than frames that are alike differ by, {noise:.2} ms)"),
        };
        format!(
            "{saved:9.2} ms{certainty} of {without:.2} ms without it; the picture differs by {difference:.1e}"
        )
    };
    let all_saved = match savings {
        [] => String::new(),
        _ => format!(
            "saved, where the eye stays where it is:\n{}\n",
            table(savings.iter().map(|saving| (saving.skip.name(), saved(saving))))
        ),
    };
    let counts = table(report.counts.iter().map(|(name, count)| (name.as_str(), format!("{count:9}"))));
    let skipped: String = match &*report.skipped {
        [] => "left out: nothing\n".to_owned(),
        skipped => {
            skipped.iter().fold("left out:\n".to_owned(), |text, skipped| text + "  - " + skipped + "\n")
        }
    };
    format!("{skipped}{all_saved}counted:\n{counts}\ntook:\n")
}

fn skips() -> PossibleValuesParser {
    Skip::ALL.map(|skip| PossibleValue::new(skip.name()).help(skip.summary())).to_vec().into()
}

fn methods() -> PossibleValuesParser {
    METHODS.iter().map(|entry| PossibleValue::new(entry.name).help(entry.summary)).collect::<Vec<_>>().into()
}

/// Reads a `WxH`.
pub fn size(text: &str) -> std::result::Result<PictureSize, String> {
    let (width, height) = text.split_once(['x', 'X']).ok_or("write it as 640x480")?;
    let pixels = |side: &str| side.parse::<u32>().map_err(|_| format!("`{side}` is no number of pixels"));
    PictureSize::new(pixels(width)?, pixels(height)?)
}
