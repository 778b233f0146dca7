//! Marks in pictures by which a later run knows that they are up to date: a fingerprint of all that makes a frame, in a text chunk
//! of a PNG (`tEXt`) or an attribute of an EXR, both called `mesoshell-frame`.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use crate::frame::file;
use crate::scene::FrameInputs;
use crate::{Error, Result, input};

/// Makes the marks of frames.
#[derive(Debug)]
pub struct Marker {
    /// Of all that makes them beside their scenes.
    making: blake3::Hash,
    /// Of files: each is read once.
    hashes: HashMap<PathBuf, blake3::Hash>,
}

impl Marker {
    /// For frames that this program makes by the `method` of that name on a device; `size` where it is not the scene's.
    ///
    /// # Errors
    /// [`Error::Input`] where the program's file cannot be read: any other build may draw another picture.
    pub fn new(method: &str, device: &str, size: Option<[u32; 2]>) -> Result<Self> {
        let program = std::env::current_exe()
            .map_err(|error| Error::input("the program", format!("cannot be found: {error}")))?;
        let mut fields = Fields(blake3::Hasher::new());
        fields.add(of_file(&program)?.as_bytes());
        fields.add(method.as_bytes());
        fields.add(device.as_bytes());
        fields.add(bytemuck::bytes_of(&size.unwrap_or_default()));
        Ok(Self { making: fields.0.finalize(), hashes: HashMap::new() })
    }

    /// The mark of a frame: 32 hexadecimal digits, the same on every run.
    ///
    /// # Errors
    /// [`Error::Input`] where a file that the scene names cannot be read.
    pub fn mark(&mut self, inputs: &FrameInputs) -> Result<String> {
        let mut fields = Fields(blake3::Hasher::new());
        fields.add(self.making.as_bytes());
        fields.add(inputs.text.as_bytes());
        for path in &inputs.files {
            let hash = match self.hashes.get(path) {
                Some(hash) => *hash,
                None => of_file(path)?,
            };
            self.hashes.insert(path.clone(), hash);
            fields.add(path.to_string_lossy().as_bytes());
            fields.add(hash.as_bytes());
        }
        Ok(fields.0.finalize().to_hex()[..32].to_owned())
    }
}

struct Fields(blake3::Hasher);

impl Fields {
    /// The length goes in first, so that two fields never run into one.
    fn add(&mut self, field: &[u8]) {
        self.0.update(&(field.len() as u64).to_le_bytes()).update(field);
    }
}

fn of_file(path: &Path) -> Result<blake3::Hash> {
    let unreadable = |error: std::io::Error| Error::input(path, format!("cannot be read: {error}"));
    let (file, _) = input::open(path).map_err(unreadable)?;
    let mut hasher = blake3::Hasher::new();
    hasher.update_reader(file).map_err(unreadable)?;
    Ok(hasher.finalize())
}

/// Whether the picture at `path` bears this mark: is there, whole, and up to date.
pub fn is_on(path: &Path, mark: &str) -> bool {
    file::mark(path).is_some_and(|found| found == mark)
}
