//! Rays that walk see what is seen when all tetrahedra are sorted.

mod common;

use std::path::Path;
use std::sync::Arc;

use common::Watched;
use glam::DVec3;
use mesoshell::frame::Frame;
use mesoshell::metric::{self, Metrics};
use mesoshell::progress::Silent;
use mesoshell::scene::{self, Scene, Traversal};
use mesoshell::shell::{Shell, ShellOptions};
use mesoshell::stress::scenes::{PAINTS, painted, ring, view};

/// Of two pictures of the same segments: each gathers them by sums that are compensated, and one ends where 2^-20 is let through.
const BOUND: f64 = 2e-6;

fn load(name: &str, overrides: &[&str]) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name).with_extension("toml");
    let mut overrides: Vec<String> = overrides.iter().map(|text| (*text).to_owned()).collect();
    overrides.push("image.size=[128, 128]".to_owned());
    scene::load(&path, &overrides, &Silent).unwrap_or_else(|error| panic!("{error:?}")).scene
}

/// Walked, and sorted.
fn both(scene: &Scene) -> [Frame; 2] {
    [Traversal::Walk, Traversal::Sort].map(|traversal| {
        let scene = Arc::new(Scene { traversal, ..scene.clone() });
        Watched::prepare("shell", &scene).render(&scene.view)
    })
}

fn compare(name: &str, [walked, sorted]: &[Frame; 2]) -> Metrics {
    let metrics = metric::compare(&walked.image, &sorted.image).unwrap();
    println!("{name}: {metrics:?}, {:?}", walked.report.counts);
    metrics
}

/// At the default quality: see `tests/accuracy.rs`.
fn agree_with_the_reference(scene: &Scene, frame: &Frame) {
    let scene = Arc::new(scene.clone());
    let reference = Watched::prepare("reference", &scene).render(&scene.view);
    let metrics = metric::compare(&frame.image, &reference.image).unwrap();
    println!("against the reference: {metrics:?}");
    assert!(metrics.rmse <= 1e-3 && metrics.p999 <= 1e-2, "{metrics:?}");
}

#[test]
fn pictures_are_those_of_sorted_tetrahedra() {
    for (name, overrides) in [
        ("fur-sphere", &["march.end_below=0"][..]),
        ("fog-torus", &[]),
        ("lit-fur", &[]),
        ("effects/solid", &[]),
        ("effects/shadow", &["shading.shadow_size=128"]),
    ] {
        let frames = both(&load(name, overrides));
        let metrics = compare(name, &frames);
        assert_eq!(metrics.pixels, 128 * 128);
        assert!(metrics.max <= BOUND, "{name}: {metrics:?}");
        assert_eq!(frames[0].report.counts["pixels_overlapping"], 0, "{name}");
    }
}

#[test]
fn another_scene_is_found_out() {
    let [walked, _] = both(&load("fog-torus", &[]));
    let [_, sorted] = both(&load("fog-torus", &["shell.thickness=0.201"]));
    assert!(compare("another thickness", &[walked, sorted]).max > 10.0 * BOUND);
}

/// Where the shell is in two places at once, both integrate the sum of two media by midpoints, between the same entries and exits.
#[test]
fn parts_of_the_shell_that_overlap_are_walked_together() {
    for name in ["weave-teapot", "table1/teapot-weave"] {
        let off = ["march.end_below=0", "shading.shadow_size=128"];
        let frames = both(&load(name, &off[..if name == "weave-teapot" { 1 } else { 2 }]));
        let metrics = compare(name, &frames);
        assert!(frames[0].report.counts["pixels_overlapping"] > 50, "{name}");
        assert!(metrics.p999 <= BOUND && metrics.max <= 1e-4, "{name}: {metrics:?}");
    }
}

#[test]
fn rays_may_begin_in_the_shell() {
    let inside = ["camera.eye=[1.05, 0.42, 0]", "camera.target=[0, 0, -1]"];
    let frames = both(&load("fog-torus", &inside));
    assert_eq!(frames[0].report.counts["pixels_begun_inside"], 128 * 128);
    let metrics = compare("inside", &frames);
    assert!(metrics.max <= BOUND, "{metrics:?}");

    // In two parts of it at once.
    let mut scene = load("fog-torus", &inside);
    let doubled = doubled(&scene.shell);
    scene.shell = Arc::new(doubled);
    let frames = both(&scene);
    assert_eq!(frames[0].report.counts["pixels_overlapping"], 128 * 128);
    compare("inside two", &frames);
    agree_with_the_reference(&scene, &frames[0]);
}

/// The same tetrahedra twice, in one place.
fn doubled(shell: &Shell) -> Shell {
    let count = shell.vertices.len() as u32;
    let mut vertices = shell.vertices.to_vec();
    vertices.extend_from_within(..);
    let mut topology = (*shell.topology).clone();
    let tetrahedra = topology.tetrahedra.len() as u32;
    let again: Vec<_> = topology.tetrahedra.iter().map(|ids| ids.map(|id| id + count)).collect();
    topology.tetrahedra.extend(again);
    let beyond = |t: u32| if t == mesoshell::shell::EXTERIOR { t } else { t + tetrahedra };
    let again: Vec<_> = topology.neighbours.iter().map(|neighbours| neighbours.map(beyond)).collect();
    topology.neighbours.extend(again);
    topology.corners.extend_from_within(..);
    let mut texture = shell.texture.to_vec();
    texture.extend_from_within(..);
    Shell::assemble(topology, vertices, texture)
}

#[test]
fn cycles_are_nothing_to_rays_that_walk() {
    let view = view(DVec3::new(0.0, 0.0, 8.0), DVec3::ZERO, 24.0, 0.01, 128);
    let frames = both(&painted(ring(12), &PAINTS, 0.2, view));
    assert!(frames[1].report.counts["tetrahedra_in_cycles"] >= 12);
    assert_eq!(frames[0].report.counts["pixels_overlapping"], 0);
    let metrics = compare("a ring", &frames);
    // In a cycle the two cut the same segments, but a step that is cut in two errs by some roundings more.
    assert!(metrics.max <= 1e-5, "{metrics:?}");
}

/// Tetrahedra that are inverted overlap their neighbours, and are met as they lie.
#[test]
fn folds_are_walked_as_they_lie() {
    let mut scene = load("fog-torus", &[]);
    let torus = mesoshell::mesh::generate::Torus { segments: 16, rings: 8, ..Default::default() };
    let mesh = mesoshell::mesh::generate::Generator::Torus(torus).build().unwrap();
    scene.shell = Arc::new(Shell::build(&mesh, &ShellOptions::new(0.9)).unwrap());
    assert!(scene.shell.health.inverted > 20, "{:?}", scene.shell.health);
    let frames = both(&scene);
    let metrics = compare("folds", &frames);
    // Where parts overlap, steps end where any of them begins or ends; of those that are sorted, any that is in a cycle.
    assert!(metrics.p999 <= 1e-4 && metrics.max <= 1e-3, "{metrics:?}");
    agree_with_the_reference(&scene, &frames[0]);
}
