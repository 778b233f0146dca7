//! The base mesh: triangles with positions, normals and texture coordinates.

pub mod deform;
pub mod figure;
pub mod flow;
pub mod generate;
pub mod gltf;
pub mod info;
pub mod model;
pub mod normals;
pub mod obj;
pub mod projection;
pub mod weld;

use glam::{DVec2, DVec3};

pub use generate::Generator;
pub use info::{Info, info};
pub use projection::Projection;

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

/// The largest coordinate that a mesh may have, in world units: products of three stay finite by far.
pub const LARGEST_COORDINATE: f64 = 1e32;

impl Mesh {
    /// The least mesh that there is: a right angle at the origin, legs of length 1 along X and Y, facing Z; (u, v) is (x, y).
    pub fn triangle() -> Self {
        Self {
            positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y],
            normals: vec![DVec3::Z; 3],
            triangles: vec![[0, 1, 2]],
            uvs: vec![[DVec2::ZERO, DVec2::X, DVec2::Y]],
        }
    }

    /// Checks what every builder promises, except that no two positions are equal: that is
    /// [`weld`](weld::weld)'s work.
    ///
    /// # Errors
    /// The first thing that is wrong, in a sentence.
    pub fn validate(&self) -> std::result::Result<(), String> {
        let Self { positions, normals, triangles, uvs } = self;
        if triangles.is_empty() {
            return Err("the mesh has no triangle".into());
        }
        if normals.len() != positions.len() || uvs.len() != triangles.len() {
            return Err(format!(
                "the mesh has {} normals for {} positions and {} texture triangles for {} triangles",
                normals.len(),
                positions.len(),
                uvs.len(),
                triangles.len()
            ));
        }
        // These comparisons are false for NaN.
        let is_near = |p: &DVec3| p.to_array().iter().all(|x| x.abs() <= LARGEST_COORDINATE);
        if let Some(id) = positions.iter().position(|p| !is_near(p)) {
            return Err(format!("position {id} is {}: not finite, or beyond 1e32", positions[id]));
        }
        // A normal that was normalised once is off by at most a few units in the last place, 2e-16.
        let is_unit = |n: &DVec3| (n.length() - 1.0).abs() <= 1e-12;
        if let Some(id) = normals.iter().position(|n| !is_unit(n)) {
            return Err(format!("normal {id} is {}: not of unit length", normals[id]));
        }
        for (triangle, &[a, b, c]) in triangles.iter().enumerate() {
            if a == b || b == c || c == a || a.max(b).max(c) as usize >= positions.len() {
                return Err(format!(
                    "triangle {triangle} has the position ids {a}, {b}, {c}: they must be different and \
                     less than {}",
                    positions.len()
                ));
            }
        }
        match uvs.iter().position(|corners| !corners.iter().all(|uv| uv.is_finite())) {
            Some(triangle) => Err(format!("the texture coordinates of triangle {triangle} are not finite")),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn validation_finds_each_defect() {
        let good = Mesh::triangle();
        assert_eq!(good.validate(), Ok(()));
        type Spoil = fn(&mut Mesh);
        let defects: [(Spoil, &str); 7] = [
            (|mesh| *mesh = Mesh::default(), "no triangle"),
            (|mesh| mesh.normals.truncate(2), "2 normals"),
            (|mesh| mesh.positions[1].y = f64::NAN, "position 1"),
            (|mesh| mesh.normals[2] *= 1.1, "normal 2"),
            (|mesh| mesh.triangles[0][1] = 3, "ids 0, 3, 2"),
            (|mesh| mesh.triangles[0][1] = 2, "different"),
            (|mesh| mesh.uvs[0][1].x = f64::INFINITY, "texture coordinates"),
        ];
        for (spoil, words) in defects {
            let mut mesh = good.clone();
            spoil(&mut mesh);
            let message = mesh.validate().unwrap_err();
            assert!(message.contains(words), "{message:?} should say {words:?}");
        }
    }
}
