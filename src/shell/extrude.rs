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
    if options.smoothing_rounds > 0 {
        average(mesh, options.smoothing_rounds, &mut directions);
    }
    if let Some(wind) = &options.wind {
        wind.turn(mesh, &mut directions);
    }
    directions
}

fn average(mesh: &Mesh, rounds: u32, directions: &mut [DVec3]) {
    let edges = directed_edges(mesh);
    for _ in 0..rounds {
        let mut sums = directions.to_vec();
        for &(from, to) in &edges {
            sums[from as usize] += directions[to as usize];
        }
        directions.par_iter_mut().zip(sums).for_each(|(direction, sum)| {
            if sum.length() > CANCELLED {
                *direction = sum.normalize();
            }
        });
    }
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

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;

    /// A fan of four triangles around vertex 0, whose direction alone is tilted.
    fn fan() -> Mesh {
        Mesh {
            positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y, -DVec3::X, -DVec3::Y],
            normals: vec![DVec3::X, DVec3::Z, DVec3::Z, DVec3::Z, DVec3::Z],
            triangles: vec![[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]],
            uvs: vec![[DVec2::ZERO; 3]; 4],
        }
    }

    fn after(rounds: u32, mesh: &Mesh) -> Vec<DVec3> {
        directions(mesh, &ShellOptions { smoothing_rounds: rounds, ..ShellOptions::new(1.0) })
    }

    #[test]
    fn no_rounds_keep_the_normals() {
        assert_eq!(after(0, &fan()), fan().normals);
    }

    #[test]
    fn a_round_is_the_even_mean_over_the_edges() {
        let smooth = after(1, &fan());
        // The hub sees itself and four rim vertices; a rim vertex sees itself, the hub and two others.
        let expected = [DVec3::new(1.0, 0.0, 4.0), DVec3::new(1.0, 0.0, 3.0)].map(DVec3::normalize);
        assert!(smooth[0].distance(expected[0]) < 1e-15 && smooth[3].distance(expected[1]) < 1e-15);
        assert!(smooth[0].distance(expected[1]) > 1e-2, "the comparison can fail");
    }

    #[test]
    fn rounds_even_out_and_stay_of_unit_length() {
        let smooth = after(50, &fan());
        for direction in &smooth {
            assert!((direction.length() - 1.0).abs() < 1e-15);
            assert!(direction.distance(smooth[0]) < 1e-9);
        }
    }

    #[test]
    fn the_order_of_triangles_changes_no_bit() {
        let mut mesh = fan();
        mesh.normals = (0..5).map(|i| DVec3::new(0.1 * f64::from(i), 0.3, 0.7).normalize()).collect();
        let smooth = after(3, &mesh);
        mesh.triangles = vec![[4, 1, 0], [3, 0, 2], [1, 2, 0], [0, 3, 4]];
        assert_eq!(after(3, &mesh), smooth);
        mesh.normals[4].x += 1e-12;
        assert_ne!(after(3, &mesh), smooth);
    }

    #[test]
    fn directions_that_cancel_stay() {
        let mesh = Mesh {
            positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y],
            normals: vec![
                DVec3::Z,
                DVec3::new(0.0, 0.75f64.sqrt(), -0.5),
                DVec3::new(0.0, -0.75f64.sqrt(), -0.5),
            ],
            triangles: vec![[0, 1, 2]],
            uvs: vec![[DVec2::ZERO; 3]],
        };
        assert_eq!(after(1, &mesh), mesh.normals);
    }
}
