//! Light and its shadows, as the `shell` method draws them: against closed forms, against the reference, and against the pictures that
//! there would be if the effect were off or in the wrong place.

mod common;

use std::sync::Arc;

use common::effects::{
    in_layer, lamp, light_up, plate, rays, reference, render, ring, rmse, slab, solid_mesh, sun,
};
use glam::{DVec2, DVec3};
use mesoshell::frame::Image;
use mesoshell::mesh::Mesh;
use mesoshell::mesh::generate::{Generator, Plane, Sphere, Torus};
use mesoshell::scene::{March, Scene, Source};
use mesoshell::shell::{Shell, ShellOptions};
use mesoshell::stress::scenes::view;
use mesoshell::volume::{Pyramid, Volume};

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

/// As a part of its own, which shares no vertices.
fn add_to(mesh: &mut Mesh, part: Mesh) {
    let first = mesh.positions.len() as u32;
    mesh.positions.extend(part.positions);
    mesh.normals.extend(part.normals);
    mesh.triangles.extend(part.triangles.iter().map(|corners| corners.map(|corner| corner + first)));
    mesh.uvs.extend(part.uvs);
}

/// Where the shell is in itself, media add, for lights as for the eye: two rings that go through one another.
#[test]
fn shadows_of_a_shell_that_overlaps_itself_agree_with_the_reference() {
    let one = Generator::Torus(Torus { segments: 24, rings: 12, ..Torus::default() }).build().unwrap();
    let turned = |v: DVec3| DVec3::new(v.x, -v.z, v.y);
    let mut other = one.clone();
    other.positions.iter_mut().for_each(|position| *position = turned(*position) + 0.4 * DVec3::X);
    other.normals.iter_mut().for_each(|normal| *normal = turned(*normal));
    let mut two = one;
    add_to(&mut two, other);
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
    // An eye's ray sees light that falls by exp(-2 / 64) a texel: one value for a step errs by a 24th of that squared, 4e-5 of a light of
    // at most 1. A curve has 14 knots at least, 1/13 apart, whose chords are off by up to (1/13)^2 / 8: they lie elsewhere.
    let difference = rmse(&coarse, &fine);
    assert!(difference < 8e-4, "{difference}");
    assert!(rmse(&coarse, &Image::new(24, 24)) > 0.1);
}

/// Rays of lights through so much of the shell at once that to count their steps, which are too many, and then to take fewer is too
/// much: they are gone through once more, coarsely.
#[test]
fn what_is_too_much_to_count_is_gone_through_coarsely() {
    let view = view(DVec3::new(0.3, 3.0, 2.0), DVec3::new(0.0, 0.25, 0.0), 30.0, 1e-3, 8);
    let mut scene = slab(10.0, 0.5, 2.0 / 14.0, [1.0; 3], view);
    // Fourteen slabs, one in another, together as dense as the one above: 55 stretches of up to fourteen media.
    let slab = Generator::Plane(Plane { size: 20.0, segments: 1 }).build().unwrap();
    let mut stack = slab.clone();
    for i in 1..14 {
        let mut lifted = slab.clone();
        lifted.positions.iter_mut().for_each(|position| position.y += f64::from(i) * 0.01);
        add_to(&mut stack, lifted);
    }
    scene.shell = Shell::build(&stack, &ShellOptions::new(0.5)).unwrap().into();
    light_up(&mut scene, 0.0, vec![sun(DVec3::Y, 4.0)]);
    scene.shading.as_mut().unwrap().shadow_size = 16;
    scene.medium.lod_footprint = 0.0; // level 0 alone, as above
    let [coarse, fine] = [1.0, 0.1].map(|step| {
        let scene = Scene { march: March::Default { step }, ..scene.clone() };
        render(&scene).image
    });
    let difference = rmse(&coarse, &fine);
    assert!(difference < 8e-4, "{difference}"); // as above
    assert!(rmse(&coarse, &Image::new(8, 8)) > 0.1);
}

/// Where a wall is cut through, or begins, its surface is lit: it is before all of it, though in the light's picture half of what is
/// beside a point is nearer to the light than the point.
#[test]
fn a_wall_is_not_in_its_own_shadow() {
    let view = view(DVec3::new(2.5, 2.0, 1.5), DVec3::new(0.0, 0.25, 0.0), 50.0, 1e-3, 128);
    let mut scene = slab(1.0, 0.5, 2.0, [1.0; 3], view);
    let volume = Volume::new([4; 3], vec![[1.0; 4]; 64]).unwrap();
    scene.volume = Pyramid::build(volume).into();
    let to_light = DVec3::new(1.0, 0.9, 0.8);
    light_up(&mut scene, 0.0, vec![sun(to_light, 4.0)]);
    scene.shading.as_mut().unwrap().shadow_size = 128;
    let image = render(&scene).image;
    let eye = view.camera.eye;
    let (low, high) = (DVec3::new(-1.0, 0.0, -1.0), DVec3::new(1.0, 0.5, 1.0));
    let mut compared = [0; 3]; // by the axis across which the face lies
    for (ray, found) in rays(&view).zip(&image.rgba) {
        // The eye is beyond all three faces: the box begins where the last of them is passed.
        let enter = ((high - eye) / ray).max_element();
        let point = eye + enter * ray;
        let to_faces = (point - low).min(high - point);
        // A pixel of the light's picture is 2.9 / 126 wide at most, of a box that is 2.9 from corner to corner, and as much wider on a
        // face as light falls aslant. Two of them from an edge all four pixels around a point show its face.
        let face = to_faces.min_position();
        let beside = 2.0 * 2.9 / 126.0 / to_light.normalize()[face];
        let far_faces = to_faces.to_array().into_iter().filter(|&to_face| to_face > beside).count();
        if far_faces == 2 && to_faces.min_element() > -1e-9 {
            // All that the texture sends out: a wall's colour, 1, times brightness / 4; and some dozen roundings.
            assert!((found[0] - 1.0).abs() < 1e-5, "{} at {point}", found[0]);
            compared[face] += 1;
        }
    }
    let least = [1000, 3000, 200];
    assert!((0..3).all(|face| compared[face] > least[face]), "{compared:?}");
}

/// A light's picture shows all solids: one far away makes the shadows of the shell coarse, and that is told of.
#[test]
fn a_solid_far_away_comes_with_a_warning() {
    let warns = |at: DVec3| {
        let mut scene = ring();
        scene.solids = [plate(at, 0.8, DVec3::Y)].into();
        let warnings = render(&scene).report.warnings;
        warnings.iter().any(|warning| warning.contains("shading.shadow_size"))
    };
    assert!(!warns(DVec3::new(0.9, 0.31, 0.4)));
    assert!(warns(DVec3::new(40.0, 0.31, 0.4)));
}
