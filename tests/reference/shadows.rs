//! Light that the medium and solids stand in the way of.
//!
//! The medium of the closed forms is a flat slab of particles of one density that send on a quarter of what reaches them, so that
//! `C = 1/4 light * integral of sigma exp(-sigma s) E ds`, where `E` is `exp(-sigma times the path from the point out of the slab)`.

use glam::DVec3;
use mesoshell::mesh::Mesh;
use mesoshell::mesh::generate::{Generator, Plane, Sphere};
use mesoshell::reference::{Reference, SHADOW_TOLERANCE, TOLERANCE};
use mesoshell::scene::{Light, LightView, Scene, Solid, Source, View};
use mesoshell::volume::{Pyramid, Quantity, Volume};

use super::{
    OPACITY_DISTANCE, SIDE, THICKNESS, error, flat_shell, grey, layers, level_zero, light, lit, noise, rays,
    scene, shell, slant, slanted_view, torus_shell, view,
};

/// Of the slab, opacity 1/2 an opacity distance.
const SIGMA: f64 = std::f64::consts::LN_2 / OPACITY_DISTANCE;

const SUN: DVec3 = DVec3::new(0.48, 0.8, -0.36);

fn sun() -> Light {
    light(Source::Directional { towards: SUN }, DVec3::new(1.0, 2.0, 4.0))
}

/// White fog in one light; as opacity or as extinction, which are the same.
fn fog(light: Light, view: View, quantity: Quantity) -> Scene {
    let alpha = match quantity {
        Quantity::Opacity => 0.5,
        Quantity::Extinction => std::f32::consts::LN_2,
    };
    let volume = Volume { quantity, ..layers(&[[alpha; 4]]) };
    let mut scene = scene(flat_shell(), level_zero(volume), view);
    scene.shading = Some(lit(&scene, vec![light]));
    scene
}

/// Simpson's rule on an even number of steps.
fn simpson(from: f64, to: f64, steps: u32, at: impl Fn(f64) -> f64) -> f64 {
    let h = (to - from) / f64::from(steps);
    let weight = |i: u32| if i == 0 || i == steps { 1.0 } else { f64::from(2 + 2 * (i % 2)) };
    (0..=steps).map(|i| weight(i) * at(from + h * f64::from(i))).sum::<f64>() * h / 3.0
}

/// The largest difference between the reference's colours and `expected` times the light's, of all rays.
fn largest_error(scene: &Scene, tolerance: f64, expected: impl Fn(DVec3) -> f64) -> f64 {
    let colour = scene.shading.as_ref().unwrap().lights[0].colour;
    let reference = Reference::new(scene, &scene.view).with_tolerance(tolerance);
    let difference = |(point, direction)| {
        let [r, g, b, _] = reference.integrate_ray(point).rgba;
        (DVec3::new(r, g, b) - expected(direction) * colour).abs().max_element()
    };
    rays(&scene.view).into_iter().map(difference).fold(0.0, f64::max)
}

#[test]
fn single_scattering_in_a_slab_under_the_sun() {
    let view = slanted_view();
    for quantity in [Quantity::Opacity, Quantity::Extinction] {
        let scene = fog(sun(), view, quantity);
        // Down the ray, the path to the sun is `steepness` times as long as the way so far.
        let expected = |sun: DVec3| {
            move |direction: DVec3| {
                let steepness = 1.0 / (sun.y * slant(direction));
                let length = THICKNESS * slant(direction);
                0.25 * -(-SIGMA * length * (1.0 + steepness)).exp_m1() / (1.0 + steepness)
            }
        };
        // A texel's alpha is an f32.
        let rounding = 4.0 * f64::from(f32::EPSILON);
        for tolerance in [1e-4, SHADOW_TOLERANCE, 1e-8] {
            assert!(largest_error(&scene, tolerance, expected(SUN)) <= tolerance + rounding);
        }
        let lower = (SUN - 1e-3 * DVec3::Y).normalize();
        assert!(largest_error(&scene, SHADOW_TOLERANCE, expected(lower)) > SHADOW_TOLERANCE);
        // The same without shadows: brighter by far, and as accurate as ever.
        let mut bright = scene.clone();
        bright.shading.as_mut().unwrap().lights[0].shadow = false;
        let all = |direction: DVec3| -0.25 * (-SIGMA * THICKNESS * slant(direction)).exp_m1();
        assert!(largest_error(&bright, TOLERANCE, all) <= TOLERANCE + rounding);
        assert!(largest_error(&scene, SHADOW_TOLERANCE, all) > 0.05);
    }
}

#[test]
fn single_scattering_in_a_slab_around_a_lamp_and_under_one() {
    let view = slanted_view();
    let eye = view.camera.eye;
    for position in [DVec3::new(0.3, 1.5, -0.2), DVec3::new(0.2, 0.2, 0.1), DVec3::new(0.5, -0.6, 0.3)] {
        let source = Source::Point { position, falloff: Some(0.7) };
        let scene = fog(light(source, DVec3::new(2.0, 1.0, 3.0)), view, Quantity::Opacity);
        let expected = |position: DVec3| {
            move |direction: DVec3| {
                let [from, to] = [THICKNESS, 0.0].map(|y| (y - eye.y) / direction.y);
                let stretch = direction.length();
                // The integrand is analytic, but near a lamp in the slab it changes within a tenth.
                simpson(from, to, 4000, |z| {
                    let point = eye + z * direction;
                    let way = position - point;
                    let within = (position.y.clamp(0.0, THICKNESS) - point.y) / way.y;
                    let reaching = (-SIGMA * way.length() * within).exp();
                    let left = 1.0 / (1.0 + way.length_squared() / (0.7 * 0.7));
                    0.25 * SIGMA * stretch * (-SIGMA * stretch * (z - from)).exp() * reaching * left
                })
            }
        };
        for tolerance in [SHADOW_TOLERANCE, 1e-8] {
            assert!(largest_error(&scene, tolerance, expected(position)) <= tolerance);
        }
        assert!(largest_error(&scene, 1e-8, expected(position + 1e-3 * DVec3::X)) > SHADOW_TOLERANCE);
    }
}

/// Levels of one density each, so that only the level of detail varies. For a light it is that of its own pixels.
#[test]
fn a_light_reads_the_level_of_detail_of_its_own_pixels() {
    let [fine, coarse] = [0.3_f32, 0.6];
    let level = |size: [u32; 3], alpha| {
        Volume::new(size, vec![[alpha; 4]; size.iter().product::<u32>() as usize]).unwrap()
    };
    let pyramid = Pyramid { levels: vec![level([8, 8, 8], fine), level([4, 4, 4], coarse)] };
    let view = view(DVec3::new(0.3, 2.0, 0.9), DVec3::new(0.05, 0.0, 0.02), 3);
    let eye = view.camera.eye;
    // One picture, one, and six.
    let lamp = |x, y, z| Source::Point { position: DVec3::new(x, y, z), falloff: None };
    let cases = [
        (Source::Directional { towards: SUN }, 1, 2.0),
        (lamp(1.5, 9.0, -3.0), 1, 4.0),
        (lamp(0.7, 0.4, -0.3), 6, 2.5),
    ];
    for (source, views, footprint) in cases {
        let mut scene = scene(flat_shell(), pyramid.clone(), view);
        scene.medium.lod_footprint = footprint;
        let lamp = light(source, DVec3::ONE);
        scene.shading = Some(lit(&scene, vec![lamp]));
        let pictures = LightView::of(&lamp, &scene.extent(), 64);
        assert_eq!(pictures.len(), views);
        let light_pixel = pictures[0].pixel;
        let rho = |direction: DVec3| {
            let DVec3 { x, y, z } = direction.normalize();
            (8.0 / THICKNESS * x.hypot(z)).max(8.0 / SIDE * y.hypot(z)).max(8.0 / SIDE * x.hypot(y))
        };
        let sigma = |lod: f64| {
            let part = lod.clamp(0.0, 1.0);
            -(1.0 - (f64::from(fine) * (1.0 - part) + f64::from(coarse) * part)).ln() / OPACITY_DISTANCE
        };
        let mut levels = Vec::new();
        let reaching = |point: DVec3, pixel: f64| match source {
            Source::Directional { towards } => {
                let lod = (footprint * pixel * rho(towards)).log2();
                (-sigma(lod) * (THICKNESS - point.y) / towards.y).exp()
            }
            Source::Point { position, .. } => {
                let way = position - point;
                let within = (position.y.min(THICKNESS) - point.y) / way.y;
                let at = |s: f64| sigma((footprint * pixel * (1.0 - s) * way.length() * rho(way)).log2());
                (-way.length() * simpson(0.0, within, 60, at)).exp()
            }
        };
        let expected = |pixel: f64| {
            move |direction: DVec3| {
                let [from, to] = [THICKNESS, 0.0].map(|y| (y - eye.y) / direction.y);
                let stretch = direction.length();
                let seen = |z: f64| {
                    stretch * sigma((footprint * z * view.pixel_at_unit_depth() * rho(direction)).log2())
                };
                let steps = 400;
                let h = (to - from) / f64::from(steps);
                let mut depth = 0.0;
                // The midpoint rule.
                let terms = (0..steps).map(|i| {
                    let z = from + (f64::from(i) + 0.5) * h;
                    let step = seen(z) * h;
                    depth += step;
                    0.25 * step * (0.5 * step - depth).exp() * reaching(eye + z * direction, pixel)
                });
                terms.sum::<f64>()
            }
        };
        for (_, direction) in rays(&view) {
            let middle = eye + direction * ((0.5 * THICKNESS - eye.y) / direction.y);
            let (way, width) = match source {
                Source::Directional { towards } => (towards, 1.0),
                Source::Point { position, .. } => (position - middle, position.distance(middle)),
            };
            levels.push((footprint * light_pixel * width * rho(way)).log2());
        }
        assert!(levels.iter().any(|lod| *lod > 0.05 && *lod < 0.95), "{levels:?}");
        // Of second order in a 400th of an optical depth of a few: a few 1e-6. Kinks where level 0 or 1 ends err by as much.
        let bound = SHADOW_TOLERANCE + 1e-5;
        let found = largest_error(&scene, SHADOW_TOLERANCE, expected(light_pixel));
        assert!(found <= bound, "{found:e} from {source:?}");
        assert!(largest_error(&scene, SHADOW_TOLERANCE, expected(1.05 * light_pixel)) > 5.0 * bound);
    }
}

fn solid(mesh: Mesh, colour: DVec3) -> Solid {
    Solid { origin: "a test".into(), mesh: mesh.into(), colour, texture: None }
}

/// A square plate over the slab, facing up, and the floor beneath.
fn plate_and_floor(left: f64) -> Vec<Solid> {
    let mut plate = Generator::Plane(Plane { size: 0.8, segments: 3 }).build().unwrap();
    plate.positions.iter_mut().for_each(|position| *position += DVec3::new(left + 0.4, PLATE, 0.1));
    let mut floor = Generator::Plane(Plane { size: 10.0, segments: 2 }).build().unwrap();
    floor.positions.iter_mut().for_each(|position| position.y = FLOOR);
    [(plate, DVec3::ONE), (floor, DVec3::splat(0.5))].map(|(mesh, colour)| solid(mesh, colour)).to_vec()
}

const PLATE: f64 = 1.2;
const FLOOR: f64 = -0.2;

#[test]
fn the_shadow_of_a_plate_lies_in_the_fog_and_on_the_floor() {
    // From below the plate, so that none of it is seen.
    let view = view(DVec3::new(0.3, 1.1, 0.9), DVec3::new(-0.4, 0.0, 0.3), 24);
    let eye = view.camera.eye;
    let mut scene = fog(sun(), view, Quantity::Opacity);
    scene.solids = plate_and_floor(-0.5).into();
    // Where a ray is in the shadow: the plate is the box |x - middle| < half, on the way along the sun to its height.
    let shaded = |left: f64, direction: DVec3| {
        let up = |point: DVec3, slope: f64| point + SUN * ((PLATE * slope - point.y) / SUN.y);
        let (start, slope) = (up(eye, 1.0), up(direction, 0.0));
        let mut range = [0.0, f64::INFINITY];
        for (start, slope, middle) in [(start.x, slope.x, left + 0.4), (start.z, slope.z, 0.1)] {
            let ends = [-0.4, 0.4].map(|side| (middle + side - start) / slope);
            range = [range[0].max(ends[0].min(ends[1])), range[1].min(ends[0].max(ends[1]))];
        }
        range
    };
    let expected = |left: f64| {
        move |direction: DVec3| {
            let stretch = direction.length();
            let [from, to, floor] = [THICKNESS, 0.0, FLOOR].map(|y| (y - eye.y) / direction.y);
            let steepness = 1.0 / (SUN.y * slant(direction));
            // integral of sigma exp(-sigma s (1 + steepness)) from the top to depth z
            let up_to = |z: f64| {
                let s = stretch * (z.clamp(from, to) - from);
                -(-SIGMA * s * (1.0 + steepness)).exp_m1() / (1.0 + steepness)
            };
            let [begin, end] = shaded(left, direction);
            let dark = if begin < end { up_to(end) - up_to(begin) } else { 0.0 };
            let is_floor_dark = begin < floor && floor < end;
            let through = (-SIGMA * (stretch * (to - from) + THICKNESS / SUN.y)).exp();
            let of_floor = if is_floor_dark { 0.0 } else { 0.5 * SUN.y * through };
            0.25 * (up_to(to) - dark) + of_floor
        }
    };
    let found = largest_error(&scene, SHADOW_TOLERANCE, expected(-0.5));
    assert!(found <= SHADOW_TOLERANCE, "{found:e}");
    assert!(largest_error(&scene, SHADOW_TOLERANCE, expected(-0.499)) > 10.0 * SHADOW_TOLERANCE);
    // All cases occur: fog in part, fog and floor, neither.
    let ranges: Vec<_> = rays(&view)
        .into_iter()
        .map(|(_, direction)| {
            let [begin, end] = shaded(-0.5, direction);
            let [from, to, floor] = [THICKNESS, 0.0, FLOOR].map(|y| (y - eye.y) / direction.y);
            (begin < end && begin < to && end > from, begin < floor && floor < end)
        })
        .collect();
    for case in [(true, true), (true, false), (false, false)] {
        assert!(ranges.iter().filter(|range| **range == case).count() > 20, "{case:?}");
    }
}

/// The ray and the light span no plane then.
#[test]
fn a_ray_that_comes_from_the_light_is_lit_unless_a_solid_is_behind_the_eye() {
    let target = DVec3::new(0.1, 0.0, 0.6);
    let view = view(target + 1.3 * SUN, target, 3);
    let mut scene = fog(sun(), view, Quantity::Opacity);
    let middle = |scene: &Scene| Reference::new(scene, &view).pixel(1, 1).rgba;
    let bright = 0.125 * -(-2.0 * SIGMA * THICKNESS / SUN.y).exp_m1();
    let passed = (-SIGMA * THICKNESS / SUN.y).exp();
    let expected = [bright, 2.0 * bright, 4.0 * bright, 1.0 - passed];
    assert!(error(&middle(&scene), &expected) <= SHADOW_TOLERANCE);
    // Along the sun from the target, the plate's height is over its middle.
    let towards = target + SUN * (PLATE / SUN.y);
    scene.solids = plate_and_floor(towards.x - 0.4).into();
    assert_eq!(middle(&scene), [0.0, 0.0, 0.0, 1.0]);
    scene.solids = scene.solids[1..].into();
    let floor = 0.5 * SUN.y * passed * passed;
    let [r, g, b] = [1.0, 2.0, 4.0].map(|light| light * (bright + floor));
    assert!(error(&middle(&scene), &[r, g, b, 1.0]) <= SHADOW_TOLERANCE);
}

/// What the eye sees of a wall is its surface, and that is not in its own shadow, however it is turned.
#[test]
fn a_wall_does_not_shade_itself() {
    let ball = shell(Generator::Sphere(Sphere { segments: 12, rings: 8, ..Sphere::default() }), 0.3);
    let view = view(DVec3::new(0.4, 1.9, 2.9), DVec3::new(0.1, 0.05, -0.2), 24);
    let lamp = Source::Point { position: DVec3::new(2.0, 2.5, 1.0), falloff: None };
    for source in [Source::Directional { towards: SUN }, lamp] {
        let mut scene = scene(ball.clone(), level_zero(layers(&[[1.0; 4]])), view);
        scene.shading = Some(lit(&scene, vec![light(source, DVec3::ONE)]));
        let reference = Reference::new(&scene, &view);
        let (mut bright, mut dark) = (0, 0);
        for (point, direction) in rays(&view) {
            // The outermost face on the ray: the ball is convex.
            let mut nearest = (f64::INFINITY, DVec3::ZERO);
            for (t, neighbours) in scene.shell.topology.neighbours.iter().enumerate() {
                for face in (0..4).filter(|&face| neighbours[face] == mesoshell::shell::EXTERIOR) {
                    let [a, b, c] = scene.shell.face(t, face).map(|id| scene.shell.vertices[id as usize]);
                    let system = glam::DMat3::from_cols(b - a, c - a, -direction);
                    let found = system.inverse() * (view.camera.eye - a);
                    if found.x >= 0.0 && found.y >= 0.0 && found.x + found.y <= 1.0 && found.z < nearest.0 {
                        nearest = (found.z, (b - a).cross(c - a).normalize());
                    }
                }
            }
            let (depth, normal) = nearest;
            if depth.is_infinite() {
                continue;
            }
            let place = view.camera.eye + depth * direction;
            let to_light = match source {
                Source::Directional { towards } => towards,
                Source::Point { position, .. } => (position - place).normalize(),
            };
            let expected = if normal.dot(to_light) > 0.0 { 0.25 } else { 0.0 };
            assert_eq!(reference.integrate_ray(point).rgba, [expected, expected, expected, 1.0]);
            (bright, dark) = (bright + usize::from(expected > 0.0), dark + usize::from(expected == 0.0));
        }
        assert!(bright > 50 && dark > 10, "{bright} {dark}");
    }
}

#[test]
fn a_ball_does_not_shade_its_lit_side() {
    let view = view(DVec3::new(0.4, 1.9, 2.9), DVec3::ZERO, 24);
    let mut scene = scene(flat_shell(), level_zero(layers(&[grey(0.0)])), view);
    let mesh = Generator::Sphere(Sphere { segments: 24, rings: 16, ..Sphere::default() }).build().unwrap();
    scene.solids = [solid(mesh, DVec3::ONE)].into();
    scene.shading = Some(lit(&scene, vec![sun()]));
    let mut bright = scene.clone();
    bright.shading.as_mut().unwrap().lights[0].shadow = false;
    let [shaded, bright] = [&scene, &bright].map(|scene| Reference::new(scene, &view));
    let mut seen = 0;
    for (point, _) in rays(&view) {
        // A convex mesh hides no light from a triangle that faces it.
        let found = shaded.integrate_ray(point).rgba;
        assert_eq!(found, bright.integrate_ray(point).rgba);
        seen += usize::from(found[0] > 0.0);
    }
    assert!(seen > 80, "{seen}");
}

/// Everything at once: noise with opaque texels in a bent shell, levels of detail, a ball in the hole, the sun and two lamps.
#[test]
fn the_tolerance_is_kept() {
    let view = view(DVec3::new(0.5, 2.0, 2.2), DVec3::new(0.4, 0.0, 0.3), 8);
    let ball = Generator::Sphere(Sphere { radius: 0.6, segments: 12, rings: 8 }).build().unwrap();
    let sources = [
        Source::Directional { towards: SUN },
        Source::Point { position: DVec3::new(1.4, 1.0, 0.3), falloff: Some(1.0) },
        Source::Point { position: DVec3::new(0.9, 0.05, -0.1), falloff: None },
    ];
    for (most, footprint) in [(0.9, 1.0), (1.0, 0.0)] {
        let mut scene = scene(torus_shell(), Pyramid::build(noise([9, 7, 5], most)), view);
        scene.medium.lod_footprint = footprint;
        scene.solids = [solid(ball.clone(), DVec3::splat(0.7))].into();
        scene.shading = Some(lit(&scene, sources.map(|source| light(source, DVec3::ONE)).to_vec()));
        let at = |scene: &Scene, tolerance| {
            let reference = Reference::new(scene, &view).with_tolerance(tolerance);
            rays(&view).into_iter().map(|(point, _)| reference.integrate_ray(point).rgba).collect::<Vec<_>>()
        };
        let worst =
            |a: &[[f64; 4]], b: &[[f64; 4]]| a.iter().zip(b).map(|(a, b)| error(a, b)).fold(0.0, f64::max);
        let exact = at(&scene, 1e-7);
        assert!(exact.iter().filter(|rgba| rgba[0] > 0.02).count() > 40);
        for tolerance in [1e-3, 1e-4, SHADOW_TOLERANCE] {
            let found = worst(&at(&scene, tolerance), &exact);
            println!("{most}: {found:e} at {tolerance:e}");
            assert!(found <= tolerance, "{found:e} at {tolerance:e}");
        }
        let mut other = scene.clone();
        other.medium.opacity_distance *= 1.001;
        assert!(worst(&at(&other, SHADOW_TOLERANCE), &exact) > 3.0 * SHADOW_TOLERANCE);
    }
}
