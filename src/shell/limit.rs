//! A thickness that a shell can bear: lowered around the vertices where it would fold over.
//!
//! The volume of a tetrahedron, in parts of a third of its triangle's area times the length of the edge that stands on the triangle, is
//! 1 in a shell of parallel prisms, and falls below 0 where the shell folds. As the thickness goes to 0 it tends to the cosine between the
//! triangle's normal and one of the directions of extrusion, so that a shell whose directions all leave its triangles on the outer side
//! is sound if it is only thin enough. Where a direction leaves a triangle on the inner side no thickness helps, and nothing is lowered
//! for that triangle's sake.
//!
//! All vertices of a prism that has less than [`LEAST`] are lowered by the factor [`STEP`], and after each round no vertex is left
//! more than [`STEEPEST`] times as thick as a neighbour; until no prism has less. Where nothing is lowered, nothing is changed.

use glam::DVec3;
use rayon::prelude::*;

use super::cell::{area_vector, determinant};
use super::{Limit, ShellOptions, Topology, extrude};
use crate::mesh::Mesh;

/// The relative volume that every tetrahedron keeps, in parts of the least cosine at its triangle.
const LEAST: f64 = 0.05;

/// By which thickness is lowered in a round: fine enough that no more than a tenth is lost.
const STEP: f64 = 0.9;

/// How much thicker a vertex may be than its neighbour.
const STEEPEST: f64 = 1.3;

/// After so many rounds a vertex is 1e-9 of what it was: that a shell folds there all the same is rounding.
const ROUNDS: usize = 200;

/// Triangles that one task of the thread pool takes at least.
const TASK: usize = 256;

/// The factors on the thickness, one a position, that keep the shell from folding; `None` where none is needed.
pub(super) fn factors(
    mesh: &Mesh,
    topology: &Topology,
    options: &ShellOptions,
    directions: &[DVec3],
) -> Option<(Vec<f64>, Limit)> {
    let base = topology.base_vertices;
    let full = |id: usize| extrude::thickness_at(options, id);
    let mut factors = vec![1.0; mesh.positions.len()];
    for round in 0..ROUNDS {
        let is_short = |triangle: usize| {
            let ids = mesh.triangles[triangle].map(|id| id as usize);
            let normal = area_vector(ids.map(|id| mesh.positions[id]));
            let area = normal.length();
            let cosine = ids.iter().map(|&id| normal.dot(directions[id]) / area).fold(1.0, f64::min);
            // A triangle without an area has nothing to lose; one that a direction leaves on its inner side folds at any thickness.
            if area == 0.0 || cosine <= 0.0 {
                return false;
            }
            let vertex = |id: u32| {
                let id = (id % base) as usize;
                mesh.positions[id] + factors[id] * full(id) * directions[id]
            };
            topology.tetrahedra[3 * triangle..3 * triangle + 3].iter().any(|ids| {
                // One edge stands on the surface. Where the thickness is 0 it has no length, whatever its factor.
                let outer = ids.iter().find(|&&id| id >= base && ids.contains(&(id - base)));
                let height =
                    outer.map_or(0.0, |id| factors[(id - base) as usize] * full((id - base) as usize));
                let corners = ids.map(|id| if id < base { mesh.positions[id as usize] } else { vertex(id) });
                height > 0.0 && determinant(corners) <= LEAST * cosine * area * height
            })
        };
        let short: Vec<usize> = (0..mesh.triangles.len())
            .into_par_iter()
            .with_min_len(TASK)
            .filter(|&triangle| is_short(triangle))
            .collect();
        if short.is_empty() {
            if round == 0 {
                return None;
            }
            break;
        }
        let mut lowered = factors.clone();
        for id in short.iter().flat_map(|&triangle| mesh.triangles[triangle]) {
            lowered[id as usize] = STEP * factors[id as usize];
        }
        // In one pass over the triangles what is lowered spreads to its neighbours; more of it in the next round.
        for &[a, b, c] in &mesh.triangles {
            for (i, j) in [(a, b), (b, c), (c, a), (b, a), (c, b), (a, c)] {
                lowered[i as usize] = lowered[i as usize].min(STEEPEST * lowered[j as usize]);
            }
        }
        factors = lowered;
    }
    let at = (0..factors.len()).min_by(|&a, &b| factors[a].total_cmp(&factors[b]))?;
    let vertices = factors.iter().filter(|&&factor| factor < 1.0).count() as u64;
    let limit = Limit { vertices, least: factors[at], at: mesh.positions[at] };
    Some((factors, limit))
}

#[cfg(test)]
mod tests {
    use crate::mesh::deform::{self, Bend, Deform};
    use crate::mesh::generate::{Generator, Sphere, Tube};
    use crate::shell::{Shell, ShellOptions};
    use glam::DVec3;

    fn limited(thickness: f64) -> ShellOptions {
        ShellOptions { limited: true, ..ShellOptions::new(thickness) }
    }

    #[test]
    fn a_bent_tube_folds_unless_it_is_limited() {
        let tube = Tube { radius: 0.3, height: 3.0, segments: 32, rings: 32 };
        let mut mesh = Generator::Tube(tube).build().unwrap();
        let bend =
            Bend { axis: DVec3::Y, centre: DVec3::ZERO, towards: DVec3::X, range: [-1.0, 1.0], angle: 200.0 };
        deform::apply(&[Deform::Bend(bend)], &mut mesh);
        let folded = Shell::build(&mesh, &ShellOptions::new(0.5)).unwrap();
        assert!(folded.health.inverted > 20, "{:?}", folded.health);
        assert!(folded.limit.is_none());
        let shell = Shell::build(&mesh, &limited(0.5)).unwrap();
        assert_eq!(shell.health.inverted, 0);
        let limit = shell.limit.unwrap();
        // The centre of curvature is 2 / 200 degrees = 0.57 from the spine, 0.27 from the tube's inner side.
        assert!((0.3..0.55).contains(&limit.least), "{limit:?}");
        assert!(limit.at.x > 0.0 && (50..900).contains(&limit.vertices), "{limit:?}");
        // On the outer side of the bend it is as thick as ever.
        let thickness = |id: usize| shell.vertices[mesh.positions.len() + id].distance(mesh.positions[id]);
        let outermost = (0..mesh.positions.len())
            .min_by(|&a, &b| mesh.positions[a].x.total_cmp(&mesh.positions[b].x))
            .unwrap();
        assert!((thickness(outermost) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn what_no_thickness_mends_takes_nothing_from_the_rest() {
        let mut mesh = Generator::Sphere(Sphere { radius: 1.0, segments: 24, rings: 12 }).build().unwrap();
        mesh.normals[100] = -mesh.normals[100];
        let shell = Shell::build(&mesh, &limited(0.2)).unwrap();
        assert!(shell.health.inverted > 0, "it is turned inside out there, however thin");
        let least = shell.limit.map_or(1.0, |limit| limit.least);
        assert!(least > 0.1, "{least}");
    }

    #[test]
    fn what_does_not_fold_is_left_alone() {
        let mesh = Generator::Sphere(Sphere { radius: 1.0, segments: 24, rings: 12 }).build().unwrap();
        let [free, limited] =
            [ShellOptions::new(0.4), limited(0.4)].map(|o| Shell::build(&mesh, &o).unwrap());
        assert_eq!(free, limited);
    }
}
