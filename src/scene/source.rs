//! Where a scene's mesh and volume come from: a generator or a recipe, or a file.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use toml::Spanned;

use super::file::{self, DensitySection, MeshSection, VolumeSection};
use super::meshes::{Between, MeshFiles, Shown};
use super::numbered;
use super::text::Text;
use super::timeline::Moment;
use crate::mesh::generate::Generator;
use crate::mesh::gltf::{self, Clip, Gltf, Pose};
use crate::mesh::projection::Projection;
use crate::mesh::{Mesh, obj};
use crate::progress::Progress;
use crate::volume::recipe::{self, Recipe};
use crate::volume::{self, Interpretation, Volume};
use crate::{Error, Result};

/// Refuses a sequence of volumes that are not all of one size.
///
/// # Errors
/// [`Error::Input`] with the file.
pub(super) fn check_volumes(section: &VolumeSection, base_dir: &Path) -> Result<()> {
    let Some(path) = &section.file else { return Ok(()) };
    let Some(files) = numbered::files(&base_dir.join(path))? else { return Ok(()) };
    let first = volume::size(&files[0])?;
    for file in &files[1..] {
        let size = volume::size(file)?;
        if size != first {
            let message = format!("has {size:?} texels, but {} has {first:?}", files[0].display());
            return Err(Error::input(file, message).with_help("all volumes of a sequence must have one size"));
        }
    }
    Ok(())
}

/// Where the mesh comes from.
pub(super) enum MeshSource<'a> {
    Generator(&'a Generator),
    File(PathBuf, Option<&'a Projection>),
    Sequence(Between, Option<&'a Projection>),
    Gltf(Arc<Gltf>, Option<Pose>),
}

impl<'a> MeshSource<'a> {
    /// What a section names, if that is one thing; of what moves by itself, what it shows at that moment. A glTF file is read,
    /// unless it is among `meshes`, which were read before.
    ///
    /// # Errors
    /// [`Error`] with the spot, or with the file.
    pub(super) fn of(
        text: &Text,
        section: &'a Spanned<MeshSection>,
        base_dir: &Path,
        moment: Moment,
        meshes: &mut MeshFiles,
        progress: &dyn Progress,
    ) -> Result<Self> {
        match section.get_ref() {
            MeshSection { generator: Some(generator), file: None, projection: None, .. } => {
                generator.check().map_err(|bad| {
                    let span = text.span_of("mesh", bad.key).unwrap_or(section.span());
                    text.error(span, format!("`{}` {}", bad.key, bad.message))
                })?;
                Ok(Self::Generator(generator))
            }
            MeshSection { generator: None, file: Some(file), projection, clip, rate, time, .. } => {
                let path = base_dir.join(file);
                let files = numbered::files(&path)?;
                if gltf::has_name_of_one(&path) {
                    if files.is_some() {
                        let message =
                            "a sequence is one of OBJ files: a glTF file holds its animations itself";
                        return Err(Error::input(path, message).with_help("name a single file"));
                    }
                    return Self::gltf(text, section, &path, moment, meshes, progress);
                }
                if let Some(clip) = clip {
                    return Err(text.error(clip.span(), "`clip` is for a glTF file, .glb or .gltf"));
                }
                let Some(files) = files else {
                    if rate.is_some() || time.is_some() {
                        let message = "`rate` and `time` are for a sequence of files, with a `#` in `file`, and for a glTF file";
                        return Err(text.error(section.span(), message));
                    }
                    return Ok(Self::File(path, projection.as_ref()));
                };
                let rate = rate.unwrap_or_else(file::default_rate);
                let between = Between::of(files, moment, rate.0, time.map(|time| time.0));
                Ok(Self::Sequence(between, projection.as_ref()))
            }
            _ => Err(text.error(section.span(), "[mesh] needs either `generator` with its keys or `file`")),
        }
    }

    /// A glTF file, in the pose that a section says it has at that moment.
    fn gltf(
        text: &Text,
        section: &Spanned<MeshSection>,
        path: &Path,
        moment: Moment,
        meshes: &mut MeshFiles,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let MeshSection { projection, clip, rate, time, .. } = section.get_ref();
        let gltf = meshes.gltf(path, projection.as_ref(), progress)?;
        let clips = gltf.clips();
        let at = rate.map_or(1.0, |rate| rate.0) * time.map_or(moment.time, |time| time.0);
        if let Some(clip) = clip {
            let index = clip_index(clips, clip.get_ref()).map_err(|(message, help)| {
                text.error(clip.span(), format!("{} {message}", path.display())).with_help(help)
            })?;
            let pose = gltf.pose(index, at);
            return Ok(Self::Gltf(gltf, Some(pose)));
        }
        if clips.is_empty() && (rate.is_some() || time.is_some()) {
            let message = format!("`rate` and `time` are for an animation, but {} has none", path.display());
            return Err(text.error(section.span(), message));
        }
        // The first, where there is one.
        let pose = (!clips.is_empty()).then(|| gltf.pose(0, at));
        Ok(Self::Gltf(gltf, pose))
    }

    /// What it shows, if it moves by itself.
    pub(super) fn shown(&self) -> Option<Shown> {
        match self {
            Self::Generator(_) | Self::File(..) => None,
            Self::Sequence(between, _) => Some(Shown::Between(between.clone())),
            Self::Gltf(_, pose) => Some(Shown::Pose(*pose)),
        }
    }

    /// `meshes` are those that were read before.
    pub(super) fn load(&self, meshes: &mut MeshFiles) -> Result<Mesh> {
        match self {
            Self::Generator(generator) => generator.build(),
            Self::File(file, projection) => obj::load(file, *projection),
            Self::Sequence(between, projection) => between.load(*projection, meshes),
            Self::Gltf(gltf, pose) => gltf.mesh(*pose),
        }
    }
}

/// The clip of that name; where none has it, the one of that number, from 1.
///
/// # Errors
/// What is wrong with the file, and what helps, where there is none, or more than one.
fn clip_index(clips: &[Clip], name: &str) -> std::result::Result<usize, (String, String)> {
    let named: Vec<usize> = (0..clips.len()).filter(|&index| clips[index].name == name).collect();
    let numbered = || name.parse::<usize>().ok()?.checked_sub(1).filter(|index| *index < clips.len());
    let one_or_none = match named[..] {
        [] => numbered(),
        [index] => Some(index),
        // One without a name, beside another that is called as its number.
        _ => numbered().filter(|index| named.contains(index)),
    };
    one_or_none.ok_or_else(|| {
        if named.is_empty() {
            let names: Vec<String> = clips.iter().map(|clip| format!("\"{}\"", clip.name)).collect();
            let there_are = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
            return (format!("has no animation \"{name}\""), format!("those that it has: {there_are}"));
        }
        let count = named.len();
        let numbers: Vec<String> = named.iter().map(|index| format!("\"{}\"", index + 1)).collect();
        let help = format!("choose one by its number: {}", numbers.join(", "));
        (format!("has {count} animations \"{name}\""), help)
    })
}

/// Where the volume comes from.
#[derive(Clone)]
pub(super) enum VolumeSource {
    Recipe(Recipe),
    File(PathBuf, Interpretation),
}

impl VolumeSource {
    /// Of a sequence, the file of that moment.
    ///
    /// # Errors
    /// [`Error`](crate::Error) with the spot, or with the file.
    pub(super) fn of(
        text: &Text,
        section: &Spanned<VolumeSection>,
        base_dir: &Path,
        moment: Moment,
    ) -> Result<Self> {
        match section.get_ref() {
            VolumeSection {
                recipe: Some(path), file: None, transfer: None, density: None, alpha: None, vary, ..
            } => {
                let laid_over = |(key, value): (&String, &toml::Value)| format!("{key} = {value}");
                let laid_over: Vec<String> = vary.iter().flatten().map(laid_over).collect();
                let file = base_dir.join(path);
                let recipe = recipe::load_with(&file, &laid_over).map_err(|error| match file.exists() {
                    true => error,
                    false => error.with_help("paths in a scene, and those of -D, are relative to the scene file"),
                })?;
                Ok(Self::Recipe(recipe))
            }
            VolumeSection { density: Some(_), opacity_distance: Some(_), .. } => Err(text.error(
                section.span(),
                "[volume.density] says itself how dense the volume is: leave out `opacity_distance`",
            )),
            VolumeSection { recipe: None, file: Some(path), transfer, density, alpha, vary: None, .. } => {
                let colour = |density: &DensitySection| {
                    density.colour.map_or([1.0; 3], |colour| colour.0.to_array())
                };
                let interpretation = Interpretation {
                    density: density.as_ref().map(colour),
                    alpha_mode: None,
                    constant_alpha: alpha.map(|alpha| alpha.0 as f32),
                    transfer: transfer.clone(),
                };
                let path = base_dir.join(path);
                let path = match numbered::files(&path)? {
                    Some(mut files) => {
                        let VolumeSection { rate, time, .. } = section.get_ref();
                        files.swap_remove(moment.file(files.len(), rate.0, time.map(|time| time.0)))
                    }
                    None => path,
                };
                Ok(Self::File(path, interpretation))
            }
            _ => Err(text.error(
                section.span(),
                "[volume] needs either `recipe`, with or without `vary`, or `file` with what it may need of `transfer`, `density` \
                 and `alpha`",
            )),
        }
    }

    /// The file that is read, if it is one.
    pub(super) fn path(&self) -> Option<&Path> {
        match self {
            Self::Recipe(_) => None,
            Self::File(path, _) => Some(path),
        }
    }

    /// `admit` has been asked about a recipe's size; whether the shell `resolves` it has not.
    pub(super) fn load(
        &self,
        admit: &dyn Fn([u32; 3]) -> Result<()>,
        resolves: &dyn Fn([u32; 3]) -> Result<()>,
    ) -> Result<Volume> {
        match self {
            Self::Recipe(recipe) => {
                resolves(recipe.header().size)?;
                recipe.build()
            }
            Self::File(path, interpretation) => {
                let raw = volume::read(path)?;
                admit(raw.size)?;
                resolves(raw.size)?;
                Volume::from_raw(raw, interpretation)
            }
        }
    }
}
