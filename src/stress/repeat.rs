//! The same bytes on every run, whatever the number of threads. Bound 0: nothing random, and no sum whose order is left to
//! chance.

use std::sync::Arc;

use glam::DVec3;

use super::scenes::{PAINTS, painted, view};
use super::{Case, Stand};
use crate::frame::Image;
use crate::mesh::generate::{Generator, Torus};
use crate::scene::Scene;
use crate::shell::{Shell, ShellOptions};
use crate::{Error, Result};

pub(super) const CASES: &[Case] = &[
    Case { name: "runs", measure: "pixels that differ between runs", bound: 0.0, worst: runs },
    Case { name: "threads", measure: "pixels that differ with 1, 2, 4 threads", bound: 0.0, worst: threads },
];

/// Overlaps, so that sorting, cycles and blending all have their part.
fn scene() -> Result<Arc<Scene>> {
    let mesh = Generator::Torus(Torus { segments: 32, rings: 16, ..Torus::default() }).build()?;
    let view = view(DVec3::new(0.4, 1.4, 3.0), DVec3::ZERO, 40.0, 1e-3, 96);
    let options = ShellOptions { uv_scale: glam::DVec2::new(4.0, 3.0), ..ShellOptions::new(0.9) };
    Ok(Arc::new(painted(Shell::build(&mesh, &options)?, &PAINTS, 0.3, view)))
}

fn differing(a: &Image, b: &Image) -> usize {
    let differ = |(a, b): &(&[f32; 4], &[f32; 4])| a.map(f32::to_bits) != b.map(f32::to_bits);
    a.rgba.iter().zip(&b.rgba).filter(differ).count()
}

fn runs(stand: &Stand<'_>) -> Result<f64> {
    let scene = scene()?;
    let first = stand.frame(&scene)?.image;
    // Every other run with a device of its own.
    let mut method = stand.prepare(&scene)?;
    let mut differ = 0;
    for run in 1..stand.either(5, 100) {
        if run % 2 == 0 {
            method = stand.prepare(&scene)?;
        }
        method.forget();
        differ += differing(&method.render(&scene.view)?.image, &first);
    }
    Ok(differ as f64)
}

/// From the mesh to the picture; the threads are those that sort and map. (The device's own are its driver's.)
fn threads(stand: &Stand<'_>) -> Result<f64> {
    let mut first: Option<Image> = None;
    let mut differ = 0;
    for count in [1, 2, 4] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build();
        let pool = pool.map_err(|error| Error::OutOfMemory { message: error.to_string(), help: None })?;
        let image = pool.install(|| stand.frame(&scene()?))?.image;
        differ += differing(&image, first.get_or_insert_with(|| image.clone()));
    }
    Ok(differ as f64)
}
