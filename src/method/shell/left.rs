//! The pixels that the device leaves to the host: those of cycles so deep that `glsl/cycle.frag.glsl` gives them up. There the
//! integral is evaluated as the [`reference`](mod@crate::reference) does, whatever the plan of the march.

use rayon::prelude::*;

use super::seen::Seen;
use crate::Result;
use crate::progress::{Interrupt, Progress};
use crate::reference::Reference;
use crate::scene::{Scene, View};

/// Largest absolute error: that of f32 sums on the device.
const TOLERANCE: f64 = 1e-6;

/// The same where a light casts shadows: ten times the reference's own. Shadows that are read from a light's pictures, as in all other
/// pixels, are off by up to 9e-2 at their edges (teapot-bust of `benches/speed.toml`), and two digits more take four times as long.
const TOLERANCE_IN_SHADOWS: f64 = 1e-4;

/// Fills in the pixels of `rgba`, and of `depth` where it is wanted, that are not finite although `seen` resolves them per pixel;
/// returns how many they are. Elsewhere such a pixel is a fault, and stays.
///
/// # Errors
/// [`Error::Interrupted`](crate::Error::Interrupted) soon after the flag is set.
pub fn fill(
    seen: Option<&Seen>,
    scene: &Scene,
    view: &View,
    rgba: &mut [[f32; 4]],
    mut depth: Option<&mut [f32]>,
    progress: &dyn Progress,
    interrupt: &Interrupt,
) -> Result<u64> {
    let place = |pixel: usize| ((pixel % view.width as usize) as u32, (pixel / view.width as usize) as u32);
    let is_tiled = seen.map(|seen| seen.is_tiled(view));
    let is_left = |&pixel: &usize| {
        let (x, y) = place(pixel);
        !rgba[pixel][3].is_finite() && is_tiled.as_ref().is_none_or(|is_tiled| is_tiled(x, y))
    };
    let left: Vec<usize> = (0..rgba.len()).filter(is_left).collect();
    if left.is_empty() {
        return Ok(0);
    }
    progress.stage("integrating what the device left");
    let tolerance = if scene.casts_shadows() { TOLERANCE_IN_SHADOWS } else { TOLERANCE };
    let reference = Reference::new(scene, view).with_tolerance(tolerance);
    let sample = |&pixel: &usize| {
        interrupt.check()?;
        let (x, y) = place(pixel);
        Ok(reference.pixel(x, y))
    };
    let samples: Vec<_> = left.par_iter().map(sample).collect::<Result<_>>()?;
    for (&pixel, sample) in left.iter().zip(samples) {
        rgba[pixel] = sample.rgba.map(|channel| channel as f32);
        if let Some(depth) = &mut depth {
            depth[pixel] = sample.depth as f32;
        }
    }
    Ok(left.len() as u64)
}
