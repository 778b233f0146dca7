//! Solids: which the ray meets, what they hide, and what colour they have.

use std::sync::Arc;

use glam::{DMat3, DQuat, DVec2, DVec3};
use mesoshell::mesh::Mesh;
use mesoshell::mesh::generate::{Generator, Plane, Sphere};
use mesoshell::reference::{Reference, TOLERANCE};
use mesoshell::scene::{Light, Scene, Solid, Source, View};
use mesoshell::volume::{Pyramid, Volume};

use super::brute_force::filtered;
use super::{
    OPACITY_DISTANCE, THICKNESS, error, flat_shell, grey, layers, level_zero, light, lit, noise, rays, scene,
    slant, slanted_view, view,
};

/// Of a few dozen operations on values of the order of 1, as in `closed_forms`.
const ROUNDING: f64 = 1e-13;

/// A solid whose vertices are mapped; normals as covectors are.
fn solid(generator: Generator, colour: DVec3, linear: DMat3, offset: DVec3) -> Solid {
    let mut mesh = generator.build().unwrap();
    mesh.positions.iter_mut().for_each(|position| *position = linear * *position + offset);
    let map = linear.inverse().transpose();
    mesh.normals.iter_mut().for_each(|normal| *normal = (map * *normal).normalize());
    Solid { origin: "a test".into(), mesh: mesh.into(), colour, texture: None }
}

/// Depth, number and barycentric coordinates of the first triangle, by trying all: T. Moeller, B. Trumbore, 1997.
fn first(mesh: &Mesh, eye: DVec3, direction: DVec3) -> Option<(f64, usize, DVec3)> {
    let mut first: Option<(f64, usize, DVec3)> = None;
    for (index, triangle) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = triangle.map(|id| mesh.positions[id as usize]);
        let found = DMat3::from_cols(b - a, c - a, -direction).inverse() * (eye - a);
        let (weights, depth) = (DVec3::new(1.0 - found.x - found.y, found.x, found.y), found.z);
        if weights.min_element() >= 0.0 && depth > 0.0 && first.is_none_or(|(nearest, ..)| depth < nearest) {
            first = Some((depth, index, weights));
        }
    }
    first
}

#[test]
fn a_ball_half_sunk_in_fog() {
    let alpha = 0.3_f32;
    let view = slanted_view();
    let colour = DVec3::new(0.2, 0.9, 1.7);
    let ball = Generator::Sphere(Sphere { radius: 0.4, segments: 14, rings: 9 });
    let mut scene = scene(flat_shell(), level_zero(layers(&[grey(alpha)])), view);
    let centre = DVec3::new(0.05, THICKNESS, 0.02);
    scene.solids = [solid(ball, colour, DMat3::IDENTITY, centre)].into();
    let sigma = -(1.0 - f64::from(alpha)).ln() / OPACITY_DISTANCE;
    let worst = |scene: &Scene, mesh: &Mesh| {
        let reference = Reference::new(scene, &view);
        let (mut hits, mut worst) = (0, 0.0_f64);
        for (point, direction) in rays(&view) {
            let sample = reference.integrate_ray(point);
            let entry = (view.camera.eye.y - THICKNESS) * slant(direction);
            let hit = first(mesh, view.camera.eye, direction).map(|(depth, ..)| depth * direction.length());
            let end = hit.unwrap_or(f64::INFINITY).min(view.camera.eye.y * slant(direction));
            let length = (end - entry).max(0.0);
            let passed = (-sigma * length).exp();
            let [r, g, b] = if hit.is_some() { (passed * colour).to_array() } else { [0.0; 3] };
            let fog = 1.0 - passed;
            let total = if hit.is_some() { 1.0 } else { fog };
            worst = worst.max(error(&sample.rgba, &[fog + r, 0.5 * fog + g, b, total]));
            // integral of T sigma s ds over the fog, s from the eye, and what reaches the ball.
            let mean =
                entry * fog + fog / sigma - length * passed + if hit.is_some() { passed * end } else { 0.0 };
            worst = worst.max((total * sample.depth - mean).abs() / 10.0);
            hits += usize::from(hit.is_some());
            assert!(hit.is_none() || sample.rgba[3] == 1.0);
        }
        assert!(hits > 10 && hits < 70, "{hits}");
        worst
    };
    assert!(worst(&scene, &scene.solids[0].mesh) <= TOLERANCE + ROUNDING);
    let mut moved = Mesh::clone(&scene.solids[0].mesh);
    moved.positions.iter_mut().for_each(|position| position.y += 1e-6);
    assert!(worst(&scene, &moved) > 100.0 * TOLERANCE);
}

#[test]
fn no_ray_passes_between_the_triangles_of_a_closed_mesh() {
    let linear = DMat3::from_quat(DQuat::from_axis_angle(DVec3::new(0.3, -0.5, 0.8).normalize(), 2.1))
        * DMat3::from_diagonal(DVec3::new(1.3, 0.6, 2.0));
    let ball = Generator::Sphere(Sphere { radius: 0.7, segments: 11, rings: 8 });
    let ball = solid(ball, DVec3::ONE, linear, DVec3::new(10.0, -7.0, 3.0));
    let misses = |solid: &Solid| {
        let mut misses = 0;
        for eye in [DVec3::new(10.0, -7.0, 3.0), DVec3::new(10.1, -6.95, 3.3)] {
            let mesh = &solid.mesh;
            for triangle in &ball.mesh.triangles {
                let [a, b, c] = triangle.map(|id| ball.mesh.positions[id as usize]);
                for target in
                    [a, b, c, 0.5 * (a + b), b.lerp(c, 0.3), c.lerp(a, 0.123_456), (a + b + c) / 3.0]
                {
                    let mut view = view(eye, target, 1);
                    view.camera.up = DVec3::new(0.3, 0.8, 0.4);
                    let mut scene = scene(flat_shell(), level_zero(layers(&[grey(0.0)])), view);
                    scene.solids = [Solid { mesh: mesh.clone(), ..solid.clone() }].into();
                    misses += u32::from(Reference::new(&scene, &view).pixel(0, 0).rgba != [1.0; 4]);
                }
            }
        }
        misses
    };
    assert_eq!(misses(&ball), 0);
    let mut torn = ball.clone();
    let mesh = Arc::make_mut(&mut torn.mesh);
    mesh.triangles.remove(20);
    mesh.uvs.remove(20);
    assert!(misses(&torn) >= 2);
}

/// A parallelogram with a texture, seen from near and far.
#[test]
fn a_texture_on_a_turned_and_stretched_solid_blends_its_levels() {
    let full = noise([8, 4, 1], 1.0);
    let texels = full.texels.iter().map(|[r, g, b, _]| [*r, *g, *b, 1.0]).collect();
    let texture = Pyramid::build(Volume::new(full.size, texels).unwrap());
    let linear = DMat3::from_quat(DQuat::from_axis_angle(DVec3::new(0.3, -0.5, 0.8).normalize(), 2.1))
        * DMat3::from_diagonal(DVec3::new(1.3, 1.0, 0.6));
    let colour = DVec3::new(0.5, 1.0, 1.5);
    let offset = DVec3::new(0.3, 0.2, -0.4);
    let mut plate = solid(Generator::Plane(Plane { size: 2.0, segments: 2 }), colour, linear, offset);
    // As the plane's own map says, then turned and three times over, so that both repeat.
    let uv = |p: DVec3| DVec2::new(p.x + 0.4 * p.z, 1.5 * p.z - 0.1);
    let mesh = Arc::make_mut(&mut plate.mesh);
    for (triangle, uvs) in mesh.triangles.iter().zip(&mut mesh.uvs) {
        *uvs = triangle.map(|id| uv(linear.inverse() * (mesh.positions[id as usize] - offset)));
    }
    plate.texture = Some(texture.clone().into());
    let eye = offset + linear * DVec3::new(0.2, 2.0, 0.9);
    let view = view(eye, offset, 9);
    let mut scene = scene(flat_shell(), level_zero(layers(&[grey(0.0)])), view);
    scene.solids = [plate].into();
    // The densest texels of all directions in the plane.
    let texels_along = |x: f64, z: f64| {
        let along = DVec3::new(x, 0.0, z);
        (uv(along) - uv(DVec3::ZERO)) * DVec2::new(8.0, 4.0) / (linear * along).length()
    };
    let densest = (0..20_000).map(|i| {
        let (z, x) = (f64::from(i) * std::f64::consts::PI / 20_000.0).sin_cos();
        texels_along(x, z).length()
    });
    let rho = densest.fold(0.0, f64::max);
    let pixel = view.pixel_at_unit_depth();
    let last = texture.levels.len() - 1;
    for footprint in [0.0, 0.7, 1.0, 100.0] {
        scene.medium.lod_footprint = footprint;
        let reference = Reference::new(&scene, &view);
        let (mut hits, mut between) = (0, 0);
        for (point, direction) in rays(&view) {
            let Some((depth, ..)) = first(&scene.solids[0].mesh, eye, direction) else { continue };
            let place = uv(linear.inverse() * (eye + depth * direction - offset));
            let lod = (footprint * depth * pixel * rho).log2().clamp(0.0, last as f64);
            let at = |level: usize| filtered(&texture.levels[level.min(last)], place.extend(0.5));
            let (fine, coarse, part) = (at(lod as usize), at(lod as usize + 1), lod.fract());
            let expected: [f64; 4] = std::array::from_fn(|c| {
                (fine[c] * (1.0 - part) + coarse[c] * part) * if c < 3 { colour[c] } else { 1.0 }
            });
            // The scan of directions misses the densest by up to a 20000th of pi: half its square, 1e-8, of rho.
            let found = reference.integrate_ray(point).rgba;
            assert!(error(&found, &expected) < 1e-7, "{found:?} {expected:?}");
            hits += 1;
            between += usize::from(part > 0.01);
        }
        assert!(hits > 40, "{hits}");
        assert_eq!(between > 40, footprint == 0.7 || footprint == 1.0, "{footprint}: {between}");
    }
}

/// What a point of a plate sends to the eye: Lambert's and Blinn's laws in angles.
fn shaded(scene: &Scene, normal: DVec3, point: DVec3, eye: DVec3) -> DVec3 {
    let shading = scene.shading.as_ref().unwrap();
    let colour = scene.solids[0].colour;
    let to_eye = (eye - point).normalize();
    let normal = if normal.dot(to_eye) < 0.0 { -normal } else { normal };
    let mut sum = colour * shading.ambient;
    for light in &shading.lights {
        let (to_light, left) = match light.source {
            Source::Directional { towards } => (towards, 1.0),
            Source::Point { position, falloff } => {
                let ratio = falloff.map_or(0.0, |falloff| position.distance(point) / falloff);
                ((position - point).normalize(), 1.0 / (1.0 + ratio * ratio))
            }
        };
        let cosine = to_light.angle_between(normal).cos();
        if cosine > 0.0 {
            let half = (to_light + to_eye).normalize();
            let highlight = half.angle_between(normal).cos().max(0.0).powf(shading.shininess);
            sum += left * cosine * light.colour * (shading.diffuse * colour + shading.specular * highlight);
        }
    }
    sum
}

#[test]
fn a_plate_is_lit_on_the_side_that_is_seen() {
    let sun = Source::Directional { towards: DVec3::new(0.5, 0.7, 0.2).normalize() };
    let lamp = Source::Point { position: DVec3::new(-0.3, -0.8, 0.4), falloff: Some(1.2) };
    for shadow in [false, true] {
        for above in [1.0, -1.0] {
            let eye = DVec3::new(0.2, 2.0 * above, 0.5);
            let seen: View = view(eye, DVec3::ZERO, 5);
            let mut scene = scene(flat_shell(), level_zero(layers(&[grey(0.0)])), seen);
            let plate = Generator::Plane(Plane { size: 8.0, segments: 3 });
            scene.solids = [solid(plate, DVec3::new(0.5, 0.8, 0.3), DMat3::IDENTITY, DVec3::ZERO)].into();
            let lights = [light(sun, DVec3::new(1.0, 0.5, 2.0)), light(lamp, DVec3::new(0.3, 2.0, 1.0))];
            let lights = lights.map(|light| Light { shadow, ..light }).to_vec();
            let mut shading = lit(&scene, lights);
            (shading.ambient, shading.diffuse) = (DVec3::new(0.1, 0.2, 0.05), 0.7);
            (shading.specular, shading.shininess) = (0.6, 9.0);
            scene.shading = Some(shading);
            let reference = Reference::new(&scene, &seen);
            let mut smallest = f64::INFINITY;
            for (point, direction) in rays(&seen) {
                let place = eye - direction * (eye.y / direction.y);
                let expected = shaded(&scene, DVec3::Y, place, eye);
                let [r, g, b, _] = reference.integrate_ray(point).rgba;
                // Nothing stands before the plate, and paths to lights are free: only rounding is left. An angle
                // near 0 costs half of the digits of its cosine's.
                assert!(
                    (DVec3::new(r, g, b) - expected).abs().max_element() < 1e-8,
                    "{r} {g} {b} {expected}"
                );
                smallest = smallest.min((expected - scene.solids[0].colour * 0.1).max_element());
            }
            assert!(smallest > 0.05, "all of it is lit");
        }
    }
}
