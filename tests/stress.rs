//! The short form of the stress cases, under the validation layers; random strips of tetrahedra; the driver's threads.

mod common;

use std::process::Command;
use std::sync::Arc;

use common::{Watched, set_up};
use glam::{DVec2, DVec3};
use mesoshell::gpu::Messages;
use mesoshell::reference::Reference;
use mesoshell::scene::{Scene, View};
use mesoshell::shell::{EXTERIOR, Shell};
use mesoshell::stress::compare::{centre, excess};
use mesoshell::stress::scenes::{connected, loose, painted, view};
use mesoshell::stress::{Extent, Stand, cases};
use proptest::prelude::*;

#[test]
fn every_case_stays_within_its_bound() {
    let messages = Messages::default();
    let mut failed = Vec::new();
    set_up(&messages, |setup| {
        let stand = Stand { setup, extent: Extent::Quick };
        for case in cases() {
            let outcome = case.run(&stand).unwrap_or_else(|error| panic!("{}: {error}", case.name));
            println!("{:26} {:9.2e} of {:9.2e}, {}", case.name, outcome.worst, outcome.bound, case.measure);
            if !outcome.passed {
                failed.push(case.name);
            }
        }
    });
    assert!(failed.is_empty(), "beyond their bounds: {failed:?}");
    assert!(messages.all().is_empty(), "the validation layers said:\n{}", messages.all().join("\n"));
}

#[test]
fn the_drivers_threads_change_no_byte() {
    let folder = tempfile::tempdir().unwrap();
    let picture = |threads: &str| {
        let path = folder.path().join(format!("{threads}.exr"));
        let render = ["render", "scenes/fog-torus.toml", "--quiet", "--size", "96x96", "-o"];
        let mut command = Command::new(env!("CARGO_BIN_EXE_mesoshell"));
        command.args(render).arg(&path).env("LP_NUM_THREADS", threads).env("RAYON_NUM_THREADS", threads);
        assert!(command.status().unwrap().success());
        std::fs::read(path).unwrap()
    };
    let one = picture("1");
    assert!(picture("2") == one && picture("4") == one);
}

/// A strip of tetrahedra, each of four vertices in a row: a helix (Boerdijk and Coxeter's) with every vertex moved, scaled along
/// its axes. `None` where the moves turned a tetrahedron over.
fn strip(moves: &[[f64; 3]], stretch: [f64; 3]) -> Option<Shell> {
    let vertices: Vec<DVec3> = (0..)
        .zip(moves)
        .map(|(i, &by)| {
            let i = f64::from(i) - 0.5 * (moves.len() - 1) as f64;
            let turn = DVec2::from_angle((-2.0f64 / 3.0).acos() * i);
            let on_helix = DVec3::new(0.52 * turn.x, 0.316 * i, 0.52 * turn.y);
            (on_helix + DVec3::from_array(by)) * DVec3::from_array(stretch)
        })
        .collect();
    let tetrahedra: Vec<[u32; 4]> =
        (0..vertices.len() as u32 - 3).map(|i| [0, 1, 2, 3].map(|k| i + k)).collect();
    let shell = connected(vertices, tetrahedra, &vec![DVec3::splat(0.5); moves.len() - 3]);
    // Neighbours lie on different sides of their face where both turn the same way.
    let volume = |t: usize| {
        let [a, b, c, d] = shell.vertices_of(t);
        (b - a).cross(c - a).dot(d - a)
    };
    (0..shell.topology.tetrahedra.len()).all(|t| volume(t) * volume(0) > 0.0).then_some(shell)
}

/// The length of a ray inside the strip from its outer faces alone, by the signed depths at which it crosses them (Möller and
/// Trumbore 1997): a gap or an overlap between two tetrahedra cannot show in it.
fn length_by_outer_faces(shell: &Shell, view: &View, point: DVec2) -> f64 {
    let (eye, direction) = (view.camera.eye, view.ray_at_unit_depth(point));
    let mut length = 0.0;
    for t in 0..shell.topology.tetrahedra.len() {
        for k in 0..4 {
            if shell.topology.neighbours[t][k] != EXTERIOR {
                continue;
            }
            let [a, b, c] = shell.face(t, k).map(|id| shell.vertices[id as usize]);
            let (ab, ac) = (b - a, c - a);
            let across = direction.cross(ac);
            let determinant = ab.dot(across);
            let from = eye - a;
            let u = from.dot(across) / determinant;
            let v = direction.dot(from.cross(ab)) / determinant;
            if u < 0.0 || v < 0.0 || u + v > 1.0 {
                continue;
            }
            let depth = ac.dot(from.cross(ab)) / determinant;
            let leaves = shell.cells()[t].gradients[k].dot(direction) < 0.0;
            length += if leaves { depth } else { -depth };
        }
    }
    length * direction.length()
}

fn seen(shell: Shell, eye: DVec3, pixels: u32) -> Arc<Scene> {
    let view = view(eye, DVec3::ZERO, 60.0, 1e-3, pixels);
    Arc::new(painted(shell, &[([0.8; 3], 0.4)], 0.3, view))
}

fn strips() -> impl Strategy<Value = (Shell, DVec3)> {
    let moves = prop::collection::vec(prop::array::uniform3(-0.15..0.15), 4..16);
    let stretch = prop::array::uniform3(prop_oneof![Just(1.0), 0.01..2.0]);
    let eye = (0.0..std::f64::consts::TAU, -1.0..1.0, 4.0..6.0);
    (moves, stretch, eye).prop_filter_map(
        "a strip that is turned over",
        |(moves, stretch, (turn, y, far))| {
            let eye = far * DVec3::new(turn.cos(), y, turn.sin());
            strip(&moves, stretch).map(|shell| (shell, eye))
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, rng_seed: proptest::test_runner::RngSeed::Fixed(5), ..ProptestConfig::default() })]

    /// What the tetrahedra on a ray cover together is what lies between the outer faces.
    #[test]
    fn intervals_of_a_strip_tile_the_ray((shell, eye) in strips()) {
        let scene = seen(shell, eye, 48);
        let reference = Reference::new(&scene, &scene.view);
        for pixel in 0..48 * 48 {
            let point = centre(&scene.view, pixel);
            let [sum, outer] = [reference.path_length(point), length_by_outer_faces(&scene.shell, &scene.view, point)];
            // Some thirty roundings of 1e-16 at a distance of 10, at faces that are met at 1/30000 radian at worst.
            prop_assert!((sum - outer).abs() < 1e-9, "pixel {pixel}: {sum} in parts, {outer} in all");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 8, failure_persistence: None, rng_seed: proptest::test_runner::RngSeed::Fixed(6), ..ProptestConfig::default() })]

    #[test]
    fn a_strip_on_the_device_is_as_dense_as_it_is_long((shell, eye) in strips()) {
        let scene = seen(shell, eye, 64);
        let image = Watched::prepare("shell", &scene).render(&scene.view).image;
        let excess = excess(&scene, &scene.view, &image);
        prop_assert!(excess <= 1.0, "{excess} times what f32 explains");
    }
}

#[test]
fn a_strip_with_a_gap_would_be_seen() {
    let shell = strip(&[[0.0; 3]; 8], [1.0; 3]).unwrap();
    let mut corners: Vec<[DVec3; 4]> =
        (0..shell.topology.tetrahedra.len()).map(|t| shell.vertices_of(t)).collect();
    let scene = seen(shell, DVec3::new(4.0, 1.0, 3.0), 48);
    // One tetrahedron a little smaller at one of its inner faces than its neighbour thinks.
    let [_, from, _, to] = corners[2];
    corners[2][1] = from.lerp(to, 1e-3);
    let torn = seen(loose(&corners, &vec![DVec3::splat(0.5); corners.len()]), scene.view.camera.eye, 48);
    let reference = Reference::new(&torn, &torn.view);
    let off = (0..48 * 48).map(|pixel| {
        let point = centre(&torn.view, pixel);
        (reference.path_length(point) - length_by_outer_faces(&scene.shell, &scene.view, point)).abs()
    });
    assert!(off.fold(0.0, f64::max) > 1e-6);
}
