//! The same scene told otherwise: moved far away, scaled, mirrored, its vertices and triangles renamed, its surface cut into
//! other triangles. The picture must be the same.

use std::f64::consts::TAU;
use std::sync::Arc;

use glam::{DVec2, DVec3};
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64;

use super::compare::{ROUNDING, excess, transmittance};
use super::scenes::{constant_scene, view};
use super::{Case, Stand, alpha};
use crate::Result;
use crate::frame::Image;
use crate::mesh::Mesh;
use crate::mesh::generate::{Generator, Plane, Torus};
use crate::metric;
use crate::reference;
use crate::scene::{END_BELOW, March, Medium, Scene, Skips, Traversal, View};
use crate::shell::{Shell, ShellOptions};
use crate::volume::{Pyramid, Quantity, Volume};

pub(super) const CASES: &[Case] = &[
    // World coordinates at 1e6 are rounded to 6e-11, against which what f32 makes of positions relative to the eye, 2e-7, is
    // the larger part by far: twice the worst of one picture, which is a ray that grazes the outside at 1/1000 radian, so
    // 2 * 1000 * 8 * 2^-24 = 1e-3.
    Case { name: "offset", measure: "largest difference", bound: 1e-3, worst: offset },
    // The part of it that is in the input: what the reference makes of the moved scene. Four coordinates, each off by 2^-34,
    // grazing at 1/100 radian in a medium of at most 5 a unit; and the rounding of the reference's picture to f32.
    Case {
        name: "offset-input",
        measure: "largest difference of the reference",
        bound: 4.0 * 100.0 * 5.0 / (1u64 << 34) as f64 + ROUNDING,
        worst: offset_input,
    },
    // Neighbours share their planes wherever they are: 0 is expected, 1 in 50,000 may come of vertices that the input's own
    // rounding has moved across a ray.
    Case {
        name: "offset-lost",
        measure: "part of the rays lost or doubled",
        bound: 2e-5,
        worst: offset_lost,
    },
    // f64 rounds a scaled scene otherwise, by 1e-16; relative to the scene's own size all that reaches f32 is the same but for
    // one number in 2^29 / 16, which is off by a rounding of 2^-24, and 100 times that where a ray grazes: 6e-6.
    Case { name: "scale", measure: "largest difference", bound: 1e-5, worst: scale },
    Case { name: "scale-depth", measure: "relative error of depth", bound: SCALE_DEPTH, worst: scale_depth },
    // As for `scale`: the sign of one coordinate changes, and with it the order of some sums in f64.
    Case { name: "mirror", measure: "largest difference", bound: 1e-5, worst: mirror },
    // The same tetrahedra in another order of storage; along a ray they have but one order.
    Case { name: "triangle-order", measure: "largest difference", bound: 0.0, worst: triangle_order },
    // Other ids cut the prisms otherwise: other tetrahedra, whose medium has the same bounds.
    Case { name: "vertex-order", measure: "error / what f32 explains", bound: 1.0, worst: vertex_order },
    Case { name: "tilings", measure: "largest difference", bound: TILINGS, worst: tilings },
];

/// Waves of colour and opacity, which repeat along u and v.
fn waves() -> Pyramid {
    let size = [16, 16, 4];
    let texels = (0..16 * 16 * 4).map(|i| {
        let [u, v, w] = [i % 16, i / 16 % 16, i / 256].map(f64::from);
        let wave = |turns: f64| 0.5 + 0.5 * (TAU * turns).sin();
        let alpha = 0.1 + 0.4 * wave(u / 16.0) * wave(v / 16.0 + w / 8.0);
        let colour = [wave(v / 16.0), wave(u / 8.0), w / 3.0];
        [colour[0] * alpha, colour[1] * alpha, colour[2] * alpha, alpha].map(|x| x as f32)
    });
    Pyramid::build(Volume { size, texels: texels.collect(), quantity: Quantity::Opacity })
}

fn torus() -> Result<Mesh> {
    Generator::Torus(Torus { segments: 24, rings: 12, ..Torus::default() }).build()
}

const THICKNESS: f64 = 0.2;

fn views(stand: &Stand<'_>) -> [View; 2] {
    let pixels = stand.either(96, 256);
    [
        view(DVec3::new(0.9, 1.4, 3.0), DVec3::new(0.1, 0.0, 0.0), 40.0, 1e-3, pixels),
        view(DVec3::new(1.2, 0.45, 0.3), DVec3::new(0.2, 0.1, -1.0), 70.0, 1e-3, pixels),
    ]
}

/// A mesh in waves, everything in world units `scale` times as large.
fn in_waves(mesh: &Mesh, scale: f64, view: View) -> Result<Arc<Scene>> {
    let options = ShellOptions { uv_scale: DVec2::new(3.0, 2.0), ..ShellOptions::new(scale * THICKNESS) };
    let shell = Shell::build(mesh, &options)?;
    let medium = Medium { opacity_distance: 0.2 * scale, lod_footprint: 1.0 };
    Ok(Arc::new(Scene {
        shell: Arc::new(shell),
        volume: Arc::new(waves()),
        medium,
        shading: None,
        solids: Arc::default(),
        view,
        march: March::default(),
        traversal: Traversal::default(),
        end_below: END_BELOW,
        skips: Skips::default(),
    }))
}

/// The largest difference between two pictures of a scene; infinite where there is next to nothing in them to differ.
fn difference(a: &Image, b: &Image) -> Result<f64> {
    let covered = |image: &Image| image.rgba.iter().filter(|pixel| pixel[3] > 0.01).count();
    let is_seen = [a, b].iter().all(|image| 20 * covered(image) > image.rgba.len());
    Ok(if is_seen { metric::compare(a, b)?.max } else { f64::INFINITY })
}

/// The mesh and the eye with every position replaced.
fn placed(mesh: &Mesh, view: View, place: impl Fn(DVec3) -> DVec3) -> (Mesh, View) {
    let mut mesh = mesh.clone();
    mesh.positions.iter_mut().for_each(|position| *position = place(*position));
    let mut view = view;
    view.camera.eye = place(view.camera.eye);
    view.camera.target = place(view.camera.target);
    (mesh, view)
}

const OFFSETS: [DVec3; 2] = [DVec3::splat(1e6), DVec3::new(148_376.0, 1_234.0, -223_423.0)];

/// The largest difference between what `picture` makes of a scene in its place and of the scene at each of the offsets.
fn difference_when_moved(stand: &Stand<'_>, picture: impl Fn(&Arc<Scene>) -> Result<Image>) -> Result<f64> {
    let mut worst = 0.0f64;
    for view in views(stand) {
        let mesh = torus()?;
        let here = picture(&in_waves(&mesh, 1.0, view)?)?;
        for offset in OFFSETS {
            let (mesh, view) = placed(&mesh, view, |position| position + offset);
            worst = worst.max(difference(&here, &picture(&in_waves(&mesh, 1.0, view)?)?)?);
        }
    }
    Ok(worst)
}

fn offset(stand: &Stand<'_>) -> Result<f64> {
    difference_when_moved(stand, |scene| Ok(stand.frame(scene)?.image))
}

fn offset_input(stand: &Stand<'_>) -> Result<f64> {
    let Stand { setup, .. } = stand;
    difference_when_moved(stand, |scene| {
        Ok(reference::render(scene, &scene.view, setup.progress.as_ref(), setup.interrupt)?.image)
    })
}

fn offset_lost(stand: &Stand<'_>) -> Result<f64> {
    let (mut lost, mut rays) = (0, 0);
    for view in views(stand) {
        for offset in OFFSETS {
            let (mesh, view) = placed(&torus()?, view, |position| position + offset);
            let scene = Arc::new(constant_scene(&mesh, THICKNESS, 0.5, 1.0, view)?);
            let found = transmittance(&scene, &view, &alpha(&stand.frame(&scene)?.image));
            lost += found.missed.max(found.miscounted);
            rays += found.errors.len();
        }
    }
    Ok(lost as f64 / rays as f64)
}

fn scale(stand: &Stand<'_>) -> Result<f64> {
    let mut worst = 0.0f64;
    for view in views(stand) {
        let mesh = torus()?;
        let here = stand.frame(&in_waves(&mesh, 1.0, view)?)?.image;
        for scale in [1e-6, 1e6] {
            let (mesh, mut view) = placed(&mesh, view, |position| scale * position);
            view.camera.near *= scale;
            let there = stand.frame(&in_waves(&mesh, scale, view)?)?.image;
            worst = worst.max(difference(&here, &there)?);
        }
    }
    Ok(worst)
}

/// The bound: in a constant medium a tetrahedron has one sample, in its middle; over a length `l` of optical depth `d` light is
/// stopped `l d / 12` before it on average. With an alpha of 1e-3 over 0.2, edges of at most 0.6, and an eye 1.8 away:
/// 0.6 * 3e-3 / 12 / 1.8 = 8.3e-5; some 32 roundings besides.
const SCALE_DEPTH: f64 = 8.3e-5 + 32.0 * ROUNDING;

/// [`Frame::depth`](crate::frame::Frame::depth) against the reference's, where more than a rounding of light is stopped.
fn scale_depth(stand: &Stand<'_>) -> Result<f64> {
    let mut worst = 0.0f64;
    for scale in [1e-6, 1.0, 1e6] {
        let [view, _] = views(stand);
        let (mesh, mut view) = placed(&torus()?, view, |position| scale * position);
        view.camera.near *= scale;
        view.depth = true;
        let scene = Arc::new(constant_scene(&mesh, scale * THICKNESS, 1e-3, 1.0, view)?);
        let there = stand.frame(&scene)?;
        let exact = reference::render(&scene, &view, stand.setup.progress.as_ref(), stand.setup.interrupt)?;
        let seen = exact.image.rgba.iter().zip(&there.image.rgba).map(|(a, b)| a[3].min(b[3]) > 1e-5);
        let [depths, exact] = [there.depth, exact.depth].map(Option::unwrap_or_default);
        let mut compared = 0;
        for ((depth, exact), _) in depths.iter().zip(&exact).zip(seen).filter(|(_, seen)| *seen) {
            compared += 1;
            let error = (f64::from(*depth) / f64::from(*exact) - 1.0).abs();
            worst = if error.is_nan() { f64::INFINITY } else { worst.max(error) };
        }
        if 20 * compared < depths.len() || depths.is_empty() {
            return Ok(f64::INFINITY);
        }
    }
    Ok(worst)
}

fn mirror(stand: &Stand<'_>) -> Result<f64> {
    let across = |v: DVec3| DVec3::new(-v.x, v.y, v.z);
    let mut worst = 0.0f64;
    for view in views(stand) {
        let here = stand.frame(&in_waves(&torus()?, 1.0, view)?)?.image;
        let (mut mesh, mut view) = placed(&torus()?, view, across);
        view.camera.up = across(view.camera.up);
        mesh.normals.iter_mut().for_each(|normal| *normal = across(*normal));
        mesh.triangles.iter_mut().for_each(|ids| ids.swap(1, 2));
        mesh.uvs.iter_mut().for_each(|uvs| uvs.swap(1, 2));
        let mut there = stand.frame(&in_waves(&mesh, 1.0, view)?)?.image;
        there.rgba.chunks_mut(view.width as usize).for_each(<[_]>::reverse);
        worst = worst.max(difference(&here, &there)?);
    }
    Ok(worst)
}

fn triangle_order(stand: &Stand<'_>) -> Result<f64> {
    let mut random = Pcg64::seed_from_u64(7);
    let mut worst = 0.0f64;
    for view in views(stand) {
        let mesh = torus()?;
        let here = stand.frame(&in_waves(&mesh, 1.0, view)?)?.image;
        let mut order: Vec<usize> = (0..mesh.triangles.len()).collect();
        order.shuffle(&mut random);
        let shuffled = Mesh {
            triangles: order.iter().map(|&i| mesh.triangles[i]).collect(),
            uvs: order.iter().map(|&i| mesh.uvs[i]).collect(),
            ..mesh
        };
        let there = stand.frame(&in_waves(&shuffled, 1.0, view)?)?.image;
        worst = worst.max(difference(&here, &there)?);
    }
    Ok(worst)
}

/// In a constant medium, since the map from the shell to the texture is that of the tetrahedra.
fn vertex_order(stand: &Stand<'_>) -> Result<f64> {
    let mut random = Pcg64::seed_from_u64(8);
    let mut worst = 0.0f64;
    for view in views(stand) {
        let mesh = torus()?;
        let mut renamed: Vec<u32> = (0..mesh.positions.len() as u32).collect();
        renamed.shuffle(&mut random);
        let mut there = mesh.clone();
        for (id, &to) in renamed.iter().enumerate() {
            there.positions[to as usize] = mesh.positions[id];
            there.normals[to as usize] = mesh.normals[id];
        }
        for ids in &mut there.triangles {
            *ids = ids.map(|id| renamed[id as usize]);
        }
        let [here, there] = [&mesh, &there].map(|mesh| constant_scene(mesh, THICKNESS, 0.5, 0.8, view));
        worst = worst.max(excess(&here?, &view, &stand.frame(&Arc::new(there?))?.image));
    }
    Ok(worst)
}

/// A flat plate in waves, as 2 x 2 squares, with the other diagonals, and as 7 x 7 squares.
///
/// The bound: other tetrahedra begin and end their samples elsewhere, so what is compared is the quadrature. It is midpoint's:
/// the error over an optical depth of 1 is h^2 / 24 times the second derivative of the integrand over the path, in texels.
/// Waves of eight texels have one of (TAU / 8)^2 times an amplitude of 1/2, and linear filtering concentrates it in kinks: 0.31
/// in all a texel of path. With h = 1/32 texel and 10 texels of path that is 10 * 0.31 / 24 / 1024 = 1.3e-4; each of
/// the two pictures may have as much.
const TILINGS: f64 = 2.0 * 1.3e-4;

fn tilings(stand: &Stand<'_>) -> Result<f64> {
    let plane = |segments| Generator::Plane(Plane { size: 2.0, segments }).build();
    let mut turned = plane(2)?;
    // Two triangles a square, (a, b, c) and (a, c, d).
    for (triangles, uvs) in turned.triangles.chunks_exact_mut(2).zip(turned.uvs.chunks_exact_mut(2)) {
        let [[a, b, c], [.., d]] = [triangles[0], triangles[1]];
        let [[ua, ub, uc], [.., ud]] = [uvs[0], uvs[1]];
        triangles.copy_from_slice(&[[a, b, d], [b, c, d]]);
        uvs.copy_from_slice(&[[ua, ub, ud], [ub, uc, ud]]);
    }
    let view = view(DVec3::new(0.4, 2.0, 1.7), DVec3::ZERO, 45.0, 1e-3, stand.either(96, 256));
    let picture = |mesh: &Mesh| -> Result<Image> {
        let mut scene = Scene::clone(&*in_waves(mesh, 1.0, view)?);
        scene.march = March::Default { step: 1.0 / 32.0 };
        // The level of detail goes with the tetrahedron.
        scene.medium.lod_footprint = 0.0;
        Ok(stand.frame(&Arc::new(scene))?.image)
    };
    let whole = picture(&plane(2)?)?;
    let mut worst = 0.0f64;
    for mesh in [turned, plane(7)?] {
        worst = worst.max(difference(&whole, &picture(&mesh)?)?);
    }
    Ok(worst)
}
