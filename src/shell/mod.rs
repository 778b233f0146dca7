//! The shell: prisms extruded from the base mesh, split into tetrahedra.
//!
//! ```text
//!        a'-------c'        w = 1, outer surface: shell vertex ids n..2n
//!        | \   / |
//!        |   b'  |          prism of the triangle (a, b, c), a < b < c by position id
//!        a - | - c          tetrahedra (a,b,c,c')  (a,b,b',c')  (a,a',b',c')
//!          \ | /
//!            b              w = 0, base surface: shell vertex ids 0..n
//! ```
//!
//! Within a tetrahedron the four vertices are stored so that `det(v1-v0, v2-v0, v3-v0)` is positive
//! in a shell that is not inverted; face `k` is the face opposite vertex `k`.
//!
//! The scheme is section 3 of Dufort, Leblanc, Poulin, "Interactive rendering of meso-structure surface
//! details using semi-transparent 3D textures", VMV 2005. `topology` splits and connects, `extrude`
//! places the outer vertices, `cell` computes the maps, `frames` smooths them, `health` counts what is wrong.

mod build;
mod cell;
mod extrude;
mod frames;
mod health;
mod limit;
mod topology;
mod wind;

use std::sync::{Arc, OnceLock};

pub(crate) use cell::determinant;
pub use frames::{FrameKind, Frames};
use glam::{DAffine3, DMat3, DVec2, DVec3, DVec4};
use rayon::prelude::*;
pub use wind::Wind;

/// In [`Topology::neighbours`]: no tetrahedron lies beyond that face.
pub const EXTERIOR: u32 = u32::MAX;

/// What connects to what: built once, kept while vertices move.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Topology {
    /// `n`: shell vertices `0..n` are the mesh's positions, `n..2n` their extrusions.
    pub base_vertices: u32,
    /// Shell vertex ids; tetrahedra `3i..3i+3` belong to base triangle `i`.
    pub tetrahedra: Vec<[u32; 4]>,
    /// The tetrahedron that shares face `k`, or [`EXTERIOR`]. Symmetric.
    pub neighbours: Vec<[u32; 4]>,
    /// Which corner (0..3) of its base triangle each vertex stands on or above.
    pub corners: Vec<[u8; 4]>,
    /// Edges with three or more triangles, or with two that run the same way; the prism sides there
    /// are exterior faces.
    pub non_manifold_edges: u64,
    /// Edges with one triangle; the prism sides there are exterior faces.
    pub boundary_edges: u64,
}

/// The affine maps of one tetrahedron.
///
/// All zero where the volume is exactly zero, or so near zero that the maps would not be finite.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Cell {
    /// World-space gradients of the four barycentric coordinates: `gradients[k]` points from face `k`
    /// to vertex `k` and is 1 / height long, so that at a point `x` the barycentric coordinate is
    /// `b_k(x) = gradients[k] . (x - v)` for any vertex `v` of face `k`.
    pub gradients: [DVec3; 4],
    /// Linear part of the map from world space to texture space (u, v, w).
    pub texture_from_world: DMat3,
}

/// How the shell is built from the mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct ShellOptions {
    /// World units; positive, finite and not denormal.
    pub thickness: f64,
    /// Factor on the thickness, one a position; empty means 1 everywhere.
    pub thickness_scale: Vec<f64>,
    /// Rounds of neighbourhood averaging applied to the extrusion directions.
    pub smoothing_rounds: u32,
    /// What the outer vertices lean with, after the averaging.
    pub wind: Option<Wind>,
    /// Whether the shell is made thinner where it would fold.
    pub limited: bool,
    /// Texture coordinates are `R (uv_scale * uv) + uv_offset`, modulo 1; R turns by `uv_rotation`.
    pub uv_scale: DVec2,
    /// Radians, from u towards v: see `uv_scale`.
    pub uv_rotation: f64,
    /// See `uv_scale`.
    pub uv_offset: DVec2,
}

/// What is wrong with a shell, counted; nothing is dropped because of it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct Health {
    /// All tetrahedra.
    pub tetrahedra: u64,
    /// Negative volume: the shell folds over there.
    pub inverted: u64,
    /// Volume exactly zero (by exact arithmetic on the vertices), or the [`Cell`] zero for want of range: never
    /// drawn, still in the order.
    pub zero_volume: u64,
    /// Shape quality below [`SLIVER_QUALITY`], but not of zero volume.
    pub slivers: u64,
    /// See [`Topology::non_manifold_edges`].
    pub non_manifold_edges: u64,
    /// See [`Topology::boundary_edges`].
    pub boundary_edges: u64,
    /// Vertices where the thickness exceeds the smallest radius of curvature on the concave side, estimated
    /// along the edges.
    pub overlap_risk_vertices: u64,
}

/// Below this quality (1 for a regular tetrahedron, 0 for a flat one) a tetrahedron is a sliver.
pub const SLIVER_QUALITY: f64 = 1e-3;

/// The extruded, split mesh with its maps.
#[derive(Debug, Clone)]
pub struct Shell {
    /// Shared between the frames of a deforming mesh.
    pub topology: Arc<Topology>,
    /// World space: base vertices, then outer vertices.
    pub vertices: Arc<Vec<DVec3>>,
    /// Texture-space (u, v, w) of the four vertices of each tetrahedron; w is exactly 0 or 1.
    ///
    /// u and v repeat, so the largest whole numbers that leave none of the four negative are taken off
    /// (the same for all four, and for the whole prism): what is left keeps its precision in f32.
    pub texture: Arc<Vec<[DVec3; 4]>>,
    /// Six times the signed volume of each tetrahedron, in cubic world units, with the exact sign: negative where it is inverted. Zero
    /// also where it has a volume so near zero that its maps would not be finite.
    pub determinants: Vec<f64>,
    /// See [`Shell::cells`], which makes them when they are first needed: whoever changes any of the above afterwards must
    /// [`measure`](Shell::measure) the shell anew.
    maps: OnceLock<Vec<Cell>>,
    /// What `texture` was made from: the transformed UVs of each triangle.
    uvs: Arc<Vec<[DVec2; 3]>>,
    /// Counted when the shell was built.
    pub health: Health,
    /// Where it was made thinner than asked.
    pub limit: Option<Limit>,
}

/// Where a shell gave way to the limit on its thickness: see [`ShellOptions::limited`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limit {
    /// How many positions of the mesh are below their full thickness.
    pub vertices: u64,
    /// The least factor on a thickness.
    pub least: f64,
    /// The mesh's position that has it.
    pub at: DVec3,
}

/// The corners of face `k`, counter-clockwise seen from outside a tetrahedron of positive volume.
const FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

impl ShellOptions {
    /// A shell of even thickness (world units) along the mesh's own normals, with its own UVs.
    pub fn new(thickness: f64) -> Self {
        Self {
            thickness,
            thickness_scale: Vec::new(),
            smoothing_rounds: 0,
            wind: None,
            limited: false,
            uv_scale: DVec2::ONE,
            uv_rotation: 0.0,
            uv_offset: DVec2::ZERO,
        }
    }
}

impl Topology {
    /// Shell vertex ids of face `k` of tetrahedron `t`, counter-clockwise seen from outside when the
    /// tetrahedron's volume is positive, starting at the smallest.
    ///
    /// The tetrahedron beyond thus sees the same three from the same start, the other way round: what both
    /// compute from their edges is the same to the bit, up to its sign.
    pub fn face(&self, t: usize, k: usize) -> [u32; 3] {
        FACES[k].map(|corner| self.tetrahedra[t][corner])
    }
}

impl PartialEq for Shell {
    fn eq(&self, other: &Self) -> bool {
        let Self { topology, vertices, texture, determinants, maps: _, uvs: _, health, limit } = self;
        (topology, vertices, texture) == (&other.topology, &other.vertices, &other.texture)
            && (determinants, health, limit) == (&other.determinants, &other.health, &other.limit)
    }
}

impl Shell {
    /// The maps of each tetrahedron. They are made when they are first asked for: a frame of an unlit scene needs none.
    pub fn cells(&self) -> &[Cell] {
        if self.maps.get().is_none() {
            let map = |t| cell::maps(self.vertices_of(t), self.texture[t], self.determinants[t]);
            // Outside of the lock: a thread of the pool that waited for it could be the one to make them.
            let maps = (0..self.determinants.len()).into_par_iter().map(map).collect();
            let _ = self.maps.set(maps); // unless another was faster, with the same
        }
        self.maps.get().expect("set above")
    }

    /// Whether tetrahedron `t` has maps: nothing is drawn of one without.
    pub fn has_maps(&self, t: usize) -> bool {
        self.determinants[t] != 0.0
    }

    /// World-space vertices of tetrahedron `t`.
    pub fn vertices_of(&self, t: usize) -> [DVec3; 4] {
        self.topology.tetrahedra[t].map(|id| self.vertices[id as usize])
    }

    /// See [`Topology::face`].
    pub fn face(&self, t: usize, k: usize) -> [u32; 3] {
        self.topology.face(t, k)
    }

    /// The paper's 3x4 matrix `M^{o->t}` of tetrahedron `t`: world space to texture space.
    ///
    /// Far from the world's origin its translation cancels against its linear part; where that matters,
    /// use [`Cell::texture_from_world`] relative to a vertex. Where the [`Cell`] is zero, everything maps to
    /// the first vertex's texture coordinates.
    pub fn texture_from_world(&self, t: usize) -> DAffine3 {
        let linear = self.cells()[t].texture_from_world;
        let [origin, ..] = self.vertices_of(t);
        DAffine3 { matrix3: linear, translation: self.texture[t][0] - linear * origin }
    }

    /// The plane of each face of tetrahedron `t` as `(n, d)`: `n` of unit length, in world space, and
    /// `n . x + d >= 0` inside. All zero where the [`Cell`] is zero.
    ///
    /// The two tetrahedra at a shared face get the same plane, bit for bit, up to its sign.
    pub fn planes(&self, t: usize) -> [DVec4; 4] {
        std::array::from_fn(|k| {
            let corners = self.face(t, k).map(|id| self.vertices[id as usize]);
            let area = cell::area_vector(corners);
            let inward = self.cells()[t].gradients[k].dot(area);
            if inward == 0.0 {
                return DVec4::ZERO;
            }
            let normal = area.normalize() * inward.signum();
            normal.extend(-normal.dot(corners[0]))
        })
    }

    /// Barycentric coordinates of a world-space point in tetrahedron `t`: none is negative inside. All zero
    /// where the [`Cell`] is zero.
    pub fn barycentric(&self, t: usize, point: DVec3) -> [f64; 4] {
        let vertices = self.vertices_of(t);
        std::array::from_fn(|k| self.cells()[t].gradients[k].dot(point - vertices[FACES[k][0]]))
    }
}
