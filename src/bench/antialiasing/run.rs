//! Renders every scene from every distance by every filter, and compares.

use std::path::PathBuf;
use std::sync::Arc;

use super::report::{csv, html};
use super::results::{self, Picture, Point, Results, SceneResults};
use super::sweep::Sweep;
use crate::bench::cache::{self, Cached};
use crate::bench::file::write_whole;
use crate::bench::sweep::overrides;
use crate::bench::{Environment, Options};
use crate::fingerprint::Fingerprint;
use crate::frame::{Backdrop, Image};
use crate::gpu::Gpu;
use crate::method::{METHODS, Setup};
use crate::progress::{Progress, Silent};
use crate::scene::{self, Camera, March, Scene, View};
use crate::{Result, metric, reference};

/// Of each ray of a reference. Thousands of times below the errors that filters make, and the mean of a pixel's rays errs less.
const TOLERANCE: f64 = 1e-5;

/// The part of a scene's time that references take, roughly, for the progress alone.
const REFERENCES_PART: f64 = 0.8;

/// What a benchmark of antialiasing ended with.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// What was measured; `antialiasing.json` holds the same.
    pub results: Results,
    /// What the user should know, each a sentence.
    pub warnings: Vec<String>,
    /// The report in HTML.
    pub report: PathBuf,
}

/// The pictures of a scene.
pub struct Pictures {
    /// From each distance.
    pub references: Vec<Image>,
    /// By each filter, from each distance.
    pub filtered: Vec<Vec<Image>>,
    /// On which they are laid.
    pub backdrop: Backdrop,
}

/// Measures a sweep and writes `antialiasing.json`, `antialiasing.csv` and `antialiasing.html`. References are kept, so that an
/// interrupted run loses little; [`Options::resume`] is not read.
///
/// # Errors
/// Whatever stands between a scene and its picture; [`Error::Output`](crate::Error::Output).
pub fn run(sweep: &Sweep, options: &Options<'_>, setup: &Setup<'_>) -> Result<Outcome> {
    let device = Gpu::open(setup.device, setup.validation)?.info().clone();
    let overrides = overrides(sweep.size, &sweep.define);
    let mut results = Results {
        schema: results::SCHEMA,
        sweep: sweep.clone(),
        environment: Environment::here(&device),
        scenes: Vec::new(),
        means: Vec::new(),
    };
    let mut warnings = Vec::new();
    let mut pictures = Vec::new();
    for (index, path) in sweep.scenes.iter().enumerate() {
        setup.progress.stage(&format!("loading {}", path.display()));
        setup.interrupt.check()?;
        let loaded = scene::load(path, &overrides, &Silent)?;
        let bench = Bench { sweep, options, setup, done: (index, sweep.scenes.len()) };
        let scene = Scene { march: March::Default { step: sweep.step }, ..loaded.scene };
        let mut of_scene = SceneResults { scene: path.clone(), pictures: Vec::new() };
        pictures.push(bench.measure(scene, loaded.backdrop, &mut of_scene, &mut warnings)?);
        results.scenes.push(of_scene);
    }
    results.means = results::means(sweep, &results.scenes);

    let write = |name: &str, bytes: &[u8]| {
        let path = options.out.join(name);
        write_whole(&path, |file| std::io::Write::write_all(file, bytes)).map(|()| path)
    };
    let json = serde_json::to_vec_pretty(&results).expect("numbers, strings and lists");
    write("antialiasing.json", &json)?;
    write("antialiasing.csv", csv(&results).as_bytes())?;
    let report = write("antialiasing.html", html(&results, &pictures).as_bytes())?;
    Ok(Outcome { results, warnings, report })
}

/// What the measurement of a scene needs.
struct Bench<'a> {
    sweep: &'a Sweep,
    options: &'a Options<'a>,
    setup: &'a Setup<'a>,
    /// Scenes done, and all of them.
    done: (usize, usize),
}

impl Bench<'_> {
    fn measure(
        &self,
        mut scene: Scene,
        backdrop: Backdrop,
        results: &mut SceneResults,
        warnings: &mut Vec<String>,
    ) -> Result<Pictures> {
        let name = results.name();
        let views: Vec<View> = self.sweep.distances.iter().map(|&k| view_from(&scene.view, k)).collect();
        let mut references = Vec::new();
        for (view, &distance) in views.iter().zip(&self.sweep.distances) {
            let stage = format!("{name} from {distance}: reference");
            let cached = self.reference(&scene, view, &views, &stage, warnings)?;
            results.pictures.push(Picture {
                distance,
                width: view.width,
                height: view.height,
                level: median_level(&scene, view),
                reference_milliseconds: cached.milliseconds,
                reference_reused: cached.reused,
                points: Vec::new(),
            });
            references.push(cached.image);
        }
        let mut filtered = Vec::new();
        for (index, &filter) in self.sweep.filters.iter().enumerate() {
            let part = index as f64 / self.sweep.filters.len() as f64;
            self.tell(REFERENCES_PART + (1.0 - REFERENCES_PART) * part);
            self.setup.progress.stage(&format!("{name}: {}", filter.name()));
            scene.volume = Arc::new(scene.filtered(filter));
            let silent: Arc<dyn Progress> = Arc::new(Silent);
            let setup = Setup { progress: &silent, ..*self.setup };
            let mut method = METHODS[0].prepare(Arc::new(scene.clone()), &setup)?;
            let images =
                views.iter().map(|view| Ok(method.render(view)?.image)).collect::<Result<Vec<_>>>()?;
            for ((image, reference), picture) in images.iter().zip(&references).zip(&mut results.pictures) {
                let error = metric::compare_over(image, reference, backdrop.flat_colour())?.metrics;
                picture.points.push(Point::new(filter, error, image, reference));
            }
            filtered.push(images);
        }
        Ok(Pictures { references, filtered, backdrop })
    }

    /// The picture of many rays a pixel, from the cache where it is there.
    fn reference(
        &self,
        scene: &Scene,
        view: &View,
        views: &[View],
        stage: &str,
        warnings: &mut Vec<String>,
    ) -> Result<Cached> {
        let pixels = |view: &View| f64::from(view.width) * f64::from(view.height);
        let all: f64 = views.iter().map(pixels).sum();
        let before: f64 = views.iter().take_while(|&other| other != view).map(pixels).sum();
        let progress =
            ReferenceProgress { bench: self, stage, before: before / all, part: pixels(view) / all };
        let side = self.sweep.rays.isqrt();
        let fingerprint = Fingerprint::of_supersampled(scene, view, side, TOLERANCE);
        let render = || {
            let interrupt = self.setup.interrupt;
            reference::render_supersampled(scene, view, side, TOLERANCE, &progress, interrupt)
        };
        cache::kept(&fingerprint, [view.width, view.height], self.options.cache, warnings, render)
    }

    /// Tells the part of this scene that is done.
    fn tell(&self, part: f64) {
        let (done, all) = self.done;
        self.setup.progress.fraction((done as f64 + part) / all as f64);
    }
}

struct ReferenceProgress<'a> {
    bench: &'a Bench<'a>,
    stage: &'a str,
    /// Of all pixels: those of the pictures before, and of this.
    before: f64,
    part: f64,
}

impl Progress for ReferenceProgress<'_> {
    fn stage(&self, _: &str) {
        self.bench.setup.progress.stage(self.stage);
    }

    fn fraction(&self, done: f64) {
        self.bench.tell(REFERENCES_PART * (self.before + self.part * done));
    }
}

/// The view with the eye `distance` times as far from its target. Pixels keep their angle, so that one covers so many times as
/// much; the picture is cut to so many times fewer of them, by its field of view, as no more are needed.
fn view_from(view: &View, distance: f64) -> View {
    let Camera { eye, target, up, fov_y, near } = view.camera;
    let [width, height] = [view.width, view.height].map(|side| (f64::from(side) / distance).ceil() as u32);
    let tangent = (0.5 * fov_y).tan() * f64::from(height) / f64::from(view.height);
    let camera = Camera {
        eye: target + distance * (eye - target),
        target,
        up,
        fov_y: 2.0 * tangent.atan(),
        near: distance * near,
    };
    View { camera, width, height, depth: false }
}

/// The median, over the tetrahedra, of the level of detail in their middles, as if they were all seen.
fn median_level(scene: &Scene, view: &View) -> f64 {
    let forward = view.camera.frame().forward;
    let pixel = scene.medium.lod_footprint * view.pixel_at_unit_depth();
    let shell = &scene.shell;
    let level = |(index, vertices): (usize, &[u32; 4])| {
        let middle = vertices.map(|vertex| shell.vertices[vertex as usize]).iter().sum::<glam::DVec3>() / 4.0;
        let towards = middle - view.camera.eye;
        let last = scene.volume.levels.len() as f64 - 1.0;
        (towards.dot(forward) * pixel * scene.texels_across(index, towards)).log2().clamp(0.0, last)
    };
    let mut levels: Vec<f64> = shell.topology.tetrahedra.iter().enumerate().map(level).collect();
    levels.sort_by(f64::total_cmp);
    levels.get(levels.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use glam::{DVec2, DVec3};

    use super::*;

    #[test]
    fn from_farther_away_pixels_keep_their_angle() {
        let camera = Camera {
            eye: DVec3::new(1.0, 2.0, 4.0),
            target: DVec3::new(0.5, 0.0, 0.0),
            up: DVec3::Y,
            fov_y: 0.7,
            near: 0.1,
        };
        let view = View { camera, width: 64, height: 48, depth: false };
        let far = view_from(&view, 4.0);
        assert_eq!((far.width, far.height), (16, 12));
        assert!((far.pixel_at_unit_depth() / view.pixel_at_unit_depth() - 1.0).abs() < 1e-12);
        let distances = [view, far].map(|view| view.camera.eye.distance(view.camera.target));
        assert!((distances[1] / distances[0] - 4.0).abs() < 1e-12 && far.camera.near == 0.4);
        // Middles stay in the middle.
        let [near_ray, far_ray] = [(view, [32.0, 24.0]), (far, [8.0, 6.0])]
            .map(|(view, point)| view.ray_at_unit_depth(DVec2::from_array(point)));
        assert!(near_ray.distance(far_ray) < 1e-12);
        assert_eq!(view_from(&view, 1.0).width, 64);
        assert_eq!(view_from(&view, 1e6).height, 1);
    }
}
