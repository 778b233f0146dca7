//! Which tetrahedra a ray crosses, and from where to where.
//!
//! A tetrahedron is the set where its four barycentric coordinates are not negative. Along a ray each is a
//! linear function of depth, so the tetrahedron's interval is found by clipping with four
//! half-spaces; everything is measured from the eye, so that a scene far from the origin loses nothing.
//!
//! Two neighbours read their shared face from one plane, so the exit of one *is* the entry of the other,
//! bit for bit (Woop, Benthin, Wald, *Watertight Ray/Triangle Intersection*, 2013). A ray that lies in a
//! face or along an edge is put on one side of it as if the whole ray were shifted a little in
//! one fixed direction across the picture: it is inside one of the tetrahedra there, not none or two.

use bvh::aabb::{Aabb, Bounded};
use bvh::bounding_hierarchy::BHShape;
use bvh::bvh::Bvh;
use bvh::ray::Ray;
use glam::DVec3;

use crate::scene::View;
use crate::shell::{EXTERIOR, Shell};

/// The part of a ray in one tetrahedron.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossing {
    /// Its index in the shell.
    pub tetrahedron: usize,
    /// Depth at which the ray enters it, at least the near depth.
    pub enter: f64,
    /// Depth at which the ray leaves it, greater than `enter`.
    pub exit: f64,
}

/// A barycentric coordinate as seen from the eye: `at_eye + gradient . (x - eye)`.
#[derive(Debug, Clone, Copy, Default)]
struct Plane {
    gradient: DVec3,
    at_eye: f64,
    /// Distance from the eye to the vertex from which `at_eye` was measured: its rounding grows with it.
    reach: f64,
}

/// Finds the tetrahedra on a ray.
pub struct Crossings {
    planes: Vec<[Plane; 4]>,
    boxes: Vec<PaddedBox>,
    hierarchy: Bvh<f64, 3>,
    near: f64,
    /// Where a ray that lies in a face is thought to be shifted; in general position to the picture's axes.
    aside: DVec3,
}

/// A ray is in a plane if it stays within this angle of it, in radians: a thousand roundings.
const EDGE_ON: f64 = 1e-13;

/// Boxes grow by this part of the largest coordinate, so that rounding loses no tetrahedron.
const BOX_PADDING: f64 = 1e-9;

impl Crossings {
    /// Prepares a shell to be seen from one eye. Tetrahedra of zero volume are left out.
    pub fn new(shell: &Shell, view: &View) -> Self {
        let (eye, frame) = (view.camera.eye, view.camera.frame());
        let mut planes: Vec<[Plane; 4]> = Vec::with_capacity(shell.cells.len());
        for tetrahedron in 0..shell.cells.len() {
            let own = std::array::from_fn(|face| match shared_plane(shell, &planes, tetrahedron, face) {
                Some(plane) => plane,
                None => own_plane(shell, eye, tetrahedron, face),
            });
            planes.push(own);
        }
        let mut boxes: Vec<PaddedBox> = (0..shell.cells.len())
            .filter(|&tetrahedron| shell.cells[tetrahedron].has_maps())
            .map(|tetrahedron| {
                let vertices = shell.topology.tetrahedra[tetrahedron]
                    .map(|vertex| shell.vertices[vertex as usize] - eye);
                PaddedBox::around(&vertices, tetrahedron)
            })
            .collect();
        // The hierarchy compares areas and extents with absolute limits: it is built at unit scale.
        let reach = boxes.iter().map(PaddedBox::reach).fold(f64::MIN_POSITIVE, f64::max);
        boxes.iter_mut().for_each(|bounds| bounds.finish(reach));
        let hierarchy = Bvh::build(&mut boxes);
        let aside = 0.618 * frame.right + 0.786 * frame.up;
        Self { planes, boxes, hierarchy, near: view.camera.near, aside }
    }

    /// Replaces the content of `crossings` by those of the ray from the eye, where
    /// `direction` is scaled to unit depth; in order of entry.
    pub fn find(&self, direction: DVec3, crossings: &mut Vec<Crossing>) {
        crossings.clear();
        let ray = Ray::new([0.0; 3].into(), direction.to_array().into());
        for bounds in self.hierarchy.traverse(&ray, &self.boxes) {
            let tetrahedron = bounds.tetrahedron;
            if let Some((enter, exit)) = self.clip(tetrahedron, direction) {
                crossings.push(Crossing { tetrahedron, enter, exit });
            }
        }
        crossings
            .sort_unstable_by(|a, b| a.enter.total_cmp(&b.enter).then(a.tetrahedron.cmp(&b.tetrahedron)));
    }

    fn clip(&self, tetrahedron: usize, direction: DVec3) -> Option<(f64, f64)> {
        let (mut enter, mut exit) = (self.near, f64::INFINITY);
        for plane in &self.planes[tetrahedron] {
            let slope = plane.gradient.dot(direction);
            let steepness = EDGE_ON * plane.gradient.length();
            if slope.abs() <= steepness * direction.length() && plane.at_eye.abs() <= steepness * plane.reach
            {
                if plane.gradient.dot(self.aside) <= 0.0 {
                    return None;
                }
            } else if slope == 0.0 {
                if plane.at_eye < 0.0 {
                    return None;
                }
            } else {
                let depth = -plane.at_eye / slope;
                if slope > 0.0 { enter = enter.max(depth) } else { exit = exit.min(depth) }
            }
        }
        (enter < exit && exit.is_finite()).then_some((enter, exit))
    }
}

fn own_plane(shell: &Shell, eye: DVec3, tetrahedron: usize, face: usize) -> Plane {
    let gradient = shell.cells[tetrahedron].gradients[face];
    let on_face = shell.topology.tetrahedra[tetrahedron][(face + 1) % 4];
    let from_vertex = eye - shell.vertices[on_face as usize];
    Plane { gradient, at_eye: gradient.dot(from_vertex), reach: from_vertex.length() }
}

/// The plane of a face that a tetrahedron of lower index shares, turned to this tetrahedron's side.
fn shared_plane(shell: &Shell, planes: &[[Plane; 4]], tetrahedron: usize, face: usize) -> Option<Plane> {
    let topology = &shell.topology;
    let neighbour = topology.neighbours[tetrahedron][face];
    if neighbour == EXTERIOR || neighbour as usize >= tetrahedron {
        return None;
    }
    let neighbour = neighbour as usize;
    if !shell.cells[neighbour].has_maps() {
        return None;
    }
    let vertices = topology.tetrahedra[tetrahedron];
    let is_on_face = |vertex: u32| (0..4).any(|k| k != face && vertices[k] == vertex);
    let back = (0..4).find(|&k| {
        topology.neighbours[neighbour][k] as usize == tetrahedron
            && !is_on_face(topology.tetrahedra[neighbour][k])
    })?;
    let plane = planes[neighbour][back];
    let gradient = shell.cells[tetrahedron].gradients[face];
    let turned = Plane { gradient: -plane.gradient, at_eye: -plane.at_eye, reach: plane.reach };
    Some(if gradient.dot(plane.gradient) < 0.0 { turned } else { plane })
}

/// A tetrahedron's bounds relative to the eye.
struct PaddedBox {
    tetrahedron: usize,
    min: DVec3,
    max: DVec3,
    node: usize,
}

impl PaddedBox {
    fn around(vertices: &[DVec3; 4], tetrahedron: usize) -> Self {
        let [min, max] = [DVec3::min, DVec3::max].map(|pick| vertices.iter().copied().reduce(pick));
        let (min, max) = (min.unwrap_or_default(), max.unwrap_or_default());
        Self { tetrahedron, min, max, node: 0 }
    }

    fn reach(&self) -> f64 {
        self.min.abs().max(self.max.abs()).max_element()
    }

    fn finish(&mut self, unit: f64) {
        let padding = DVec3::splat(BOX_PADDING * self.reach());
        self.min = (self.min - padding) / unit;
        self.max = (self.max + padding) / unit;
    }
}

impl Bounded<f64, 3> for PaddedBox {
    fn aabb(&self) -> Aabb<f64, 3> {
        Aabb::with_bounds(self.min.to_array().into(), self.max.to_array().into())
    }
}

impl BHShape<f64, 3> for PaddedBox {
    fn set_bh_node_index(&mut self, node: usize) {
        self.node = node;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::mesh::generate::{Generator, Torus};
    use crate::scene::Camera;
    use crate::shell::ShellOptions;

    #[test]
    fn neighbours_share_the_end_of_their_crossings_bit_for_bit() {
        let mesh = Generator::Torus(Torus { segments: 20, rings: 9, ..Torus::default() }).build().unwrap();
        let mut shell = Shell::build(&mesh, &ShellOptions::new(0.1)).unwrap();
        let eye = DVec3::new(0.3, 2.0, 2.2);
        let camera = Camera { eye, target: DVec3::ZERO, up: DVec3::Y, fov_y: 0.7, near: 0.1 };
        let view = View { camera, width: 40, height: 40, depth: false };
        let mismatches = |shell: &Shell| {
            let crossings = Crossings::new(shell, &view);
            let (mut list, mut shared, mut mismatches) = (Vec::new(), 0, 0);
            for i in 0..1600 {
                let point = DVec2::new(f64::from(i % 40), f64::from(i / 40));
                crossings.find(view.ray_at_unit_depth(point), &mut list);
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
