//! Relations between tetrahedra that share a face: the one on the eye's side of the face is in front.
//!
//! Every sign is that of an exact adaptive predicate (Shewchuk 1997) on the world-space vertices, with
//! the vertices of a face in one canonical order (ascending ids): both tetrahedra read the same sign, so
//! rounding can make no false cycle. Which side of a face a tetrahedron lies on is the exact sign of its volume, not
//! its place in the mesh, so an inverted tetrahedron is related as it lies.
//!
//! | the two tetrahedra of a face | relation | the face in the A-buffer |
//! |---|---|---|
//! | on opposite sides of it | the eye's side is in front | no |
//! | one has no volume | the other's side decides | for the one with volume |
//! | both on one side (a fold) | none: they overlap, a ray leaves or enters both | for both |
//! | neither has volume | none | no |
//! | the eye lies in the face's plane | none: no ray crosses it | no |
//!
//! A tetrahedron without volume is met by a ray in one point, yet the order of its neighbours may run
//! through it. Their faces towards it are in the A-buffer too, so that nothing is lost where several such
//! tetrahedra lie behind one another.

use std::sync::atomic::{self, AtomicU8};

use glam::DVec3;
use rayon::prelude::*;
use robust::{Coord3D, orient3d};

use crate::shell::{EXTERIOR, Topology};

/// Faces that one task of the thread pool takes: some 0.1 ms of work.
const TASK: usize = 4096;

/// One face of the shell with the tetrahedra on it.
#[derive(Debug, Clone, Copy)]
struct Face {
    /// Ascending vertex ids: the canonical order.
    vertices: [u32; 3],
    /// The second is [`EXTERIOR`] where there is none.
    cells: [u32; 2],
    /// The face's number 0..4 in each of `cells`.
    local: [u8; 2],
    /// Factor from a cell's orientation to the side of this face on which the cell lies.
    parity: [i8; 2],
}

impl Face {
    /// On which side of the face each of its tetrahedra lies: the sign of `p . (q x r)` for its vertices relative to the fourth; 0
    /// where there is none, or none with volume.
    fn sides(&self, determinants: &[f64]) -> [i8; 2] {
        [0, 1].map(|i| match self.cells[i] {
            EXTERIOR => 0,
            cell => orientation_of(determinants[cell as usize]) * self.parity[i],
        })
    }

    /// The face as each of its tetrahedra has it, beyond which no other is known to follow.
    fn boundary(&self, sides: [i8; 2], eye_side: i8) -> [Option<BoundaryFace>; 2] {
        [0, 1].map(|i| {
            let is_boundary = eye_side != 0 && sides[i] != 0 && sides[1 - i] != -sides[i];
            let (vertices, cell, local) = (self.vertices, self.cells[i], self.local[i]);
            is_boundary.then_some(BoundaryFace {
                vertices,
                cell,
                local,
                leaves: sides[i] == eye_side,
                eye_side,
            })
        })
    }
}

/// The faces of a topology; kept while vertices move.
#[derive(Debug, Clone)]
pub struct FaceTable {
    faces: Vec<Face>,
}

/// A face of one tetrahedron beyond which no other is known to follow: the outside, a fold, or a
/// tetrahedron without volume.
#[derive(Debug, Clone, Copy)]
pub struct BoundaryFace {
    /// Ascending vertex ids.
    pub vertices: [u32; 3],
    /// The tetrahedron.
    pub cell: u32,
    /// The face's number in it.
    pub local: u8,
    /// A ray from the eye leaves the tetrahedron here; else it enters.
    pub leaves: bool,
    /// +1 or -1: the sign of `p . (q x r)` for the vertices relative to the eye.
    pub eye_side: i8,
}

/// What the faces tell about one view.
#[derive(Debug, Clone)]
pub struct Relations {
    /// `[front, back]` tetrahedra.
    pub pairs: Vec<[u32; 2]>,
    /// One a tetrahedron: bit `k` is set where the eye lies strictly on the inner side of face `k`,
    /// so that a ray leaves through it. 0 for a tetrahedron without volume.
    pub exit_faces: Vec<u8>,
    /// The faces that the A-buffer needs.
    pub boundary: Vec<BoundaryFace>,
}

/// -1, 0 or +1: the exact sign of `a . (b x c)`, all relative to `d`.
fn orientation(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> i8 {
    let coord = |v: DVec3| Coord3D { x: v.x, y: v.y, z: v.z };
    let determinant = orient3d(coord(a), coord(b), coord(c), coord(d));
    i8::from(determinant > 0.0) - i8::from(determinant < 0.0)
}

/// The [`orientation`] of the vertices of a tetrahedron, given six times its volume.
fn orientation_of(determinant: f64) -> i8 {
    i8::from(determinant < 0.0) - i8::from(determinant > 0.0)
}

/// The vertices of face `k` of a tetrahedron in canonical order, and the parity (+1, -1) of the
/// permutation that takes the tetrahedron's vertices to them and vertex `k`.
fn canonical_face(tetrahedron: [u32; 4], k: usize) -> ([u32; 3], i8) {
    let mut order = [(k + 1) % 4, (k + 2) % 4, (k + 3) % 4];
    order.sort_unstable_by_key(|&i| tetrahedron[i]);
    let permutation = [order[0], order[1], order[2], k];
    let inversions = (0..4).flat_map(|j| (0..j).map(move |i| (i, j)));
    let inversions = inversions.filter(|&(i, j)| permutation[i] > permutation[j]).count();
    (order.map(|i| tetrahedron[i]), if inversions % 2 == 0 { 1 } else { -1 })
}

impl FaceTable {
    /// Lists every face once.
    pub fn new(topology: &Topology) -> Self {
        let mut faces = Vec::with_capacity(topology.tetrahedra.len() * 5 / 2);
        for (cell, (&tetrahedron, neighbours)) in
            (0u32..).zip(topology.tetrahedra.iter().zip(&topology.neighbours))
        {
            for (k, &other) in neighbours.iter().enumerate() {
                if other < cell {
                    continue; // listed from the other side
                }
                let (vertices, parity) = canonical_face(tetrahedron, k);
                let mut face =
                    Face { vertices, cells: [cell, other], local: [k as u8, 0], parity: [parity, 0] };
                if other != EXTERIOR {
                    let opposite = topology.tetrahedra[other as usize];
                    let (k, (_, parity)) = (0..4)
                        .map(|k| (k, canonical_face(opposite, k)))
                        .find(|(_, (shared, _))| *shared == vertices)
                        .expect("neighbours share the face between them");
                    face.local[1] = k as u8;
                    face.parity[1] = parity;
                }
                faces.push(face);
            }
        }
        Self { faces }
    }

    /// The faces that the A-buffer needs, as in [`Relations::boundary`], in the same order.
    pub fn boundary(&self, determinants: &[f64], vertices: &[DVec3], eye: DVec3) -> Vec<BoundaryFace> {
        let at = |id: u32| vertices[id as usize];
        let of = |face: &Face| {
            let sides = face.sides(determinants);
            let is_boundary = sides[0] != -sides[1];
            let [a, b, c] = face.vertices;
            let eye_side = if is_boundary { orientation(at(a), at(b), at(c), eye) } else { 0 };
            face.boundary(sides, eye_side).into_iter().flatten()
        };
        let faces = self.faces.par_iter().with_min_len(1024);
        faces.map(of).flatten_iter().collect()
    }

    /// For each face of each tetrahedron the place, four times a tetrahedron and the number of its face, where a ray goes on that
    /// leaves through it; [`EXTERIOR`] where it does not: outside, at a fold, and at a tetrahedron without volume.
    pub fn beyond(&self, determinants: &[f64]) -> Vec<u32> {
        let mut beyond = vec![EXTERIOR; 4 * determinants.len()];
        for face in &self.faces {
            let sides = face.sides(determinants);
            if sides[0] == -sides[1] && sides[0] != 0 {
                let places = [0, 1].map(|i| 4 * face.cells[i] + u32::from(face.local[i]));
                beyond[places[0] as usize] = places[1];
                beyond[places[1] as usize] = places[0];
            }
        }
        beyond
    }

    /// Relates the tetrahedra of the topology of [`FaceTable::new`], whose volumes have the signs of `determinants` (see
    /// [`Shell::determinants`](crate::shell::Shell::determinants)), as seen from `eye`. `vertices` and `eye` are in world space.
    pub fn relate(&self, determinants: &[f64], vertices: &[DVec3], eye: DVec3) -> Relations {
        let at = |id: u32| vertices[id as usize];
        let exit_faces: Vec<AtomicU8> = determinants.iter().map(|_| AtomicU8::new(0)).collect();
        let of_some = |faces: &[Face]| {
            let mut pairs = Vec::with_capacity(faces.len());
            let mut boundary = Vec::new();
            for face in faces {
                let [a, b, c] = face.vertices;
                let eye_side = orientation(at(a), at(b), at(c), eye);
                if eye_side == 0 {
                    continue;
                }
                let sides = face.sides(determinants);
                for (i, cell) in face.cells.into_iter().enumerate() {
                    if sides[i] == eye_side {
                        exit_faces[cell as usize].fetch_or(1 << face.local[i], atomic::Ordering::Relaxed);
                    }
                }
                boundary.extend(face.boundary(sides, eye_side).into_iter().flatten());
                let [first, second] = face.cells;
                if second != EXTERIOR && sides[0] != sides[1] {
                    let first_in_front = sides[0] == eye_side || sides[1] == -eye_side;
                    pairs.push(if first_in_front { [first, second] } else { [second, first] });
                }
            }
            (pairs, boundary)
        };
        let parts: Vec<_> = self.faces.par_chunks(TASK).map(of_some).collect();
        let (pairs, boundary): (Vec<_>, Vec<_>) = parts.into_iter().unzip();
        let exit_faces = exit_faces.into_iter().map(AtomicU8::into_inner).collect();
        Relations { pairs: pairs.concat(), exit_faces, boundary: boundary.concat() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two tetrahedra on the face (0, 1, 2), with their fourth vertices 3 and 4 at heights `z`.
    fn two_on_a_face(z: [f64; 2]) -> (Topology, Vec<DVec3>) {
        let topology = Topology {
            tetrahedra: vec![[0, 1, 2, 3], [4, 1, 0, 2]],
            neighbours: vec![[EXTERIOR, EXTERIOR, EXTERIOR, 1], [0, EXTERIOR, EXTERIOR, EXTERIOR]],
            ..Topology::default()
        };
        let corner = DVec3::new(0.2, 0.2, 0.0);
        let fourth = z.map(|z| corner + z * DVec3::Z);
        (topology, vec![DVec3::ZERO, DVec3::X, DVec3::Y, fourth[0], fourth[1]])
    }

    fn seen_from(z: f64, heights: [f64; 2]) -> Relations {
        let (topology, vertices) = two_on_a_face(heights);
        let determinants: Vec<f64> = topology
            .tetrahedra
            .iter()
            .map(|ids| crate::shell::determinant(ids.map(|id| vertices[id as usize])))
            .collect();
        FaceTable::new(&topology).relate(&determinants, &vertices, DVec3::new(0.3, 0.1, z))
    }

    /// Tetrahedra with the shared face in the A-buffer.
    fn shared_in_boundary(relations: &Relations) -> Vec<(u32, bool)> {
        let shared = relations.boundary.iter().filter(|face| face.vertices == [0, 1, 2]);
        shared.map(|face| (face.cell, face.leaves)).collect()
    }

    #[test]
    fn the_eyes_side_is_in_front_inverted_or_not() {
        for (eye, heights, pair) in [
            (5.0, [1.0, -1.0], [0, 1]),
            (-5.0, [1.0, -1.0], [1, 0]),
            (5.0, [-1.0, 1.0], [1, 0]),
            (1e-300, [1.0, -1.0], [0, 1]),
        ] {
            let relations = seen_from(eye, heights);
            assert_eq!(relations.pairs, [pair]);
            assert!(shared_in_boundary(&relations).is_empty());
            assert_eq!(relations.exit_faces[0] >> 3 & 1, u8::from(pair[0] == 0));
            assert_eq!(relations.exit_faces[1] & 1, u8::from(pair[0] == 1));
        }
        assert!(seen_from(0.0, [1.0, -1.0]).pairs.is_empty());
    }

    #[test]
    fn a_fold_makes_no_relation_but_two_boundary_faces() {
        let relations = seen_from(5.0, [1.0, 2.0]);
        assert!(relations.pairs.is_empty());
        assert_eq!(shared_in_boundary(&relations), [(0, true), (1, true)]);
    }

    #[test]
    fn a_tetrahedron_without_volume_is_placed_by_its_neighbour() {
        for (eye, pair) in [(5.0, [0, 1]), (-5.0, [1, 0])] {
            let relations = seen_from(eye, [1.0, 0.0]);
            assert_eq!(relations.pairs, [pair]);
            assert_eq!(shared_in_boundary(&relations), [(0, eye > 0.0)]);
            assert_eq!(relations.exit_faces[1], 0);
        }
        let relations = seen_from(5.0, [0.0, 0.0]);
        assert!(relations.pairs.is_empty() && relations.boundary.is_empty());
    }
}
