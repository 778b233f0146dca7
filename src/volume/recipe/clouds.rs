//! Clouds: a sparse layer of cumulus with flat grey bottoms and billowing white tops.
//!
//! The shape is fractal gradient noise whose rim cellular noise eats into, after Andrew Schneider, "The
//! Real-Time Volumetric Cloudscapes of Horizon: Zero Dawn", SIGGRAPH 2015 course. There is no lighting here,
//! so the light that falls from straight above is drawn into the colour.

use glam::Vec3;
use rayon::prelude::*;

use super::Pattern;
use super::grid::{Grid, premultiplied, smoothstep};
use super::keys::keys;
use super::noise::{Octaves, turned};
use crate::value::Colour;

keys! {
    /// The keys of `recipe = "clouds"`.
    Clouds {
        /// The share of the sky that is under clouds, roughly.
        coverage: f32 = 0.6, 0.0..=1.0;
        /// Optical depth of a straight path through a cloud as thick as the shell.
        depth: f32 = 50.0, 0.0..=200.0;
        /// Clouds along a tile's side.
        scale: u32 = 2, 1..=64;
        /// How many octaves of noise give them their shape.
        octaves: u32 = 4, 1..=10;
        /// Where the clouds are in their motion; 1 is 0 again.
        phase: f32 = 0.0, 0.0..=1.0;
        /// Billows along a tile's side.
        billows: u32 = 6, 1..=256;
        /// How deep the billows cut into the clouds.
        billowing: f32 = 0.8, 0.0..=1.0;
        /// How softly the clouds end: 0 is as sharp as the grid can hold.
        softness: f32 = 0.2, 0.0..=1.0;
        /// Height of the bottoms as a share of the shell's thickness.
        bottom: f32 = 0.08, 0.0..=0.9;
        /// How dark the clouds grow towards their bottoms.
        shade: f32 = 0.85, 0.0..=1.0;
        /// Colour of the tops.
        top_colour: Colour = Colour::srgb(0xffffff);
        /// Colour where no light comes through.
        bottom_colour: Colour = Colour::srgb(0x5f6b80);
    }
}

/// A cloud at one point.
#[derive(Clone, Copy)]
struct Vapour {
    /// 0..1.
    density: f32,
    /// Height above the bottoms, 0..1.
    level: f32,
    /// 1 on the back of a billow, 0 in the crease between two.
    bulge: f32,
}

impl Vapour {
    const NONE: Self = Self { density: 0., level: 0., bulge: 0. };
}

impl Clouds {
    fn vapour(&self, grid: &Grid, position: Vec3, seed: u32) -> Vapour {
        // Nothing reaches the outer surface, and clouds are widest low down.
        let level = (position.z / grid.height - self.bottom) / (0.95 - self.bottom);
        if !(0. ..1.).contains(&level) || self.coverage <= 0. {
            return Vapour::NONE;
        }
        let narrowing = 0.6 * smoothstep(0.2, 0., level) + 1.1 * level * level;
        let finest = grid.finest_noise();
        let shape = Octaves { cells: self.scale, count: self.octaves, gain: 0.45, finest };
        let body = 1.6 * shape.flowing(position, seed, turned(self.phase)) + self.coverage - 0.5 - narrowing;
        // The billows add and take at most this much.
        let billowing = 0.9 * self.billowing;
        if body + 0.5 * billowing <= 0. {
            return Vapour::NONE;
        }
        let billows = Octaves { cells: self.billows, count: 3, gain: 0.45, finest };
        let bulge = billows.billows(position, seed ^ 0xb1);
        let rim = body + billowing * (bulge - 0.5);
        let density = smoothstep(0., 0.1 + 0.5 * self.softness, rim);
        Vapour { density, level, bulge: smoothstep(0.25, 0.65, bulge) }
    }

    /// The share of the skylight that comes to a point under `above`, an optical depth.
    fn light(&self, vapour: Vapour, above: f32) -> f32 {
        let through = (-0.12 * self.shade * above).exp();
        let height = 1. - 0.7 * self.shade * smoothstep(0.75, 0., vapour.level);
        let crease = 1. - 0.45 * self.shade * (1. - vapour.bulge);
        through * height * crease
    }
}

impl Pattern for Clouds {
    fn draw(&self, grid: &Grid, seed: u32, texels: &mut [[f32; 4]]) {
        grid.fill(texels, |position| {
            let Vapour { density, level, bulge } = self.vapour(grid, position, seed);
            [density, level, bulge, 0.]
        });
        grid.soften(texels);

        // From the top slice down, `above` is the optical depth over each column.
        let slice_texels = grid.size[0] * grid.size[1];
        let mut above = vec![0f32; slice_texels];
        let per_slice = self.depth / grid.size[2] as f32;
        for slice in texels.chunks_mut(slice_texels).rev() {
            slice.par_iter_mut().zip(&mut above).for_each(|(texel, above)| {
                let [density, level, bulge, _] = *texel;
                let half = 0.5 * density * per_slice;
                let light = self.light(Vapour { density, level, bulge }, *above + half);
                *above += 2. * half;
                let colour = Vec3::lerp(self.bottom_colour.0, self.top_colour.0, light);
                *texel = premultiplied(colour, grid.opacity(self.depth * density));
            });
        }
    }
}
