//! A line of text in a picture's file, beside the picture.

use std::io::{Cursor, Read, Seek, SeekFrom};
use std::path::Path;

use exr::prelude::{AttributeValue, Image as ExrImage, SpecificChannels, Text, Vec2, WritableImage};

use super::{Format, exr_header};
use crate::frame::Image;
use crate::input;

/// Of the text in both kinds of files.
const KEYWORD: &str = "mesoshell-frame";

/// More than any picture's header has; a mark is short, and stands before the pixels.
const LONGEST_HEADER: u64 = 1 << 16;

/// What a PNG begins with: its signature, then the chunk `IHDR` of 25 bytes.
const PNG_HEAD: usize = 8 + 25;

/// What a PNG ends with: the chunk `IEND`, which is empty.
const PNG_END: &[u8; 12] = b"\0\0\0\0IEND\xae\x42\x60\x82";

/// The mark of a picture that [`write_marked`](super::write_marked) has written; `None` where there is none, or no such file.
pub fn mark(path: &Path) -> Option<String> {
    let format = Format::of(path).ok()?;
    let (file, _) = input::open(path).ok()?;
    let mut head = Vec::new();
    file.take(LONGEST_HEADER).read_to_end(&mut head).ok()?;
    let text = match format {
        Format::Png => {
            let chunk = head.get(PNG_HEAD..)?;
            let length = u32::from_be_bytes(chunk.get(..4)?.try_into().ok()?);
            let (kind, data) = (chunk.get(4..8)?, chunk.get(8..8 + usize::try_from(length).ok()?)?);
            let text = data.strip_prefix(KEYWORD.as_bytes())?.strip_prefix(b"\0")?;
            (kind == b"tEXt").then_some(text)?
        }
        Format::Exr => exr_header::attribute(&head, KEYWORD.as_bytes())?,
    };
    String::from_utf8(text.to_vec()).ok()
}

/// Whether a picture that has a [`mark`] is there to its end: a copy that broke off, or a disk that was full, leaves less.
pub fn is_whole(path: &Path) -> bool {
    match Format::of(path) {
        Ok(Format::Png) => ends_as_png(path).unwrap_or(false),
        Ok(Format::Exr) => super::read(path).is_ok(),
        Err(_) => false,
    }
}

fn ends_as_png(path: &Path) -> std::io::Result<bool> {
    let (mut file, _) = input::open(path)?;
    let mut end = [0; PNG_END.len()];
    file.seek(SeekFrom::End(-(PNG_END.len() as i64)))?;
    file.read_exact(&mut end)?;
    Ok(end == *PNG_END)
}

/// The PNG with a chunk of text after its header ("PNG Specification", third edition, 11.3.3.2).
pub(super) fn in_png(mut bytes: Vec<u8>, mark: &str) -> Vec<u8> {
    let body = [b"tEXt", KEYWORD.as_bytes(), b"\0", mark.as_bytes()].concat();
    let mut crc = flate2::Crc::new();
    crc.update(&body);
    let length = u32::try_from(body.len() - 4).expect("a mark is short");
    let chunk = [&length.to_be_bytes()[..], &body, &crc.sum().to_be_bytes()].concat();
    bytes.splice(PNG_HEAD..PNG_HEAD, chunk);
    bytes
}

/// Writes an EXR, with the mark as an attribute where there is one.
///
/// # Errors
/// A sentence.
pub(super) fn write_exr(bytes: &mut Vec<u8>, image: &Image, mark: Option<&str>) -> Result<(), String> {
    let size = [image.width, image.height].map(|side| side as usize);
    let channels = SpecificChannels::rgba(|Vec2(x, y)| {
        let [r, g, b, a] = image.rgba[y * size[0] + x];
        (r, g, b, a)
    });
    let mut exr = ExrImage::from_channels(Vec2(size[0], size[1]), channels);
    if let Some(mark) = mark {
        let others = &mut exr.layer_data.attributes.other;
        others.insert(Text::from(KEYWORD), AttributeValue::Text(Text::from(mark)));
    }
    exr.write().to_buffered(Cursor::new(bytes)).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::super::{read, write, write_marked};
    use super::*;
    use crate::frame::Backdrop;

    #[test]
    fn marks_are_found_and_leave_the_picture_alone() {
        let folder = tempfile::tempdir().unwrap();
        let picture = Image { width: 2, height: 3, rgba: vec![[0.25, 0.5, 0.0, 1.0]; 6] };
        for name in ["a.png", "a.exr"] {
            let path = folder.path().join(name);
            assert_eq!(mark(&path), None, "not there yet");
            write(&path, &picture, &Backdrop::default()).unwrap();
            let plain = read(&path).unwrap();
            assert_eq!(mark(&path), None);
            write_marked(&path, &picture, &Backdrop::default(), Some("0123abcd")).unwrap();
            assert_eq!(mark(&path).as_deref(), Some("0123abcd"));
            assert_eq!(read(&path).unwrap(), plain, "{name}");
            // Whatever is left of a file, nothing goes wrong.
            let bytes = std::fs::read(&path).unwrap();
            assert!(is_whole(&path));
            for length in (0..bytes.len().min(400)).chain([bytes.len() - 1]) {
                std::fs::write(&path, &bytes[..length]).unwrap();
                mark(&path);
                assert!(!is_whole(&path), "{length} of {} bytes", bytes.len());
            }
        }
    }
}
