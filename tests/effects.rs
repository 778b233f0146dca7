//! Solids and glow, as the `shell` method draws them: against closed forms, against the reference, and against the pictures that there
//! would be if the effect were off or in the wrong place.

mod common;

use std::sync::Arc;

use common::effects::{
    ball, in_layer, light_up, plate, rays, reference, render, ring, rmse, slab, solid, solid_mesh, sun,
};
use glam::{DQuat, DVec3};
use mesoshell::mesh::generate::{Generator, Plane, Sphere};
use mesoshell::scene::{Emission, March, Scene, Skip, Skips, Solid, View};
use mesoshell::stress::scenes::view;
use mesoshell::volume::{Pyramid, Quantity, Volume};

/// In dense fog a long step counts, and is lit, where the mean of what it stops is. By the paper's plan, which takes as many samples here,
/// that is in its middle.
#[test]
fn a_long_step_in_dense_fog_counts_and_is_lit_where_it_stops_light() {
    let eye = DVec3::new(0.0, 2.0, 3.0);
    let view = View { depth: true, ..view(eye, DVec3::new(0.0, 0.4, 0.0), 40.0, 1e-3, 48) };
    let (height, extinction) = (0.5, 12.0);
    let mut scene = slab(20.0, height, extinction, [0.5, 0.6, 0.7], view);
    light_up(&mut scene, 0.0, vec![sun(DVec3::new(0.3, 1.0, 0.2), 4.0)]);
    let exact = reference(&scene);
    // How far off colours are, and depths, at most.
    let off = |march: March, off: &[Skip]| {
        let frame = render(&Scene { march, skips: Skips::without(off), ..scene.clone() });
        let depth = |(ray, depth): (DVec3, &f32)| {
            let [near, far] = <[f64; 2]>::from(in_layer(eye, ray, height)).map(|depth| depth * ray.length());
            let through = (-extinction * (far - near)).exp();
            let expected = (near + 1.0 / extinction - (far + 1.0 / extinction) * through) / (1.0 - through);
            (f64::from(*depth) - expected).abs()
        };
        let depths = rays(&view).zip(frame.depth.as_ref().unwrap()).map(depth);
        (rmse(&frame.image, &exact), depths.fold(0.0, f64::max))
    };
    let one_a_tetrahedron = March::Default { step: 1000.0 };
    let middle = off(March::Paper { samples: 1 }, &[]);
    for skips in [&[][..], &[Skip::EvenSpace]] {
        let mean = off(one_a_tetrahedron, skips);
        println!("{mean:?}, in the middle {middle:?}");
        // Rounding: depths of some 4 in f32, of a sum of a few.
        assert!(mean.1 < 1e-5 && middle.1 > 1e-2, "{mean:?} {middle:?}");
        assert!(mean.0 < 0.5 * middle.0, "{mean:?} {middle:?}");
    }
}

/// Where fog grows denser a long step counts farther in than where it is the same all along: the sample before tells.
#[test]
fn a_long_step_in_growing_fog_counts_farther_in() {
    let eye = DVec3::new(0.0, 6.0, 0.01);
    let view = View { depth: true, ..view(eye, DVec3::ZERO, 12.0, 1e-3, 48) };
    let (height, extinction) = (0.5, 8.0);
    let mut scene = slab(20.0, height, extinction, [1.0; 3], view);
    // From nothing at the top to twice the extinction at the ground.
    let texel = |i: u32| [2.0 - (i as f32 + 0.5) / 32.0; 4];
    let volume = Volume::of(Quantity::Extinction, [1, 1, 64], (0..64).map(texel).collect()).unwrap();
    scene.volume = Pyramid::build(volume).into();
    scene.medium.lod_footprint = 0.0;
    scene.march = March::Default { step: 4.0 };
    let frame = render(&scene);
    let mut sum = 0.0;
    for (ray, depth) in rays(&view).zip(frame.depth.as_ref().unwrap()) {
        let [near, far] = <[f64; 2]>::from(in_layer(eye, ray, height)).map(|depth| depth * ray.length());
        let whole = far - near;
        // At a part `u` of the way the optical depth is `dense u^2`; the mean of the way is by parts an integral of transmittances.
        let dense = extinction * whole;
        let parts = 1000;
        let passed = |i: u32| (-dense * ((f64::from(i) + 0.5) / f64::from(parts)).powi(2)).exp();
        let through = (0..parts).map(passed).sum::<f64>() / f64::from(parts);
        let end = (-dense).exp();
        sum += f64::from(*depth) - (near + whole * (through - end) / (1.0 - end));
    }
    // In steps. Sixteen are on the way: most of what is sent out comes from about the sixth, which grows as 1 + (2 u - 1) / 11, and whose
    // mean is a 66th of it farther in than if it were even. Only the first of each of three tetrahedra does not know.
    let off = sum / (48.0 * 48.0) / (height / 16.0);
    println!("off by {off} steps");
    assert!(off.abs() < 0.5 / 66.0, "{off}");
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
    // A step counts where the mean of what it stops is, however long it is.
    scene.march = March::Default { step: 16.0 };
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
