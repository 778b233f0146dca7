//! The `shell` method: sorted tetrahedra, rasterised and marched (Dufort, Leblanc, Poulin 2005).
//!
//! A frame runs top to bottom in `Shell::render`: order, see (what depends on the eye), shadows (once), upload, solids, march,
//! read back. Deviations from the paper, and why: entry and exit are computed exactly per pixel within conservative outlines
//! ([`outline`], `glsl/shell.frag.glsl`), because interpolated ones inherit the rasteriser's snapping; an eye inside the
//! shell is then no special case; tetrahedra are drawn front to back into a floating-point target; and those that hide one
//! another in a cycle, or overlap, are resolved per pixel (`glsl/cycle.frag.glsl`), where they are too many on the host
//! (`left.rs`).

mod left;
pub mod lit;
pub mod outline;
pub mod seen;
pub mod shadows;
pub mod solids;

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::DVec3;

use self::lit::{Lit, LitView, Sight};
use self::seen::{Run, Seen};
use self::shadows::Shadows;
use self::solids::{SolidView, Solids};
use super::{Method, Setup};
use crate::frame::{Frame, Image, Report, Stopwatch};
use crate::gpu::{
    Batch, Buffer, Draw, Gpu, Keeps, Pipeline, PipelineInfo, Sampled, Target, Texture3d, draw, shaders,
};
use crate::order::{Sorted, Sorter};
use crate::progress::{Interrupt, Progress};
use crate::scene::{March, Model, Scene, Sizes, View, span};
use crate::shell;
use crate::volume::{Pyramid, Quantity};
use crate::{Error, Result};

/// The push constants of `glsl/include/shell.glsl`: see there for each member.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "documented at the one declaration in glsl")]
pub struct ViewConstants {
    pub centre: [f32; 2],
    pub pixel: f32,
    pub near: f32,
    pub texels: [f32; 3],
    pub last_level: f32,
    pub lod_scale: f32,
    pub per_opacity_distance: f32,
    pub step: f32,
    pub samples: u32,
}

/// A scene on a device.
struct Shell {
    scene: Arc<Scene>,
    gpu: Arc<Gpu>,
    progress: Arc<dyn Progress>,
    interrupt: Interrupt,
    sorter: Sorter,
    volume: Texture3d,
    /// In a lit scene.
    lit: Option<Lit>,
    /// Once they were needed, and if a light casts any.
    shadows: Option<Option<Shadows>>,
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
    sorted: Sorted,
    /// And of what, unless that has changed.
    seen: Option<(Seen, Arc<shell::Shell>)>,
}

/// The target of a picture and the pipeline that draws into it.
struct Canvas {
    kind: CanvasKind,
    target: Target,
    sorted: Pipeline,
    /// For cycles, where there are any.
    cycle: Option<Pipeline>,
    cells: Buffer,
    tiles: Buffer,
    members: Buffer,
    /// In a lit scene.
    lit: Option<LitView>,
    /// Where there are solids: their picture, and what lays it behind the medium.
    solids: Option<(SolidView, Pipeline)>,
}

impl Canvas {
    /// By the binding that shaders name.
    fn buffers<'a>(&'a self, lit: Option<&'a Lit>) -> Vec<(u32, &'a Buffer)> {
        let mut buffers = vec![(0, &self.cells), (1, &self.tiles), (2, &self.members)];
        if let (Some(lit), Some(view)) = (lit, &self.lit) {
            buffers.extend([(3, &view.cells), (4, &lit.frames)]);
            buffers.extend(view.lights());
        }
        buffers
    }

    fn batch(&self, run: &Run) -> Batch<'_> {
        let (pipeline, quads) = match run {
            Run::Sorted(cells) => (&self.sorted, cells),
            Run::Cycle(tiles) => (self.cycle.as_ref().expect("built where there are cycles"), tiles),
        };
        Batch { pipeline, vertices: 6 * quads.start..6 * quads.end }
    }
}

/// What a canvas depends on.
#[derive(Debug, Clone, PartialEq)]
struct CanvasKind {
    width: u32,
    height: u32,
    depth: bool,
    cycles: bool,
    /// What is compiled into the shaders: what the scene has, and what is asked for.
    switches: Vec<&'static str>,
    /// Their specialisation constants.
    constants: Vec<u32>,
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
    setup.progress.stage("opening the device");
    let gpu = Gpu::open(setup.device, setup.validation)?;
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
        let volume = Texture3d::upload(&gpu, "the volume", &scene.volume)?;
        let lit = scene.shading.as_ref().map(|shading| Lit::new(&gpu, &scene.shell, shading)).transpose()?;
        let solids = Solids::new(&gpu, &scene.solids)?;
        let sorter = Sorter::new(&scene.shell.topology);
        Ok(Box::new(Shell {
            scene,
            gpu,
            progress,
            interrupt,
            sorter,
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

impl Method for Shell {
    fn render(&mut self, view: &View) -> Result<Frame> {
        let mut watch = Stopwatch::start();
        self.interrupt.check()?;
        let last = self.last.take().filter(|last| last.view == *view);
        let last = last.filter(|last| Arc::ptr_eq(&last.vertices, &self.scene.shell.vertices));
        let mut kept = std::mem::take(&mut self.kept);
        let (sorted, seen) = match last {
            Some(Last { sorted, seen, .. }) => {
                kept.push("the order is kept: neither the geometry nor the camera has moved".into());
                (sorted, seen)
            }
            None => {
                self.progress.stage("sorting the tetrahedra");
                let sorted = self.sorter.sort(&self.scene.shell, view);
                watch.lap("order");
                watch.add("order.relations", sorted.times.relations);
                watch.add("order.abuffer", sorted.times.abuffer);
                watch.add("order.search", sorted.times.search);
                (sorted, None)
            }
        };

        self.interrupt.check()?;
        let seen = seen.filter(|(_, shell)| Arc::ptr_eq(shell, &self.scene.shell));
        let is_uploaded = seen.is_some() && self.canvas.is_some();
        let seen = match seen {
            Some((seen, _)) => seen,
            None => {
                self.progress.stage("mapping the view");
                let seen = Seen::new(&self.scene, &sorted, view, self.gpu.subpixels());
                watch.lap("see");
                seen
            }
        };
        let keeps_shadows = self.shadows.is_some();
        if !keeps_shadows {
            let shadows =
                Shadows::draw(&self.gpu, &self.scene, &self.volume, &*self.progress, &self.interrupt)?;
            if shadows.is_some() {
                watch.lap("shadows");
            }
            self.shadows = Some(shadows);
        }
        self.progress.stage("uploading the view");
        let kind = self.kind(&seen, view);
        let canvas = self.canvas.take();
        let canvas = self.canvas(canvas, kind, &seen, view, is_uploaded)?;
        let canvas = &*self.canvas.insert(canvas);
        watch.lap("upload");

        let constants = constants(&self.scene, view, seen.unit);
        let shadows = self.shadows.iter().flatten().next();
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
        let mut textures = vec![(8, Sampled::Texture(&self.volume))];
        textures.extend(self.lit.as_ref().map(|lit| (9, Sampled::Texture(&lit.directions))));
        textures.extend(shadow_textures);
        let mut batches: Vec<Batch<'_>> = seen.runs.iter().map(|run| canvas.batch(run)).collect();
        if let Some((solids, layer)) = &canvas.solids {
            textures.extend(solids.textures());
            batches.push(Batch { pipeline: layer, vertices: 0..3 });
        }
        let times = draw(&Draw {
            target: &canvas.target,
            clears: true,
            buffers: &canvas.buffers(self.lit.as_ref()),
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
        let left = left::fill(
            &seen,
            &self.scene,
            view,
            &mut rgba,
            depth.as_deref_mut(),
            &*self.progress,
            &self.interrupt,
        )?;
        watch.lap("left");
        if shadows.is_some() {
            check_shadows(&rgba)?;
        }
        let mut report = self.report(&sorted, &seen, &rgba);
        report.skipped.extend(kept);
        if keeps_shadows && shadows.is_some() {
            report.skipped.push("shadows are kept: they do not depend on the camera".into());
        }
        report.counts.insert("pixels_left_to_host".to_owned(), left);
        report.stages = watch.finish();
        let (vertices, shell) = (self.scene.shell.vertices.clone(), self.scene.shell.clone());
        self.last = Some(Last { view: *view, vertices, sorted, seen: Some((seen, shell)) });
        Ok(Frame { image: Image { width: view.width, height: view.height, rgba }, depth, report })
    }

    fn update(&mut self, scene: Arc<Scene>) -> Result<()> {
        let before = &self.scene;
        let same_shell = Arc::ptr_eq(&before.shell, &scene.shell);
        let same_volume = Arc::ptr_eq(&before.volume, &scene.volume);
        let same_solids = Arc::ptr_eq(&before.solids, &scene.solids);
        let model = |scene: &Scene| scene.shading.as_ref().map(|shading| shading.model);
        let size = scene.volume.levels[0].size;
        let mut kept = Vec::new();
        let texels = if same_shell && size == before.volume.levels[0].size {
            self.texels
        } else {
            longest_span(&scene)?
        };

        let volume = if same_volume {
            kept.push("the volume is kept on the device: it is the same".to_owned());
            None
        } else {
            self.progress.stage("uploading the volume");
            Some(Texture3d::upload(&self.gpu, "the volume", &scene.volume)?)
        };
        let same_directions = match (&before.shading, &scene.shading) {
            (Some(a), Some(b)) => Arc::ptr_eq(&a.directions, &b.directions) && a.model == b.model,
            (None, None) => true,
            _ => false,
        };
        let lit = match &scene.shading {
            Some(shading) if !same_directions => Some(Lit::new(&self.gpu, &scene.shell, shading)?),
            _ => None,
        };
        let solids = if solids::have_same_textures(&before.solids, &scene.solids) {
            None
        } else {
            Some(Solids::new(&self.gpu, &scene.solids)?)
        };
        if let (Some(lit), Some(shading), true, false) =
            (&mut self.lit, &scene.shading, same_directions, same_shell)
        {
            lit.place(&scene.shell, shading)?;
        }

        // Nothing fails from here on.
        if same_directions {
            if scene.shading.is_some() {
                kept.push("the volume's directions are kept on the device: they are the same".to_owned());
            }
        } else {
            self.lit = lit;
        }
        if let Some(volume) = volume {
            self.volume = volume;
        }
        if let Some(solids) = solids {
            self.solids = solids;
        }
        if !(same_shell && same_volume && same_solids && has_same_shadows(before, &scene)) {
            self.shadows = None;
        }
        let same_topology = Arc::ptr_eq(&before.shell.topology, &scene.shell.topology);
        if !same_topology {
            self.sorter = Sorter::new(&scene.shell.topology);
            self.last = None;
        }
        if same_shell {
            kept.push("the shell is kept: nothing of it has moved".to_owned());
        } else if same_topology {
            kept.push("the shell's topology is kept: the triangles are the same".to_owned());
        }
        if let Some(last) = &mut self.last
            && (model(before) != model(&scene)
                || before.medium.lod_footprint != scene.medium.lod_footprint
                || size != before.volume.levels[0].size
                || scene.volume.levels.len() != before.volume.levels.len())
        {
            last.seen = None;
        }
        (self.texels, self.kept, self.scene) = (texels, kept, scene);
        Ok(())
    }

    fn forget(&mut self) {
        self.last = None;
    }
}

/// Pixels that are lit through more of the shell than a light's picture resolves are not finite: see `glsl/include/shadows.glsl`.
fn check_shadows(rgba: &[[f32; 4]]) -> Result<()> {
    let unresolved = rgba.iter().filter(|pixel| !pixel.iter().all(|x| x.is_finite())).count();
    if unresolved == 0 {
        return Ok(());
    }
    Err(Error::Device {
        message: format!(
            "{unresolved} pixels are lit through more of the shell than a pixel of a light's picture resolves"
        ),
        help: Some("make shading.shadow_size larger, or shell.uv_scale smaller".into()),
    })
}

/// Whether all that lights see of two scenes is alike, if shell, volume and solids are.
fn has_same_shadows(a: &Scene, b: &Scene) -> bool {
    let lights =
        |scene: &Scene| scene.shading.as_ref().map(|shading| (shading.lights.clone(), shading.shadow_size));
    lights(a) == lights(b) && a.medium == b.medium && a.march == b.march
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

impl Shell {
    /// The canvas for this frame, with what was seen in its buffers: the one of the frame before, where it is of that kind.
    /// `is_uploaded`: that has been seen in the frame before, too.
    fn canvas(
        &self,
        kept: Option<Canvas>,
        kind: CanvasKind,
        seen: &Seen,
        view: &View,
        is_uploaded: bool,
    ) -> Result<Canvas> {
        let Some(mut canvas) = kept.filter(|canvas| canvas.kind == kind) else {
            return self.new_canvas(kind, seen, view);
        };
        if !is_uploaded {
            canvas.cells.refill(&seen.cells)?;
            canvas.tiles.refill(&seen.tiles)?;
            canvas.members.refill(&seen.members)?;
        }
        if let (Some(lit), Some(kept), Some(sight)) = (&self.lit, &mut canvas.lit, self.sight(seen, view)) {
            kept.refill(lit, sight, !is_uploaded)?;
        }
        Ok(canvas)
    }

    /// In a lit scene.
    fn sight<'a>(&'a self, seen: &'a Seen, view: &'a View) -> Option<Sight<'a>> {
        let shadows = self.shadows.iter().flatten().next();
        let shading = self.scene.shading.as_ref()?;
        Some(Sight { shading, shadows, shell: &self.scene.shell, seen, view })
    }

    fn kind(&self, seen: &Seen, view: &View) -> CanvasKind {
        let has_shadows = self.shadows.iter().flatten().next().is_some();
        let switches = [
            ("DEPTH", view.depth),
            ("SOLIDS", self.solids.is_some()),
            ("LIT", self.lit.is_some()),
            ("SHADOWS", has_shadows),
        ];
        let mut constants = constants_of_volume(self.scene.march, seen.minified, &self.scene.volume).to_vec();
        if let Some(shading) = &self.scene.shading {
            constants.extend([shading.model == Model::Fibre, shading.emission.glow > 0.0].map(u32::from));
        }
        CanvasKind {
            width: view.width,
            height: view.height,
            depth: view.depth,
            cycles: !seen.tiles.is_empty(),
            switches: switches.into_iter().filter_map(|(name, is_on)| is_on.then_some(name)).collect(),
            constants,
        }
    }

    fn new_canvas(&self, kind: CanvasKind, seen: &Seen, view: &View) -> Result<Canvas> {
        let target = Target::new(&self.gpu, kind.width, kind.height, if kind.depth { 2 } else { 1 })?;
        let on = &kind.switches;
        let mut buffers = vec![0, 1, 2];
        let mut textures = vec![8];
        for &switch in on {
            let (more_buffers, more_textures): (&[u32], &[u32]) = match switch {
                "LIT" => (&[3, 4, 5], &[9]),
                "SHADOWS" => (&[6], &[10, 11, 12, 13]),
                "SOLIDS" => (&[], &[15]),
                _ => (&[], &[]),
            };
            buffers.extend(more_buffers);
            textures.extend(more_textures);
        }
        if on.contains(&"SHADOWS") && on.contains(&"SOLIDS") {
            textures.push(14);
        }
        let info = PipelineInfo {
            vertex: shaders::SHELL_VERT.with(on),
            fragment: shaders::SHELL_FRAG.with(on),
            constants: &kind.constants,
            storage_buffers: &buffers,
            textures: &textures,
            push_constant_bytes: size_of::<ViewConstants>() as u32,
            keeps: Keeps::Blend,
        };
        let sorted = Pipeline::new(&self.gpu, &target, &info)?;
        let of_cycles = PipelineInfo {
            vertex: shaders::TILE_VERT.with(on),
            fragment: shaders::CYCLE_FRAG.with(on),
            ..info
        };
        let cycle = kind.cycles.then(|| Pipeline::new(&self.gpu, &target, &of_cycles)).transpose()?;
        let solids = self.solids.as_ref().map(|_| {
            let layer = PipelineInfo {
                vertex: shaders::LAYER_VERT.with(on),
                fragment: shaders::LAYER_FRAG.with(on),
                constants: &[],
                storage_buffers: &[],
                textures: &[15, 16],
                ..info
            };
            Ok::<_, Error>((SolidView::new(&self.gpu, view, on)?, Pipeline::new(&self.gpu, &target, &layer)?))
        });
        let lit = match (&self.lit, self.sight(seen, view)) {
            (Some(lit), Some(sight)) => Some(LitView::new(&self.gpu, lit, sight)?),
            _ => None,
        };
        Ok(Canvas {
            kind,
            sorted,
            cycle,
            cells: Buffer::storage(&self.gpu, "the tetrahedra in order", &seen.cells)?,
            tiles: Buffer::storage(&self.gpu, "the tiles of cycles", &seen.tiles)?,
            members: Buffer::storage(&self.gpu, "the members of cycles", &seen.members)?,
            lit,
            solids: solids.transpose()?,
            target,
        })
    }

    fn report(&self, sorted: &Sorted, seen: &Seen, rgba: &[[f32; 4]]) -> Report {
        let health = self.scene.shell.health;
        let mut report =
            Report { method: "shell".into(), device: self.gpu.info().name.clone(), ..Report::default() };
        let mut count = |name: &str, value: u64| report.counts.insert(name.to_owned(), value);
        count("tetrahedra", health.tetrahedra);
        count("tetrahedra_drawn", seen.cells.len() as u64);
        count("face_relations", sorted.face_relations);
        count("image_relations", sorted.image_relations);
        count("cycles", sorted.order.cycles.len() as u64);
        count("tetrahedra_in_cycles", sorted.cycle_members);
        count("pixels_covered", rgba.iter().filter(|pixel| pixel[3] > 0.0).count() as u64);
        let triangles = self.scene.solids.iter().map(|solid| solid.mesh.triangles.len() as u64).sum::<u64>();
        if triangles > 0 {
            count("solid_triangles", triangles);
        }
        if let Some(shadows) = self.shadows.iter().flatten().next() {
            count("shadow_pictures", shadows.pictures() as u64);
        }
        if seen.before_near > 0 {
            report.skipped.push(format!("{} tetrahedra lie before the near plane", seen.before_near));
        }
        if seen.beside > 0 {
            report.skipped.push(format!("{} tetrahedra lie beside the picture", seen.beside));
        }
        if health.zero_volume > 0 {
            report.skipped.push(format!("{} tetrahedra have no volume", health.zero_volume));
        }
        if sorted.order.cycles.is_empty() {
            report
                .skipped
                .push("no tetrahedra hide one another in a cycle: nothing is resolved per pixel".into());
        }
        if !seen.minified {
            report.skipped.push("all is magnified: no level of detail but 0 is compiled in".into());
        }
        match (&self.scene.shading, &self.shadows) {
            (None, _) => report.skipped.push("the scene is unlit: nothing of light is compiled in".into()),
            (_, Some(None)) => {
                report.skipped.push("no light casts shadows: nothing of them is compiled in".into());
            }
            _ => {}
        }
        if health.inverted > 0 {
            report.warnings.push(format!(
                "{} of {} tetrahedra are inverted: the shell folds; make it thinner or smooth its directions",
                health.inverted, health.tetrahedra
            ));
        }
        let wanted = wanted_samples(self.scene.march, self.texels);
        if wanted > MOST_SAMPLES {
            report.warnings.push(format!(
                "a ray may pass {:.0} texels in one tetrahedron, and want {wanted:.0} samples there; it takes at most \
                 {MOST_SAMPLES}, so that what is seen there may be coarse or cut short: make shell.uv_scale smaller",
                self.texels
            ));
        }
        report
    }
}

/// Passes through loops that a ray makes in one tetrahedron at most: a bound of `sample_count` and `march_exactly` in
/// `glsl/include`, and of lavapipe, which ends all loops of a pixel there.
const MOST_SAMPLES: f64 = 65535.0;

/// How many samples the plan wants along a ray that passes so many texels of the full volume in a tetrahedron, at most.
fn wanted_samples(march: March, texels: f64) -> f64 {
    match march {
        March::Default { step } => texels / step,
        March::Paper { samples } => f64::from(samples),
        // A ray passes planes of texels on three axes, of two levels, and each piece may be cut in 16.
        March::Exact => 3.0 * (1.0 + 0.5) * 17.0 * texels,
    }
}

/// Texels a sample in cycles under the exact plan.
const CYCLE_STEP: f64 = 0.125;

/// The specialisation constant `PLAN` of `glsl/include/march.glsl`.
fn plan(march: March) -> u32 {
    match march {
        March::Default { .. } => 0,
        March::Paper { .. } => 1,
        March::Exact => 2,
    }
}

/// The specialisation constants of `glsl/include/sample.glsl`.
fn constants_of_volume(march: March, minified: bool, volume: &Pyramid) -> [u32; 3] {
    let is_extinction = volume.levels[0].quantity == Quantity::Extinction;
    [plan(march), u32::from(minified), u32::from(is_extinction)]
}

impl ViewConstants {
    /// What is known of a volume, and nothing else.
    fn of_volume(volume: &Pyramid) -> Self {
        Self {
            texels: volume.levels[0].size.map(|side| side as f32),
            last_level: (volume.levels.len() - 1) as f32,
            ..Self::zeroed()
        }
    }
}

/// `unit`: see [`Seen::unit`].
fn constants(scene: &Scene, view: &View, unit: f64) -> ViewConstants {
    let pixel = view.pixel_at_unit_depth();
    let (step, samples) = match scene.march {
        March::Paper { samples } => (1.0, samples),
        March::Default { step } => (step, 1),
        // Of cycles alone, which are always marched by midpoints.
        March::Exact => (CYCLE_STEP, 1),
    };
    ViewConstants {
        centre: [0.5 * view.width as f32, 0.5 * view.height as f32],
        pixel: pixel as f32,
        near: (view.camera.near / unit) as f32,
        lod_scale: (scene.medium.lod_footprint * pixel) as f32,
        per_opacity_distance: (unit / scene.medium.opacity_distance) as f32,
        step: step as f32,
        samples,
        ..ViewConstants::of_volume(&scene.volume)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plans_have_the_numbers_of_the_shader() {
        let shader = include_str!("../../../glsl/include/sample.glsl");
        for (name, march) in
            [("DEFAULT", March::default()), ("PAPER", March::Paper { samples: 1 }), ("EXACT", March::Exact)]
        {
            assert!(shader.contains(&format!("const uint PLAN_{name} = {};", plan(march))), "{name}");
        }
    }

    #[test]
    fn host_and_shader_agree_on_the_most_samples() {
        let shader = include_str!("../../../glsl/include/sample.glsl");
        assert!(shader.contains(&format!("clamp(ceil(texels / view.step), 1.0, {MOST_SAMPLES:.1})")));
    }
}
