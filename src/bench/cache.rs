//! The references' cache: pictures of minutes of work, kept under the [`Fingerprint`] of all that they depend on.
//!
//! A file is one line of JSON and then the picture: little-endian f32, linear premultiplied RGBA, row by
//! row from the top left. Any file of the folder may be deleted at any time.

use std::fs::File;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::file::write_whole;
use crate::fingerprint::Fingerprint;
use crate::frame::{Frame, Image};
use crate::progress::{Interrupt, Progress};
use crate::scene::Scene;
use crate::{Result, reference};

const FORMAT: &str = "mesoshell reference 1";

/// The longest header that is read, in bytes.
const LONGEST_HEADER: u64 = 1024;

/// The first line of a file.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Header {
    format: String,
    fingerprint: Fingerprint,
    width: u32,
    height: u32,
    /// What the picture took to compute.
    milliseconds: f64,
    /// Of the bytes that follow.
    checksum: Fingerprint,
}

/// A reference's picture.
#[derive(Debug, Clone)]
pub struct Cached {
    /// Linear premultiplied RGBA.
    pub image: Image,
    /// What it took to compute, whenever that was, in milliseconds.
    pub milliseconds: f64,
    /// Whether it was there already.
    pub reused: bool,
}

/// The reference's picture of the scene's own view, one pixel of every square of `every` by `every`: from `folder`, or computed and
/// kept there.
///
/// A file that is damaged is computed again, and `warnings` tells so.
///
/// # Errors
/// [`Error::Interrupted`](crate::Error::Interrupted), and [`Error::Output`](crate::Error::Output) where the picture cannot be kept.
pub fn reference(
    scene: &Scene,
    every: u32,
    fingerprint: &Fingerprint,
    folder: &Path,
    warnings: &mut Vec<String>,
    progress: &dyn Progress,
    interrupt: &Interrupt,
) -> Result<Cached> {
    let render = || reference::render_thinned(scene, &scene.view, every, progress, interrupt);
    kept(fingerprint, [scene.view.width / every, scene.view.height / every], folder, warnings, render)
}

/// As [`fn@reference`], of any picture by the reference: `render` computes it where `folder` has none of that fingerprint.
///
/// # Errors
/// [`Error::Output`](crate::Error::Output) where the picture cannot be kept, and those of `render`.
pub fn kept(
    fingerprint: &Fingerprint,
    size: [u32; 2],
    folder: &Path,
    warnings: &mut Vec<String>,
    render: impl FnOnce() -> Result<Frame>,
) -> Result<Cached> {
    let path = path(folder, fingerprint);
    if path.exists() {
        match read(&path, fingerprint, size) {
            Ok(cached) => return Ok(cached),
            Err(reason) => {
                warnings.push(format!("{}: {reason}; the reference is computed again", path.display()));
            }
        }
    }
    let frame = render()?;
    let milliseconds = frame.report.stages.iter().map(|stage| stage.milliseconds).sum();
    let cached = Cached { image: frame.image, milliseconds, reused: false };
    write(&path, fingerprint, &cached)?;
    Ok(cached)
}

/// Where a picture lies.
fn path(folder: &Path, fingerprint: &Fingerprint) -> PathBuf {
    folder.join(format!("{fingerprint}.reference"))
}

fn bytes(image: &Image) -> Vec<u8> {
    image.rgba.as_flattened().iter().flat_map(|value| value.to_le_bytes()).collect()
}

fn checksum(bytes: &[u8]) -> Fingerprint {
    Fingerprint::builder("picture").bytes(bytes).finish()
}

fn write(path: &Path, fingerprint: &Fingerprint, cached: &Cached) -> Result<()> {
    let pixels = bytes(&cached.image);
    let header = Header {
        format: FORMAT.to_owned(),
        fingerprint: fingerprint.clone(),
        width: cached.image.width,
        height: cached.image.height,
        milliseconds: cached.milliseconds,
        checksum: checksum(&pixels),
    };
    write_whole(path, |file| {
        serde_json::to_writer(&mut *file, &header)?;
        file.write_all(b"\n")?;
        file.write_all(&pixels)
    })
}

/// What the file holds, or why it is not what was kept.
fn read(path: &Path, fingerprint: &Fingerprint, [width, height]: [u32; 2]) -> Result<Cached, String> {
    let file = File::open(path).map_err(|error| error.to_string())?;
    let length = file.metadata().map_err(|error| error.to_string())?.len();
    let mut file = BufReader::new(file);
    let mut line = Vec::new();
    (&mut file).take(LONGEST_HEADER).read_until(b'\n', &mut line).map_err(|error| error.to_string())?;
    let header: Header = serde_json::from_slice(&line).map_err(|_| "the header is damaged".to_owned())?;
    let same = (header.format.as_str(), &header.fingerprint, header.width, header.height);
    if same != (FORMAT, fingerprint, width, height) {
        return Err("it is the picture of something else".to_owned());
    }
    // The sides are those of the view, not what a file claims.
    let expected = 16 * u64::from(width) * u64::from(height);
    if length != line.len() as u64 + expected {
        return Err(format!("{} bytes of pixels, expected {expected}", length - line.len() as u64));
    }
    let mut pixels = Vec::new();
    file.read_to_end(&mut pixels).map_err(|error| error.to_string())?;
    if checksum(&pixels) != header.checksum {
        return Err("the pixels are damaged".to_owned());
    }
    let (values, _) = pixels.as_chunks::<4>();
    let values: Vec<f32> = values.iter().map(|&value| f32::from_le_bytes(value)).collect();
    let (rgba, _) = values.as_chunks::<4>();
    let image = Image { width, height, rgba: rgba.to_vec() };
    Ok(Cached { image, milliseconds: header.milliseconds, reused: true })
}

#[cfg(test)]
mod tests {
    use super::super::fingerprint::tests::scene;
    use super::*;
    use crate::Error;
    use crate::progress::Silent;

    /// The picture, and the warnings on the way to it.
    fn get(scene: &Scene, folder: &Path) -> (Cached, Vec<String>) {
        let mut warnings = Vec::new();
        let fingerprint = Fingerprint::of_reference(scene, &scene.view, 1);
        let interrupt = Interrupt::default();
        let cached = reference(scene, 1, &fingerprint, folder, &mut warnings, &Silent, &interrupt).unwrap();
        (cached, warnings)
    }

    #[test]
    fn what_has_not_changed_is_reused() {
        let folder = tempfile::tempdir().unwrap();
        let scene = scene();
        let (first, _) = get(&scene, folder.path());
        let (second, warnings) = get(&scene, folder.path());
        assert!(!first.reused && second.reused && warnings.is_empty());
        assert_eq!(first.image, second.image);
        assert!(first.image.rgba.iter().any(|pixel| pixel[3] > 0.1));
        assert_eq!(first.milliseconds, second.milliseconds);

        let mut changed = scene.clone();
        std::sync::Arc::make_mut(&mut changed.volume).levels[0].texels[3][0] += 0.01;
        let (third, warnings) = get(&changed, folder.path());
        assert!(!third.reused && warnings.is_empty());
        assert_ne!(first.image, third.image);
        assert!(get(&scene, folder.path()).0.reused);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
    }

    #[test]
    fn few_pixels_are_those_of_the_whole_picture() {
        let folder = tempfile::tempdir().unwrap();
        let scene = scene();
        let whole = get(&scene, folder.path()).0.image;
        // 32 pixels are ten squares of 3 and a rest.
        let fingerprint = Fingerprint::of_reference(&scene, &scene.view, 3);
        let interrupt = Interrupt::default();
        let thinned =
            reference(&scene, 3, &fingerprint, folder.path(), &mut Vec::new(), &Silent, &interrupt).unwrap();
        assert_eq!((thinned.image.width, thinned.image.height), (10, 10));
        assert_eq!(thinned.image, whole.thinned(3));
        assert_eq!(thinned.image.rgba[11], whole.rgba[4 * 32 + 4]);
        assert_ne!(thinned.image, whole.thinned(2));
    }

    #[test]
    fn a_damaged_file_is_computed_again() {
        let folder = tempfile::tempdir().unwrap();
        let scene = scene();
        let (good, _) = get(&scene, folder.path());
        let path = path(folder.path(), &Fingerprint::of_reference(&scene, &scene.view, 1));
        let bytes = std::fs::read(&path).unwrap();
        let mut bit_flipped = bytes.clone();
        bit_flipped[bytes.len() - 777] ^= 1;
        let (header, pixels) = bytes.split_at(bytes.len() - 16 * 32 * 32);
        let header = String::from_utf8(header.to_vec()).unwrap();
        let claims = header.replace("\"width\":32", "\"width\":4294967295");
        assert_ne!(claims, header);
        let claims = [claims.as_bytes(), pixels].concat();
        let longer = [bytes.as_slice(), b"x"].concat();
        let damaged: [(&[u8], &str); 6] = [
            (&bytes[..bytes.len() - 1], "expected 16384"),
            (&longer, "expected 16384"),
            (&bit_flipped, "damaged"),
            (&claims, "something else"),
            (b"", "header"),
            (&bytes[1..], "header"),
        ];
        for (damaged, part) in damaged {
            std::fs::write(&path, damaged).unwrap();
            let (again, warnings) = get(&scene, folder.path());
            assert!(!again.reused && again.image == good.image);
            assert!(warnings.len() == 1 && warnings[0].contains(part), "{warnings:?}");
            assert!(get(&scene, folder.path()).0.reused);
        }
    }

    #[test]
    fn a_folder_that_cannot_be_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        std::fs::write(&file, "").unwrap();
        let (scene, interrupt) = (scene(), Interrupt::default());
        let fingerprint = Fingerprint::of_reference(&scene, &scene.view, 1);
        let error =
            reference(&scene, 1, &fingerprint, &file, &mut Vec::new(), &Silent, &interrupt).unwrap_err();
        assert!(matches!(error, Error::Output { .. }), "{error}");
    }
}
