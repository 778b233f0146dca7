//! Which tetrahedra a ray crosses, and from where to where.
//!
//! A tetrahedron is the set where its four barycentric coordinates are not negative. Along a ray each is a
//! linear function of the distance, so the tetrahedron's interval is found by clipping with four
//! half-spaces; everything is measured from the eye, so that a scene far from the origin loses nothing. Rays to a light start
//! elsewhere, and read the same planes.
//!
//! Two neighbours read their shared face from one plane, so the exit of one *is* the entry of the other,
//! bit for bit (Woop, Benthin, Wald, *Watertight Ray/Triangle Intersection*, 2013). A ray that lies in a
//! face or along an edge is put on one side of it as if the whole ray were shifted a little in
//! one fixed direction across it: it is inside one of the tetrahedra there, not none or two.

use glam::DVec3;

use super::hierarchy::{Hierarchy, Path};
use crate::shell::{EXTERIOR, Shell};

/// The part of a path in one tetrahedron, in the path's own measure: on an eye's ray, in depth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossing {
    /// Its index in the shell.
    pub tetrahedron: usize,
    /// Where the path enters it, at least the path's own beginning.
    pub enter: f64,
    /// Where the path leaves it, greater than `enter`.
    pub exit: f64,
}

/// A barycentric coordinate as seen from the eye: `at_eye + gradient . (x - eye)`.
#[derive(Debug, Clone, Copy, Default)]
struct Plane {
    gradient: DVec3,
    at_eye: f64,
    /// Distance from the eye to the vertex from which `at_eye` was measured: its rounding grows with it.
    reach: f64,
    /// Slopes per world unit up to this are taken for none.
    steepness: f64,
}

/// Finds the tetrahedra on a path.
pub struct Crossings {
    planes: Vec<[Plane; 4]>,
    hierarchy: Hierarchy,
}

/// A ray is in a plane if it stays within this angle of it, in radians: a thousand roundings.
const EDGE_ON: f64 = 1e-13;

impl Crossings {
    /// Prepares a shell for paths that are measured from this eye. Tetrahedra of zero volume are left out.
    pub fn new(shell: &Shell, eye: DVec3) -> Self {
        let mut planes: Vec<[Plane; 4]> = Vec::with_capacity(shell.topology.tetrahedra.len());
        for tetrahedron in 0..shell.topology.tetrahedra.len() {
            let own = std::array::from_fn(|face| match shared_plane(shell, &planes, tetrahedron, face) {
                Some(plane) => plane,
                None => own_plane(shell, eye, tetrahedron, face),
            });
            planes.push(own);
        }
        let with_maps =
            (0..shell.topology.tetrahedra.len()).filter(|&tetrahedron| shell.has_maps(tetrahedron));
        let hulls = with_maps.map(|tetrahedron| {
            let vertices = shell.topology.tetrahedra[tetrahedron];
            (tetrahedron, vertices.map(|vertex| shell.vertices[vertex as usize] - eye))
        });
        let hierarchy = Hierarchy::new(hulls);
        Self { planes, hierarchy }
    }

    /// Replaces the content of `crossings` by those of the path, in order of entry.
    pub fn find(&self, path: &Path, crossings: &mut Vec<Crossing>) {
        crossings.clear();
        self.visit(path, |crossing| {
            crossings.push(crossing);
            true
        });
        crossings
            .sort_unstable_by(|a, b| a.enter.total_cmp(&b.enter).then(a.tetrahedron.cmp(&b.tetrahedron)));
    }

    /// Calls `found` with the crossings of the path, in any order, until it returns false.
    pub fn visit(&self, path: &Path, mut found: impl FnMut(Crossing) -> bool) {
        let start_reach = path.start.length();
        self.hierarchy.visit(path, |tetrahedron, end| {
            if let Some((enter, exit)) = self.clip(tetrahedron, path, start_reach)
                && !found(Crossing { tetrahedron, enter, exit })
            {
                *end = f64::NEG_INFINITY;
            }
        });
    }

    fn clip(&self, tetrahedron: usize, path: &Path, start_reach: f64) -> Option<(f64, f64)> {
        let unit = path.direction.length();
        let (mut enter, mut exit) = (path.from, f64::INFINITY);
        for plane in &self.planes[tetrahedron] {
            let slope = plane.gradient.dot(path.direction);
            let at_start = plane.at_eye + plane.gradient.dot(path.start);
            if slope.abs() <= plane.steepness * unit
                && at_start.abs() <= plane.steepness * (plane.reach + start_reach)
            {
                if plane.gradient.dot(path.aside) <= 0.0 {
                    return None;
                }
            } else if slope == 0.0 {
                if at_start < 0.0 {
                    return None;
                }
            } else {
                let place = -at_start / slope;
                if slope > 0.0 { enter = enter.max(place) } else { exit = exit.min(place) }
            }
        }
        let is_bounded = exit.is_finite();
        exit = exit.min(path.to);
        (is_bounded && enter < exit).then_some((enter, exit))
    }
}

fn own_plane(shell: &Shell, eye: DVec3, tetrahedron: usize, face: usize) -> Plane {
    let gradient = shell.cells()[tetrahedron].gradients[face];
    let on_face = shell.topology.tetrahedra[tetrahedron][(face + 1) % 4];
    let from_vertex = eye - shell.vertices[on_face as usize];
    let steepness = EDGE_ON * gradient.length();
    Plane { gradient, at_eye: gradient.dot(from_vertex), reach: from_vertex.length(), steepness }
}

/// The plane of a face that a tetrahedron of lower index shares, turned to this tetrahedron's side.
fn shared_plane(shell: &Shell, planes: &[[Plane; 4]], tetrahedron: usize, face: usize) -> Option<Plane> {
    let topology = &shell.topology;
    let neighbour = topology.neighbours[tetrahedron][face];
    if neighbour == EXTERIOR || neighbour as usize >= tetrahedron {
        return None;
    }
    let neighbour = neighbour as usize;
    if !shell.has_maps(neighbour) {
        return None;
    }
    let vertices = topology.tetrahedra[tetrahedron];
    let is_on_face = |vertex: u32| (0..4).any(|k| k != face && vertices[k] == vertex);
    let back = (0..4).find(|&k| {
        topology.neighbours[neighbour][k] as usize == tetrahedron
            && !is_on_face(topology.tetrahedra[neighbour][k])
    })?;
    let plane = planes[neighbour][back];
    let gradient = shell.cells()[tetrahedron].gradients[face];
    let turned = Plane { gradient: -plane.gradient, at_eye: -plane.at_eye, ..plane };
    Some(if gradient.dot(plane.gradient) < 0.0 { turned } else { plane })
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::mesh::generate::{Generator, Torus};
    use crate::scene::{Camera, View};
    use crate::shell::ShellOptions;

    #[test]
    fn neighbours_share_the_end_of_their_crossings_bit_for_bit() {
        let mesh = Generator::Torus(Torus { segments: 20, rings: 9, ..Torus::default() }).build().unwrap();
        let mut shell = Shell::build(&mesh, &ShellOptions::new(0.1)).unwrap();
        let eye = DVec3::new(0.3, 2.0, 2.2);
        let camera = Camera { eye, target: DVec3::ZERO, up: DVec3::Y, fov_y: 0.7, near: 0.1 };
        let view = View { camera, width: 40, height: 40, depth: false };
        let mismatches = |shell: &Shell| {
            let crossings = Crossings::new(shell, eye);
            let (mut list, mut shared, mut mismatches) = (Vec::new(), 0, 0);
            for i in 0..1600 {
                let point = DVec2::new(f64::from(i % 40), f64::from(i / 40));
                crossings.find(&Path::of_eye(&view, view.ray_at_unit_depth(point)), &mut list);
                for pair in list.windows(2) {
                    // The torus is seen through twice, with a gap.
                    if pair[1].enter - pair[0].exit < 1e-6 {
                        shared += 1;
                        mismatches += u32::from(pair[1].enter != pair[0].exit);
                    }
                }
            }
            assert!(shared > 3000, "{shared}");
            mismatches
        };
        assert_eq!(mismatches(&shell), 0);
        // Strangers to each other, cells round on their own.
        let mut topology = (*shell.topology).clone();
        topology.neighbours.fill([EXTERIOR; 4]);
        shell.topology = topology.into();
        assert!(mismatches(&shell) > 100);
    }
}
