//! What filters are measured against: the mean of many rays a pixel through the full volume, which no filter has touched.

use glam::DVec2;

use super::{Counts, Reference, of_all_pixels, report};
use crate::Result;
use crate::frame::{Frame, Image, Stopwatch};
use crate::progress::{Interrupt, Progress};
use crate::scene::{Scene, View};

/// Renders `view` of the scene (`scene.view` is not read) at level 0 alone, each pixel the mean of `side` times `side`
/// rays through the middles of the squares that it is cut into: a box as wide as the pixel. `tolerance` is that of each
/// ray: see [`Reference::with_tolerance`]. The picture does not depend on the number of threads; depth is left out.
///
/// # Errors
/// [`Error::Interrupted`](crate::Error::Interrupted) soon after the flag is set.
pub fn render_supersampled(
    scene: &Scene,
    view: &View,
    side: u32,
    tolerance: f64,
    progress: &dyn Progress,
    interrupt: &Interrupt,
) -> Result<Frame> {
    let mut stopwatch = Stopwatch::start();
    progress.stage("building the bounding volume hierarchy");
    let reference = Reference::new(scene, view).with_lod_footprint(0.0).with_tolerance(tolerance);
    stopwatch.lap("hierarchy");

    let offsets = (0..side * side).map(|ray| DVec2::new(f64::from(ray % side), f64::from(ray / side)) + 0.5);
    let offsets: Vec<DVec2> = offsets.map(|offset| offset / f64::from(side)).collect();
    let pixel = |x: u32, y: u32, counts: &mut Counts| {
        let corner = DVec2::new(f64::from(x), f64::from(y));
        let mut sum = [0.0; 4];
        for &offset in &offsets {
            let (sample, added) = reference.integrate(view.ray_at_unit_depth(corner + offset));
            *counts = counts.add(added);
            sum = std::array::from_fn(|channel| sum[channel] + sample.rgba[channel]);
        }
        sum.map(|sum| (sum / offsets.len() as f64) as f32)
    };
    let (rgba, counts) = of_all_pixels(view, progress, interrupt, pixel)?;
    stopwatch.lap("integrate");

    let image = Image { width: view.width, height: view.height, rgba };
    let report = report(stopwatch, counts, &image);
    Ok(Frame { image, depth: None, report })
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::mesh::generate::{Generator, Torus};
    use crate::progress::Silent;
    use crate::shell::{Shell, ShellOptions};
    use crate::volume::{Pyramid, Volume};

    /// A torus of checkered fog, far enough for coarse levels.
    fn scene() -> Scene {
        let mesh = Generator::Torus(Torus { segments: 12, rings: 8, ..Torus::default() }).build().unwrap();
        let shell = Shell::build(&mesh, &ShellOptions::new(0.2)).unwrap();
        let texel = |i: u32| if (i ^ i >> 3 ^ i >> 6) & 1 == 0 { [0.2, 0.1, 0.0, 0.3] } else { [0.0; 4] };
        let volume = Volume::new([8, 8, 4], (0..256).map(texel).collect()).unwrap();
        let mut scene = Scene::new(shell, Pyramid::build(volume), 0.05);
        scene.view.camera.eye *= 2.0;
        (scene.view.width, scene.view.height) = (24, 20);
        scene
    }

    fn supersampled(scene: &Scene, side: u32) -> Image {
        let interrupt = Interrupt::default();
        render_supersampled(scene, &scene.view, side, 1e-7, &Silent, &interrupt).unwrap().image
    }

    #[test]
    fn a_pixel_is_the_mean_of_its_rays_through_the_full_volume() {
        let scene = scene();
        let mut full = scene.clone();
        std::sync::Arc::make_mut(&mut full.volume).levels.truncate(1);
        let single = Reference::new(&full, &full.view);
        let largest_difference = |scene: &Scene, shift: f64| {
            let image = supersampled(scene, 3);
            let mut largest = 0.0_f64;
            for (i, pixel) in image.rgba.iter().enumerate() {
                let corner = DVec2::new((i % 24) as f64, (i / 24) as f64);
                let mut mean = [0.0; 4];
                for ray in 0..9 {
                    let offset = DVec2::new(f64::from(ray % 3), f64::from(ray / 3)) / 3.0 + 1.0 / 6.0 + shift;
                    let sample = single.integrate_ray(corner + offset);
                    mean = std::array::from_fn(|channel| mean[channel] + sample.rgba[channel] / 9.0);
                }
                let differences = (0..4).map(|c| (f64::from(pixel[c]) - mean[c]).abs());
                largest = differences.fold(largest, f64::max);
            }
            largest
        };
        assert!(supersampled(&scene, 3).rgba.iter().filter(|pixel| pixel[3] > 0.05).count() > 20);
        // Two tolerances, and the rounding of a pixel to f32.
        assert!(largest_difference(&scene, 0.0) <= 2e-7);
        assert!(largest_difference(&scene, 0.02) > 1e-3, "rays elsewhere");
        let mut other = scene.clone();
        other.view.camera.eye += DVec3::new(0.01, 0.0, 0.0);
        assert!(largest_difference(&other, 0.0) > 1e-3, "another eye");
    }

    #[test]
    fn levels_and_footprint_have_no_part_in_it() {
        let scene = scene();
        let mut other = scene.clone();
        other.medium.lod_footprint = 5.0;
        let volume = std::sync::Arc::make_mut(&mut other.volume);
        volume.levels.iter_mut().skip(1).for_each(|level| level.texels.fill([0.0; 4]));
        assert_eq!(supersampled(&scene, 2), supersampled(&other, 2));
        std::sync::Arc::make_mut(&mut other.volume).levels[0].texels[0][0] += 0.1;
        assert_ne!(supersampled(&scene, 2), supersampled(&other, 2));
    }

    #[test]
    fn an_interrupt_ends_it() {
        let scene = scene();
        let interrupt = Interrupt::default();
        interrupt.set();
        let error = render_supersampled(&scene, &scene.view, 8, 1e-4, &Silent, &interrupt).unwrap_err();
        assert!(matches!(error, crate::Error::Interrupted));
    }
}
