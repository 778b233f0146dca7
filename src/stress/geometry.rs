//! Meshes that no one would draw on purpose: without volume, thin, folded over, torn, and tetrahedra that hide one another in
//! a cycle. All are compared with the reference.

use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::scenes::{PAINTS, Paint, constant_scene, in_turns, loose, painted, ring, view};
use super::{Case, Stand};
use crate::Result;
use crate::mesh::Mesh;
use crate::mesh::generate::{Generator, Plane, Torus};
use crate::scene::{Scene, Traversal, View};
use crate::shell::{Shell, ShellOptions};

/// The medium is constant in every tetrahedron, so quadrature is exact and all that is left is rounding, which
/// [`excess`](super::compare::excess) measures in multiples of what f32 explains: 1 is the bound for all of these.
const EXCESS: &str = "error / what f32 explains";

pub(super) const CASES: &[Case] = &[
    Case { name: "zero-volume", measure: EXCESS, bound: 1.0, worst: zero_volume },
    Case { name: "slivers", measure: EXCESS, bound: 1.0, worst: slivers },
    Case { name: "inverted", measure: EXCESS, bound: 1.0, worst: inverted },
    Case { name: "t-junctions", measure: EXCESS, bound: 1.0, worst: t_junctions },
    Case { name: "non-manifold", measure: EXCESS, bound: 1.0, worst: non_manifold },
    Case { name: "duplicate-vertices", measure: EXCESS, bound: 1.0, worst: duplicate_vertices },
    Case { name: "cycles", measure: EXCESS, bound: 1.0, worst: cycles },
];

const FOG: Paint = ([0.8, 0.6, 0.3], 0.5);

/// A square of 2 x 2 around the origin that faces up.
fn plane(segments: u32) -> Result<Mesh> {
    Generator::Plane(Plane { size: 2.0, segments }).build()
}

/// From above, at an angle, and straight down; all within 60 degrees of the normal.
fn from_above(stand: &Stand<'_>) -> Vec<View> {
    let pixels = stand.either(96, 384);
    let eyes = [DVec3::new(0.7, 2.6, 1.9), DVec3::new(0.0, 3.0, 0.0), DVec3::new(-1.3, 1.7, 0.2)];
    eyes[..stand.either(2, 3)].iter().map(|&eye| view(eye, DVec3::ZERO, 45.0, 1e-3, pixels)).collect()
}

fn in_fog(shell: Shell, views: &[View]) -> Arc<Scene> {
    Arc::new(painted(shell, &[FOG], 0.2, views[0]))
}

/// No thickness over a third of the vertices, and a triangle that is a line.
fn zero_volume(stand: &Stand<'_>) -> Result<f64> {
    let mut mesh = plane(6)?;
    let first = mesh.positions.len() as u32;
    mesh.positions.extend([-0.4, 0.1, 0.6].map(|x| DVec3::new(x, 0.5, x)));
    mesh.normals.extend([DVec3::Y; 3]);
    mesh.triangles.push([first, first + 1, first + 2]);
    mesh.uvs.push([DVec2::ZERO; 3]);
    let thickness_scale = (0..mesh.positions.len()).map(|i| f64::from(i % 3 != 0)).collect();
    let shell = Shell::build(&mesh, &ShellOptions { thickness_scale, ..ShellOptions::new(0.2) })?;
    if shell.health.zero_volume < 10 {
        return Ok(f64::INFINITY);
    }
    let views = from_above(stand);
    stand.excess(&in_fog(shell, &views), &views)
}

/// Down to a quality of 1e-12: triangles whose third vertex lies so near the edge between the others, between whole
/// neighbours; layers so thin; and loose plates.
fn slivers(stand: &Stand<'_>) -> Result<f64> {
    let views = from_above(stand);
    let mut worst = 0.0f64;
    for thin in [1e-6, 1e-9, 1e-12] {
        let mut narrow = plane(6)?;
        for position in &mut narrow.positions {
            // Every second row moves up to its neighbour, but for `thin`.
            let row = 3.0 * (1.0 - position.z);
            if row.round() as i32 % 2 == 1 {
                position.z += (1.0 - 3.0 * thin) / 3.0;
            }
        }
        worst = worst
            .max(stand.excess(&in_fog(Shell::build(&narrow, &ShellOptions::new(0.2))?, &views), &views)?);

        let mesh = plane(3)?;
        let thickness_scale =
            (0..mesh.positions.len()).map(|i| if i % 2 == 0 { thin } else { 1.0 }).collect();
        let low = Shell::build(&mesh, &ShellOptions { thickness_scale, ..ShellOptions::new(0.2) })?;
        worst = worst.max(stand.excess(&in_fog(low, &views), &views)?);

        let plates: Vec<[DVec3; 4]> = (0..12)
            .map(|i| {
                let y = -0.1 * f64::from(i);
                let turn = DVec2::from_angle(f64::from(i));
                let corner = |x: f64, z: f64| DVec3::new(turn.x * x - turn.y * z, y, turn.y * x + turn.x * z);
                [corner(-0.8, -0.5), corner(0.9, -0.4), corner(0.1, 0.9), corner(0.0, 0.1) + thin * DVec3::Y]
            })
            .collect();
        let plates = painted(loose(&plates, &in_turns(plates.len())), &PAINTS, 0.2, views[0]);
        worst = worst.max(stand.excess(&Arc::new(plates), &views)?);
    }
    Ok(worst)
}

/// A torus so thick that its shell folds over around the hole.
fn inverted(stand: &Stand<'_>) -> Result<f64> {
    let mut torus = Generator::Torus(Torus { segments: 16, rings: 10, ..Torus::default() }).build()?;
    torus.normals.iter_mut().for_each(|normal| *normal = -*normal);
    let pixels = stand.either(96, 256);
    let views = [
        view(DVec3::new(0.5, 2.5, 2.0), DVec3::ZERO, 45.0, 1e-3, pixels),
        view(DVec3::new(1.1, 0.1, 0.2), DVec3::ZERO, 70.0, 1e-3, pixels),
    ];
    let scene = constant_scene(&torus, 0.55, 0.2, 0.8, views[0])?;
    let health = scene.shell.health;
    if health.inverted == 0 || health.inverted == health.tetrahedra {
        return Ok(f64::INFINITY);
    }
    stand.excess(&Arc::new(scene), &views)
}

/// A square whose right half is finer than its left one: vertices of one lie within edges of the other.
fn t_junctions(stand: &Stand<'_>) -> Result<f64> {
    let mut mesh = plane(2)?;
    let coarse = mesh.positions.len() as u32;
    // Not a power of two: the vertices are next to the edge, not on it.
    let fine = plane(6)?;
    mesh.positions.extend(fine.positions.iter().map(|position| *position + DVec3::new(2.0, 0.0, 0.0)));
    mesh.normals.extend(&fine.normals);
    mesh.triangles.extend(fine.triangles.iter().map(|ids| ids.map(|id| id + coarse)));
    mesh.uvs.extend(&fine.uvs);
    mesh.positions.iter_mut().for_each(|position| position.x -= 1.0);
    let views = from_above(stand);
    stand.excess(&in_fog(Shell::build(&mesh, &ShellOptions::new(0.2))?, &views), &views)
}

/// Five leaves on one edge, two of them the same way round: near the edge their shells overlap.
fn non_manifold(stand: &Stand<'_>) -> Result<f64> {
    let mut mesh = Mesh { positions: vec![-0.8 * DVec3::X, 0.8 * DVec3::X], ..Mesh::default() };
    mesh.normals = vec![DVec3::Y; 2];
    for (i, angle) in (0..5u32).zip([0.3f64, 0.8, 1.5, 2.2, 2.9]) {
        mesh.positions.push(DVec3::new(0.1 * f64::from(i), angle.sin(), angle.cos()));
        mesh.normals.push(DVec3::new(0.0, angle.cos().abs(), -angle.sin()).normalize());
        mesh.triangles.push(if i % 2 == 0 { [0, 1, 2 + i] } else { [1, 0, 2 + i] });
        mesh.uvs.push([DVec2::ZERO; 3]);
    }
    let shell = Shell::build(&mesh, &ShellOptions::new(0.2))?;
    if shell.health.non_manifold_edges != 1 {
        return Ok(f64::INFINITY);
    }
    let views = from_above(stand);
    stand.excess(&in_fog(shell, &views), &views)
}

/// Every triangle with vertices of its own: no two tetrahedra of different prisms know that they touch.
fn duplicate_vertices(stand: &Stand<'_>) -> Result<f64> {
    let torus = Generator::Torus(Torus { segments: 16, rings: 8, ..Torus::default() }).build()?;
    let mut torn = Mesh { uvs: torus.uvs.clone(), ..Mesh::default() };
    for ids in &torus.triangles {
        let first = torn.positions.len() as u32;
        torn.positions.extend(ids.map(|id| torus.positions[id as usize]));
        torn.normals.extend(ids.map(|id| torus.normals[id as usize]));
        torn.triangles.push([first, first + 1, first + 2]);
    }
    let views = from_above(stand);
    stand.excess(&in_fog(Shell::build(&torn, &ShellOptions::new(0.2))?, &views), &views)
}

/// Rings of 3, 6 and 12 interlocking tetrahedra, walked and sorted; the report must tell of the cycle where it is one.
fn cycles(stand: &Stand<'_>) -> Result<f64> {
    let mut worst = 0.0f64;
    for count in [3, 6, 12] {
        let view = view(DVec3::new(0.0, 0.0, 8.0), DVec3::ZERO, 24.0, 0.01, stand.either(128, 512));
        for traversal in [Traversal::Walk, Traversal::Sort] {
            let scene = Arc::new(Scene { traversal, ..painted(ring(count), &PAINTS, 0.1, view) });
            let frame = stand.frame(&scene)?;
            if traversal == Traversal::Sort && frame.report.counts["cycles"] == 0 {
                return Ok(f64::INFINITY);
            }
            worst = worst.max(super::compare::excess(&scene, &view, &frame.image));
        }
    }
    Ok(worst)
}
