//! A solid whose height is an image: engraved or raised letters, terrain, a relief.
//!
//! A texel is filled as far as the surface around it leaves it: its neighbourhood's heights, [`FINER`] to a
//! texel, each count by their nearness. So upright walls are as soft as slopes.

use std::path::PathBuf;

use glam::Vec3;
use rayon::prelude::*;
use toml::de::DeTable;

use super::grid::{Grid, premultiplied, smoothstep};
use super::keys::keys;
use super::noise::Octaves;
use super::{Pattern, Source};
use crate::Result;
use crate::value::Colour;
use crate::volume::grey::Grey;

keys! {
    /// The keys of `recipe = "height-map"`.
    HeightMap {
        /// A PNG image, relative to the recipe file. It fills a tile, u to its right and v up. Grey is taken as the
        /// fraction of its full range, a colour as its linear luminance. Must be given.
        image: PathBuf = PathBuf::new();
        /// Height of what is black, as a share of the shell's thickness. Above `white`, the relief is inverted.
        black: f32 = 0.3, 0.02..=0.95;
        /// Height of what is white, as a share of the shell's thickness.
        white: f32 = 0.9, 0.02..=0.95;
        /// Radius over which the heights are smoothed, in tile widths.
        softness: f32 = 0.0, 0.0..=0.25;
        /// How strongly the stone's grain shows.
        grain: f32 = 0.5, 0.0..=1.0;
        /// How dark it is below the surroundings.
        occlusion: f32 = 0.7, 0.0..=1.0;
        /// Colour at the height of what is black.
        black_colour: Colour = Colour::srgb(0x5e371f);
        /// Colour at the height of what is white.
        white_colour: Colour = Colour::srgb(0xcdbfa6);
    }
}

/// Heights to a texel, along u and along v.
const FINER: usize = 3;

/// A height map with its image.
#[derive(Debug)]
struct Relief {
    keys: HeightMap,
    image: Grey,
}

/// Reads the keys and the image that they name.
pub(super) fn read(source: &Source, table: DeTable) -> Result<impl Pattern + use<>> {
    let keys: HeightMap = source.read(table)?;
    if keys.image.as_os_str().is_empty() {
        let help = "name a PNG image, relative to the recipe: `image = \"letters.png\"`";
        return Err(source.error(0..0, "`image` must be given".into(), "no image").with_help(help));
    }
    let path = source.folder.join(&keys.image);
    let image = Grey::read(&path)?;
    Ok(Relief { keys, image })
}

/// What a relief needs besides.
impl Grey {
    /// The same on a grid of `size`, each value a mean over what it stands for.
    fn resized(&self, size: [usize; 2]) -> Self {
        let taps = [self.size[0].div_ceil(size[0]), self.size[1].div_ceil(size[1])];
        let weight = 1. / (taps[0] * taps[1]) as f32;
        let mut values = vec![0.; size[0] * size[1]];
        values.par_chunks_mut(size[0]).enumerate().for_each(|(j, row)| {
            for (i, value) in row.iter_mut().enumerate() {
                let within = |index: usize, tap: usize, axis: usize| {
                    (index as f32 + (tap as f32 + 0.5) / taps[axis] as f32) / size[axis] as f32
                };
                let taps = (0..taps[1]).flat_map(|y| (0..taps[0]).map(move |x| (x, y)));
                *value = taps.map(|(x, y)| weight * self.between(within(i, x, 0), within(j, y, 1))).sum();
            }
        });
        Self { size, values }
    }

    /// Blurred over some `radius`, in tile widths: three times by a box, which is nearly a Gaussian.
    fn blurred(mut self, radius: f32) -> Self {
        for _ in 0..3 {
            for _ in 0..2 {
                self = self.blurred_along_x_and_turned(radius);
            }
        }
        self
    }

    fn blurred_along_x_and_turned(&self, radius: f32) -> Self {
        let [width, height] = self.size;
        // Three boxes of half the radius reach over half as much again.
        let reach = (0.5 * radius * width as f32).round() as i64;
        let mut values = vec![0.; width * height];
        values.par_chunks_mut(height).enumerate().for_each(|(x, column)| {
            for (y, value) in column.iter_mut().enumerate() {
                let sum: f32 = (-reach..=reach).map(|step| self.at(x as i64 + step, y as i64)).sum();
                *value = sum / (2 * reach + 1) as f32;
            }
        });
        Self { size: [height, width], values }
    }
}

impl Relief {
    /// How much of a texel is filled whose centre is at height `z` and whose indices are `i` and `j`.
    fn cover(&self, heights: &Grey, grid: &Grid, i: usize, j: usize, z: f32) -> f32 {
        // The slope of a smooth cubic, two texels wide, as the edges of `Grid::coverage` are.
        const REACH: i64 = FINER as i64 - 1;
        let weight = |step: i64| 1. - (step as f32 / FINER as f32).powi(2);
        let total: f32 = (-REACH..=REACH).map(weight).sum();
        let mut cover = 0.;
        for y in -REACH..=REACH {
            for x in -REACH..=REACH {
                let middle = |index: usize| (FINER * index + FINER / 2) as i64;
                let height = heights.at(middle(i) + x, middle(j) + y);
                cover += weight(x) * weight(y) * grid.coverage(z - height);
            }
        }
        (cover / (total * total)).min(1.)
    }
}

impl Pattern for Relief {
    fn draw(&self, grid: &Grid, seed: u32, texels: &mut [[f32; 4]]) {
        let HeightMap { black, white, softness, grain, occlusion, black_colour, white_colour, .. } =
            &self.keys;
        let mut heights = self.image.resized([FINER * grid.size[0], FINER * grid.size[1]]).blurred(*softness);
        heights.values.iter_mut().for_each(|value| *value = grid.height * (black + (white - black) * *value));
        // What lies around a point, as high as it is on average.
        let around = heights.resized([grid.size[0], grid.size[1]]).blurred(0.05);
        let range = grid.height * (white - black);
        let stone = Octaves { cells: 7, count: 5, gain: 0.75, finest: grid.finest_noise() };
        grid.slices(texels, |k, slice| {
            for (index, texel) in slice.iter_mut().enumerate() {
                let [i, j] = [index % grid.size[0], index / grid.size[0]];
                let position = grid.position(i, j, k);
                let cover = self.cover(&heights, grid, i, j, position.z);
                if cover > 0. {
                    let level = (position.z - black * grid.height) / if range == 0. { 1. } else { range };
                    let colour = Vec3::lerp(black_colour.0, white_colour.0, smoothstep(0.05, 0.7, level));
                    let sunk = (around.values[index] - position.z) / range.abs().max(0.05 * grid.height);
                    let light = 1. - occlusion * smoothstep(-0.2, 1.1, sunk);
                    let mottle = 1. + 1.2 * grain * stone.gradient(position, seed);
                    *texel = premultiplied(colour * light * mottle, cover);
                }
            }
        });
    }
}
