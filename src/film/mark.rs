//! Marks in pictures by which a later run knows that they are up to date: a fingerprint of all that makes a frame, in a text chunk
//! of a PNG (`tEXt`) or an attribute of an EXR, both called `mesoshell-frame`.

use std::path::Path;

use crate::frame::file;
use crate::scene::FrameInputs;
use crate::{Error, Result, input};

/// What makes a frame beside its scene.
#[derive(Debug, Clone)]
pub struct Making<'a> {
    /// The name of the method.
    pub method: &'a str,
    /// The name of the device, with its driver's.
    pub device: &'a str,
    /// Pixels across and down, where they are not the scene's.
    pub size: Option<[u32; 2]>,
    /// Of the program: see [`of_program`].
    pub program: blake3::Hash,
}

/// Of the program that runs: any other build may draw another picture.
///
/// # Errors
/// [`Error::Input`] where it cannot be read.
pub fn of_program() -> Result<blake3::Hash> {
    let path = std::env::current_exe()
        .map_err(|error| Error::input("the program", format!("cannot be found: {error}")))?;
    of_file(&path)
}

fn of_file(path: &Path) -> Result<blake3::Hash> {
    let unreadable = |error: std::io::Error| Error::input(path, format!("cannot be read: {error}"));
    let (file, _) = input::open(path).map_err(unreadable)?;
    let mut hasher = blake3::Hasher::new();
    hasher.update_reader(file).map_err(unreadable)?;
    Ok(hasher.finalize())
}

/// The mark of a frame: 32 hexadecimal digits, the same on every run.
///
/// # Errors
/// [`Error::Input`] where a file that the scene names cannot be read.
pub fn of_frame(inputs: &FrameInputs, making: &Making<'_>) -> Result<String> {
    let mut hasher = blake3::Hasher::new();
    let mut add = |field: &[u8]| {
        // The length first, so that two fields never run into one.
        hasher.update(&(field.len() as u64).to_le_bytes()).update(field);
    };
    add(making.program.as_bytes());
    add(making.method.as_bytes());
    add(making.device.as_bytes());
    add(bytemuck::bytes_of(&making.size.unwrap_or_default()));
    add(inputs.text.as_bytes());
    for path in &inputs.files {
        add(path.to_string_lossy().as_bytes());
        add(of_file(path)?.as_bytes());
    }
    Ok(hasher.finalize().to_hex()[..32].to_owned())
}

/// Whether the picture at `path` bears this mark: is there, whole, and up to date.
pub fn is_on(path: &Path, mark: &str) -> bool {
    file::mark(path).is_some_and(|found| found == mark)
}
