//! Image error: how far one linear premultiplied RGBA image is from another.
//!
//! Channels are compared as they are, in linear light and without a tone curve, so that a number means
//! the same in the dark as in the light, and a change of hue counts as much as one of brightness. [`flip`] alone
//! judges as a person does.

pub mod flip;
mod magma;
pub mod map;

use serde::Serialize;

use crate::frame::Image;
use crate::{Error, Result};

/// The differences between two images, in units of linear premultiplied RGBA (1 is white) but for PSNR and FLIP.
///
/// A value that is not finite in either image counts as an infinite difference, even from itself.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Metrics {
    /// Root of the mean square difference over all pixels and all four channels.
    pub rmse: f64,
    /// The largest difference of a channel.
    pub max: f64,
    /// The 99.9th percentile, over pixels, of a pixel's largest channel difference: at most one pixel
    /// in a thousand is worse.
    pub p999: f64,
    /// Peak signal to noise ratio for a peak of 1, in decibels: `-20 log10(rmse)`; infinite for equal images.
    pub psnr: f64,
    /// The mean FLIP error of the pixels, 0 to 1: see [`flip`].
    pub flip: f64,
    /// Pixels compared.
    pub pixels: u64,
}

/// The differences between two images, and where FLIP sees them.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// Over all pixels.
    pub metrics: Metrics,
    /// The FLIP error of each pixel, row by row from the top left; empty where a value is not finite.
    pub flip_errors: Vec<f32>,
}

/// Compares two images, for FLIP over black; neither is preferred.
///
/// # Errors
/// [`Error::Usage`] when their sizes differ, or when they have no pixels.
pub fn compare(a: &Image, b: &Image) -> Result<Metrics> {
    Ok(compare_over(a, b, [0.0; 3])?.metrics)
}

/// As [`compare`], for FLIP over `background` (linear RGB), which is kept pixel by pixel.
///
/// # Errors
/// As [`compare`].
pub fn compare_over(a: &Image, b: &Image, background: [f32; 3]) -> Result<Comparison> {
    check_sizes(a, b)?;
    let mut sum_of_squares = 0.0;
    let mut largest: Vec<f64> = Vec::with_capacity(a.rgba.len());
    for (a, b) in a.rgba.iter().zip(&b.rgba) {
        let differences: [f64; 4] = std::array::from_fn(|channel| difference(a[channel], b[channel]));
        sum_of_squares += differences.iter().map(|d| d * d).sum::<f64>();
        largest.push(differences.into_iter().fold(0.0, f64::max));
    }
    let pixels = largest.len();
    let rmse = (sum_of_squares / (4 * pixels) as f64).sqrt();

    let p999 = percentile_999(&mut largest);
    let max = largest.into_iter().fold(0.0, f64::max);
    let (flip, flip_errors) = if max.is_finite() {
        let errors = flip::errors(a, b, background)?;
        (errors.iter().copied().map(f64::from).sum::<f64>() / pixels as f64, errors)
    } else {
        (f64::INFINITY, Vec::new())
    };
    let metrics = Metrics { rmse, max, p999, psnr: -20.0 * rmse.log10(), flip, pixels: pixels as u64 };
    Ok(Comparison { metrics, flip_errors })
}

/// The nearest rank: the smallest value that at least 99.9 % of them do not exceed.
fn percentile_999(values: &mut [f64]) -> f64 {
    let rank = values.len() - values.len() / 1000;
    *values.select_nth_unstable_by(rank - 1, f64::total_cmp).1
}

fn check_sizes(a: &Image, b: &Image) -> Result<()> {
    let sizes = [(a.width, a.height, a.rgba.len()), (b.width, b.height, b.rgba.len())];
    if sizes[0] == sizes[1] && !a.rgba.is_empty() {
        return Ok(());
    }
    let message =
        format!("images of {}x{} and {}x{} pixels cannot be compared", a.width, a.height, b.width, b.height);
    let help = Some("render both at the same size, of at least one pixel".into());
    Err(Error::Usage { message, help })
}

/// Linear RGB of a premultiplied pixel over an opaque background.
fn over([r, g, b, a]: [f32; 4], background: [f32; 3]) -> [f32; 3] {
    let under = background.map(|x| x * (1.0 - a.clamp(0.0, 1.0)));
    [r + under[0], g + under[1], b + under[2]]
}

fn difference(a: f32, b: f32) -> f64 {
    if a.is_finite() && b.is_finite() { (f64::from(a) - f64::from(b)).abs() } else { f64::INFINITY }
}

#[cfg(test)]
mod tests {
    use rand::RngExt;
    use rand_pcg::Pcg32;

    use super::*;

    fn noise(width: u32, height: u32) -> Image {
        let mut random = Pcg32::new(7, 7);
        let mut image = Image::new(width, height);
        image.rgba.fill_with(|| std::array::from_fn(|_| random.random()));
        image
    }

    #[test]
    fn equal_images_do_not_differ() {
        let image = noise(40, 30);
        let metrics = compare(&image, &image).unwrap();
        assert_eq!(
            metrics,
            Metrics { rmse: 0.0, max: 0.0, p999: 0.0, psnr: f64::INFINITY, flip: 0.0, pixels: 1200 }
        );
    }

    #[test]
    fn one_channel_of_one_pixel_counts() {
        let a = Image::new(50, 20);
        let mut b = a.clone();
        b.rgba[777][3] = 0.5;
        let metrics = compare(&a, &b).unwrap();
        assert_eq!(metrics.max, 0.5);
        assert_eq!(metrics.rmse, (0.25_f64 / 4000.0).sqrt());
        // One pixel of a thousand may be worse, a second may not.
        assert_eq!(metrics.p999, 0.0);
        b.rgba[3][0] = -0.25;
        assert_eq!(compare(&a, &b).unwrap().p999, 0.25);
        assert_eq!(compare(&a, &b).unwrap(), compare(&b, &a).unwrap());
    }

    #[test]
    fn a_swapped_channel_counts() {
        let image = noise(64, 64);
        let mut swapped = image.clone();
        for [r, _, b, _] in &mut swapped.rgba {
            std::mem::swap(r, b);
        }
        let metrics = compare(&image, &swapped).unwrap();
        assert_eq!(metrics.pixels, 64 * 64);
        // Two of four channels differ by the difference of two uniform numbers, whose mean square is 1/6;
        // the standard error of its mean over 4096 pixels is below 2 %.
        assert!((metrics.rmse - (2.0 / 4.0 / 6.0_f64).sqrt()).abs() < 0.01, "{metrics:?}");
    }

    #[test]
    fn a_constant_offset_has_its_psnr() {
        let a = Image::new(10, 10);
        let mut b = a.clone();
        b.rgba.fill([0.125; 4]);
        let metrics = compare(&a, &b).unwrap();
        assert_eq!((metrics.rmse, metrics.max, metrics.p999), (0.125, 0.125, 0.125));
        assert!((metrics.psnr - 20.0 * 8.0_f64.log10()).abs() < 1e-12);
    }

    #[test]
    fn what_is_not_finite_never_passes() {
        for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let mut image = noise(20, 20);
            let good = image.clone();
            image.rgba[5][2] = value;
            for (a, b) in [(&image, &good), (&good, &image), (&image, &image)] {
                let metrics = compare(a, b).unwrap();
                assert_eq!([metrics.rmse, metrics.max, metrics.flip], [f64::INFINITY; 3]);
                assert_eq!(metrics.psnr, f64::NEG_INFINITY);
            }
        }
    }

    #[test]
    fn different_sizes_are_refused() {
        for (a, b) in [((3, 4), (4, 3)), ((3, 4), (3, 5)), ((0, 0), (0, 0))] {
            let error = compare(&Image::new(a.0, a.1), &Image::new(b.0, b.1)).unwrap_err();
            assert_eq!(error.exit_code(), 2);
        }
    }
}
