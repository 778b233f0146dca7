//! The `shell` method against the reference on the three scenes of the demo, at the default quality and at finer steps.

mod common;

use std::path::Path;
use std::sync::Arc;

use common::Watched;
use glam::{DVec2, DVec3};
use mesoshell::bench::convergence;
use mesoshell::mesh::generate::{Generator, Plane, Torus};
use mesoshell::metric::{self, Metrics};
use mesoshell::progress::Silent;
use mesoshell::scene::{self, March, Scene};
use mesoshell::shell::{Shell, ShellOptions};
use mesoshell::volume::{Pyramid, Quantity, Volume};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

fn load(name: &str, overrides: &[&str]) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name).with_extension("toml");
    let overrides: Vec<String> = overrides.iter().map(|text| (*text).to_owned()).collect();
    scene::load(&path, &overrides, &Silent).unwrap_or_else(|error| panic!("{error:?}")).scene
}

fn compare(scene: &Scene, steps: &[f64]) -> Vec<Metrics> {
    let view = scene.view;
    let reference = Watched::prepare("reference", &Arc::new(scene.clone())).render(&view).image;
    let error = |step: &f64| {
        let scene = Arc::new(Scene { march: March::Default { step: *step }, ..scene.clone() });
        metric::compare(&Watched::prepare("shell", &scene).render(&view).image, &reference).unwrap()
    };
    steps.iter().map(error).collect()
}

/// At 512 x 512 and the default step.
fn default_quality(name: &str) {
    let scene = load(name, &[]);
    assert_eq!((scene.view.width, scene.view.height), (512, 512));
    let March::Default { step } = scene.march else { panic!("{name} has another plan") };
    assert_eq!(scene.march, March::default(), "{name} sets its own quality");
    let metrics = compare(&scene, &[step])[0];
    println!("{name}: {metrics:?}");
    assert_eq!(metrics.pixels, 512 * 512);
    assert!(metrics.rmse <= 1e-3 && metrics.p999 <= 1e-2, "{name}: {metrics:?}");
}

/// Halving the step at least halves the error, until 2e-4.
fn converges(name: &str) {
    let scene = load(name, &["image.size=[192, 192]", "march.end_below=0"]);
    let steps = [2.0, 1.0, 0.5, 0.25, 0.125];
    let errors: Vec<f64> = compare(&scene, &steps).iter().map(|metrics| metrics.rmse).collect();
    println!("{name}: {errors:?}");
    for pair in errors.windows(2) {
        assert!(pair[1] <= 2e-4 || pair[1] <= 0.5 * pair[0], "{name}: {errors:?}");
    }
    assert!(errors[steps.len() - 1] <= 2e-4, "{name}: {errors:?}");
}

#[test]
fn fur_sphere() {
    default_quality("fur-sphere");
    converges("fur-sphere");
}

#[test]
fn fog_torus() {
    default_quality("fog-torus");
    converges("fog-torus");
}

#[test]
fn weave_teapot() {
    default_quality("weave-teapot");
    converges("weave-teapot");
}

/// In a smooth medium the error falls with the square of the step, as a midpoint rule's must.
///
/// One wave of opacity along w in 256 texels: at steps of many texels the kinks of its linear reconstruction do not show. Two
/// triangles, so that segments are long: a ray's 256 texels lie in three or so tetrahedra. A segment of `L` texels is cut into
/// `ceil(L / step)` steps; at a step of 16 and `L = 85` the true step is shorter by half of `16 / 85` in the mean, which takes
/// `2 log2(1.09) / 3 = 0.08` off the slope over three octaves.
#[test]
fn the_order_of_convergence_is_two_where_the_volume_is_smooth() {
    let texels = (0..256).map(|i| {
        let (sin, cos) = ((f64::from(i) + 0.5) / 256.0 * std::f64::consts::TAU).sin_cos();
        let (alpha, red) = ((0.008 + 0.006 * cos) as f32, (0.5 + 0.4 * sin) as f32);
        [red * alpha, 0.5 * alpha, (1.0 - red) * alpha, alpha]
    });
    let volume = Pyramid::build(Volume::new([1, 1, 256], texels.collect()).unwrap());
    let plane = Generator::Plane(Plane { segments: 1, ..Plane::default() }).build().unwrap();
    let shell = Shell::build(&plane, &ShellOptions::new(1.0)).unwrap();
    let mut scene = Scene::new(shell, volume, 1.0 / 256.0);
    scene.medium.lod_footprint = 0.0;
    scene.view = mesoshell::stress::scenes::view(DVec3::new(0.9, 4.0, 2.5), DVec3::ZERO, 40.0, 0.01, 128);
    let order = |steps: &[f64]| {
        let errors = compare(&scene, steps);
        let points: Vec<[f64; 2]> =
            steps.iter().zip(&errors).map(|(step, error)| [*step, error.rmse]).collect();
        println!("{points:?}");
        convergence::order(&points).unwrap().0
    };
    let found = order(&[16.0, 8.0, 4.0, 2.0]);
    println!("order {found}");
    assert!(found >= 2.0 - 0.08, "{found}");
}

#[test]
fn depth_is_that_of_the_reference() {
    let mut scene = load("fur-sphere", &["image.size=[128, 128]", "march.step=0.125"]);
    scene.view.depth = true;
    let scene = Arc::new(scene);
    let view = scene.view;
    let frames = ["shell", "reference"].map(|name| Watched::prepare(name, &scene).render(&view));
    let [shell, reference] = frames.each_ref().map(|frame| frame.depth.as_ref().unwrap());
    let mut compared = 0;
    for (i, (shell, reference)) in shell.iter().zip(reference).enumerate() {
        // The mean is a quotient by alpha, and tells nothing where that is near 0.
        if frames.iter().any(|frame| frame.image.rgba[i][3] < 0.1) {
            continue;
        }
        compared += 1;
        // At this step alpha errs by 5e-4 (the readme's table), and so does each part of it along the ray, of which at most
        // 1.5 lies in a shell that is 0.25 thick around a ball of radius 1: 2 * 5e-4 * 1.5 / 0.1.
        assert!((shell - reference).abs() <= 0.015, "{shell} for {reference}");
    }
    assert!(compared > 5_000, "only {compared} pixels compared");
}

#[test]
fn pictures_are_the_same_bytes_on_every_run() {
    let scene = Arc::new(load("weave-teapot", &["image.size=[128, 128]"]));
    let render = || Watched::prepare("shell", &scene).render(&scene.view).image;
    let first = render();
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(first, render());
    assert_eq!(first, one_thread.install(render));
}

/// Three-point Gauss is exact for the optical depth where that is a cubic, and errs by the sixth order for colour; the bound is what
/// f32 leaves, of which a ray of a hundred cells with some ten roundings each gathers up to 1000 * 2^-24, at random far less.
#[test]
fn the_exact_plan_is_exact() {
    for name in ["fur-sphere", "fog-torus"] {
        let scene = Scene { march: March::Exact, ..load(name, &["image.size=[160, 160]"]) };
        let reference = Watched::prepare("reference", &Arc::new(scene.clone())).render(&scene.view).image;
        let exact = Watched::prepare("shell", &Arc::new(scene.clone())).render(&scene.view).image;
        let metrics = metric::compare(&exact, &reference).unwrap();
        println!("{name}: {metrics:?}");
        assert!(metrics.rmse <= 1e-5, "{name}: {metrics:?}");
    }
}

/// The teapot's spout and handle run through its body: where tetrahedra overlap the exact plan takes midpoints, and is no more
/// exact than they are.
#[test]
fn the_exact_plan_takes_fine_midpoints_in_cycles() {
    let scene = load("weave-teapot", &["image.size=[160, 160]"]);
    let midpoints = compare(&scene, &[0.125])[0];
    let reference = Watched::prepare("reference", &Arc::new(scene.clone())).render(&scene.view).image;
    let scene = Arc::new(Scene { march: March::Exact, ..scene });
    let exact =
        metric::compare(&Watched::prepare("shell", &scene).render(&scene.view).image, &reference).unwrap();
    println!("exact {exact:?}, midpoints {midpoints:?}");
    assert!(exact.rmse <= midpoints.rmse, "{exact:?} for {midpoints:?}");
}

#[test]
fn densities_are_interpolated_as_extinction() {
    // Noise of no smoothness at all, up to an optical depth of 3 a texel, seen from near and from afar.
    let mut random = Pcg64::seed_from_u64(9);
    let texels = (0..16 * 16 * 8)
        .map(|_| {
            let density: f32 = random.random_range(0.0..1.0f32).powi(3);
            [density, 0.5 * density * random.random_range(0.0..1.0f32), 0.1 * density, density]
        })
        .collect();
    let volume = Volume::of(Quantity::Extinction, [16, 16, 8], texels).unwrap();
    let torus = Generator::Torus(Torus { segments: 24, rings: 12, ..Torus::default() }).build().unwrap();
    let options = ShellOptions { uv_scale: DVec2::new(6.0, 2.0), ..ShellOptions::new(0.2) };
    let shell = Shell::build(&torus, &options).unwrap();
    let mut scene = Scene::new(shell, Pyramid::build(volume), 0.05);
    for (distance, step) in [(1.0, 0.25), (6.0, 0.25)] {
        scene.view = mesoshell::stress::scenes::view(
            distance * DVec3::new(1.0, 1.3, 1.9),
            DVec3::ZERO,
            40.0 / distance,
            0.01,
            160,
        );
        let error = |march| {
            let scene = Arc::new(Scene { march, ..scene.clone() });
            let [shell, reference] =
                ["shell", "reference"].map(|name| Watched::prepare(name, &scene).render(&scene.view).image);
            metric::compare(&shell, &reference).unwrap()
        };
        let (exact, midpoints) = (error(March::Exact), error(March::Default { step }));
        println!("{distance}: exact {exact:?}, midpoints {midpoints:?}");
        assert!(exact.rmse <= 1e-5, "{exact:?}");
        assert!(midpoints.rmse <= 2e-3 && midpoints.rmse > 10.0 * exact.rmse, "{midpoints:?}");
        // Read as an opacity the same numbers are another medium.
        let mut opacity = scene.clone();
        std::sync::Arc::make_mut(&mut opacity.volume)
            .levels
            .iter_mut()
            .for_each(|level| level.quantity = Quantity::Opacity);
        let pictures = [&scene, &opacity]
            .map(|scene| Watched::prepare("shell", &Arc::new(scene.clone())).render(&scene.view).image);
        let other = metric::compare(&pictures[0], &pictures[1]).unwrap();
        assert!(other.rmse > 10.0 * midpoints.rmse, "{other:?}");
    }
}
