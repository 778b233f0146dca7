//! Media at the ends of their ranges: clear, opaque, so thin that 1 - alpha rounds to 1, so dense that nothing passes.

use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::compare::{ROUNDING, Transmittance, transmittance};
use super::scenes::{columns, connected, constant_scene, painted, view};
use super::{Case, Stand, alpha};
use crate::frame::{Backdrop, Image, file};
use crate::mesh::generate::{Generator, Plane, Torus};
use crate::reference::Reference;
use crate::scene::{March, Medium, Scene, View};
use crate::shell::{Shell, ShellOptions};
use crate::volume::Pyramid;
use crate::{Error, Result};

pub(super) const CASES: &[Case] = &[
    // Some 16 roundings of 2^-24, each in the length of the segment or its opacity: 1e-6.
    Case {
        name: "constant-medium-median",
        measure: "error of transmittance",
        bound: 1e-6,
        worst: |stand| Ok(percentile(&torus(stand)?, 0.5)),
    },
    // One ray in ten thousand may graze the outside at 1/100 radian, where 8 roundings move its entry by a hundred times as
    // much as straight ahead: 100 * 16 * 2^-24.
    Case {
        name: "constant-medium-p9999",
        measure: "error of transmittance",
        bound: 1e-4,
        worst: |stand| Ok(percentile(&torus(stand)?, 0.9999)),
    },
    // Neighbours read a shared face from the same plane, bit for bit, so no ray can pass between or be in both.
    Case {
        name: "constant-medium-lost",
        measure: "rays lost or counted twice",
        bound: 0.0,
        worst: |stand| torus(stand).map(|found| found.missed.max(found.miscounted) as f64),
    },
    // The blend adds alpha 0 times something to the target: not one bit changes.
    Case { name: "alpha-0", measure: "pixels changed", bound: 0.0, worst: clear },
    // Transmittance is 0 after the first sample, whatever the length: only the outline is left, which f32 may move.
    Case { name: "alpha-1", measure: "error / what f32 explains", bound: 1.0, worst: opaque },
    Case { name: "thin-path", measure: "relative error of opacity", bound: THIN_PATH, worst: thin_path },
    Case {
        name: "thin-layers",
        measure: "relative error of opacity",
        bound: THIN_LAYERS,
        worst: thin_layers,
    },
    Case {
        name: "optical-depth-range",
        measure: "relative error of opacity",
        bound: DEPTH_RANGE,
        worst: depth_range,
    },
];

/// The torus of `tests/constant_medium.rs`, coarser, from outside, afar and inside.
fn torus(stand: &Stand<'_>) -> Result<Transmittance> {
    let (segments, rings) = stand.either((45, 24), (90, 48));
    let mesh = Generator::Torus(Torus { segments, rings, ..Torus::default() }).build()?;
    let pixels = stand.either(128, 512);
    let views = [
        view(DVec3::new(0.9, 1.4, 3.0), DVec3::ZERO, 40.0, 1e-3, pixels),
        view(DVec3::new(0.2, 3.4, 0.3), DVec3::new(0.1, 0.0, 0.0), 40.0, 1e-3, pixels),
        view(DVec3::new(1.3, 0.35, 0.35), DVec3::new(0.5, 0.2, -1.0), 80.0, 1e-3, pixels),
    ];
    let scene = Arc::new(constant_scene(&mesh, 0.15, 0.5, 1.0, views[0])?);
    let mut method = stand.prepare(&scene)?;
    let mut all = Transmittance::default();
    for view in views {
        let mut found = transmittance(&scene, &view, &alpha(&method.render(&view)?.image));
        all.errors.append(&mut found.errors);
        all.missed += found.missed;
        all.miscounted += found.miscounted;
    }
    Ok(all)
}

/// Over the pixels that see the medium.
fn percentile(found: &Transmittance, part: f64) -> f64 {
    let mut seen: Vec<f64> = found.errors.iter().copied().filter(|error| *error > 0.0).collect();
    seen.sort_by(f64::total_cmp);
    let rank = (part * seen.len() as f64) as usize;
    seen.get(rank).copied().unwrap_or(f64::INFINITY)
}

/// A picture of nothing, laid over a background.
fn clear(stand: &Stand<'_>) -> Result<f64> {
    let mesh = Generator::Torus(Torus::default()).build()?;
    let view = view(DVec3::new(0.9, 1.4, 3.0), DVec3::ZERO, 40.0, 1e-3, 128);
    let image = stand.frame(&Arc::new(constant_scene(&mesh, 0.2, 0.0, 1.0, view)?))?.image;
    let empty = Image::new(view.width, view.height);
    let bits = |image: &Image| -> Vec<[u32; 4]> { image.rgba.iter().map(|p| p.map(f32::to_bits)).collect() };
    let changed = bits(&image).iter().zip(bits(&empty)).filter(|(a, b)| **a != *b).count();

    let unwritable = |error: std::io::Error| Error::Output {
        path: std::env::temp_dir(),
        message: error.to_string(),
        help: None,
    };
    let folder = tempfile::tempdir().map_err(unwritable)?;
    let laid = |name: &str, image: &Image| {
        let path = folder.path().join(name);
        file::write(&path, image, &Backdrop::colour([0.2, 0.5, 0.9]))?;
        file::read(&path)
    };
    let [over, background] = [laid("over.png", &image)?, laid("background.png", &empty)?];
    Ok((changed + usize::from(over != background)) as f64)
}

fn opaque(stand: &Stand<'_>) -> Result<f64> {
    let mesh = Generator::Torus(Torus { segments: 24, rings: 12, ..Torus::default() }).build()?;
    let view = view(DVec3::new(0.9, 1.4, 3.0), DVec3::ZERO, 40.0, 1e-3, stand.either(128, 512));
    stand.excess(&Arc::new(constant_scene(&mesh, 0.2, 1.0, 0.7, view)?), &[view])
}

/// Where every ray below meets medium: straight down on the middle of a plate of the given thickness, at most 10 degrees off.
fn down(height: f64) -> View {
    view(DVec3::new(0.013, height, 0.007), DVec3::new(0.01, 0.0, 0.0), 20.0, 1e-3, 32)
}

/// The worst relative error of the opacity of any pixel.
fn relative_error(stand: &Stand<'_>, scene: Scene) -> Result<f64> {
    let scene = Arc::new(scene);
    let image = stand.frame(&scene)?.image;
    let reference = Reference::new(&scene, &scene.view);
    let per_length = super::compare::extinction(&scene);
    let errors = image.rgba.iter().enumerate().map(|(i, pixel)| {
        let length = reference.path_length(super::compare::centre(&scene.view, i));
        let exact = -(-per_length * length).exp_m1();
        (f64::from(pixel[3]) / exact - 1.0).abs()
    });
    Ok(errors.fold(0.0, |worst, error| if error.is_nan() { f64::INFINITY } else { worst.max(error) }))
}

/// A path a million opacity distances long, of alpha 1e-8, so of an optical depth of 0.01, in steps of a sixteenth of a texel, so
/// at the most that are taken in a tetrahedron.
///
/// The bound: entry and exit, at 3 and 2 from the eye, are rounded some four times each, which is 20 * 2^-24 of the length of 1;
/// some 16 more roundings make the opacity. Adding up the samples must not add anything: 36 * 2^-24 is 2e-6.
const THIN_PATH: f64 = 36.0 * ROUNDING;

fn thin_path(stand: &Stand<'_>) -> Result<f64> {
    let mesh = Generator::Plane(Plane { size: 2.0, segments: 1 }).build()?;
    let mut worst = 0.0f64;
    for texels in stand.either(vec![1, 4096], vec![1, 64, 1024, 4096]) {
        let shell = Shell::build(&mesh, &ShellOptions::new(1.0))?;
        let mut scene = painted(shell, &[([0.5; 3], 1e-8)], 1e-6, down(3.0));
        let mut volume = columns(&[([0.5; 3], 1e-8)]).levels.remove(0);
        volume.texels = vec![volume.texels[0]; texels];
        volume.size = [1, 1, texels as u32];
        scene.volume = Arc::new(Pyramid::build(volume));
        // 16 samples a texel: 65,536 of them.
        scene.march = March::Default { step: 1.0 / 16.0 };
        worst = worst.max(relative_error(stand, scene)?);
    }
    Ok(worst)
}

/// A column of four hundred prisms, 1200 tetrahedra, a million opacity distances of alpha 1e-8 long.
///
/// The bound: every blend rounds the sum so far once, by at most 2^-24 of it; a ray passes at most all. Lengths add up to that of
/// the column, since each tetrahedron ends where the next begins; they and the opacity are as in [`THIN_PATH`].
const THIN_LAYERS: f64 = 1200.0 * ROUNDING + THIN_PATH;

fn thin_layers(stand: &Stand<'_>) -> Result<f64> {
    let layers = 400;
    let vertices = (0..=layers).flat_map(|layer| {
        [0.1, 2.2, 4.3].map(|turn| {
            let at = 20.0 * DVec2::from_angle(turn);
            DVec3::new(at.x, -0.01 * f64::from(layer), at.y)
        })
    });
    let tetrahedra = (0..layers).flat_map(|layer| {
        let [a, b, c, d, e, f] = [0, 1, 2, 3, 4, 5].map(|i| 3 * layer + i);
        [[a, b, c, f], [a, b, e, f], [a, d, e, f]]
    });
    let (vertices, tetrahedra): (Vec<_>, Vec<_>) = (vertices.collect(), tetrahedra.collect());
    let shell = connected(vertices, tetrahedra, &[DVec3::splat(0.5); 1200]);
    relative_error(stand, painted(shell, &[([0.5; 3], 1e-8)], 4e-6, down(3.0)))
}

/// Optical depths from 1e-6 to 1e6 through one plate.
///
/// The bound: the length of 0.5 lies between 2 and 2.5 from the eye, so its ends' roundings, four each, are 36 * 2^-24 of it.
/// Opacity follows with the same relative error at most, and some 16 roundings of its own; beyond an optical depth of 1/32 it
/// is 1 - exp(-depth), where exp may be off by two: 64 * 2^-24 of 1/32. Vulkan would allow exp and the logarithm of 1 - alpha
/// more, 98 and 28 times 2^-24: a driver that takes it may fail here.
const DEPTH_RANGE: f64 = (36.0 + 16.0 + 64.0) * ROUNDING;

fn depth_range(stand: &Stand<'_>) -> Result<f64> {
    let mesh = Generator::Plane(Plane { size: 2.0, segments: 2 }).build()?;
    let mut worst = 0.0f64;
    for alpha in stand.either(vec![1e-3, 0.5], vec![1e-8, 1e-3, 0.5, 0.999]) {
        for exponent in -6..=6 {
            let shell = Shell::build(&mesh, &ShellOptions::new(0.5))?;
            let mut scene = painted(shell, &[([0.5; 3], alpha)], 1.0, down(2.5));
            let depth = 10f64.powi(exponent);
            let opacity_distance = 0.5 * super::compare::extinction(&scene) / depth;
            scene.medium = Medium { opacity_distance, ..scene.medium };
            worst = worst.max(relative_error(stand, scene)?);
        }
    }
    Ok(worst)
}
