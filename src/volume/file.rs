//! Volume files of any supported kind.

use std::io::Read as _;
use std::path::Path;

use super::raw::{open, unreadable};
use super::{RawVolume, VolumeInfo, ktx2_file, nrrd, recipe, stack};
use crate::{Error, Result};

const PNG_MAGIC: &[u8] = b"\x89PNG\r\n\x1a\n";

/// Reads a KTX2 file, an NRRD file (attached or detached header), a PNG, a folder of PNGs or a pattern of them
/// (`slice_*.png`); files are told apart by their first bytes, not by their names.
///
/// # Errors
/// [`Error::Input`] where the file is missing, damaged or of another kind, and
/// [`Error::OutOfMemory`] where it holds more than 2^28 texels.
pub fn read(path: &Path) -> Result<RawVolume> {
    if path.is_dir() || stack::is_pattern(path) {
        return stack::read(path);
    }
    let mut magic = Vec::new();
    let (file, _) = open(path)?;
    file.take(ktx2::MAGIC.len() as u64).read_to_end(&mut magic).map_err(|error| unreadable(path, &error))?;
    if magic == ktx2::MAGIC {
        ktx2_file::read(path)
    } else if magic.starts_with(nrrd::MAGIC) {
        nrrd::read(path)
    } else if magic.starts_with(PNG_MAGIC) {
        stack::read(path)
    } else {
        let error = Error::input(path, "is no volume: it does not begin as a KTX2, NRRD or PNG file does");
        Err(error.with_help("read a 3D KTX2 texture, an NRRD file, or a folder or pattern of PNG slices"))
    }
}

/// The texels along u, v, w of the volume at `path`: of a KTX2 file from its header alone.
///
/// # Errors
/// As [`read`].
pub fn size(path: &Path) -> Result<[u32; 3]> {
    if path.is_file() {
        let mut magic = Vec::new();
        let (file, _) = open(path)?;
        let length = ktx2::MAGIC.len() as u64;
        file.take(length).read_to_end(&mut magic).map_err(|error| unreadable(path, &error))?;
        if magic == ktx2::MAGIC {
            return ktx2_file::size(path);
        }
    }
    read(path).map(|raw| raw.size)
}

/// What the volume at `path` is, read whole, so that its ranges are known; a recipe, a file whose name ends in `.toml`,
/// is computed, and its colours are premultiplied.
///
/// # Errors
/// As [`read`], and as [`recipe::load`] and [`Recipe::build`](recipe::Recipe::build).
pub fn info(path: &Path) -> Result<VolumeInfo> {
    Ok(read_or_make(path)?.info())
}

/// Reads a volume file as [`read`] does, or computes a recipe, which is a file whose name ends in `.toml`.
///
/// # Errors
/// As [`read`], and as [`recipe::load`] and [`Recipe::build`](recipe::Recipe::build).
pub fn read_or_make(path: &Path) -> Result<RawVolume> {
    if !is_recipe(path) {
        return read(path);
    }
    let recipe = recipe::load(path)?;
    let format = format!("recipe \"{}\"", recipe.header().recipe);
    Ok(RawVolume::of(recipe.build()?, path, format))
}

/// Whether a path is that of a recipe.
pub fn is_recipe(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("toml")) && !path.is_dir()
}
