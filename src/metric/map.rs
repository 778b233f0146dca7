//! Pictures of where two images differ: [`signed`] says which of them is brighter, [`flip`] what a person sees.
//!
//! They are opaque and hold the linear values of what are colours of a scale in sRGB, so that a PNG of them has
//! those colours byte for byte. A value that is NaN has no colour: its pixel is NaN too, and no PNG is written.

use super::magma::MAGMA;
use super::{check_sizes, over};
use crate::Result;
use crate::frame::Image;
use crate::frame::srgb::linear_from_srgb;

/// The luminance (Rec. 709, linear light) of `a` less that of `b`, for each pixel, both over `background` (linear
/// RGB), where white has 1.
///
/// # Errors
/// [`Error::Usage`](crate::Error::Usage) when their sizes differ, or when they have no pixels.
pub fn luminance_differences(a: &Image, b: &Image, background: [f32; 3]) -> Result<Vec<f32>> {
    check_sizes(a, b)?;
    let luminance = |&pixel: &[f32; 4]| {
        let [r, g, b] = over(pixel, background);
        0.2126 * r + 0.7152 * g + 0.0722 * b
    };
    Ok(a.rgba.iter().zip(&b.rgba).map(|(a, b)| luminance(a) - luminance(b)).collect())
}

/// A range that shows most of `differences`: the 99.9th percentile of their magnitudes; the largest where that is 0,
/// and 1 where even that is 0.
pub fn natural_range(differences: &[f32]) -> f32 {
    let mut magnitudes: Vec<f64> = differences.iter().map(|d| f64::from(d.abs())).collect();
    let largest = magnitudes.iter().copied().fold(0.0, f64::max);
    let percentile = super::percentile_999(&mut magnitudes);
    [percentile, largest].into_iter().find(|&range| range > 0.0).unwrap_or(1.0) as f32
}

/// Red where a difference is above 0, blue where it is below, white where there is none.
///
/// The scale is linear in the bytes of sRGB: at `t = |difference| / range`, at most 1, red is (255, 255 (1 - t),
/// 255 (1 - t)) and blue (255 (1 - t), 255 (1 - t), 255); green alone gives the magnitude.
pub fn signed(differences: &[f32], width: u32, range: f32) -> Image {
    picture(differences, width, |difference| {
        let fade = 1.0 - (difference.abs() / range).min(1.0);
        if difference > 0.0 { [1.0, fade, fade] } else { [fade, fade, 1.0] }
    })
}

/// FLIP errors, 0 to 1, in the colours of the paper: magma, from black (none) to light yellow (the most).
pub fn flip(errors: &[f32], width: u32) -> Image {
    picture(errors, width, |error| {
        let [_, bytes @ ..] = MAGMA[usize::from((error * 255.0).round() as u8)].to_be_bytes();
        bytes.map(|byte| f32::from(byte) / 255.0)
    })
}

/// Rows of `width` values, each in its sRGB colour.
fn picture(values: &[f32], width: u32, color: impl Fn(f32) -> [f32; 3]) -> Image {
    let opaque = |&value: &f32| {
        let [r, g, b] = if value.is_nan() { [value; 3] } else { color(value).map(linear_from_srgb) };
        [r, g, b, 1.0]
    };
    Image { width, height: (values.len() / width as usize) as u32, rgba: values.iter().map(opaque).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::srgb::srgb_from_linear;

    fn bytes(image: &Image) -> Vec<[u8; 3]> {
        let byte = |x: f32| (255.0 * srgb_from_linear(x)).round() as u8;
        image.rgba.iter().map(|&[r, g, b, _]| [r, g, b].map(byte)).collect()
    }

    #[test]
    fn the_sign_has_its_colour_and_green_the_magnitude() {
        let map = signed(&[0.0, 0.05, -0.05, 0.2, -0.2, 7.0], 3, 0.2);
        assert_eq!((map.width, map.height), (3, 2));
        let expected =
            [[255, 255, 255], [255, 191, 191], [191, 191, 255], [255, 0, 0], [0, 0, 255], [255, 0, 0]];
        assert_eq!(bytes(&map), expected);
    }

    #[test]
    fn a_range_leaves_out_one_difference_in_a_thousand() {
        let mut differences = vec![-0.25; 1000];
        differences[3] = 9.0;
        assert_eq!(natural_range(&differences), 0.25);
        assert_eq!(natural_range(&[0.0, -0.5]), 0.5);
        let mut one = vec![0.0; 1000];
        assert_eq!(natural_range(&one), 1.0);
        one[3] = -9.0;
        assert_eq!(natural_range(&one), 9.0);
    }

    #[test]
    fn luminance_is_that_of_what_is_seen() {
        let (mut a, mut b) = (Image::new(3, 1), Image::new(3, 1));
        a.rgba = vec![[0.5, 0.5, 0.5, 1.0], [0.0, 0.0, 0.0, 0.5], [0.0, 0.0, 0.0, 1.0]];
        b.rgba = vec![[0.25, 0.25, 0.25, 1.0], [0.0; 4], [0.0, 1.0, 0.0, 1.0]];
        let near = |found: Vec<f32>, expected: [f32; 3]| {
            assert!(found.iter().zip(expected).all(|(x, y)| (x - y).abs() < 1e-6), "{found:?}");
        };
        near(luminance_differences(&a, &b, [0.0; 3]).unwrap(), [0.25, 0.0, -0.7152]);
        near(luminance_differences(&a, &b, [1.0; 3]).unwrap(), [0.25, -0.5, -0.7152]);
    }

    #[test]
    fn magma_ends_as_it_should_and_nan_has_no_colour() {
        assert_eq!(bytes(&flip(&[0.0, 0.5, 1.0], 1)), [[0, 0, 4], [183, 55, 121], [252, 253, 191]]);
        assert!(flip(&[f32::NAN], 1).rgba[0][0].is_nan() && signed(&[f32::NAN], 1, 1.0).rgba[0][0].is_nan());
    }
}
