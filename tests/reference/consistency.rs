//! What must not change the picture, and what the tolerance promises.

use glam::DVec3;
use mesoshell::mesh::Mesh;
use mesoshell::mesh::generate::{Generator, Torus};
use mesoshell::progress::{Interrupt, Progress, Silent};
use mesoshell::reference::{Reference, TOLERANCE, render};
use mesoshell::scene::{Medium, View};
use mesoshell::shell::{Shell, ShellOptions};
use mesoshell::volume::Pyramid;
use mesoshell::{Error, frame::Frame};

use super::{
    bright_noise, error, flat_shell, grey, layers, level_zero, noise, rays, scene, slanted_view, torus_shell,
    view,
};

#[test]
fn tolerances_are_kept_on_noise_with_opaque_texels() {
    let view = view(DVec3::new(0.5, 2.0, 2.2), DVec3::new(0.4, 0.0, 0.3), 24);
    let mut scene = scene(torus_shell(), Pyramid::build(noise([9, 7, 5], 1.0)), view);
    for (footprint, gain) in [(0.0, 1.0), (1.0, 1.0), (0.5, 50.0)] {
        scene.volume = Pyramid::build(bright_noise([9, 7, 5], 1.0, gain)).into();
        scene.medium.lod_footprint = footprint;
        let at = |tolerance| {
            let reference = Reference::new(&scene, &view).with_tolerance(tolerance);
            rays(&view).into_iter().map(|(point, _)| reference.integrate_ray(point)).collect::<Vec<_>>()
        };
        let exact = at(1e-12);
        let covered = exact.iter().filter(|sample| sample.rgba[3] > 0.1).count();
        assert!(covered > 200, "{covered}");
        for tolerance in [1e-4, 1e-6, TOLERANCE, 1e-11] {
            let worst =
                at(tolerance).iter().zip(&exact).map(|(a, b)| error(&a.rgba, &b.rgba)).fold(0.0, f64::max);
            assert!(worst <= tolerance, "{worst:e} at {tolerance:e}");
        }
        // Another medium, by a ten-millionth, is told apart.
        let mut other = scene.clone();
        other.medium.opacity_distance *= 1.0 + 1e-7;
        let other = Reference::new(&other, &view);
        let pixels = rays(&view).into_iter().zip(&exact);
        let differences = pixels.map(|((point, _), b)| error(&other.integrate_ray(point).rgba, &b.rgba));
        assert!(differences.fold(0.0, f64::max) > 10.0 * TOLERANCE);
    }
}

fn moved(mesh: &Mesh, scale: f64, offset: DVec3) -> Mesh {
    let mut mesh = mesh.clone();
    mesh.positions.iter_mut().for_each(|p| *p = *p * scale + offset);
    mesh
}

#[test]
fn place_and_scale_do_not_matter() {
    let mesh = Generator::Torus(Torus { segments: 16, rings: 8, ..Torus::default() }).build().unwrap();
    let volume = Pyramid::build(noise([8, 8, 4], 0.9));
    let picture = |scale: f64, offset: DVec3| {
        let shell = Shell::build(&moved(&mesh, scale, offset), &ShellOptions::new(0.2 * scale)).unwrap();
        let eye = DVec3::new(0.5, 2.0, 2.2) * scale + offset;
        let mut view = view(eye, DVec3::new(0.5, 0.0, 0.25) * scale + offset, 12);
        view.camera.near *= scale;
        let mut scene = scene(shell, volume.clone(), view);
        scene.medium = Medium { opacity_distance: 0.05 * scale, lod_footprint: 1.0 };
        let reference = Reference::new(&scene, &view);
        rays(&view).into_iter().map(|(point, _)| reference.integrate_ray(point).rgba).collect::<Vec<_>>()
    };
    let worst =
        |a: &[[f64; 4]], b: &[[f64; 4]]| a.iter().zip(b).map(|(a, b)| error(a, b)).fold(0.0, f64::max);
    let plain = picture(1.0, DVec3::ZERO);
    for scale in [1e-6, 1e6] {
        assert!(worst(&plain, &picture(scale, DVec3::ZERO)) < 2.0 * TOLERANCE);
    }
    // At 1e6 a coordinate is rounded by 6e-11; the sine of a grazing face, the slope of the
    // texture (4 texels on a thickness of 0.2, extinction up to 2.3 / 0.05 a unit) and the eye's own three
    // coordinates enlarge that by some hundreds.
    let far = DVec3::new(1e6, -1e6, 1e6);
    let shift = worst(&plain, &picture(1.0, far));
    assert!(shift < 6e-8, "{shift:e}");
    assert!(worst(&plain, &picture(1.0 + 1e-6, far)) > 0.0);
}

/// Hears whether the run was told of to its end.
#[derive(Default)]
struct Last(std::sync::Mutex<f64>);

impl Progress for Last {
    fn stage(&self, _name: &str) {
        *self.0.lock().unwrap() = 0.0;
    }
    fn fraction(&self, done: f64) {
        let mut last = self.0.lock().unwrap();
        *last = last.max(done);
    }
}

#[test]
fn threads_do_not_matter_and_the_frame_is_what_pixels_say() {
    let view = View { width: 16, ..view(DVec3::new(0.5, 2.0, 2.2), DVec3::new(0.5, 0.0, 0.3), 12) };
    let scene = scene(torus_shell(), Pyramid::build(noise([8, 8, 4], 1.0)), view);
    let last = Last::default();
    let on = |threads| -> Frame {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| render(&scene, &view, &last, &Interrupt::default())).unwrap()
    };
    let (one, three) = (on(1), on(3));
    assert_eq!(*last.0.lock().unwrap(), 1.0);
    let bits = |frame: &Frame| frame.image.rgba.iter().flatten().map(|c| c.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&one), bits(&three));
    assert_eq!(one.depth, three.depth);
    assert_eq!(one.report.counts, three.report.counts);
    let reference = Reference::new(&scene, &view);
    for y in 0..view.height {
        for x in 0..view.width {
            let index = (y * view.width + x) as usize;
            assert_eq!(one.image.rgba[index], reference.pixel(x, y).rgba.map(|c| c as f32));
        }
    }
    let covered = one.image.rgba.iter().filter(|pixel| pixel[3] > 0.0).count() as u64;
    assert_eq!(one.report.counts["pixels_covered"], covered);
    assert!(covered > 50 && covered < 192);
}

#[test]
fn an_interrupt_is_heard() {
    let view = slanted_view();
    let scene = scene(flat_shell(), level_zero(layers(&[grey(0.5)])), view);
    let interrupt = Interrupt::default();
    interrupt.set();
    assert!(matches!(render(&scene, &view, &Silent, &interrupt), Err(Error::Interrupted)));
}
