//! The `shell` method: sorted tetrahedra, rasterised and marched (Dufort, Leblanc, Poulin 2005).
//!
//! A frame runs top to bottom in [`Shell::render`]: order, see (what depends on the eye), upload, march,
//! read back. Deviations from the paper, and why: exit faces are drawn instead of entry faces, so that an eye
//! inside the shell is no special case; entries are computed per pixel from barycentric coordinates
//! (`glsl/shell.frag.glsl`); tetrahedra are drawn front to back into a floating-point target.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use rayon::prelude::*;

use super::{Method, Setup};
use crate::Result;
use crate::frame::{Frame, Image, Report, Stopwatch};
use crate::gpu::{Buffer, Draw, Gpu, Pipeline, PipelineInfo, Target, Texture3d, draw, shaders};
use crate::order::{Sorted, Sorter};
use crate::progress::{Interrupt, Progress};
use crate::scene::{March, Scene, View};

/// The push constants of `glsl/include/shell.glsl`: see there for each member.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "documented at the one declaration in glsl")]
pub struct ViewConstants {
    pub clip_from_view: [f32; 2],
    pub near: f32,
    pub lod_scale: f32,
    pub texels: [f32; 3],
    pub last_level: f32,
    pub per_opacity_distance: f32,
    pub step: f32,
    pub samples: u32,
}

/// `Tetrahedron` of `glsl/include/shell.glsl`: see there for each member.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "documented at the one declaration in glsl")]
pub struct Tetrahedron {
    pub vertices: [u32; 4],
    pub texture: [[f32; 4]; 4],
}

/// `Eye` of `glsl/include/shell.glsl`: see there for each member.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "documented at the one declaration in glsl")]
pub struct Eye {
    pub barycentric: [f32; 4],
    pub texture: [f32; 3],
    pub texels_per_unit: f32,
}

/// A scene on a device.
struct Shell {
    scene: Arc<Scene>,
    gpu: Arc<Gpu>,
    progress: Arc<dyn Progress>,
    interrupt: Interrupt,
    sorter: Sorter,
    volume: Texture3d,
    tetrahedra: Buffer,
    // What a frame of one size and kind needs, kept for the next frame.
    canvas: Option<Canvas>,
}

/// The target of a picture and the pipeline that draws into it.
struct Canvas {
    kind: CanvasKind,
    target: Target,
    pipeline: Pipeline,
    vertices: Buffer,
    eyes: Buffer,
    faces: Buffer,
}

/// What a canvas depends on.
#[derive(Debug, Clone, Copy, PartialEq)]
struct CanvasKind {
    width: u32,
    height: u32,
    depth: bool,
    minified: bool,
}

/// What the device needs to know about one view, apart from constants.
struct Seen {
    /// View-space shell vertices: x right, y up, z into the picture.
    vertices: Vec<[f32; 4]>,
    eyes: Vec<Eye>,
    /// `4 tetrahedron + face`, front to back.
    faces: Vec<u32>,
    tetrahedra_drawn: u64,
    tetrahedra_behind: u64,
    /// Whether any level of detail but 0 is needed.
    minified: bool,
}

/// Opens the device and uploads the scene.
///
/// # Errors
/// [`Error::Device`](crate::Error::Device) and [`Error::OutOfMemory`](crate::Error::OutOfMemory): checked before anything
/// is drawn.
pub fn prepare(scene: Arc<Scene>, setup: &Setup<'_>) -> Result<Box<dyn Method>> {
    setup.progress.stage("opening the device");
    let gpu = Gpu::open(setup.device, setup.validation)?;
    setup.progress.stage("uploading the volume");
    let volume = Texture3d::upload(&gpu, "the volume", &scene.volume)?;
    let tetrahedra: Vec<Tetrahedron> = scene
        .shell
        .topology
        .tetrahedra
        .par_iter()
        .zip(&scene.shell.texture)
        .map(|(&vertices, texture)| Tetrahedron {
            vertices,
            texture: texture.map(|t| t.as_vec3().extend(0.0).into()),
        })
        .collect();
    let tetrahedra = Buffer::storage(&gpu, "the tetrahedra", &tetrahedra)?;
    let sorter = Sorter::new(&scene.shell.topology);
    Ok(Box::new(Shell {
        scene,
        gpu,
        progress: setup.progress.clone(),
        interrupt: setup.interrupt.clone(),
        sorter,
        volume,
        tetrahedra,
        canvas: None,
    }))
}

impl Method for Shell {
    fn render(&mut self, view: &View) -> Result<Frame> {
        let mut watch = Stopwatch::start();
        self.interrupt.check()?;
        self.progress.stage("sorting the tetrahedra");
        let sorted = self.sorter.sort(&self.scene.shell, view);
        watch.lap("order");
        watch.add("order.relations", sorted.times.relations);
        watch.add("order.abuffer", sorted.times.abuffer);
        watch.add("order.search", sorted.times.search);

        self.interrupt.check()?;
        self.progress.stage("mapping the view");
        let seen = see(&self.scene, &sorted, view);
        watch.lap("see");
        self.progress.stage("uploading the view");
        let kind =
            CanvasKind { width: view.width, height: view.height, depth: view.depth, minified: seen.minified };
        let kept = self.canvas.take();
        let canvas = self.canvas(kept, kind, &seen)?;
        let canvas = &*self.canvas.insert(canvas);
        watch.lap("upload");

        self.interrupt.check()?;
        self.progress.stage("marching");
        let times = draw(
            &self.gpu,
            &Draw {
                target: &canvas.target,
                pipeline: &canvas.pipeline,
                buffers: &[&canvas.vertices, &self.tetrahedra, &canvas.eyes, &canvas.faces],
                textures: &[&self.volume],
                push_constants: bytemuck::bytes_of(&constants(&self.scene, view)),
                vertices: u32::try_from(3 * seen.faces.len()).expect("checked when the buffer was made"),
            },
        )?;
        watch.lap("march");
        if let Some(times) = times {
            watch.add("march.device", times.draw);
            watch.add("march.readback", times.readback);
        }
        self.interrupt.check()?;
        let rgba = canvas.target.read(0);
        let depth = view.depth.then(|| {
            let mean = |[weighted, _, _, alpha]: [f32; 4]| {
                if alpha > 0.0 { weighted / alpha } else { f32::INFINITY }
            };
            canvas.target.read(1).into_iter().map(mean).collect()
        });
        watch.lap("read");
        let mut report = self.report(&sorted, &seen, &rgba);
        report.stages = watch.finish();
        Ok(Frame { image: Image { width: view.width, height: view.height, rgba }, depth, report })
    }
}

impl Shell {
    /// The canvas for this frame, with what was seen in its buffers: the one of the frame before, where it fits.
    fn canvas(&self, kept: Option<Canvas>, kind: CanvasKind, seen: &Seen) -> Result<Canvas> {
        let fits =
            |canvas: &Canvas| canvas.kind == kind && canvas.faces.capacity::<u32>() >= seen.faces.len();
        let Some(mut canvas) = kept.filter(fits) else {
            return self.new_canvas(kind, seen);
        };
        canvas.vertices.write(&seen.vertices);
        canvas.eyes.write(&seen.eyes);
        canvas.faces.write(&seen.faces);
        Ok(canvas)
    }

    fn new_canvas(&self, kind: CanvasKind, seen: &Seen) -> Result<Canvas> {
        let target = Target::new(&self.gpu, kind.width, kind.height, if kind.depth { 2 } else { 1 })?;
        let pipeline = Pipeline::new(
            &self.gpu,
            &target,
            &PipelineInfo {
                vertex: shaders::SHELL_VERT,
                fragment: if kind.depth { shaders::SHELL_DEPTH_FRAG } else { shaders::SHELL_FRAG },
                constants: &[
                    u32::from(matches!(self.scene.march, March::Paper { .. })),
                    u32::from(kind.minified),
                ],
                storage_buffers: 4,
                textures: 1,
                push_constant_bytes: u32::try_from(size_of::<ViewConstants>()).expect("a few dozen bytes"),
            },
        )?;
        Ok(Canvas {
            kind,
            target,
            pipeline,
            vertices: Buffer::storage(&self.gpu, "the shell's vertices", &seen.vertices)?,
            eyes: Buffer::storage(&self.gpu, "the maps to the eye", &seen.eyes)?,
            faces: Buffer::storage(&self.gpu, "the faces in order", &seen.faces)?,
        })
    }

    fn report(&self, sorted: &Sorted, seen: &Seen, rgba: &[[f32; 4]]) -> Report {
        let health = self.scene.shell.health;
        let mut report =
            Report { method: "shell".into(), device: self.gpu.info().name.clone(), ..Report::default() };
        let mut count = |name: &str, value: u64| report.counts.insert(name.to_owned(), value);
        count("tetrahedra", health.tetrahedra);
        count("tetrahedra_drawn", seen.tetrahedra_drawn);
        count("faces_drawn", seen.faces.len() as u64);
        count("face_relations", sorted.face_relations);
        count("image_relations", sorted.image_relations);
        count("cycles", sorted.order.cycles.len() as u64);
        count("pixels_covered", rgba.iter().filter(|pixel| pixel[3] > 0.0).count() as u64);
        if seen.tetrahedra_behind > 0 {
            report.skipped.push(format!("{} tetrahedra lie before the near plane", seen.tetrahedra_behind));
        }
        if health.zero_volume > 0 {
            report.skipped.push(format!("{} tetrahedra have no volume", health.zero_volume));
        }
        if !seen.minified {
            report.skipped.push("all is magnified: no level of detail but 0 is compiled in".into());
        }
        if !sorted.order.cycles.is_empty() {
            report.warnings.push(format!(
                "{} tetrahedra hide one another in {} cycles: where they overlap, the picture is approximate",
                sorted.cycle_members,
                sorted.order.cycles.len()
            ));
        }
        if health.inverted > 0 {
            report.warnings.push(format!(
                "{} of {} tetrahedra are inverted: the shell folds; make it thinner or smooth its directions",
                health.inverted, health.tetrahedra
            ));
        }
        report
    }
}

/// Maps the shell to the view: positions relative to the eye, subtracted in f64 before anything is f32.
fn see(scene: &Scene, sorted: &Sorted, view: &View) -> Seen {
    let shell = &scene.shell;
    let frame = view.camera.frame();
    let eye = view.camera.eye;
    let vertices: Vec<[f32; 4]> = shell
        .vertices
        .par_iter()
        .map(|&vertex| {
            let offset = vertex - eye;
            let in_view =
                DVec3::new(offset.dot(frame.right), offset.dot(frame.up), offset.dot(frame.forward));
            in_view.as_vec3().extend(0.0).into()
        })
        .collect();
    let eyes: Vec<Eye> = (0..shell.cells.len()).into_par_iter().map(|t| eye_map(scene, t, eye)).collect();

    let near = view.camera.near;
    let lod_scale = scene.medium.lod_footprint * view.pixel_at_unit_depth();
    let mut seen = Seen {
        vertices,
        eyes,
        faces: Vec::with_capacity(2 * shell.cells.len()),
        tetrahedra_drawn: 0,
        tetrahedra_behind: 0,
        minified: false,
    };
    for &tetrahedron in &sorted.order.sequence {
        let index = tetrahedron as usize;
        let exits = sorted.exit_faces[index];
        if exits == 0 {
            continue;
        }
        let depths = shell.topology.tetrahedra[index].map(|v| f64::from(seen.vertices[v as usize][2]));
        let farthest = depths.into_iter().fold(f64::NEG_INFINITY, f64::max);
        if farthest <= near {
            seen.tetrahedra_behind += 1;
            continue;
        }
        seen.minified |= lod_scale * farthest * f64::from(seen.eyes[index].texels_per_unit) > 1.0;
        seen.tetrahedra_drawn += 1;
        seen.faces.extend((0..4).filter(|face| exits & (1 << face) != 0).map(|face| 4 * tetrahedron + face));
    }
    seen
}

/// The affine functions of a tetrahedron, at the eye.
fn eye_map(scene: &Scene, tetrahedron: usize, eye: DVec3) -> Eye {
    let shell = &scene.shell;
    let cell = &shell.cells[tetrahedron];
    let vertex = |k: usize| shell.vertices[shell.topology.tetrahedra[tetrahedron][k] as usize];
    // Measured from a vertex of the face, where the coordinate is 0.
    let barycentric = std::array::from_fn(|k| cell.gradients[k].dot(eye - vertex((k + 1) % 4)) as f32);
    let texture = shell.texture[tetrahedron][0] + cell.texture_from_world * (eye - vertex(0));
    Eye {
        barycentric,
        texture: texture.as_vec3().into(),
        texels_per_unit: scene.texels_per_unit(tetrahedron) as f32,
    }
}

fn constants(scene: &Scene, view: &View) -> ViewConstants {
    let pixel = view.pixel_at_unit_depth();
    let (step, samples) = match scene.march {
        March::Paper { samples } => (1.0, samples),
        March::Default { step } => (step, 1),
    };
    ViewConstants {
        clip_from_view: [
            (2.0 / (f64::from(view.width) * pixel)) as f32,
            (-2.0 / (f64::from(view.height) * pixel)) as f32,
        ],
        near: view.camera.near as f32,
        lod_scale: (scene.medium.lod_footprint * pixel) as f32,
        texels: scene.volume.levels[0].size.map(|side| side as f32),
        last_level: (scene.volume.levels.len() - 1) as f32,
        per_opacity_distance: scene.medium.opacity_distance.recip() as f32,
        step: step as f32,
        samples,
    }
}
