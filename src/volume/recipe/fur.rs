//! Fur: thousands of thin curved strands over a layer of skin.
//!
//! The strands are grouped into clumps (the cells of cellular noise), whose strands share a length and a
//! direction and draw together at their tips. There is no lighting here, so the darkness between the strands
//! is drawn into their colour.

use std::f32::consts::TAU;

use glam::{Vec2, Vec3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;
use rayon::prelude::*;

use super::Pattern;
use super::grid::{Grid, lay_over, smoothstep};
use super::keys::keys;
use super::noise::{gradient, nearest_feature, random};
use super::strand::{Nearest, POINTS, Strand};
use crate::value::Colour;

keys! {
    /// The keys of `recipe = "fur"`.
    Fur {
        /// Strands a tile.
        density: u32 = 3000, 0..=100_000;
        /// Height of the longest strands as a share of the shell's thickness.
        length: f32 = 0.95, 0.05..=1.0;
        /// How much shorter the shortest strands are, as a share of `length`.
        length_variation: f32 = 0.5, 0.0..=1.0;
        /// Radius of a strand at its root, in tile widths.
        thickness: f32 = 0.005, 0.0005..=0.05;
        /// How much thinner the tip is than the root: 1 is a point.
        taper: f32 = 0.85, 0.0..=1.0;
        /// Radius of the curls at the tip, in tile widths.
        curl: f32 = 0.012, 0.0..=0.2;
        /// Turns that a curl makes from root to tip.
        curl_turns: f32 = 1.2, 0.0..=10.0;
        /// How far the tips lean over, as a share of the strand's height.
        lean: f32 = 0.8, 0.0..=4.0;
        /// Where the fur leans to: degrees from u towards v.
        direction: f32 = 30.0, -360.0..=360.0;
        /// How far the direction strays, in degrees.
        direction_variation: f32 = 40.0, 0.0..=180.0;
        /// Clumps along a tile's side.
        clumps: u32 = 9, 1..=256;
        /// How far the tips of a clump draw together: 0 not at all, 1 to a point.
        clumping: f32 = 0.7, 0.0..=1.0;
        /// How far the fur gives way along a crease in the middle of u: 0 not at all, 1 down to the skin.
        crease: f32 = 0.0, 0.0..=1.0;
        /// How far the crease reaches to either side, in tile widths.
        crease_width: f32 = 0.12, 0.01..=0.5;
        /// Opacity, over one voxel, of what strands fill entirely.
        opacity: f32 = 0.92, 0.0..=0.98;
        /// How dark the fur is at its roots: 0 as bright as at the tips, 1 black.
        occlusion: f32 = 0.9, 0.0..=1.0;
        /// Colour at the root.
        root_colour: Colour = Colour::srgb(0x6e3f20);
        /// Colour at the tip.
        tip_colour: Colour = Colour::srgb(0xf6cc92);
        /// How much strands differ in brightness.
        colour_variation: f32 = 0.5, 0.0..=1.0;
        /// Colour of the skin.
        skin_colour: Colour = Colour::srgb(0x2a1a10);
    }
}

/// One hair.
struct Hair {
    strand: Strand,
    /// Multiplies the hair's colour.
    brightness: f32,
}

impl Fur {
    /// The hairs, whatever the grid.
    fn hairs(&self, height: f32, seed: u32) -> Vec<Hair> {
        (0..self.density).into_par_iter().map(|index| self.hair(index, height, seed)).collect()
    }

    fn hair(&self, index: u32, height: f32, seed: u32) -> Hair {
        let mut random_of_hair = Pcg32::seed_from_u64(u64::from(seed) << 32 | u64::from(index));
        let mut spread = |range: f32| range * random_of_hair.random_range(-1f32..1.);
        // Martin Roberts' R2 sequence spreads any number of roots evenly over a tile that repeats.
        let even = |step: f64| (f64::from(index) * step).fract() as f32;
        let jitter = 0.35 / (self.density as f32).sqrt();
        let root = Vec2::new(
            even(0.754_877_666_246_692_8) + spread(jitter),
            even(0.569_840_290_998_053_3) + spread(jitter),
        );

        let cells = [self.clumps; 2];
        let clump = nearest_feature(root.extend(0.) * self.clumps as f32, cells, seed);
        let to_clump = clump.offset.truncate() / self.clumps as f32;
        let clump_height = random(clump.id, seed);
        let clump_turn = random(clump.id, seed ^ 0x7a) * 2. - 1.;

        let shorter = self.length_variation * (0.6 * clump_height * clump_height + 0.4 * spread(1.).abs());
        let to_crease = root.x - root.x.floor() - 0.5;
        let creased = self.crease * smoothstep(self.crease_width, 0., to_crease.abs());
        let top = height * self.length * (1. - shorter) * (1. - 0.9 * creased);
        let swirl = gradient((root * 2.).extend(0.5), [2; 2], seed);
        let stray = self.direction_variation.to_radians() * (0.35 * clump_turn + 1.2 * swirl + spread(0.25));
        let leaning =
            Vec2::from_angle(self.direction.to_radians() + stray) * self.lean * top * (1. + spread(0.2));
        // What is beside the crease was combed away from it.
        let aside = Vec2::X * to_crease.signum() * creased * 1.2 * height;
        let phase = TAU * random(clump.id, seed ^ 0x33) + spread(0.8);
        let brightness = 1. + self.colour_variation * (0.5 * clump_turn + spread(0.7));

        let points = std::array::from_fn(|point| {
            let t = point as f32 / (POINTS - 1) as f32;
            let angle = phase + TAU * self.curl_turns * t;
            let curl = self.curl * t * (Vec2::from_angle(angle) - Vec2::from_angle(phase));
            let across = root + (leaning + aside) * t.powf(1.6) + to_clump * self.clumping * t * t + curl;
            across.extend(top * t)
        });
        Hair { strand: Strand { points }, brightness }
    }

    /// Adds the part of a hair that is near the slice at height `z`.
    fn draw_hair(&self, hair: &Hair, grid: &Grid, z: f32, slice: &mut [[f32; 4]]) {
        let reach = self.thickness + grid.voxel();
        hair.strand.near_slice(grid, z, reach, slice, |nearest, texel| {
            let cover = self.cover_at(nearest, grid.voxel());
            if cover > 0. {
                lay_over(texel, self.colour_at(hair, nearest.along, z / grid.height), cover);
            }
        });
    }

    /// How much of a voxel the hair fills. One thinner than a voxel is drawn a voxel wide, and fainter.
    fn cover_at(&self, nearest: &Nearest, voxel: f32) -> f32 {
        let radius = self.thickness * (1. - self.taper * nearest.along);
        let thinness = (2. * radius / voxel).min(1.);
        let tip = smoothstep(1., 0.7, nearest.along);
        thinness * tip * smoothstep(radius + voxel, radius - voxel, nearest.offset.length())
    }

    fn colour_at(&self, hair: &Hair, along: f32, level: f32) -> Vec3 {
        let colour = Vec3::lerp(self.root_colour.0, self.tip_colour.0, smoothstep(0., 1., along));
        let light = 1. - self.occlusion * (1. - smoothstep(-0.05, 0.85, level));
        colour * hair.brightness * light
    }
}

impl Pattern for Fur {
    fn draw(&self, grid: &Grid, seed: u32, texels: &mut [[f32; 4]]) {
        let hairs = self.hairs(grid.height, seed);
        let skin = self.skin_colour.0;
        grid.slices(texels, |k, slice| {
            let z = grid.position(0, 0, k).z;
            let cover = smoothstep(3. * grid.voxel(), 0., z);
            for texel in slice.iter_mut() {
                lay_over(texel, skin * (1. - self.occlusion), cover);
            }
            for hair in &hairs {
                self.draw_hair(hair, grid, z, slice);
            }
            for texel in slice {
                *texel = texel.map(|channel| channel * self.opacity);
            }
        });
    }
}
