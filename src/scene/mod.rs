//! The scene: what is rendered, from where, and how finely. It comes from a [`mod@file`], or is put
//! together by hand:
//!
//! ```
//! use mesoshell::mesh::generate::{Generator, Torus};
//! use mesoshell::scene::Scene;
//! use mesoshell::shell::{Shell, ShellOptions};
//! use mesoshell::volume::{Pyramid, Volume};
//!
//! let mesh = Generator::Torus(Torus::default()).build()?;
//! let shell = Shell::build(&mesh, &ShellOptions::new(0.2))?;
//! let half_opaque_orange = Volume::new([1, 1, 1], vec![[0.5, 0.2, 0.0, 0.5]])?;
//! let mut scene = Scene::new(shell, Pyramid::build(half_opaque_orange), 0.2);
//! (scene.view.width, scene.view.height) = (64, 64);
//! let frame = mesoshell::method::render(scene)?;
//! assert!(frame.image.rgba.iter().any(|[.., alpha]| *alpha > 0.4));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod backdrop;
pub mod camera;
mod cameras;
pub mod file;
mod files;
mod lighting;
pub mod load;
mod meshes;
mod motion;
mod numbered;
mod parts;
mod sequence;
pub mod shading;
pub mod shadow;
mod skip;
pub mod solid;
mod solids;
mod source;
pub mod span;
pub(crate) mod text;
mod thickness;
mod timeline;
mod wind;

pub use backdrop::Background;
pub use camera::{Camera, View};
pub use load::{Loaded, load, load_if, parse};
pub use sequence::{FrameInputs, Sequence};
pub use shading::{Emission, Light, Model, Shading, Source};
pub use shadow::{Extent, LightView};
pub use skip::{Skip, Skips};
pub use solid::Solid;
pub use timeline::{Ease, Timeline};

use std::fmt;
use std::sync::Arc;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::shell::Shell;
use crate::volume::{Filter, Pyramid};

/// A loaded scene: all that a method needs, whatever file it came from. Its large parts are shared: scenes that differ in
/// little else, such as the frames of an animation, hold the same ones, and a method tells by the pointer what has changed.
#[derive(Debug, Clone)]
pub struct Scene {
    /// The geometry.
    pub shell: Arc<Shell>,
    /// The texture that fills it.
    pub volume: Arc<Pyramid>,
    /// How opacity and detail are to be read.
    pub medium: Medium,
    /// How light makes its colours; without it they are what it sends out.
    pub shading: Option<Shading>,
    /// Opaque surfaces beside the volume, or in its midst.
    pub solids: Arc<[Solid]>,
    /// Where it is seen from, how large, and whether depth is wanted.
    pub view: View,
    /// How finely the `shell` method marches.
    pub march: March,
    /// How it goes from tetrahedron to tetrahedron.
    pub traversal: Traversal,
    /// What part of the light, 0 to 0.1, a ray must let through to go on; what is behind is taken for more of what it saw last. By so much a
    /// picture may be off, where nothing in it is brighter than 1.
    pub end_below: f64,
    /// What it may leave out.
    pub skips: Skips,
}

/// By default a ray ends where less is let through, which changes no picture by 1e-6.
pub const END_BELOW: f64 = 1.0 / (1 << 20) as f64;

/// What a scene asks of a device, known before its volume is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sizes {
    /// Pixels across and down.
    pub picture: [u32; 2],
    /// Texels along u, v, w.
    pub volume: [u32; 3],
}

/// What the texture means. It belongs to the medium, not to the march: the reference obeys it too.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Medium {
    /// The path length, in world units, whose opacity, or optical depth, the texture's alpha is: see
    /// [`Quantity`](crate::volume::Quantity).
    pub opacity_distance: f64,
    /// How many pixels wide a texel of the level that is read is; 0 always reads level 0. See [`PIXEL_FOOTPRINT`].
    ///
    /// At a point at depth `z` (world units along the camera's forward axis) in a tetrahedron the level of
    /// detail is `log2(lod_footprint * z * pixel * rho)`, clamped to `0..=last level`, where `pixel` is
    /// [`View::pixel_at_unit_depth`] and `rho` is [`Scene::texels_across`] the ray in that tetrahedron: a pixel is wide
    /// across the ray, while along it the march sees every texel. Between integer levels the two levels'
    /// premultiplied RGBA are blended linearly.
    pub lod_footprint: f64,
}

/// The footprint at which a texture is as sharp as the pixels: a texel of the level read is `1 / sqrt(3)` pixels wide.
///
/// A pixel's box of width `p` has the variance `p^2 / 12`. A texel of width `t` is a mean over a box itself, `t^2 / 12`, and its
/// linear interpolation spreads it by a tent of twice its width, `t^2 / 6`; together `t^2 / 4`.
pub const PIXEL_FOOTPRINT: f64 = 0.577_350_269_189_625_8;

/// How samples are spread along a ray in one tetrahedron.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "plan", rename_all = "kebab-case")]
pub enum March {
    /// The 2005 paper, section 5.1: the same number of samples in every tetrahedron.
    Paper {
        /// At least 1.
        samples: u32,
    },
    /// Midpoints by length: `ceil(length / step)`, at least one.
    Default {
        /// In texels of the level of detail that the sample is read from; positive.
        step: f64,
    },
    /// Cell by cell of texel centres, where the texture is a cubic along the ray, by three-point Gauss-Legendre.
    /// Optical depth is exact where the texture holds extinction. Tetrahedra in cycles are marched by midpoints all the same,
    /// eight a texel.
    Exact,
}

/// How the `shell` method goes from one tetrahedron on a ray to the next.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Traversal {
    /// Each ray walks by adjacency, and stops where nothing more is seen. Plans other than the default are drawn in order all the same.
    #[default]
    Walk,
    /// All tetrahedra are sorted, and drawn in that order, as in the 2005 paper.
    Sort,
}

impl fmt::Display for March {
    /// For people: `"default plan, step 0.5"`.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Default { step } => write!(formatter, "default plan, step {step}"),
            Self::Paper { samples: 1 } => write!(formatter, "paper plan, 1 sample"),
            Self::Paper { samples } => write!(formatter, "paper plan, {samples} samples"),
            Self::Exact => write!(formatter, "exact plan"),
        }
    }
}

impl Default for March {
    /// Two samples a texel.
    fn default() -> Self {
        Self::Default { step: 0.5 }
    }
}

/// The mean lengths, in world units, of the edges of a texel along u, v and w, where a texture of `size` texels fills the
/// shell: of all tetrahedra that the texture is not flat in, weighted by volume.
pub fn texel_edges(shell: &Shell, size: [u32; 3]) -> [f64; 3] {
    let mut edges = DVec3::ZERO;
    let mut volume = 0.0;
    for (cell, vertices) in shell.cells().iter().zip(&shell.topology.tetrahedra) {
        let world_from_texture = cell.texture_from_world.inverse();
        if world_from_texture.is_finite() {
            let [a, b, c, d] = vertices.map(|vertex| shell.vertices[vertex as usize]);
            let weight = (b - a).cross(c - a).dot(d - a).abs();
            let [u, v, w] = [0, 1, 2].map(|axis| world_from_texture.col(axis).length());
            edges += weight * DVec3::new(u, v, w);
            volume += weight;
        }
    }
    // Nowhere is there a texel: any length will do.
    let edges = if volume > 0.0 { edges / volume } else { DVec3::ONE };
    [0, 1, 2].map(|axis| edges[axis] / f64::from(size[axis]))
}

impl Scene {
    /// Whether a light casts shadows.
    pub fn casts_shadows(&self) -> bool {
        self.shading.as_ref().is_some_and(Shading::casts_shadows)
    }

    /// Whether `other` has the same picture because nothing in it is another. Of large parts that are not shared it is not known.
    pub fn shows_the_same(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.shell, &other.shell)
            && Arc::ptr_eq(&self.volume, &other.volume)
            && Arc::ptr_eq(&self.solids, &other.solids)
            && (self.medium, self.view, self.march) == (other.medium, other.view, other.march)
            && (self.traversal, self.end_below, self.skips) == (other.traversal, other.end_below, other.skips)
            && self.shading == other.shading
    }

    /// The pyramid above the same full volume by another filter.
    pub fn filtered(&self, filter: Filter) -> Pyramid {
        let full = self.volume.levels[0].clone();
        let texel = texel_edges(&self.shell, full.size).map(|edge| edge / self.medium.opacity_distance);
        Pyramid::build_with(full, filter, texel)
    }

    /// A shell filled with a texture, whose opacity is that of a path of `opacity_distance` world units: all of
    /// it in a picture of 512 x 512 pixels, at the default level of detail and step.
    pub fn new(shell: Shell, volume: Pyramid, opacity_distance: f64) -> Self {
        let camera = Camera::framing(&shell.vertices);
        Self {
            shell: Arc::new(shell),
            volume: Arc::new(volume),
            medium: Medium { opacity_distance, lod_footprint: PIXEL_FOOTPRINT },
            shading: None,
            solids: Arc::default(),
            view: View { camera, width: 512, height: 512, depth: false },
            march: March::default(),
            traversal: Traversal::default(),
            end_below: END_BELOW,
            skips: Skips::default(),
        }
    }

    /// The largest density of level-0 texels across a ray, along any texture axis in a tetrahedron, in texels
    /// per world unit: `max_i size_i |row_i of texture_from_world x direction| / |direction|`.
    pub fn texels_across(&self, tetrahedron: usize, direction: DVec3) -> f64 {
        let map = self.shell.cells()[tetrahedron].texture_from_world;
        let size = self.volume.levels[0].size;
        let across = (0..3).map(|i| f64::from(size[i]) * map.row(i).cross(direction).length());
        across.fold(0.0, f64::max) / direction.length()
    }
}
