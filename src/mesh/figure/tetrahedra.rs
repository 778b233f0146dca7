//! From a field to a closed mesh: A. Doi, A. Koide, *An Efficient Method of Triangulating Equi-Valued Surfaces by Using Tetrahedral
//! Cells*, 1991. Every cube is cut into six tetrahedra around the diagonal from its lowest to its highest corner, as its
//! neighbours are, so the mesh is closed and manifold wherever the field is positive at the border of the box.

use std::collections::HashMap;

use glam::{DVec3, UVec3};
use rayon::prelude::*;

/// The orders in which the six tetrahedra go from corner to corner along the axes; the first three turn the same way as (u, v, w).
const PATHS: [[usize; 3]; 6] = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];

/// How near to an end of its edge a vertex may lie, as a part of the edge: no triangle collapses when it is written to a file.
const LEAST_PART: f64 = 0.02;

/// Positions, and triangles counter-clockwise from where `field` is positive, on a grid of cubes with the side `step` in a box.
pub(super) fn mesh(
    field: impl Fn(DVec3) -> f64 + Sync,
    [low, high]: [DVec3; 2],
    step: f64,
) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let cells = ((high - low) / step).ceil().as_uvec3();
    let [nx, ny, nz] = (cells + UVec3::ONE).to_array().map(|n| n as usize);
    let place = |corner: UVec3| low + step * corner.as_dvec3();
    let id = |corner: UVec3| (corner.z as usize * ny + corner.y as usize) * nx + corner.x as usize;
    let corner_of = |id: usize| UVec3::new((id % nx) as u32, (id / nx % ny) as u32, (id / nx / ny) as u32);
    let values: Vec<f64> = (0..nx * ny * nz).into_par_iter().map(|id| field(place(corner_of(id)))).collect();

    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    let mut on_edge = HashMap::new();
    for cell in (0..nx * ny * nz).map(corner_of).filter(|corner| corner.cmplt(cells).all()) {
        for (index, path) in PATHS.iter().enumerate() {
            let mut corners = [cell; 4];
            for (k, &axis) in path.iter().enumerate() {
                corners[k + 1] = corners[k];
                corners[k + 1][axis] += 1;
            }
            // All tetrahedra are turned to be positively oriented.
            if index >= 3 {
                corners.swap(2, 3);
            }
            let ids = corners.map(id);
            let mut vertex = |a: usize, b: usize| {
                let (a, b) = (ids[a].min(ids[b]), ids[a].max(ids[b]));
                *on_edge.entry((a, b)).or_insert_with(|| {
                    let part = (values[a] / (values[a] - values[b])).clamp(LEAST_PART, 1.0 - LEAST_PART);
                    positions.push(place(corner_of(a)).lerp(place(corner_of(b)), part));
                    positions.len() as u32 - 1
                })
            };
            let is_inside = ids.map(|id| values[id] < 0.0);
            // The corners from the one in front on, so that the order is an even permutation of (0, 1, 2, 3).
            let from = [[0, 1, 2, 3], [1, 0, 3, 2], [2, 3, 0, 1], [3, 2, 1, 0]];
            let only = |wanted: bool| (0..4).find(|&k| is_inside[k] == wanted).unwrap_or(0);
            match is_inside.iter().filter(|&&inside| inside).count() {
                1 => {
                    let [i, a, b, c] = from[only(true)];
                    triangles.push([vertex(i, a), vertex(i, b), vertex(i, c)]);
                }
                2 => {
                    let first = only(true);
                    // Of the even permutations that start there, the one whose second corner is inside too.
                    let [_, a, b, c] = from[first];
                    let turns = [[a, b, c], [b, c, a], [c, a, b]];
                    let [j, k, l] = turns[turns.iter().position(|turn| is_inside[turn[0]]).unwrap_or(0)];
                    let quad = [vertex(first, k), vertex(first, l), vertex(j, l), vertex(j, k)];
                    triangles.extend([[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]]);
                }
                3 => {
                    let [i, a, b, c] = from[only(false)];
                    triangles.push([vertex(i, a), vertex(i, c), vertex(i, b)]);
                }
                _ => {}
            }
        }
    }
    (positions, triangles)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ball_is_closed_and_its_volume_converges() {
        let mut errors = Vec::new();
        for step in [0.2, 0.1] {
            let (positions, triangles) =
                mesh(|p| p.length() - 1.0, [DVec3::splat(-1.15), DVec3::splat(1.15)], step);
            let mut edges = HashMap::new();
            let mut six_volumes = 0.0;
            for &[a, b, c] in &triangles {
                for edge in [(a, b), (b, c), (c, a)] {
                    assert!(edges.insert(edge, ()).is_none(), "{edge:?} runs twice the same way");
                }
                let [a, b, c] = [a, b, c].map(|id| positions[id as usize]);
                six_volumes += a.dot(b.cross(c));
            }
            assert!(edges.keys().all(|&(a, b)| edges.contains_key(&(b, a))), "closed");
            assert_eq!(positions.len() + triangles.len(), edges.len() / 2 + 2, "Euler");
            errors.push((six_volumes / 6.0 - 4.0 / 3.0 * std::f64::consts::PI).abs());
        }
        // Linear interpolation errs by the square of the step.
        assert!(errors[1] < 0.35 * errors[0] && errors[1] < 0.05, "{errors:?}");
    }
}
