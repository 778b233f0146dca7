#![doc = include_str!("../../docs/scene.md")]
//!
//! # In code
//!
//! [`SceneFile`] is what such a text says, read and checked key by key, before any file that it names is
//! opened; [`load`](crate::scene::load()) makes a scene of it.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::Deserialize;
use toml::Spanned;

use super::Background;
use super::Model;
use super::PIXEL_FOOTPRINT;
use super::camera::DEFAULT_FOV_DEGREES;
use super::motion::{DeformSection, TransformSection};
use super::shading::DEFAULT_SHADOW_SIZE;
use super::timeline::Ease;
use super::wind::WindSection;
use super::{Skip, Traversal};
use crate::mesh::generate::Generator;
use crate::mesh::projection::Projection;
use crate::value::{
    BelowOne, Colour, EndBelow, Exactly, FieldOfView, Finite, Fraction, Frames, NotNegative, PictureSize,
    Pixels, Positive, Rate, Rounds, Samples, ShadowSize, Shininess, Step, Stops,
};
use crate::volume::{Filter, TransferFunction};

/// A whole scene file.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneFile {
    /// The base mesh; the span is the section's.
    pub mesh: Spanned<MeshSection>,
    /// What is done to it, in order; the spans are those of the sections.
    #[serde(default)]
    pub deform: Vec<Spanned<DeformSection>>,
    /// The shell around it.
    pub shell: ShellSection,
    /// What fills the shell; the span is the section's.
    pub volume: Spanned<VolumeSection>,
    /// Where it is seen from; by default a camera that takes in the whole shell.
    pub camera: Option<CameraSection>,
    /// Other places to see it from.
    #[serde(default)]
    pub cameras: BTreeMap<String, CameraSection>,
    /// Which of them is taken in place of `camera`.
    pub view: Option<Spanned<String>>,
    /// The picture.
    #[serde(default)]
    pub image: ImageSection,
    /// How finely the shell is marched.
    #[serde(default)]
    pub march: MarchSection,
    /// How light is seen; without it the volume's colours are what it sends out. The span is the section's.
    pub shading: Option<Spanned<ShadingSection>>,
    /// The lights; the spans are those of the sections.
    #[serde(default)]
    pub light: Vec<Spanned<LightSection>>,
    /// Makes the base mesh opaque.
    pub base: Option<BaseSection>,
    /// Opaque meshes; the spans are those of the sections.
    #[serde(default)]
    pub solid: Vec<Spanned<SolidSection>>,
    /// How long it lasts; by default one frame.
    pub timeline: Option<TimelineSection>,
    /// What changes in time; the spans are those of the sections.
    #[serde(default)]
    pub track: Vec<Spanned<TrackSection>>,
}

/// `[timeline]`: see [`Timeline`](super::Timeline).
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TimelineSection {
    /// How many there are.
    pub frames: Frames,
    /// Frames a second.
    #[serde(default = "default_rate")]
    pub rate: Rate,
    /// Whether the frame after the last would be the first.
    #[serde(default, rename = "loop")]
    pub loops: bool,
}

/// `[[track]]`: a key whose value changes in time.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrackSection {
    /// `section.key`, or `section.name.key` of what there may be several of.
    pub key: Spanned<String>,
    /// Seconds, ascending.
    pub at: Spanned<Vec<Finite>>,
    /// The key's value at each of these times.
    pub values: Spanned<Vec<toml::Value>>,
    /// How it goes from one to the next.
    #[serde(default)]
    pub ease: Ease,
}

/// `[base]`: the base mesh is opaque.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BaseSection {
    /// Multiplies the texture; by default white.
    #[serde(default = "white")]
    pub colour: Colour,
    /// A picture laid over the mesh's own texture coordinates, relative to the scene file.
    pub texture: Option<PathBuf>,
}

/// `[[solid]]`: an opaque mesh.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SolidSection {
    /// What tracks and overrides call it.
    pub name: Option<String>,
    /// An OBJ file, relative to the scene file.
    pub file: PathBuf,
    /// In place of the file's materials; multiplies the texture.
    pub colour: Option<Colour>,
    /// A picture, relative to the scene file, in place of the file's materials.
    pub texture: Option<PathBuf>,
    /// World space: where the origin of the file is.
    #[serde(default = "origin")]
    pub position: Exactly<3, Finite>,
    /// World units for one of the file.
    #[serde(default = "scale_one")]
    pub scale: Positive,
}

/// `[mesh]`: a generator or a file.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeshSection {
    /// A generated mesh, with the keys of its generator.
    pub generator: Option<Generator>,
    /// A mesh file, relative to the scene file.
    pub file: Option<PathBuf>,
    /// How texture coordinates are made, in place of those of the file.
    pub projection: Option<Projection>,
    /// Of a glTF file: the name of an animation; by default the first.
    pub clip: Option<Spanned<String>>,
    /// Of a sequence of files: how many a second. Of a glTF file: how many seconds of the clip a second.
    pub rate: Option<Rate>,
    /// Of a sequence of files: seconds after its first. Of a glTF file: seconds after the beginning of the clip. By default the time of the frame.
    pub time: Option<Finite>,
    /// Where it is.
    pub transform: Option<TransformSection>,
}

impl MeshSection {
    /// The same, with what the mesh that is loaded does not depend on as if nothing were said of it; of what moves by itself,
    /// without when.
    pub(super) fn loaded(&self) -> Self {
        Self { clip: None, rate: None, time: None, transform: None, ..self.clone() }
    }
}

/// `[shell]`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShellSection {
    /// World units.
    pub thickness: Positive,
    /// A PNG picture, relative to the scene file: grey is a factor on the thickness.
    pub thickness_map: Option<PathBuf>,
    /// Rounds of averaging of the extrusion directions.
    #[serde(default = "no_rounds")]
    pub smoothing: Rounds,
    /// What the outer side leans with.
    pub wind: Option<WindSection>,
    /// Whether it gives way where it would fold.
    #[serde(default)]
    pub limit: Limit,
    /// Repeats of the texture along u and v for each unit of the mesh's texture coordinates.
    #[serde(default = "scale_of_one")]
    pub uv_scale: Exactly<2, Finite>,
    /// Turns the texture, after the scale.
    #[serde(default = "zero")]
    pub uv_rotation: Finite,
    /// Added after the rotation.
    #[serde(default = "no_offset")]
    pub uv_offset: Exactly<2, Finite>,
}

/// What becomes of a shell that is too thick for its mesh.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Limit {
    /// It folds, with a warning.
    #[default]
    None,
    /// It is made thinner there.
    Safe,
}

/// `[volume]`: a recipe or a file.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VolumeSection {
    /// A recipe file, relative to the scene file.
    pub recipe: Option<PathBuf>,
    /// A volume file, a folder of images or a pattern of them, relative to the scene file.
    pub file: Option<PathBuf>,
    /// How the scalars of a file become colour and opacity.
    pub transfer: Option<TransferFunction>,
    /// How the scalars of a file become extinction.
    pub density: Option<DensitySection>,
    /// The opacity of every texel of a file that has red, green and blue alone.
    pub alpha: Option<Fraction>,
    /// World units; by default one level-0 texel along w.
    pub opacity_distance: Option<Positive>,
    /// In pixels.
    #[serde(default = "pixel_footprint")]
    pub lod_footprint: NotNegative,
    /// How texels are merged.
    #[serde(default)]
    pub filter: Filter,
    /// What fills the shell besides.
    pub haze: Option<HazeSection>,
    /// Laid over the recipe's keys.
    pub vary: Option<toml::Table>,
    /// Of a sequence of files: how many a second.
    #[serde(default = "default_rate")]
    pub rate: Rate,
    /// Of a sequence of files: seconds after its first; by default the time of the frame.
    pub time: Option<Finite>,
}

impl VolumeSection {
    /// The same, with what the texels do not depend on as if nothing were said of it.
    pub(super) fn texels(&self) -> Self {
        let (rate, lod_footprint) = (default_rate(), pixel_footprint());
        Self { opacity_distance: None, lod_footprint, rate, time: None, ..self.clone() }
    }
}

/// `[volume.haze]`: a medium that is everywhere.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HazeSection {
    /// The opacity of a path as long as the shell is thick.
    pub alpha: BelowOne,
    /// By default white.
    #[serde(default = "white")]
    pub colour: Colour,
}

/// `[volume.density]`: the scalars of a file are densities.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DensitySection {
    /// Extinction where the file says 1, per world unit.
    pub extinction: Positive,
    /// By default white.
    pub colour: Option<Colour>,
}

/// `[camera]`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraSection {
    /// World space.
    pub eye: Exactly<3, Finite>,
    /// World space, not the eye.
    pub target: Spanned<Exactly<3, Finite>>,
    /// World space, not along the line of sight; by default Y.
    pub up: Option<Spanned<Exactly<3, Finite>>>,
    /// Degrees by which the eye is taken round the target, about `up`.
    #[serde(default = "zero")]
    pub orbit: Finite,
    /// The vertical field of view.
    #[serde(default = "default_fov")]
    pub fov: FieldOfView,
    /// World units; by default a thousandth of the distance between eye and target.
    pub near: Option<Positive>,
}

/// `[image]`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ImageSection {
    /// Width and height.
    pub size: PictureSize,
    /// What lies behind the shell; a transparent picture without it.
    pub background: Option<Background>,
    /// How brightly a PNG shows it.
    pub exposure: Stops,
}

/// `[march]`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MarchSection {
    /// Which of the two keys below counts.
    pub plan: Plan,
    /// In texels: see [`March::Default`](super::March::Default).
    pub step: Step,
    /// In each tetrahedron: see [`March::Paper`](super::March::Paper).
    pub samples: Samples,
    /// See [`Traversal`].
    pub traversal: Traversal,
    /// See [`Scene::end_below`](super::Scene::end_below).
    pub end_below: EndBelow,
    /// What is not left out although it could be.
    pub no_skip: Vec<Skip>,
}

/// `[shading]`: see [`Shading`](super::Shading) for what the numbers mean.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ShadingSection {
    /// What the texture's directions are.
    pub model: Model,
    /// Light from everywhere.
    pub ambient: Colour,
    /// Factor on what is scattered.
    pub diffuse: NotNegative,
    /// Factor on what is mirrored.
    pub specular: NotNegative,
    /// How narrow the highlights are.
    pub shininess: Shininess,
    /// Factor on the light that bright colours send out of themselves.
    pub glow: NotNegative,
    /// How bright a colour must be to glow.
    pub glow_from: BelowOne,
    /// Pixels a side of the pictures from which shadows are read.
    pub shadow_size: ShadowSize,
    /// For a surface: a file of normals, relative to the scene file; by default they are derived.
    pub normals: Option<Spanned<PathBuf>>,
    /// For fibres: a file of tangents, relative to the scene file; by default they are derived.
    pub tangents: Option<Spanned<PathBuf>>,
}

/// `[[light]]`: from a direction or at a position.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LightSection {
    /// What tracks and overrides call it.
    pub name: Option<String>,
    /// World space, not zero: where the light shines.
    pub direction: Option<Spanned<Exactly<3, Finite>>>,
    /// World space, not inside the camera.
    pub position: Option<Exactly<3, Finite>>,
    /// By default white.
    #[serde(default = "white")]
    pub colour: Colour,
    /// With `position`: at which distance, in world units, half of it is left.
    pub falloff: Option<Positive>,
    /// Whether it casts shadows.
    #[serde(default)]
    pub shadow: bool,
}

/// How samples are spread.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Plan {
    /// By length.
    Default,
    /// The same number in every tetrahedron.
    Paper,
    /// Cell by cell.
    Exact,
}

impl Default for ImageSection {
    fn default() -> Self {
        Self { size: PictureSize([Pixels(512); 2]), background: None, exposure: Stops(0.0) }
    }
}

impl Default for MarchSection {
    fn default() -> Self {
        Self {
            plan: Plan::Default,
            step: Step(0.5),
            samples: Samples(10),
            traversal: Traversal::default(),
            end_below: EndBelow(super::END_BELOW),
            no_skip: Vec::new(),
        }
    }
}

impl Default for ShadingSection {
    fn default() -> Self {
        Self {
            model: Model::Surface,
            ambient: Colour::linear(0.1, 0.1, 0.1),
            diffuse: NotNegative(1.0),
            specular: NotNegative(0.2),
            shininess: Shininess(32.0),
            glow: NotNegative(0.0),
            glow_from: BelowOne(0.0),
            shadow_size: ShadowSize(DEFAULT_SHADOW_SIZE),
            normals: None,
            tangents: None,
        }
    }
}

fn white() -> Colour {
    Colour::linear(1.0, 1.0, 1.0)
}

pub(super) fn default_rate() -> Rate {
    Rate(24.0)
}

fn zero() -> Finite {
    Finite(0.0)
}

fn origin() -> Exactly<3, Finite> {
    Exactly([Finite(0.0); 3])
}

fn scale_one() -> Positive {
    Positive(1.0)
}

fn no_rounds() -> Rounds {
    Rounds(0)
}

fn scale_of_one() -> Exactly<2, Finite> {
    Exactly([Finite(1.0); 2])
}

fn no_offset() -> Exactly<2, Finite> {
    Exactly([Finite(0.0); 2])
}

fn pixel_footprint() -> NotNegative {
    NotNegative(PIXEL_FOOTPRINT)
}

fn default_fov() -> FieldOfView {
    FieldOfView(DEFAULT_FOV_DEGREES)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::text::Text;

    const SCENE: &str = r#"
[mesh]
generator = "torus"
segments = 8
rings = 4

[shell]
thickness = 0.1

[volume]
recipe = "fog.toml"
"#;

    const DOCUMENTATION: &str = include_str!("../../docs/scene.md");

    #[test]
    fn the_documented_scene_is_one() {
        let mut blocks =
            DOCUMENTATION.split("```toml\n").skip(1).map(|block| block.split("```").next().unwrap());
        let scene = blocks.next().unwrap();
        Text::new("docs", scene.to_owned(), &[]).unwrap().parse::<SceneFile>(("mesh", "generator")).unwrap();
        let transfer = blocks.next().unwrap();
        let scene = SCENE.replace("recipe", "file") + transfer;
        Text::new("docs", scene, &[]).unwrap().parse::<SceneFile>(("mesh", "generator")).unwrap();
        let lit = blocks.find(|block| block.contains("[shading]")).unwrap();
        let solid = blocks.find(|block| block.contains("[[solid]]")).unwrap();
        let moving = blocks.find(|block| block.contains("[timeline]")).unwrap();
        for block in [lit, solid, moving] {
            let text = Text::new("docs", format!("{SCENE}{block}"), &[]).unwrap();
            text.parse::<SceneFile>(("mesh", "generator")).unwrap();
        }
    }

    /// The keys of a section as the reader lists them when it meets an unknown one.
    fn keys(section: &str) -> Vec<String> {
        let text = Text::new("keys", SCENE.to_owned(), &[format!("{section}.unknown_key=1")]).unwrap();
        let message = text.parse::<SceneFile>(("mesh", "generator")).unwrap_err().to_string();
        let (_, expected) = message.split_once(", expected ").unwrap_or_else(|| panic!("{message}"));
        expected.split('`').skip(1).step_by(2).map(str::to_owned).collect()
    }

    #[test]
    fn every_key_is_documented() {
        let mut found = 0;
        for section in ["shell", "volume", "camera", "image", "march", "shading", "base", "timeline"] {
            let (_, documented) = DOCUMENTATION.split_once(&format!("\n## `[{section}]`")).unwrap();
            let documented = documented.split("\n## ").next().unwrap();
            for key in keys(section) {
                assert!(documented.contains(&format!("\n| `{key}` |")), "{section}.{key}");
                found += 1;
            }
        }
        assert_eq!(found, 8 + 12 + 6 + 3 + 6 + 10 + 2 + 3);
        let text = Text::new("keys", "[mesh]\nfile = \"a.glb\"\nunknown_key = 1".to_owned(), &[]).unwrap();
        let message = text.parse::<SceneFile>(("mesh", "generator")).unwrap_err().to_string();
        let (_, documented) = DOCUMENTATION.split_once("\n## `[mesh]`").unwrap();
        let documented = documented.split("\n## ").next().unwrap();
        let mesh: Vec<&str> =
            message.split_once(", expected ").unwrap().1.split('`').skip(1).step_by(2).collect();
        assert_eq!(mesh.len(), 7);
        // The last is a section of its own.
        assert!(mesh[..6].iter().all(|key| documented.contains(&format!("\n| `{key}` |"))), "{mesh:?}");
        assert!(documented.contains(&format!("\n### `[mesh.{}]`", mesh[6])), "{mesh:?}");
        let wind = keys("shell.wind");
        assert_eq!(wind, ["direction", "strength", "gust", "size", "phase"]);
        let (_, documented) = DOCUMENTATION.split_once("\n### `[shell.wind]`").unwrap();
        let documented = documented.split("\n## ").next().unwrap();
        assert!(wind.iter().all(|key| documented.contains(&format!("\n| `{key}` |"))), "{wind:?}");
        for (section, count) in [("light", 6), ("solid", 6), ("track", 4), ("deform", 14)] {
            let text = Text::new("keys", format!("{SCENE}[[{section}]]\nunknown_key = 1"), &[]).unwrap();
            let message = text.parse::<SceneFile>(("mesh", "generator")).unwrap_err().to_string();
            let (_, documented) = DOCUMENTATION.split_once(&format!("\n## `[[{section}]]`")).unwrap();
            let documented = documented.split("\n## ").next().unwrap();
            let keys: Vec<&str> =
                message.split_once(", expected ").unwrap().1.split('`').skip(1).step_by(2).collect();
            assert_eq!(keys.len(), count);
            assert!(keys.iter().all(|key| documented.contains(&format!("\n| `{key}` |"))), "{keys:?}");
        }
        for generator in ["plane", "tube", "sphere", "torus", "vase", "teapot"] {
            let scene = format!("[mesh]\ngenerator = \"{generator}\"\nunknown_key = 1");
            let text = Text::new("keys", scene, &[]).unwrap();
            let message = text.parse::<SceneFile>(("mesh", "generator")).unwrap_err().to_string();
            let (_, row) = DOCUMENTATION.split_once(&format!("\n| `{generator}` |")).unwrap();
            let row = row.lines().next().unwrap();
            for key in message.split_once(", expected ").unwrap().1.split('`').skip(1).step_by(2) {
                assert!(row.contains(&format!("`{key}` ")), "{generator}.{key}");
            }
        }
    }
}
