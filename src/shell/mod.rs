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

use std::sync::Arc;

use glam::{DMat3, DVec2, DVec3};

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
}

/// The affine maps of one tetrahedron. All zero where its volume is zero.
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
    /// World units; positive and finite.
    pub thickness: f64,
    /// Factor on the thickness, one a position; empty means 1 everywhere.
    pub thickness_scale: Vec<f64>,
    /// Rounds of neighbourhood averaging applied to the extrusion directions.
    pub smoothing_rounds: u32,
    /// Texture coordinates are `uv_scale * uv + uv_offset`.
    pub uv_scale: DVec2,
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
    /// Volume exactly zero (by exact arithmetic on the vertices): never drawn, still in the order.
    pub zero_volume: u64,
    /// Shape quality below [`SLIVER_QUALITY`], but not of zero volume.
    pub slivers: u64,
    /// See [`Topology::non_manifold_edges`].
    pub non_manifold_edges: u64,
    /// Edges with one triangle.
    pub boundary_edges: u64,
    /// Vertices where the thickness exceeds the smallest radius of curvature on the concave side.
    pub overlap_risk_vertices: u64,
}

/// Below this quality (1 for a regular tetrahedron, 0 for a flat one) a tetrahedron is a sliver.
pub const SLIVER_QUALITY: f64 = 1e-3;

/// The extruded, split mesh with its maps.
#[derive(Debug, Clone, PartialEq)]
pub struct Shell {
    /// Shared between the frames of a deforming mesh.
    pub topology: Arc<Topology>,
    /// World space: base vertices, then outer vertices.
    pub vertices: Vec<DVec3>,
    /// Texture-space (u, v, w) of the four vertices of each tetrahedron.
    pub texture: Vec<[DVec3; 4]>,
    /// One a tetrahedron.
    pub cells: Vec<Cell>,
    /// Counted when the shell was built.
    pub health: Health,
}
