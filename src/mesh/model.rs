//! A model: a mesh with materials and without normals, as it is voxelised. It need not be fit for a shell.

use std::path::{Path, PathBuf};

use glam::{DVec2, DVec3, Vec3};
use image::ImageReader;

use crate::frame::srgb::linear_from_srgb;
use crate::volume::{Quantity, Volume};
use crate::{Error, Result, input};

/// Triangles whose positions are welded, and what they are made of.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    /// Where it was read from, for messages.
    pub path: PathBuf,
    /// In the model's own units, right-handed with Y up; all finite, no two equal.
    pub positions: Vec<DVec3>,
    /// Three different position ids each, counter-clockwise seen from outside. Possibly none.
    pub triangles: Vec<[u32; 3]>,
    /// Texture coordinates of each triangle's corners; zero where the file has none.
    pub uvs: Vec<[DVec2; 3]>,
    /// For each triangle, the index of its material.
    pub triangle_materials: Vec<u32>,
    /// At least one.
    pub materials: Vec<Material>,
}

impl Model {
    /// Whether there are any texture coordinates.
    pub fn has_uvs(&self) -> bool {
        self.uvs.iter().flatten().any(|uv| *uv != DVec2::ZERO)
    }
}

/// The colour of a surface.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    /// Linear red, green, blue; multiplies the texture.
    pub colour: Vec3,
    /// What varies over the surface.
    pub texture: Option<Texture>,
}

impl Material {
    /// The linear colour at `uv`, averaged over about `footprint`, an area in the plane of texture coordinates.
    pub fn colour_at(&self, uv: DVec2, footprint: f64) -> Vec3 {
        let texture = self.texture.as_ref().map_or(Vec3::ONE, |texture| texture.at(uv, footprint));
        self.colour * texture
    }
}

/// A picture and its ever coarser copies; it repeats.
#[derive(Debug, Clone, PartialEq)]
pub struct Texture {
    levels: Vec<Level>,
}

#[derive(Debug, Clone, PartialEq)]
struct Level {
    width: usize,
    height: usize,
    /// Linear; row by row from v = 1 downwards, as pictures are stored.
    pixels: Vec<Vec3>,
}

impl Texture {
    /// Reads a PNG or JPEG picture in sRGB; its alpha is not read.
    ///
    /// # Errors
    /// [`Error::Input`] where it cannot be read or is damaged.
    pub fn read(path: &Path) -> Result<Self> {
        let unreadable = |error: String| {
            Error::input(path, format!("the texture cannot be read: {error}")).with_help(
                "textures are PNG or JPEG pictures; their names are relative to the file that names them",
            )
        };
        input::open(path).map_err(|error| unreadable(error.to_string()))?;
        // The reader's own limits bound the memory that a header may claim.
        let picture = ImageReader::open(path)
            .and_then(ImageReader::with_guessed_format)
            .map_err(|error| unreadable(error.to_string()))?
            .decode()
            .map_err(|error| unreadable(error.to_string()))?
            .into_rgb32f();
        let (width, height) = picture.dimensions();
        let pixels = picture.pixels().map(|pixel| Vec3::from(pixel.0.map(linear_from_srgb))).collect();
        Ok(Self::new(width as usize, height as usize, pixels))
    }

    /// The full texture as a volume of one texel along w, opaque; its v runs up, as texture coordinates do.
    pub fn volume(&self) -> Volume {
        let Level { width, height, pixels } = &self.levels[0];
        let rows = pixels.chunks(*width).rev();
        let texels = rows.flatten().map(|pixel| pixel.extend(1.0).to_array()).collect();
        Volume { size: [*width as u32, *height as u32, 1], texels, quantity: Quantity::Opacity }
    }

    /// A texture of `width * height` linear pixels, row by row from the top, which is v = 1.
    ///
    /// # Panics
    /// Where there are not so many pixels, or none.
    pub fn new(width: usize, height: usize, pixels: Vec<Vec3>) -> Self {
        assert!(!pixels.is_empty() && pixels.len() == width * height, "{width} x {height} pixels");
        let mut levels = vec![Level { width, height, pixels }];
        while let Some(coarser) = levels.last().and_then(Level::halved) {
            levels.push(coarser);
        }
        Self { levels }
    }

    /// Interpolated in the level whose pixels come nearest to `footprint` in area.
    fn at(&self, uv: DVec2, footprint: f64) -> Vec3 {
        let Level { width, height, .. } = self.levels[0];
        // A level has a quarter of the pixels of the one before.
        let level = (0.5 * (footprint * (width * height) as f64).log2()).round();
        self.levels[level.clamp(0.0, (self.levels.len() - 1) as f64) as usize].interpolated(uv)
    }
}

impl Level {
    /// Averages of two by two pixels, the last of an odd number left out; none of a single pixel.
    fn halved(&self) -> Option<Self> {
        if self.pixels.len() == 1 {
            return None;
        }
        let [width, height] = [self.width, self.height].map(|side| (side / 2).max(1));
        let average = |index: usize| {
            let (x, y) = (index % width, index / width);
            let pixel = |dx: usize, dy: usize| -> Vec3 {
                self.pixels[(2 * y + dy).min(self.height - 1) * self.width + (2 * x + dx).min(self.width - 1)]
            };
            0.25 * (pixel(0, 0) + pixel(1, 0) + pixel(0, 1) + pixel(1, 1))
        };
        Some(Self { width, height, pixels: (0..width * height).map(average).collect() })
    }

    fn interpolated(&self, uv: DVec2) -> Vec3 {
        let size = DVec2::new(self.width as f64, self.height as f64);
        let at = DVec2::new(uv.x, 1.0 - uv.y).rem_euclid(DVec2::ONE) * size - 0.5;
        let (base, part) = (at.floor(), at.fract_gl().as_vec2());
        let pixel = |dx: f64, dy: f64| {
            let wrapped = (base + DVec2::new(dx, dy)).rem_euclid(size).as_usizevec2();
            // A remainder may round up to the whole.
            self.pixels[wrapped.y.min(self.height - 1) * self.width + wrapped.x.min(self.width - 1)]
        };
        let upper = pixel(0.0, 0.0).lerp(pixel(1.0, 0.0), part.x);
        let lower = pixel(0.0, 1.0).lerp(pixel(1.0, 1.0), part.x);
        upper.lerp(lower, part.y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_lie_as_they_are_seen_and_repeat() {
        let pixels = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE];
        let texture = Texture::new(2, 2, pixels.to_vec());
        // Pixel centres: the upper row is at v = 3/4.
        for (pixel, uv) in pixels.into_iter().zip([[0.25, 0.75], [0.75, 0.75], [0.25, 0.25], [0.75, 0.25]]) {
            for whole in [0.0, 1.0, -3.0] {
                assert_eq!(texture.at(DVec2::from(uv) + whole, 0.0), pixel);
            }
        }
        assert_eq!(texture.at(DVec2::new(0.5, 0.75), 0.0), 0.5 * (Vec3::X + Vec3::Y));
        assert_eq!(texture.at(DVec2::new(0.0, 0.75), 0.0), 0.5 * (Vec3::X + Vec3::Y), "around the border");
        assert_eq!(texture.at(DVec2::ZERO, 1.0), Vec3::splat(0.5), "the average of the whole");
    }
}
