//! Splits every prism into three tetrahedra and finds which tetrahedra share a face.
//!
//! The vertices of a base triangle are sorted by position id, `a < b < c`; the prism becomes `(a,b,c,c')`,
//! `(a,b,b',c')`, `(a,a',b',c')`. The quad above an edge `lo < hi` is thereby always cut from `lo` to `hi'`,
//! whichever triangle looks at it, so that neighbouring prisms agree without asking each other
//! (Dompierre et al., "How to subdivide pyramids, prisms and hexahedra into tetrahedra", IMR 1999).

use rayon::prelude::*;

use super::{EXTERIOR, Topology};
use crate::mesh::Mesh;
use crate::{Error, Result};

/// A prism vertex as (rank of its base vertex in the sorted triangle, whether it is the outer one).
type PrismVertex = (usize, bool);

/// The split where the sorted triangle runs counter-clockwise; where it runs clockwise, the last two
/// vertices of each change places, so that volumes stay positive. Either way every face starts at its smallest
/// id.
const SPLIT: [[PrismVertex; 4]; 3] = [
    [(0, false), (1, false), (2, false), (2, true)],
    [(0, false), (1, false), (2, true), (1, true)],
    [(0, false), (0, true), (1, true), (2, true)],
];

/// The tetrahedra of a prism at the quad opposite the base vertex of each rank: the one below the quad's
/// diagonal, the one above.
const AT_QUAD: [[usize; 2]; 3] = [[0, 1], [0, 2], [1, 2]];

/// The faces inside a prism: a tetrahedron, the vertex that its face lies opposite, and the same for the
/// tetrahedron beyond.
const INSIDE: [[(usize, PrismVertex); 2]; 2] =
    [[(0, (2, false)), (1, (1, true))], [(1, (1, false)), (2, (0, true))]];

/// One side of a base triangle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Side {
    /// Position ids at its ends.
    low: u32,
    high: u32,
    triangle: u32,
    /// The corner (0..3) of the triangle that it lies opposite.
    opposite: u8,
    /// Whether the triangle runs from `low` to `high`.
    ascending: bool,
}

impl Topology {
    /// Splits and connects the prisms above a mesh's triangles.
    ///
    /// # Errors
    /// [`Error::Usage`] where a triangle names a position that does not exist or names one twice, and where
    /// the shell would need more than `u32` ids.
    pub(super) fn of(mesh: &Mesh) -> Result<Self> {
        let ids = mesh.triangles.len().saturating_mul(3).max(mesh.positions.len().saturating_mul(2));
        if ids >= EXTERIOR as usize {
            let message = format!(
                "the mesh is too large for a shell: {} triangles, {} positions",
                mesh.triangles.len(),
                mesh.positions.len()
            );
            let help = Some("a shell holds fewer than 1,431,655,765 base triangles".into());
            return Err(Error::Usage { message, help });
        }
        let base_vertices = mesh.positions.len() as u32;
        for (index, &[a, b, c]) in mesh.triangles.iter().enumerate() {
            let broken = if a.max(b).max(c) >= base_vertices {
                "names a position that does not exist"
            } else if a == b || b == c || c == a {
                "names a position twice"
            } else {
                continue;
            };
            let message = format!(
                "mesh triangle {index} ({a}, {b}, {c}) {broken}; there are {base_vertices} positions"
            );
            return Err(Error::Usage { message, help: Some("remove the triangle from the mesh".into()) });
        }

        let mut topology = Self { base_vertices, ..Self::default() };
        for &triangle in &mesh.triangles {
            topology.split(triangle);
        }
        topology.connect(mesh);
        Ok(topology)
    }

    /// Appends the three tetrahedra of one prism, connected to one another.
    fn split(&mut self, triangle: [u32; 3]) {
        let corner_of_rank = corners_by_position(triangle);
        let clockwise = is_odd(corner_of_rank);
        let base_vertices = self.base_vertices;
        let id = |(rank, outer): PrismVertex| {
            triangle[corner_of_rank[rank]] + if outer { base_vertices } else { 0 }
        };
        let first = self.tetrahedra.len();
        for mut vertices in SPLIT {
            if clockwise {
                vertices.swap(2, 3);
            }
            self.tetrahedra.push(vertices.map(id));
            self.corners.push(vertices.map(|(rank, _)| corner_of_rank[rank] as u8));
            self.neighbours.push([EXTERIOR; 4]);
        }
        for shared in INSIDE {
            let [x, y] = shared.map(|(t, vertex)| {
                let t = first + t;
                (t, place_of(id(vertex), self.tetrahedra[t]))
            });
            self.join(x, y);
        }
    }

    /// Connects the prisms across the edges that exactly two triangles share, one in each direction, and
    /// counts the others.
    fn connect(&mut self, mesh: &Mesh) {
        let mut sides: Vec<Side> = mesh
            .triangles
            .par_iter()
            .enumerate()
            .flat_map_iter(|(index, &triangle)| {
                (0..3).map(move |opposite| {
                    let [from, to] = [1, 2].map(|step| triangle[(opposite + step) % 3]);
                    Side {
                        low: from.min(to),
                        high: from.max(to),
                        triangle: index as u32,
                        opposite: opposite as u8,
                        ascending: from < to,
                    }
                })
            })
            .collect();
        sides.par_sort_unstable();
        for edge in sides.chunk_by(|x, y| (x.low, x.high) == (y.low, y.high)) {
            match edge {
                [_] => self.boundary_edges += 1,
                [x, y] if x.ascending != y.ascending => {
                    let [xs, ys] = [x, y].map(|side| self.quad(mesh, side));
                    self.join(xs[0], ys[0]);
                    self.join(xs[1], ys[1]);
                }
                _ => self.non_manifold_edges += 1,
            }
        }
    }

    /// The two faces, as (tetrahedron, face), above one side of a triangle.
    fn quad(&self, mesh: &Mesh, side: &Side) -> [(usize, usize); 2] {
        let triangle = mesh.triangles[side.triangle as usize];
        let apex = triangle[side.opposite as usize];
        let rank = triangle.iter().filter(|&&id| id < apex).count();
        AT_QUAD[rank].map(|t| {
            let t = 3 * side.triangle as usize + t;
            (t, place_of(side.opposite, self.corners[t]))
        })
    }

    /// Makes two (tetrahedron, face) neighbours of each other.
    fn join(&mut self, x: (usize, usize), y: (usize, usize)) {
        self.neighbours[x.0][x.1] = y.0 as u32;
        self.neighbours[y.0][y.1] = x.0 as u32;
    }
}

/// The triangle's corners in ascending order of their position ids.
fn corners_by_position(triangle: [u32; 3]) -> [usize; 3] {
    let mut corners = [0, 1, 2];
    corners.sort_unstable_by_key(|&corner| triangle[corner]);
    corners
}

/// Whether a permutation of three is a single exchange.
fn is_odd(permutation: [usize; 3]) -> bool {
    !matches!(permutation, [0, 1, 2] | [1, 2, 0] | [2, 0, 1])
}

/// Where `item` stands among four; it is known to be there.
fn place_of<T: PartialEq>(item: T, items: [T; 4]) -> usize {
    items.iter().position(|x| *x == item).expect("the split names each prism vertex where it stands")
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use glam::{DVec2, DVec3};

    use super::*;

    fn topology(triangles: &[[u32; 3]]) -> Result<Topology> {
        let positions = triangles.iter().flatten().max().map_or(0, |&id| id as usize + 1);
        Topology::of(&Mesh {
            positions: vec![DVec3::ZERO; positions],
            normals: vec![DVec3::Z; positions],
            triangles: triangles.to_vec(),
            uvs: vec![[DVec2::ZERO; 3]; triangles.len()],
        })
    }

    fn as_sets(tetrahedra: &[[u32; 4]]) -> Vec<BTreeSet<u32>> {
        tetrahedra.iter().map(|ids| ids.iter().copied().collect()).collect()
    }

    fn interior_faces(topology: &Topology) -> usize {
        topology.neighbours.iter().flatten().filter(|&&t| t != EXTERIOR).count()
    }

    #[test]
    fn every_winding_gives_the_same_three_tetrahedra() {
        let expected = as_sets(&[[0, 1, 2, 5], [0, 1, 4, 5], [0, 3, 4, 5]]);
        for triangle in [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]] {
            let topology = topology(&[triangle]).unwrap();
            assert_eq!(as_sets(&topology.tetrahedra), expected);
            for (ids, corners) in topology.tetrahedra.iter().zip(&topology.corners) {
                assert_eq!(corners.map(|corner| triangle[corner as usize]), ids.map(|id| id % 3));
            }
            assert_eq!(interior_faces(&topology), 4, "two shared faces, seen from both sides");
        }
        let other = topology(&[[0, 1, 3]]).unwrap();
        assert_ne!(as_sets(&other.tetrahedra), expected);
    }

    #[test]
    fn an_edge_of_two_opposed_triangles_joins_their_prisms() {
        let topology = topology(&[[0, 1, 2], [2, 1, 3]]).unwrap();
        assert_eq!((topology.boundary_edges, topology.non_manifold_edges), (4, 0));
        assert_eq!(interior_faces(&topology), 2 * 4 + 2 * 2);
    }

    #[test]
    fn an_edge_of_two_triangles_that_run_the_same_way_is_exterior() {
        let topology = topology(&[[0, 1, 2], [1, 2, 3]]).unwrap();
        assert_eq!((topology.boundary_edges, topology.non_manifold_edges), (4, 1));
        assert_eq!(interior_faces(&topology), 2 * 4);
    }

    #[test]
    fn an_edge_of_three_triangles_is_exterior() {
        let topology = topology(&[[0, 1, 2], [1, 0, 3], [0, 1, 4]]).unwrap();
        assert_eq!((topology.boundary_edges, topology.non_manifold_edges), (6, 1));
        assert_eq!(interior_faces(&topology), 3 * 4);
    }

    #[test]
    fn a_sheet_with_two_sides_is_closed() {
        let topology = topology(&[[0, 1, 2], [0, 2, 1]]).unwrap();
        assert_eq!((topology.boundary_edges, topology.non_manifold_edges), (0, 0));
        assert_eq!(interior_faces(&topology), 2 * 4 + 3 * 4);
    }

    #[test]
    fn no_triangles_make_an_empty_topology() {
        assert_eq!(topology(&[]).unwrap(), Topology::default());
    }

    #[test]
    fn a_triangle_that_names_a_position_twice_or_one_too_many_is_refused() {
        let message = topology(&[[0, 1, 2], [3, 1, 3]]).unwrap_err().to_string();
        assert!(message.contains("triangle 1 (3, 1, 3) names a position twice"), "{message}");

        let mesh = Mesh { triangles: vec![[0, 1, 2]], positions: vec![DVec3::ZERO; 2], ..Mesh::default() };
        let message = Topology::of(&mesh).unwrap_err().to_string();
        assert!(message.contains("does not exist; there are 2 positions"), "{message}");
    }
}
