//! In a constant medium the picture is the path length: every pixel against the exact length through the shell.
//!
//! The bounds: in f32, the length carries some ten roundings and alpha another few, so the median error is below
//! 1e-6 (16 * 2^-24). What is above that comes from the rasteriser, which snaps vertices to 1/256 pixel: a pixel's
//! fragment lies on a triangle that is off by up to 1/512 pixel, so its length is off by as much as the length changes over
//! that distance. At a silhouette the length grows like a square root or faster, which makes the tail.

mod common;

use std::sync::Arc;

use common::{Watched, constant_scene, view};
use glam::{DVec2, DVec3};
use mesoshell::mesh::generate::{Generator, Sphere, Torus};
use mesoshell::reference::Reference;
use mesoshell::scene::{Scene, View};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;

const ALPHA: f32 = 0.5;

/// What one picture showed.
#[derive(Debug, Default)]
struct Errors {
    /// Of transmittance, all pixels.
    errors: Vec<f64>,
    /// Pixels whose ray passes more than a rounding of medium, but which stayed clear, or the other way round.
    missed: usize,
}

fn compare(scene: &Scene, view: &View, alpha: &[f64]) -> Errors {
    let reference = Reference::new(scene, view);
    let per_length = -f64::from(1.0 - ALPHA).ln() / scene.medium.opacity_distance;
    let exact: Vec<f64> = (0..alpha.len())
        .into_par_iter()
        .map(|i| {
            let (x, y) = (i % view.width as usize, i / view.width as usize);
            let length = reference.path_length(DVec2::new(x as f64 + 0.5, y as f64 + 0.5));
            (-per_length * length).exp()
        })
        .collect();
    let errors = exact.iter().zip(alpha).map(|(exact, alpha)| (exact - (1.0 - alpha)).abs()).collect();
    // A pixel is missed, or covered for nothing, when its error is that of its whole opacity, and that opacity is more than
    // snapping explains (the bound on the maximum).
    let missed = exact
        .iter()
        .zip(alpha)
        .filter(|(exact, alpha)| {
            (**alpha == 0.0 && **exact < 1.0 - 2e-3) || (**alpha > 2e-3 && **exact == 1.0)
        })
        .count();
    Errors { errors, missed }
}

#[test]
fn transmittance_is_that_of_the_exact_path_length() {
    let torus = Generator::Torus(Torus { segments: 90, rings: 48, ..Torus::default() }).build().unwrap();
    assert_eq!(torus.triangles.len(), 8_640, "25,920 tetrahedra, as in the paper's largest scenes");
    let thickness = 0.15;
    let mut random = Pcg64::seed_from_u64(20);
    let mut unit = || {
        let mut component = || random.random_range(-1.0..1.0);
        loop {
            let point = DVec3::new(component(), component(), component());
            if (0.01..1.0).contains(&point.length()) {
                return point.normalize();
            }
        }
    };
    let any = view(DVec3::new(0.0, 0.0, 4.0), DVec3::ZERO, 40.0, 1e-3, 512);
    let scene = Arc::new(constant_scene(&torus, thickness, ALPHA, 1.0, any));
    let mut method = Watched::prepare("shell", &scene);
    let mut all = Errors::default();
    for index in 0..20 {
        let direction = unit();
        let view = if index % 3 == 2 {
            // Inside the shell: half the thickness above the surface of the tube.
            let around = DVec3::new(direction.x, 0.0, direction.z).normalize();
            let outward = (around * direction.y + DVec3::Y * direction.x).normalize();
            let eye = around + outward * (0.4 + 0.5 * thickness);
            view(eye, eye + unit(), 80.0, 1e-3, 512)
        } else {
            view(3.5 * direction, 0.2 * unit(), 40.0, 1e-3, 512)
        };
        let frame = method.render(&view);
        let alpha: Vec<f64> = frame.image.rgba.iter().map(|pixel| f64::from(pixel[3])).collect();
        let mut one = compare(&scene, &view, &alpha);
        let worst = one.errors.iter().copied().fold(0.0, f64::max);
        println!("view {index}: max {worst:.2e}, missed {}", one.missed);
        all.missed += one.missed;
        all.errors.append(&mut one.errors);

        if index == 0 {
            // The comparator sees what it should: a pixel left out, a pixel counted twice.
            let half = |alpha: f64| (alpha - 0.5).abs();
            let (hit, _) = alpha.iter().enumerate().min_by(|a, b| half(*a.1).total_cmp(&half(*b.1))).unwrap();
            let mut hole = alpha.clone();
            hole[hit] = 0.0;
            assert_eq!(compare(&scene, &view, &hole).missed, one.missed + 1);
            let mut twice = alpha;
            twice[hit] = 1.0 - (1.0 - twice[hit]).powi(2);
            let worst = compare(&scene, &view, &twice).errors.into_iter().fold(0.0, f64::max);
            assert!(worst > 2e-3, "counted twice, yet off by no more than {worst:e}");
        }
    }
    assert_eq!(all.errors.len(), 20 * 512 * 512);
    all.errors.sort_by(f64::total_cmp);
    // The median is over the pixels that see the medium.
    let seen: Vec<f64> = all.errors.iter().copied().filter(|error| *error > 0.0).collect();
    let median = seen[seen.len() / 2];
    let p9999 = all.errors[all.errors.len() * 9_999 / 10_000];
    let max = all.errors[all.errors.len() - 1];
    println!("{} pixels see the medium; median {median:.2e}, 99.99 % {p9999:.2e}, max {max:.2e}", seen.len());
    assert!(seen.len() > 1_000_000, "only {} pixels compared", seen.len());
    assert!(median <= 1e-6 && p9999 <= 1e-4 && max <= 2e-3);
    assert_eq!(all.missed, 0);
}

#[test]
fn what_is_left_is_the_rasterisers_snapping() {
    // Seen at twice the resolution, vertices snap to half the distance: errors above rounding halve. The same rays are
    // compared: pixel centres of the coarse picture fall on corners of the fine one, so compare the tails, not pixels.
    let sphere = Generator::Sphere(Sphere { segments: 96, rings: 48, ..Sphere::default() }).build().unwrap();
    let tail = |pixels: u32| {
        let view = view(DVec3::new(0.3, 1.1, 3.2), DVec3::ZERO, 40.0, 1e-3, pixels);
        let scene = Arc::new(constant_scene(&sphere, 0.15, ALPHA, 1.0, view));
        let frame = Watched::prepare("shell", &scene).render(&view);
        let alpha: Vec<f64> = frame.image.rgba.iter().map(|pixel| f64::from(pixel[3])).collect();
        let mut errors = compare(&scene, &view, &alpha).errors;
        errors.sort_by(f64::total_cmp);
        for p in [0.5, 0.9, 0.99, 0.999, 0.9999, 0.99999, 0.999999] {
            println!("{pixels} {p} {:.2e}", errors[(errors.len() as f64 * p) as usize]);
        }
        errors[errors.len() * 999 / 1000]
    };
    let (coarse, fine) = (tail(256), tail(1024));
    println!("99.9 % at 256: {coarse:.2e}, at 1024: {fine:.2e}");
    assert!(fine < 0.5 * coarse, "four times the resolution must divide the tail by about four");
}
