//! Pictures of a report: PNG in data URIs, and signed error maps.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use crate::frame::file::write_png;
use crate::frame::srgb::linear_from_srgb;
use crate::frame::{Backdrop, Image};
use crate::metric::map::{luminance_differences, natural_range};

/// The longest side of an embedded picture, in pixels.
const LONGEST_SIDE: u32 = 512;

/// sRGB of an error of the whole range: too dark and too bright. What is between fades into the page.
pub const TOO_DARK: [u8; 3] = [0x2a, 0x78, 0xd6];
/// See [`TOO_DARK`].
pub const TOO_BRIGHT: [u8; 3] = [0xe3, 0x49, 0x48];

/// A picture as a `data:` URI; with nothing behind it what is transparent stays so.
pub fn data_uri(image: &Image, backdrop: &Backdrop) -> String {
    let mut png = Vec::new();
    write_png(&mut png, image, backdrop).expect("memory takes any picture");
    format!("data:image/png;base64,{}", STANDARD.encode(png))
}

/// The picture made smaller by a whole factor, so that its sides are at most 512 pixels: each pixel is the mean of a
/// square, cut off at the right and lower edge.
pub fn thumbnail(image: &Image) -> Image {
    let factor = image.width.max(image.height).div_ceil(LONGEST_SIDE).max(1);
    let mut small = Image::new(image.width.div_ceil(factor), image.height.div_ceil(factor));
    for y in 0..small.height {
        for x in 0..small.width {
            let columns = x * factor..((x + 1) * factor).min(image.width);
            let rows = y * factor..((y + 1) * factor).min(image.height);
            let count = (columns.len() * rows.len()) as f32;
            let mut sum = [0.0; 4];
            for row in rows {
                for column in columns.clone() {
                    let pixel = image.rgba[row as usize * image.width as usize + column as usize];
                    sum = std::array::from_fn(|channel| sum[channel] + pixel[channel]);
                }
            }
            small.rgba[y as usize * small.width as usize + x as usize] = sum.map(|channel| channel / count);
        }
    }
    small
}

/// Where a picture is brighter or darker than the reference, in linear luminance.
pub struct ErrorMap {
    /// Red where it is brighter, blue where it is darker, transparent where it is equal.
    pub image: Image,
    /// The difference that is opaque: the [`natural_range`], rounded up to 1, 2 or 5 times a power of ten.
    pub range: f32,
}

/// Compares two pictures of one size, both over `background`, linear RGB.
pub fn error_map(image: &Image, reference: &Image, background: [f32; 3]) -> ErrorMap {
    let differences = luminance_differences(image, reference, background);
    let differences = differences.expect("pictures of one scene have one size");
    let range = rounded_up(natural_range(&differences));
    let colour = |difference: &f32| {
        let end = if *difference < 0.0 { TOO_DARK } else { TOO_BRIGHT };
        let alpha = if range > 0.0 { (difference.abs() / range).min(1.0) } else { 0.0 };
        let [r, g, b] = end.map(|channel| alpha * linear_from_srgb(f32::from(channel) / 255.0));
        [r, g, b, alpha]
    };
    let rgba = differences.iter().map(colour).collect();
    ErrorMap { image: Image { width: image.width, height: image.height, rgba }, range }
}

/// To 1, 2 or 5 times a power of ten; what is not positive or not finite to 0.
fn rounded_up(value: f32) -> f32 {
    if !(value > 0.0 && value.is_finite()) {
        return 0.0;
    }
    let power = 10.0_f64.powf(f64::from(value).log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|step| (step * power) as f32);
    steps.into_iter().find(|&step| step >= value).unwrap_or(steps[3])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_have_their_sign_and_size() {
        let mut reference = Image::new(40, 50);
        reference.rgba.fill([0.5, 0.5, 0.5, 1.0]);
        let mut image = reference.clone();
        for pixel in &mut image.rgba[..1000] {
            *pixel = [0.2, 0.2, 0.2, 1.0];
        }
        image.rgba[1500] = [0.65, 0.65, 0.65, 1.0];
        let map = error_map(&image, &reference, [0.0; 3]);
        assert_eq!(map.range, 0.5);
        let [r, _, b, alpha] = map.image.rgba[0];
        assert!((alpha - 0.6).abs() < 1e-6 && b > r, "dark is blue");
        let [r, _, b, alpha] = map.image.rgba[1500];
        assert!((alpha - 0.3).abs() < 1e-6 && r > b, "bright is red");
        assert_eq!(map.image.rgba[1999], [0.0; 4]);
        let same = error_map(&image, &image, [0.0; 3]);
        assert!(same.range == 1.0 && same.image.rgba.iter().all(|pixel| *pixel == [0.0; 4]));
    }

    #[test]
    fn ranges_are_round() {
        for (value, range) in [(0.3, 0.5), (0.5, 0.5), (0.051, 0.1), (1.0e-4, 1.0e-4), (1.1e-7, 2.0e-7)] {
            let rounded = rounded_up(value);
            assert!((rounded / range - 1.0).abs() < 1e-6, "{value}: {rounded}");
        }
        assert_eq!([0.0, f32::NAN, f32::INFINITY].map(rounded_up), [0.0; 3]);
    }

    #[test]
    fn a_thumbnail_keeps_the_mean() {
        let mut image = Image::new(1025, 3);
        image.rgba.fill([0.25; 4]);
        image.rgba[0] = [1.0; 4];
        let small = thumbnail(&image);
        assert_eq!((small.width, small.height, small.rgba.len()), (342, 1, 342));
        assert!((small.rgba[0][0] - (1.0 + 8.0 * 0.25) / 9.0).abs() < 1e-6);
        assert_eq!(small.rgba[341], [0.25; 4]);
        assert_eq!(thumbnail(&small), small);
    }

    #[test]
    fn a_uri_holds_the_png() {
        let mut image = Image::new(2, 1);
        image.rgba = vec![[1.0; 4], [0.0; 4]];
        let uri = data_uri(&image, &Backdrop::default());
        let png = STANDARD.decode(uri.strip_prefix("data:image/png;base64,").unwrap()).unwrap();
        let back = image::load_from_memory(&png).unwrap().into_rgba8();
        assert_eq!(back.into_raw(), [255, 255, 255, 255, 0, 0, 0, 0]);
    }
}
