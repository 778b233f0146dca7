//! Where no order is right: cycles and shells that overlap themselves, against the reference.
//!
//! The media here are constant in each tetrahedron, so quadrature is exact, and what is left is rounding: no more than
//! [`excess`] explains, and than the 1e-4 of `constant_medium.rs`, while a wrong order would change colours by tenths.

mod common;

use std::f64::consts::TAU;
use std::sync::Arc;

use common::Watched;
use glam::DVec3;
use mesoshell::frame::Image;
use mesoshell::mesh::Mesh;
use mesoshell::mesh::generate::{Generator, Sphere};
use mesoshell::metric;
use mesoshell::scene::{Emission, Light, Model, Scene, Shading, Solid, Source, Traversal, View};
use mesoshell::shell::{Shell, ShellOptions};
use mesoshell::stress::compare::excess;
use mesoshell::stress::scenes::{PAINTS, Paint, columns, in_turns, loose, painted, ring, view};
use mesoshell::volume::Directions;

/// Whose tetrahedra are sorted.
fn scene(shell: Shell, paints: &[Paint], view: View) -> Arc<Scene> {
    Arc::new(Scene { traversal: Traversal::Sort, ..painted(shell, paints, 0.1, view) })
}

const BOUND: f64 = 1e-4;

/// [`excess`] allows for the ends of one segment on a ray; where a ray goes on from one member into the next, it has the ends of
/// both. What is behind two of these paints is a tenth of what is before it, or less.
const TWO_SEGMENTS: f64 = 2.0;

/// Both methods' pictures agree, whether tetrahedra are sorted or rays walk; returns the cycles that the report counts.
fn agree(scene: &Arc<Scene>) -> u64 {
    let reference = Watched::prepare("reference", scene).render(&scene.view);
    let covered = reference.image.rgba.iter().filter(|pixel| pixel[3] > 0.01).count();
    assert!(covered > 500, "only {covered} pixels covered");
    let counts = [Traversal::Walk, Traversal::Sort].map(|traversal| {
        let scene = Arc::new(Scene { traversal, ..Scene::clone(scene) });
        let shell = Watched::prepare("shell", &scene).render(&scene.view);
        let metrics = metric::compare(&shell.image, &reference.image).unwrap();
        let excess = excess(&scene, &scene.view, &shell.image);
        println!("{metrics:?}, excess {excess}, {covered} pixels covered, {:?}", shell.report.counts);
        assert!(metrics.max <= BOUND, "{metrics:?}");
        assert!(excess <= TWO_SEGMENTS, "{excess} times what f32 explains of a segment, {metrics:?}");
        shell.report.counts
    });
    counts[1]["cycles"]
}

#[test]
fn rings_of_interlocking_bars_are_resolved() {
    for count in [3, 6, 12] {
        let view = view(DVec3::new(0.0, 0.0, 8.0), DVec3::ZERO, 24.0, 0.01, 160);
        let cycles = agree(&scene(ring(count), &PAINTS, view));
        assert!(cycles >= 1, "a ring of {count} is no cycle");
    }
}

#[test]
fn a_wrong_order_would_be_seen() {
    // With two paints swapped a bar that lies before another looks as if it lay behind it.
    let view = view(DVec3::new(0.0, 0.0, 8.0), DVec3::ZERO, 24.0, 0.01, 160);
    let right = scene(ring(3), &PAINTS, view);
    let [a, b, c] = PAINTS;
    let swapped = scene(ring(3), &[b, a, c], view);
    let wrong = Watched::prepare("shell", &swapped).render(&view).image;
    assert!(excess(&right, &view, &wrong) > 100.0);
}

#[test]
fn a_cycle_before_the_near_plane_is_left_out() {
    let mut view = view(DVec3::new(0.0, 0.0, 8.0), DVec3::ZERO, 24.0, 0.01, 160);
    view.camera.near = 20.0;
    let frame = Watched::prepare("shell", &scene(ring(3), &PAINTS, view)).render(&view);
    assert_eq!(frame.report.counts["tetrahedra_in_cycles"], 3);
    assert_eq!(frame.report.counts["tetrahedra_drawn"], 0);
    assert!(frame.image.rgba.iter().all(|pixel| *pixel == [0.0; 4]));
}

#[test]
fn a_tetrahedron_too_small_for_its_maps_is_left_out() {
    // Seen from afar it has an outline, a pixel or so of margin; without maps nothing is known of what is in it.
    let mut shell = ring(3);
    let view = view(DVec3::new(0.0, 0.0, 8.0), DVec3::ZERO, 24.0, 0.01, 160);
    let drawn = |shell: Shell| {
        let frame = Watched::prepare("shell", &scene(shell, &PAINTS, view)).render(&view);
        frame.report.counts["tetrahedra_drawn"]
    };
    assert_eq!(drawn(shell.clone()), 5);
    shell.determinants[0] = 0.0;
    assert_eq!(drawn(shell), 4);
}

#[test]
fn views_one_after_another_are_drawn_as_each_alone() {
    let whole = view(DVec3::new(0.0, 0.0, 8.0), DVec3::ZERO, 24.0, 0.01, 96);
    let corner = view(DVec3::new(0.0, 0.0, 8.0), DVec3::new(0.9, 0.9, 0.0), 2.0, 0.01, 96);
    let mut behind = whole;
    behind.camera.near = 8.5;
    let scene = scene(ring(12), &PAINTS, whole);
    let mut method = Watched::prepare("shell", &scene);
    let mut drawn = Vec::new();
    for view in [corner, whole, behind, whole] {
        let frame = method.render(&view);
        assert_eq!(frame.image, Watched::prepare("shell", &scene).render(&view).image);
        drawn.push(frame.report.counts["tetrahedra_drawn"]);
    }
    assert!(drawn[0] < drawn[1] && drawn[2] < drawn[1], "no buffer had to grow: {drawn:?}");
}

/// Bars that hide one another in turns, a ball that they hide and are hidden by, and the shadows of all on all.
#[test]
fn a_cycle_around_a_ball_in_the_sun_agrees_with_the_reference() {
    let view = view(DVec3::new(0.0, 0.0, 8.0), DVec3::ZERO, 24.0, 0.01, 160);
    let mut scene = Scene { traversal: Traversal::Sort, ..painted(ring(3), &PAINTS, 0.1, view) };
    let mut ball = Generator::Sphere(Sphere { radius: 0.4, segments: 64, rings: 32 }).build().unwrap();
    ball.positions.iter_mut().for_each(|position| *position += DVec3::new(0.2, 0.1, 0.0));
    let colour = DVec3::new(0.9, 0.8, 0.3);
    scene.solids = [Solid { origin: "a test".into(), mesh: ball.into(), colour, texture: None }].into();
    let sun = Source::Directional { towards: DVec3::new(0.9, 0.3, 0.6).normalize() };
    scene.shading = Some(Shading {
        model: Model::Surface,
        ambient: DVec3::splat(0.1),
        diffuse: 1.0,
        specular: 0.0,
        shininess: 1.0,
        emission: Emission { glow: 0.0, from: 0.0 },
        shadow_size: 4096,
        lights: vec![Light { source: sun, colour: DVec3::splat(2.0), shadow: true }],
        directions: Directions::normals(&scene.volume.levels[0]).into(),
    });
    let render = |scene: &Scene| Watched::prepare("shell", &Arc::new(scene.clone())).render(&view);
    let exact = Watched::prepare("reference", &Arc::new(scene.clone())).render(&view).image;
    let frame = render(&scene);
    assert!(frame.report.counts["cycles"] > 0);
    let rmse = |image: &Image| metric::compare(image, &exact).unwrap().rmse;
    let error = rmse(&frame.image);
    println!("RMSE {error:e}");
    // Half of the bound of any scene with shadows, whose edges are those of pixels: see docs/gallery.md.
    assert!(error < 5e-3, "{error}");
    type Change = fn(&mut Scene);
    let changes: [(&str, Change); 3] = [
        ("the ball", |scene| scene.solids = [].into()),
        ("the shadows", |scene| scene.shading.as_mut().unwrap().lights[0].shadow = false),
        ("the order of two bars' paints", |scene| {
            let [a, b, c] = PAINTS;
            scene.volume = Arc::new(columns(&[b, a, c]));
        }),
    ];
    for (name, change) in changes {
        let mut changed = scene.clone();
        change(&mut changed);
        let apart = rmse(&render(&changed).image);
        println!("{name}: {apart:e}");
        assert!(apart > 3.0 * error, "{name} makes no difference: {apart}");
    }
}

/// Two shells through one another, the second shifted by its own radius.
fn overlapping() -> Mesh {
    let sphere = Generator::Sphere(Sphere { radius: 1.0, segments: 16, rings: 8 }).build().unwrap();
    let count = sphere.positions.len() as u32;
    let mut both = sphere.clone();
    both.positions.extend(sphere.positions.iter().map(|position| *position + DVec3::new(1.0, 0.2, 0.1)));
    both.normals.extend(sphere.normals);
    both.triangles.extend(sphere.triangles.iter().map(|triangle| triangle.map(|vertex| vertex + count)));
    // The first lies in the left column of the texture, the second in the right one.
    both.uvs = vec![[glam::DVec2::new(0.25, 0.5); 3]; sphere.triangles.len()];
    both.uvs.extend(vec![[glam::DVec2::new(0.75, 0.5); 3]; sphere.triangles.len()]);
    both
}

#[test]
fn media_that_overlap_add() {
    let shell = Shell::build(&overlapping(), &ShellOptions::new(0.2)).unwrap();
    let paints = [([0.9, 0.5, 0.1], 0.3), ([0.1, 0.5, 0.9], 0.4)];
    for eye in [DVec3::new(1.0, 1.5, 4.0), DVec3::new(4.0, 0.5, -1.0), DVec3::new(0.5, 0.1, 0.0)] {
        let view = view(eye, DVec3::new(0.5, 0.1, 0.05) + 0.01 * DVec3::Z, 50.0, 0.01, 160);
        let scene = scene(shell.clone(), &paints, view);
        assert!(agree(&scene) >= 1);
    }
}

#[test]
fn more_members_in_a_pixel_than_are_kept_at_once_are_resolved_in_turns() {
    // A pile of 200 flat tetrahedra that all overlap their neighbours in the pile.
    let pile: Vec<[DVec3; 4]> = (0..200)
        .map(|i| {
            let z = -0.02 * f64::from(i);
            let turn = f64::from(i);
            let corner = |k: f64| DVec3::new((turn + k * TAU / 3.0).cos(), (turn + k * TAU / 3.0).sin(), z);
            [corner(0.0), corner(1.0), corner(2.0), DVec3::new(0.0, 0.0, z + 0.03)]
        })
        .collect();
    let texture = in_turns(200);
    let faint = PAINTS.map(|(colour, alpha)| (colour, 0.2 * alpha));
    let view = view(DVec3::new(0.1, 0.2, 6.0), DVec3::ZERO, 24.0, 0.01, 96);
    assert!(agree(&scene(loose(&pile, &texture), &faint, view)) >= 1);
}

/// A bunch of spikes, each turned from the last, that all hold the origin; their colours differ, so that those that are left
/// out are missed in hue too.
fn bunch(count: u32) -> Scene {
    let spike = |i: u32| {
        let turn = f64::from(i) * TAU * 0.381_966; // the golden angle
        let tilt = 0.3 + 0.002 * f64::from(i);
        let corner = |k: f64| {
            let (sin, cos) = (turn + k * TAU / 3.0).sin_cos();
            DVec3::new(cos, sin, -tilt)
        };
        [corner(0.0), corner(1.0), corner(2.0), DVec3::new(0.0, 0.0, tilt)]
    };
    let spikes: Vec<[DVec3; 4]> = (0..count).map(spike).collect();
    let faint = PAINTS.map(|(colour, alpha)| (colour, 0.01 * alpha));
    let view = view(DVec3::new(0.3, 0.2, 6.0), DVec3::ZERO, 24.0, 0.01, 64);
    Arc::unwrap_or_clone(scene(loose(&spikes, &in_turns(spikes.len())), &faint, view))
}

#[test]
fn what_is_too_much_for_the_device_is_left_to_the_host() {
    for count in [20, 100] {
        let mut scene = bunch(count);
        scene.view.depth = count == 100;
        let scene = Arc::new(scene);
        let frames =
            ["shell", "reference"].map(|method| Watched::prepare(method, &scene).render(&scene.view));
        let metrics = metric::compare(&frames[0].image, &frames[1].image).unwrap();
        let left = frames[0].report.counts["pixels_left_to_host"];
        let excess = excess(&scene, &scene.view, &frames[0].image);
        println!("{count} spikes: {left} pixels left, excess {excess}, {metrics:?}");
        assert!(metrics.max <= BOUND && excess <= 1.0, "{excess} times what f32 explains, {metrics:?}");
        assert_eq!(left > 0, count > 20);
        let [shell, reference] = frames.map(|frame| frame.depth.unwrap_or_default());
        assert!(shell.iter().zip(&reference).all(|(a, b)| a == b || (a - b).abs() < 1e-3));
    }
}
