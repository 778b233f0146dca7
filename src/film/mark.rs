//! Marks in pictures by which a later run knows that they are up to date: a fingerprint of all that makes a frame, in a text chunk
//! of a PNG (`tEXt`) or an attribute of an EXR, both called `mesoshell-frame`.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use crate::fingerprint::{Builder, Fingerprint};
use crate::frame::file;
use crate::scene::FrameInputs;
use crate::{Error, Result, input};

/// Makes the marks of frames.
#[derive(Debug)]
pub struct Marker {
    /// With all that makes them beside their scenes.
    making: Builder,
    /// Of files: each is read once.
    files: HashMap<PathBuf, Fingerprint>,
}

impl Marker {
    /// For frames that this program makes by the `method` of that name on a device; `size` where it is not the scene's.
    ///
    /// # Errors
    /// [`Error::Input`] where the program's file cannot be read: any other build may draw another picture.
    pub fn new(method: &str, device: &str, size: Option<[u32; 2]>) -> Result<Self> {
        let program = std::env::current_exe()
            .map_err(|error| Error::input("the program", format!("cannot be found: {error}")))?;
        let making = Fingerprint::builder("frame")
            .bytes(of_file(&program)?.to_string().as_bytes())
            .bytes(method.as_bytes())
            .bytes(device.as_bytes())
            .numbers(&size.unwrap_or_default());
        Ok(Self { making, files: HashMap::new() })
    }

    /// The mark of a frame: the same on every run.
    ///
    /// # Errors
    /// [`Error::Input`] where a file that the scene names cannot be read.
    pub fn mark(&mut self, inputs: &FrameInputs) -> Result<String> {
        let mut mark = self.making.clone().bytes(inputs.text.as_bytes());
        for path in &inputs.files {
            if !self.files.contains_key(path) {
                self.files.insert(path.clone(), of_file(path)?);
            }
            let content = self.files[path].to_string();
            mark = mark.bytes(path.to_string_lossy().as_bytes()).bytes(content.as_bytes());
        }
        Ok(mark.finish().to_string())
    }
}

fn of_file(path: &Path) -> Result<Fingerprint> {
    let read = input::open(path).and_then(|(file, _)| Fingerprint::of_bytes(file));
    read.map_err(|error| Error::input(path, format!("cannot be read: {error}")))
}

/// Whether the picture at `path` bears this mark: is there, whole, and up to date.
pub fn is_on(path: &Path, mark: &str) -> bool {
    file::mark(path).is_some_and(|found| found == mark) && file::is_whole(path)
}
