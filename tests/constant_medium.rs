//! In a constant medium the picture is the path length: every pixel against the exact length through the shell.
//!
//! The bounds: in f32, the length carries some ten roundings and alpha another few, so the median error is below
//! 1e-6 (16 * 2^-24). More than that is left only where the ray grazes the outside of the shell: there the rounded plane of the face
//! moves the point of entry by its rounding over the sine of the angle. The second test shows that all of it amounts to moving
//! the ray by less than 1/4096 pixel, where a rasteriser's snapping of vertices alone would move it by 1/512.

mod common;

use std::sync::Arc;

use common::Watched;
use glam::{DVec2, DVec3};
use mesoshell::mesh::generate::{Generator, Torus};
use mesoshell::reference::Reference;
use mesoshell::stress::compare::{AROUND, Transmittance, centre, extinction, transmittance};
use mesoshell::stress::scenes::{constant_scene, view};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;

const ALPHA: f32 = 0.5;

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
    let scene = Arc::new(constant_scene(&torus, thickness, ALPHA, 1.0, any).unwrap());
    let mut method = Watched::prepare("shell", &scene);
    let mut all = Transmittance::default();
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
        let mut one = transmittance(&scene, &view, &alpha);
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
            assert_eq!(transmittance(&scene, &view, &hole).missed, one.missed + 1);
            let mut twice = alpha;
            twice[hit] = 1.0 - (1.0 - twice[hit]).powi(2);
            let worst = transmittance(&scene, &view, &twice).errors.into_iter().fold(0.0, f64::max);
            assert!(worst > 2e-3, "counted twice, yet off by no more than {worst:e}");
        }
    }
    assert_eq!(all.errors.len(), 20 * 512 * 512);
    all.errors.sort_by(f64::total_cmp);
    // Both percentiles are over the pixels that see the medium.
    let seen: Vec<f64> = all.errors.iter().copied().filter(|error| *error > 0.0).collect();
    let median = seen[seen.len() / 2];
    let p9999 = seen[seen.len() * 9_999 / 10_000];
    let max = all.errors[all.errors.len() - 1];
    println!("{} pixels see the medium; median {median:.2e}, 99.99 % {p9999:.2e}, max {max:.2e}", seen.len());
    assert!(seen.len() > 1_000_000, "only {} pixels compared", seen.len());
    assert!(median <= 1e-6 && p9999 <= 1e-4 && max <= 2e-3);
    assert_eq!(all.missed, 0);
}

/// Eight roundings of 2^-24 each in ray and plane turn one against the other by 5e-7 radians; a pixel of these
/// views is at least 1.4e-3 radians wide, so that is 3.4e-4 of it at most, or 1.4/4096. Rounding being random, half as much is
/// expected; twice the change of transmittance over 1/4096 pixel covers kinks of the length within that distance.
const SHIFT_PIXELS: f64 = 1.0 / 4096.0;

#[test]
fn what_is_left_is_rounding_not_snapping() {
    let torus = Generator::Torus(Torus { segments: 90, rings: 48, ..Torus::default() }).build().unwrap();
    let views = [
        view(DVec3::new(0.3, 1.1, 3.2), DVec3::ZERO, 40.0, 1e-3, 512),
        view(DVec3::new(1.3, 0.3, 0.35), DVec3::new(0.5, 0.2, -1.0), 80.0, 1e-3, 512),
    ];
    let scene = Arc::new(constant_scene(&torus, 0.15, ALPHA, 1.0, views[0]).unwrap());
    let mut method = Watched::prepare("shell", &scene);
    let per_length = extinction(&scene);
    for view in views {
        let frame = method.render(&view);
        let reference = Reference::new(&scene, &view);
        let clear = |point: DVec2| (-per_length * reference.path_length(point)).exp();
        let unexplained = |alpha_of: &(dyn Fn(usize) -> f64 + Sync)| {
            let pixels = frame.image.rgba.len();
            (0..pixels)
                .into_par_iter()
                .filter(|&i| {
                    let centre = centre(&view, i);
                    let exact = clear(centre);
                    let error = (exact - (1.0 - alpha_of(i))).abs();
                    if error <= 2e-6 {
                        return false;
                    }
                    let change = AROUND
                        .map(|direction| (clear(centre + SHIFT_PIXELS * direction) - exact).abs())
                        .into_iter()
                        .fold(0.0, f64::max);
                    error > 2e-6 + 2.0 * change
                })
                .count()
        };
        let alpha = |i: usize| f64::from(frame.image.rgba[i][3]);
        assert_eq!(unexplained(&alpha), 0);
        // A single pixel that is off by what snapping would do to it is found.
        let middle = 256 * 512 + 140;
        let snapped = |i: usize| {
            let error = if i == middle { 1e-3 } else { 0.0 };
            alpha(i) + error
        };
        assert_eq!(unexplained(&snapped), 1);
    }
}
