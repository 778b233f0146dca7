//! What is in a mesh, counted: for people who want to know what they are about to extrude.

use std::collections::HashMap;

use glam::{DVec2, DVec3};
use serde::Serialize;

use super::Mesh;
use super::normals::facet_normal;

/// Counts and sizes of a mesh.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Info {
    /// Welded positions.
    pub positions: u64,
    /// Triangles.
    pub triangles: u64,
    /// Edges, each counted once.
    pub edges: u64,
    /// Edges with one triangle.
    pub boundary_edges: u64,
    /// Edges with three or more triangles.
    pub non_manifold_edges: u64,
    /// Edges with two triangles that have different texture coordinates there.
    pub uv_seam_edges: u64,
    /// Whether the two triangles of every edge with two run opposite ways along it, so that they have
    /// the same outside.
    pub consistently_oriented: bool,
    /// Triangles that face against the normals at their corners.
    pub triangles_against_normals: u64,
    /// Triangles without area (height below 1e-12 of the longest side).
    pub degenerate_triangles: u64,
    /// Smallest coordinates, world units.
    pub low: DVec3,
    /// Largest coordinates, world units.
    pub high: DVec3,
    /// Sum over the triangles, square world units.
    pub area: f64,
    /// Smallest texture coordinates.
    pub uv_low: DVec2,
    /// Largest texture coordinates.
    pub uv_high: DVec2,
}

/// The triangles along an edge.
#[derive(Default)]
struct Edge {
    /// How many run from the lower to the higher id.
    upward: u32,
    downward: u32,
    /// Texture coordinates at the lower and the higher id in the first of them, and whether all agree.
    uvs: Option<[DVec2; 2]>,
    is_seam: bool,
}

/// Counts a valid mesh.
pub fn info(mesh: &Mesh) -> Info {
    let edges = edges(mesh);
    let count = |of: &dyn Fn(&Edge) -> bool| edges.values().filter(|edge| of(edge)).count() as u64;

    let (mut area, mut degenerate_triangles, mut triangles_against_normals) = (0.0, 0, 0);
    for ids in &mesh.triangles {
        let corners = ids.map(|id| mesh.positions[id as usize]);
        area += 0.5 * (corners[1] - corners[0]).cross(corners[2] - corners[0]).length();
        let facet = facet_normal(corners);
        let normals: DVec3 = ids.iter().map(|&id| mesh.normals[id as usize]).sum();
        degenerate_triangles += u64::from(facet == DVec3::ZERO);
        triangles_against_normals += u64::from(facet.dot(normals) < 0.0);
    }

    let uvs = || mesh.uvs.iter().flatten().copied();
    Info {
        positions: mesh.positions.len() as u64,
        triangles: mesh.triangles.len() as u64,
        edges: edges.len() as u64,
        boundary_edges: count(&|edge| edge.upward + edge.downward == 1),
        non_manifold_edges: count(&|edge| edge.upward + edge.downward > 2),
        uv_seam_edges: count(&|edge| edge.upward + edge.downward == 2 && edge.is_seam),
        consistently_oriented: count(&|edge| edge.upward.abs_diff(edge.downward) == 2) == 0,
        triangles_against_normals,
        degenerate_triangles,
        low: mesh.positions.iter().copied().fold(DVec3::INFINITY, DVec3::min),
        high: mesh.positions.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max),
        area,
        uv_low: uvs().fold(DVec2::INFINITY, DVec2::min),
        uv_high: uvs().fold(DVec2::NEG_INFINITY, DVec2::max),
    }
}

fn edges(mesh: &Mesh) -> HashMap<[u32; 2], Edge> {
    let mut edges = HashMap::<[u32; 2], Edge>::with_capacity(3 * mesh.triangles.len() / 2);
    for (ids, uvs) in mesh.triangles.iter().zip(&mesh.uvs) {
        for k in 0..3 {
            let (mut ends, mut end_uvs) = ([ids[k], ids[(k + 1) % 3]], [uvs[k], uvs[(k + 1) % 3]]);
            let is_upward = ends[0] < ends[1];
            if !is_upward {
                ends.reverse();
                end_uvs.reverse();
            }
            let edge = edges.entry(ends).or_default();
            edge.upward += u32::from(is_upward);
            edge.downward += u32::from(!is_upward);
            edge.is_seam |= *edge.uvs.get_or_insert(end_uvs) != end_uvs;
        }
    }
    edges
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::generate::{Generator, Sphere, Torus, Tube};

    #[test]
    fn a_torus_is_closed_and_has_two_seams() {
        let info = info(&Generator::Torus(Torus::default()).build().unwrap());
        // Euler: V - E + F = 0. The seams are one parallel of 48 edges and one meridian of 24.
        assert_eq!(info.positions + info.triangles, info.edges);
        assert_eq!((info.boundary_edges, info.non_manifold_edges, info.uv_seam_edges), (0, 0, 48 + 24));
        assert!(info.consistently_oriented);
        assert_eq!((info.triangles_against_normals, info.degenerate_triangles), (0, 0));
        assert_eq!((info.uv_low, info.uv_high), (DVec2::ZERO, DVec2::ONE));
        assert!((info.high - DVec3::new(1.4, 0.4, 1.4)).length() < 1e-12);
    }

    #[test]
    fn a_sphere_has_an_euler_characteristic_of_two() {
        let info = info(&Generator::Sphere(Sphere::default()).build().unwrap());
        assert_eq!(info.positions + info.triangles, info.edges + 2);
        // The seam runs from pole to pole; besides, the triangles around a pole disagree on its u.
        assert_eq!(info.uv_seam_edges, 22 + 2 * 48);
    }

    #[test]
    fn a_turned_triangle_is_noticed() {
        let mut tube = Generator::Tube(Tube::default()).build().unwrap();
        assert!(info(&tube).consistently_oriented);
        tube.triangles[7].swap(0, 1);
        let info = info(&tube);
        assert!(!info.consistently_oriented);
        assert_eq!(info.triangles_against_normals, 1);
    }

    #[test]
    fn a_third_triangle_on_an_edge_is_noticed() {
        let mut tube = Generator::Tube(Tube::default()).build().unwrap();
        tube.positions.push(DVec3::new(0.0, 9.0, 0.0));
        tube.normals.push(DVec3::Y);
        let [a, b, _] = tube.triangles[200];
        tube.triangles.push([a, b, tube.positions.len() as u32 - 1]);
        tube.uvs.push([DVec2::ZERO; 3]);
        assert_eq!(info(&tube).non_manifold_edges, 1);
    }
}
