//! The header of an NRRD file: lines of `field: description` up to an empty line.

use std::collections::BTreeMap;
use std::path::Path;

use super::MAGIC;
use crate::{Error, Result};

/// What of a header says where its numbers are.
pub(super) struct Header {
    /// Along each axis, the fastest first.
    pub(super) sizes: Vec<u64>,
    pub(super) number: Number,
    pub(super) little_endian: bool,
    pub(super) encoding: Encoding,
    /// The data's own file, relative to the header; without it the data follows the header.
    pub(super) data_file: Option<String>,
    /// Lines before the data, as stored.
    pub(super) line_skip: usize,
    /// Then bytes, once decompressed; without it, which only raw data has, all before the last that are needed.
    pub(super) byte_skip: Option<u64>,
}

#[derive(Clone, Copy)]
pub(super) enum Encoding {
    Raw,
    Gzip,
    Text,
}

/// The types of NRRD except `block`.
#[derive(Clone, Copy)]
pub(super) enum Number {
    Int8,
    Uint8,
    Int16,
    Uint16,
    Int32,
    Uint32,
    Int64,
    Uint64,
    Float,
    Double,
}

/// The specified field names that are read here, each with the line that it stands on.
type Fields = BTreeMap<String, (usize, String)>;

impl Header {
    /// The header at the start of `bytes`, and the place where it ends.
    pub(super) fn parse(path: &Path, bytes: &[u8]) -> Result<(Self, usize)> {
        let (fields, end) = fields(path, bytes)?;
        let at = |line: usize, message: String| Error::input(path, format!("line {line}: {message}"));
        let required = |name: &str| {
            fields.get(name).ok_or_else(|| Error::input(path, format!("its header has no field `{name}`")))
        };
        let (line, name) = required("type")?;
        let number = Number::named(name)
            .ok_or_else(|| at(*line, format!("the type `{name}` is unknown or not numeric")))?;
        let (line, name) = required("encoding")?;
        let encoding = Encoding::named(name).ok_or_else(|| {
            at(*line, format!("the encoding `{name}` is not supported")).with_help("use raw, gzip or text")
        })?;
        let (line, text) = required("sizes")?;
        let sizes = text.split_whitespace().map(str::parse).collect::<Result<Vec<u64>, _>>();
        let sizes = sizes.map_err(|_| at(*line, format!("`{text}` is not a list of sizes")))?;
        let (line, dimension) = required("dimension")?;
        if dimension.parse() != Ok(sizes.len()) {
            return Err(at(
                *line,
                format!("the dimension is {dimension}, but there are {} sizes", sizes.len()),
            ));
        }
        let little_endian = match fields.get("endian") {
            Some((_, order)) if order.eq_ignore_ascii_case("little") => true,
            Some((_, order)) if order.eq_ignore_ascii_case("big") => false,
            None if number.bytes() == 1 || matches!(encoding, Encoding::Text) => true,
            Some((line, order)) => return Err(at(*line, format!("`{order}` is neither `little` nor `big`"))),
            None => return Err(Error::input(path, "its header has no field `endian`, which its type needs")),
        };
        let line_skip = match fields.get("line skip") {
            Some((line, text)) => {
                text.parse().map_err(|_| at(*line, format!("`{text}` is not a number of lines")))?
            }
            None => 0,
        };
        let byte_skip = match fields.get("byte skip") {
            Some((_, text)) if text == "-1" && matches!(encoding, Encoding::Raw) => None,
            Some((line, text)) => {
                let skip = text.parse().map_err(|_| {
                    let error = at(*line, format!("`{text}` is not a number of bytes to skip"));
                    error.with_help("-1, for all before the data, is possible only with the encoding raw")
                })?;
                Some(skip)
            }
            None => Some(0),
        };
        let data_file = match fields.get("data file") {
            Some((line, name)) if name.starts_with("LIST") || name.contains('%') => {
                let error = at(*line, "data in several files is not supported".into());
                return Err(error.with_help("join the files into one"));
            }
            Some((_, name)) => Some(name.clone()),
            None => None,
        };
        Ok((Self { sizes, number, little_endian, encoding, data_file, line_skip, byte_skip }, end))
    }
}

/// The fields, and where the data starts that follows them. Comments and `key:=value` pairs are left out.
fn fields(path: &Path, bytes: &[u8]) -> Result<(Fields, usize)> {
    let mut fields = Fields::new();
    let mut end = 0;
    for (number, line) in (1..).zip(bytes.split_inclusive(|&byte| byte == b'\n')) {
        end += line.len();
        let text = String::from_utf8_lossy(line);
        let text = text.trim_end();
        let at = |message: String| Error::input(path, format!("line {number}: {message}"));
        if number == 1 {
            let version = text.as_bytes().strip_prefix(MAGIC).unwrap_or_default();
            if !matches!(version, [b'1'..=b'5']) {
                return Err(at("is not `NRRD000` and a version from 1 to 5".into()));
            }
            continue;
        }
        if text.is_empty() {
            break;
        }
        let separator = text.find(':').unwrap_or(text.len());
        let (name, description) = text.split_at(separator);
        if text.starts_with('#') || description.starts_with(":=") {
            continue;
        }
        let Some(description) = description.strip_prefix(": ") else {
            return Err(at(format!(
                "`{}` is not `field: description`",
                text.escape_debug().take(40).collect::<String>()
            )));
        };
        let name = match name.to_ascii_lowercase().as_str() {
            "datafile" => "data file".into(),
            "lineskip" => "line skip".into(),
            "byteskip" => "byte skip".into(),
            name => String::from(name),
        };
        // What follows `data file: LIST` are the names of files.
        let is_list = name == "data file" && description.starts_with("LIST");
        let repeated = fields.insert(name, (number, description.trim().into()));
        if let Some((before, _)) = repeated {
            return Err(at(format!("repeats the field of line {before}")));
        }
        if is_list {
            break;
        }
    }
    Ok((fields, end))
}

impl Encoding {
    fn named(name: &str) -> Option<Self> {
        match name.to_ascii_lowercase().as_str() {
            "raw" => Some(Self::Raw),
            "gzip" | "gz" => Some(Self::Gzip),
            "ascii" | "text" | "txt" => Some(Self::Text),
            _ => None,
        }
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Raw => "raw",
            Self::Gzip => "gzip",
            Self::Text => "text",
        }
    }
}

/// Applies a macro to the Rust type of a [`Number`].
macro_rules! with_type {
    ($number:expr, $macro:ident) => {
        match $number {
            Number::Int8 => $macro!(i8),
            Number::Uint8 => $macro!(u8),
            Number::Int16 => $macro!(i16),
            Number::Uint16 => $macro!(u16),
            Number::Int32 => $macro!(i32),
            Number::Uint32 => $macro!(u32),
            Number::Int64 => $macro!(i64),
            Number::Uint64 => $macro!(u64),
            Number::Float => $macro!(f32),
            Number::Double => $macro!(f64),
        }
    };
}

impl Number {
    fn named(name: &str) -> Option<Self> {
        Some(match name {
            "signed char" | "int8" | "int8_t" => Self::Int8,
            "uchar" | "unsigned char" | "uint8" | "uint8_t" => Self::Uint8,
            "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => Self::Int16,
            "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => Self::Uint16,
            "int" | "signed int" | "int32" | "int32_t" => Self::Int32,
            "uint" | "unsigned int" | "uint32" | "uint32_t" => Self::Uint32,
            "longlong"
            | "long long"
            | "long long int"
            | "signed long long"
            | "signed long long int"
            | "int64"
            | "int64_t" => Self::Int64,
            "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => {
                Self::Uint64
            }
            "float" => Self::Float,
            "double" => Self::Double,
            _ => return None,
        })
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Int8 => "int8",
            Self::Uint8 => "uint8",
            Self::Int16 => "int16",
            Self::Uint16 => "uint16",
            Self::Int32 => "int32",
            Self::Uint32 => "uint32",
            Self::Int64 => "int64",
            Self::Uint64 => "uint64",
            Self::Float => "float",
            Self::Double => "double",
        }
    }

    pub(super) fn bytes(self) -> usize {
        macro_rules! bytes {
            ($type:ty) => {
                size_of::<$type>()
            };
        }
        with_type!(self, bytes)
    }

    /// The largest integer; 1 for floats.
    pub(super) fn full_scale(self) -> f32 {
        macro_rules! max {
            ($type:ty) => {
                <$type>::MAX as f32
            };
        }
        match self {
            Self::Float | Self::Double => 1.0,
            integer => with_type!(integer, max),
        }
    }

    /// The numbers that `data` stores, rounded to f32.
    pub(super) fn decode(self, data: &[u8], little_endian: bool) -> Vec<f32> {
        macro_rules! decode {
            ($type:ty) => {{
                let (numbers, _) = data.as_chunks();
                match little_endian {
                    true => numbers.iter().map(|&number| <$type>::from_le_bytes(number) as f32).collect(),
                    false => numbers.iter().map(|&number| <$type>::from_be_bytes(number) as f32).collect(),
                }
            }};
        }
        with_type!(self, decode)
    }
}
