//! What a glTF file says, and the bytes that it says it of.
//!
//! The crate `gltf` takes a file to be sound once it has validated it; that panics at some damaged files, and refuses sound
//! ones. So its types are filled in without, and each index is checked where it is used.

use std::cell::Cell;
use std::io::Read;
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::engine::general_purpose::STANDARD_NO_PAD;
use gltf::json::{Index, Root, root::Get};
use serde::Deserialize;
use serde_json::Value;

use crate::{Error, Result, input};

/// In bytes, of a file with all that it names.
const LONGEST_FILE: u64 = 1 << 31;

/// How many numbers are taken out of a file: those of some four million vertices with all that they can have. A short file can
/// name the same bytes any number of times.
const MOST_NUMBERS: u64 = 1 << 26;

const MAGIC: &[u8] = b"glTF";

/// Of the header, with the head of the first chunk.
const GLB_HEAD: usize = 20;

/// What a reader need not know to find the triangles, or what is known: beginnings of names.
const EXTENSIONS: [&str; 6] = [
    "KHR_materials_",
    "KHR_texture_basisu",
    TEXTURE_TRANSFORM,
    "EXT_texture_",
    "KHR_lights_punctual",
    "KHR_mesh_quantization",
];

/// Moves texture coordinates, but by the material: where it is needed, those of the file alone are of no use.
const TEXTURE_TRANSFORM: &str = "KHR_texture_transform";

/// A file that was read.
pub(super) struct Document {
    pub path: PathBuf,
    pub root: Root,
    pub buffers: Vec<Vec<u8>>,
    numbers_left: Cell<u64>,
}

impl Document {
    /// Reads a file in text or binary, and the files that it names.
    ///
    /// # Errors
    /// [`Error::Input`] when it or one of those cannot be read, is damaged, or needs an extension that is not known.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = input::bytes(path, LONGEST_FILE)
            .map_err(|error| Error::input(path, format!("cannot be read: {error}")))?;
        let (json, chunk) = if bytes.starts_with(MAGIC) { binary(path, &bytes)? } else { (&bytes[..], None) };
        let root = root_of(without_mark(json))
            .map_err(|error| damaged(path, format!("is not a readable glTF file: {error}")))?;
        check_kind(path, &root)?;
        let mut left = LONGEST_FILE;
        let mut buffers = Vec::new();
        for (index, buffer) in root.buffers.iter().enumerate() {
            let length = buffer.byte_length.0;
            left = left.checked_sub(length).ok_or_else(|| {
                damaged(path, format!("its buffers are longer than {} MiB", LONGEST_FILE >> 20))
            })?;
            let mut bytes = match (&buffer.uri, chunk) {
                (Some(uri), _) => uri_bytes(path, uri, length, index)?,
                (None, Some(chunk)) if index == 0 => chunk.to_vec(),
                _ => {
                    return Err(damaged(
                        path,
                        format!("buffer {index} has neither a `uri` nor a binary chunk"),
                    ));
                }
            };
            if (bytes.len() as u64) < length {
                let message = format!("buffer {index} has {} bytes, but should have {length}", bytes.len());
                return Err(damaged(path, message));
            }
            bytes.truncate(length as usize);
            buffers.push(bytes);
        }
        Ok(Self { path: path.to_owned(), root, buffers, numbers_left: Cell::new(MOST_NUMBERS) })
    }

    /// What is wrong with the file.
    pub fn error(&self, message: impl Into<String>) -> Error {
        damaged(&self.path, message)
    }

    /// # Errors
    /// [`Error::Input`] where texture coordinates, as they are stored, are not those that are meant.
    pub fn check_uvs(&self) -> Result<()> {
        if !self.root.extensions_required.iter().any(|name| name == TEXTURE_TRANSFORM) {
            return Ok(());
        }
        let message =
            format!("its texture coordinates need the extension {TEXTURE_TRANSFORM}, which is not supported");
        Err(Error::input(&self.path, message).with_help(
            "export it with texture coordinates in floating point and without that extension, or set `projection` under `[mesh]` \
             in the scene",
        ))
    }

    /// What an index stands for.
    ///
    /// # Errors
    /// [`Error::Input`] where there are not so many; `what` they are called.
    pub fn get<T>(&self, index: Index<T>, what: &str) -> Result<&T>
    where
        Root: Get<T>,
    {
        self.root.get(index).ok_or_else(|| self.error(format!("there is no {what} {index}")))
    }

    /// To be called before so many numbers are stored.
    ///
    /// # Errors
    /// [`Error::Input`] where they are too many.
    pub fn spend(&self, numbers: u64) -> Result<()> {
        let left = self.numbers_left.get().checked_sub(numbers);
        self.numbers_left.set(left.ok_or_else(|| {
            Error::input(&self.path, format!("holds more than {MOST_NUMBERS} numbers"))
                .with_help("export less of it, or with fewer vertices")
        })?);
        Ok(())
    }
}

/// The files that a glTF file names, as far as it can be read.
pub fn named_files(path: &Path) -> Vec<PathBuf> {
    #[derive(Deserialize)]
    struct Named {
        #[serde(default)]
        buffers: Vec<Buffer>,
    }
    #[derive(Deserialize)]
    struct Buffer {
        uri: Option<String>,
    }
    let named: Option<Named> =
        json_of(path).and_then(|json| serde_json::from_slice(without_mark(&json)).ok());
    let uris = named.into_iter().flat_map(|named| named.buffers).filter_map(|buffer| buffer.uri);
    uris.filter(|uri| !is_data(uri)).map(|uri| beside(path, &uri)).collect()
}

/// The part of a file that is JSON: a binary file may be long beyond it.
fn json_of(path: &Path) -> Option<Vec<u8>> {
    let (mut file, length) = input::open(path).ok()?;
    let mut json = Vec::new();
    (&mut file).take(GLB_HEAD as u64).read_to_end(&mut json).ok()?;
    let rest = if json.starts_with(MAGIC) {
        let length = u32::from_le_bytes(*json.get(12..16)?.first_chunk()?);
        json.clear();
        u64::from(length)
    } else {
        length
    };
    file.take(rest.min(LONGEST_FILE)).read_to_end(&mut json).ok()?;
    Some(json)
}

/// Without the byte-order mark that some editors put before a text.
fn without_mark(json: &[u8]) -> &[u8] {
    json.strip_prefix(b"\xef\xbb\xbf").unwrap_or(json)
}

/// Without channels that move no node, which are to be ignored, or (`KHR_animation_pointer`) something that is not read.
fn root_of(json: &[u8]) -> serde_json::Result<Root> {
    let mut root: Value = serde_json::from_slice(json)?;
    let animations = root.get_mut("animations").and_then(Value::as_array_mut);
    for animation in animations.into_iter().flatten() {
        if let Some(channels) = animation.get_mut("channels").and_then(Value::as_array_mut) {
            channels.retain(|channel| {
                let target = |key| channel.get("target").and_then(|target| target.get(key));
                channel.get("target").is_none()
                    || target("node").is_some_and(|node| !node.is_null())
                        && target("path").is_none_or(|path| path != "pointer")
            });
        }
    }
    serde_json::from_value(root)
}

fn damaged(path: &Path, message: impl Into<String>) -> Error {
    Error::input(path, message).with_help("the file may be damaged or cut off: export it again")
}

/// The two chunks of a binary file.
fn binary<'a>(path: &Path, bytes: &'a [u8]) -> Result<(&'a [u8], Option<&'a [u8]>)> {
    let word = |at: usize| {
        bytes.get(at..at + 4).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]]))
    };
    if let Some(version) = word(4).filter(|version| *version != 2) {
        return Err(not_version_2(path, &version.to_string()));
    }
    let length = word(8).unwrap_or(GLB_HEAD as u32) as usize;
    if length.max(GLB_HEAD) > bytes.len() {
        return Err(damaged(path, format!("has {} bytes, but should have {length}", bytes.len())));
    }
    let mut chunks = Vec::new();
    let mut rest = &bytes[12..length.max(GLB_HEAD)];
    while let Some((head, after)) = rest.split_first_chunk::<8>() {
        let length = u32::from_le_bytes([head[0], head[1], head[2], head[3]]) as usize;
        let Some((chunk, after)) = after.split_at_checked(length) else {
            return Err(damaged(path, "its last chunk is cut off"));
        };
        chunks.push((&head[4..], chunk));
        rest = after;
    }
    // Of other kinds there may be some behind these.
    match chunks[..] {
        [(b"JSON", json), (b"BIN\0", chunk), ..] => Ok((json, Some(chunk))),
        [(b"JSON", json), ..] => Ok((json, None)),
        _ => Err(damaged(path, "its first chunk is not the one in JSON")),
    }
}

fn not_version_2(path: &Path, version: &str) -> Error {
    Error::input(path, format!("is of glTF {version}")).with_help("glTF 2.0 is read: export it again as that")
}

fn check_kind(path: &Path, root: &Root) -> Result<()> {
    if !root.asset.version.starts_with("2.") {
        return Err(not_version_2(path, &root.asset.version));
    }
    let known = |name: &str| EXTENSIONS.iter().any(|known| name.starts_with(known));
    match root.extensions_required.iter().find(|name| !known(name)) {
        None => Ok(()),
        Some(name) => Err(Error::input(path, format!("needs the extension {name}, which is not supported"))
            .with_help(
                "export it without that extension, or convert it; compressed geometry must be unpacked",
            )),
    }
}

fn is_data(uri: &str) -> bool {
    uri.get(..5).is_some_and(|scheme| scheme.eq_ignore_ascii_case("data:"))
}

/// The first `length` bytes of a URI, or what there is.
fn uri_bytes(path: &Path, uri: &str, length: u64, index: usize) -> Result<Vec<u8>> {
    if !is_data(uri) {
        let name = beside(path, uri);
        let mut bytes = Vec::new();
        let read = input::open(&name).and_then(|(file, _)| file.take(length).read_to_end(&mut bytes));
        return read.map(|_| bytes).map_err(|error| {
            Error::input(&name, format!("cannot be read: {error}"))
                .with_help(format!("it is buffer {index} of {}", path.display()))
        });
    }
    let data = uri.split_once(";base64,").map(|(_, data)| data.trim_end_matches('='));
    data.and_then(|data| STANDARD_NO_PAD.decode(data).ok())
        .ok_or_else(|| damaged(path, format!("buffer {index} is a data URI that is not in base64")))
}

/// The file of a URI, in which `%20` stands for a space.
fn beside(path: &Path, uri: &str) -> PathBuf {
    let mut name = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let Some((&byte, after)) = rest.split_first() {
        let digits = after.get(..2).filter(|digits| byte == b'%' && digits.iter().all(u8::is_ascii_hexdigit));
        let code = digits.and_then(|digits| u8::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok());
        name.push(code.unwrap_or(byte));
        rest = if code.is_some() { &after[2..] } else { after };
    }
    path.parent().unwrap_or(Path::new("")).join(String::from_utf8_lossy(&name).as_ref())
}
