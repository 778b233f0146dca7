//! Files that hold a whole film: GIF, animated PNG, and YUV4MPEG2 for video encoders.

use std::io::Write;
use std::path::Path;

use color_quant::NeuQuant;

use crate::frame::{Backdrop, Image, file};
use crate::scene::Timeline;
use crate::{Error, Result, output};

/// What a film is written as.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FilmFormat {
    /// 256 colours for all frames together, dithered in a fixed pattern; opaque.
    Gif,
    /// Lossless.
    Apng,
    /// YUV4MPEG2: Y'CbCr of Rec. 709 in limited range, 8 bits, 4:4:4; what ffmpeg and others read from a pipe.
    Y4m,
}

impl FilmFormat {
    /// By the extension of a name: `.gif`, `.apng`, `.y4m`; `-` is standard output, for YUV4MPEG2.
    pub fn of(path: &Path) -> Option<Self> {
        if path == Path::new("-") {
            return Some(Self::Y4m);
        }
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "gif" => Some(Self::Gif),
            "apng" => Some(Self::Apng),
            "y4m" => Some(Self::Y4m),
            _ => None,
        }
    }
}

/// A film that is being made.
pub struct Film {
    format: FilmFormat,
    timeline: Timeline,
    size: [u32; 2],
    /// Of each frame, red, green and blue, 8 bits, sRGB.
    frames: Vec<Vec<u8>>,
}

impl Film {
    /// Of no frame yet.
    pub fn new(format: FilmFormat, timeline: Timeline, size: [u32; 2]) -> Self {
        Self { format, timeline, size, frames: Vec::new() }
    }

    /// Adds a frame; where its backdrop is none, it is laid on black.
    ///
    /// # Errors
    /// [`Error::Output`] where a value is not a number.
    pub fn add(&mut self, image: &Image, backdrop: &Backdrop) -> Result<()> {
        self.frames.push(file::opaque_srgb(image, backdrop)?);
        Ok(())
    }

    /// Writes the film, whole or not at all; to standard output where `path` is `-`.
    ///
    /// # Errors
    /// [`Error::Output`].
    pub fn write(&self, path: &Path) -> Result<()> {
        if path == Path::new("-") {
            let path = Path::new("standard output");
            let mut stdout = std::io::stdout().lock();
            return self
                .encode(path, &mut stdout)
                .and_then(|()| stdout.flush().map_err(|error| output::unwritable(path, &error)));
        }
        let mut file = output::file_beside(path)?;
        let mut writer = std::io::BufWriter::new(file.as_file_mut());
        self.encode(path, &mut writer)?;
        writer.flush().map_err(|error| output::unwritable(path, &error))?;
        drop(writer);
        output::keep(file, path)
    }

    fn encode(&self, path: &Path, writer: &mut dyn Write) -> Result<()> {
        let failed =
            |error: &dyn std::fmt::Display| output::error(path, format!("cannot be encoded: {error}"));
        match self.format {
            FilmFormat::Gif => self.gif(writer).map_err(|error| failed(&error)),
            FilmFormat::Apng => self.apng(writer).map_err(|error| failed(&error)),
            FilmFormat::Y4m => self.y4m(writer).map_err(|error| output::unwritable(path, &error)),
        }
    }

    /// The rate as a fraction of whole numbers.
    fn rate(&self) -> [u32; 2] {
        // Rates are at most 1000: milliseconds fit by far.
        let thousandths = (1000.0 * self.timeline.rate).round() as u32;
        match thousandths % 1000 {
            0 => [thousandths / 1000, 1],
            _ => [thousandths, 1000],
        }
    }

    fn gif(&self, writer: &mut dyn Write) -> Result<(), gif::EncodingError> {
        let [width, height] = self.size.map(|side| u16::try_from(side).unwrap_or(u16::MAX));
        // All frames have one palette, or their colours would flicker. Some 2^18 pixels are enough to learn it from.
        let pixels = self.frames.iter().map(|frame| frame.len() / 3).sum::<usize>();
        let every = (pixels >> 18).max(1) | 1;
        let pixel = |rgb: &[u8]| [rgb[0], rgb[1], rgb[2], 255];
        let samples = self.frames.iter().flat_map(|frame| frame.chunks_exact(3)).step_by(every);
        let samples: Vec<u8> = samples.flat_map(pixel).collect();
        let quantizer = NeuQuant::new(1, 256, &samples);
        let palette = quantizer.color_map_rgb();
        let mut encoder = gif::Encoder::new(writer, width, height, &palette)?;
        if self.timeline.loops {
            encoder.set_repeat(gif::Repeat::Infinite)?;
        }
        for (index, frame) in self.frames.iter().enumerate() {
            // Hundredths of a second, rounded so that the sum stays right.
            let at = |index: usize| (100.0 * index as f64 / self.timeline.rate).round() as u16;
            let row = self.size[0] as usize;
            let index_of = |(i, rgb): (usize, &[u8])| {
                let shift = dither(i % row, i / row);
                let shifted = [0, 1, 2].map(|k| (i32::from(rgb[k]) + shift).clamp(0, 255) as u8);
                quantizer.index_of(&pixel(&shifted)) as u8
            };
            let buffer: Vec<u8> = frame.chunks_exact(3).enumerate().map(index_of).collect();
            encoder.write_frame(&gif::Frame {
                delay: at(index + 1) - at(index),
                width,
                height,
                buffer: buffer.into(),
                ..gif::Frame::default()
            })?;
        }
        Ok(())
    }

    fn apng(&self, writer: &mut dyn Write) -> Result<(), png::EncodingError> {
        let [width, height] = self.size;
        let mut encoder = png::Encoder::new(writer, width, height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_animated(self.frames.len() as u32, if self.timeline.loops { 0 } else { 1 })?;
        let [numerator, denominator] = self.rate().map(|whole| u16::try_from(whole).unwrap_or(u16::MAX));
        encoder.set_frame_delay(denominator, numerator)?;
        let mut writer = encoder.write_header()?;
        for frame in &self.frames {
            writer.write_image_data(frame)?;
        }
        writer.finish()
    }

    fn y4m(&self, writer: &mut dyn Write) -> std::io::Result<()> {
        let ([width, height], [frames, seconds]) = (self.size, self.rate());
        writeln!(
            writer,
            "YUV4MPEG2 W{width} H{height} F{frames}:{seconds} Ip A1:1 C444 XCOLORRANGE=LIMITED"
        )?;
        for frame in &self.frames {
            writer.write_all(b"FRAME\n")?;
            for plane in 0..3 {
                let bytes: Vec<u8> =
                    frame.chunks_exact(3).map(|rgb| ycbcr([rgb[0], rgb[1], rgb[2]])[plane]).collect();
                writer.write_all(&bytes)?;
            }
        }
        Ok(())
    }
}

/// Rec. ITU-R BT.709, section 3, in limited range: 16..235, and 16..240 about 128.
fn ycbcr(rgb: [u8; 3]) -> [u8; 3] {
    let [r, g, b] = rgb.map(|byte| f64::from(byte) / 255.0);
    let luma = 0.2126 * r + 0.7152 * g + 0.0722 * b;
    let (cb, cr) = ((b - luma) / 1.8556, (r - luma) / 1.5748);
    [16.0 + 219.0 * luma, 128.0 + 224.0 * cb, 128.0 + 224.0 * cr].map(|value| value.round() as u8)
}

/// By how much a pixel is brighter before its colour is chosen, -6 to 6 of 255: about half of what two colours of a palette of 256 are
/// apart. A fixed pattern (Bayer 1973) does not crawl from frame to frame.
fn dither(x: usize, y: usize) -> i32 {
    const BAYER: [[i32; 4]; 4] = [[0, 8, 2, 10], [12, 4, 14, 6], [3, 11, 1, 9], [15, 7, 13, 5]];
    (2 * BAYER[y % 4][x % 4] - 15) * 6 / 15
}

/// Refuses a film whose frames its format cannot hold.
///
/// # Errors
/// [`Error::Usage`].
pub fn check_size(format: FilmFormat, [width, height]: [u32; 2]) -> Result<()> {
    if format == FilmFormat::Gif && width.max(height) > u32::from(u16::MAX) {
        return Err(Error::Usage {
            message: format!("a GIF has at most 65535 pixels a side, not {width} x {height}"),
            help: Some("write an .apng".into()),
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two frames of 2 x 1 pixels: red and grey, then grey and red.
    fn film(format: FilmFormat) -> Film {
        let timeline = Timeline { frames: 2, rate: 12.5, loops: true };
        let mut film = Film::new(format, timeline, [2, 1]);
        let (red, grey) = ([1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 0.0]);
        for rgba in [vec![red, grey], vec![grey, red]] {
            film.add(&Image { width: 2, height: 1, rgba }, &Backdrop::colour([0.2; 3])).unwrap();
        }
        film
    }

    fn encoded(format: FilmFormat) -> Vec<u8> {
        let mut bytes = Vec::new();
        film(format).encode("film".as_ref(), &mut bytes).unwrap();
        bytes
    }

    #[test]
    fn y4m_is_what_the_standard_says() {
        // Red: luma 0.2126, so Y' 62.56, Cb 128 - 224 * 0.2126 / 1.8556, Cr 240. Grey 0.2 is 124 in sRGB.
        let grey = (16.0 + 219.0 * 124.0 / 255.0_f64).round() as u8;
        let mut expected = b"YUV4MPEG2 W2 H1 F12500:1000 Ip A1:1 C444 XCOLORRANGE=LIMITED\n".to_vec();
        expected.extend(b"FRAME\n".iter().chain(&[63, grey, 102, 128, 240, 128]));
        expected.extend(b"FRAME\n".iter().chain(&[grey, 63, 128, 102, 128, 240]));
        assert_eq!(encoded(FilmFormat::Y4m), expected);
    }

    #[test]
    fn gif_and_apng_are_read_back() {
        let bytes = encoded(FilmFormat::Gif);
        let mut options = gif::DecodeOptions::new();
        options.set_color_output(gif::ColorOutput::RGBA);
        let mut decoder = options.read_info(&bytes[..]).unwrap();
        let mut seen = Vec::new();
        while let Some(frame) = decoder.read_next_frame().unwrap() {
            seen.push((frame.delay, frame.buffer.to_vec()));
        }
        assert_eq!(seen.len(), 2);
        assert!(seen.iter().all(|(delay, _)| *delay == 8), "a frame of 1/12.5 s");
        let is_red = |pixel: &[u8]| pixel[0] > 200 && pixel[1] < 60;
        assert!(is_red(&seen[0].1[..4]) && !is_red(&seen[0].1[4..]));
        assert!(!is_red(&seen[1].1[..4]) && is_red(&seen[1].1[4..]));

        let bytes = encoded(FilmFormat::Apng);
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        let control = *reader.info().animation_control().unwrap();
        assert_eq!((control.num_frames, control.num_plays), (2, 0));
        let mut frames = Vec::new();
        for _ in 0..2 {
            let mut pixels = vec![0; 6];
            reader.next_frame(&mut pixels).unwrap();
            frames.push(pixels);
        }
        assert_eq!(frames, [[255, 0, 0, 124, 124, 124], [124, 124, 124, 255, 0, 0]]);
    }
}
