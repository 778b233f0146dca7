//! Where the outer vertices go: along the mesh's normals, optionally averaged over their neighbourhood
//! ("extrusion direction ... neighborhood operators", Dufort et al. 2005, section 3).
//!
//! A round of averaging replaces every direction by the mean, renormalised, of itself and of its edge
//! neighbours, all with the same weight (the umbrella operator of Kobbelt et al., SIGGRAPH 1998). Neighbours
//! are added in ascending id, so that the order of the triangles does not matter to a single bit.

use glam::DVec3;
use rayon::prelude::*;

use super::ShellOptions;
use crate::mesh::Mesh;

/// Shorter than this, a mean of unit directions has cancelled and tells nothing: the old one stays.
const CANCELLED: f64 = 1e-9;

/// Unit directions of extrusion, one a position.
pub(super) fn directions(mesh: &Mesh, options: &ShellOptions) -> Vec<DVec3> {
    let mut directions = mesh.normals.clone();
    if options.smoothing_rounds == 0 {
        return directions;
    }
    let edges = directed_edges(mesh);
    for _ in 0..options.smoothing_rounds {
        let mut sums = directions.clone();
        for &(from, to) in &edges {
            sums[from as usize] += directions[to as usize];
        }
        directions.par_iter_mut().zip(sums).for_each(|(direction, sum)| {
            if sum.length() > CANCELLED {
                *direction = sum.normalize();
            }
        });
    }
    directions
}

/// World-space thickness above position `id`.
pub(super) fn thickness_at(options: &ShellOptions, id: usize) -> f64 {
    options.thickness * options.thickness_scale.get(id).copied().unwrap_or(1.0)
}

/// Every edge once in each direction, in ascending order.
fn directed_edges(mesh: &Mesh) -> Vec<(u32, u32)> {
    let mut edges: Vec<(u32, u32)> = mesh
        .triangles
        .par_iter()
        .flat_map_iter(|&[a, b, c]| [(a, b), (b, a), (b, c), (c, b), (c, a), (a, c)])
        .collect();
    edges.par_sort_unstable();
    edges.dedup();
    edges
}
