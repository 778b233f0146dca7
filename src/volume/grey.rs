//! Grey pictures that repeat: heights, factors.

use std::path::Path;

use super::stack;
use crate::{Error, Result};

/// Numbers on a grid that repeats.
#[derive(Debug, Clone)]
pub(crate) struct Grey {
    /// Pixels along u and v.
    pub size: [usize; 2],
    /// Row by row, v upwards.
    pub values: Vec<f32>,
}

impl Grey {
    /// Reads a PNG picture, u to its right: grey as the fraction of its full range, a colour as its linear luminance; 0..1.
    ///
    /// # Errors
    /// [`Error::Input`] where it cannot be read, is damaged, or is no single picture.
    pub fn read(path: &Path) -> Result<Self> {
        if path.is_dir() {
            return Err(Error::input(path, "is a folder, not an image"));
        }
        let raw = stack::read(path)?;
        if raw.size[2] != 1 {
            return Err(Error::input(path, format!("stands for {} images, not for one", raw.size[2])));
        }
        let luminance = |pixel: &[f32]| match *pixel {
            // The weights add up to 1, but for rounding.
            [red, green, blue, ..] => (0.2126 * red + 0.7152 * green + 0.0722 * blue).min(1.0),
            _ => pixel[0],
        };
        let (width, channels) = (raw.size[0] as usize, raw.channels as usize);
        // The last row comes first, since v goes up.
        let rows = raw.values.chunks_exact(width * channels).rev();
        let values: Vec<f32> = rows.flat_map(|row| row.chunks_exact(channels)).map(luminance).collect();
        Ok(Self { size: [width, values.len() / width], values })
    }

    /// That of a pixel, of which there is no end.
    pub fn at(&self, x: i64, y: i64) -> f32 {
        let [x, y] = [x.rem_euclid(self.size[0] as i64), y.rem_euclid(self.size[1] as i64)];
        self.values[y as usize * self.size[0] + x as usize]
    }

    /// The value between pixel centres; `x` and `y` in widths and heights of the picture.
    pub fn between(&self, x: f32, y: f32) -> f32 {
        let [x, y] = [x * self.size[0] as f32 - 0.5, y * self.size[1] as f32 - 0.5];
        let [i, j] = [x.floor(), y.floor()];
        let row = |j: i64| self.at(i as i64, j) + (self.at(i as i64 + 1, j) - self.at(i as i64, j)) * (x - i);
        row(j as i64) + (row(j as i64 + 1) - row(j as i64)) * (y - j)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_repeats_and_is_interpolated() {
        let map = Grey { size: [2, 1], values: vec![0.0, 1.0] };
        for (u, expected) in [(0.25, 0.0), (0.75, 1.0), (0.5, 0.5), (0.0, 0.5), (-0.75, 0.0), (7.375, 0.25)] {
            assert_eq!(map.between(u, 3.3), expected, "u {u}");
        }
    }
}
