//! Renders every scene, compares, and writes the gallery.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use super::about::about;
use super::find::picture_names;
use super::page;
use super::results::{self, Drawn, Measured, Results, SceneResults, bound};
use super::sheet::{sheet, thumbnail};
use crate::bench::Environment;
use crate::bench::cache;
use crate::bench::file::{check_writable, write_whole};
use crate::bench::sweep::overrides;
use crate::fingerprint::Fingerprint;
use crate::frame::file::{check_numbers, write_png};
use crate::frame::{Backdrop, Image};
use crate::gpu::Gpu;
use crate::method::{METHODS, Method, Setup};
use crate::progress::{Progress, Silent};
use crate::scene::{self, Loaded, Scene, Sizes, View};
use crate::{Error, Result, input, metric, output, reference};

/// The page, and the sheet beside it.
const PAGE: &str = "index.html";
const SHEET: &str = "contact-sheet.png";

/// What a gallery is made of.
#[derive(Debug, Clone, Copy)]
pub struct Options<'a> {
    /// The folder of `index.html` and the pictures.
    pub out: &'a Path,
    /// The folder of the references' pictures.
    pub cache: &'a Path,
    /// Width and height instead of the scenes' own, in pixels.
    pub size: Option<[u32; 2]>,
    /// A picture that is compared with the reference is as large as fits in here, in pixels; without it none is.
    pub reference_size: Option<[u32; 2]>,
}

/// What a gallery ended with.
#[derive(Debug)]
pub struct Outcome {
    /// What was found.
    pub results: Results,
    /// Why scenes could not be rendered, in their order.
    pub failures: Vec<(PathBuf, Error)>,
    /// What the user should know, each a sentence.
    pub warnings: Vec<String>,
    /// The page.
    pub page: PathBuf,
}

/// Renders scenes and writes their pictures, `contact-sheet.png` and `index.html`.
///
/// All is written at the end: what ends the run before leaves an earlier gallery as it was. References are kept at once.
///
/// # Errors
/// [`Error::Device`] where there is no device, [`Error::Interrupted`], [`Error::Output`]. What is wrong with one scene is in the
/// [`Outcome`].
pub fn run(scenes: &[PathBuf], options: &Options<'_>, setup: &Setup<'_>) -> Result<Outcome> {
    let device = Gpu::open(setup.device, setup.validation)?.info().clone();
    let page_path = options.out.join(PAGE);
    check_writable(&page_path)?;
    let environment = Environment::here(&device);
    let mut results = Results { schema: results::SCHEMA, environment, scenes: Vec::new() };
    let (mut failures, mut warnings) = (Vec::new(), Vec::new());
    let (mut texts, mut pictures, mut thumbnails) = (Vec::new(), Vec::new(), Vec::new());
    for (index, (path, picture)) in scenes.iter().zip(picture_names(scenes, &[SHEET])).enumerate() {
        setup.interrupt.check()?;
        let text = input::text(path).ok();
        let about = text.as_deref().map(about).unwrap_or_default();
        let easel = Easel { path, picture, options, setup, at: (index + 1, scenes.len()) };
        match easel.paint(&mut warnings) {
            Ok(Painted { drawn, png, thumbnail }) => {
                pictures.push((drawn.picture.clone(), png));
                thumbnails.push(Some(thumbnail));
                results.scenes.push(SceneResults::drawn(path, about, drawn));
            }
            Err(error @ (Error::Interrupted | Error::Output { .. })) => return Err(error),
            Err(error) => {
                results.scenes.push(SceneResults::broken(path, about, error.to_string()));
                thumbnails.push(None);
                failures.push((path.clone(), error));
            }
        }
        texts.push(text);
    }

    setup.progress.stage("writing the gallery");
    let write =
        |name: &Path, bytes: &[u8]| write_whole(&options.out.join(name), |file| file.write_all(bytes));
    for (name, png) in &pictures {
        write(name, png)?;
    }
    let sheet_path = options.out.join(SHEET);
    write(SHEET.as_ref(), &png(&sheet_path, &sheet(&results, &thumbnails), &Backdrop::colour([0.0; 3]))?)?;
    write(PAGE.as_ref(), page::page(&results, &texts).as_bytes())?;
    Ok(Outcome { results, failures, warnings, page: page_path })
}

/// What the picture of a scene needs.
struct Easel<'a> {
    path: &'a Path,
    /// Within the gallery.
    picture: PathBuf,
    options: &'a Options<'a>,
    setup: &'a Setup<'a>,
    /// Which scene it is, from 1, and of how many.
    at: (usize, usize),
}

/// A scene that was rendered.
struct Painted {
    drawn: Drawn,
    png: Vec<u8>,
    thumbnail: Image,
}

impl Easel<'_> {
    fn paint(&self, warnings: &mut Vec<String>) -> Result<Painted> {
        let silent: Arc<dyn Progress> = Arc::new(Silent);
        let method = (METHODS[0].open)(&Setup { progress: &silent, ..*self.setup })?;
        self.stage("loading");
        let start = Instant::now();
        let admit = |sizes: &Sizes| method.admit(sizes);
        let overrides = overrides(self.options.size, &[]);
        let Loaded { scene, backdrop, .. } = scene::load_if(self.path, &overrides, &Silent, &admit)?;
        let scene = Arc::new(scene);
        let mut method = method.prepare(scene.clone())?;
        let load_milliseconds = milliseconds(start);

        self.setup.interrupt.check()?;
        self.stage("rendering");
        // In the first frame pipelines are compiled and buffers made.
        method.render(&scene.view)?;
        let start = Instant::now();
        method.forget();
        let frame = method.render(&scene.view)?;
        let frame_milliseconds = milliseconds(start);
        let told = frame.report.warnings.iter().map(|warning| format!("{}: {warning}", self.path.display()));
        warnings.extend(told);
        let error = match self.options.reference_size {
            Some(room) => Some(self.compare(&scene, method.as_mut(), room, &backdrop, warnings)?),
            None => None,
        };
        let View { width, height, .. } = scene.view;
        Ok(Painted {
            png: png(&self.options.out.join(&self.picture), &frame.image, &backdrop)?,
            thumbnail: thumbnail(&frame.image, &backdrop),
            drawn: Drawn {
                picture: self.picture.clone(),
                width,
                height,
                tetrahedra: scene.shell.topology.tetrahedra.len() as u64,
                load_milliseconds,
                frame_milliseconds,
                report: frame.report,
                bound: bound(&scene),
                error,
            },
        })
    }

    /// The same view in fewer pixels, by the method and by the reference.
    fn compare(
        &self,
        scene: &Scene,
        method: &mut dyn Method,
        room: [u32; 2],
        backdrop: &Backdrop,
        warnings: &mut Vec<String>,
    ) -> Result<Measured> {
        self.stage("comparing");
        let [width, height] = fitted([scene.view.width, scene.view.height], room);
        let view = View { width, height, ..scene.view };
        let image = method.render(&view)?.image;
        let fingerprint = Fingerprint::of_reference(scene, &view, 1);
        let render = || reference::render(scene, &view, &OfReference(self), self.setup.interrupt);
        let cached = cache::kept(&fingerprint, [width, height], self.options.cache, warnings, render)?;
        Ok(Measured {
            width,
            height,
            metrics: metric::compare_over(&image, &cached.image, backdrop.flat_colour())?.metrics,
            reference_milliseconds: cached.milliseconds,
            reference_reused: cached.reused,
        })
    }

    fn stage(&self, name: &str) {
        let (index, all) = self.at;
        self.setup.progress.stage(&format!("{} ({index} of {all}): {name}", self.path.display()));
    }
}

/// Tells the reference's progress.
struct OfReference<'a>(&'a Easel<'a>);

impl Progress for OfReference<'_> {
    /// They are told as one.
    fn stage(&self, _: &str) {}

    fn fraction(&self, done: f64) {
        self.0.setup.progress.fraction(done);
    }
}

/// The largest size of the same shape that fits into `room`, and is no larger than `size`.
fn fitted(size: [u32; 2], room: [u32; 2]) -> [u32; 2] {
    let scales = [0, 1].map(|axis| f64::from(room[axis]) / f64::from(size[axis]));
    let scale = scales[0].min(scales[1]).min(1.0);
    size.map(|side| ((scale * f64::from(side)).round() as u32).max(1))
}

fn png(path: &Path, image: &Image, backdrop: &Backdrop) -> Result<Vec<u8>> {
    // It is the picture that is at fault, not the file, which is not even opened: no reason to end the gallery.
    let of_picture = |error: Error| Error::Device { message: error.to_string(), help: None };
    check_numbers(path, image).map_err(of_picture)?;
    let mut png = Vec::new();
    write_png(&mut png, image, backdrop)
        .map_err(|error| of_picture(output::error(path, format!("cannot be encoded: {error}"))))?;
    Ok(png)
}

fn milliseconds(start: Instant) -> f64 {
    1e3 * start.elapsed().as_secs_f64()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// So that it is one scene that is broken, and the others are kept.
    #[test]
    fn a_picture_that_is_no_number_is_no_fault_of_the_output() {
        let image = Image { width: 1, height: 1, rgba: vec![[f32::NAN, 0.0, 0.0, 1.0]] };
        let error = png("a.png".as_ref(), &image, &Backdrop::default()).unwrap_err();
        assert!(matches!(error, Error::Device { .. }), "{error:?}");
        assert!(error.to_string().contains("a.png: pixel (0, 0) is not a number"), "{error}");
    }

    #[test]
    fn what_is_compared_keeps_its_shape() {
        let sizes = [
            ([512, 512], [256, 256]),
            ([1280, 720], [256, 144]),
            ([300, 900], [85, 256]),
            ([64, 48], [64, 48]),
            ([32768, 1], [256, 1]),
        ];
        for (size, expected) in sizes {
            assert_eq!(fitted(size, [256, 256]), expected);
        }
    }
}
