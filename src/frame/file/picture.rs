//! Pictures that are looked at and not measured: the background of a scene.

use std::path::Path;

use image::codecs::jpeg::JpegDecoder;

use super::{Format, damaged, decode_srgb, open, read};
use crate::frame::Image;
use crate::{Error, Result};

/// Whether the name is that of a picture that [`read_picture`] takes.
pub fn is_picture(path: &Path) -> bool {
    is_jpeg(path) || Format::of(path).is_ok()
}

/// Reads a picture to lay things on: as [`read`] does, or JPEG, in sRGB as well. All its values are finite.
///
/// # Errors
/// As [`read`], and [`Error::Input`] for a value that is not finite.
pub fn read_picture(path: &Path) -> Result<Image> {
    let picture = if is_jpeg(path) {
        let (file, length) = open(path)?;
        let decoder = JpegDecoder::new(file).map_err(|error| damaged(path, &error))?;
        // A block of 8 x 8 pixels takes at least a bit, which is below what is allowed for.
        decode_srgb(path, decoder, length, 1)?
    } else {
        read(path)?
    };
    match picture.rgba.iter().position(|pixel| pixel.iter().any(|x| !x.is_finite())) {
        None => Ok(picture),
        Some(index) => {
            let (x, y) = (index % picture.width as usize, index / picture.width as usize);
            Err(Error::input(path, format!("pixel ({x}, {y}) is not finite"))
                .with_help("a picture to lay things on has finite values alone: replace that pixel"))
        }
    }
}

fn is_jpeg(path: &Path) -> bool {
    let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
    matches!(extension.as_deref(), Some("jpg" | "jpeg"))
}

#[cfg(test)]
mod tests {
    use image::codecs::jpeg::JpegEncoder;
    use image::{ExtendedColorType, ImageEncoder};

    use super::*;
    use crate::frame::Backdrop;
    use crate::frame::file::write;
    use crate::frame::srgb::linear_from_srgb;

    #[test]
    fn a_jpeg_is_srgb_and_opaque() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sky.JPEG");
        let mut jpeg = Vec::new();
        let encoder = JpegEncoder::new_with_quality(&mut jpeg, 100);
        encoder.write_image(&[128; 3 * 16 * 16], 16, 16, ExtendedColorType::Rgb8).unwrap();
        std::fs::write(&path, &jpeg).unwrap();
        assert!(is_picture(&path) && is_picture("a.png".as_ref()) && is_picture("a.exr".as_ref()));
        assert!(!is_picture("a.bmp".as_ref()) && !is_picture("gold".as_ref()));
        let picture = read_picture(&path).unwrap();
        assert_eq!((picture.width, picture.height), (16, 16));
        let grey = linear_from_srgb(128.0 / 255.0);
        let is_grey =
            |pixel: &[f32; 4]| pixel[3] == 1.0 && pixel[..3].iter().all(|x| (x - grey).abs() < 0.01);
        assert!(picture.rgba.iter().all(is_grey), "{:?}", picture.rgba[0]);
        for length in 0..jpeg.len() - 20 {
            std::fs::write(&path, &jpeg[..length]).unwrap();
            // A decoder may make up what is cut off.
            if let Err(error) = read_picture(&path) {
                assert_eq!(error.exit_code(), 3, "{error}");
            }
        }
        std::fs::write(&path, &jpeg[..jpeg.len() / 2]).unwrap();
        assert!(read_picture(&path).unwrap_err().to_string().contains("sky.JPEG"));
    }

    #[test]
    fn what_is_not_finite_is_no_background() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sky.exr");
        let mut image = Image::new(2, 2);
        write(&path, &image, &Backdrop::default()).unwrap();
        assert_eq!(read_picture(&path).unwrap(), image);
        image.rgba[3][1] = f32::INFINITY;
        write(&path, &image, &Backdrop::default()).unwrap();
        assert!(read_picture(&path).unwrap_err().to_string().contains("pixel (1, 1)"));
    }
}
