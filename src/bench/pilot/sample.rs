//! A random sample of a picture's pixels, with the exact values there: from it the error of the whole picture is estimated.

use std::sync::atomic::{AtomicUsize, Ordering};

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::Result;
use crate::frame::Image;
use crate::progress::{Interrupt, Progress};
use crate::reference::Reference;
use crate::scene::View;

/// Pixels of a sample; all of them where a picture has no more. The error of the demo's scenes sits in few pixels (the worst
/// thousandth holds up to a third of it), of which eight remain in the sample: the estimate is good to about a tenth.
const PIXELS: u64 = 8192;

/// An RMSE that was estimated from a sample.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Root of the mean square difference over the sampled pixels and all four channels.
    pub rmse: f64,
    /// Its standard error; 0 where all pixels were sampled.
    pub standard_error: f64,
}

impl Estimate {
    /// What the picture's RMSE exceeds about once in forty times: two standard errors above the estimate.
    pub fn upper(&self) -> f64 {
        self.rmse + 2.0 * self.standard_error
    }
}

/// Pixels and their exact values.
#[derive(Debug, Clone, PartialEq)]
pub struct Sample {
    /// Index into the picture's pixels; linear premultiplied RGBA.
    exact: Vec<(usize, [f64; 4])>,
    /// Pixels of the picture.
    population: u64,
}

impl Sample {
    /// Draws one pixel at random from each of 8192 stretches of the picture's rows, the same ones every time, and
    /// integrates there.
    ///
    /// # Errors
    /// [`Error::Interrupted`](crate::Error::Interrupted) soon after the flag is set.
    pub fn draw(
        reference: &Reference<'_>,
        view: &View,
        progress: &dyn Progress,
        interrupt: &Interrupt,
    ) -> Result<Self> {
        let population = u64::from(view.width) * u64::from(view.height);
        let count = population.min(PIXELS);
        let mut random = Pcg64::seed_from_u64(0x9e37);
        let start = |stretch: u64| stretch * population / count;
        let pixels: Vec<u64> =
            (0..count).map(|stretch| random.random_range(start(stretch)..start(stretch + 1))).collect();
        let done = AtomicUsize::new(0);
        let exact = |&pixel: &u64| {
            interrupt.check()?;
            let (x, y) = (pixel % u64::from(view.width), pixel / u64::from(view.width));
            let rgba = reference.pixel(x as u32, y as u32).rgba;
            progress.fraction((done.fetch_add(1, Ordering::Relaxed) + 1) as f64 / count as f64);
            Ok((pixel as usize, rgba))
        };
        Ok(Self { exact: pixels.par_iter().map(exact).collect::<Result<_>>()?, population })
    }

    /// The error of a picture of the same view.
    pub fn estimate(&self, image: &Image) -> Estimate {
        let square = |(pixel, exact): &(usize, [f64; 4])| {
            let differences = image.rgba[*pixel].into_iter().zip(exact);
            let sum: f64 = differences.map(|(a, b)| (f64::from(a) - b).powi(2)).sum();
            if sum.is_finite() { sum / 4.0 } else { f64::INFINITY }
        };
        let count = self.exact.len() as f64;
        let mean = self.exact.iter().map(square).sum::<f64>() / count;
        if mean == 0.0 || mean.is_infinite() {
            return Estimate { rmse: mean, standard_error: 0.0 };
        }
        let variance = self.exact.iter().map(|pixel| (square(pixel) - mean).powi(2)).sum::<f64>()
            / (count - 1.0).max(1.0);
        // Of a mean over a part of a finite population; stretches make it no worse.
        let left_out = 1.0 - count / self.population as f64;
        let of_mean = (variance / count * left_out).sqrt();
        // The root's derivative.
        Estimate { rmse: mean.sqrt(), standard_error: of_mean / (2.0 * mean.sqrt()) }
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::fingerprint::tests::scene;
    use super::*;
    use crate::metric;
    use crate::progress::Silent;
    use crate::reference;

    fn draw(width: u32, height: u32) -> (Sample, Image) {
        let mut scene = scene();
        (scene.view.width, scene.view.height) = (width, height);
        let interrupt = Interrupt::default();
        let image = reference::render(&scene, &scene.view, &Silent, &interrupt).unwrap().image;
        let reference = Reference::new(&scene, &scene.view);
        (Sample::draw(&reference, &scene.view, &Silent, &interrupt).unwrap(), image)
    }

    #[test]
    fn of_a_small_picture_all_pixels_are_sampled() {
        let (sample, exact) = draw(32, 24);
        assert!(sample.exact.iter().map(|(pixel, _)| *pixel).eq(0..32 * 24));
        let mut image = exact.clone();
        image.rgba[400][2] += 0.25;
        image.rgba[77][3] -= 0.5;
        let estimate = sample.estimate(&image);
        // The reference's picture is rounded to f32.
        let rmse = metric::compare(&image, &exact).unwrap().rmse;
        assert!((estimate.rmse - rmse).abs() < 1e-7 && estimate.standard_error == 0.0, "{estimate:?} {rmse}");
    }

    #[test]
    fn the_error_of_a_large_picture_is_near_its_estimate() {
        let (sample, exact) = draw(256, 200);
        assert_eq!(sample.exact.len() as u64, PIXELS);
        let mut random = Pcg64::seed_from_u64(5);
        let mut image = exact.clone();
        for pixel in &mut image.rgba {
            // One pixel in a hundred is far off, the others a little.
            let size = if random.random_range(0..100) == 0 { 0.1 } else { 0.002 };
            pixel[0] += size * random.random_range(-1.0..1.0f32);
        }
        let estimate = sample.estimate(&image);
        let rmse = metric::compare(&image, &exact).unwrap().rmse;
        // Four standard errors are exceeded once in 16,000 times.
        assert!((estimate.rmse - rmse).abs() < 4.0 * estimate.standard_error, "{estimate:?} {rmse}");
        assert!(
            estimate.standard_error > 0.01 * rmse && estimate.standard_error < 0.1 * rmse,
            "{estimate:?}"
        );
        assert!((sample.estimate(&exact).rmse - rmse).abs() > 4.0 * estimate.standard_error);
    }

    #[test]
    fn what_is_not_finite_meets_nothing() {
        let (sample, mut image) = draw(16, 16);
        image.rgba[9][1] = f32::NAN;
        assert_eq!(sample.estimate(&image).upper(), f64::INFINITY);
    }
}
