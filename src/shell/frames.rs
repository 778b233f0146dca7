//! The local frame of the shell: a field of linear maps from texture space to world space, continuous from tetrahedron to
//! tetrahedron, for directions that are stored in the texture (Dufort, Leblanc, Poulin 2005, section 5.3).
//!
//! The texture map's own linear part is constant in each tetrahedron, and jumps from one to the next. So at each vertex the mean
//! is taken over the tetrahedra around it, weighted by their volumes, and interpolated by barycentric coordinates.
//!
//! Around a vertex there may be several maps that have nothing to do with each other: those on either side of a texture seam, or
//! of an edge along which the texture is mirrored. A mean is taken only over tetrahedra that are connected through faces across
//! which the texture goes on: its coordinates there are the same, or by the same whole numbers apart, and neither
//! side is the other's mirror image.

use glam::{DMat3, DVec3};

use super::{EXTERIOR, Shell, cell};

/// What is to be transformed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameKind {
    /// Normals and gradients, by the transpose of the texture map: they are covectors, `(d/du, d/dv, d/dw)`.
    Covectors,
    /// Tangents, by its inverse: they are vectors, `(du, dv, dw)`.
    Vectors,
}

/// A frame at each vertex of each tetrahedron.
#[derive(Debug, Clone, PartialEq)]
pub struct Frames {
    /// World space from texture space, up to one positive factor that all share: no entry is greater than 1. Zero where
    /// no tetrahedron has a map.
    pub maps: Vec<DMat3>,
    /// For the four vertices of each tetrahedron the index of its frame.
    pub of_vertices: Vec<[u32; 4]>,
}

impl Frames {
    /// The frame at a point of tetrahedron `t`, given by barycentric coordinates.
    pub fn at(&self, t: usize, barycentric: [f64; 4]) -> DMat3 {
        (0..4).fold(DMat3::ZERO, |sum, k| sum + self.maps[self.of_vertices[t][k] as usize] * barycentric[k])
    }
}

impl Shell {
    /// The frames for one kind of direction.
    pub fn frames(&self, kind: FrameKind) -> Frames {
        // A corner is a vertex as one tetrahedron has it: `4 t + k`.
        let mut groups = Groups::new(4 * self.topology.tetrahedra.len());
        for (t, neighbours) in self.topology.neighbours.iter().enumerate() {
            for (face, &neighbour) in neighbours.iter().enumerate() {
                if neighbour != EXTERIOR && (neighbour as usize) > t {
                    self.join_across(t, face, neighbour as usize, &mut groups);
                }
            }
        }
        let mut frames =
            Frames { maps: Vec::new(), of_vertices: vec![[0; 4]; self.topology.tetrahedra.len()] };
        let mut frame_of_group = vec![u32::MAX; 4 * self.topology.tetrahedra.len()];
        let mut volumes: Vec<f64> = Vec::new();
        for t in 0..self.topology.tetrahedra.len() {
            let (map, volume) = self.map_and_volume(t, kind);
            for k in 0..4 {
                let frame = &mut frame_of_group[groups.root(4 * t + k)];
                if *frame == u32::MAX {
                    *frame = frames.maps.len() as u32;
                    frames.maps.push(DMat3::ZERO);
                    volumes.push(0.0);
                }
                frames.of_vertices[t][k] = *frame;
                frames.maps[*frame as usize] += volume * map;
                volumes[*frame as usize] += volume;
            }
        }
        for (map, volume) in frames.maps.iter_mut().zip(volumes) {
            if volume > 0.0 {
                *map *= volume.recip();
            }
        }
        let entries = frames.maps.iter().flat_map(DMat3::to_cols_array);
        let largest = entries.fold(0.0, |largest: f64, entry| largest.max(entry.abs()));
        if largest > 0.0 {
            frames.maps.iter_mut().for_each(|map| *map *= largest.recip());
        }
        frames
    }

    /// The map of one tetrahedron, and its weight: none where there is no such map.
    fn map_and_volume(&self, t: usize, kind: FrameKind) -> (DMat3, f64) {
        let texture_from_world = self.cells()[t].texture_from_world;
        let map = match kind {
            FrameKind::Covectors => texture_from_world.transpose(),
            FrameKind::Vectors if texture_from_world.determinant() == 0.0 => DMat3::ZERO,
            FrameKind::Vectors => texture_from_world.inverse(),
        };
        let volume = cell::determinant(self.vertices_of(t)).abs();
        if map.is_finite() && map != DMat3::ZERO { (map, volume) } else { (DMat3::ZERO, 0.0) }
    }

    /// Puts the three vertices of a face into the same groups on both sides, where the texture goes on across it.
    fn join_across(&self, t: usize, face: usize, neighbour: usize, groups: &mut Groups) {
        let ids = self.topology.tetrahedra[neighbour];
        let shared: [Option<(usize, usize)>; 4] = std::array::from_fn(|k| {
            let id = self.topology.tetrahedra[t][k];
            (k != face).then(|| ids.iter().position(|&other| other == id).map(|other| (k, other))).flatten()
        });
        let apart = |(k, other): (usize, usize)| self.texture[t][k] - self.texture[neighbour][other];
        let turns = shared.iter().flatten().next().map_or(DVec3::ZERO, |&pair| apart(pair).round());
        let goes_on = shared.iter().flatten().all(|&(k, other)| {
            let largest = self.texture[t][k].abs().max_element().max(1.0);
            (apart((k, other)) - turns).abs().max_element() <= SAME_PLACE * largest
        });
        let handedness = |t: usize| self.cells()[t].texture_from_world.determinant();
        if goes_on && handedness(t) * handedness(neighbour) > 0.0 {
            for (k, other) in shared.into_iter().flatten() {
                groups.join(4 * t + k, 4 * neighbour + other);
            }
        }
    }
}

/// Texture coordinates this near, relative to their size, were written as the same: thousands of roundings.
const SAME_PLACE: f64 = 1e-9;

/// Disjoint sets with path halving.
struct Groups(Vec<usize>);

impl Groups {
    fn new(count: usize) -> Self {
        Self((0..count).collect())
    }

    fn root(&mut self, mut item: usize) -> usize {
        while self.0[item] != item {
            let parent = self.0[item];
            self.0[item] = self.0[parent];
            item = parent;
        }
        item
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b)] = a.min(b);
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::mesh::Mesh;
    use crate::mesh::generate::{Generator, Sphere, Torus};
    use crate::shell::ShellOptions;

    fn torus() -> Shell {
        let mesh = Generator::Torus(Torus { segments: 16, rings: 9, ..Torus::default() }).build().unwrap();
        let options = ShellOptions { uv_scale: DVec2::new(6.0, 2.0), ..ShellOptions::new(0.2) };
        Shell::build(&mesh, &options).unwrap()
    }

    /// Two triangles that share the edge from (0, 0) to (0, 1), with these UVs at the four positions of each.
    fn two_triangles(left: [DVec2; 3], right: [DVec2; 3]) -> Shell {
        let mesh = Mesh {
            positions: vec![DVec3::NEG_X, DVec3::ZERO, DVec3::Y, DVec3::X],
            normals: vec![DVec3::Z; 4],
            triangles: vec![[0, 1, 2], [2, 1, 3]],
            uvs: vec![left, right],
        };
        Shell::build(&mesh, &ShellOptions::new(0.5)).unwrap()
    }

    #[test]
    fn a_texture_that_wraps_around_a_torus_has_one_frame_a_vertex() {
        let shell = torus();
        for kind in [FrameKind::Covectors, FrameKind::Vectors] {
            let frames = shell.frames(kind);
            assert_eq!(frames.maps.len(), shell.vertices.len());
            for (ids, of_vertices) in shell.topology.tetrahedra.iter().zip(&frames.of_vertices) {
                for (other, others) in shell.topology.tetrahedra.iter().zip(&frames.of_vertices) {
                    for (k, j) in (0..4).flat_map(|k| (0..4).map(move |j| (k, j))) {
                        assert_eq!(ids[k] == other[j], of_vertices[k] == others[j]);
                    }
                }
            }
        }
    }

    #[test]
    fn frames_are_near_the_maps_that_they_are_means_of() {
        let mesh = Generator::Torus(Torus { segments: 48, rings: 36, ..Torus::default() }).build().unwrap();
        let shell = Shell::build(&mesh, &ShellOptions::new(0.05)).unwrap();
        for kind in [FrameKind::Covectors, FrameKind::Vectors] {
            let frames = shell.frames(kind);
            let along = |map: DMat3| (map * DVec3::Z).normalize();
            for t in 0..shell.topology.tetrahedra.len() {
                let own = along(shell.map_and_volume(t, kind).0);
                // Triangles of 48 x 36 rows differ by 10 degrees from their neighbours.
                let cosine = along(frames.at(t, [0.25; 4])).dot(own);
                assert!(cosine > 10f64.to_radians().cos(), "{t}: {cosine}");
            }
        }
    }

    #[test]
    fn seams_and_mirrors_are_not_averaged_across() {
        let at = DVec2::new;
        let left = [at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0)];
        // The shared edge is (1, 0)-(1, 1) on the left; corners of the right triangle are (0, 1), (0, 0), (1, 0) in space.
        let count = |right| two_triangles(left, right).frames(FrameKind::Covectors).maps.len();
        assert_eq!(count([at(1.0, 1.0), at(1.0, 0.0), at(2.0, 0.0)]), 8, "one chart: a frame a vertex");
        assert_eq!(count([at(4.0, 3.0), at(4.0, 2.0), at(5.0, 2.0)]), 8, "whole turns away");
        assert_eq!(count([at(1.0, 1.0), at(1.0, 0.0), at(0.0, 0.0)]), 12, "mirrored: two frames on the edge");
        assert_eq!(count([at(0.5, 1.0), at(0.5, 0.0), at(2.0, 0.0)]), 12, "half a turn away");
        assert_eq!(count([at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0)]), 12, "turned");
    }

    #[test]
    fn poles_and_degenerate_maps_do_no_harm() {
        let sphere = Generator::Sphere(Sphere { segments: 12, rings: 6, radius: 1.0 }).build().unwrap();
        let mut squashed = sphere.clone();
        squashed.uvs[5] = [DVec2::splat(0.3); 3];
        for (mesh, degenerate) in [(sphere, 0), (squashed, 3)] {
            let shell = Shell::build(&mesh, &ShellOptions::new(0.2)).unwrap();
            for kind in [FrameKind::Covectors, FrameKind::Vectors] {
                let frames = shell.frames(kind);
                assert!(frames.maps.iter().all(DMat3::is_finite));
                let zero = (0..shell.topology.tetrahedra.len())
                    .filter(|&t| frames.at(t, [0.25; 4]) == DMat3::ZERO)
                    .count();
                assert_eq!(zero, if kind == FrameKind::Vectors { degenerate } else { 0 });
            }
        }
    }
}
