//! How a lit scene's colours come about. This is part of the medium, as the level of detail is: the `shell` method and the
//! reference both obey it, each with its own code. Without it a texel's colour is what it sends out.
//!
//! At a point on a ray the texture has the straight colour `c`, and its [`Directions`] the filtered vector `V` of weight `W`,
//! both at the medium's level of detail. Then
//!
//! ```text
//!   colour = c (ambient + sum of E diffuse D + G) + sum of E specular S      over all lights
//!
//!   a = |V| / W, at most 1                how far the directions filtered here agree; 0 where there is none
//!   d = F V / |F V|                       in world space; F: the shell's Frames, interpolated
//!   l, e, h                               to the light, to the eye, half-way between the two; of unit length
//!   E                                     what reaches the point from the light: shadow, falloff
//!   G = glow max(0, min(1, (m - from) / (1 - from)))   what the texel sends out itself; m: the largest of red, green, blue of c
//!
//!   surface:  D = a max(0, d.l) + (1 - a) / 4
//!             S = a max(0, d.l) max(0, d.h)^shininess
//!   fibre:    D = a sin(d, l) + (1 - a) pi / 4
//!             S = a max(0, sin(d, l) sin(d, e) - (d.l)(d.e))^shininess
//! ```
//!
//! - Where directions disagree, in a coarse level or between two strands, a part `1 - a` of the texture is taken for particles
//!   of every direction: `1/4` and `pi/4` are the means of `max(0, d.l)` and `sin(d, l)` over the sphere. So the colour has no
//!   jump where `V` passes through zero, and fog of one density is lit evenly.
//! - A volume has no back: a normal that faces away from the eye is not turned round, and light from behind gives it nothing.
//! - `surface` is J. H. Lambert's law and J. F. Blinn, *Models of light reflection for computer synthesized pictures*, 1977,
//!   whose highlight is a reflectance here: the factor `d.l` lets it end where the light does, without an edge.
//! - `fibre` is J. T. Kajiya, T. L. Kay, *Rendering fur with three dimensional textures*, 1989, for vectors that all point away
//!   from the fibre: a cylinder mirrors light into the cone about it on the other side, hence the minus.
//! - The glow is the paper's (section 5.3): colours select the voxels "where light is added in the integral".
//! - A light casts shadows where [`Light::shadow`] says so: see [`shadow`](super::shadow).

use std::sync::Arc;

use glam::DVec3;
use serde::Deserialize;

use crate::shell::FrameKind;
use crate::volume::Directions;

/// The most lights of a scene; each costs at every sample.
pub const MOST_LIGHTS: usize = 64;

/// The least of [`Shading::shadow_size`].
pub const LEAST_SHADOW_SIZE: u32 = 16;

/// [`Shading::shadow_size`] where nothing else is said.
pub const DEFAULT_SHADOW_SIZE: u32 = 1024;

/// Material and lights of a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Shading {
    /// What a texel's direction is.
    pub model: Model,
    /// Light from everywhere; linear, each at least 0.
    pub ambient: DVec3,
    /// Factor on `D`, at least 0.
    pub diffuse: f64,
    /// Factor on `S`, at least 0.
    pub specular: f64,
    /// Exponent of `S`, at least 1.
    pub shininess: f64,
    /// What texels send out of themselves.
    pub emission: Emission,
    /// Pixels a side of the pictures that lights with shadows take: see [`shadow`](super::shadow). At least
    /// [`LEAST_SHADOW_SIZE`].
    pub shadow_size: u32,
    /// At most [`MOST_LIGHTS`].
    pub lights: Vec<Light>,
    /// Normals or tangents, one a texel of the scene's volume, with as many levels.
    pub directions: Arc<Directions>,
}

/// What texels send out of themselves: `G` at the head of this module. Bright colours glow, others do not.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Emission {
    /// Factor, at least 0.
    pub glow: f64,
    /// The brightness, 0 or above and below 1, from which a colour begins to glow; it does so fully from 1 on.
    pub from: f64,
}

/// How light is sent on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Model {
    /// Directions are normals.
    Surface,
    /// Directions are tangents.
    Fibre,
}

/// A light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Light {
    /// Where it is.
    pub source: Source,
    /// Linear, each at least 0; of a point light that of no distance.
    pub colour: DVec3,
    /// Whether the volume and the solids stand in its way.
    pub shadow: bool,
}

/// Where light comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Source {
    /// From infinitely far.
    Directional {
        /// World space, unit length: from every point *to* the light.
        towards: DVec3,
    },
    /// From one point.
    Point {
        /// World space.
        position: DVec3,
        /// The distance, in world units and above 0, at which half of the colour is left: at distance `r` it is
        /// `1 / (1 + (r / falloff)^2)`, far away the square of the distance, and nowhere infinite. `None`: the same everywhere.
        falloff: Option<f64>,
    },
}

impl Model {
    /// How its directions are taken to world space.
    pub fn frame_kind(self) -> FrameKind {
        match self {
            Self::Surface => FrameKind::Covectors,
            Self::Fibre => FrameKind::Vectors,
        }
    }
}

impl Shading {
    /// Whether any light does.
    pub fn casts_shadows(&self) -> bool {
        self.lights.iter().any(|light| light.shadow)
    }

    /// The largest of red, green and blue by which light multiplies a colour, and what it may add to that: no point of the
    /// scene is brighter than `colour * factor + added`.
    pub fn bounds(&self) -> (f64, f64) {
        let light: DVec3 = self.lights.iter().map(|light| light.colour).sum();
        (
            (self.ambient + self.diffuse * light).max_element() + self.emission.glow,
            self.specular * light.max_element(),
        )
    }
}
