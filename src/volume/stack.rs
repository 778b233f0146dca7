//! A volume as a stack of PNG images: one image a w-layer, the first at the base (w = 0).
//!
//! A row of an image runs along u, and its rows, from the top, along v. Grey images are scalars, fractions
//! of their full range; colours are decoded from sRGB, as PNG has it. Alpha is straight.

use std::cmp::Ordering;
use std::ffi::OsStr;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use image::{ColorType, DynamicImage, ImageDecoder, ImageFormat, ImageReader};

use super::raw::{check_fits_memory, claimed_size, open, unreadable};
use super::{AlphaMode, RawVolume};
use crate::frame::srgb::linear_from_srgb;
use crate::input::MAX_DEFLATE_RATIO;
use crate::{Error, Result};

/// Whether `path` stands for several files: its last part has `*` or `?`, and no file has that very name.
pub(super) fn is_pattern(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.to_string_lossy().contains(['*', '?'])) && !path.exists()
}

/// Reads the images in a folder (`*.png`), those of a pattern, or one image, in the natural order of their
/// names: `slice_2.png` is before `slice_10.png`.
pub(crate) fn read(path: &Path) -> Result<RawVolume> {
    let images = images(path)?;
    let mut values = Vec::new();
    let shape = shape(&decoder(&images[0])?);
    let ((width, height), colour) = shape;
    let channels = u32::from(colour.channel_count());
    let size = [u64::from(width), u64::from(height), images.len() as u64];
    let (size, _) = claimed_size(path, size, channels)?;
    check_fits_memory(path, size)?;
    for image in &images {
        let decoder = decoder(image)?;
        let found = self::shape(&decoder);
        if found != shape {
            let describe = |((width, height), colour): Shape| format!("{width} x {height} {colour:?}");
            let message =
                format!("is {}, but {} is {}", describe(found), images[0].display(), describe(shape));
            return Err(Error::input(image, message).with_help("all images of a stack must be alike"));
        }
        let decoded = DynamicImage::from_decoder(decoder).map_err(|error| undecodable(image, &error))?;
        append(&mut values, &decoded, channels);
    }
    let format = format!("PNG {colour:?}");
    let alpha_mode = AlphaMode::Straight;
    RawVolume { path: path.into(), format, size, channels, values, full_scale: 1.0, alpha_mode }.validated()
}

/// The images that `path` stands for, in order.
///
/// # Errors
/// [`Error::Input`] where a folder cannot be read, or has none that match.
pub(crate) fn images(path: &Path) -> Result<Vec<PathBuf>> {
    if path.is_dir() {
        matching(path, path, "*.png")
    } else if is_pattern(path) {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        matching(path, folder, &path.file_name().unwrap_or_default().to_string_lossy())
    } else {
        Ok(vec![path.into()])
    }
}

/// The width and height of an image, and what its pixels are.
type Shape = ((u32, u32), ColorType);

fn shape(decoder: &impl ImageDecoder) -> Shape {
    (decoder.dimensions(), decoder.color_type())
}

fn undecodable(path: &Path, error: &image::ImageError) -> Error {
    Error::input(path, format!("is no readable PNG: {error}"))
}

/// A decoder that has read the header of the PNG at `path` and found its size plausible.
fn decoder(path: &Path) -> Result<impl ImageDecoder> {
    let (file, length) = open(path)?;
    let decoder = ImageReader::with_format(BufReader::new(file), ImageFormat::Png)
        .into_decoder()
        .map_err(|error| undecodable(path, &error))?;
    // Pixels of one bit grow to a byte.
    if decoder.total_bytes() / (8 * MAX_DEFLATE_RATIO) > length {
        let (width, height) = decoder.dimensions();
        let message = format!("claims {width} x {height} pixels, more than its {length} bytes can hold");
        return Err(Error::input(path, message));
    }
    Ok(decoder)
}

/// Appends an image's values: PNG decodes to 8 or 16 bits a channel, of 1 to 4 channels.
fn append(values: &mut Vec<f32>, image: &DynamicImage, channels: u32) {
    let start = values.len();
    match image.color() {
        ColorType::L8 | ColorType::La8 | ColorType::Rgb8 | ColorType::Rgba8 => {
            values.extend(image.as_bytes().iter().map(|&value| f32::from(value) / 255.0));
        }
        _ => {
            let words = image.as_bytes().as_chunks().0.iter();
            values.extend(words.map(|&pair| f32::from(u16::from_ne_bytes(pair)) / 65535.0));
        }
    }
    let colours = match channels {
        1 => return,
        2 => 1,
        _ => 3,
    };
    for texel in values[start..].chunks_exact_mut(channels as usize) {
        for value in &mut texel[..colours] {
            *value = linear_from_srgb(*value);
        }
    }
}

/// The files in `folder` whose names match `pattern`, in natural order; at least one.
fn matching(path: &Path, folder: &Path, pattern: &str) -> Result<Vec<PathBuf>> {
    let entries = std::fs::read_dir(folder).map_err(|error| unreadable(folder, &error))?;
    let mut files = Vec::new();
    for entry in entries {
        let file = entry.map_err(|error| unreadable(folder, &error))?.path();
        let name = file.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
        if matches(pattern.to_lowercase().as_bytes(), name.as_bytes()) && file.is_file() {
            files.push(file);
        }
    }
    if files.is_empty() {
        let message = format!("no file matches `{pattern}`");
        return Err(Error::input(path, message)
            .with_help("name a folder of PNG images, or a pattern such as slice_*.png"));
    }
    files.sort_by(|a, b| natural_order(a.file_name(), b.file_name()));
    Ok(files)
}

/// Whether `name` is like `pattern`, in which `*` stands for any bytes and `?` for any one.
fn matches(pattern: &[u8], name: &[u8]) -> bool {
    // The last star, and where in the name what it stands for ends: greedy, with one step of regret.
    let (mut p, mut n) = (0, 0);
    let mut star = None;
    while n < name.len() {
        match pattern.get(p) {
            Some(b'*') => {
                star = Some((p, n));
                p += 1;
            }
            Some(&wanted) if wanted == b'?' || wanted == name[n] => {
                p += 1;
                n += 1;
            }
            _ => {
                let Some((at, end)) = star else { return false };
                star = Some((at, end + 1));
                p = at + 1;
                n = end + 1;
            }
        }
    }
    pattern[p..].iter().all(|&rest| rest == b'*')
}

/// Runs of digits by the number they are, everything else by its bytes, and at last the names as they are.
fn natural_order(a: Option<&OsStr>, b: Option<&OsStr>) -> Ordering {
    fn key(name: &str) -> Vec<(usize, &str)> {
        let mut parts = Vec::new();
        let mut rest = name;
        while let Some(first) = rest.chars().next() {
            let digits = first.is_ascii_digit();
            let end = rest.find(|c: char| c.is_ascii_digit() != digits).unwrap_or(rest.len());
            let (part, after) = rest.split_at(end);
            // Numbers compare by their lengths first, and come before texts.
            let number = part.trim_start_matches('0');
            parts.push(if digits { (number.len(), number) } else { (usize::MAX, part) });
            rest = after;
        }
        parts
    }
    let [a, b] = [a, b].map(|name| name.unwrap_or_default().to_string_lossy());
    key(&a).cmp(&key(&b)).then_with(|| a.cmp(&b))
}

#[cfg(test)]
mod tests {
    use image::{ImageBuffer, Luma, LumaA, Rgb, Rgba};

    use super::*;

    fn save(folder: &Path, name: &str, image: DynamicImage) {
        image.save_with_format(folder.join(name), ImageFormat::Png).unwrap();
    }

    fn grey(width: u32, height: u32, value: u8) -> DynamicImage {
        ImageBuffer::from_pixel(width, height, Luma([value])).into()
    }

    #[test]
    fn layers_follow_the_natural_order_of_names() {
        let folder = tempfile::tempdir().unwrap();
        for i in [10, 2, 1, 100, 20] {
            save(folder.path(), &format!("slice_{i}.png"), grey(2, 3, i));
        }
        save(folder.path(), "other.PNG", grey(2, 3, 0));
        std::fs::write(folder.path().join("notes.txt"), "no image").unwrap();
        let values = |path: PathBuf| {
            let raw = crate::volume::read(&path).unwrap();
            let layers: Vec<_> = raw.values.chunks(6).map(|layer| (layer[0] * 255.0).round() as u8).collect();
            assert_eq!((raw.size, raw.channels), ([2, 3, layers.len() as u32], 1));
            layers
        };
        assert_eq!(values(folder.path().into()), [0, 1, 2, 10, 20, 100]);
        assert_eq!(values(folder.path().join("slice_*.png")), [1, 2, 10, 20, 100]);
        assert_eq!(values(folder.path().join("slice_??.png")), [10, 20]);
        assert_eq!(values(folder.path().join("slice_2.png")), [2]);
    }

    #[test]
    fn all_kinds_of_png_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let values = |image: DynamicImage| {
            save(folder.path(), "a.png", image);
            read(&path).unwrap().values
        };
        // Grey without alpha is data; colour is on the sRGB curve, alpha is not.
        let linear = linear_from_srgb(51.0 / 255.0);
        assert_eq!(values(ImageBuffer::from_pixel(1, 1, Luma([51u8])).into()), [0.2]);
        assert_eq!(values(ImageBuffer::from_pixel(1, 1, Luma([13107u16])).into()), [0.2]);
        assert_eq!(values(ImageBuffer::from_pixel(1, 1, LumaA([51u8, 51])).into()), [linear, 0.2]);
        assert_eq!(values(ImageBuffer::from_pixel(1, 1, LumaA([13107u16, 13107])).into()), [linear, 0.2]);
        assert_eq!(values(ImageBuffer::from_pixel(1, 1, Rgb([51u8, 0, 255])).into()), [linear, 0.0, 1.0]);
        assert_eq!(
            values(ImageBuffer::from_pixel(1, 1, Rgb([13107u16, 0, 65535])).into()),
            [linear, 0.0, 1.0]
        );
        let rgba = ImageBuffer::from_pixel(1, 1, Rgba([0u8, 51, 255, 51]));
        assert_eq!(values(rgba.into()), [0.0, linear, 1.0, 0.2]);
        let rgba = ImageBuffer::from_pixel(1, 1, Rgba([0u16, 13107, 65535, 13107]));
        assert_eq!(values(rgba.into()), [0.0, linear, 1.0, 0.2]);
    }

    #[test]
    fn the_odd_image_is_named() {
        let folder = tempfile::tempdir().unwrap();
        save(folder.path(), "1.png", grey(2, 3, 0));
        save(folder.path(), "2.png", grey(2, 3, 0));
        let odd = |image: DynamicImage| {
            save(folder.path(), "3.png", image);
            read(folder.path()).unwrap_err().to_string()
        };
        for image in [grey(3, 2, 0), ImageBuffer::from_pixel(2, 3, Luma([0u16])).into()] {
            let message = odd(image);
            assert!(message.contains("3.png: is ") && message.contains("1.png"), "{message}");
        }
    }

    #[test]
    fn patterns() {
        for (pattern, name, expected) in [
            ("a*.png", "a.png", true),
            ("a*.png", "abc.png.png", true),
            ("a*.png", "abc.jpg", false),
            ("*b*d", "abcbd", true),
            ("*b*d", "abcb", false),
            ("a?c", "abc", true),
            ("a?c", "ac", false),
            ("**", "", true),
        ] {
            assert_eq!(matches(pattern.as_bytes(), name.as_bytes()), expected, "{pattern} {name}");
        }
    }

    #[test]
    fn numbers_of_any_length_are_ordered() {
        let ordered =
            ["7a", "007b", "7b", "8", "99999999999999999999998", "99999999999999999999999", "a", "a1", "a02"];
        let mut sorted = ordered;
        sorted.reverse();
        sorted.sort_by(|a, b| natural_order(Some(OsStr::new(a)), Some(OsStr::new(b))));
        assert_eq!(sorted, ordered);
    }
}
