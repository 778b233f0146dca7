//! Fog: fractal gradient noise, thick at the base and thinning out towards the outer surface.

use glam::Vec3;

use super::Pattern;
use super::grid::{Grid, premultiplied, smoothstep};
use super::keys::keys;
use super::noise::{Octaves, flowing, turned};
use crate::value::Colour;

keys! {
    /// The keys of `recipe = "fog"`.
    Fog {
        /// Optical depth of a straight path through the whole shell where the fog is thickest.
        depth: f32 = 5.0, 0.0..=100.0;
        /// Swirls a tile.
        scale: u32 = 3, 1..=64;
        /// How many octaves of noise: 1 is soft, more are wispy.
        octaves: u32 = 4, 1..=10;
        /// How much the noise tears the fog apart: 0 is an even layer, 1 leaves holes.
        contrast: f32 = 0.8, 0.0..=1.0;
        /// How far the swirls are drawn out into wisps, in their own widths.
        swirl: f32 = 0.5, 0.0..=2.0;
        /// Where the swirls are in their motion; 1 is 0 again.
        phase: f32 = 0.0, 0.0..=1.0;
        /// How high the fog reaches, as a share of the shell's thickness.
        reach: f32 = 0.95, 0.05..=1.0;
        /// Colour where the fog is thick.
        colour: Colour = Colour::srgb(0xf2f4f7);
        /// Colour of the thin wisps.
        wisp_colour: Colour = Colour::srgb(0xc3cfdf);
    }
}

impl Fog {
    /// How far the fog at a point was blown, in tile widths.
    fn wind(&self, position: Vec3, seed: u32) -> Vec3 {
        let turned = turned(self.phase);
        let noise = |axis| flowing(position * self.scale as f32, [self.scale; 2], seed ^ axis, turned);
        Vec3::new(noise(0xa1), noise(0xa2), noise(0xa3)) * self.swirl / self.scale as f32
    }
}

impl Pattern for Fog {
    fn draw(&self, grid: &Grid, seed: u32, texels: &mut [[f32; 4]]) {
        let swirls =
            Octaves { cells: self.scale, count: self.octaves, gain: 0.5, finest: grid.finest_noise() };
        grid.fill(texels, |position| {
            let level = position.z / grid.height;
            let noise = swirls.flowing(position + self.wind(position, seed), seed, turned(self.phase));
            // The fog's ceiling rises and falls with the noise, so that its top is no plane.
            let ceiling = self.reach * (1. - 0.45 * self.contrast * (0.5 - 1.2 * noise).clamp(0., 1.));
            let thinning = smoothstep(ceiling, 0., level);
            let thickness = 1. - self.contrast * smoothstep(0.35, -0.3, noise);
            let density = thickness * thinning;
            let colour = Vec3::lerp(self.wisp_colour.0, self.colour.0, density.sqrt());
            premultiplied(colour, grid.opacity(self.depth * density))
        });
    }
}
