//! The `shell` method: tetrahedra that each ray walks through (Garrity 1990), or that are sorted and rasterised (Dufort, Leblanc,
//! Poulin 2005), and marched. `plan.rs` tells which way is gone, and what is left out.
//!
//! A frame runs top to bottom in `Shell::render`: order, see (what depends on the eye), shadows (once), upload, solids, march,
//! read back. Deviations from the paper, and why: entry and exit are computed exactly per pixel within conservative outlines
//! ([`outline`], `glsl/shell.frag.glsl`), because interpolated ones inherit the rasteriser's snapping; an eye inside the
//! shell is then no special case; tetrahedra are drawn front to back into a floating-point target; and those that hide one
//! another in a cycle, or overlap, are resolved per pixel (`glsl/cycle.frag.glsl`), where they are too many on the host
//! (`left.rs`).

mod canvas;
mod constants;
mod left;
mod lens;
pub mod lit;
pub mod outline;
mod plan;
mod report;
pub mod seen;
pub mod shadows;
pub mod solids;
mod squares;
mod update;
mod volume;
mod walk;

use std::sync::{Arc, Weak};

pub use constants::ViewConstants;
use glam::DVec3;

use self::canvas::Canvas;
use self::lit::{Lit, LitView};
use self::seen::Seen;
use self::shadows::Shadows;
use self::solids::Solids;
use self::volume::DeviceVolume;
use self::walk::Ways;
use super::{Choice, Method, Setup};
use crate::frame::{Frame, Image, Stopwatch};
use crate::gpu::{Batch, Draw, Gpu, Sampled, draw};
use crate::order::{Crossings, Sorted, Sorter};
use crate::progress::{Interrupt, Progress};
use crate::scene::{Scene, Sizes, Skip, View, span};
use crate::shell::{self, Topology};
use crate::{Error, Result};

/// A scene on a device.
struct Shell {
    scene: Arc<Scene>,
    gpu: Arc<Gpu>,
    progress: Arc<dyn Progress>,
    interrupt: Interrupt,
    /// Once it was needed; of the topology that it was made for.
    sorter: Option<(Arc<Topology>, Sorter)>,
    /// Once they were needed.
    ways: Option<Ways>,
    volume: DeviceVolume,
    /// In a lit scene.
    lit: Option<Lit>,
    /// Once they were needed.
    shadows: Option<Shadows>,
    /// Where there are any.
    solids: Option<Solids>,
    /// The most that a ray passes in one tetrahedron.
    texels: f64,
    // What a frame of one size and kind needs, kept for the next frame.
    canvas: Option<Canvas>,
    last: Option<Last>,
    /// What the last update has kept, each a sentence.
    kept: Vec<String>,
}

/// How the shell was seen last.
struct Last {
    view: View,
    vertices: Arc<Vec<DVec3>>,
    /// Whether rays were to walk: they have, unless they cross the boundary too often for the device.
    walks: bool,
    sight: Sight,
    /// And of what, unless that has changed; a shell that is no longer needed may go.
    seen: Option<(Seen, Weak<shell::Shell>)>,
}

/// In which order each ray meets the tetrahedra.
enum Sight {
    /// All rays in one.
    Sorted(Sorted),
    /// Each by itself, from where it enters.
    Walked(Crossings),
}

impl Sight {
    fn into_crossings(self) -> Option<Crossings> {
        match self {
            Self::Sorted(_) => None,
            Self::Walked(crossings) => Some(crossings),
        }
    }
}

/// A device without a scene.
struct Opened {
    gpu: Arc<Gpu>,
    progress: Arc<dyn Progress>,
    interrupt: Interrupt,
}

/// Opens the device.
///
/// # Errors
/// [`Error::Device`] where there is none.
pub fn open(setup: &Setup<'_>) -> Result<Box<dyn super::Opened>> {
    let gpu = Gpu::open(setup.device, setup.validation)?;
    // Most volumes ask; here it is known before they are loaded.
    gpu.blends_levels()?;
    Ok(Box::new(Opened { gpu, progress: setup.progress.clone(), interrupt: setup.interrupt.clone() }))
}

impl super::Opened for Opened {
    fn admit(&self, sizes: &Sizes) -> Result<()> {
        self.gpu.check_sizes(sizes.picture, sizes.volume)
    }

    fn device(&self) -> String {
        let info = self.gpu.info();
        format!("{}, {}", info.name, info.driver)
    }

    fn prepare(self: Box<Self>, scene: Arc<Scene>) -> Result<Box<dyn Method>> {
        let Self { gpu, progress, interrupt } = *self;
        let texels = longest_span(&scene)?;
        progress.stage("uploading the volume");
        let volume = DeviceVolume::new(&gpu, &scene)?;
        let lit = scene.shading.as_ref().map(|shading| Lit::new(&gpu, &scene.shell, shading)).transpose()?;
        let solids = Solids::new(&gpu, &scene.solids)?;
        Ok(Box::new(Shell {
            scene,
            gpu,
            progress,
            interrupt,
            sorter: None,
            ways: None,
            volume,
            lit,
            shadows: None,
            solids,
            texels,
            canvas: None,
            last: None,
            kept: Vec::new(),
        }))
    }
}

/// Those of a shell: kept, unless they are another topology's.
fn ways<'a>(kept: &'a mut Option<Ways>, shell: &shell::Shell) -> &'a mut Ways {
    let kept_ways = kept.take().filter(|ways| ways.are_of(shell));
    kept.insert(kept_ways.unwrap_or_else(|| Ways::new(&shell.topology)))
}

/// As [`ways`].
fn sorter<'a>(kept: &'a mut Option<(Arc<Topology>, Sorter)>, shell: &shell::Shell) -> &'a Sorter {
    let kept_sorter = kept.take().filter(|(topology, _)| Arc::ptr_eq(topology, &shell.topology));
    let new = || (shell.topology.clone(), Sorter::new(&shell.topology));
    &kept.insert(kept_sorter.unwrap_or_else(new)).1
}

impl Method for Shell {
    fn plan(&self) -> Vec<Choice> {
        self.choices()
    }

    fn render(&mut self, view: &View) -> Result<Frame> {
        let mut watch = Stopwatch::start();
        self.interrupt.check()?;
        let walks = self.walks(view);
        if !self.scene.skips.allow(Skip::Kept) {
            (self.last, self.shadows) = (None, None);
        }
        let is_same_sight = |last: &Last| {
            last.view == *view
                && Arc::ptr_eq(&last.vertices, &self.scene.shell.vertices)
                && last.walks == walks
        };
        let mut kept = std::mem::take(&mut self.kept);
        let mut spare = None;
        let (sight, seen) = match self.last.take() {
            Some(last) if is_same_sight(&last) => {
                kept.push("the order is kept: neither the geometry nor the camera has moved".into());
                (last.sight, last.seen)
            }
            last => {
                let mut spare_crossings = None;
                if let Some(last) = last {
                    spare = last.seen;
                    spare_crossings = last.sight.into_crossings();
                }
                let crossings = walks.then(|| {
                    self.progress.stage("finding where rays enter");
                    let ways = ways(&mut self.ways, &self.scene.shell);
                    Crossings::new(ways.faces(), &self.scene.shell, view, spare_crossings)
                });
                let sight = match crossings {
                    Some(crossings)
                        if walk::holds_crossings(self.gpu.most_texels(), &self.scene.shell, &crossings) =>
                    {
                        Sight::Walked(crossings)
                    }
                    _ => {
                        self.progress.stage("sorting the tetrahedra");
                        Sight::Sorted(
                            sorter(&mut self.sorter, &self.scene.shell).sort(&self.scene.shell, view),
                        )
                    }
                };
                watch.lap("order");
                if let Sight::Sorted(sorted) = &sight {
                    watch.add("order.relations", sorted.times.relations);
                    watch.add("order.abuffer", sorted.times.abuffer);
                    watch.add("order.search", sorted.times.search);
                }
                (sight, None)
            }
        };

        self.interrupt.check()?;
        let is_same_shell =
            seen.as_ref().is_some_and(|(_, shell)| shell.as_ptr() == Arc::as_ptr(&self.scene.shell));
        let is_uploaded = is_same_shell && self.canvas.is_some();
        let seen = match seen {
            Some((seen, _)) if is_same_shell => seen,
            seen => {
                self.progress.stage("mapping the view");
                let spare = seen.or(spare).map(|(seen, _)| seen);
                let subpixels = self.gpu.subpixels();
                let seen = match &sight {
                    Sight::Sorted(sorted) => Seen::new(&self.scene, sorted, view, subpixels, spare),
                    Sight::Walked(_) => Seen::all(&self.scene, view, subpixels, spare),
                };
                watch.lap("see");
                seen
            }
        };
        let keeps_shadows = self.shadows.is_some();
        let needs_shadows = self.scene.casts_shadows() && !keeps_shadows;
        if matches!(sight, Sight::Walked(_)) || needs_shadows {
            let ways = ways(&mut self.ways, &self.scene.shell);
            // Else no ray of a light walks, either.
            if walk::holds(self.gpu.most_texels(), &self.scene.shell, 0) {
                ways.place(&self.gpu, &self.scene.shell)?;
            }
        }
        if needs_shadows {
            self.progress.stage("drawing shadows");
            let ways = self.ways.as_ref().expect("made just now");
            self.shadows = Some(Shadows::draw(
                &self.gpu,
                &self.scene,
                &self.volume,
                ways,
                &*self.progress,
                &self.interrupt,
            )?);
            watch.lap("shadows");
        }
        self.progress.stage("uploading the view");
        let kind = self.kind(&sight, &seen, view);
        let canvas = self.canvas.take();
        let canvas = self.canvas(canvas, kind, &sight, &seen, view, is_uploaded)?;
        self.canvas = Some(canvas);
        let canvas = self.canvas.as_ref().expect("put there just now");
        watch.lap("upload");

        let constants = ViewConstants::of_eye(&self.scene, view, seen.unit, self.volume.even());
        let shadows = self.shadows.as_ref();
        let shadow_textures = shadows.map_or_else(Vec::new, Shadows::textures);
        if let (Some(solids), Some((solid_view, _))) = (&self.solids, &canvas.solids) {
            self.interrupt.check()?;
            self.progress.stage("drawing the solids");
            solid_view.draw(
                &self.gpu,
                &self.scene,
                solids,
                view,
                seen.unit,
                &constants,
                &canvas.lit.as_ref().map_or_else(Vec::new, LitView::lights),
                &shadow_textures,
                shadows.map_or(0.0, Shadows::widest_pixel),
                &self.interrupt,
            )?;
            watch.lap("solids");
        }
        self.interrupt.check()?;
        self.progress.stage("marching");
        let mut textures = self.volume.textures();
        textures.extend(self.lit.as_ref().map(|lit| (9, Sampled::Texture(&lit.directions))));
        textures.extend(shadow_textures);
        let mut batches = canvas.batches(&seen);
        if let Some((solids, layer)) = &canvas.solids {
            textures.extend(solids.textures());
            batches.push(Batch { pipeline: layer, vertices: 0..3 });
        }
        let times = draw(&Draw {
            target: &canvas.target,
            clears: true,
            buffers: &canvas.buffers(self.ways.as_ref()),
            textures: &textures,
            push_constants: bytemuck::bytes_of(&constants),
            batches: &batches,
            between: &|done| {
                self.progress.fraction(done);
                self.interrupt.check()
            },
        })?;
        watch.lap("march");
        if let Some(times) = times {
            watch.add("march.device", times.draw);
            watch.add("march.readback", times.readback);
        }
        self.interrupt.check()?;
        let mut rgba = canvas.target.read(0);
        let mut depth: Option<Vec<f32>> = view.depth.then(|| {
            let mean = |[weighted, _, _, alpha]: [f32; 4]| {
                if alpha > 0.0 { (seen.unit * f64::from(weighted / alpha)) as f32 } else { f32::INFINITY }
            };
            canvas.target.read(1).into_iter().map(mean).collect()
        });
        watch.lap("read");
        if shadows.is_some() {
            check_shadows(&rgba)?;
        }
        let left = left::fill(
            matches!(sight, Sight::Sorted(_)).then_some(&seen),
            &self.scene,
            view,
            &mut rgba,
            depth.as_deref_mut(),
            &*self.progress,
            &self.interrupt,
        )?;
        watch.lap("left");
        let mut report = self.report(&sight, &seen, &rgba);
        report.skipped.extend(kept);
        if keeps_shadows {
            report.skipped.push("shadows are kept: they do not depend on the camera".into());
        }
        report.counts.insert("pixels_left_to_host".to_owned(), left);
        report.stages = watch.finish();
        let (vertices, shell) = (self.scene.shell.vertices.clone(), Arc::downgrade(&self.scene.shell));
        self.last = Some(Last { view: *view, vertices, walks, sight, seen: Some((seen, shell)) });
        Ok(Frame { image: Image { width: view.width, height: view.height, rgba }, depth, report })
    }

    fn update(&mut self, scene: Arc<Scene>) -> Result<()> {
        self.take(scene)
    }

    fn forget(&mut self) {
        self.last = None;
    }
}

/// Pixels that are lit through more of the shell than a light's picture resolves have colours that are not finite: see
/// `glsl/include/shadows.glsl`. Of those that are left to the host alpha is not, either.
fn check_shadows(rgba: &[[f32; 4]]) -> Result<()> {
    let is_unresolved = |pixel: &&[f32; 4]| pixel[3].is_finite() && !pixel.iter().all(|x| x.is_finite());
    let unresolved = rgba.iter().filter(is_unresolved).count();
    if unresolved == 0 {
        return Ok(());
    }
    Err(Error::Device {
        message: format!(
            "{unresolved} pixels are lit through more of the shell than a pixel of a light's picture resolves"
        ),
        help: Some(
            "make shading.shadow_size larger or shell.uv_scale smaller, and keep the shell from folding: shell.thickness".into(),
        ),
    })
}

/// The most texels that a ray passes in one tetrahedron.
///
/// # Errors
/// [`Error::Usage`] where f32 does not resolve so many.
fn longest_span(scene: &Scene) -> Result<f64> {
    let size = scene.volume.levels[0].size;
    span::check(&scene.shell, size).map_err(|too_fine| Error::Usage {
        message: too_fine.to_string(),
        help: Some(span::TooFine::HELP.into()),
    })?;
    Ok(span::longest(&scene.shell, size))
}
