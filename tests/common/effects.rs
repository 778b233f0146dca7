//! Small scenes with light, solids and shadows, and what they are compared with: for tests/effects.rs and tests/shadows.rs.

use std::sync::Arc;

use super::Watched;
use glam::{DVec2, DVec3};
use mesoshell::frame::{Frame, Image};
use mesoshell::mesh::Mesh;
use mesoshell::mesh::generate::{Generator, Plane, Sphere, Torus};
use mesoshell::metric;
use mesoshell::reference::Reference;
use mesoshell::scene::{Emission, Light, Model, Scene, Shading, Solid, Source, View};
use mesoshell::shell::{Shell, ShellOptions};
use mesoshell::stress::scenes::view;
use mesoshell::volume::{Directions, Pyramid, Quantity, Volume};
use rayon::prelude::*;

pub fn render(scene: &Scene) -> Frame {
    let scene = Arc::new(scene.clone());
    Watched::prepare("shell", &scene).render(&scene.view)
}

pub fn reference(scene: &Scene) -> Image {
    let View { width, height, .. } = scene.view;
    let integrals = Reference::new(scene, &scene.view);
    let pixels = (0..width * height).into_par_iter();
    let rgba = pixels.map(|i| integrals.pixel(i % width, i / width).rgba.map(|x| x as f32)).collect();
    Image { width, height, rgba }
}

pub fn rmse(a: &Image, b: &Image) -> f64 {
    metric::compare(a, b).unwrap().rmse
}

/// The ray through each pixel, at unit depth, in the order of the pixels.
pub fn rays(view: &View) -> impl Iterator<Item = DVec3> + use<> {
    let view = *view;
    (0..view.width * view.height).map(move |i| {
        let pixel = DVec2::new(f64::from(i % view.width), f64::from(i / view.width));
        view.ray_at_unit_depth(pixel + 0.5)
    })
}

/// A slab of equal texels above the XZ plane from -`half` to `half`, `height` high: `extinction` per world unit.
pub fn slab(half: f64, height: f64, extinction: f64, colour: [f32; 3], view: View) -> Scene {
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
pub fn light_up(scene: &mut Scene, ambient: f64, lights: Vec<Light>) {
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

pub fn sun(towards: DVec3, brightness: f64) -> Light {
    let source = Source::Directional { towards: towards.normalize() };
    Light { source, colour: DVec3::splat(brightness), shadow: true }
}

pub fn lamp(position: DVec3, brightness: f64) -> Light {
    let source = Source::Point { position, falloff: None };
    Light { source, colour: DVec3::splat(brightness), shadow: true }
}

pub fn solid(mesh: Mesh, colour: DVec3) -> Solid {
    Solid { origin: "a test".into(), mesh: mesh.into(), colour, texture: None }
}

/// Of the first solid, to be changed.
pub fn solid_mesh(scene: &mut Scene) -> &mut Mesh {
    Arc::make_mut(&mut Arc::make_mut(&mut scene.solids)[0].mesh)
}

pub fn ball(centre: DVec3, radius: f64, colour: DVec3) -> Solid {
    let mut mesh = Generator::Sphere(Sphere { radius, segments: 256, rings: 128 }).build().unwrap();
    mesh.positions.iter_mut().for_each(|position| *position += centre);
    solid(mesh, colour)
}

/// A square that faces up.
pub fn plate(centre: DVec3, side: f64, colour: DVec3) -> Solid {
    let mut mesh = Generator::Plane(Plane { size: side, segments: 1 }).build().unwrap();
    mesh.positions.iter_mut().for_each(|position| *position += centre);
    solid(mesh, colour)
}

/// Where a ray from `eye` meets the layer `0 <= y <= height`, in parts of `ray`.
pub fn in_layer(eye: DVec3, ray: DVec3, height: f64) -> (f64, f64) {
    let [a, b] = [(0.0 - eye.y) / ray.y, (height - eye.y) / ray.y];
    (a.min(b).max(0.0), a.max(b).max(0.0))
}

/// A ring of striped fog with a ball in it, under the sun and a lamp in its midst.
pub fn ring() -> Scene {
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
