//! Volumes in NRRD files (Kindlmann, "Definition of NRRD File Format", part of the Teem documentation,
//! <https://teem.sourceforge.net/nrrd/format.html>).
//!
//! Read are volumes of 3 axes, and of 4 whose first has 1 to 4 channels; all types but `block`; the encodings
//! raw, gzip and text; with the data in the same file or in one other. The fastest of the three axes is u,
//! the slowest w; spaces, spacings and orientations are not read, since a texture has none.

mod header;

use std::cmp::Ordering;
use std::io::{self, BufRead, BufReader, Read, Seek as _, SeekFrom};
use std::path::Path;

use flate2::read::MultiGzDecoder;

use super::raw::{check_fits_memory, claimed_size, open, unreadable};
use super::{AlphaMode, RawVolume};
use crate::input::MAX_DEFLATE_RATIO;
use crate::{Error, Result};
use header::{Encoding, Header};

/// How every NRRD file begins; the version follows.
pub(super) const MAGIC: &[u8] = b"NRRD000";

/// In bytes.
const LONGEST_HEADER: u64 = 1 << 20;

/// In bytes: the smallest f64, written out, has some 1100.
const LONGEST_NUMBER: usize = 2000;

/// Reads the volume whose header is at `path`.
pub(super) fn read(path: &Path) -> Result<RawVolume> {
    let (mut file, mut length) = open(path)?;
    let mut start = Vec::new();
    (&mut file).take(LONGEST_HEADER + 1).read_to_end(&mut start).map_err(|error| unreadable(path, &error))?;
    let (header, data_start) = Header::parse(path, &start)?;
    if data_start as u64 > LONGEST_HEADER {
        return Err(Error::input(path, format!("its header is longer than {} KiB", LONGEST_HEADER >> 10)));
    }
    let (channels, sizes) = match header.sizes[..] {
        [width, height, depth] => (1, [width, height, depth]),
        [channels @ 1..=4, width, height, depth] => (channels as u32, [width, height, depth]),
        _ => {
            let message = format!("has the sizes {:?}, which are not those of a volume", header.sizes);
            return Err(
                Error::input(path, message).with_help("3 axes are read, or 4 with 1 to 4 channels first")
            );
        }
    };
    let (size, count) = claimed_size(path, sizes, channels)?;

    // Errors from here on are those of the file that has the data.
    let detached = header.data_file.as_ref().map(|name| path.parent().unwrap_or(Path::new("")).join(name));
    let data_path = detached.as_deref().unwrap_or(path);
    let unreadable = |error| unreadable(data_path, &error);
    let mut skipped = data_start as u64;
    if detached.is_some() {
        let advice = || format!("it is the `data file` that {} names", path.display());
        (file, length) = open(data_path).map_err(|error| error.with_help(advice()))?;
        skipped = 0;
    }
    let mut data = BufReader::new(file);
    data.seek(SeekFrom::Start(skipped)).map_err(unreadable)?;
    for _ in 0..header.line_skip {
        let lines = data.skip_until(b'\n').and_then(|_| data.fill_buf());
        if lines.map_err(unreadable)?.is_empty() {
            let message = format!("has nothing after the {} lines to skip", header.line_skip);
            return Err(Error::input(data_path, message));
        }
    }
    let left = length.saturating_sub(data.stream_position().map_err(unreadable)?);
    let promised = count * header.number.bytes();
    let wrong_length = |comparison: &str| {
        let message = format!(
            "has {comparison} than the {promised} bytes of {count} {} values that its header promises",
            header.number.name()
        );
        Error::input(data_path, message)
    };
    let values = match header.encoding {
        Encoding::Raw => {
            // Without a skip the data is what comes last.
            let skip = header.byte_skip.unwrap_or(left.saturating_sub(promised as u64));
            match left.saturating_sub(skip).cmp(&(promised as u64)) {
                Ordering::Less => return Err(wrong_length("fewer")),
                Ordering::Greater => return Err(wrong_length("more")),
                Ordering::Equal => {}
            }
            check_fits_memory(path, size)?;
            let skip = i64::try_from(skip).expect("less than the file's length");
            data.seek_relative(skip).map_err(unreadable)?;
            let mut bytes = Vec::new();
            data.take(promised as u64).read_to_end(&mut bytes).map_err(unreadable)?;
            header.number.decode(&bytes, header.little_endian)
        }
        Encoding::Gzip => {
            if promised as u64 / MAX_DEFLATE_RATIO > left {
                return Err(wrong_length("fewer"));
            }
            check_fits_memory(path, size)?;
            let bytes = inflated(data, header.byte_skip.unwrap_or(0), promised)
                .map_err(|error| Error::input(data_path, format!("its gzip data is damaged: {error}")))?;
            match bytes.len().cmp(&promised) {
                Ordering::Less => return Err(wrong_length("fewer")),
                Ordering::Greater => return Err(wrong_length("more")),
                Ordering::Equal => header.number.decode(&bytes, header.little_endian),
            }
        }
        Encoding::Text => {
            // A value takes a digit, and a separator before the next: where bytes lack, so will values.
            if left.div_ceil(2) >= count as u64 {
                check_fits_memory(path, size)?;
            }
            let skip =
                i64::try_from(header.byte_skip.unwrap_or(0).min(left)).expect("at most the file's length");
            data.seek_relative(skip).map_err(unreadable)?;
            text_values(data_path, data, count)?
        }
    };
    let format = format!("NRRD {} {}", header.number.name(), header.encoding.name());
    let full_scale = header.number.full_scale();
    let volume = RawVolume {
        path: path.into(),
        format,
        size,
        channels,
        values,
        full_scale,
        alpha_mode: AlphaMode::Straight,
    };
    volume.validated()
}

/// What follows the first `skip` bytes of the inflated stream: of `length` bytes, or one more where there are more. No more than
/// that is inflated.
fn inflated(data: impl Read, skip: u64, length: usize) -> io::Result<Vec<u8>> {
    let mut stream = MultiGzDecoder::new(data);
    io::copy(&mut stream.by_ref().take(skip), &mut io::sink())?;
    let mut inflated = Vec::new();
    stream.take(length as u64 + 1).read_to_end(&mut inflated)?;
    Ok(inflated)
}

/// Exactly `count` numbers in text, separated by white space or commas. Nothing is read beyond the first word too many.
fn text_values(path: &Path, data: impl BufRead, count: usize) -> Result<Vec<f32>> {
    let mut bytes = data.bytes();
    let mut words = std::iter::from_fn(|| {
        let mut word = Vec::new();
        for byte in bytes.by_ref() {
            match byte {
                Err(error) => return Some(Err(unreadable(path, &error))),
                Ok(byte) if !byte.is_ascii_whitespace() && byte != b',' => word.push(byte),
                Ok(_) if word.is_empty() => {}
                Ok(_) => break,
            }
            if word.len() > LONGEST_NUMBER {
                return Some(Err(Error::input(
                    path,
                    format!("has a word of more than {LONGEST_NUMBER} bytes"),
                )));
            }
        }
        (!word.is_empty()).then(|| Ok(String::from_utf8_lossy(&word).into_owned()))
    });
    let mut values = Vec::new();
    for word in words.by_ref().take(count) {
        let word = word?;
        let value =
            word.parse::<f64>().map_err(|_| Error::input(path, format!("`{word}` is not a number")))?;
        values.push(value as f32);
    }
    match (values.len() == count, words.next()) {
        (true, None) => Ok(values),
        (true, Some(word)) => {
            word.and_then(|_| Err(Error::input(path, format!("has more than {count} values"))))
        }
        (false, _) => Err(Error::input(path, format!("has only {} of {count} values", values.len()))),
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;

    use flate2::Compression;
    use flate2::write::GzEncoder;

    use super::*;

    fn gzip(data: &[u8]) -> Vec<u8> {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
        encoder.write_all(data).unwrap();
        encoder.finish().unwrap()
    }

    /// The NRRD of `fields` (a line each) and `data`, read.
    fn read_file(fields: &str, data: &[u8]) -> Result<RawVolume> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("volume.nrrd");
        std::fs::write(&path, [format!("NRRD0004\n# made here\n{fields}\n\n").as_bytes(), data].concat())
            .unwrap();
        read(&path)
    }

    fn message(result: Result<RawVolume>) -> String {
        let error = result.unwrap_err();
        assert!(matches!(error, Error::Input { .. }), "{error:?}");
        error.to_string()
    }

    #[test]
    fn all_types_in_both_byte_orders() {
        macro_rules! check {
            ($($number:ty: $($name:literal)+, $full_scale:expr;)+) => {$(
                for name in [$($name),+] {
                    let numbers: [$number; 4] = [0 as $number, 1 as $number, 100 as $number, <$number>::MIN];
                    let expected = numbers.map(|number| number as f32);
                    let (little, big) = (numbers.map(<$number>::to_le_bytes), numbers.map(<$number>::to_be_bytes));
                    for (endian, bytes) in [("little", little.concat()), ("big", big.concat())] {
                        let fields = format!("type: {name}\ndimension: 3\nsizes: 4 1 1\nendian: {endian}\nencoding: raw");
                        match read_file(&fields, &bytes) {
                            Ok(volume) => assert_eq!((&volume.values[..], volume.full_scale), (&expected[..], $full_scale)),
                            // f64::MIN is infinite as f32.
                            Err(error) => assert!(name == "double" && error.to_string().contains("(3, 0, 0)"), "{error}"),
                        }
                    }
                }
            )+};
        }
        check! {
            i8: "int8" "signed char" "int8_t", 127.0;
            u8: "uint8" "unsigned char" "uchar" "uint8_t", 255.0;
            i16: "int16" "short" "signed short int", 32767.0;
            u16: "uint16" "ushort" "unsigned short int", 65535.0;
            i32: "int32" "int" "signed int", i32::MAX as f32;
            u32: "uint32" "uint" "unsigned int", u32::MAX as f32;
            i64: "int64" "longlong" "long long int", i64::MAX as f32;
            u64: "uint64" "ulonglong" "unsigned long long", u64::MAX as f32;
            f32: "float", 1.0;
            f64: "double", 1.0;
        }
    }

    #[test]
    fn axes_and_channels_are_ordered_from_the_fastest() {
        let data: Vec<u8> = (0..24).collect();
        let scalar = read_file("type: uchar\ndimension: 3\nsizes: 2 3 4\nencoding: raw", &data).unwrap();
        assert_eq!((scalar.size, scalar.channels, scalar.values[7]), ([2, 3, 4], 1, 7.0));
        assert_eq!(scalar.format, "NRRD uint8 raw");
        let colour = read_file("type: uchar\ndimension: 4\nsizes: 4 1 3 2\nencoding: raw", &data).unwrap();
        assert_eq!((colour.size, colour.channels), ([1, 3, 2], 4));
        assert!(
            message(read_file("type: uchar\ndimension: 4\nsizes: 6 1 2 2\nencoding: raw", &data))
                .contains("sizes")
        );
        assert!(
            message(read_file("type: uchar\ndimension: 2\nsizes: 6 4\nencoding: raw", &data))
                .contains("sizes")
        );
    }

    #[test]
    fn encodings_and_skips() {
        let fields = |encoding: &str, more: &str| {
            format!("type: uint16\nendian: little\ndimension: 3\nsizes: 3 1 1\nencoding: {encoding}{more}")
        };
        let raw = [1, 0, 2, 0, 3, 0];
        let with = |before: &[u8]| [before, &raw].concat();
        for (fields, data) in [
            (fields("raw", ""), raw.to_vec()),
            (fields("raw", "\nbyte skip: 2"), with(b"ab")),
            (fields("raw", "\nbyte skip: -1"), with(b"what a header")),
            (fields("raw", "\nline skip: 2\nbyteskip: 1"), with(b"one\ntwo\n!")),
            (fields("gzip", ""), gzip(&raw)),
            (fields("gz", "\nbyte skip: 3"), gzip(&with(b"abc"))),
            (fields("gzip", "\nlineskip: 1"), [b"line\n", &gzip(&raw)[..]].concat()),
            (fields("gzip", ""), [gzip(&raw[..2]), gzip(&raw[2..])].concat()),
            (fields("ascii", ""), b" 1, 2\n3.0e0\n".to_vec()),
            (fields("txt", "\nline skip: 1"), b"numbers\n1 2 3".to_vec()),
        ] {
            assert_eq!(read_file(&fields, &data).unwrap().values, [1.0, 2.0, 3.0], "{fields}");
        }
        for (fields, data, expected) in [
            (fields("raw", ""), raw[..5].to_vec(), "fewer than the 6 bytes"),
            (fields("raw", ""), with(b"a"), "more than the 6 bytes"),
            (fields("raw", "\nbyte skip: -1"), raw[..5].to_vec(), "fewer than the 6 bytes"),
            (fields("raw", "\nbyte skip: 7"), raw.to_vec(), "fewer"),
            (fields("raw", "\nline skip: 2"), with(b"one\n"), "nothing after the 2 lines to skip"),
            (fields("gzip", ""), gzip(&raw[..4]), "fewer"),
            (fields("gzip", ""), gzip(&vec![0; 1 << 24]), "more"),
            (fields("gzip", ""), gzip(&raw)[..20].to_vec(), "damaged"),
            (fields("gzip", "\nbyte skip: -1"), gzip(&raw), "`-1` is not"),
            (fields("ascii", "\nbyte skip: -1"), b"1 2 3".to_vec(), "`-1` is not"),
            (fields("ascii", ""), b"1 2".to_vec(), "only 2 of 3"),
            (fields("ascii", ""), b"1 2 3 4".to_vec(), "more than 3"),
            (fields("ascii", ""), b"1 2 x".to_vec(), "`x` is not a number"),
            (fields("ascii", ""), b"1 nan 2".to_vec(), "(1, 0, 0) is NaN"),
            (fields("bzip2", ""), raw.to_vec(), "bzip2"),
            (fields("hex", ""), raw.to_vec(), "hex"),
        ] {
            let message = message(read_file(&fields, &data));
            assert!(message.contains(expected), "{fields}: {message}");
        }
    }

    #[test]
    fn a_gzip_header_cannot_claim_more_than_deflate_could_hold() {
        let fields = "type: double\nendian: little\ndimension: 3\nsizes: 2048 2048 512\nencoding: gzip";
        assert!(message(read_file(fields, &gzip(&[0; 16]))).contains("fewer"));
    }

    #[test]
    fn detached_data_is_found_beside_the_header() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("volume.nhdr");
        let header = |field: &str| {
            let fields = "type: uchar\ndimension: 3\nsizes: 2 1 1\nencoding: raw";
            std::fs::write(&path, format!("NRRD0001\r\n{fields}\r\n{field}")).unwrap();
            read(&path)
        };
        std::fs::write(folder.path().join("the data.raw"), [7, 9]).unwrap();
        assert_eq!(header("data file: the data.raw\n").unwrap().values, [7.0, 9.0]);
        assert_eq!(header("datafile: ./the data.raw").unwrap().values, [7.0, 9.0]);
        let missing = message(header("data file: none.raw"));
        assert!(missing.contains("none.raw: cannot be read"), "{missing}");
        std::fs::write(folder.path().join("the data.raw"), [7]).unwrap();
        let short = message(header("data file: the data.raw"));
        assert!(short.contains("the data.raw: has fewer"), "{short}");
        #[cfg(unix)]
        {
            let endless = header("data file: /dev/zero").unwrap_err();
            assert_eq!(endless.to_string(), "/dev/zero: cannot be read: it is no regular file");
            let Error::Input { help: Some(help), .. } = endless else { panic!("{endless:?}") };
            assert!(help.contains("`data file`") && help.contains("volume.nhdr"), "{help}");
        }
        for several in ["LIST\na.raw\nb.raw", "slice%03d.raw 1 10 1", "a.raw b 2"] {
            let refused = message(header(&format!("data file: {several}")));
            assert!(refused.contains("volume.nhdr") || refused.contains("cannot be read"), "{refused}");
        }
    }
}
