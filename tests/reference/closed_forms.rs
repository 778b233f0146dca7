//! Media whose integral along a ray can be written down.

use glam::{DMat3, DVec3};
use mesoshell::mesh::generate::{Generator, Plane, Sphere};
use mesoshell::progress::{Interrupt, Silent};
use mesoshell::reference::{Reference, Sample, TOLERANCE, render};
use mesoshell::scene::{Scene, View};
use mesoshell::shell::{Shell, ShellOptions};
use mesoshell::volume::{Pyramid, Volume};

use super::{
    OPACITY_DISTANCE, SIDE, THICKNESS, error, flat_shell, grey, layers, level_zero, rays, scene, shell,
    slant, slanted_view, torus_shell, view,
};

/// What rounding may add to [`TOLERANCE`]: a few dozen operations, on values of the order of 1.
const ROUNDING: f64 = 1e-13;

fn assert_close(found: f64, expected: f64, bound: f64) {
    assert!((found - expected).abs() <= bound, "{found} for {expected}, more than {bound:e} apart");
}

/// The rays of a view through the flat shell: (slant, result), all of which must hit.
fn through_flat(volume: Volume, view: &View) -> Vec<(f64, Sample)> {
    let scene = scene(flat_shell(), level_zero(volume), *view);
    let reference = Reference::new(&scene, view);
    rays(view).into_iter().map(|(point, ray)| (slant(ray), reference.integrate_ray(point))).collect()
}

/// `integral of -ln(clear)` per unit length, where `clear` runs linearly between two values.
fn mean_extinction(from: f64, to: f64) -> f64 {
    let primitive = |x: f64| if x == 0.0 { 0.0 } else { x - x * x.ln() };
    if from == to { -from.ln() } else { (primitive(to) - primitive(from)) / (to - from) }
}

#[test]
fn a_constant_medium_in_a_flat_shell() {
    let alpha = 0.3_f32;
    let view = slanted_view();
    for (slant, sample) in through_flat(layers(&[grey(alpha); 3]), &view) {
        let sigma = -(1.0 - f64::from(alpha)).ln() / OPACITY_DISTANCE;
        let length = THICKNESS * slant;
        let total = 1.0 - (-sigma * length).exp();
        assert_close(sample.rgba[3], total, TOLERANCE);
        // The texel's colour is its f32 quotient: exactly 1, 1/2 and 0 here.
        assert!(error(&sample.rgba, &[total, 0.5 * total, 0.0, total]) <= TOLERANCE);
        // integral of T sigma s ds over 0..length, from where the ray enters.
        let behind_entry = (1.0 / sigma) - length * (1.0 - total) / total;
        let entry = (view.camera.eye.y - THICKNESS) * slant;
        assert_close(sample.depth, entry + behind_entry, 10.0 * TOLERANCE / total);
    }
}

/// The length of a ray in the shell around a closed mesh, from the boundary alone: depths where it
/// leaves less depths where it enters, beyond `near`.
fn length_by_boundary(shell: &Shell, eye: DVec3, direction: DVec3, near: f64) -> f64 {
    let (mut sum, mut balance) = (0.0, 0.0);
    for (t, neighbours) in shell.topology.neighbours.iter().enumerate() {
        for face in (0..4).filter(|&face| neighbours[face] == mesoshell::shell::EXTERIOR) {
            let [a, b, c] = shell.face(t, face).map(|id| shell.vertices[id as usize]);
            // Moeller and Trumbore: eye + z direction = a + v (b - a) + w (c - a).
            let system = DMat3::from_cols(b - a, c - a, -direction);
            let solution = system.inverse() * (eye - a);
            let is_hit = solution.x >= 0.0 && solution.y >= 0.0 && solution.x + solution.y <= 1.0;
            if is_hit && solution.z > near {
                let outwards = direction.dot((b - a).cross(c - a)).signum();
                sum += outwards * solution.z;
                balance += outwards;
            }
        }
    }
    (sum - balance * near) * direction.length()
}

#[test]
fn a_constant_medium_in_bent_shells_seen_from_outside_and_inside() {
    let alpha = 0.2_f32;
    let sphere = shell(Generator::Sphere(Sphere { segments: 12, rings: 7, ..Sphere::default() }), 0.3);
    for (shell, inside) in [(sphere, DVec3::new(0.0, 0.1, 1.1)), (torus_shell(), DVec3::new(1.45, 0.1, 0.1))]
    {
        for eye in [DVec3::new(0.4, 1.9, 2.9), inside, DVec3::new(0.02, 0.01, 0.03)] {
            let view = view(eye, DVec3::new(0.1, 0.05, -0.2), 12);
            let scene = scene(shell.clone(), level_zero(layers(&[grey(alpha)])), view);
            let reference = Reference::new(&scene, &view);
            let mut hits = 0;
            for (point, direction) in rays(&view) {
                let length = length_by_boundary(&shell, eye, direction, view.camera.near);
                let total = 1.0 - (1.0 - f64::from(alpha)).powf(length / OPACITY_DISTANCE);
                assert_close(reference.path_length(point), length, 1e-12);
                assert_close(reference.integrate_ray(point).rgba[3], total, TOLERANCE + 1e-11);
                hits += u32::from(length > 0.0);
            }
            assert!(hits > 40, "{hits} rays hit the shell from {eye}");
        }
    }
}

#[test]
fn a_linear_density() {
    let (low, high) = (0.15_f32, 0.85_f32);
    for (slant, sample) in through_flat(layers(&[grey(low), grey(high)]), &slanted_view()) {
        let [low, high] = [low, high].map(|alpha| 1.0 - f64::from(alpha));
        // A quarter of the thickness is clamped at either end; half of it is the ramp.
        let mean = 0.25 * -(low.ln() + high.ln()) + 0.5 * mean_extinction(low, high);
        let total = 1.0 - (-mean * THICKNESS * slant / OPACITY_DISTANCE).exp();
        assert!(error(&sample.rgba, &[total, 0.5 * total, 0.0, total]) <= TOLERANCE);
    }
}

#[test]
fn a_linear_colour_in_a_constant_medium() {
    let alpha = 0.4_f32;
    let volume = layers(&[[alpha, 0.0, 0.0, alpha], [0.0, 0.0, alpha, alpha]]);
    for (slant, sample) in through_flat(volume, &slanted_view()) {
        // In optical depth from the top: blue is 1 to q, falls to 0 at 3q, and stays there to 4q.
        let q = -(1.0 - f64::from(alpha)).ln() * 0.25 * THICKNESS * slant / OPACITY_DISTANCE;
        let blue = 1.0 - ((-q).exp() - (-3.0 * q).exp()) / (2.0 * q);
        let total = 1.0 - (-4.0 * q).exp();
        assert!(error(&sample.rgba, &[total - blue, 0.0, blue, total]) <= TOLERANCE);
    }
}

#[test]
fn one_opaque_plane_of_texels_is_a_singularity_and_not_a_wall() {
    let (below, above) = (0.25_f32, 0.5_f32);
    for (slant, sample) in through_flat(layers(&[grey(below), grey(1.0), grey(above)]), &slanted_view()) {
        let [below, above] = [below, above].map(|alpha| 1.0 - f64::from(alpha));
        let mean =
            -(below.ln() + above.ln()) + 2.0 * (mean_extinction(below, 0.0) + mean_extinction(0.0, above));
        let total = 1.0 - (-mean / 6.0 * THICKNESS * slant / OPACITY_DISTANCE).exp();
        assert!(total < 0.9999);
        assert!(error(&sample.rgba, &[total, 0.5 * total, 0.0, total]) <= TOLERANCE);
    }
}

#[test]
fn a_wall_behind_a_translucent_layer() {
    let green = [0.0, 0.4, 0.0, 0.4_f32];
    let volume = layers(&[[0.0, 0.0, 1.0, 1.0], [1.0, 0.0, 0.0, 1.0], green, green]);
    let view = slanted_view();
    for (slant, sample) in through_flat(volume, &view) {
        // Down from the top: 3/8 of the thickness green, 1/4 from green to red, then the wall, red.
        let scale = THICKNESS * slant / OPACITY_DISTANCE;
        let first = -(1.0 - f64::from(green[3])).ln() * 0.375 * scale;
        // On the ramp, at x of its length, red is x and alpha 0.4 + 0.6 x. With clear = 1 - alpha = y, and
        // depth(x) = ramp times the integral of -ln(y) up to x, C = integral of T sigma red / alpha dx:
        // by the midpoint rule on 2^18 steps graded as x = 1 - (1 - t)^2 towards the singularity.
        let ramp = 0.25 * scale;
        let [base, rise] = [f64::from(green[3]), 1.0 - f64::from(green[3])];
        let depth = |x: f64| first + ramp * x * mean_extinction(1.0 - base, (1.0 - x) * rise);
        let steps = 1 << 18;
        let red: f64 = (0..steps)
            .map(|i| {
                let rest = 1.0 - (f64::from(i) + 0.5) / f64::from(steps);
                let x = 1.0 - rest * rest;
                let extinction = -(rest * rest * rise).ln() * ramp;
                2.0 * rest / f64::from(steps) * (-depth(x)).exp() * extinction * x / (base + rise * x)
            })
            .sum();
        let red = red + (-depth(1.0)).exp();
        // The midpoint rule errs by h^2 / 24 times the change of the slope, some tens: 1e-11.
        assert!(error(&sample.rgba, &[red, 1.0 - red, 0.0, 1.0]) <= TOLERANCE + 1e-10, "{sample:?} {red}");
    }
    // A wall at the surface hides everything: its colour is that of the entry, exactly.
    let wall = layers(&[green, green, [0.25, 0.5, 0.75, 1.0]]);
    for (slant, sample) in through_flat(wall, &view) {
        assert_eq!(sample.rgba, [0.25, 0.5, 0.75, 1.0]);
        let entry = (view.camera.eye.y - THICKNESS) * slant;
        assert_close(sample.depth, entry, ROUNDING);
    }
}

#[test]
fn empty_space_is_exactly_nothing_and_costs_nothing() {
    let view = slanted_view();
    let scene = scene(flat_shell(), level_zero(layers(&[[0.0; 4]; 4])), view);
    let frame = render(&scene, &view, &Silent, &Interrupt::default()).unwrap();
    assert!(frame.image.rgba.iter().all(|pixel| pixel.map(f32::to_bits) == [0; 4]));
    assert!(frame.depth.unwrap().iter().all(|&depth| depth == f32::INFINITY));
    assert_eq!(frame.report.counts["panels"], 0);
    assert!(frame.report.counts["segments"] > 0);
    assert_eq!(frame.report.counts["rays"], 81);
}

#[test]
fn levels_of_detail_are_blended_along_the_ray() {
    let [fine, coarse] = [0.3_f32, 0.6];
    let level = |size: [u32; 3], alpha| {
        Volume::new(size, vec![grey(alpha); size.iter().product::<u32>() as usize]).unwrap()
    };
    // Constant levels: only the level of detail varies, with depth. It goes from below 0 to above the last.
    let volume = Pyramid { levels: vec![level([8, 8, 8], fine), level([4, 4, 4], coarse)] };
    let view = view(DVec3::new(0.1, 1.4, 0.2), DVec3::new(0.8, 0.0, 0.1), 5);
    let mut scene = scene(flat_shell(), volume, view);
    // Texels per unit: 8 over the thickness, 8 over a side; as much of them counts as lies across the ray.
    let pixel = 2.0 * (0.5 * view.camera.fov_y).tan() / 5.0;
    let rho = |direction: DVec3| {
        let DVec3 { x, y, z } = direction.normalize();
        (8.0 / THICKNESS * x.hypot(z)).max(8.0 / SIDE * y.hypot(z)).max(8.0 / SIDE * x.hypot(y))
    };
    // Level 0 ends near depth 1.
    scene.medium.lod_footprint = 1.0 / (pixel * rho(view.camera.target - view.camera.eye));
    let reference = Reference::new(&scene, &view);
    let mut blended = 0;
    for (point, direction) in rays(&view) {
        let [enter, exit] = [THICKNESS, 0.0].map(|y| (y - view.camera.eye.y) / direction.y);
        let level_0_ends = 1.0 / (scene.medium.lod_footprint * pixel * rho(direction));
        let sigma = |z: f64| {
            let part = (z / level_0_ends).log2().clamp(0.0, 1.0);
            -(1.0 - (f64::from(fine) * (1.0 - part) + f64::from(coarse) * part)).ln()
        };
        // Simpson's rule, between the kinks where level 0 ends and level 1 begins.
        let simpson = |from: f64, to: f64| {
            let steps = 1000;
            let h = (to - from) / f64::from(steps);
            let at = |i: i32| sigma(from + h * f64::from(i));
            let inner: f64 = (1..steps).map(|i| f64::from(2 + 2 * (i % 2)) * at(i)).sum();
            h / 3.0 * (at(0) + inner + at(steps))
        };
        let [first, second] = [1.0, 2.0].map(|times| (times * level_0_ends).clamp(enter, exit));
        let cuts = [enter, first, second, exit];
        let depth: f64 = cuts.windows(2).map(|cut| simpson(cut[0], cut[1])).sum();
        let total = 1.0 - (-depth * direction.length() / OPACITY_DISTANCE).exp();
        // Simpson errs by h^4 (to - from) / 180 times a fourth derivative of a few tens: below 1e-12.
        assert!(
            error(&reference.integrate_ray(point).rgba, &[total, 0.5 * total, 0.0, total]) <= 2.0 * TOLERANCE
        );
        blended += usize::from(enter < 2.0 * level_0_ends && exit > level_0_ends);
    }
    // The others pass through the shell where it is all level 0, or all level 1.
    assert!(blended >= 15, "only {blended} rays");
}

#[test]
fn the_near_plane_is_a_depth_and_not_a_distance() {
    let alpha = 0.3_f32;
    let mut view = view(DVec3::new(0.0, 0.4, 0.1), DVec3::new(0.1, 0.0, 0.0), 7);
    view.camera.near = 0.1;
    for (i, (slant, sample)) in through_flat(layers(&[grey(alpha)]), &view).into_iter().enumerate() {
        let direction = rays(&view)[i].1;
        let length = view.camera.eye.y * slant - view.camera.near * direction.length();
        let total = 1.0 - (1.0 - f64::from(alpha)).powf(length / OPACITY_DISTANCE);
        assert_close(sample.rgba[3], total, TOLERANCE);
    }
}

#[test]
fn rays_in_shared_faces_and_along_edges_count_once() {
    // Straight down on a vertex of the grid: the middle pixel looks along an edge of prisms, and its row and
    // column (or its diagonals) along their sides.
    for turn in [0.0, 0.25, 0.5, 0.75, 1.0_f64].map(|half_turns| half_turns * std::f64::consts::PI) {
        for eye in [DVec3::new(0.0, 2.0, 0.0), DVec3::new(SIDE / 6.0, 1.7, -SIDE / 6.0)] {
            let mut view = view(eye, DVec3::new(eye.x, 0.0, eye.z), 9);
            view.camera.up = DVec3::new(turn.sin(), 0.0, turn.cos());
            let scene = scene(flat_shell(), level_zero(layers(&[grey(0.5)])), view);
            let reference = Reference::new(&scene, &view);
            for (point, direction) in rays(&view) {
                assert_close(reference.path_length(point), THICKNESS * slant(direction), 1e-12);
            }
        }
    }
}

#[test]
fn inverted_cells_are_solids_too() {
    let mut mesh = Generator::Plane(Plane { size: SIDE, segments: 6 }).build().unwrap();
    mesh.normals.iter_mut().for_each(|normal| *normal = -*normal);
    let shell = Shell::build(&mesh, &ShellOptions::new(THICKNESS)).unwrap();
    assert_eq!(shell.health.inverted, shell.health.tetrahedra);
    let view = slanted_view();
    let volume = layers(&[grey(0.2), grey(0.7)]);
    let scene = scene(shell, level_zero(volume.clone()), view);
    let reference = Reference::new(&scene, &view);
    // The same medium upside down: a different path through it, of the same optical depth.
    for ((point, _), (_, upright)) in rays(&view).into_iter().zip(through_flat(volume, &view)) {
        assert_close(reference.integrate_ray(point).rgba[3], upright.rgba[3], 2.0 * TOLERANCE);
    }
}

#[test]
fn cells_without_volume_add_nothing() {
    let mesh = Generator::Plane(Plane { size: SIDE, segments: 6 }).build().unwrap();
    let mut options = ShellOptions::new(THICKNESS);
    // Nothing above the left half: its cells, and some of those at its border, are flat.
    options.thickness_scale = mesh.positions.iter().map(|p| f64::from(u8::from(p.x > 0.1))).collect();
    let shell = Shell::build(&mesh, &options).unwrap();
    assert!(shell.health.zero_volume > 36);
    let view = view(DVec3::new(0.0, 3.0, 0.0), DVec3::ZERO, 12);
    let scene = scene(shell, level_zero(layers(&[grey(0.5)])), view);
    let reference = Reference::new(&scene, &view);
    let ground = |direction: DVec3| view.camera.eye - direction * (view.camera.eye.y / direction.y);
    let (mut empty, mut full) = (0, 0);
    for (point, direction) in rays(&view) {
        let (length, ground) = (reference.path_length(point), ground(direction));
        // The first column of vertices of full thickness stands at SIDE / 6; the ray leans outwards.
        if ground.x < 0.0 {
            assert_eq!(length, 0.0);
            empty += 1;
        } else if ground.x * (1.0 - THICKNESS / 3.0) > SIDE / 6.0 {
            assert_close(length, THICKNESS * slant(direction), 1e-12);
            full += 1;
        }
    }
    assert!(empty > 40 && full > 10, "{empty} {full}");
    options.thickness_scale.fill(0.0);
    let flat = Shell::build(&mesh, &options).unwrap();
    assert_eq!(flat.health.zero_volume, flat.health.tetrahedra);
    let flat = Scene { shell: flat.into(), ..scene.clone() };
    assert_eq!(Reference::new(&flat, &view).pixel(6, 6).rgba, [0.0; 4]);
}

#[test]
fn media_that_overlap_add() {
    let low = Generator::Plane(Plane { size: SIDE, segments: 3 }).build().unwrap();
    let mut mesh = low.clone();
    let count = low.positions.len() as u32;
    mesh.positions.extend(low.positions.iter().map(|p| *p + DVec3::new(0.0, 0.5 * THICKNESS, 0.0)));
    mesh.normals.extend(&low.normals);
    mesh.triangles.extend(low.triangles.iter().map(|t| t.map(|id| id + count)));
    mesh.uvs.extend(&low.uvs);
    let shell = Shell::build(&mesh, &ShellOptions::new(THICKNESS)).unwrap();
    let view = slanted_view();
    let mut scene = scene(shell, level_zero(layers(&[grey(0.4)])), view);
    let reference = Reference::new(&scene, &view);
    for (point, direction) in rays(&view) {
        let length = 2.0 * THICKNESS * slant(direction);
        assert_close(reference.path_length(point), length, 1e-12);
        let total = 1.0 - 0.6_f64.powf(length / OPACITY_DISTANCE);
        // The texel is the f32 next to 0.4.
        assert_close(reference.integrate_ray(point).rgba[3], total, TOLERANCE + f64::from(f32::EPSILON));
    }
    // Walls hide across media: the upper shell is opaque from its upper texel down, and comes first.
    scene.volume = level_zero(layers(&[grey(0.4), grey(1.0)])).into();
    let reference = Reference::new(&scene, &view);
    assert_eq!(reference.pixel(4, 4).rgba, [1.0, 0.5, 0.0, 1.0]);
}
