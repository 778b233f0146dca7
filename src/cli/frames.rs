//! `mesoshell render --frames`: many frames of an animated scene in one process, to pictures that a later run finds up to date, or to
//! a film.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use mesoshell::film::mark::{self, Marker};
use mesoshell::film::moving::{self, FilmFormat};
use mesoshell::film::{Film, Names};
use mesoshell::frame::{Backdrop, Frame, Image, Report, Stopwatch, file};
use mesoshell::gpu::Messages;
use mesoshell::method::{self, Method, Opened, Setup};
use mesoshell::progress::{Interrupt, Progress, Silent};
use mesoshell::scene::{Loaded, Scene, Sequence, Sizes, Skip};
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
    /// A frame's scene, made while the frame before was drawn.
    ahead: Option<(u32, Result<Loaded>)>,
    last: Option<(Arc<Scene>, Arc<Image>, Report)>,
}

/// A frame that is to be rendered.
struct Wanted {
    index: usize,
    frame: u32,
    mark: Option<String>,
}

/// The frames that are asked for.
struct Queue<'a> {
    frames: &'a [u32],
    next: usize,
    /// Of pictures, that may be up to date: their names, and what makes their marks.
    pictures: Option<(&'a Names, Marker)>,
    overwrite: bool,
    up_to_date: Vec<u32>,
    interrupt: &'a Interrupt,
}

impl Queue<'_> {
    /// The next that is not up to date.
    fn next(&mut self, sequence: &Sequence) -> Option<Result<Wanted>> {
        while let Some(&frame) = self.frames.get(self.next) {
            if let Err(error) = self.interrupt.check() {
                return Some(Err(error));
            }
            self.next += 1;
            let wanted = |mark| Wanted { index: self.next - 1, frame, mark };
            let Some((names, marker)) = &mut self.pictures else { return Some(Ok(wanted(None))) };
            match sequence.inputs(frame).and_then(|inputs| marker.mark(&inputs)) {
                Err(error) => return Some(Err(error.of(&name(frame)))),
                Ok(mark) if !self.overwrite && mark::is_on(&names.of(frame), &mark) => {
                    self.up_to_date.push(frame);
                }
                Ok(mark) => return Some(Ok(wanted(Some(mark)))),
            }
        }
        None
    }
}

/// Of a frame, for people.
fn name(frame: u32) -> String {
    format!("frame {frame}")
}

struct Drawn {
    image: Arc<Image>,
    backdrop: Backdrop,
    report: Report,
}

impl Stage {
    /// Meanwhile the scene of the frame `next` is made, on a thread of its own: two are in memory then.
    fn render(
        &mut self,
        sequence: &mut Sequence,
        frame: u32,
        next: Option<u32>,
        size: Option<[u32; 2]>,
        progress: &dyn Progress,
        interrupt: &Interrupt,
    ) -> Result<Drawn> {
        let admit = |sizes: &Sizes| match &self.opened {
            Some(opened) => opened.admit(&Sizes { picture: size.unwrap_or(sizes.picture), ..*sizes }),
            None => Ok(()),
        };
        let loaded = match self.ahead.take() {
            Some((of, loaded)) if of == frame => loaded,
            _ => sequence.at(frame, progress, &admit),
        };
        let Loaded { mut scene, backdrop, mut stages, .. } = loaded?;
        [scene.view.width, scene.view.height] = size.unwrap_or([scene.view.width, scene.view.height]);
        // Taken, so that the scene before is gone while the next one is made.
        if let Some((last, image, report)) =
            self.last.take().filter(|(last, ..)| scene.skips.allow(Skip::Kept) && scene.shows_the_same(last))
        {
            let skipped = vec!["the picture is kept: nothing differs from the frame before".to_owned()];
            let told = Report { stages, skipped, ..report.clone() };
            self.last = Some((last, image.clone(), report));
            return Ok(Drawn { image, backdrop, report: told });
        }
        let view = scene.view;
        let scene = Arc::new(scene);
        let kept = scene.clone();
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
        let (drawn, ahead) = thread::scope(|scope| {
            let ahead = next
                .map(|next| scope.spawn(move || (next, sequence.at(next, &Silent, &|_| interrupt.check()))));
            let drawn = method.render(&view);
            (drawn, ahead.map(|ahead| ahead.join().expect("the making of scenes does not panic")))
        });
        self.ahead = ahead;
        let Frame { image, mut report, .. } = drawn?;
        stages.append(&mut report.stages);
        report.stages = stages;
        let image = Arc::new(image);
        self.last = Some((kept, image.clone(), report.clone()));
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
            help: Some(
                "choose it for one frame, and give its step and ends by -D march.step=S -D march.end_below=E"
                    .into(),
            ),
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
    progress.stage("opening the device");
    let opened = (entry.open)(&setup)?;
    let pictures = match &output {
        Output::Pictures(names) => {
            Some((names, Marker::new(entry.name, &opened.device(), arguments.pixels())?))
        }
        Output::Film(..) => None,
    };
    let mut queue = Queue {
        frames: &frames,
        next: 0,
        pictures,
        overwrite: arguments.overwrite,
        up_to_date: Vec::new(),
        interrupt,
    };
    let mut stage = Stage { opened: Some(opened), method: None, ahead: None, last: None };

    let mut done = Rendered {
        scene: arguments.scene.clone(),
        frames: Vec::new(),
        rendered: 0,
        up_to_date: 0,
        milliseconds: 0.0,
    };
    let mut film: Option<Film> = None;
    let begun = Instant::now();
    line.0.stage("looking which frames are up to date");
    let mut coming = queue.next(&sequence);
    while let Some(wanted) = coming {
        let Wanted { index, frame, mark } = wanted?;
        let left = (done.rendered > 0).then(|| {
            let a_frame = begun.elapsed() / done.rendered as u32;
            let seconds = (a_frame * (frames.len() - index) as u32).as_secs();
            format!(", {} left", humantime::format_duration(Duration::from_secs(seconds)))
        });
        let name = name(frame);
        line.0.stage(&format!("{name} ({} of {}{})", index + 1, frames.len(), left.unwrap_or_default()));
        interrupt.check()?;
        let of_frame = |error: Error| error.of(&name);
        // What keeps the frame after this one from being drawn is told when this one is kept.
        coming = queue.next(&sequence);
        let next = coming.as_ref().and_then(|wanted| wanted.as_ref().ok()).map(|wanted| wanted.frame);
        let Drawn { image, backdrop, mut report } = stage
            .render(&mut sequence, frame, next, arguments.pixels(), progress.as_ref(), interrupt)
            .map_err(of_frame)?;
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
    if let Output::Pictures(names) = &output {
        done.up_to_date = queue.up_to_date.len();
        let kept = |&frame: &u32| RenderedFrame { frame, output: names.of(frame), report: None };
        done.frames.extend(queue.up_to_date.iter().map(kept));
        done.frames.sort_by_key(|one| one.frame);
    }
    Ok(done)
}
