//! Fingerprints: 128 bits of BLAKE3 over named fields, the same on every run. Two things of one fingerprint are taken for
//! the same thing.

use std::fmt;
use std::io::Read;

use bytemuck::NoUninit;
use serde::{Deserialize, Serialize};

/// Written as 32 hexadecimal digits.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Fingerprint(String);

impl fmt::Display for Fingerprint {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.0)
    }
}

/// Takes in one field after another.
#[derive(Debug, Clone)]
pub struct Builder(blake3::Hasher);

impl Builder {
    /// Adds a field; its length goes in too, so that two fields never run into one.
    #[must_use]
    pub fn bytes(mut self, bytes: &[u8]) -> Self {
        self.0.update(&(bytes.len() as u64).to_le_bytes()).update(bytes);
        self
    }

    /// Adds a field of numbers, bit by bit.
    #[must_use]
    pub fn numbers<T: NoUninit>(self, numbers: &[T]) -> Self {
        self.bytes(bytemuck::cast_slice(numbers))
    }

    /// The fingerprint of the fields so far.
    pub fn finish(self) -> Fingerprint {
        Fingerprint(self.0.finalize().to_hex()[..32].to_owned())
    }
}

impl Fingerprint {
    /// Begins a fingerprint of a `kind` of thing; different kinds never share one.
    pub fn builder(kind: &str) -> Builder {
        Builder(blake3::Hasher::new()).bytes(kind.as_bytes())
    }

    /// Of all that can be read.
    ///
    /// # Errors
    /// Those of the reader.
    pub fn of_bytes(reader: impl Read) -> std::io::Result<Self> {
        let mut hasher = blake3::Hasher::new();
        hasher.update_reader(reader)?;
        Ok(Builder(hasher).finish())
    }
}
