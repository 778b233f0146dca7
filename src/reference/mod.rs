//! The f64 reference integrator: what every other method is measured against.
//!
//! It evaluates the volume rendering integral (absorption plus emission: N. Max, *Optical models for direct volume
//! rendering*, 1995, section 4) of the medium of Dufort, Leblanc and Poulin 2005, section 4.3, along each pixel's ray on
//! the CPU, in f64, to [`TOLERANCE`], and was derived from that integral, from no shader:
//!
//! ```text
//!   C = integral of T(s) sigma(s) c(s) ds      T(s) = exp(-integral of sigma from the near plane to s)
//!   sigma = -ln(1 - alpha) / opacity_distance  c = P / alpha      (P, alpha): the texture, premultiplied
//! ```
//!
//! - `hierarchy`: what may lie on a ray, by bounding volumes;
//! - `crossing`: which tetrahedra lie on it, by clipping;
//! - `texture`: the texture along the ray, a cubic in each cell of texel centres;
//! - `layer`: the same in one tetrahedron, at the level of detail that the ray asks for;
//! - `shade`: in a lit scene the colour that the texture has at a point;
//! - `solids`: which opaque triangle ends the ray, and its colour;
//! - `shadow`: what reaches a point from a light that casts shadows;
//! - `penumbra`, `umbra`: the same along the eye's ray, through the medium and past solids;
//! - `quadrature`: the nested rules of panels;
//! - `integrate`: the coupled integral along the ray, with its error control;
//! - `supersample`: pixels of many rays, for filters to be measured against.
//!
//! Rays are measured by *depth* `z` along the camera's forward axis. Where tetrahedra overlap, in a shell
//! that intersects itself, their media add. A texel cell whose eight corners all have alpha 1 is a wall: what
//! reaches it sees its colour there, and nothing behind it; what reaches a solid sees the solid's. In a scene in which a light casts
//! shadows the error is at most [`SHADOW_TOLERANCE`].

mod crossing;
mod hierarchy;
mod integrate;
mod layer;
mod penumbra;
mod quadrature;
mod shade;
mod shadow;
mod solids;
mod supersample;
mod texture;
mod umbra;

pub use supersample::render_supersampled;

use std::sync::atomic::{AtomicU32, Ordering};

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::Result;
use crate::frame::{Frame, Image, Report, Stopwatch};
use crate::progress::{Interrupt, Progress};
use crate::scene::{Scene, View};

use crossing::{Crossing, Crossings};
use hierarchy::Path;
use integrate::RayIntegral;
use quadrature::Rule;
use shade::Lit;
use shadow::Shadows;
use solids::{Hit, Solids};

/// Largest absolute error of premultiplied red, green, blue and alpha.
pub const TOLERANCE: f64 = 1e-9;

/// The same in a scene in which a light casts shadows.
///
/// What the medium lets through to a point has kinks wherever the path to the light passes an edge of the shell or of a tetrahedron
/// whose level of detail is another: to halve a stretch around each until it is straight takes a few paths more for
/// every digit. It is a 400th of what 8 bits can tell, and far below the error of shadows that are read from a picture with pixels.
pub const SHADOW_TOLERANCE: f64 = 1e-5;

/// The largest absolute error with which a scene's picture is computed where nothing else is asked for.
pub fn tolerance(scene: &Scene) -> f64 {
    if scene.casts_shadows() { SHADOW_TOLERANCE } else { TOLERANCE }
}

/// What one ray sees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Linear premultiplied red, green, blue and alpha.
    pub rgba: [f64; 4],
    /// Mean distance from the eye, in world units, at which light was stopped,
    /// `integral of T sigma s ds / alpha`; infinite where alpha is 0.
    pub depth: f64,
}

/// A scene prepared for rays from one eye.
pub struct Reference<'a> {
    scene: &'a Scene,
    view: View,
    lod_footprint: f64,
    tolerance: f64,
    /// The largest colour (premultiplied by nothing) of any point, at least 1.
    brightness: f64,
    lit: Option<Lit<'a>>,
    shadows: Option<Shadows>,
    rule: Rule,
    crossings: Crossings,
    solids: Solids<'a>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Counts {
    rays: u64,
    segments: u64,
    panels: u64,
    shadow_paths: u64,
}

impl Counts {
    fn add(self, other: Self) -> Self {
        Self {
            rays: self.rays + other.rays,
            segments: self.segments + other.segments,
            panels: self.panels + other.panels,
            shadow_paths: self.shadow_paths + other.shadow_paths,
        }
    }
}

impl<'a> Reference<'a> {
    /// Prepares the scene for the eye of `view`; `scene.view` is not read.
    pub fn new(scene: &'a Scene, view: &View) -> Self {
        let (eye, unlit) = (view.camera.eye, unlit_brightness(scene));
        Self {
            scene,
            view: *view,
            lod_footprint: scene.medium.lod_footprint,
            tolerance: tolerance(scene),
            brightness: brightness(scene, unlit),
            lit: Lit::of(scene),
            shadows: Shadows::of(scene, eye, unlit),
            rule: Rule::new(),
            crossings: Crossings::new(&scene.shell, eye),
            solids: Solids::new(scene, eye),
        }
    }

    /// The same with another largest error than [`TOLERANCE`]; positive. Below 1e-12 rounding rules.
    #[must_use]
    pub fn with_tolerance(self, tolerance: f64) -> Self {
        Self { tolerance, ..self }
    }

    /// The same with another footprint than the medium's: see [`Medium::lod_footprint`](crate::scene::Medium::lod_footprint).
    #[must_use]
    pub fn with_lod_footprint(self, lod_footprint: f64) -> Self {
        Self { lod_footprint, ..self }
    }

    /// The ray through the centre of pixel `(x, y)`.
    pub fn pixel(&self, x: u32, y: u32) -> Sample {
        self.integrate_ray(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5))
    }

    /// The ray through a point of the picture, in pixels: `(x + 0.5, y + 0.5)` is a pixel's centre.
    pub fn integrate_ray(&self, point: DVec2) -> Sample {
        self.integrate(self.view.ray_at_unit_depth(point)).0
    }

    /// The length, in world units, of the same ray inside the shell and beyond the near plane: the sum over
    /// tetrahedra, so that what overlaps counts as often as it is covered.
    pub fn path_length(&self, point: DVec2) -> f64 {
        let direction = self.view.ray_at_unit_depth(point);
        let (crossings, _) = self.meet(direction);
        direction.length() * crossings.iter().map(|crossing| crossing.exit - crossing.enter).sum::<f64>()
    }

    fn integrate(&self, direction: DVec3) -> (Sample, Counts) {
        let (crossings, solid) = self.meet(direction);
        RayIntegral::evaluate(self, direction, &crossings, solid.as_ref())
    }

    /// The first triangle of a solid on the eye's ray, and the tetrahedra before it.
    fn meet(&self, direction: DVec3) -> (Vec<Crossing>, Option<Hit>) {
        let mut path = Path::of_eye(&self.view, direction);
        let solid = self.solids.first(&path);
        if let Some(hit) = solid {
            path.to = hit.place;
        }
        let mut crossings = Vec::new();
        self.crossings.find(&path, &mut crossings);
        (crossings, solid)
    }

    /// The part of the tolerance that is for panels along the eye's ray.
    fn panels_tolerance(&self) -> f64 {
        if self.shadows.is_some() { shadow::OF_PANELS * self.tolerance } else { self.tolerance }
    }
}

/// Renders `view` of the scene (`scene.view` is not read) on all threads of the current rayon pool. The
/// picture does not depend on their number.
///
/// # Errors
/// [`Error::Interrupted`](crate::Error::Interrupted) soon after the flag is set.
pub fn render(scene: &Scene, view: &View, progress: &dyn Progress, interrupt: &Interrupt) -> Result<Frame> {
    render_thinned(scene, view, 1, progress, interrupt)
}

/// As [`render`], of the pixels alone that [`Image::thinned`] keeps: a smaller picture of as large a view. `every`: at least 1.
///
/// # Errors
/// As [`render`].
pub fn render_thinned(
    scene: &Scene,
    view: &View,
    every: u32,
    progress: &dyn Progress,
    interrupt: &Interrupt,
) -> Result<Frame> {
    let mut stopwatch = Stopwatch::start();
    progress.stage("building the bounding volume hierarchy");
    let reference = Reference::new(scene, view);
    stopwatch.lap("hierarchy");

    let sample = |x: u32, y: u32, counts: &mut Counts| {
        let [x, y] = [x, y].map(|place| f64::from(place * every + every / 2) + 0.5);
        let point = DVec2::new(x, y);
        let (sample, added) = reference.integrate(view.ray_at_unit_depth(point));
        *counts = counts.add(added);
        sample
    };
    let thinned = View { width: view.width / every, height: view.height / every, ..*view };
    let (samples, counts) = of_all_pixels(&thinned, progress, interrupt, sample)?;
    stopwatch.lap("integrate");

    let depth = view.depth.then(|| samples.iter().map(|sample| sample.depth as f32).collect());
    let rgba = samples.iter().map(|sample| sample.rgba.map(|channel| channel as f32)).collect();
    let image = Image { width: thinned.width, height: thinned.height, rgba };
    let report = report(stopwatch, counts, &image);
    Ok(Frame { image, depth, report })
}

/// Evaluates every pixel of a view, row by row from the top left, on all threads of the current rayon pool; `pixel` adds to the
/// counts what it cost.
fn of_all_pixels<T: Send>(
    view: &View,
    progress: &dyn Progress,
    interrupt: &Interrupt,
    pixel: impl Fn(u32, u32, &mut Counts) -> T + Sync,
) -> Result<(Vec<T>, Counts)> {
    progress.stage("integrating rays");
    let rows_done = AtomicU32::new(0);
    let row = |y: u32| -> Result<(Vec<T>, Counts)> {
        let mut counts = Counts::default();
        let evaluate = |x| interrupt.check().map(|()| pixel(x, y, &mut counts));
        let pixels = (0..view.width).map(evaluate).collect::<Result<_>>()?;
        let done = rows_done.fetch_add(1, Ordering::Relaxed) + 1;
        progress.fraction(f64::from(done) / f64::from(view.height));
        Ok((pixels, counts))
    };
    let rows: Vec<_> = (0..view.height).into_par_iter().map(row).collect::<Result<_>>()?;
    let counts = rows.iter().fold(Counts::default(), |sum, (_, counts)| sum.add(*counts));
    Ok((rows.into_iter().flat_map(|(pixels, _)| pixels).collect(), counts))
}

fn report(stopwatch: Stopwatch, counts: Counts, image: &Image) -> Report {
    let covered = image.rgba.iter().filter(|pixel| pixel[3] > 0.0).count() as u64;
    let counts = [
        ("rays", counts.rays),
        ("segments", counts.segments),
        ("panels", counts.panels),
        ("shadow_paths", counts.shadow_paths),
        ("pixels_covered", covered),
    ];
    Report {
        method: "reference".into(),
        device: "cpu".into(),
        stages: stopwatch.finish(),
        counts: counts.map(|(name, count)| (name.to_owned(), count)).into(),
        ..Report::default()
    }
}

/// The largest ratio of premultiplied colour to alpha over all texels that have alpha, or colour of a solid, at least 1, unlit.
/// An interpolated colour is a weighted mean of such ratios, so nothing in the scene is brighter.
fn unlit_brightness(scene: &Scene) -> f64 {
    let texels = scene.volume.levels.par_iter().flat_map(|level| level.texels.par_iter());
    let visible = texels.filter(|texel| texel[3] > 0.0);
    let of_volume = visible
        .map(|texel| f64::from(texel[0].max(texel[1]).max(texel[2])) / f64::from(texel[3]))
        .reduce(|| 1.0, f64::max);
    of_volume.max(solids::brightness(&scene.solids))
}

/// The same as it may be lit.
fn brightness(scene: &Scene, unlit: f64) -> f64 {
    scene.shading.as_ref().map_or(unlit, |shading| {
        let (factor, added) = shading.bounds();
        (factor * unlit + added).max(1.0)
    })
}
