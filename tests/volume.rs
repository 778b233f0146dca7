//! Volume files that are damaged, lie or mean harm: each is an `Error::Input` that names the file and what is
//! wrong with it, told without a panic and without the memory that the file claims to need.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use mesoshell::Error;
use mesoshell::mesh::obj;
use mesoshell::value::Colour;
use mesoshell::volume::{
    AlphaMode, ControlPoint, Interpretation, RawVolume, Sample, TransferFunction, Volume, info, read,
    write_raw, write_volume,
};
use tempfile::TempDir;

/// A folder for one test's file.
struct Scratch(TempDir);

impl Scratch {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// The message about a file with `bytes`, which must name the file, and its exit code must be that of input.
    fn refusal(&self, name: &str, bytes: &[u8]) -> String {
        let path = self.path(name);
        std::fs::write(&path, bytes).unwrap();
        refusal(&path, read(&path))
    }
}

fn refusal<T>(path: &Path, result: mesoshell::Result<T>) -> String {
    match result.err().expect("the file is to be refused") {
        error @ Error::Input { .. } => {
            let message = error.to_string();
            assert!(message.starts_with(&*path.to_string_lossy()), "{message}");
            message
        }
        other => panic!("{other:?}"),
    }
}

fn small_ktx2(folder: &Scratch) -> Vec<u8> {
    let path = folder.path("good.ktx2");
    let texels = (0..24).map(|i| [0.0, 0.25, 0.5, i as f32 / 24.0]).collect();
    write_volume(&path, &Volume::new([4, 3, 2], texels).unwrap()).unwrap();
    read(&path).unwrap();
    std::fs::read(path).unwrap()
}

fn nrrd(fields: &str, data: &[u8]) -> Vec<u8> {
    [format!("NRRD0005\n{fields}\n\n").as_bytes(), data].concat()
}

const SMALL_NRRD: &str = "type: float\ndimension: 3\nsizes: 2 2 2\nendian: little\nencoding: raw";

#[test]
fn missing_and_foreign_files() {
    let folder = Scratch::new();
    let missing = folder.path("none.ktx2");
    assert!(refusal(&missing, read(&missing)).contains("cannot be read"));
    for bytes in [&b""[..], b"NRRD", b"\xabKTX 11\xbb\r\n\x1a\n", b"PK\x03\x04", &[0; 4096]] {
        assert!(folder.refusal("foreign.ktx2", bytes).contains("is no volume"));
    }
    let empty = Scratch::new();
    assert!(refusal(empty.0.path(), read(empty.0.path())).contains("no file matches `*.png`"));
    let pattern = folder.path("slice_*.png");
    assert!(refusal(&pattern, read(&pattern)).contains("slice_*.png"));
}

#[test]
fn ktx2_cut_anywhere() {
    let folder = Scratch::new();
    let good = small_ktx2(&folder);
    for length in 12..good.len() {
        assert!(folder.refusal("cut.ktx2", &good[..length]).contains("ends early"), "{length} bytes");
    }
}

#[test]
fn ktx2_with_any_byte_of_its_head_changed() {
    let folder = Scratch::new();
    let good = small_ktx2(&folder);
    let path = folder.path("changed.ktx2");
    let head = good.len() - 24 * 16;
    let mut refused = 0;
    for at in 12..head {
        for value in [0, 1, 2, 0x7f, 0x80, 0xff] {
            let mut bytes = good.clone();
            bytes[at] = value;
            std::fs::write(&path, bytes).unwrap();
            match read(&path) {
                Ok(raw) => assert_eq!(raw.values.len(), 96),
                error => {
                    refusal(&path, error);
                    refused += 1;
                }
            }
        }
    }
    assert!(refused > 100, "only {refused} changes were noticed");
}

#[test]
fn ktx2_headers_that_lie() {
    let folder = Scratch::new();
    let good = small_ktx2(&folder);
    let with = |at: usize, word: u32| {
        let mut bytes = good.clone();
        bytes[at..at + 4].copy_from_slice(&word.to_le_bytes());
        folder.refusal("lie.ktx2", &bytes)
    };
    // Fields of the header by their offsets: format 12, width 20, height 24, depth 28, layers 32, faces 36,
    // supercompression 44, level 0's offset 80 and length 88.
    assert!(with(12, 0).contains("VK_FORMAT_UNDEFINED"));
    assert!(with(12, 145).contains("BC7_UNORM_BLOCK"));
    assert!(with(12, 107).contains("R32G32B32A32_UINT"));
    assert!(with(20, 1 << 31).contains("2147483648 x 3 x 2"));
    assert!(with(20, 0).contains("zero pixel width"));
    assert!(with(24, 0).contains("4 x 0 x 2"));
    assert!(with(28, 0).contains("no 3D texture"));
    assert!(with(28, u32::MAX).contains("4294967295"));
    assert!(with(32, 2).contains("no 3D texture"));
    assert!(with(36, 6).contains("no 3D texture"));
    assert!(with(44, 1).contains("BasisLZ"));
    assert!(with(44, 2).contains("Zstandard"));
    assert!(with(44, 3).contains("zlib data is damaged"));
    assert!(with(84, u32::MAX).contains("ends early"));
    assert!(with(88, 16).contains("takes 384 bytes, but has 16"));
    let mut bytes = good.clone();
    for at in [20, 24, 28] {
        bytes[at..at + 4].copy_from_slice(&u32::MAX.to_le_bytes());
    }
    assert!(folder.refusal("lie.ktx2", &bytes).contains("claims 4294967295 x 4294967295 x 4294967295"));
}

#[test]
fn ktx2_with_a_bad_texel() {
    let folder = Scratch::new();
    let good = small_ktx2(&folder);
    let texels = good.len() - 24 * 16;
    for (value, name) in [(f32::NAN, "NaN"), (f32::INFINITY, "inf"), (f32::NEG_INFINITY, "-inf")] {
        let mut bytes = good.clone();
        // Texel (1, 2, 1), channel 2.
        let at = texels + ((12 + 2 * 4 + 1) * 4 + 2) * 4;
        bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
        let message = folder.refusal("nan.ktx2", &bytes);
        assert!(message.contains(&format!("channel 2 of texel (1, 2, 1) is {name}")), "{message}");
    }
}

#[test]
fn nrrd_cut_anywhere() {
    let folder = Scratch::new();
    let good = nrrd(SMALL_NRRD, &[0; 32]);
    std::fs::write(folder.path("good.nrrd"), &good).unwrap();
    assert_eq!(read(&folder.path("good.nrrd")).unwrap().size, [2, 2, 2]);
    for length in 7..good.len() {
        folder.refusal("cut.nrrd", &good[..length]);
    }
}

#[test]
fn nrrd_headers_that_lie() {
    let folder = Scratch::new();
    let sizes =
        |sizes: &str| folder.refusal("lie.nrrd", &nrrd(&SMALL_NRRD.replace("2 2 2", sizes), &[0; 32]));
    assert!(sizes("2048 2048 512").contains("fewer"));
    assert!(sizes("2147483648 1 1").contains("fewer"));
    assert!(sizes("0 2 2").contains("claims 0 x 2 x 2"));
    assert!(sizes("4294967296 1 1").contains("claims 4294967296"));
    assert!(sizes("4294967295 4294967295 4294967295").contains("claims"));
    assert!(sizes("2 2 -2").contains("line 4: `2 2 -2` is not a list of sizes"));
    assert!(sizes("99999999999999999999 1 1").contains("not a list of sizes"));
    assert!(sizes("2 2").contains("line 3: the dimension is 3, but there are 2 sizes"));
    assert!(sizes("2 2 1").contains("more than the 16 bytes"));

    let changed = |from: &str, to: &str| {
        assert!(SMALL_NRRD.contains(from));
        folder.refusal("lie.nrrd", &nrrd(&SMALL_NRRD.replace(from, to), &[0; 32]))
    };
    assert!(changed("float", "block").contains("line 2: the type `block`"));
    assert!(changed("type: float\n", "").contains("no field `type`"));
    assert!(changed("endian: little\n", "").contains("no field `endian`"));
    assert!(changed("little", "middle").contains("line 5: `middle`"));
    assert!(changed("raw", "bzip2").contains("line 6: the encoding `bzip2`"));
    assert!(changed("raw", "text").contains("is not a number"));
    assert!(changed("raw", "raw\nbyte skip: -2").contains("line 7"));
    assert!(changed("raw", "raw\nbyte skip: 9223372036854775807").contains("fewer"));
    assert!(changed("raw", "raw\nline skip: 18446744073709551615").contains("lines to skip"));
    assert!(changed("raw", "raw\nencoding: raw").contains("line 7: repeats the field of line 6"));
    assert!(changed("raw", "raw\ndata file: LIST").contains("line 7: data in several files"));
    assert!(changed("dimension: 3", "dimension 3").contains("line 3: `dimension 3`"));
    assert!(folder.refusal("lie.nrrd", b"NRRD0009\n").contains("line 1"));
}

#[test]
fn nrrd_text_and_gzip_are_bounded_by_what_the_file_holds() {
    let folder = Scratch::new();
    let fields = |encoding| SMALL_NRRD.replace("2 2 2", "65536 65536 16").replace("raw", encoding);
    assert!(folder.refusal("bomb.nrrd", &nrrd(&fields("text"), b"1 2 3")).contains("has only 3 of"));
    let mut bomb = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    bomb.write_all(&vec![0; 1 << 22]).unwrap();
    let bomb = bomb.finish().unwrap();
    assert!(folder.refusal("bomb.nrrd", &nrrd(&fields("gzip"), &bomb)).contains("fewer"));
    assert!(folder.refusal("bomb.nrrd", &nrrd(&SMALL_NRRD.replace("raw", "gzip"), &bomb)).contains("more"));
}

/// As long as no memory and no patience is: what a header does not promise is not read.
#[test]
fn a_file_of_a_tebibyte_is_not_read_to_its_end() {
    let folder = Scratch::new();
    let stretched = |name: &str, bytes: &[u8]| {
        let path = folder.path(name);
        std::fs::write(&path, bytes).unwrap();
        // A hole: it takes no place on the disk.
        std::fs::File::options().write(true).open(&path).unwrap().set_len(1 << 40).unwrap();
        path
    };
    let path = stretched("long.nrrd", &nrrd(SMALL_NRRD, &[0; 32]));
    assert!(refusal(&path, read(&path)).contains("more than the 32 bytes"));
    let path = stretched("long.nrrd", &nrrd(&SMALL_NRRD.replace("raw", "text"), b"1 2 3 4 5 6 7 8"));
    assert!(refusal(&path, read(&path)).contains("has a word of more than"));
    let path = stretched("long.nrrd", &nrrd(&SMALL_NRRD.replace("raw", "raw\nbyte skip: -1"), &[]));
    assert_eq!(read(&path).unwrap().values, [0.0; 8], "its end");
    let path = stretched("long.nrrd", format!("NRRD0005\n{SMALL_NRRD}\n#").as_bytes());
    assert!(refusal(&path, read(&path)).contains("its header is longer than 1024 KiB"));
    // What follows level 0 is no matter of ours.
    let path = stretched("long.ktx2", &small_ktx2(&folder));
    assert_eq!(read(&path).unwrap(), RawVolume { path, ..read(&folder.path("good.ktx2")).unwrap() });
    let path = stretched("long.obj", b"v 0 0 0\n");
    assert!(refusal(&path, obj::load(&path, None)).contains("it is longer than 2048 MiB"));
}

#[cfg(unix)]
#[test]
fn a_pipe_is_no_volume_and_no_mesh() {
    let folder = Scratch::new();
    let path = folder.path("pipe");
    assert!(std::process::Command::new("mkfifo").arg(&path).status().unwrap().success());
    assert!(refusal(&path, read(&path)).contains("no regular file"));
    assert!(refusal(&path, obj::load(&path, None)).contains("no regular file"));
}

#[test]
fn images_that_are_cut_or_lie() {
    let folder = Scratch::new();
    let good = folder.path("0.png");
    image::GrayImage::new(40, 30).save(&good).unwrap();
    let bytes = std::fs::read(&good).unwrap();
    let stack = folder.path("?.png");
    assert_eq!(read(&stack).unwrap().size, [40, 30, 1]);
    for length in [0, 8, 20, 33, bytes.len() / 2] {
        let path = folder.path("1.png");
        std::fs::write(&path, &bytes[..length]).unwrap();
        assert!(refusal(&path, read(&stack)).contains("no readable PNG"), "{length} bytes");
    }
    std::fs::remove_file(folder.path("1.png")).unwrap();

    // A header of 30000 x 30000 pixels with a right checksum.
    let mut header = b"IHDR".to_vec();
    header.extend([30_000u32.to_be_bytes(), 30_000u32.to_be_bytes()].concat());
    header.extend([8, 0, 0, 0, 0]);
    let mut checksum = flate2::Crc::new();
    checksum.update(&header);
    let lie = [&bytes[..12], &header, &checksum.sum().to_be_bytes(), &bytes[33..]].concat();
    assert!(folder.refusal("2.png", &lie).contains("30000 x 30000 pixels"));
}

#[test]
fn a_volume_too_large_for_memory_is_told_so() {
    let folder = Scratch::new();
    // 2^29 texels that half a megabyte honestly holds, as members of 2^20 each.
    let mut member = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    member.write_all(&vec![0; 1 << 20]).unwrap();
    let zeros = member.finish().unwrap().repeat(1 << 9);
    let fields = "type: uint8\ndimension: 3\nsizes: 1024 1024 512\nencoding: gzip";
    let path = folder.path("large.nrrd");
    std::fs::write(&path, nrrd(fields, &zeros)).unwrap();
    let error = read(&path).unwrap_err();
    assert_eq!(error.exit_code(), 5);
    assert!(error.to_string().contains("large.nrrd"), "{error}");
}

#[test]
fn what_a_file_holds_becomes_a_medium() {
    let folder = Scratch::new();
    let path = folder.path("scalar.nrrd");
    let bytes: Vec<u8> = (0..8).collect();
    std::fs::write(&path, nrrd("type: uint8\ndimension: 3\nsizes: 2 2 2\nencoding: raw", &bytes)).unwrap();
    let found = info(&path).unwrap();
    assert_eq!((found.size, found.channels, found.texture_bytes), ([2, 2, 2], 1, 128));
    assert_eq!((found.ranges[0].min, found.ranges[0].max, found.ranges[0].mean), (0.0, 7.0, 3.5));

    let raw = read(&path).unwrap();
    let message = refusal(&path, Volume::from_raw(raw.clone(), &Interpretation::default()));
    assert!(message.contains("colour and opacity"), "{message}");
    let point = |value, alpha| ControlPoint { value, colour: Colour::linear(1.0, 0.0, 0.0), alpha };
    let transfer = TransferFunction::new(vec![point(0.0, 0.0), point(8.0, 1.0)]).unwrap();
    let interpretation = Interpretation { transfer: Some(transfer), ..Default::default() };
    let volume = Volume::from_raw(raw, &interpretation).unwrap();
    assert_eq!(volume.texel([1, 0, 1]), [0.625, 0.0, 0.0, 0.625]);
}

#[test]
fn a_converted_file_means_the_same() {
    let folder = Scratch::new();
    let path = folder.path("colour.nrrd");
    let bytes: Vec<u8> = (0..32).map(|i| i * 8).collect();
    std::fs::write(&path, nrrd("type: uint8\ndimension: 4\nsizes: 4 2 2 2\nencoding: raw", &bytes)).unwrap();
    let raw = read(&path).unwrap();
    let volume = |raw: RawVolume| Volume::from_raw(raw, &Interpretation::default()).unwrap();
    for sample in [Sample::Unorm8, Sample::Float32] {
        let converted = folder.path("colour.ktx2");
        write_raw(&converted, &raw, sample).unwrap();
        let read_back = read(&converted).unwrap();
        assert_eq!(read_back.alpha_mode, AlphaMode::Straight);
        assert_eq!(volume(read_back), volume(raw.clone()), "{sample:?}");
    }
}

#[test]
fn a_file_that_cannot_be_written_is_named() {
    let path = Scratch::new().path("gone/volume.ktx2");
    let volume = Volume::new([1, 1, 1], vec![[0.0; 4]]).unwrap();
    let error = write_volume(&path, &volume).unwrap_err();
    assert_eq!(error.exit_code(), 6);
    assert!(error.to_string().contains("volume.ktx2"), "{error}");
}
