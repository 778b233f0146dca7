//! The reference integrator against closed forms, against brute force, and against itself.
#![allow(missing_docs, reason = "a test names itself")]

mod brute_force;
mod closed_forms;
mod consistency;
mod emission;
mod shadows;
mod solids;

use glam::{DVec2, DVec3};
use mesoshell::mesh::generate::{Generator, Plane, Torus};
use mesoshell::scene::{
    Camera, Emission, Light, March, Medium, Model, Scene, Shading, Skips, Source, Traversal, View,
};
use mesoshell::shell::{Shell, ShellOptions};
use mesoshell::volume::{Directions, Pyramid, Volume};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

/// Side of the flat shell's square, and its thickness, in world units.
const SIDE: f64 = 4.0;
const THICKNESS: f64 = 0.5;
const OPACITY_DISTANCE: f64 = 0.25;

fn shell(generator: Generator, thickness: f64) -> Shell {
    Shell::build(&generator.build().unwrap(), &ShellOptions::new(thickness)).unwrap()
}

fn flat_shell() -> Shell {
    shell(Generator::Plane(Plane { size: SIDE, segments: 6 }), THICKNESS)
}

fn torus_shell() -> Shell {
    shell(Generator::Torus(Torus { segments: 16, rings: 8, ..Torus::default() }), 0.2)
}

/// A volume one texel wide whose layers, from w = 0 up, are `[r, g, b, a]` premultiplied.
fn layers(layers: &[[f32; 4]]) -> Volume {
    Volume::new([1, 1, layers.len() as u32], layers.to_vec()).unwrap()
}

fn grey(alpha: f32) -> [f32; 4] {
    [alpha, 0.5 * alpha, 0.0, alpha]
}

/// Independent texels: opacity up to `most`, of which a fifth is 0 and a fifth is `most`; colour up to 1.
fn noise(size: [u32; 3], most: f32) -> Volume {
    bright_noise(size, most, 1.0)
}

/// The same with colour up to `gain`.
fn bright_noise(size: [u32; 3], most: f32, gain: f32) -> Volume {
    let mut random = Pcg32::seed_from_u64(7);
    let texel = |_| {
        let alpha = (random.random_range(-0.33..1.33_f32)).clamp(0.0, 1.0) * most;
        let mut colour = || random.random_range(0.0..=gain) * alpha;
        [colour(), colour(), colour(), alpha]
    };
    Volume::new(size, (0..size.iter().product()).map(texel).collect()).unwrap()
}

fn level_zero(volume: Volume) -> Pyramid {
    Pyramid { levels: vec![volume] }
}

fn view(eye: DVec3, target: DVec3, size: u32) -> View {
    let camera = Camera { eye, target, up: DVec3::new(0.1, 0.2, -1.0), fov_y: 0.7, near: 1e-3 };
    View { camera, width: size, height: size, depth: true }
}

/// Down on the flat shell, aslant.
fn slanted_view() -> View {
    view(DVec3::new(0.3, 2.0, 0.9), DVec3::new(0.05, 0.0, 0.02), 9)
}

fn scene(shell: Shell, volume: Pyramid, view: View) -> Scene {
    let medium = Medium { opacity_distance: OPACITY_DISTANCE, lod_footprint: 0.0 };
    Scene {
        shell: shell.into(),
        volume: volume.into(),
        medium,
        shading: None,
        solids: [].into(),
        view,
        march: March::Default { step: 1.0 },
        traversal: Traversal::default(),
        end_below: mesoshell::scene::END_BELOW,
        skips: Skips::default(),
    }
}

/// Casts shadows.
fn light(source: Source, colour: DVec3) -> Light {
    Light { source, colour, shadow: true }
}

/// Particles of every direction, which send on a quarter of what they receive: white where the texture is.
fn lit(scene: &Scene, lights: Vec<Light>) -> Shading {
    Shading {
        model: Model::Surface,
        ambient: DVec3::ZERO,
        diffuse: 1.0,
        specular: 0.0,
        shininess: 1.0,
        emission: Emission { glow: 0.0, from: 0.0 },
        shadow_size: 64,
        lights,
        directions: Directions::of(&scene.volume.levels[0], |_| DVec3::ZERO).into(),
    }
}

fn centre(x: u32, y: u32) -> DVec2 {
    DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5)
}

/// Unit-depth directions of all pixels with their picture points.
fn rays(view: &View) -> Vec<(DVec2, DVec3)> {
    let points = (0..view.height).flat_map(|y| (0..view.width).map(move |x| centre(x, y)));
    points.map(|point| (point, view.ray_at_unit_depth(point))).collect()
}

/// World units per world unit of height, of a ray through the flat shell.
fn slant(direction: DVec3) -> f64 {
    direction.length() / direction.y.abs()
}

fn error(a: &[f64; 4], b: &[f64; 4]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}
