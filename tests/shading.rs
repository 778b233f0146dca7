//! Lit scenes: against closed forms under any linear map of the mesh, against the reference on real textures, and each effect
//! against the pictures that it would give if it were off, wrong-handed or in another space.

mod common;

use std::f64::consts::PI;
use std::path::Path;
use std::sync::Arc;

use common::Watched;
use glam::{DMat3, DQuat, DVec2, DVec3};
use mesoshell::frame::Image;
use mesoshell::mesh::Mesh;
use mesoshell::metric;
use mesoshell::progress::Silent;
use mesoshell::reference::Reference;
use mesoshell::scene::{self, Emission, Light, March, Model, Scene, Shading, Source, Traversal, View};
use mesoshell::shell::{Shell, ShellOptions};
use mesoshell::volume::{Directions, Pyramid, Volume};
use rayon::prelude::*;

/// Of the slab, before it is mapped.
const THICKNESS: f64 = 0.25;

/// A square of side 2 about the origin, with (u, v) = (x, y), and a slab upon it that runs along z; all mapped by `linear`. Where
/// that mirrors, triangles are turned over, so that the slab is not inside out.
fn mapped_slab(linear: DMat3) -> Shell {
    let corners = [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)].map(|(x, y)| DVec3::new(x, y, 0.0));
    let mut triangles = vec![[0, 1, 3], [0, 3, 2]];
    if linear.determinant() < 0.0 {
        triangles.iter_mut().for_each(|triangle: &mut [u32; 3]| triangle.swap(1, 2));
    }
    let uv = |id: u32| corners[id as usize].truncate();
    let up = linear * DVec3::Z;
    let mesh = Mesh {
        positions: corners.map(|corner| linear * corner).to_vec(),
        normals: vec![up.normalize(); 4],
        uvs: triangles.iter().map(|triangle| triangle.map(uv)).collect(),
        triangles,
    };
    let shell = Shell::build(&mesh, &ShellOptions::new(THICKNESS * up.length())).unwrap();
    assert_eq!(shell.health.inverted, 0);
    shell
}

/// The texture's (u, v, w) from the unmapped slab's (x, y, z).
const TEXTURE_FROM_SLAB: DMat3 = DMat3::from_diagonal(DVec3::new(1.0, 1.0, 1.0 / THICKNESS));

/// Rotated, mirrored, stretched and sheared in several ways.
fn maps() -> [DMat3; 4] {
    let turn = DMat3::from_quat(DQuat::from_axis_angle(DVec3::new(0.3, -0.5, 0.8).normalize(), 2.1));
    let stretch = DMat3::from_diagonal(DVec3::new(1.3, 0.6, 2.0));
    let mirror = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
    let shear = DMat3::from_cols(DVec3::X, DVec3::new(0.4, 1.0, 0.0), DVec3::new(0.3, -0.2, 1.0));
    [DMat3::IDENTITY, turn * stretch, turn * mirror * stretch, turn * stretch * shear * mirror]
}

const COLOUR: DVec3 = DVec3::new(0.5, 0.25, 0.75);
const AMBIENT: DVec3 = DVec3::new(0.1, 0.05, 0.2);
const DIFFUSE: f64 = 0.8;
const SPECULAR: f64 = 0.6;
const SHININESS: f64 = 12.0;

/// A slab of one texel, lit from two directions and from a point.
fn slab(linear: DMat3, alpha: f32, model: Model, direction: DVec3) -> Scene {
    let [r, g, b] = (COLOUR.as_vec3() * alpha).to_array();
    let volume = Volume::new([1, 1, 1], vec![[r, g, b, alpha]]).unwrap();
    let directions = Directions::of(&volume, |_| direction.normalize());
    let up = linear * DVec3::Z;
    let towards = |direction: DVec3| Source::Directional { towards: (linear * direction).normalize() };
    let lamp = Source::Point { position: linear * DVec3::new(0.7, -0.4, 1.5), falloff: Some(1.5) };
    let lights = [
        (towards(DVec3::new(0.5, 0.3, 1.0)), DVec3::new(1.0, 0.8, 0.5)),
        (towards(DVec3::new(-0.8, 0.2, 0.3)), DVec3::new(0.2, 0.5, 1.5)),
        (lamp, DVec3::new(0.6, 1.2, 0.3)),
    ];
    let shell = mapped_slab(linear);
    let mut scene = Scene::new(shell, Pyramid::build(volume), THICKNESS * up.length());
    let eye = linear * DVec3::new(0.4, -0.9, 3.0);
    scene.view = mesoshell::stress::scenes::view(eye, linear * DVec3::new(0.1, 0.0, 0.1), 30.0, 1e-3, 48);
    scene.shading = Some(Shading {
        model,
        ambient: AMBIENT,
        diffuse: DIFFUSE,
        specular: SPECULAR,
        shininess: SHININESS,
        emission: Emission { glow: 0.0, from: 0.0 },
        shadow_size: 64,
        lights: lights.map(|(source, colour)| Light { source, colour, shadow: false }).to_vec(),
        directions: directions.into(),
    });
    scene
}

/// The colour that a point sends to the eye, where all of the texture has the world-space unit vector `direction`: the formulas of
/// Lambert, Blinn and Kajiya-Kay in angles.
fn colour(scene: &Scene, direction: DVec3, point: DVec3) -> DVec3 {
    let shading = scene.shading.as_ref().unwrap();
    let to_eye = (scene.view.camera.eye - point).normalize();
    let mut sum = COLOUR * AMBIENT;
    for light in &shading.lights {
        let (to_light, left) = match light.source {
            Source::Directional { towards } => (towards, 1.0),
            Source::Point { position, falloff } => {
                let ratio = position.distance(point) / falloff.unwrap();
                ((position - point).normalize(), 1.0 / (1.0 + ratio * ratio))
            }
        };
        let from_direction = to_light.angle_between(direction);
        let (scattered, mirrored) = match shading.model {
            Model::Surface if from_direction > 0.5 * PI => (0.0, 0.0),
            Model::Surface => {
                let half = (to_light + to_eye).normalize();
                let highlight = half.angle_between(direction).cos().max(0.0).powf(SHININESS);
                (from_direction.cos(), from_direction.cos() * highlight)
            }
            Model::Fibre => {
                // The cone of mirrored light is as far from the other end of the fibre.
                let off_cone = to_eye.angle_between(direction) - (PI - from_direction);
                (from_direction.sin(), off_cone.cos().max(0.0).powf(SHININESS))
            }
        };
        sum += left * light.colour * (DIFFUSE * scattered * COLOUR + SPECULAR * mirrored);
    }
    sum
}

fn rays(view: &View) -> impl Iterator<Item = (usize, DVec3)> {
    let points = (0..view.height).flat_map(move |y| (0..view.width).map(move |x| (x, y)));
    let centres = points.map(|(x, y)| DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5));
    let view = *view;
    centres.map(move |point| view.ray_at_unit_depth(point)).enumerate()
}

/// The picture of the reference at 1e-7, which is what f32 tells.
fn reference(scene: &Scene) -> Image {
    let (view, reference) = (scene.view, Reference::new(scene, &scene.view).with_tolerance(1e-7));
    let pixel = |i: u32| reference.pixel(i % view.width, i / view.width).rgba.map(|x| x as f32);
    Image {
        width: view.width,
        height: view.height,
        rgba: (0..view.width * view.height).into_par_iter().map(pixel).collect(),
    }
}

fn shell(scene: &Scene) -> Image {
    let scene = Arc::new(scene.clone());
    Watched::prepare("shell", &scene).render(&scene.view).image
}

/// The largest difference of any pixel's straight colour from that of an opaque slab whose vectors are `direction`; pixels are
/// compared where the ray enters through the slab's outer side.
fn largest_error(scene: &Scene, linear: DMat3, image: &Image, direction: DVec3) -> f64 {
    let (slab_from_world, eye) = (linear.inverse(), scene.view.camera.eye);
    let (mut compared, mut largest) = (0, 0.0_f64);
    for (i, ray) in rays(&scene.view) {
        let (from, along) = (slab_from_world * eye, slab_from_world * ray);
        let depth = (THICKNESS - from.z) / along.z;
        let entry = from + depth * along;
        if entry.truncate().abs().max_element() > 0.98 {
            continue;
        }
        let [r, g, b, a] = image.rgba[i].map(f64::from);
        assert!((a - 1.0).abs() < 1e-6, "the slab is opaque");
        let expected = colour(scene, direction.normalize(), eye + depth * ray);
        largest = largest.max((DVec3::new(r, g, b) / a - expected).abs().max_element());
        compared += 1;
    }
    assert!(compared > 600, "{compared} pixels compared");
    largest
}

/// The reference sees a wall where the ray enters it; the device's first sample is half a step within, a quarter of the slab: the
/// lamp is there by so much nearer. It is compared with only lights from afar.
///
/// Vectors are stored in f32, and cosines off by 2^-24; a power of 12 makes that 12 times as much, on the device, whose powers
/// are off by 2^-21 or so, 12 * 2^-21 = 6e-6.
fn assert_shaded(model: Model, world_from_slab: impl Fn(DMat3) -> DMat3, wrong: &[fn(DMat3) -> DMat3]) {
    // In the slab's own space; the stored vector is what becomes of it in the texture's.
    let vector = DVec3::new(0.45, -0.35, 0.8);
    let stored = world_from_slab(TEXTURE_FROM_SLAB) * vector;
    for (number, linear) in maps().into_iter().enumerate() {
        let scene = slab(linear, 1.0, model, stored);
        let direction = world_from_slab(linear) * vector;
        let found = largest_error(&scene, linear, &reference(&scene), direction);
        println!("{model:?}, map {number}: reference {found:e}");
        assert!(found < 1e-6, "map {number}: {found}");

        let mut afar = scene.clone();
        afar.shading.as_mut().unwrap().lights.truncate(2);
        let image = shell(&afar);
        let found = largest_error(&afar, linear, &image, direction);
        println!("{model:?}, map {number}: shell {found:e}");
        assert!(found < 2e-5, "map {number}: {found}");
        for (k, wrong) in wrong.iter().enumerate().filter(|_| number > 0) {
            let other = largest_error(&afar, linear, &image, wrong(linear) * vector);
            assert!(other > 0.05, "map {number} could not tell it from the wrong space {k}: {other}");
        }
        let mut dark = afar.clone();
        dark.shading.as_mut().unwrap().lights.clear();
        assert!(largest_error(&afar, linear, &shell(&dark), direction) > 0.1);
        let unlit = Scene { shading: None, ..afar.clone() };
        assert!(largest_error(&afar, linear, &shell(&unlit), direction) > 0.1);
    }
}

/// Normals are covectors: they go by the inverse transpose.
#[test]
fn normals_follow_a_rotated_mirrored_and_stretched_mesh() {
    let inverse_transpose = |map: DMat3| map.inverse().transpose();
    let wrong: [fn(DMat3) -> DMat3; 4] = [
        |linear| linear,
        |_| DMat3::IDENTITY,
        |linear| linear.transpose(),
        // Wrong-handed: u turned about.
        |linear| linear.inverse().transpose() * DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)),
    ];
    assert_shaded(Model::Surface, inverse_transpose, &wrong);
}

/// Tangents are vectors: they go with the mesh.
#[test]
fn tangents_follow_a_rotated_mirrored_and_stretched_mesh() {
    let wrong: [fn(DMat3) -> DMat3; 3] = [
        |_| DMat3::IDENTITY,
        |linear| linear.transpose(),
        |linear| linear * DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)),
    ];
    assert_shaded(Model::Fibre, |map| map, &wrong);
}

/// What is translucent has the same colour, where light and vectors are the same all along the ray.
#[test]
fn a_translucent_slab_has_the_colour_of_an_opaque_one() {
    for (model, plan) in [
        (Model::Surface, March::Exact),
        (Model::Surface, March::Paper { samples: 3 }),
        (Model::Fibre, March::default()),
    ] {
        let straight = |alpha: f32| {
            let mut scene = slab(maps()[1], alpha, model, DVec3::new(0.1, 0.2, 0.5));
            scene.march = plan;
            scene.shading.as_mut().unwrap().lights.truncate(2);
            let image = shell(&scene);
            let colour = |&[r, g, b, a]: &[f32; 4]| if a > 0.01 { Some([r / a, g / a, b / a]) } else { None };
            image.rgba.iter().map(colour).collect::<Vec<_>>()
        };
        let (mut compared, [thin, opaque]) = (0, [straight(0.4), straight(1.0)]);
        for (thin, opaque) in thin.iter().zip(&opaque).filter_map(|(a, b)| a.zip(*b)) {
            // Quotients by an alpha of 0.01 or more of what f32 rounded a few times.
            assert!(thin.iter().zip(opaque).all(|(a, b)| (a - b).abs() < 1e-4), "{thin:?} {opaque:?}");
            compared += 1;
        }
        assert!(compared > 600, "{compared}");
    }
}

/// A mirror shows the light where the normal is half-way, and there alone it is brightest.
#[test]
fn the_highlight_is_at_the_mirror_direction() {
    let mut scene = slab(DMat3::IDENTITY, 1.0, Model::Surface, DVec3::Z);
    let top = DVec3::new(0.2, 0.1, THICKNESS);
    let to_eye = (scene.view.camera.eye - top).normalize();
    let shading = scene.shading.as_mut().unwrap();
    let towards = DVec3::new(-to_eye.x, -to_eye.y, to_eye.z);
    shading.lights =
        vec![Light { source: Source::Directional { towards }, colour: DVec3::ONE, shadow: false }];
    (shading.ambient, shading.diffuse, shading.specular, shading.shininess) = (DVec3::ZERO, 0.0, 1.0, 1000.0);
    let image = shell(&scene);
    let brightest =
        (0..image.rgba.len()).max_by(|&a, &b| image.rgba[a][0].total_cmp(&image.rgba[b][0])).unwrap();
    let (_, ray) = rays(&scene.view).nth(brightest).unwrap();
    let eye = scene.view.camera.eye;
    let seen = eye + (THICKNESS - eye.z) / ray.z * ray;
    // Pixels are 2 tan(15 degrees) 3 / 48 wide.
    assert!(seen.distance(top) < 0.034, "{seen} for {top}");
    // The cosine of the light, times a power that is 1 within half a pixel: 1 - 1000 (0.006 / 2)^2 / 2.
    assert!((f64::from(image.rgba[brightest][0]) - to_eye.z).abs() < 0.01);
}

fn load(name: &str, overrides: &[&str]) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name).with_extension("toml");
    let overrides: Vec<String> = overrides.iter().map(|text| (*text).to_owned()).collect();
    scene::load(&path, &overrides, &Silent).unwrap_or_else(|error| panic!("{error:?}")).scene
}

fn rmse(a: &Image, b: &Image) -> f64 {
    metric::compare(a, b).unwrap().rmse
}

/// At the default step within 5e-3, and converging; off by far more without the light, or in the light of another model.
fn agrees_with_the_reference(name: &str) {
    let scene = load(name, &["image.size=[160, 160]"]);
    assert_eq!(scene.march, March::default());
    let exact = reference(&scene);
    let error = |march| rmse(&shell(&Scene { march, ..scene.clone() }), &exact);
    let default = error(March::default());
    let fine = error(March::Default { step: 0.125 });
    let paper = error(March::Paper { samples: 40 });
    let voxels = error(March::Exact);
    println!("{name}: default {default:e}, step 0.125 {fine:e}, paper {paper:e}, exact {voxels:e}");
    assert!(default <= 5e-3 && fine <= 0.5 * default && paper <= 5e-3 && voxels <= 2e-4);

    let mut others = vec![Scene { shading: None, ..scene.clone() }; 5];
    for (k, other) in others.iter_mut().enumerate().skip(1) {
        let mut shading = scene.shading.clone().unwrap();
        match k {
            1 => shading.lights.truncate(1),
            2 => shading.specular = 0.0,
            3 => shading.diffuse = 0.5,
            _ => {
                let levels = Arc::make_mut(&mut shading.directions).levels.iter_mut();
                levels.flat_map(|level| &mut level.texels).for_each(|texel| texel[0] = -texel[0]);
            }
        }
        other.shading = Some(shading);
    }
    for (k, other) in others.iter().enumerate() {
        let apart = rmse(&shell(other), &exact);
        println!("{name}: change {k} {apart:e}");
        assert!(apart > 5.0 * default, "change {k} makes no difference: {apart}");
    }
}

#[test]
fn lit_rocks_agree_with_the_reference() {
    agrees_with_the_reference("lit-rocks");
}

#[test]
fn lit_fur_agrees_with_the_reference() {
    agrees_with_the_reference("lit-fur");
}

/// A torus so thick that it fills its own hole many times over.
#[test]
fn a_shell_that_overlaps_itself_is_lit() {
    let overrides = ["image.size=[64, 64]", "shell.thickness=0.8", "mesh.segments=24", "mesh.rings=12"];
    let scene = load("lit-rocks", &[&overrides[..], &["march.step=0.25"]].concat());
    let exact = reference(&scene);
    for (traversal, count) in
        [(Traversal::Walk, "pixels_overlapping"), (Traversal::Sort, "tetrahedra_in_cycles")]
    {
        let scene = Arc::new(Scene { traversal, ..scene.clone() });
        let frame = Watched::prepare("shell", &scene).render(&scene.view);
        let found = rmse(&frame.image, &exact);
        println!("overlapping: {found:e}, {:?}", frame.report.counts);
        assert!(frame.report.counts[count] > 100, "{:?}", frame.report.counts);
        assert!(found <= 5e-3, "{found}");
    }
}

/// Light adds up: the picture in two lights, less that in none, is the sum of those in each.
#[test]
fn lights_add() {
    let scene = load("lit-rocks", &["image.size=[96, 96]"]);
    let with = |kept: &[usize]| {
        let mut scene = scene.clone();
        let shading = scene.shading.as_mut().unwrap();
        shading.lights = kept.iter().map(|&k| shading.lights[k]).collect();
        shell(&scene).rgba.into_flattened()
    };
    let [both, first, second, none] = [&[0, 1][..], &[0], &[1], &[]].map(with);
    for (i, both) in both.iter().enumerate() {
        let sum = first[i] + second[i] - none[i];
        assert!((both - sum).abs() < 1e-5 || i % 4 == 3, "{both} for {sum}");
    }
    assert!(first.iter().zip(&second).any(|(a, b)| (a - b).abs() > 0.1));
}

/// A world in a mirror: everything that it is made of, light included, with x turned about.
#[test]
fn a_mirrored_world_looks_mirrored() {
    for name in ["lit-rocks", "lit-fur"] {
        let scene = load(name, &["image.size=[96, 96]", "march.step=0.25"]);
        let flip = |v: DVec3| DVec3::new(-v.x, v.y, v.z);
        let mut mirrored = scene.clone();
        let shell_of = Arc::make_mut(&mut mirrored.shell);
        Arc::make_mut(&mut shell_of.vertices).iter_mut().for_each(|vertex| *vertex = flip(*vertex));
        // Tetrahedra of positive volume stay so: two vertices change places.
        let mut topology = (*shell_of.topology).clone();
        for t in 0..topology.tetrahedra.len() {
            topology.tetrahedra[t].swap(2, 3);
            topology.neighbours[t].swap(2, 3);
            topology.corners[t].swap(2, 3);
            Arc::make_mut(&mut shell_of.texture)[t].swap(2, 3);
        }
        shell_of.topology = Arc::new(topology);
        shell_of.measure();
        for vector in [&mut mirrored.view.camera.eye, &mut mirrored.view.camera.target] {
            *vector = flip(*vector);
        }
        let other_light = mirrored.clone();
        for light in &mut mirrored.shading.as_mut().unwrap().lights {
            match &mut light.source {
                Source::Directional { towards: vector } | Source::Point { position: vector, .. } => {
                    *vector = flip(*vector);
                }
            }
        }
        let in_a_mirror = |scene: &Scene| {
            let mut image = shell(scene);
            image.rgba.chunks_exact_mut(96).for_each(<[_]>::reverse);
            image
        };
        let original = shell(&scene);
        let found = rmse(&in_a_mirror(&mirrored), &original);
        let wrong = rmse(&in_a_mirror(&other_light), &original);
        println!("{name}: mirrored {found:e}, in light that is not {wrong:e}");
        assert!(found < 2e-4 && wrong > 0.02, "{name}: {found} {wrong}");
    }
}
