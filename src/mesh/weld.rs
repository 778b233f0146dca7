//! Welding: one id for each place, whatever corners, seams or objects of a file meet there.

use std::collections::HashMap;

use glam::DVec3;

use super::Mesh;

/// A mesh without two equal positions, and what it cost.
#[derive(Debug, Clone, PartialEq)]
pub struct Welded {
    /// The mesh; an id comes from the first position that had its value, and so does the normal.
    pub mesh: Mesh,
    /// Triangles dropped because fewer than three different positions were left to them.
    pub dropped_triangles: usize,
}

/// Merges positions that are equal bit for bit (0 and -0 count as equal), drops the triangles that
/// collapse, and drops the positions that no triangle uses.
///
/// `mesh.normals` has one normal a position and `mesh.uvs` one entry a triangle, as always; ids must
/// be in range.
pub fn weld(mesh: Mesh) -> Welded {
    let mut first_at = HashMap::with_capacity(mesh.positions.len());
    let first_like: Vec<u32> =
        (0..).zip(&mesh.positions).map(|(id, &p)| *first_at.entry(place(p)).or_insert(id)).collect();

    let mut welded = Mesh::default();
    let mut new_ids = vec![None; mesh.positions.len()];
    for (triangle, uvs) in mesh.triangles.iter().zip(&mesh.uvs) {
        let [a, b, c] = triangle.map(|id| first_like[id as usize]);
        if a == b || b == c || c == a {
            continue;
        }
        welded.triangles.push([a, b, c].map(|id| {
            *new_ids[id as usize].get_or_insert_with(|| {
                welded.positions.push(mesh.positions[id as usize]);
                welded.normals.push(mesh.normals[id as usize]);
                welded.positions.len() as u32 - 1
            })
        }));
        welded.uvs.push(*uvs);
    }
    let dropped_triangles = mesh.triangles.len() - welded.triangles.len();
    Welded { mesh: welded, dropped_triangles }
}

/// The bits of a position, alike for 0 and -0.
fn place(position: DVec3) -> [u64; 3] {
    position.to_array().map(|x| (x + 0.0).to_bits())
}
