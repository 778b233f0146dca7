//! Clouds: a sparse layer of cumulus with flat grey bottoms and billowing white tops.
//!
//! The shape is fractal gradient noise whose rim cellular noise eats into, after Andrew Schneider, "The
//! Real-Time Volumetric Cloudscapes of Horizon: Zero Dawn", SIGGRAPH 2015 course. There is no lighting here,
//! so the light that falls from straight above is drawn into the colour.

use glam::Vec3;
use rayon::prelude::*;

use super::Pattern;
use super::grid::{Grid, premultiplied, smoothstep};
use super::keys::{Colour, keys, srgb};
use super::noise::Octaves;

keys! {
    /// The keys of `recipe = "clouds"`.
    Clouds {
        /// The share of the sky that is under clouds, roughly.
        coverage: f32 = 0.55, 0.0..=1.0;
        /// Optical depth of a straight path through a cloud as thick as the shell.
        depth: f32 = 40.0, 0.0..=200.0;
        /// Clouds along a tile's side.
        scale: u32 = 2, 1..=64;
        /// How many octaves of noise give them their shape.
        octaves: u32 = 4, 1..=10;
        /// Billows along a tile's side.
        billows: u32 = 8, 1..=256;
        /// How deep the billows cut into the clouds.
        billowing: f32 = 0.65, 0.0..=1.0;
        /// How softly the clouds end: 0 is as sharp as the grid can hold.
        softness: f32 = 0.25, 0.0..=1.0;
        /// Height of the bottoms as a share of the shell's thickness.
        bottom: f32 = 0.08, 0.0..=0.9;
        /// How dark the clouds grow towards their bottoms.
        shade: f32 = 0.85, 0.0..=1.0;
        /// Colour of the tops.
        top_colour: Colour = srgb(0xffffff);
        /// Colour where no light comes through.
        bottom_colour: Colour = srgb(0x76808f);
    }
}

impl Clouds {
    /// The density at a point, 0..1.
    fn density(&self, grid: &Grid, position: Vec3, seed: u32) -> f32 {
        // Nothing reaches the outer surface, and clouds are widest low down.
        let level = (position.z / grid.height - self.bottom) / (0.97 - self.bottom);
        let profile = smoothstep(0., 0.18, level) * smoothstep(1., 0.15, level);
        if profile <= 0. || self.coverage <= 0. {
            return 0.;
        }
        let finest = grid.finest_noise();
        let shape = Octaves { cells: self.scale, count: self.octaves, gain: 0.45, finest };
        // Gradient noise is near normal with a deviation of about 0.22: this makes its share above 0 `coverage`.
        let body = shape.gradient(position, seed) * 1.6 + self.coverage - 0.5;
        let body = body - 0.75 * (1. - profile);
        if body <= -0.1 {
            return 0.;
        }
        let lumps = Octaves { cells: self.billows, count: 3, gain: 0.5, finest };
        let eaten = self.billowing * (0.75 - lumps.billows(position, seed ^ 0xb1)) * 0.9;
        let softness = 0.12 + 0.5 * self.softness;
        smoothstep(0., softness, body - eaten * smoothstep(0.7, 0., body))
    }
}

impl Pattern for Clouds {
    fn draw(&self, grid: &Grid, seed: u32, texels: &mut [[f32; 4]]) {
        grid.fill(texels, |position| [self.density(grid, position, seed); 4]);

        // From the top slice down, `light` is the depth of cloud above each column.
        let slice_texels = grid.size[0] * grid.size[1];
        let mut above = vec![0f32; slice_texels];
        let per_slice = self.depth / grid.size[2] as f32;
        for slice in texels.chunks_mut(slice_texels).rev() {
            slice.par_iter_mut().zip(&mut above).for_each(|(texel, above)| {
                let density = texel[0];
                *above += 0.5 * density * per_slice;
                let light = (-0.22 * self.shade * *above).exp();
                *above += 0.5 * density * per_slice;
                let colour = Vec3::lerp(self.bottom_colour.0, self.top_colour.0, light);
                *texel = premultiplied(colour, grid.opacity(self.depth * density));
            });
        }
    }
}
