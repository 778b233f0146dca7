//! Image files: PNG (8-bit sRGB, for people) and OpenEXR (linear premultiplied f32, for measuring). Backgrounds may be JPEG.
//!
//! Files are written beside their final name and then renamed, so that there is never half a file
//! under that name. Sizes that a file claims are checked against its length before memory is asked for.

mod exr_header;
mod mark;
mod picture;

use std::fs::File;
use std::io::{BufReader, Write};
use std::path::Path;

use image::codecs::openexr::OpenExrDecoder;
use image::codecs::png::{PngDecoder, PngEncoder};
use image::{DynamicImage, ExtendedColorType, ImageDecoder, ImageEncoder, ImageError, Limits};
use rayon::prelude::*;

pub use mark::{is_whole, mark};
pub use picture::{is_picture, read_picture};

use super::srgb::{linear_from_srgb, srgb_from_linear};
use super::{Backdrop, Behind, Image};
use crate::{Error, Result, input, output};

/// The most pixels that are read: 4 GiB of f32 RGBA.
const MOST_PIXELS: u64 = 1 << 28;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Format {
    Png,
    Exr,
}

impl Format {
    fn of(path: &Path) -> Result<Self> {
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
        match extension.as_deref() {
            Some("png") => Ok(Self::Png),
            Some("exr") => Ok(Self::Exr),
            _ => Err(Error::Usage {
                message: format!("{}: images are written and read as .png or .exr", path.display()),
                help: Some("give the file one of these extensions".into()),
            }),
        }
    }
}

/// Finds out, before hours of work, whether [`write()`] can work: the extension is known and a file can
/// be made in the directory.
///
/// # Errors
/// [`Error::Usage`] for an unknown extension, [`Error::Output`] for the rest.
pub fn check_writable(path: impl AsRef<Path>) -> Result<()> {
    let path = path.as_ref();
    Format::of(path)?;
    output::file_beside(path).map(drop)
}

/// Writes an image as the file's extension says, in place of any file of that name.
///
/// EXR keeps every bit of the linear premultiplied RGBA; `backdrop` is not used. PNG is sRGB with 8 bits a
/// channel: over what is [behind](Backdrop::behind) and opaque where there is something, else with straight alpha.
/// Values that are outside 0..=1 once exposed are clamped there.
///
/// # Errors
/// [`Error::Usage`] for an unknown extension, [`Error::Output`] when the file cannot be written, or when
/// an image with values that are not numbers is to become a PNG.
pub fn write(path: impl AsRef<Path>, image: &Image, backdrop: &Backdrop) -> Result<()> {
    write_marked(path.as_ref(), image, backdrop, None)
}

/// Writes an image as [`write()`] does, with a [`mark`] in the file.
///
/// # Errors
/// As [`write()`].
pub fn write_marked(path: &Path, image: &Image, backdrop: &Backdrop, mark: Option<&str>) -> Result<()> {
    let format = Format::of(path)?;
    let mut bytes = Vec::new();
    let encoded = match format {
        Format::Png => {
            check_numbers(path, image)?;
            write_png(&mut bytes, image, backdrop).map_err(|error| error.to_string())
        }
        Format::Exr => mark::write_exr(&mut bytes, image, mark),
    };
    encoded.map_err(|error| output::error(path, format!("cannot be encoded: {error}")))?;
    if let (Format::Png, Some(mark)) = (format, mark) {
        bytes = mark::in_png(bytes, mark);
    }
    let mut file = output::file_beside(path)?;
    file.as_file_mut().write_all(&bytes).map_err(|error| output::unwritable(path, &error))?;
    output::keep(file, path)
}

/// Reads an image: EXR as linear premultiplied RGBA, PNG as sRGB (whatever profile it names) with straight
/// alpha. Where there is no alpha it is 1.
///
/// # Errors
/// [`Error::Usage`] for an unknown extension, [`Error::Input`] when the file cannot be read, is damaged,
/// or claims a size that it cannot hold or that is beyond 2^28 pixels.
pub fn read(path: impl AsRef<Path>) -> Result<Image> {
    let path = path.as_ref();
    let format = Format::of(path)?;
    let (mut file, length) = open(path)?;
    let damaged = |error: ImageError| damaged(path, &error);
    match format {
        Format::Png => {
            // The default limits bound what is not the image: its profile may not swell beyond 512 MiB.
            let decoder = PngDecoder::with_limits(file, Limits::default()).map_err(damaged)?;
            // Bilevel images have eight pixels a byte.
            decode_srgb(path, decoder, length, 8)
        }
        Format::Exr => {
            for size in exr_header::sizes(path, &mut file)? {
                check_size(path, size, length, 1)?;
            }
            let decoder = OpenExrDecoder::with_alpha_preference(file, Some(true)).map_err(damaged)?;
            let (width, height) = decoder.dimensions();
            let mut rgba = Image::new(width, height).rgba;
            decoder.read_image(bytemuck::cast_slice_mut(&mut rgba)).map_err(damaged)?;
            Ok(Image { width, height, rgba })
        }
    }
}

fn open(path: &Path) -> Result<(BufReader<File>, u64)> {
    let (file, length) =
        input::open(path).map_err(|error| Error::input(path, format!("cannot be read: {error}")))?;
    Ok((BufReader::new(file), length))
}

fn damaged(path: &Path, error: &ImageError) -> Error {
    Error::input(path, format!("cannot be decoded: {error}"))
        .with_help("is it complete, and what its extension says?")
}

fn decode_srgb(path: &Path, decoder: impl ImageDecoder, length: u64, pixels_per_byte: u64) -> Result<Image> {
    let (width, height) = decoder.dimensions();
    check_size(path, [width.into(), height.into()], length, pixels_per_byte)?;
    let decoded = DynamicImage::from_decoder(decoder).map_err(|error| damaged(path, &error))?.into_rgba32f();
    let rgba = decoded.pixels().map(|pixel| premultiplied_from_srgb(pixel.0)).collect();
    Ok(Image { width, height, rgba })
}

/// Whether a PNG can be made of an image.
pub(crate) fn check_numbers(path: &Path, image: &Image) -> Result<()> {
    match image.rgba.iter().position(|pixel| pixel.iter().any(|x| x.is_nan())) {
        None => Ok(()),
        Some(index) => {
            let (x, y) = (index % image.width as usize, index / image.width as usize);
            Err(output::error(path, format!("pixel ({x}, {y}) is not a number, and a PNG cannot say so"))
                .with_help("write an EXR to see what is there"))
        }
    }
}

/// The PNG that [`write()`] makes of an image without values that are not numbers.
pub(crate) fn write_png(writer: impl Write, image: &Image, backdrop: &Backdrop) -> Result<(), ImageError> {
    let (width, height) = (image.width, image.height);
    let encoder = PngEncoder::new(writer);
    let byte = |x: f32| (255.0 * x.clamp(0.0, 1.0)).round() as u8;
    let srgb_byte = |linear: f32| byte(srgb_from_linear(linear.clamp(0.0, 1.0)));
    let develop = backdrop.develop(width, height);
    let developed = image.rgba.par_iter().enumerate().map(|(index, &pixel)| develop(index, pixel));
    if backdrop.behind == Behind::Nothing {
        let straight = |[r, g, b, a]: [f32; 4]| {
            // Where nothing that is left covers the pixel, colour has no meaning.
            let alpha = byte(a);
            let [r, g, b] = [r, g, b].map(|x| if alpha > 0 { srgb_byte(x / a) } else { 0 });
            [r, g, b, alpha]
        };
        let pixels: Vec<[u8; 4]> = developed.map(straight).collect();
        encoder.write_image(pixels.as_flattened(), width, height, ExtendedColorType::Rgba8)
    } else {
        let pixels: Vec<[u8; 3]> = developed.map(|[r, g, b, _]| [r, g, b].map(srgb_byte)).collect();
        encoder.write_image(pixels.as_flattened(), width, height, ExtendedColorType::Rgb8)
    }
}

/// Red, green and blue of every pixel, sRGB of 8 bits, as a PNG shows them; laid on black where the backdrop is none.
///
/// # Errors
/// [`Error::Output`] where a value is not a number.
pub fn opaque_srgb(image: &Image, backdrop: &Backdrop) -> Result<Vec<u8>> {
    check_numbers(Path::new("the frame"), image)?;
    let byte = |x: f32| (255.0 * srgb_from_linear(x.clamp(0.0, 1.0)).clamp(0.0, 1.0)).round() as u8;
    let develop = backdrop.develop(image.width, image.height);
    let developed = image.rgba.par_iter().enumerate().map(|(index, &pixel)| develop(index, pixel));
    let pixels: Vec<[u8; 3]> = developed.map(|[r, g, b, _]| [r, g, b].map(byte)).collect();
    Ok(pixels.into_flattened())
}

fn premultiplied_from_srgb([r, g, b, a]: [f32; 4]) -> [f32; 4] {
    let [r, g, b] = [r, g, b].map(|x| linear_from_srgb(x) * a);
    [r, g, b, a]
}

/// Whether a file of `length` bytes can hold `size` pixels of at least `1 / pixels_per_byte` bytes.
fn check_size(path: &Path, size: [u64; 2], length: u64, pixels_per_byte: u64) -> Result<()> {
    let [width, height] = size;
    // Both sides are below 2^32.
    let pixels = width * height;
    if pixels > MOST_PIXELS {
        let message = format!("claims {width}x{height} pixels, but at most 2^28 are read");
        return Err(Error::input(path, message).with_help("if the image is really that large, scale it down"));
    }
    let most = length.saturating_mul(input::MAX_DEFLATE_RATIO).saturating_mul(pixels_per_byte);
    if pixels > most {
        let message = format!("claims {width}x{height} pixels, but {length} bytes cannot hold them");
        return Err(Error::input(path, message).with_help("the file is damaged or cut off: make it again"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;
    use std::sync::Arc;

    use rand::RngExt;
    use rand_pcg::Pcg32;
    use tempfile::TempDir;

    use super::*;

    fn folder() -> TempDir {
        tempfile::tempdir().unwrap()
    }

    /// Premultiplied noise with transparent, opaque and partly covered pixels.
    fn noise(width: u32, height: u32) -> Image {
        let mut random = Pcg32::new(11, 11);
        let mut image = Image::new(width, height);
        image.rgba.fill_with(|| {
            let a = (1.5 * random.random::<f32>() - 0.25).clamp(0.0, 1.0);
            [a * random.random::<f32>(), a * random.random::<f32>(), a * random.random::<f32>(), a]
        });
        image
    }

    fn written(folder: &TempDir, name: &str, image: &Image, backdrop: &Backdrop) -> PathBuf {
        let path = folder.path().join(name);
        write(&path, image, backdrop).unwrap();
        path
    }

    #[test]
    fn exr_keeps_every_bit() {
        let folder = folder();
        let mut image = noise(33, 70);
        image.rgba[0] = [-1.5, 1e-40, f32::MAX, 0.0];
        let path = written(&folder, "a.EXR", &image, &Backdrop::colour([1.0; 3]));
        let bits = |image: &Image| image.rgba.iter().map(|pixel| pixel.map(f32::to_bits)).collect::<Vec<_>>();
        assert_eq!(bits(&read(path).unwrap()), bits(&image));
    }

    #[test]
    fn png_is_straight_srgb() {
        let folder = folder();
        let mut image = Image::new(2, 2);
        // Half covered by linear 0.2, that is sRGB 0.4845; opaque; beyond the range; nothing.
        image.rgba = vec![[0.1, 0.1, 0.0, 0.5], [1.0, 0.0, 0.2, 1.0], [2.0, -1.0, 0.0, 1.0], [0.0; 4]];
        let decoded = image::open(written(&folder, "a.png", &image, &Backdrop::default())).unwrap();
        let DynamicImage::ImageRgba8(decoded) = decoded else { panic!("{:?}", decoded.color()) };
        let expected =
            [[124, 124, 0, 128], [255, 0, 124, 255], [255, 0, 0, 255], [0, 0, 0, 0]].as_flattened().to_vec();
        assert_eq!(decoded.into_raw(), expected);
    }

    #[test]
    fn png_over_a_background_is_opaque() {
        let folder = folder();
        let mut image = Image::new(2, 1);
        // 0.1 + (1 - 0.5) 0.2 = 0.2 again; nothing, over linear 0.2.
        image.rgba = vec![[0.1, 0.1, 0.1, 0.5], [0.0; 4]];
        let decoded = image::open(written(&folder, "a.png", &image, &Backdrop::colour([0.2; 3]))).unwrap();
        let DynamicImage::ImageRgb8(decoded) = decoded else { panic!("{:?}", decoded.color()) };
        assert_eq!(decoded.into_raw(), [124; 6]);
    }

    #[test]
    fn png_over_a_picture_is_opaque() {
        let folder = folder();
        let mut image = Image::new(2, 1);
        image.rgba[0] = [0.1, 0.1, 0.1, 0.5];
        // 0.1 + (1 - 0.5) 0.2 = 0.2; nothing, over 1, 0, 4.
        let sky = Image { width: 2, height: 1, rgba: vec![[0.2, 0.2, 0.2, 1.0], [1.0, 0.0, 4.0, 1.0]] };
        let backdrop = Backdrop { behind: Behind::Picture(Arc::new(sky)), exposure: 0.0 };
        let decoded = image::open(written(&folder, "a.png", &image, &backdrop)).unwrap();
        let DynamicImage::ImageRgb8(decoded) = decoded else { panic!("{:?}", decoded.color()) };
        assert_eq!(decoded.into_raw(), [124, 124, 124, 255, 0, 255]);
    }

    #[test]
    fn exposure_multiplies_colours_and_leaves_alpha() {
        let folder = folder();
        let image = Image { width: 2, height: 1, rgba: vec![[0.025, 0.025, 0.0, 0.5], [0.0; 4]] };
        let pixels = |backdrop: Backdrop| {
            let path = written(&folder, "a.png", &image, &Backdrop { exposure: 2.0, ..backdrop });
            image::open(path).unwrap().into_rgba8().into_raw()
        };
        // Straight 0.05 becomes 0.2; what covers half over 0.15 becomes 4 (0.025 + 0.075), or 4 times 0.075 alone.
        assert_eq!(pixels(Backdrop::default()), [124, 124, 0, 128, 0, 0, 0, 0]);
        assert_eq!(pixels(Backdrop::colour([0.15; 3])), [170, 170, 149, 255, 203, 203, 203, 255]);
        let path = written(&folder, "a.exr", &image, &Backdrop { exposure: 2.0, ..Backdrop::default() });
        assert_eq!(read(path).unwrap(), image);
    }

    #[test]
    fn png_comes_back_to_within_its_steps() {
        let folder = folder();
        let image = noise(40, 25);
        let path = written(&folder, "a.png", &image, &Backdrop::default());
        let back = read(&path).unwrap();
        // Colour is off by half a step of sRGB, whose slope is at most 2.4 / 1.055, alpha by half a step.
        let bound = 0.5 / 255.0 * (2.4 / 1.055 + 1.0) + 1e-6;
        let mut compared = 0;
        for (a, b) in image.rgba.iter().flatten().zip(back.rgba.iter().flatten()) {
            assert!((a - b).abs() < bound, "{a} came back as {b}");
            compared += 1;
        }
        assert_eq!(compared, 4 * 40 * 25);
        // What has been rounded once stays.
        let again = written(&folder, "b.png", &back, &Backdrop::default());
        assert!(std::fs::read(path).unwrap() == std::fs::read(again).unwrap());
    }

    #[test]
    fn nothing_is_left_but_the_file() {
        let folder = folder();
        let mut image = noise(4, 4);
        written(&folder, "a.png", &image, &Backdrop::default());
        let before = std::fs::read(folder.path().join("a.png")).unwrap();
        image.rgba[6][1] = f32::NAN;
        let error = write(folder.path().join("a.png"), &image, &Backdrop::default()).unwrap_err();
        assert!(error.to_string().contains("pixel (2, 1)"), "{error}");
        assert_eq!(std::fs::read(folder.path().join("a.png")).unwrap(), before, "the old file stays");
        check_writable(folder.path().join("new.exr")).unwrap();
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[cfg(unix)]
    #[test]
    fn files_are_as_readable_as_any_other() {
        use std::os::unix::fs::PermissionsExt;
        let folder = folder();
        let mode = |path: PathBuf| std::fs::metadata(path).unwrap().permissions().mode();
        let plain = folder.path().join("plain");
        std::fs::write(&plain, "").unwrap();
        assert_eq!(mode(written(&folder, "a.png", &noise(2, 2), &Backdrop::default())), mode(plain));
    }

    #[test]
    fn what_cannot_be_written_is_known_before() {
        let folder = folder();
        for name in ["a.jpg", "a", "png"] {
            assert_eq!(check_writable(folder.path().join(name)).unwrap_err().exit_code(), 2, "{name}");
        }
        let missing = check_writable(folder.path().join("no/such/a.png")).unwrap_err();
        assert_eq!(missing.exit_code(), 6);
        std::fs::create_dir(folder.path().join("b.png")).unwrap();
        assert_eq!(check_writable(folder.path().join("b.png")).unwrap_err().exit_code(), 6);
        assert!(write(folder.path().join("b.png"), &noise(2, 2), &Backdrop::default()).is_err());
    }

    #[test]
    fn unreadable_files_are_input_errors() {
        let folder = folder();
        assert_eq!(read(folder.path().join("no.png")).unwrap_err().exit_code(), 3);
        for name in ["a.png", "a.exr"] {
            std::fs::write(folder.path().join(name), "not an image at all, whatever its name").unwrap();
            assert_eq!(read(folder.path().join(name)).unwrap_err().exit_code(), 3);
        }
    }

    #[test]
    fn a_header_that_lies_about_its_size_is_refused() {
        let folder = folder();
        let image = noise(5, 3);
        let refusal = |path: &Path, bytes: &[u8]| {
            std::fs::write(path, bytes).unwrap();
            read(path).unwrap_err().to_string()
        };

        let path = written(&folder, "a.png", &image, &Backdrop::default());
        let good = std::fs::read(&path).unwrap();
        let with_size = |width: u32, height: u32| {
            let mut bytes = good.clone();
            bytes[16..20].copy_from_slice(&width.to_be_bytes());
            bytes[20..24].copy_from_slice(&height.to_be_bytes());
            let checksum = png_checksum(&bytes[12..29]);
            bytes[29..33].copy_from_slice(&checksum.to_be_bytes());
            bytes
        };
        assert_eq!(with_size(5, 3), good, "the checksum is right");
        assert!(refusal(&path, &with_size(1 << 15, 1 << 15)).contains("at most 2^28"));
        assert!(refusal(&path, &with_size(1 << 14, 1 << 14)).contains("cannot hold them"));

        let path = written(&folder, "a.exr", &image, &Backdrop::default());
        let good = std::fs::read(&path).unwrap();
        for name in ["dataWindow\0box2i\0", "displayWindow\0box2i\0"] {
            let at = good.windows(name.len()).position(|bytes| bytes == name.as_bytes()).unwrap();
            // After the name and type, the size of the value, and the smallest x and y.
            let at = at + name.len() + 4 + 8;
            let with_corner = |x: i32, y: i32| {
                let mut bytes = good.clone();
                bytes[at..at + 4].copy_from_slice(&x.to_le_bytes());
                bytes[at + 4..at + 8].copy_from_slice(&y.to_le_bytes());
                bytes
            };
            assert_eq!(with_corner(4, 2), good, "the largest x and y are where they are thought to be");
            assert!(refusal(&path, &with_corner(i32::MAX, i32::MAX)).contains("at most 2^28"));
            assert!(refusal(&path, &with_corner((1 << 14) - 1, (1 << 14) - 1)).contains("cannot hold them"));
            assert!(refusal(&path, &with_corner(-5, 2)).contains("has no size"));
        }
    }

    /// The CRC-32 of a PNG chunk.
    fn png_checksum(bytes: &[u8]) -> u32 {
        let mut crc = flate2::Crc::new();
        crc.update(bytes);
        crc.sum()
    }

    #[test]
    fn damaged_files_neither_panic_nor_pass_as_another_size() {
        let folder = folder();
        let image = noise(9, 7);
        let mut random = Pcg32::new(13, 13);
        let mut refused = 0;
        for name in ["a.png", "a.exr"] {
            let path = written(&folder, name, &image, &Backdrop::default());
            let good = std::fs::read(&path).unwrap();
            for trial in 0..600 {
                let mut bytes = good.clone();
                if trial % 2 == 0 {
                    bytes.truncate(random.random_range(0..good.len()));
                } else {
                    // Headers are where damage is worst.
                    for _ in 0..4 {
                        let at = random.random_range(0..good.len().min(400));
                        bytes[at] = random.random();
                    }
                }
                std::fs::write(&path, &bytes).unwrap();
                match read(&path) {
                    Ok(image) => assert_eq!(image.rgba.len(), image.width as usize * image.height as usize),
                    Err(error) => {
                        assert_eq!(error.exit_code(), 3, "{error}");
                        refused += 1;
                    }
                }
            }
        }
        assert!(refused > 600, "only {refused} of 1200 damaged files were noticed");
    }
}
