//! Shadows, solids and glow, as the `shell` method draws them: against closed forms, against the reference, and against the
//! pictures that there would be if the effect were off or in the wrong place.

mod common;

use std::sync::Arc;

use common::Watched;
use glam::{DQuat, DVec2, DVec3};
use mesoshell::frame::{Frame, Image};
use mesoshell::mesh::Mesh;
use mesoshell::mesh::generate::{Generator, Plane, Sphere, Torus};
use mesoshell::metric;
use mesoshell::reference::Reference;
use mesoshell::scene::{Emission, Light, March, Model, Scene, Shading, Solid, Source, View};
use mesoshell::shell::{Shell, ShellOptions};
use mesoshell::stress::scenes::view;
use mesoshell::volume::{Directions, Pyramid, Quantity, Volume};
use rayon::prelude::*;

fn render(scene: &Scene) -> Frame {
    let scene = Arc::new(scene.clone());
    Watched::prepare("shell", &scene).render(&scene.view)
}

fn reference(scene: &Scene) -> Image {
    let View { width, height, .. } = scene.view;
    let integrals = Reference::new(scene, &scene.view);
    let pixels = (0..width * height).into_par_iter();
    let rgba = pixels.map(|i| integrals.pixel(i % width, i / width).rgba.map(|x| x as f32)).collect();
    Image { width, height, rgba }
}

fn rmse(a: &Image, b: &Image) -> f64 {
    metric::compare(a, b).unwrap().rmse
}

/// The ray through each pixel, at unit depth, in the order of the pixels.
fn rays(view: &View) -> impl Iterator<Item = DVec3> + use<> {
    let view = *view;
    (0..view.width * view.height).map(move |i| {
        let pixel = DVec2::new(f64::from(i % view.width), f64::from(i / view.width));
        view.ray_at_unit_depth(pixel + 0.5)
    })
}

/// A slab of equal texels above the XZ plane from -`half` to `half`, `height` high: `extinction` per world unit.
fn slab(half: f64, height: f64, extinction: f64, colour: [f32; 3], view: View) -> Scene {
    let mesh = Generator::Plane(Plane { size: 2.0 * half, segments: 4 }).build().unwrap();
    let shell = Shell::build(&mesh, &ShellOptions::new(height)).unwrap();
    let [r, g, b] = colour;
    let texels = vec![[r, g, b, 1.0]; 64];
    let volume = Volume::of(Quantity::Extinction, [1, 1, 64], texels).unwrap();
    let mut scene = Scene::new(shell, Pyramid::build(volume), extinction.recip());
    scene.view = view;
    scene
}

/// Lit by these lights, and by `ambient`; of no direction, so that `D` is 1/4 and there are no highlights.
fn light_up(scene: &mut Scene, ambient: f64, lights: Vec<Light>) {
    scene.shading = Some(Shading {
        model: Model::Surface,
        ambient: DVec3::splat(ambient),
        diffuse: 1.0,
        specular: 0.0,
        shininess: 1.0,
        emission: Emission { glow: 0.0, from: 0.0 },
        shadow_size: 256,
        lights,
        directions: Directions::normals(&scene.volume.levels[0]).into(),
    });
}

fn sun(towards: DVec3, brightness: f64) -> Light {
    let source = Source::Directional { towards: towards.normalize() };
    Light { source, colour: DVec3::splat(brightness), shadow: true }
}

fn lamp(position: DVec3, brightness: f64) -> Light {
    let source = Source::Point { position, falloff: None };
    Light { source, colour: DVec3::splat(brightness), shadow: true }
}

fn solid(mesh: Mesh, colour: DVec3) -> Solid {
    Solid { origin: "a test".into(), mesh: mesh.into(), colour, texture: None }
}

/// Of the first solid, to be changed.
fn solid_mesh(scene: &mut Scene) -> &mut Mesh {
    Arc::make_mut(&mut Arc::make_mut(&mut scene.solids)[0].mesh)
}

fn ball(centre: DVec3, radius: f64, colour: DVec3) -> Solid {
    let mut mesh = Generator::Sphere(Sphere { radius, segments: 256, rings: 128 }).build().unwrap();
    mesh.positions.iter_mut().for_each(|position| *position += centre);
    solid(mesh, colour)
}

/// A square that faces up.
fn plate(centre: DVec3, side: f64, colour: DVec3) -> Solid {
    let mut mesh = Generator::Plane(Plane { size: side, segments: 1 }).build().unwrap();
    mesh.positions.iter_mut().for_each(|position| *position += centre);
    solid(mesh, colour)
}

/// Where a ray from `eye` meets the layer `0 <= y <= height`, in parts of `ray`.
fn in_layer(eye: DVec3, ray: DVec3, height: f64) -> (f64, f64) {
    let [a, b] = [(0.0 - eye.y) / ray.y, (height - eye.y) / ray.y];
    (a.min(b).max(0.0), a.max(b).max(0.0))
}

/// An opaque ball half sunk in fog: what is before it of the fog, then the ball.
#[test]
fn a_ball_half_sunk_in_fog_is_its_closed_form() {
    let eye = DVec3::new(0.0, 2.0, 3.0);
    let view = view(eye, DVec3::new(0.0, 0.4, 0.0), 40.0, 1e-3, 96);
    let (height, extinction, radius) = (0.5, 1.5, 0.5);
    let mut scene = slab(20.0, height, extinction, [0.5, 0.6, 0.7], view);
    let centre = DVec3::new(0.1, height, -0.2);
    scene.solids = [ball(centre, radius, DVec3::new(0.9, 0.2, 0.1))].into();
    scene.view.depth = true;
    // So finely that the midpoints of steps, of h = 0.05 of the fog's height, are where its light is stopped in them: that is off by
    // (sigma h)^2 h / 24, 2e-6 a step, where a step counts.
    scene.march = March::Default { step: 0.05 };
    let frame = render(&scene);
    let closed = |ray: DVec3, radius: f64| {
        let (enter, exit) = in_layer(eye, ray, height);
        let (way, length) = (eye - centre, ray.length());
        let (a, b, c) = (ray.length_squared(), way.dot(ray), way.length_squared() - radius * radius);
        let hit = (b * b > a * c).then(|| (-b - (b * b - a * c).sqrt()) / a);
        let end = hit.map_or(exit, |hit| hit.min(exit));
        let fog = -(-extinction * length * (end - enter).max(0.0)).exp_m1();
        let under = if hit.is_some() { 1.0 - fog } else { 0.0 };
        let rgba = [0.5 * fog + 0.9 * under, 0.6 * fog + 0.2 * under, 0.7 * fog + 0.1 * under, fog + under];
        // Of the depth: the integral of T sigma s over the fog, and the ball behind it.
        let [near, far] = [enter, end.max(enter)].map(|depth| length * depth);
        let of_fog = near + 1.0 / extinction - (far + 1.0 / extinction) * (1.0 - fog);
        let depth = match hit {
            Some(hit) => of_fog + under * hit * length,
            None => of_fog / fog,
        };
        (rgba, hit.map(|hit| hit * length), depth)
    };
    let mut compared = [0, 0];
    for ((ray, found), depth) in rays(&view).zip(&frame.image.rgba).zip(frame.depth.as_ref().unwrap()) {
        // A mesh of 256 x 128 lies up to 1 - cos(pi / 128) = 3e-4 of the radius within the ball: left out where that decides
        // whether it is hit, elsewhere its surface is up to 3e-4 / cos(angle) farther.
        let (expected, hit, expected_depth) = closed(ray, radius);
        let (_, inner, _) = closed(ray, radius * (1.0 - 4e-3));
        if hit.is_some() != inner.is_some() {
            continue;
        }
        compared[usize::from(hit.is_some())] += 1;
        // Extinction times how much farther: 1.5 * 1.5e-4 / cos(85 degrees), on colours that differ by at most 0.6.
        let bound = if hit.is_some() { 1.6e-3 } else { 2e-5 };
        for (found, expected) in found.iter().zip(expected) {
            assert!((f64::from(*found) - expected).abs() < bound, "{found} for {expected}");
        }
        // How much farther the ball is: 1.5e-4 / cos(85 degrees).
        let bound = if hit.is_some() { 2e-3 } else { 1e-4 };
        assert!((f64::from(*depth) - expected_depth).abs() < bound, "{depth} for {expected_depth}");
    }
    assert!(compared[0] > 4000 && compared[1] > 900, "{compared:?}");
    // Without the ball, or with it elsewhere, it is another picture.
    let mut others = vec![scene.clone(); 2];
    others[0].solids = [].into();
    solid_mesh(&mut others[1]).positions.iter_mut().for_each(|position| position.y -= 0.1);
    for other in &others {
        assert!(rmse(&render(other).image, &frame.image) > 0.02);
    }
}

/// Light that falls slantwise through fog: `c E / 4` of a homogeneous slab integrates to
/// `c E / 4 sigma (exp(-b) - exp(-a)) / (a - b) / ...`, with one exponent for the way in and one for the way to the eye.
#[test]
fn fog_shades_itself_by_the_closed_form() {
    let eye = DVec3::new(0.3, 3.0, 2.0);
    let view = view(eye, DVec3::new(0.0, 0.25, 0.0), 30.0, 1e-3, 64);
    let (height, extinction, brightness) = (0.5, 2.0, 4.0);
    for towards in [DVec3::Y, DVec3::new(0.8, 1.0, -0.5)] {
        let mut scene = slab(10.0, height, extinction, [1.0; 3], view);
        light_up(&mut scene, 0.0, vec![sun(towards, brightness)]);
        scene.shading.as_mut().unwrap().shadow_size = 1024;
        let image = render(&scene).image;
        let per_height = extinction / towards.normalize().y;
        let mut compared = 0;
        for (ray, found) in rays(&view).zip(&image.rgba) {
            let (enter, exit) = in_layer(eye, ray, height);
            let path = ray.length() * (exit - enter);
            // At depth y below the top, on a way of extinction / cos to the eye and per_height to the light.
            let rate = (extinction * path / height + per_height) * height;
            let expected = 0.25 * brightness * extinction * path * -(-rate).exp_m1() / rate;
            // 1 being brightness / 4. Of light that is exp(-t) the curve has a chord from knot to knot, 1/13 apart: too bright by at
            // most (1/13)^2 / (8 exp(-t)), by 2/3 of that on the way. The eye sees that through exp(-k t), where k <= 1.7 is how much
            // more fog is before it than before the light: in all (1/13)^2 / 12 times the integral of k exp((1 - k) t), 1.5 at most.
            // From pixel to pixel of the light's picture, 0.028, slantwise fog begins up to 0.026 deeper: the mean of four is up to
            // (extinction 0.026)^2 / 8 too bright, of what is `expected`, 0.7 at most. Together 9.8e-4.
            let error = f64::from(found[0]) - expected;
            assert!(error.abs() < 1e-3, "{} for {expected}", found[0]);
            compared += 1;
        }
        assert_eq!(compared, 64 * 64);
        let mut unshadowed = scene.clone();
        unshadowed.shading.as_mut().unwrap().lights[0].shadow = false;
        assert!(rmse(&render(&unshadowed).image, &image) > 0.05);
    }
}

/// White fog in white light from everywhere sends out what it stops: it neither gains nor loses.
#[test]
fn a_white_medium_in_white_light_is_as_bright_as_it_is_opaque() {
    let view = view(DVec3::new(0.0, 2.0, 3.0), DVec3::ZERO, 60.0, 1e-3, 64);
    for extinction in [0.1, 3.0, 1000.0] {
        let mut scene = slab(2.0, 0.4, extinction, [1.0; 3], view);
        light_up(&mut scene, 1.0, Vec::new());
        let image = render(&scene).image;
        let covered = image.rgba.iter().filter(|pixel| pixel[3] > 0.0).count();
        assert!(covered > 1000);
        for [r, g, b, alpha] in image.rgba {
            assert!([r, g, b].iter().all(|channel| (channel - alpha).abs() <= 1e-6), "{r} for {alpha}");
        }
    }
}

/// A plate above a plate: the shadow of one lies on the other where the light says, with its edge.
#[test]
fn a_plate_casts_its_shadow_where_the_light_says() {
    let eye = DVec3::new(0.0, 4.0, 0.01);
    let view = view(eye, DVec3::ZERO, 60.0, 1e-3, 128);
    // Fog so thin that it does not count, far below.
    let mut scene = slab(0.1, 0.01, 1e-6, [1.0; 3], view);
    scene.solids = [
        plate(DVec3::new(0.0, 0.2, 0.0), 6.0, DVec3::ONE),
        plate(DVec3::new(0.0, 1.2, 0.0), 0.8, DVec3::ONE),
    ]
    .into();
    let lights = [sun(DVec3::new(-1.0, 1.0, 0.0), 1.0), lamp(DVec3::new(0.5, 2.2, 1.0), 1.0)];
    for (index, light) in lights.into_iter().enumerate() {
        light_up(&mut scene, 0.0, vec![light]);
        scene.shading.as_mut().unwrap().shadow_size = 1024;
        let image = render(&scene).image;
        let (mut in_shadow, mut in_light, mut at_edge) = (0, 0, 0);
        for (ray, found) in rays(&view).zip(&image.rgba) {
            let at = eye + (0.2 - eye.y) / ray.y * ray;
            let above = eye + (1.2 - eye.y) / ray.y * ray;
            let is_on = |point: DVec3, half: f64| half - point.x.abs().max(point.z.abs());
            if is_on(above, 0.4).abs() < 0.03 || is_on(at, 3.0) < 0.05 {
                continue; // the edges of the plates themselves
            }
            let to_light = match light.source {
                Source::Directional { towards } => towards,
                Source::Point { position, .. } => position - at,
            };
            let (to, cosine) = if is_on(above, 0.4) > 0.0 {
                (
                    -1.0,
                    match light.source {
                        Source::Directional { towards } => towards.y,
                        Source::Point { position, .. } => (position - above).normalize().y,
                    },
                )
            } else {
                // Where the way to the light passes the upper plate's height.
                (is_on(at + to_light / to_light.y, 0.4), to_light.normalize().y)
            };
            // Within a pixel of the light's picture of the edge, 7 / 1024, and the slant of the way there.
            let expected = if to > 0.02 { 0.0 } else { cosine };
            if to.abs() <= 0.02 {
                at_edge += 1;
                assert!(found[0] >= 0.0 && f64::from(found[0]) <= cosine + 1e-4);
                continue;
            }
            in_shadow += u32::from(to > 0.0);
            in_light += u32::from(to < 0.0);
            // Neither acne nor leaks.
            assert!(
                (f64::from(found[0]) - expected).abs() < 1e-4,
                "light {index}: {} for {expected} at {at}",
                found[0]
            );
        }
        assert!(in_shadow > 250 && in_light > 5000 && at_edge > 10, "{in_shadow} {in_light} {at_edge}");
    }
}

/// What bright colours send out, others do not.
#[test]
fn bright_colours_glow_by_the_definition() {
    let view = view(DVec3::new(0.0, 2.0, 3.0), DVec3::ZERO, 30.0, 1e-3, 16);
    for (brightest, glow, from) in [(0.9, 2.0, 0.5), (0.3, 2.0, 0.5), (0.9, 0.5, 0.0), (1.7, 2.0, 0.5)] {
        let mut scene = slab(10.0, 0.4, 1.0, [brightest as f32, 0.1, 0.2], view);
        light_up(&mut scene, 0.25, Vec::new());
        scene.shading.as_mut().unwrap().emission = Emission { glow, from };
        let factor = 0.25 + glow * ((brightest - from) / (1.0 - from)).clamp(0.0, 1.0);
        let mut expected = [brightest, 0.1, 0.2].map(|channel| channel * factor).to_vec();
        expected.push(1.0);
        for pixel in render(&scene).image.rgba {
            for (found, expected) in pixel.iter().zip(&expected) {
                assert!((f64::from(found / pixel[3]) - expected).abs() < 1e-5 * (1.0 + expected));
            }
        }
    }
}

/// A ring of striped fog with a ball in it, under the sun and a lamp in its midst.
fn ring() -> Scene {
    let mesh = Generator::Torus(Torus { segments: 24, rings: 12, ..Torus::default() }).build().unwrap();
    let options = ShellOptions { uv_scale: DVec2::new(6.0, 2.0), ..ShellOptions::new(0.3) };
    let shell = Shell::build(&mesh, &options).unwrap();
    let texel = |i: u32| {
        let alpha = if ((i / 3) ^ (i / 32)) & 1 == 0 { 0.5 } else { 0.03 };
        [0.9 * alpha, 0.7 * alpha, 0.4 * alpha, alpha]
    };
    let volume = Volume::new([8, 8, 4], (0..256).map(texel).collect()).unwrap();
    let mut scene = Scene::new(shell, Pyramid::build(volume), 0.06);
    scene.view = view(DVec3::new(0.5, 3.0, 3.2), DVec3::ZERO, 40.0, 1e-3, 40);
    scene.solids = [ball(DVec3::new(0.4, 0.7, 0.9), 0.35, DVec3::new(0.8, 0.3, 0.2))].into();
    light_up(
        &mut scene,
        0.1,
        vec![sun(DVec3::new(0.3, 1.0, 0.4), 2.0), lamp(DVec3::new(0.1, 0.3, -0.2), 1.0)],
    );
    let shading = scene.shading.as_mut().unwrap();
    shading.specular = 0.3;
    shading.shininess = 8.0;
    shading.shadow_size = 512;
    scene
}

#[test]
fn shadows_agree_with_the_reference() {
    let scene = ring();
    let exact = reference(&scene);
    let image = render(&scene).image;
    let error = rmse(&image, &exact);
    println!("RMSE {error:e}");
    assert!(error < 5e-3, "{error}");
    // Each thing left out or misplaced is seen.
    type Change = fn(&mut Scene);
    let changes: [(&str, Change); 6] = [
        ("the sun's shadow", |scene| scene.shading.as_mut().unwrap().lights[0].shadow = false),
        ("the lamp's shadow", |scene| scene.shading.as_mut().unwrap().lights[1].shadow = false),
        ("the ball", |scene| scene.solids = [].into()),
        ("where the sun is", |scene| {
            let towards = DVec3::new(-0.3, 1.0, 0.4).normalize();
            scene.shading.as_mut().unwrap().lights[0].source = Source::Directional { towards };
        }),
        ("the ball's place", |scene| {
            solid_mesh(scene).positions.iter_mut().for_each(|position| position.z = -position.z);
        }),
        ("how dense the fog is", |scene| scene.medium.opacity_distance *= 1.15),
    ];
    for (name, change) in changes {
        let mut changed = scene.clone();
        change(&mut changed);
        let apart = rmse(&render(&changed).image, &exact);
        println!("{name}: {apart:e}");
        assert!(apart > 2.0 * error, "{name} makes no difference: {apart}");
    }
}

/// Where the shell is in itself, media add, for lights as for the eye: two rings that go through one another.
#[test]
fn shadows_of_a_shell_that_overlaps_itself_agree_with_the_reference() {
    let one = Generator::Torus(Torus { segments: 24, rings: 12, ..Torus::default() }).build().unwrap();
    let mut two = one.clone();
    let count = one.positions.len() as u32;
    let turned = |v: DVec3| DVec3::new(v.x, -v.z, v.y);
    two.positions.extend(one.positions.iter().map(|&at| turned(at) + 0.4 * DVec3::X));
    two.normals.extend(one.normals.iter().map(|&normal| turned(normal)));
    two.uvs.extend(&one.uvs);
    two.triangles.extend(one.triangles.iter().map(|corners| corners.map(|corner| corner + count)));
    let options = ShellOptions { uv_scale: DVec2::new(6.0, 2.0), ..ShellOptions::new(0.3) };
    let mut scene = ring();
    scene.shell = Arc::new(Shell::build(&two, &options).unwrap());
    scene.solids = [].into();
    let exact = reference(&scene);
    let frame = render(&scene);
    assert!(frame.report.counts["pixels_overlapping"] > 50, "{:?}", frame.report.counts);
    let error = rmse(&frame.image, &exact);
    println!("RMSE {error:e}");
    assert!(error < 5e-3, "{error}");
    let mut denser = scene.clone();
    denser.medium.opacity_distance *= 1.15;
    let apart = rmse(&render(&denser).image, &exact);
    assert!(apart > 2.0 * error, "how dense the fog is makes no difference: {apart}");
}

/// A lamp in the fog itself, whose rays begin in the shell, beside a plate that it and a low sun hardly graze: rays of lights end at
/// solids, though no sooner than fog is seen before them.
#[test]
fn a_lamp_in_the_fog_and_a_steep_plate_agree_with_the_reference() {
    let mut scene = ring();
    scene.solids = [plate(DVec3::new(0.9, 0.31, 0.4), 0.8, DVec3::new(0.8, 0.3, 0.2))].into();
    let shading = scene.shading.as_mut().unwrap();
    shading.lights = vec![sun(DVec3::new(0.9, 0.12, 0.3), 2.0), lamp(DVec3::new(1.0, 0.45, 0.1), 1.0)];
    shading.shadow_size = 256;
    let inside = scene.shell.vertices.iter().map(|vertex| vertex.distance(DVec3::new(1.0, 0.45, 0.1)));
    assert!(inside.fold(f64::INFINITY, f64::min) < 0.15);
    let exact = reference(&scene);
    let image = render(&scene).image;
    let error = rmse(&image, &exact);
    println!("RMSE {error:e}");
    assert!(error < 5e-3, "{error}");
    for light in 0..2 {
        let mut changed = scene.clone();
        changed.shading.as_mut().unwrap().lights[light].shadow = false;
        let apart = rmse(&render(&changed).image, &exact);
        println!("without the shadow of light {light}: {apart:e}");
        assert!(apart > 2.0 * error, "the shadow of light {light} makes no difference: {apart}");
    }
}

/// Where parts of the shell touch and share no vertices, rays of lights that lie in the plane between them are in one of the two: the
/// shadow is that of the shell in one piece.
#[test]
fn rays_of_lights_between_parts_that_touch_are_not_lost() {
    let whole = Generator::Plane(Plane { size: 2.0, segments: 2 }).build().unwrap();
    let mut parted = Mesh { positions: Vec::new(), normals: Vec::new(), ..whole.clone() };
    let middle =
        |corners: &[u32; 3]| corners.iter().map(|&corner| whole.positions[corner as usize].x).sum::<f64>();
    for is_right in [false, true] {
        let first = parted.positions.len() as u32;
        parted.positions.extend(&whole.positions);
        parted.normals.extend(&whole.normals);
        for (triangle, corners) in whole.triangles.iter().enumerate() {
            if (middle(corners) > 0.0) == is_right {
                parted.triangles[triangle] = corners.map(|corner| first + corner);
            }
        }
    }
    let lit = |mesh: &Mesh| {
        let mut scene = ring();
        scene.solids = [].into();
        let options = ShellOptions { uv_scale: DVec2::splat(3.0), ..ShellOptions::new(0.5) };
        scene.shell = Arc::new(Shell::build(mesh, &options).unwrap());
        let shading = scene.shading.as_mut().unwrap();
        shading.lights = vec![sun(DVec3::Y, 2.0)];
        // A row of its pixels lies in the plane between the parts.
        shading.shadow_size = 65;
        render(&scene).image
    };
    let (whole, parted) = (lit(&whole), lit(&parted));
    let apart = rmse(&whole, &parted);
    println!("RMSE {apart:e}");
    assert!(apart < 1e-5, "{apart}");
}

/// Each pixel shows the nearest solid, lit and with its own texture: a ball of more triangles than 16 bits count, on a floor that
/// reaches behind the eye.
#[test]
fn solids_that_hide_one_another_agree_with_the_reference() {
    let mut scene = ring();
    scene.shading.as_mut().unwrap().lights.truncate(1);
    scene.shading.as_mut().unwrap().lights[0].shadow = false;
    scene.view = view(DVec3::new(0.2, 1.0, 2.5), DVec3::new(0.0, 0.2, 0.0), 60.0, 1e-3, 96);
    // There is next to nothing before them.
    scene.medium.opacity_distance = 1e9;
    let fine = Generator::Sphere(Sphere { radius: 0.6, segments: 256, rings: 160 }).build().unwrap();
    assert!(fine.triangles.len() > 1 << 16);
    let squares = |i: u32| if (i ^ (i >> 3)) & 1 == 0 { [1.0; 4] } else { [0.1, 0.2, 0.7, 1.0] };
    let squares = Volume::new([8, 8, 1], (0..64).map(squares).collect()).unwrap();
    let texture = Some(Pyramid::build(squares).into());
    let floor = plate(DVec3::new(0.0, -0.1, 0.0), 40.0, DVec3::new(0.9, 0.8, 0.7));
    let floor = Solid { texture, ..floor };
    scene.solids = [solid(fine, DVec3::new(0.8, 0.3, 0.2)), floor].into();
    let image = render(&scene).image;
    let exact = reference(&scene);
    let apart = image.rgba.iter().zip(&exact.rgba);
    let mut apart: Vec<f32> =
        apart.map(|(a, b)| (0..4).map(|k| (a[k] - b[k]).abs()).fold(0.0, f32::max)).collect();
    apart.sort_by(f32::total_cmp);
    // But at the ball's edge, of some 250 pixels, where a rasteriser's snapping may decide otherwise.
    let nearly_all = apart[apart.len() - 1 - apart.len() / 30];
    println!("97 %: {nearly_all:e}");
    // Of f32: places in the texture, up to 40 away, to a few 1e-7 of that; 8 texels with steps of 0.9 apart on 40.
    assert!(nearly_all < 2e-5, "{nearly_all}");
    let mut others = vec![scene.clone(); 2];
    Arc::make_mut(&mut others[0].solids).reverse();
    assert_eq!(rmse(&render(&others[0]).image, &image), 0.0);
    Arc::make_mut(&mut others[1].solids)[1].texture = None;
    assert!(rmse(&render(&others[1]).image, &image) > 0.02);
}

/// Textured, turned and stretched solids show what the reference sees on them, and their texture in the right place.
#[test]
fn textured_solids_agree_with_the_reference() {
    let mut scene = ring();
    scene.shading.as_mut().unwrap().lights.truncate(1);
    scene.shading.as_mut().unwrap().lights[0].shadow = false;
    scene.view.width = 96;
    scene.view.height = 96;
    let turn = DQuat::from_axis_angle(DVec3::new(0.3, -0.5, 0.8).normalize(), 1.1);
    let mut mesh = Generator::Plane(Plane { size: 1.6, segments: 2 }).build().unwrap();
    for (position, normal) in mesh.positions.iter_mut().zip(&mut mesh.normals) {
        *position = turn * (*position * DVec3::new(1.0, 1.0, 0.5)) + DVec3::new(0.0, 0.6, 0.0);
        *normal = turn * *normal;
    }
    let texel =
        |i: u32| [if i & 1 == 0 { 1.0 } else { 0.2 }, (i / 16) as f32 / 8.0, (i % 16) as f32 / 16.0, 1.0];
    let texture = Volume::new([16, 8, 1], (0..128).map(texel).collect()).unwrap();
    let texture = Some(Pyramid::build(texture).into());
    scene.solids = [Solid { texture, ..solid(mesh, DVec3::new(0.9, 0.8, 0.7)) }].into();
    // There is next to nothing before it.
    scene.medium.opacity_distance = 1e9;
    let exact = reference(&scene);
    let image = render(&scene).image;
    // But at the edges, where a rasteriser's snapping may decide otherwise: those of a hundred pixels.
    let apart = image
        .rgba
        .iter()
        .zip(&exact.rgba)
        .map(|(a, b)| (0..4).map(|k| (a[k] - b[k]).abs()).fold(0.0, f32::max));
    let mut apart: Vec<f32> = apart.collect();
    apart.sort_by(f32::total_cmp);
    let nearly_all = apart[apart.len() - 1 - apart.len() / 100];
    println!("99 %: {nearly_all:e}");
    // Of f32: places in the texture, 1.6 wide, to a few 1e-7 of it, 16 texels with steps of 0.8 apart.
    assert!(nearly_all < 2e-5, "{nearly_all}");
    for u in [1.0, 0.5] {
        let mut shifted = scene.clone();
        for uv in solid_mesh(&mut shifted).uvs.iter_mut().flatten() {
            uv.x = if u == 1.0 { -uv.x } else { uv.x + u };
        }
        assert!(rmse(&render(&shifted).image, &exact) > 0.02);
    }
}

/// Textures of solids are those of volumes for the device, and no larger.
#[test]
fn a_picture_too_large_for_the_device_is_named() {
    let size = [1 << 20, 1, 1];
    let texture = Volume::new(size, vec![[1.0; 4]; 1 << 20]).unwrap();
    let view = view(DVec3::new(0.0, 2.0, 3.0), DVec3::ZERO, 30.0, 1e-3, 16);
    let mut scene = slab(1.0, 0.1, 1.0, [1.0; 3], view);
    let plate = plate(DVec3::Y, 1.0, DVec3::ONE);
    scene.solids =
        [Solid { origin: "wall.png".into(), texture: Some(Pyramid::build(texture).into()), ..plate }].into();
    let messages = mesoshell::gpu::Messages::default();
    let prepared = common::set_up(&messages, |setup| {
        mesoshell::method::by_name("shell").unwrap().prepare(Arc::new(scene), &setup).map(drop)
    });
    let error = prepared.unwrap_err();
    assert!(error.to_string().starts_with("wall.png: a solid's texture: 1048576 x 1 x 1 texels"), "{error}");
    assert_eq!(error.exit_code(), 4);
    assert!(messages.all().is_empty(), "{:?}", messages.all());
}

/// A light's picture of a few pixels, in each of which thousands of tetrahedra are seen: its tiles are made smaller, or the frame fails
/// and says why; it is never silently dark.
#[test]
fn a_light_that_sees_too_much_in_a_pixel_is_told_of() {
    let sphere = Sphere { radius: 1.0, segments: 128, rings: 64 };
    let mesh = Generator::Sphere(sphere).build().unwrap();
    let lit_by = |thickness: f64, uv_scale: f64| {
        let options = ShellOptions { uv_scale: DVec2::splat(uv_scale), ..ShellOptions::new(thickness) };
        let shell = Shell::build(&mesh, &options).unwrap();
        let volume = Volume::new([4, 4, 4], vec![[0.001, 0.001, 0.001, 0.001]; 64]).unwrap();
        let mut scene = Scene::new(shell, Pyramid::build(volume), 0.3);
        (scene.view.width, scene.view.height) = (32, 32);
        // Level 0 alone, so that a coarse picture does not make the texture coarse.
        scene.medium.lod_footprint = 0.0;
        light_up(&mut scene, 0.0, vec![sun(DVec3::Y, 1.0)]);
        scene.shading.as_mut().unwrap().shadow_size = 16;
        scene
    };
    let image = render(&lit_by(0.1, 1.0)).image;
    // Next to nothing is absorbed: all of it is in the light.
    let unshadowed = {
        let mut scene = lit_by(0.1, 1.0);
        scene.shading.as_mut().unwrap().lights[0].shadow = false;
        render(&scene).image
    };
    assert!(rmse(&image, &unshadowed) < 1e-2 * rmse(&unshadowed, &Image::new(32, 32)));
    // Tens of thousands of samples along every ray.
    let messages = mesoshell::gpu::Messages::default();
    let scene = Arc::new(lit_by(0.1, 20_000.0));
    let result = common::set_up(&messages, |setup| {
        mesoshell::method::by_name("shell").unwrap().prepare(scene.clone(), &setup)?.render(&scene.view)
    });
    let error = result.map(drop).unwrap_err();
    assert!(
        error.to_string().contains("more of the shell than a pixel of a light's picture resolves"),
        "{error}"
    );
    assert_eq!(error.exit_code(), 4);
    assert!(messages.all().is_empty(), "{:?}", messages.all());
}

/// Where the march's steps are so short that a light's ray would take more of them than a device goes through, it takes longer ones.
#[test]
fn a_short_step_is_not_too_much_for_lights() {
    let view = view(DVec3::new(0.3, 3.0, 2.0), DVec3::new(0.0, 0.25, 0.0), 30.0, 1e-3, 24);
    let mut scene = slab(10.0, 0.5, 2.0, [1.0; 3], view);
    light_up(&mut scene, 0.0, vec![sun(DVec3::Y, 4.0)]);
    scene.medium.lod_footprint = 0.0; // level 0 alone, in a picture this coarse, too
    // A light's ray goes through 64 texels in steps of half a texel, and then of 0.02: of those 3200, 24 passes through loops each,
    // the device would go through 2500.
    let [coarse, fine] = [1.0, 0.02].map(|step| {
        let scene = Scene { march: March::Default { step }, ..scene.clone() };
        render(&scene).image
    });
    // An eye's ray sees light that falls by exp(-2 / 64) a texel: the midpoint rule errs by a 24th of that squared, 4e-5 of a light of
    // at most 1. A curve has 14 knots at least, 1/13 apart, whose chords are off by up to (1/13)^2 / 8: they lie elsewhere.
    let difference = rmse(&coarse, &fine);
    assert!(difference < 8e-4, "{difference}");
    assert!(rmse(&coarse, &Image::new(24, 24)) > 0.1);
}
