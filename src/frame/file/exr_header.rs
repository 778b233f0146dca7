//! The sizes in the header of an OpenEXR file, read before the decoder, which allocates by each of
//! them unchecked: "The OpenEXR File Layout", OpenEXR documentation.

use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use crate::{Error, Result};

/// The sizes of an EXR file's data window, display window and tiles, from its header; leaves the file
/// at its start.
///
/// # Errors
/// [`Error::Input`] when the file is no flat EXR image of one part, or its header is damaged.
pub(super) fn sizes(path: &Path, file: &mut (impl Read + Seek)) -> Result<Vec<[u64; 2]>> {
    let refuse = |message: &str| {
        Error::input(path, message).with_help("only flat images of one part are read: export it as such")
    };
    // Headers are a few hundred bytes; one with a large preview image may have many more.
    let mut header = Vec::new();
    let read = file.take(1 << 24).read_to_end(&mut header).and_then(|_| file.seek(SeekFrom::Start(0)));
    read.map_err(|error| Error::input(path, format!("cannot be read: {error}")))?;

    let mut bytes = &header[..];
    if take(&mut bytes, 4) != Some(&[0x76, 0x2f, 0x31, 0x01]) {
        return Err(refuse("is not an OpenEXR file"));
    }
    // Bits 11 and 12 of the flags after the version: deep data, and more than one part.
    match take(&mut bytes, 4) {
        Some([_, flags, ..]) if flags & 0x18 == 0 => {}
        Some(_) => return Err(refuse("has deep data or several parts")),
        None => return Err(refuse("ends in its header")),
    }
    let mut sizes = Vec::new();
    loop {
        let attribute = next_attribute(&mut bytes).ok_or_else(|| refuse("ends in its header"))?;
        let Some((name, value)) = attribute else { break };
        let word = |k: usize| {
            let four = value.get(4 * k..4 * k + 4)?;
            Some(i32::from_le_bytes(four.try_into().expect("four bytes")))
        };
        let size = match name {
            // A box: smallest x and y, largest x and y, both inside.
            b"dataWindow" | b"displayWindow" => [0, 1].map(|k| {
                let side = i64::from(word(k + 2)?) - i64::from(word(k)?) + 1;
                u64::try_from(side).ok().filter(|&side| side > 0)
            }),
            b"tiles" => [0, 1].map(|k| u64::try_from(word(k)?).ok()),
            _ => continue,
        };
        let [Some(width), Some(height)] = size else {
            let name = String::from_utf8_lossy(name);
            return Err(refuse(&format!("has a header whose {name} has no size")));
        };
        sizes.push([width, height]);
    }
    Ok(sizes)
}

/// The value of an attribute in the first bytes of an EXR file.
pub(super) fn attribute<'a>(head: &'a [u8], wanted: &[u8]) -> Option<&'a [u8]> {
    // The magic number, and the version with its flags.
    let mut bytes = head.get(8..)?;
    loop {
        let (name, value) = next_attribute(&mut bytes)??;
        if name == wanted {
            return Some(value);
        }
    }
}

/// The next attribute's name and value; `Some(None)` at the end of the header, `None` where it is cut off.
fn next_attribute<'a>(bytes: &mut &'a [u8]) -> Option<Option<(&'a [u8], &'a [u8])>> {
    let name = take_string(bytes)?;
    if name.is_empty() {
        return Some(None);
    }
    let _type = take_string(bytes)?;
    let size = take(bytes, 4)?.try_into().expect("four bytes");
    let value = take(bytes, usize::try_from(i32::from_le_bytes(size)).ok()?)?;
    Some(Some((name, value)))
}

fn take<'a>(bytes: &mut &'a [u8], count: usize) -> Option<&'a [u8]> {
    let (taken, rest) = bytes.split_at_checked(count)?;
    *bytes = rest;
    Some(taken)
}

/// Up to a zero byte, which is taken too.
fn take_string<'a>(bytes: &mut &'a [u8]) -> Option<&'a [u8]> {
    let length = bytes.iter().position(|&byte| byte == 0)?;
    let string = take(bytes, length)?;
    take(bytes, 1)?;
    Some(string)
}
