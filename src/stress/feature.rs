//! Rays and eyes exactly where a decision is hardest: through vertices, along edges and faces, on them, inside, and where
//! parts of a tetrahedron lie before the near plane or behind the eye. All in a constant medium, whose path length is exact.

use std::sync::Arc;

use glam::DVec3;

use super::compare::transmittance;
use super::scenes::{constant_scene, view};
use super::{Case, Stand, alpha};
use crate::Result;
use crate::mesh::generate::{Generator, Plane, Sphere};
use crate::scene::{Scene, View};

/// See [`excess`](super::compare::excess): 1 is all that f32 explains.
const EXCESS: &str = "error / what f32 explains";

pub(super) const CASES: &[Case] = &[
    Case { name: "rays-through-features", measure: EXCESS, bound: 1.0, worst: rays_through_features },
    // Neighbours read a shared face from the same plane, bit for bit, so no ray can pass between or be in both.
    Case {
        name: "rays-through-features-lost",
        measure: "rays lost or counted twice",
        bound: 0.0,
        worst: rays_through_features_lost,
    },
    Case { name: "grazing", measure: EXCESS, bound: 1.0, worst: grazing },
    Case { name: "eye-on-feature", measure: EXCESS, bound: 1.0, worst: eye_on_feature },
    Case { name: "near-plane", measure: EXCESS, bound: 1.0, worst: near_plane },
    Case { name: "behind-eye", measure: EXCESS, bound: 1.0, worst: behind_eye },
];

/// A plate, 2 x 2 wide and 0.25 high, of `segments` squares a side.
fn plate(segments: u32, view: View) -> Result<Arc<Scene>> {
    let mesh = Generator::Plane(Plane { size: 2.0, segments }).build()?;
    Ok(Arc::new(constant_scene(&mesh, 0.25, 0.4, 0.8, view)?))
}

/// A pixel is 1/32 wide at depth 1, and there is one in the middle: seen from straight above the middle, at a height of 2, its
/// rays meet the vertices of a lattice of 1/16, and the walls of prisms lie along rays.
fn lattice_views(stand: &Stand<'_>) -> Vec<View> {
    let pixels: u32 = stand.either(65, 257);
    let fov = 2.0 * (f64::from(pixels) / 64.0).atan().to_degrees();
    let eyes = [DVec3::new(0.0, 2.0, 0.0), DVec3::new(0.25, 2.0, -0.5), DVec3::new(0.0, 2.25, 0.25)];
    eyes.iter().map(|&eye| view(eye, eye - DVec3::Y, fov, 1e-3, pixels)).collect()
}

fn rays_through_features(stand: &Stand<'_>) -> Result<f64> {
    let views = lattice_views(stand);
    stand.excess(&plate(stand.either(8, 32), views[0])?, &views)
}

fn rays_through_features_lost(stand: &Stand<'_>) -> Result<f64> {
    let views = lattice_views(stand);
    let scene = plate(stand.either(8, 32), views[0])?;
    let mut method = stand.prepare(&scene)?;
    let mut lost = 0;
    for view in &views {
        let found = transmittance(&scene, view, &alpha(&method.render(view)?.image));
        lost += found.missed.max(found.miscounted);
    }
    Ok(lost as f64)
}

/// The eye in the plane of the outer faces, then 1e-8 radians off it on both sides, and 1e-6 on one, so that rays run along faces
/// over the whole plate; the same for the walls of prisms.
fn grazing(stand: &Stand<'_>) -> Result<f64> {
    let pixels = stand.either(96, 384);
    let mut views = Vec::new();
    for off in [0.0, 1e-8, -1e-8, 1e-6] {
        let eye = DVec3::new(0.1, 0.25 + 3.0 * off, 3.0);
        views.push(view(eye, eye - DVec3::Z, 30.0, 1e-3, pixels));
        let eye = DVec3::new(0.25 + 3.0 * off, 1.0, 3.0);
        views.push(view(eye, DVec3::new(eye.x, 0.0, 0.0), 30.0, 1e-3, pixels));
    }
    stand.excess(&plate(8, views[0])?, &views)
}

/// The eye on vertices, edges, faces of a ball's shell, inner, outer and in between, and inside a tetrahedron.
fn eye_on_feature(stand: &Stand<'_>) -> Result<f64> {
    let pixels = stand.either(64, 256);
    let mesh = Generator::Sphere(Sphere { radius: 1.0, segments: 12, rings: 6 }).build()?;
    let any = view(DVec3::Z, DVec3::ZERO, 60.0, 1e-3, pixels);
    let scene = Arc::new(constant_scene(&mesh, 0.25, 0.4, 0.8, any)?);
    let mut views = Vec::new();
    for t in (0..scene.shell.topology.tetrahedra.len()).step_by(stand.either(43, 7)) {
        let [a, b, c, d] = scene.shell.vertices_of(t);
        let eyes = [a, d, 0.5 * (a + d), 0.25 * b + 0.75 * c, (a + b + c) / 3.0, 0.25 * (a + b + c + d)];
        // Along an edge of the tetrahedron, then across.
        views.extend(eyes.map(|eye| view(eye, eye + (b - a), 80.0, 1e-3, pixels)));
        views.push(view(a, d, 80.0, 1e-3, pixels));
    }
    stand.excess(&scene, &views)
}

/// The near plane through vertices, edges and the middle of tetrahedra.
fn near_plane(stand: &Stand<'_>) -> Result<f64> {
    let pixels = stand.either(96, 384);
    let eye = DVec3::new(0.3, 2.25, 0.2);
    let mut views = Vec::new();
    // 2 and 2.25 are the depths of the two surfaces.
    for near in [1.9, 2.0, 2.1, 2.25 - 1e-9] {
        views.push(view(eye, eye - DVec3::Y, 50.0, near, pixels));
        let aside = DVec3::new(0.5, 1.6, 2.0);
        views.push(view(aside, DVec3::ZERO, 50.0, near, pixels));
    }
    stand.excess(&plate(4, views[0])?, &views)
}

/// Two huge prisms around the eye: of every tetrahedron some vertices lie before it, some behind, some exactly beside.
fn behind_eye(stand: &Stand<'_>) -> Result<f64> {
    let pixels = stand.either(96, 384);
    let mut views = Vec::new();
    for height in [0.125, 0.25, 0.5] {
        for eye in [DVec3::new(0.1, height, 0.2), DVec3::new(-0.9, height, 1.0)] {
            for towards in [DVec3::X, DVec3::NEG_Z, DVec3::new(-0.6, -0.3, 0.5)] {
                views.push(view(eye, eye + towards, 90.0, 1e-4, pixels));
            }
        }
    }
    stand.excess(&plate(1, views[0])?, &views)
}
