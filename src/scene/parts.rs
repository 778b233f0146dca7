//! What a scene's sections are made into, and kept for the next scene as long as they stay what they are: the frames of an
//! animation share all that does not move.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use glam::DVec2;
use toml::Spanned;

use super::file::{
    BaseSection, HazeSection, ImageSection, Limit, MeshSection, Plan, SceneFile, SolidSection, VolumeSection,
};
use super::lighting::Lighting;
use super::load::Loaded;
use super::meshes::{MeshFiles, Shown};
use super::motion::Motion;
use super::solids::Solids;
use super::source::{MeshSource, VolumeSource};
use super::text::Text;
use super::timeline::Moment;
use super::{
    Camera, March, Medium, Model, Scene, Sizes, Skips, Solid, View, backdrop, cameras, span, texel_edges,
    thickness,
};
use crate::frame::{Backdrop, Stopwatch};
use crate::mesh::Mesh;
use crate::progress::Progress;
use crate::shell::{Shell, ShellOptions, Wind};
use crate::volume::grey::Grey;
use crate::volume::{Directions, Haze, Pyramid};
use crate::{Error, Result};

/// What was made last, and of what.
struct Kept<Of, Made>(Option<(Of, Made)>);

impl<Of, Made> Default for Kept<Of, Made> {
    fn default() -> Self {
        Self(None)
    }
}

impl<Of: PartialEq, Made: Clone> Kept<Of, Made> {
    /// What was made of the same; else what `make` makes of it, which is then kept in its place.
    fn get(&mut self, of: Of, make: impl FnOnce(&Of) -> Result<Made>) -> Result<Made> {
        if let Some((made_of, made)) = &self.0
            && *made_of == of
        {
            return Ok(made.clone());
        }
        let made = make(&of)?;
        self.0 = Some((of, made.clone()));
        Ok(made)
    }
}

/// Equal where it is the very same.
#[derive(Clone)]
struct Same<T>(Arc<T>);

impl<T> PartialEq for Same<T> {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

/// All that a volume's texels depend on.
#[derive(PartialEq)]
struct Texels {
    /// Without the keys that are not among it.
    section: VolumeSection,
    /// Which of a sequence.
    file: Option<PathBuf>,
    /// In thicknesses of the shell, where there is haze: see [`VolumeWork::opacity_distance`].
    haze: Option<Option<f64>>,
    /// The shell whose texels are filtered, and its opacity distance.
    rest: (Same<Shell>, Option<f64>),
}

/// A shell at rest: coarser levels of the volume are made for its texels, however it is deformed.
#[derive(Clone)]
pub(super) struct Rest {
    shell: Arc<Shell>,
    thickness: f64,
    /// See [`Checked::opacity_distance`].
    opacity_distance: Option<f64>,
}

/// The volume, and what [`Lighting::origin`] tells.
type OfDirections = (Same<Pyramid>, (Model, Option<PathBuf>));
type OfSolidFiles = (Option<BaseSection>, Vec<Spanned<SolidSection>>);
/// The base mesh, where it is one.
type OfSolids = (Same<Solids>, Option<Same<Mesh>>);

/// How a volume is made.
struct VolumeWork {
    source: VolumeSource,
    section: VolumeSection,
    /// In thicknesses of the shell; without one it is a texel along w.
    opacity_distance: Option<f64>,
    rest: Rest,
}

impl VolumeWork {
    /// `lap` is told of each stage that is done.
    fn make(
        &self,
        progress: &dyn Progress,
        admit: &dyn Fn([u32; 3]) -> Result<()>,
        resolve: &dyn Fn([u32; 3]) -> Result<()>,
        lap: &mut dyn FnMut(&str),
    ) -> Result<Arc<Pyramid>> {
        progress.stage("loading the volume");
        let mut volume = self.source.load(admit, resolve)?;
        let layers = f64::from(volume.size[2]);
        let rest_distance = self.rest.opacity_distance.unwrap_or(self.rest.thickness / layers);
        let texel = texel_edges(&self.rest.shell, volume.size).map(|edge| edge / rest_distance);
        if let Some(HazeSection { alpha, colour }) = &self.section.haze {
            let depth = -(-alpha.0).ln_1p() * self.opacity_distance.unwrap_or(layers.recip());
            Haze { colour: colour.0, depth }.fill(&mut volume);
        }
        lap("load.volume");
        progress.stage("filtering the volume");
        let pyramid = Pyramid::build_with(volume, self.section.filter, texel);
        lap("load.pyramid");
        Ok(Arc::new(pyramid))
    }
}

/// The parts of the last scene.
#[derive(Default)]
pub(super) struct Parts {
    /// See [`MeshSection::loaded`] and [`MeshSource::shown`].
    mesh: Kept<(MeshSection, Option<Shown>), Arc<Mesh>>,
    mesh_files: MeshFiles,
    moved: Kept<(Same<Mesh>, Motion), Arc<Mesh>>,
    thickness_map: Kept<PathBuf, Arc<Grey>>,
    shell: Kept<(Same<Mesh>, ShellOptions), Arc<Shell>>,
    /// The shell before that, whose memory the next may have.
    spare: Option<Arc<Shell>>,
    volume: Kept<Texels, Arc<Pyramid>>,
    directions: Kept<OfDirections, Arc<Directions>>,
    solid_files: Kept<OfSolidFiles, Arc<Solids>>,
    solids: Kept<OfSolids, Arc<[Solid]>>,
    backdrop: Kept<ImageSection, Backdrop>,
}

/// A scene's text, read and checked as far as that goes without its mesh, unless that is of a glTF file, and its volume.
pub(super) struct Checked<'a> {
    text: &'a Text,
    file: &'a SceneFile,
    base_dir: &'a Path,
    camera: Option<Camera>,
    mesh: MeshSource<'a>,
    motion: Motion,
    wind: Option<Wind>,
    volume: VolumeSource,
    lighting: Option<Lighting<'a>>,
}

impl Checked<'_> {
    fn shell_options(&self, thickness_scale: Vec<f64>) -> ShellOptions {
        let shell = &self.file.shell;
        ShellOptions {
            thickness: shell.thickness.0,
            thickness_scale,
            smoothing_rounds: shell.smoothing.0,
            wind: self.wind,
            limited: shell.limit == Limit::Safe,
            uv_scale: DVec2::from_array(shell.uv_scale.0.map(|x| x.0)),
            uv_rotation: shell.uv_rotation.0.to_radians(),
            uv_offset: DVec2::from_array(shell.uv_offset.0.map(|x| x.0)),
        }
    }

    /// As the file says; otherwise it is one texel along w.
    fn opacity_distance(&self) -> Option<f64> {
        let section = self.file.volume.get_ref();
        // The path that a density of 1 makes one optical depth long.
        let mean_free_path = section.density.as_ref().map(|density| density.extinction.0.recip());
        mean_free_path.or(section.opacity_distance.map(|distance| distance.0))
    }

    /// How its volume is made, and what that depends on.
    fn volume_work(&self, rest: &Rest) -> (Texels, VolumeWork) {
        let section = self.file.volume.get_ref();
        let thickness = self.file.shell.thickness.0;
        let opacity_distance = self.opacity_distance().map(|distance| distance / thickness);
        let texels = Texels {
            section: section.texels(),
            file: self.volume.path().map(Path::to_owned),
            haze: section.haze.as_ref().map(|_| opacity_distance),
            rest: (Same(rest.shell.clone()), rest.opacity_distance),
        };
        let (source, section, rest) = (self.volume.clone(), section.clone(), rest.clone());
        (texels, VolumeWork { source, section, opacity_distance, rest })
    }

    /// Blames a texture that is too fine on who made it so.
    fn resolve(&self, shell: &Shell, size: [u32; 3]) -> Result<()> {
        span::check(shell, size).map_err(|too_fine| {
            let mesh = self.file.mesh.get_ref().file.as_ref().map(|file| self.base_dir.join(file));
            let error = match (self.text.span_of("shell", "uv_scale"), mesh) {
                (None, Some(mesh)) => Error::input(mesh, too_fine.to_string()),
                (span, _) => self.text.error(span.unwrap_or(self.file.mesh.span()), too_fine.to_string()),
            };
            error.with_help(span::TooFine::HELP)
        })
    }
}

impl Parts {
    /// Reads and checks a text; `base_dir` is where its paths start.
    ///
    /// # Errors
    /// As [`load`](super::load()).
    pub(super) fn check<'a>(
        &mut self,
        text: &'a Text,
        file: &'a SceneFile,
        base_dir: &'a Path,
        moment: Moment,
        progress: &dyn Progress,
    ) -> Result<Checked<'a>> {
        self.thickness_map(file, base_dir)?;
        Ok(Checked {
            camera: cameras::camera(text, file)?,
            mesh: MeshSource::of(text, &file.mesh, base_dir, moment, &mut self.mesh_files, progress)?,
            motion: Motion::of(text, file.mesh.get_ref().transform.as_ref(), &file.deform)?,
            wind: file.shell.wind.as_ref().map(|wind| wind.wind(text)).transpose()?,
            volume: VolumeSource::of(text, &file.volume, base_dir, moment)?,
            lighting: Lighting::of(text, file, base_dir)?,
            text,
            file,
            base_dir,
        })
    }

    fn thickness_map(&mut self, file: &SceneFile, base_dir: &Path) -> Result<Option<Arc<Grey>>> {
        let read = |path: &PathBuf| thickness::read(path).map(Arc::new);
        let map = file.shell.thickness_map.as_ref();
        map.map(|file| self.thickness_map.get(base_dir.join(file), read)).transpose()
    }

    /// The shell of a scene, and what it is made of; `stopwatch` is told what was not kept.
    fn shell(
        &mut self,
        checked: &Checked<'_>,
        progress: &dyn Progress,
        stopwatch: &mut Stopwatch,
    ) -> Result<(Arc<Mesh>, Arc<Shell>)> {
        let of_mesh = (checked.file.mesh.get_ref().loaded(), checked.mesh.shown());
        let mesh = self.mesh.get(of_mesh, |_| {
            progress.stage("loading the mesh");
            let mesh = checked.mesh.load(&mut self.mesh_files)?;
            stopwatch.lap("load.mesh");
            Ok(Arc::new(mesh))
        })?;
        let mesh = self.moved.get((Same(mesh), checked.motion.clone()), |(Same(mesh), motion)| {
            if motion.is_none() {
                return Ok(mesh.clone());
            }
            let mut moved = Mesh::clone(mesh);
            motion.apply(&mut moved);
            stopwatch.lap("deform");
            Ok(Arc::new(moved))
        })?;
        let thickness_map = self.thickness_map(checked.file, checked.base_dir)?;
        let scale = thickness_map.map_or_else(Vec::new, |map| thickness::factors(&map, &mesh));
        let before = self.shell.0.as_ref().map(|(_, shell)| shell.clone());
        let spare = &mut self.spare;
        let shell = self.shell.get((Same(mesh.clone()), checked.shell_options(scale)), |(_, options)| {
            progress.stage("building the shell");
            let shell = match before {
                Some(before) if before.topology.is_of(&mesh) => {
                    let moved = before.moved(&mesh, options, spare.take().and_then(Arc::into_inner))?;
                    *spare = Some(before);
                    moved
                }
                _ => Shell::build(&mesh, options)?,
            };
            stopwatch.lap("load.shell");
            Ok(Arc::new(shell))
        })?;
        Ok((mesh, shell))
    }

    /// The shell of this scene, as that at rest.
    ///
    /// # Errors
    /// As [`load`](super::load()).
    pub(super) fn rest(&mut self, checked: &Checked<'_>, progress: &dyn Progress) -> Result<Rest> {
        let (_, shell) = self.shell(checked, progress, &mut Stopwatch::start())?;
        let opacity_distance = checked.opacity_distance();
        Ok(Rest { shell, thickness: checked.file.shell.thickness.0, opacity_distance })
    }

    /// The scene; without a shell at `rest` its own is.
    ///
    /// # Errors
    /// As [`load_if`](super::load_if).
    pub(super) fn build(
        &mut self,
        checked: &Checked<'_>,
        rest: Option<&Rest>,
        progress: &dyn Progress,
        admit: &dyn Fn(&Sizes) -> Result<()>,
    ) -> Result<Loaded> {
        let Checked { text, file, base_dir, .. } = *checked;
        let mut stopwatch = Stopwatch::start();
        match std::mem::take(&mut self.mesh_files.untold) {
            Duration::ZERO => {}
            time => stopwatch.add("load.mesh", time),
        }
        // All that other files can have wrong is told before a long load, those that are quick to read first.
        let of_solids = (file.base.clone(), file.solid.clone());
        let solid_files = self.solid_files.get(of_solids, |(base, solids)| {
            Solids::read(text, base.as_ref(), solids, base_dir).map(Arc::new)
        })?;
        let backdrop = self.backdrop.get(file.image.clone(), |image| backdrop::read(image, base_dir))?;
        let [width, height] = file.image.size.0.map(|pixels| pixels.0);
        let admit = |volume| admit(&Sizes { picture: [width, height], volume });
        if let VolumeSource::Recipe(recipe) = &checked.volume {
            admit(recipe.header().size)?;
        }

        let (mesh, shell) = self.shell(checked, progress, &mut stopwatch)?;
        let camera = checked.camera.unwrap_or_else(|| Camera::framing(&shell.vertices));
        if let Some(lighting) = &checked.lighting {
            lighting.check_camera(text, &camera)?;
        }

        let thickness = file.shell.thickness.0;
        let opacity_distance = checked.opacity_distance();
        let own = Rest { shell: shell.clone(), thickness, opacity_distance };
        let section = file.volume.get_ref();
        let (texels, work) = checked.volume_work(rest.unwrap_or(&own));
        let volume = self.volume.get(texels, |_| {
            work.make(progress, &admit, &|size| checked.resolve(&shell, size), &mut |stage| {
                stopwatch.lap(stage)
            })
        })?;
        let size = volume.levels[0].size;
        checked.resolve(&shell, size)?;

        let shading = checked.lighting.as_ref().map(|lighting| {
            let directions = self.directions.get((Same(volume.clone()), lighting.origin()), |_| {
                progress.stage("finding the volume's directions");
                let directions = lighting.directions(&volume.levels[0])?;
                stopwatch.lap("load.directions");
                Ok(Arc::new(directions))
            });
            Ok::<_, Error>(lighting.shading(directions?))
        });
        let base = solid_files.has_base().then(|| Same(mesh.clone()));
        let solids = self.solids.get((Same(solid_files), base), |(files, _)| Ok(files.0.build(&mesh)))?;
        let scene = Scene {
            view: View { camera, width, height, depth: false },
            medium: Medium {
                opacity_distance: opacity_distance.unwrap_or(thickness / f64::from(size[2])),
                lod_footprint: section.lod_footprint.0,
            },
            march: match file.march.plan {
                Plan::Default => March::Default { step: file.march.step.0 },
                Plan::Paper => March::Paper { samples: file.march.samples.0 },
                Plan::Exact => March::Exact,
            },
            traversal: file.march.traversal,
            end_below: file.march.end_below.0,
            skips: Skips::without(&file.march.no_skip),
            shading: shading.transpose()?,
            solids,
            shell,
            volume,
        };
        Ok(Loaded { scene, samples: file.march.samples.0, backdrop, stages: stopwatch.finish() })
    }
}
