//! `mesoshell render --frames`: many frames of an animated scene in one process, to pictures that a later run finds up to date, or to
//! a film.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, Instant};

use mesoshell::film::mark::{self, Marker};
use mesoshell::film::moving::{self, FilmFormat};
use mesoshell::film::{Film, Names};
use mesoshell::frame::{Backdrop, Frame, Image, Report, Stopwatch, file};
use mesoshell::gpu::Messages;
use mesoshell::method::{self, Method, Opened, Setup};
use mesoshell::progress::{Interrupt, Progress};
use mesoshell::scene::{Loaded, Sequence, Sizes};
use mesoshell::{Error, Result};
use serde::Serialize;

use super::Talk;
use super::progress::{Line, listen};
use super::render::{Arguments, check_messages};

/// Whether more is asked for than one picture.
pub fn are_wanted(arguments: &Arguments) -> bool {
    arguments.frames.is_some() || arguments.output.as_deref().and_then(FilmFormat::of).is_some()
}

/// What is printed with `--json`.
#[derive(Serialize)]
struct Rendered {
    scene: PathBuf,
    frames: Vec<RenderedFrame>,
    rendered: usize,
    up_to_date: usize,
    milliseconds: f64,
}

#[derive(Serialize)]
struct RenderedFrame {
    frame: u32,
    output: PathBuf,
    /// Of one that was up to date there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    report: Option<Report>,
}

/// Where frames go.
enum Output {
    Pictures(Names),
    Film(FilmFormat, PathBuf),
}

/// Tells of frames instead of their stages.
struct FrameLine(Line);

impl Progress for FrameLine {
    fn stage(&self, _: &str) {}

    fn fraction(&self, done: f64) {
        self.0.fraction(done);
    }
}

/// A method, before and after it has a scene.
struct Stage {
    opened: Option<Box<dyn Opened>>,
    method: Option<Box<dyn Method>>,
}

struct Drawn {
    image: Image,
    backdrop: Backdrop,
    report: Report,
}

impl Stage {
    fn render(
        &mut self,
        sequence: &mut Sequence,
        frame: u32,
        next: Option<u32>,
        size: Option<[u32; 2]>,
        progress: &dyn Progress,
    ) -> Result<Drawn> {
        let admit = |sizes: &Sizes| match &self.opened {
            Some(opened) => opened.admit(&Sizes { picture: size.unwrap_or(sizes.picture), ..*sizes }),
            None => Ok(()),
        };
        let Loaded { mut scene, backdrop, mut stages } = sequence.at(frame, progress, &admit)?;
        [scene.view.width, scene.view.height] = size.unwrap_or([scene.view.width, scene.view.height]);
        if let Some(next) = next {
            sequence.prefetch(next)?;
        }
        let view = scene.view;
        let scene = Arc::new(scene);
        let mut watch = Stopwatch::start();
        let method = match (&mut self.method, self.opened.take()) {
            (Some(method), _) => {
                method.update(scene)?;
                watch.lap("update");
                method
            }
            (method, opened) => {
                let opened = opened.expect("it is taken where it becomes a method");
                let prepared = opened.prepare(scene)?;
                watch.lap("prepare");
                method.insert(prepared)
            }
        };
        stages.extend(watch.finish());
        let Frame { image, mut report, .. } = method.render(&view)?;
        stages.append(&mut report.stages);
        report.stages = stages;
        Ok(Drawn { image, backdrop, report })
    }
}

/// # Errors
/// Whatever stands between the scene and a frame, which is named. Frames that were done before are kept.
pub fn run(arguments: &Arguments, talk: Talk) -> Result<ExitCode> {
    let interrupt = Interrupt::default();
    listen(&interrupt);
    let start = Instant::now();
    let line = Arc::new(FrameLine(Line::new(talk)));
    let rendered = render(arguments, &line, &interrupt);
    drop(line); // The progress line is wiped before anything else is said.
    let mut rendered = rendered?;
    rendered.milliseconds = 1e3 * start.elapsed().as_secs_f64();
    let mut told: Vec<&String> = Vec::new();
    for RenderedFrame { frame, report, .. } in &rendered.frames {
        for warning in report.iter().flat_map(|report| &report.warnings).filter(|one| !told.contains(one)) {
            talk.warn(&format!("from frame {frame} on: {warning}"));
        }
        told.extend(report.iter().flat_map(|report| &report.warnings));
    }
    // A film on standard output is all that may stand there.
    let talk = Talk { quiet: talk.quiet || arguments.output.as_deref() == Some(Path::new("-")), ..talk };
    talk.result(&rendered, || {
        let Rendered { frames, rendered, up_to_date, milliseconds, .. } = &rendered;
        let outputs = match frames.as_slice() {
            [] => String::new(),
            [one] => one.output.display().to_string(),
            [first, .., last] if first.output == last.output => first.output.display().to_string(),
            [first, .., last] => format!("{} to {}", first.output.display(), last.output.display()),
        };
        format!(
            "{outputs}\n{rendered} frames rendered, {up_to_date} were up to date; {:.1} s",
            1e-3 * milliseconds
        )
    })?;
    Ok(ExitCode::SUCCESS)
}

fn output(arguments: &Arguments, frames: &[u32]) -> Result<Output> {
    let name = arguments.output.clone().unwrap_or_else(|| {
        let stem = arguments.scene.file_stem().unwrap_or("scene".as_ref()).to_string_lossy();
        format!("{stem}-####.png").into()
    });
    if let Some(format) = FilmFormat::of(&name) {
        return Ok(Output::Film(format, name));
    }
    let usage = |message: String| Error::Usage {
        message: format!("{}: {message}", name.display()),
        help: Some(
            "name pictures frame-####.png or frame-{frame:04}.png, a film film.gif, film.apng or film.y4m"
                .into(),
        ),
    };
    let names = Names::new(&name).map_err(usage)?;
    if !names.differ() && frames.len() > 1 {
        return Err(usage(format!("{} frames cannot have one name", frames.len())));
    }
    for &frame in frames {
        file::check_writable(names.of(frame))?;
    }
    Ok(Output::Pictures(names))
}

fn render(arguments: &Arguments, line: &Arc<FrameLine>, interrupt: &Interrupt) -> Result<Rendered> {
    if arguments.accuracy.is_used() {
        return Err(Error::Usage {
            message: "--max-error chooses the march of one picture, not of many frames".into(),
            help: Some("choose it for one frame, and give its step by -D march.step=S".into()),
        });
    }
    if arguments.explain {
        return Err(Error::Usage {
            message: "--explain tells of one picture, not of many frames".into(),
            help: Some("leave out --frames, or leave out --explain".into()),
        });
    }
    let mut sequence = Sequence::open(&arguments.scene, &arguments.overrides(), &line.0)?;
    let timeline = *sequence.timeline();
    let frames = match &arguments.frames {
        Some(range) => range.of(&timeline)?,
        None => (1..=timeline.frames).collect(),
    };
    let output = output(arguments, &frames)?;

    let device = arguments.device.clone().unwrap_or_default();
    let messages = arguments.validate.then(Messages::default);
    let progress: Arc<dyn Progress> = line.clone();
    let setup = Setup { device: &device, validation: messages.as_ref(), progress: &progress, interrupt };
    let entry = method::by_name(&arguments.method).expect("clap lets through the names of the table alone");
    let opened = (entry.open)(&setup)?;
    let mut marker = match &output {
        Output::Pictures(_) => Some(Marker::new(entry.name, &opened.device(), arguments.pixels())?),
        Output::Film(..) => None,
    };
    let mut stage = Stage { opened: Some(opened), method: None };

    let mut done = Rendered {
        scene: arguments.scene.clone(),
        frames: Vec::new(),
        rendered: 0,
        up_to_date: 0,
        milliseconds: 0.0,
    };
    let mut film: Option<Film> = None;
    let begun = Instant::now();
    for (index, &frame) in frames.iter().enumerate() {
        let name = format!("frame {frame}");
        let left = (done.rendered > 0).then(|| {
            let a_frame = begun.elapsed() / done.rendered as u32;
            let seconds = (a_frame * (frames.len() - index) as u32).as_secs();
            format!(", {} left", humantime::format_duration(Duration::from_secs(seconds)))
        });
        line.0.stage(&format!("{name} ({} of {}{})", index + 1, frames.len(), left.unwrap_or_default()));
        interrupt.check()?;
        let of_frame = |error: Error| error.of(&name);
        let mut mark = None;
        if let (Output::Pictures(names), Some(marker)) = (&output, &mut marker) {
            let path = names.of(frame);
            let inputs = sequence.inputs(frame).map_err(of_frame)?;
            let made = marker.mark(&inputs).map_err(of_frame)?;
            if !arguments.overwrite && mark::is_on(&path, &made) {
                done.frames.push(RenderedFrame { frame, output: path, report: None });
                done.up_to_date += 1;
                continue;
            }
            mark = Some(made);
        }

        let size = arguments.pixels();
        let next = frames.get(index + 1).copied();
        let Drawn { image, backdrop, mut report } =
            stage.render(&mut sequence, frame, next, size, progress.as_ref()).map_err(of_frame)?;
        let mut watch = Stopwatch::start();
        let path = match &output {
            Output::Pictures(names) => {
                let path = names.of(frame);
                file::write_marked(&path, &image, &backdrop, mark.as_deref())?;
                path
            }
            Output::Film(format, path) => {
                let size = [image.width, image.height];
                moving::check_size(*format, size)?;
                film.get_or_insert_with(|| Film::new(*format, timeline, size))
                    .add(&image, &backdrop)
                    .map_err(of_frame)?;
                path.clone()
            }
        };
        watch.lap("write");
        report.stages.extend(watch.finish());
        done.frames.push(RenderedFrame { frame, output: path, report: Some(report) });
        done.rendered += 1;
        check_messages(messages.as_ref())?;
    }
    if let (Some(film), Output::Film(_, path)) = (film, &output) {
        line.0.stage("writing the film");
        film.write(path)?;
    }
    drop(stage);
    check_messages(messages.as_ref())?;
    Ok(done)
}
