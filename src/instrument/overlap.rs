//! Where the shell overlaps itself: the exact number of pairs of tetrahedra whose interiors intersect.
//!
//! Boxes around the tetrahedra are compared in a hierarchy (crate `bvh`), and pairs whose boxes meet are decided by the signs of
//! exact determinants (J. Shewchuk, *Adaptive precision floating-point arithmetic and fast robust geometric predicates*,
//! 1997; crate `robust`): tetrahedra that share a face, an edge or a vertex, or merely touch, are no pair, and those that
//! share the least volume are.
//!
//! Let P and Q be tetrahedra with volume. Their interiors are disjoint exactly if a plane `n . x = d` has P on one side and Q on
//! the other, points on the plane allowed (separation of convex sets). *Such a plane can always be found among those through
//! three of the eight vertices*: all `(n, d)` with `n . p <= d` for the vertices of P and `n . q >= d` for those of Q form a
//! polyhedral cone in four dimensions. With `(n, d)` it never holds `(-n, -d)`, unless all vertices of P lie in one plane, which
//! they do not: it has a tip, and so, where it is more than its tip, an extreme ray, at which three of its inequalities are
//! equalities, and independent. These are three vertices, not on a line, in the plane. So 56 planes decide: four faces of
//! each, and 48 through an edge of the one and a vertex of the other. Each is told by the determinants of four input vertices,
//! of whose signs none is rounded.

use bvh::aabb::{Aabb, Bounded};
use bvh::bounding_hierarchy::BHShape;
use bvh::bvh::Bvh;
use glam::DVec3;
use rayon::prelude::*;
use robust::{Coord3D, orient3d};
use serde::Serialize;

use super::LISTED;
use super::faults::centroid;
use crate::shell::Shell;

/// Two tetrahedra whose interiors intersect.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Pair {
    /// Their ids, ascending.
    pub tetrahedra: [u32; 2],
    /// Half way between their centroids, world space.
    pub at: [f64; 3],
}

/// Where a shell overlaps itself.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Overlaps {
    /// All pairs of tetrahedra whose interiors intersect.
    pub pairs: u64,
    /// The first of them by id, at most [`LISTED`].
    pub first: Vec<Pair>,
}

/// A tetrahedron with volume.
struct Solid {
    id: u32,
    vertices: [u32; 4],
    corners: [Coord3D<f64>; 4],
    bounds: Aabb<f64, 3>,
    node: usize,
}

/// A vertex: its id, and where it is.
type Point<'a> = (u32, &'a Coord3D<f64>);

impl Solid {
    fn point(&self, k: usize) -> Point<'_> {
        (self.vertices[k], &self.corners[k])
    }
}

impl Bounded<f64, 3> for Solid {
    fn aabb(&self) -> Aabb<f64, 3> {
        self.bounds
    }
}

impl BHShape<f64, 3> for Solid {
    fn set_bh_node_index(&mut self, node: usize) {
        self.node = node;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}

/// The pairs of a shell as it stands. Tetrahedra without volume have no interior.
pub fn overlaps(shell: &Shell) -> Overlaps {
    let solid = |t: usize| {
        let corners = shell.vertices_of(t);
        let [low, high] =
            [DVec3::min, DVec3::max].map(|far| corners.into_iter().reduce(far).expect("four").to_array());
        Solid {
            id: t as u32,
            vertices: shell.topology.tetrahedra[t],
            corners: corners.map(|DVec3 { x, y, z }| Coord3D { x, y, z }),
            bounds: Aabb::with_bounds(low.into(), high.into()),
            node: 0,
        }
    };
    let with_volume =
        (0..shell.topology.tetrahedra.len()).into_par_iter().filter(|&t| shell.determinant(t) != 0.0);
    let mut solids: Vec<Solid> = with_volume.map(solid).collect();
    if solids.is_empty() {
        return Overlaps::default();
    }
    let tree = Bvh::build(&mut solids);
    let pairs_of = |one: &Solid| {
        let near = tree.traverse_iterator(&one.bounds, &solids);
        let mut others: Vec<u32> = near
            .filter(|other| one.id < other.id && interiors_meet(one, other))
            .map(|other| other.id)
            .collect();
        others.sort_unstable();
        others.into_iter().map(move |other| [one.id, other]).collect::<Vec<_>>()
    };
    let pairs: Vec<[u32; 2]> = solids.par_iter().flat_map_iter(pairs_of).collect();
    let told = |&[a, b]: &[u32; 2]| Pair {
        tetrahedra: [a, b],
        at: (0.5 * (centroid(shell, a) + centroid(shell, b))).to_array(),
    };
    Overlaps { pairs: pairs.len() as u64, first: pairs.iter().take(LISTED).map(told).collect() }
}

/// The other three corners of each face.
const FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]];

const EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

fn interiors_meet(one: &Solid, other: &Solid) -> bool {
    // Most pairs are neighbours, which a face separates.
    let face = |of: &Solid, k: usize| separates(FACES[k].map(|corner| of.point(corner)), one, other);
    let mixed = |of: &Solid, beyond: &Solid, [p, q]: [usize; 2]| {
        (0..4).any(|k| separates([of.point(p), of.point(q), beyond.point(k)], one, other))
    };
    !(0..4).any(|k| face(one, k))
        && !(0..4).any(|k| face(other, k))
        && !EDGES.iter().any(|&edge| mixed(one, other, edge))
        && !EDGES.iter().any(|&edge| mixed(other, one, edge))
}

/// Whether the plane through three points has the two on different sides; three on a line have no plane.
fn separates(plane: [Point<'_>; 3], one: &Solid, other: &Solid) -> bool {
    match side(&plane, one) {
        Some(first) => side(&plane, other).is_some_and(|second| second != first),
        None => false,
    }
}

/// Whether all is on the positive side; `None` for a plane that cuts, or has all in it.
fn side(plane: &[Point<'_>; 3], of: &Solid) -> Option<bool> {
    let [p, q, r] = plane;
    let mut found = None;
    for k in 0..4 {
        let (id, corner) = of.point(k);
        // Exactly zero, without the exact arithmetic.
        if [p.0, q.0, r.0].contains(&id) {
            continue;
        }
        let sign = orient3d(*p.1, *q.1, *r.1, *corner);
        if sign == 0.0 {
            continue;
        }
        let is_positive = sign > 0.0;
        if found.is_some_and(|before| before != is_positive) {
            return None;
        }
        found = Some(is_positive);
    }
    found
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    use super::*;
    use crate::instrument::tests::torus;

    const CORNER: [DVec3; 4] = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];

    /// As if no vertex were shared.
    fn meet(a: [DVec3; 4], b: [DVec3; 4]) -> bool {
        let solid = |corners: [DVec3; 4], first: u32| Solid {
            id: first,
            vertices: [0, 1, 2, 3].map(|k| first + k),
            corners: corners.map(|DVec3 { x, y, z }| Coord3D { x, y, z }),
            bounds: Aabb::empty(),
            node: 0,
        };
        let (a, b) = (solid(a, 0), solid(b, 4));
        assert_eq!(interiors_meet(&a, &b), interiors_meet(&b, &a));
        interiors_meet(&a, &b)
    }

    #[test]
    fn what_merely_touches_does_not_overlap_and_the_least_volume_does() {
        let shifted = |by: DVec3| CORNER.map(|v| v + by);
        let tiny = f64::EPSILON;
        assert!(meet(CORNER, CORNER));
        assert!(meet(CORNER, CORNER.map(|v| 0.1 + 0.1 * v)), "one in the other");
        assert!(!meet(CORNER, shifted(DVec3::X)), "a vertex");
        assert!(meet(CORNER, shifted((1.0 - tiny) * DVec3::X)));
        let mirrored = CORNER.map(|v| v * DVec3::new(1.0, 1.0, -1.0));
        assert!(!meet(CORNER, mirrored), "a face");
        assert!(meet(CORNER, mirrored.map(|v| v + tiny * DVec3::Z)));
        assert!(!meet(CORNER, CORNER.map(|v| v * DVec3::new(1.0, -1.0, -1.0))), "an edge");
        // Two wedges whose edges cross at the origin: no face separates them, but a plane through both edges.
        let wedge = [-DVec3::X, DVec3::X, DVec3::new(0.0, 1.0, 1.0), DVec3::new(0.0, -1.0, 1.0)];
        let across = [-DVec3::Y, DVec3::Y, DVec3::new(1.0, 0.0, -1.0), DVec3::new(-1.0, 0.0, -1.0)];
        assert!(!meet(wedge, across), "edges that cross");
        assert!(meet(wedge, across.map(|v| v + tiny * DVec3::Z)));
        assert!(!meet(wedge, across.map(|v| v - tiny * DVec3::Z)));
    }

    /// Against another way to tell: the part of one tetrahedron that is left of the other, cut off by its faces, whole numbers
    /// so small that nothing is rounded.
    #[test]
    fn random_pairs_agree_with_clipping() {
        let mut random = Pcg64Mcg::seed_from_u64(3);
        let mut tetrahedron = || loop {
            let corners: [DVec3; 4] = std::array::from_fn(|_| {
                DVec3::from_array(std::array::from_fn(|_| f64::from(random.random_range(-3..=3))))
            });
            let [a, b, c, d] = corners;
            if (b - a).cross(c - a).dot(d - a) != 0.0 {
                return corners;
            }
        };
        let mut counts = [0; 2];
        for _ in 0..4000 {
            let (a, b) = (tetrahedron(), tetrahedron());
            // Coordinates are below 4: shared volume is no less than some 1e-6, rounding no more than some 1e-13.
            let expected = shared_volume(a, b) > 1e-9;
            assert_eq!(meet(a, b), expected, "{a:?} {b:?}");
            counts[usize::from(expected)] += 1;
        }
        assert!(counts.iter().all(|&count| count > 500), "{counts:?}");
    }

    /// By splitting at each face of `b`, a tetrahedron at a time.
    fn shared_volume(a: [DVec3; 4], b: [DVec3; 4]) -> f64 {
        let mut pieces = vec![a];
        for k in 0..4 {
            let [p, q, r] = FACES[k].map(|corner| b[corner]);
            let normal = (q - p).cross(r - p);
            let normal = normal * normal.dot(b[k] - p).signum();
            let height = |v: DVec3| normal.dot(v - p);
            pieces = pieces.into_iter().flat_map(|piece| kept(piece, height)).collect();
        }
        let volume = |[a, b, c, d]: [DVec3; 4]| (b - a).cross(c - a).dot(d - a).abs() / 6.0;
        pieces.into_iter().map(volume).sum()
    }

    /// The part of a tetrahedron where `height` is positive.
    fn kept(piece: [DVec3; 4], height: impl Fn(DVec3) -> f64) -> Vec<[DVec3; 4]> {
        let (inside, outside): (Vec<DVec3>, Vec<DVec3>) = piece.into_iter().partition(|&v| height(v) > 0.0);
        let cut = |a: DVec3, b: DVec3| a + (b - a) * (height(a) / (height(a) - height(b)));
        match (inside.as_slice(), outside.as_slice()) {
            ([], _) => vec![],
            (_, []) => vec![piece],
            (&[a], &[p, q, r]) => vec![[a, cut(a, p), cut(a, q), cut(a, r)]],
            (&[a, b], &[p, q]) => {
                let [ap, aq, bp, bq] = [cut(a, p), cut(a, q), cut(b, p), cut(b, q)];
                vec![[a, ap, aq, bq], [a, ap, bp, bq], [a, b, bp, bq]]
            }
            (&[a, b, c], &[p]) => {
                let [ap, bp, cp] = [cut(a, p), cut(b, p), cut(c, p)];
                vec![[a, b, c, cp], [a, b, bp, cp], [a, ap, bp, cp]]
            }
            _ => unreachable!("four vertices"),
        }
    }

    #[test]
    fn a_sound_shell_has_none_and_a_planted_pair_is_found_by_id() {
        let shell = torus(0.1);
        assert_eq!(overlaps(&shell), Overlaps::default());
        // The outer vertex over one side of the ring goes to the middle of a tetrahedron on the other.
        let mut planted = shell.clone();
        let target = shell.topology.tetrahedra.len() as u32 / 2;
        let outer = shell.topology.base_vertices as usize;
        Arc::make_mut(&mut planted.vertices)[outer] = centroid(&shell, target);
        let found = overlaps(&planted);
        assert!(found.pairs > 0);
        let touched = |t: u32| shell.topology.tetrahedra[t as usize].contains(&(outer as u32));
        let all = overlapping_by_force(&planted);
        assert_eq!(found.pairs, all.len() as u64);
        assert!(all.iter().any(|&[a, b]| [a, b].contains(&target) && (touched(a) || touched(b))));
        assert_eq!(
            found.first.iter().map(|pair| pair.tetrahedra).collect::<Vec<_>>(),
            all[..found.first.len()]
        );
    }

    fn overlapping_by_force(shell: &Shell) -> Vec<[u32; 2]> {
        let count = shell.topology.tetrahedra.len();
        let pairs = (0..count).flat_map(|a| (a + 1..count).map(move |b| [a, b]));
        let meeting =
            pairs.filter(|&[a, b]| shared_volume(shell.vertices_of(a), shell.vertices_of(b)) > 1e-12);
        meeting.map(|pair| pair.map(|t| t as u32)).collect()
    }
}
