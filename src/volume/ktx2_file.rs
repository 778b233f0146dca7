//! 3D textures in KTX2 files (Khronos, "KTX File Format Specification", version 2.0).
//!
//! Read are level 0 of the 3D formats that [`Sample`] lists, as they are or compressed with zlib. The
//! axes are taken as stored: texel (0, 0, 0) comes first, and x, y, z become u, v, w.

use std::fs::File;
use std::io::{Read as _, Seek as _, SeekFrom, Take, Write as _};
use std::path::Path;

use flate2::read::ZlibDecoder;
use glam::DVec3;
use ktx2::dfd::{Basic, Block};
use ktx2::{Header, Index, LevelIndex, SupercompressionScheme};

use super::raw::{check_fits_memory, claimed_size, open, unreadable};
use super::{AlphaMode, RawVolume, Sample, Volume};
use crate::input::MAX_DEFLATE_RATIO;
use crate::{Error, Result, output};

/// Reads level 0 of the 3D texture at `path`.
pub(super) fn read(path: &Path) -> Result<RawVolume> {
    read_with_type(path).map(|(raw, _)| raw)
}

/// Reads the first three channels of level 0 as vectors: UNORM as `2 x - 1`, SFLOAT as it is.
pub(super) fn read_vectors(path: &Path) -> Result<([u32; 3], Vec<DVec3>)> {
    let (RawVolume { size, channels, values, format, .. }, sample) = read_with_type(path)?;
    let decode = match sample {
        Sample::Unorm8 | Sample::Unorm16 => |value: f64| 2.0 * value - 1.0,
        Sample::Float16 | Sample::Float32 => |value: f64| value,
        Sample::Srgb8 => {
            let message = format!("holds colours ({format}), not directions");
            return Err(Error::input(path, message).with_help("store them as UNORM or SFLOAT"));
        }
    };
    if channels < 3 {
        let message = format!("holds {channels} channels, but directions have three");
        return Err(Error::input(path, message).with_help("store x, y and z in red, green and blue"));
    }
    let vector = |texel: &[f32]| DVec3::from_array([0, 1, 2].map(|axis| decode(f64::from(texel[axis]))));
    Ok((size, values.chunks_exact(channels as usize).map(vector).collect()))
}

/// The texels of level 0 along u, v, w, from the header.
pub(super) fn size(path: &Path) -> Result<[u32; 3]> {
    let header = Header::from_bytes(&Pieces::of(path)?.bytes(0)?)
        .map_err(|error| Error::input(path, format!("has {error}")))?;
    Ok([header.pixel_width, header.pixel_height, header.pixel_depth])
}

fn read_with_type(path: &Path) -> Result<(RawVolume, Sample)> {
    let mut file = Pieces::of(path)?;
    let header =
        Header::from_bytes(&file.bytes(0)?).map_err(|error| Error::input(path, format!("has {error}")))?;
    let Header { pixel_width, pixel_height, pixel_depth, .. } = header;
    if pixel_depth == 0 || header.layer_count > 1 || header.face_count != 1 {
        return Err(Error::input(path, "is no 3D texture: its pixelDepth is 0, or it has layers or faces"));
    }
    let (sample, channels) = header.format.and_then(Sample::of).ok_or_else(|| {
        let name = header.format.map_or("VK_FORMAT_UNDEFINED".into(), |format| format!("{format:?}"));
        Error::input(path, format!("has the format {name}, which is not supported")).with_help(
            "supported are 1 to 4 channels of UNORM and SRGB in 8 bits, UNORM in 16, SFLOAT in 16 and 32",
        )
    })?;
    let size = [pixel_width, pixel_height, pixel_depth].map(u64::from);
    let (size, count) = claimed_size(path, size, channels)?;
    let level = LevelIndex::from_bytes(&file.bytes(Header::LENGTH as u64)?);
    let mut stored = file.piece(level.byte_offset, level.byte_length)?;
    let byte_count = count * sample.bytes();
    let wrong_length = |found: u64| {
        let [width, height, depth] = size;
        let message = format!(
            "level 0 of {width} x {height} x {depth} texels takes {byte_count} bytes, but has {found}"
        );
        Error::input(path, message)
    };
    let mut texels = Vec::new();
    match header.supercompression_scheme {
        None if level.byte_length == byte_count as u64 => {
            check_fits_memory(path, size)?;
            stored.read_to_end(&mut texels).map_err(|error| unreadable(path, &error))?;
        }
        None => return Err(wrong_length(level.byte_length)),
        Some(SupercompressionScheme::ZLIB) => {
            if byte_count as u64 / MAX_DEFLATE_RATIO > level.byte_length {
                return Err(wrong_length(level.byte_length));
            }
            check_fits_memory(path, size)?;
            ZlibDecoder::new(stored)
                .take(byte_count as u64 + 1)
                .read_to_end(&mut texels)
                .map_err(|error| Error::input(path, format!("its zlib data is damaged: {error}")))?;
            if texels.len() != byte_count {
                return Err(wrong_length(texels.len() as u64));
            }
        }
        Some(scheme) => {
            let error =
                Error::input(path, format!("is supercompressed by {scheme:?}, which is not supported"));
            return Err(error.with_help("store it without supercompression, or with zlib"));
        }
    }
    let values = sample.decode(&texels, channels);
    let format = format!("KTX2 {:?}", sample.format(channels));
    let alpha_mode = if is_premultiplied(&mut file, &header.index) {
        AlphaMode::Premultiplied
    } else {
        AlphaMode::Straight
    };
    let raw = RawVolume { path: path.into(), format, size, channels, values, full_scale: 1.0, alpha_mode };
    Ok((raw.validated()?, sample))
}

/// A file of which no more is read than is asked for, and that only once it is known to be there.
struct Pieces<'a> {
    path: &'a Path,
    file: File,
    length: u64,
}

impl<'a> Pieces<'a> {
    fn of(path: &'a Path) -> Result<Self> {
        let (file, length) = open(path)?;
        Ok(Self { path, file, length })
    }

    /// So many bytes from `start` on, to be read.
    fn piece(&mut self, start: u64, length: u64) -> Result<Take<&File>> {
        if start.checked_add(length).is_none_or(|end| end > self.length) {
            let message = format!("ends early: it has only {} bytes", self.length);
            return Err(Error::input(self.path, message));
        }
        self.file.seek(SeekFrom::Start(start)).map_err(|error| unreadable(self.path, &error))?;
        Ok((&self.file).take(length))
    }

    fn bytes<const N: usize>(&mut self, start: u64) -> Result<[u8; N]> {
        let mut bytes = [0; N];
        let read = self.piece(start, N as u64)?.read_exact(&mut bytes);
        read.map_err(|error| unreadable(self.path, &error)).map(|()| bytes)
    }
}

/// Whether the data format descriptor has the flag `KHR_DF_FLAG_ALPHA_PREMULTIPLIED`; not where it lies beyond the end.
///
/// Its byte is read in place: `ktx2` 0.5 panics at a descriptor with texel blocks of 256 texels.
fn is_premultiplied(file: &mut Pieces<'_>, index: &Index) -> bool {
    const FLAGS: u32 = (size_of::<u32>() + ktx2::dfd::BlockHeader::LENGTH + 3) as u32;
    let flags = file.bytes(u64::from(index.dfd_byte_offset) + u64::from(FLAGS));
    index.dfd_byte_length > FLAGS && flags.is_ok_and(|[flags]| flags & 1 == 1)
}

/// Writes `volume` as premultiplied R32G32B32A32_SFLOAT; it is read back bit for bit.
///
/// The file is written beside `path` and renamed, so that `path` is never half a file.
///
/// # Errors
/// [`Error::Output`] where the file cannot be written.
pub fn write_volume(path: &Path, volume: &Volume) -> Result<()> {
    let texels = Sample::Float32.encode(volume.texels.iter().flatten().copied(), 4);
    write_texture(path, volume.size, Sample::Float32, 4, AlphaMode::Premultiplied, &texels)
}

/// Writes the values of `raw` in `sample` format, beside `path` and then renamed.
///
/// Colours and opacities, and scalars too where the format is normalised, are divided by
/// [`RawVolume::full_scale`].
///
/// # Errors
/// [`Error::Usage`] where the format cannot hold a value, [`Error::Output`] where the file cannot be written.
pub fn write_raw(path: &Path, raw: &RawVolume, sample: Sample) -> Result<()> {
    let scale = stored_unit(raw, sample);
    let scaled = || raw.values.iter().map(|value| value / scale);
    if let Some(value) = scaled().find(|&value| !sample.can_store(value)) {
        let message = format!("{}: {sample:?} cannot hold the value {value}", raw.path.display());
        return Err(Error::Usage { message, help: Some("store it as 32-bit floats".into()) });
    }
    let texels = sample.encode(scaled(), raw.channels);
    write_texture(path, raw.size, sample, raw.channels, raw.alpha_mode, &texels)
}

/// The value of `raw` that is stored as 1.
pub(super) fn stored_unit(raw: &RawVolume, sample: Sample) -> f32 {
    let normalised = matches!(sample, Sample::Unorm8 | Sample::Srgb8 | Sample::Unorm16);
    if raw.channels > 1 || normalised { raw.full_scale } else { 1.0 }
}

fn write_texture(
    path: &Path,
    size: [u32; 3],
    sample: Sample,
    channels: u32,
    alpha_mode: AlphaMode,
    texels: &[u8],
) -> Result<()> {
    let prologue = prologue(size, sample, channels, alpha_mode, texels.len());
    let mut file = output::file_beside(path)?;
    let written = file.write_all(&prologue).and_then(|()| file.write_all(texels));
    written.map_err(|error| output::unwritable(path, &error))?;
    output::keep(file, path)
}

/// All that comes before the texels: header, level index, data format descriptor, key/value data, padding.
fn prologue(
    size: [u32; 3],
    sample: Sample,
    channels: u32,
    alpha_mode: AlphaMode,
    byte_count: usize,
) -> Vec<u8> {
    let format = sample.format(channels);
    let premultiplied = alpha_mode == AlphaMode::Premultiplied;
    let (basic, type_size) = Basic::from_format_with(format, premultiplied, None, None, None)
        .expect("every format of a Sample has a descriptor");
    let block = Block::Basic(basic).to_vec();
    let descriptor = [&(block.len() as u32 + 4).to_le_bytes(), block.as_slice()].concat();
    // Keys in the order of their bytes, as the specification asks for.
    let mut metadata = Vec::new();
    if channels == 2 {
        metadata.extend(key_value(b"KTXswizzle\0rrrg\0"));
    }
    metadata.extend(key_value(b"KTXwriter\0mesoshell\0"));

    let descriptor_start = Header::LENGTH + LevelIndex::LENGTH;
    let metadata_start = descriptor_start + descriptor.len();
    // Texels are aligned to the least common multiple of 4 and their size; 48 serves 1 to 16 bytes of them.
    let texels_start = (metadata_start + metadata.len()).next_multiple_of(48);
    let header = Header {
        format: Some(format),
        type_size,
        pixel_width: size[0],
        pixel_height: size[1],
        pixel_depth: size[2],
        layer_count: 0,
        face_count: 1,
        level_count: 1,
        supercompression_scheme: None,
        index: Index {
            dfd_byte_offset: descriptor_start as u32,
            dfd_byte_length: descriptor.len() as u32,
            kvd_byte_offset: metadata_start as u32,
            kvd_byte_length: metadata.len() as u32,
            sgd_byte_offset: 0,
            sgd_byte_length: 0,
        },
    };
    let level = LevelIndex {
        byte_offset: texels_start as u64,
        byte_length: byte_count as u64,
        uncompressed_byte_length: byte_count as u64,
    };
    let mut prologue = [&header.as_bytes()[..], &level.as_bytes(), &descriptor, &metadata].concat();
    prologue.resize(texels_start, 0);
    prologue
}

/// A key and its value, both ended by NUL, with length and padding.
fn key_value(pair: &[u8]) -> Vec<u8> {
    let mut entry = [&(pair.len() as u32).to_le_bytes(), pair].concat();
    entry.resize(entry.len().next_multiple_of(4), 0);
    entry
}

#[cfg(test)]
mod tests {
    use flate2::Compression;
    use flate2::read::ZlibEncoder;

    use super::*;
    use crate::volume::Interpretation;

    fn raw(sample: Sample, channels: u32) -> RawVolume {
        let size = [3, 2, 5];
        let words: Vec<u8> =
            (0..30 * channels).flat_map(|i| ((i * 97 % 256) as f32 / 255.0).to_le_bytes()).collect();
        let values = match sample {
            Sample::Float32 => sample.decode(&words, channels),
            _ => {
                let values = Sample::Float32.decode(&words, channels);
                sample.decode(&sample.encode(values.into_iter(), channels), channels)
            }
        };
        let alpha_mode = if channels == 4 { AlphaMode::Premultiplied } else { AlphaMode::Straight };
        let format = format!("KTX2 {:?}", sample.format(channels));
        RawVolume { path: "".into(), format, size, channels, values, full_scale: 1.0, alpha_mode }
    }

    #[test]
    fn what_is_written_is_read_bit_for_bit_here_and_by_the_ktx2_crate() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("round trip.ktx2");
        for sample in [Sample::Unorm8, Sample::Srgb8, Sample::Unorm16, Sample::Float16, Sample::Float32] {
            for channels in 1..=4 {
                let written = RawVolume { path: path.clone(), ..raw(sample, channels) };
                write_raw(&path, &written, sample).unwrap();
                assert_eq!(read(&path).unwrap(), written);

                let reader = ktx2::Reader::new(std::fs::read(&path).unwrap()).unwrap();
                let header = reader.header();
                assert_eq!(header.format, Some(sample.format(channels)));
                assert_eq!([header.pixel_width, header.pixel_height, header.pixel_depth], written.size);
                assert_eq!(header.type_size as usize, sample.bytes());
                assert_eq!(reader.writer(), Some("mesoshell\0"));
                assert_eq!(reader.is_alpha_premultiplied(), Some(channels == 4));
                let level = reader.levels().next().unwrap();
                assert_eq!(level.data, sample.encode(written.values.iter().copied(), channels));
                let offset = level.data.as_ptr() as usize - reader.data().as_ptr() as usize;
                assert_eq!((offset % 4, offset % (sample.bytes() * channels as usize)), (0, 0));
            }
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no partial file is left");
    }

    #[test]
    fn a_volume_survives_bit_for_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("v.ktx2");
        let texels = (0..24).map(|i| [i as f32 / 7.0, 1e-40, 0.0, i as f32 / 23.0]).collect();
        let volume = Volume::new([2, 3, 4], texels).unwrap();
        write_volume(&path, &volume).unwrap();
        assert_eq!(Volume::from_raw(read(&path).unwrap(), &Interpretation::default()).unwrap(), volume);
    }

    #[test]
    fn values_that_do_not_fit_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("v.ktx2");
        let mut hot = raw(Sample::Float32, 1);
        hot.values[4] = 1e5;
        write_raw(&path, &hot, Sample::Float32).unwrap();
        for sample in [Sample::Float16, Sample::Unorm8] {
            assert!(write_raw(&path, &hot, sample).unwrap_err().to_string().contains("100000"));
        }
        hot.full_scale = 1e5;
        write_raw(&path, &hot, Sample::Unorm8).unwrap();
    }

    #[test]
    fn zlib_is_inflated_and_bounded() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("z.ktx2");
        let plain = RawVolume { path: path.clone(), ..raw(Sample::Float32, 4) };
        write_raw(&path, &plain, Sample::Float32).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let start = bytes.len() - 480;
        let with_level = |texels: &[u8]| {
            let mut level = Vec::new();
            ZlibEncoder::new(texels, Compression::best()).read_to_end(&mut level).unwrap();
            let mut file = bytes[..start].to_vec();
            file[44] = 3;
            file[88..96].copy_from_slice(&(level.len() as u64).to_le_bytes());
            file.extend(level);
            std::fs::write(&path, file).unwrap();
            read(&path)
        };
        assert_eq!(with_level(&bytes[start..]).unwrap(), plain);
        for length in [479, 481, 10_000_000] {
            let message = with_level(&vec![0; length]).unwrap_err().to_string();
            assert!(message.contains("takes 480 bytes, but has"), "{message}");
        }
    }
}
