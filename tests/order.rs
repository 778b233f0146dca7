//! Visibility orders, checked along every pixel's ray of many views.

use std::f64::consts::TAU;
use std::sync::Arc;

use glam::DVec3;
use mesoshell::mesh::Mesh;
use mesoshell::mesh::generate::{Generator, Plane, Sphere, Torus, Tube, Vase};
use mesoshell::order::relations::FaceTable;
use mesoshell::order::search::InFront;
use mesoshell::order::{self, Check, Order, Sorter};
use mesoshell::scene::{Camera, View};
use mesoshell::shell::{Shell, ShellOptions, Topology};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

fn shell(mesh: &Mesh, thickness: f64) -> Shell {
    Shell::build(mesh, &ShellOptions::new(thickness)).unwrap()
}

fn generated(generator: Generator, thickness: f64) -> Shell {
    shell(&generator.build().unwrap(), thickness)
}

/// The mesh with its positions moved; normals are kept.
fn moved(generator: Generator, place: impl Fn(DVec3) -> DVec3) -> Mesh {
    let mut mesh = generator.build().unwrap();
    mesh.positions.iter_mut().for_each(|position| *position = place(*position));
    mesh
}

fn joined(mut first: Mesh, second: Mesh) -> Mesh {
    let offset = first.positions.len() as u32;
    first.positions.extend(second.positions);
    first.normals.extend(second.normals);
    first.triangles.extend(second.triangles.into_iter().map(|t| t.map(|v| v + offset)));
    first.uvs.extend(second.uvs);
    first
}

fn torus(segments: u32, rings: u32) -> Generator {
    Generator::Torus(Torus { segments, rings, ..Torus::default() })
}

fn sphere(radius: f64, segments: u32, rings: u32) -> Generator {
    Generator::Sphere(Sphere { radius, segments, rings })
}

/// Ten shells, none of which overlaps itself, each with its name.
fn shells() -> Vec<(&'static str, Shell)> {
    let plane = || Generator::Plane(Plane { size: 2.0, segments: 10 });
    let tube = Generator::Tube(Tube { radius: 0.7, height: 2.0, segments: 14, rings: 5 });
    let vase = Generator::Vase(Vase { segments: 14, rings: 12, ..Vase::default() });
    let wavy = moved(plane(), |p| DVec3::new(p.x, 0.25 * (5.0 * p.x).sin() * (4.0 * p.z).cos(), p.z));
    let skewed = moved(sphere(1.0, 14, 7), |p| DVec3::new(1.4 * p.x + 0.5 * p.y, 0.6 * p.y, p.z));
    let nested =
        joined(sphere(0.4, 10, 5).build().unwrap(), moved(sphere(1.0, 12, 6), |p| p + 0.1 * DVec3::Y));
    let mut link = torus(14, 6).build().unwrap();
    let quarter_turn = |p: DVec3| DVec3::new(p.x, p.z, -p.y);
    link.positions.iter_mut().for_each(|p| *p = quarter_turn(*p) + DVec3::X);
    link.normals.iter_mut().for_each(|n| *n = quarter_turn(*n));
    let links = joined(torus(16, 6).build().unwrap(), link);
    vec![
        ("plane", generated(plane(), 0.3)),
        ("wavy plane", shell(&wavy, 0.2)),
        ("tube", generated(tube, 0.2)),
        ("sphere", generated(sphere(1.0, 16, 8), 0.15)),
        ("thick sphere", generated(sphere(0.5, 12, 6), 0.6)),
        ("skewed sphere", shell(&skewed, 0.1)),
        ("torus", generated(torus(20, 8), 0.15)),
        ("vase", generated(vase, 0.05)),
        ("nested spheres", shell(&nested, 0.15)),
        ("linked rings", shell(&links, 0.1)),
    ]
}

fn random_direction(random: &mut Pcg64) -> DVec3 {
    let y: f64 = random.random_range(-1.0..1.0);
    let (sin, cos) = random.random_range(0.0..TAU).sin_cos();
    let r = (1.0 - y * y).sqrt();
    DVec3::new(r * cos, y, r * sin)
}

/// A view of one of four kinds: from outside; from just off the surface along it; from inside a
/// tetrahedron; from anywhere to anywhere near the shell.
fn random_view(shell: &Shell, kind: usize, random: &mut Pcg64) -> View {
    let size = shell.vertices.iter().map(|v| v.length()).fold(0.0, f64::max);
    let vertices = shell.vertices.len();
    let base = shell.topology.base_vertices as usize;
    let any = random_direction(random);
    let near = random.random_range(0..base);
    let (inner, outer) = (shell.vertices[near], shell.vertices[near + base]);
    let other = shell.vertices[random.random_range(0..vertices)];
    let (eye, target) = match kind {
        0 => (any * size * random.random_range(1.2..4.0), 0.2 * size * random_direction(random)),
        1 => (outer + random.random_range(0.01..0.3) * (outer - inner), other),
        2 => {
            let t = random.random_range(0..shell.topology.tetrahedra.len());
            let weights: [f64; 4] = std::array::from_fn(|_| random.random_range(0.01..1.0));
            let corners = shell.vertices_of(t);
            let eye: DVec3 = (0..4).map(|k| corners[k] * weights[k]).sum();
            (eye / weights.iter().sum::<f64>(), other)
        }
        _ => (any * size * random.random_range(0.0..1.2), other + 0.1 * size * random_direction(random)),
    };
    let camera = Camera {
        eye,
        target,
        up: random_direction(random),
        fov_y: random.random_range(0.3..1.8),
        near: 0.01,
    };
    View { camera, width: 96, height: 80, depth: false }
}

fn sum(checks: impl IntoIterator<Item = Check>) -> Check {
    checks.into_iter().fold(Check::default(), Check::and)
}

#[test]
fn no_ray_of_a_thousand_views_meets_a_wrong_pair() {
    let mut random = Pcg64::seed_from_u64(1);
    let mut total = Check::default();
    for (name, shell) in shells() {
        let sorter = Sorter::new(&shell.topology);
        let mut cycles = 0;
        let found = sum((0..100).map(|i| {
            let view = random_view(&shell, i % 4, &mut random);
            let sorted = sorter.sort(&shell, &view);
            cycles += sorted.order.cycles.len();
            order::check_pixels(&shell, &sorted.order, &view)
        }));
        println!("{name:16} {} tetrahedra, {cycles} cycles: {found:?}", shell.topology.tetrahedra.len());
        total = total.and(found);
    }
    println!("all: {total:?}");
    assert_eq!(total.violations, 0, "{:?}", total.first);
    assert_eq!(total.rays, 1000 * 96 * 80);
    assert!(total.pairs > 10 * total.rays, "too few pairs to prove anything");
}
