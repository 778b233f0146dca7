//! From the text of a scene file to the [`Scene`] that it describes.

use std::io::Read;
use std::path::Path;

use glam::{DVec2, DVec3};
use toml::Spanned;

use super::camera::DEFAULT_NEAR;
use super::file::{CameraSection, MeshSection, Plan, SceneFile, VolumeSection};
use super::number::{Exactly, Finite};
use super::text::Text;
use super::{Camera, March, Medium, Scene, View};
use crate::frame::{Stage, Stopwatch};
use crate::mesh::generate::Generator;
use crate::mesh::projection::Projection;
use crate::mesh::{Mesh, obj};
use crate::progress::{Progress, Silent};
use crate::shell::{Shell, ShellOptions};
use crate::volume::{self, Interpretation, Pyramid, Volume, recipe};
use crate::{Error, Result};

/// No scene file that a person wrote is longer, in bytes.
const LONGEST_SCENE_FILE: u64 = 1 << 20;

/// A scene, with what its file says beyond it.
#[derive(Debug, Clone)]
pub struct Loaded {
    /// What a method renders.
    pub scene: Scene,
    /// Linear RGB on which the picture is laid; `None` leaves it transparent.
    pub background: Option<[f32; 3]>,
    /// What loading cost.
    pub stages: Vec<Stage>,
}

/// Loads a scene file with overrides laid over it, each `dotted.key=value`.
///
/// # Errors
/// [`Error::Input`] for a file that cannot be read, [`Error::Text`] for a scene that cannot be, with the spot,
/// [`Error::Usage`] for an override that is to blame.
pub fn load(path: &Path, overrides: &[String], progress: &dyn Progress) -> Result<Loaded> {
    let unreadable = |error: std::io::Error| {
        Error::input(path, format!("the scene file cannot be read: {error}"))
            .with_help("check the path, or write the scene that docs/scene.md describes")
    };
    let mut text = String::new();
    let file = std::fs::File::open(path).map_err(unreadable)?;
    file.take(LONGEST_SCENE_FILE + 1).read_to_string(&mut text).map_err(unreadable)?;
    if text.len() as u64 > LONGEST_SCENE_FILE {
        return Err(Error::input(path, "longer than 1 MiB: this is no scene file"));
    }
    let text = Text::new(&path.display().to_string(), text, overrides)?;
    build(&text, path.parent().unwrap_or(Path::new("")), progress)
}

/// Loads a scene from a text: `name` is what errors call it, `base_dir` where its paths start.
///
/// # Errors
/// As [`load`].
pub fn parse(name: &str, text: &str, base_dir: &Path) -> Result<Loaded> {
    build(&Text::new(name, text.to_owned(), &[])?, base_dir, &Silent)
}

fn build(text: &Text, base_dir: &Path, progress: &dyn Progress) -> Result<Loaded> {
    let mut stopwatch = Stopwatch::start();
    let file: SceneFile = text.parse(("mesh", "generator"))?;
    // All that the text alone can have wrong is told before a long load.
    let camera = file.camera.as_ref().map(|section| camera(text, section)).transpose()?;
    let mesh = MeshSource::of(text, &file.mesh)?;
    let volume = VolumeSource::of(text, &file.volume)?;

    progress.stage("loading the mesh");
    let mesh = mesh.load(base_dir)?;
    stopwatch.lap("load.mesh");

    progress.stage("building the shell");
    let shell = &file.shell;
    let options = ShellOptions {
        thickness: shell.thickness.0,
        thickness_scale: Vec::new(),
        smoothing_rounds: shell.smoothing.0,
        uv_scale: DVec2::from_array(shell.uv_scale.0.map(|x| x.0)),
        uv_offset: DVec2::from_array(shell.uv_offset.0.map(|x| x.0)),
    };
    let shell = Shell::build(&mesh, &options)?;
    stopwatch.lap("load.shell");

    progress.stage("loading the volume");
    let section = file.volume.get_ref();
    let volume = volume.load(base_dir)?;
    let texel_along_w = options.thickness / f64::from(volume.size[2]);
    stopwatch.lap("load.volume");

    progress.stage("filtering the volume");
    let volume = Pyramid::build(volume);
    stopwatch.lap("load.pyramid");

    let [width, height] = file.image.size.0.map(|pixels| pixels.0);
    let camera = camera.unwrap_or_else(|| Camera::framing(&shell.vertices));
    let scene = Scene {
        view: View { camera, width, height, depth: false },
        medium: Medium {
            opacity_distance: section.opacity_distance.map_or(texel_along_w, |distance| distance.0),
            lod_footprint: section.lod_footprint.0,
        },
        march: match file.march.plan {
            Plan::Default => March::Default { step: file.march.step.0 },
            Plan::Paper => March::Paper { samples: file.march.samples.0 },
        },
        shell,
        volume,
    };
    let background = file.image.background.map(|rgb| rgb.0.map(|x| x.0 as f32));
    Ok(Loaded { scene, background, stages: stopwatch.finish() })
}

/// Where the mesh comes from.
enum MeshSource<'a> {
    Generator(&'a Generator),
    File(&'a Path, Option<&'a Projection>),
}

impl<'a> MeshSource<'a> {
    fn of(text: &Text, section: &'a Spanned<MeshSection>) -> Result<Self> {
        match section.get_ref() {
            MeshSection { generator: Some(generator), file: None, projection: None } => {
                generator.check().map_err(|bad| {
                    let span = text.span_of("mesh", bad.key).unwrap_or(section.span());
                    text.error(span, format!("`{}` {}", bad.key, bad.message))
                })?;
                Ok(Self::Generator(generator))
            }
            MeshSection { generator: None, file: Some(file), projection } => {
                Ok(Self::File(file, projection.as_ref()))
            }
            _ => Err(text.error(section.span(), "[mesh] needs either `generator` with its keys or `file`")),
        }
    }

    fn load(self, base_dir: &Path) -> Result<Mesh> {
        match self {
            Self::Generator(generator) => generator.build(),
            Self::File(file, projection) => obj::load(base_dir.join(file), projection),
        }
    }
}

/// Where the volume comes from.
enum VolumeSource<'a> {
    Recipe(&'a Path),
    File(&'a Path, Interpretation),
}

impl<'a> VolumeSource<'a> {
    fn of(text: &Text, section: &'a Spanned<VolumeSection>) -> Result<Self> {
        match section.get_ref() {
            VolumeSection { recipe: Some(path), file: None, transfer: None, alpha: None, .. } => {
                Ok(Self::Recipe(path))
            }
            VolumeSection { recipe: None, file: Some(path), transfer, alpha, .. } => {
                let interpretation = Interpretation {
                    alpha_mode: None,
                    constant_alpha: alpha.map(|alpha| alpha.0 as f32),
                    transfer: transfer.clone(),
                };
                Ok(Self::File(path, interpretation))
            }
            _ => Err(text.error(
                section.span(),
                "[volume] needs either `recipe`, or `file` with what it may need of `transfer` and `alpha`",
            )),
        }
    }

    fn load(self, base_dir: &Path) -> Result<Volume> {
        match self {
            Self::Recipe(path) => recipe::load(base_dir.join(path))?.build(),
            Self::File(path, interpretation) => {
                Volume::from_raw(volume::read(&base_dir.join(path))?, &interpretation)
            }
        }
    }
}

/// The camera, whose axes are checked to exist.
fn camera(text: &Text, section: &CameraSection) -> Result<Camera> {
    let vector = |v: &Exactly<3, Finite>| DVec3::from_array(v.0.map(|x| x.0));
    let (eye, target) = (vector(&section.eye), vector(section.target.get_ref()));
    let distance = eye.distance(target);
    if !(distance.is_normal() && eye + (target - eye) / distance != eye) {
        return Err(text.error(section.target.span(), "the target must be a point other than the eye"));
    }
    let up = section.up.as_ref().map_or(DVec3::Y, |up| vector(up.get_ref()));
    // Below this sine rounding alone would decide which way is up.
    let sine = (target - eye).normalize().cross(up.normalize_or_zero()).length();
    if sine < 1e-9 {
        return Err(text.error(
            section.up.as_ref().unwrap_or(&section.target).span(),
            "`up` must not be zero, nor point along the line of sight",
        ));
    }
    let near = section.near.map_or(DEFAULT_NEAR * distance, |near| near.0);
    Ok(Camera { eye, target, up, fov_y: section.fov.0.to_radians(), near })
}
