//! The base mesh: triangles with positions, normals and texture coordinates.

pub mod generate;
pub mod weld;

use glam::{DVec2, DVec3};

/// A triangle mesh whose positions are welded: one id a place, whatever its texture seams.
///
/// World space is right-handed with Y up; the unit is the file's. Triangles are counter-clockwise
/// seen from outside (the side that normals point to).
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mesh {
    /// World space; all finite, no two equal.
    pub positions: Vec<DVec3>,
    /// One a position, unit length: the direction of extrusion. One a position, not one a corner,
    /// or the shell would tear open at creases.
    pub normals: Vec<DVec3>,
    /// Position ids.
    pub triangles: Vec<[u32; 3]>,
    /// Texture coordinates (u, v), one a triangle corner, so that seams cost nothing.
    pub uvs: Vec<[DVec2; 3]>,
}

impl Mesh {
    /// Adds the positions and triangles of another mesh; positions that both have stay apart until they
    /// are welded.
    fn append(&mut self, other: Self) {
        let offset = self.positions.len() as u32;
        self.positions.extend(other.positions);
        self.normals.extend(other.normals);
        self.triangles.extend(other.triangles.iter().map(|ids| ids.map(|id| id + offset)));
        self.uvs.extend(other.uvs);
    }
}
