//! Grass: tufts of flat, tapered blades that bend over, on soil.
//!
//! A blade is a strand whose angle from the vertical grows towards the tip, with an elliptical section that is
//! wide across the bend. There is no lighting here, so the darkness between the blades is drawn into their
//! colour.

use std::f32::consts::TAU;

use glam::{Vec2, Vec3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;
use rayon::prelude::*;

use super::Pattern;
use super::grid::{Grid, lay_among, lay_over, smoothstep};
use super::keys::keys;
use super::noise::{Octaves, gradient, nearest_feature, random};
use super::strand::{Nearest, POINTS, Strand};
use crate::value::Colour;

keys! {
    /// The keys of `recipe = "grass"`.
    Grass {
        /// Blades a tile.
        density: u32 = 600, 0..=50_000;
        /// Length of the longest blades, as a share of the shell's thickness; bent over, they are less high.
        length: f32 = 0.97, 0.05..=1.0;
        /// How much shorter the shortest blades are, as a share of `length`.
        length_variation: f32 = 0.6, 0.0..=1.0;
        /// Half the width of a blade at its widest, in tile widths.
        width: f32 = 0.017, 0.001..=0.05;
        /// How much thinner the blades are than wide: 0 is round.
        flatness: f32 = 0.65, 0.0..=0.9;
        /// How narrow a blade grows towards its tip: 1 is a point.
        taper: f32 = 0.95, 0.0..=1.0;
        /// How far the tips are bent from the vertical, in degrees, on average.
        bend: f32 = 60.0, 0.0..=85.0;
        /// How far all blades are bent one way, as by the wind: 0 every way, 1 all one way.
        wind: f32 = 0.35, 0.0..=1.0;
        /// Where the wind blows to: degrees from u towards v.
        direction: f32 = 20.0, -360.0..=360.0;
        /// Tufts along a tile's side.
        tufts: u32 = 6, 1..=256;
        /// How far the roots of a tuft draw together: 0 not at all, 1 to a point.
        tufting: f32 = 0.35, 0.0..=1.0;
        /// How dark it is between the blades.
        occlusion: f32 = 0.85, 0.0..=1.0;
        /// How much blades and tufts differ in brightness.
        colour_variation: f32 = 0.5, 0.0..=1.0;
        /// The share of blades that are dry.
        dry: f32 = 0.08, 0.0..=1.0;
        /// Colour at the root.
        root_colour: Colour = Colour::srgb(0x8f8740);
        /// Colour at the tip.
        tip_colour: Colour = Colour::srgb(0x63b82b);
        /// Colour of dry blades.
        dry_colour: Colour = Colour::srgb(0xc9b377);
        /// Colour of the soil.
        soil_colour: Colour = Colour::srgb(0x4a3826);
    }
}

/// One blade.
struct Blade {
    strand: Strand,
    /// The horizontal direction in which the blade is wide; unit length.
    side: Vec3,
    root_colour: Vec3,
    tip_colour: Vec3,
}

impl Grass {
    /// The blades, whatever the grid.
    fn blades(&self, height: f32, seed: u32) -> Vec<Blade> {
        (0..self.density).into_par_iter().map(|index| self.blade(index, height, seed)).collect()
    }

    fn blade(&self, index: u32, height: f32, seed: u32) -> Blade {
        let mut random_of_blade = Pcg32::seed_from_u64(u64::from(seed) << 32 | u64::from(index));
        let mut draw = || random_of_blade.random::<f32>();
        let root = Vec2::new(draw(), draw());
        let tuft = nearest_feature(root.extend(0.) * self.tufts as f32, [self.tufts; 2], seed);
        let to_tuft = tuft.offset.truncate() / self.tufts as f32;
        let root = root + self.tufting * to_tuft;

        // Blades of a tuft bend away from its middle.
        let away = (-to_tuft * self.tufts as f32 * 1.5).clamp_length_max(1.);
        let any = Vec2::from_angle(TAU * draw());
        let gust = 0.7 * gradient((root * 3.).extend(0.5), [3; 2], seed ^ 0x5a);
        let blown = Vec2::from_angle(self.direction.to_radians() + gust) * 1.6 * self.wind;
        let bending = blown + (1. - self.wind) * (0.8 * away + any);
        let to = bending.normalize_or(any);
        let bend =
            (self.bend.to_radians() * (0.35 + bending.length().min(1.3) * (0.4 + 0.5 * draw()))).min(1.5);

        let tall = 0.5 * random(tuft.id, seed) + 0.5 * draw();
        let length = height * self.length * (1. - self.length_variation * (1. - tall));
        let step = length / (POINTS - 1) as f32;
        let mut place = root.extend(0.);
        let points = std::array::from_fn(|point| {
            let here = place;
            let t = (point as f32 + 0.5) / (POINTS - 1) as f32;
            let (sin, cos) = (bend * (0.12 + 0.88 * t.powf(1.3))).sin_cos();
            place += step * (to * sin).extend(cos);
            here
        });

        let brightness = 1. + self.colour_variation * (0.5 * random(tuft.id, seed ^ 0x21) + draw() - 0.75);
        let dryness = if draw() < self.dry { 0.6 + 0.4 * draw() } else { 0.25 * draw() * self.dry.sqrt() };
        let colour = |colour: Colour| colour.0.lerp(self.dry_colour.0, dryness) * brightness;
        Blade {
            strand: Strand { points },
            side: to.perp().extend(0.),
            root_colour: colour(self.root_colour),
            tip_colour: colour(self.tip_colour),
        }
    }

    /// Adds the part of a blade that is near the slice at height `z`.
    fn draw_blade(&self, blade: &Blade, grid: &Grid, z: f32, slice: &mut [[f32; 4]]) {
        let reach = self.width + grid.voxel();
        blade.strand.near_slice(grid, z, reach, slice, |nearest, texel| {
            let cover = self.cover_at(blade, nearest, grid.voxel());
            if cover > 0. {
                lay_among(texel, self.colour_at(blade, nearest, z / grid.height), cover);
            }
        });
    }

    /// How much of a voxel the blade fills. One thinner than a voxel is drawn a voxel thick, and fainter.
    fn cover_at(&self, blade: &Blade, nearest: &Nearest, voxel: f32) -> f32 {
        let along = nearest.along;
        let narrowing = 1. - self.taper * along * along * (1.5 - 0.5 * along);
        let wide = self.width * narrowing * smoothstep(-0.5, 0.3, along);
        let thick = wide * (1. - self.flatness);
        let drawn = Vec2::new(wide, thick).max(Vec2::splat(0.5 * voxel));
        let fainter = (wide / drawn.x) * (thick / drawn.y);

        let across = blade.side.dot(nearest.offset);
        let off = (nearest.offset.length_squared() - across * across).max(0.).sqrt();
        let section = Vec2::new(across, off) / drawn;
        // First order in the distance from the ellipse; exact on it.
        let radius = section.length();
        let distance = radius * (radius - 1.) / (section / drawn).length().max(1e-6);
        // The estimate is up to a tenth too steep off the axes of the ellipse.
        fainter * smoothstep(voxel, -voxel, 0.9 * distance.max(-drawn.y)) * smoothstep(1., 0.85, along)
    }

    fn colour_at(&self, blade: &Blade, nearest: &Nearest, level: f32) -> Vec3 {
        let colour = blade.root_colour.lerp(blade.tip_colour, smoothstep(0.05, 0.7, nearest.along));
        // One half of a blade, beside its rib, is turned to the light.
        let half = 1. + 0.3 * self.occlusion * (blade.side.dot(nearest.offset) / self.width).clamp(-1., 1.);
        let light = 1. - self.occlusion * (1. - smoothstep(-0.05, 0.85, level));
        colour * half * light
    }
}

impl Pattern for Grass {
    fn draw(&self, grid: &Grid, seed: u32, texels: &mut [[f32; 4]]) {
        let blades = self.blades(grid.height, seed);
        let soil = Octaves { cells: 10, count: 4, gain: 0.6, finest: grid.finest_noise() };
        let relief = 0.03 * grid.height;
        grid.slices(texels, |k, slice| {
            let z = grid.position(0, 0, k).z;
            let ground = 1.5 * grid.voxel() + relief;
            if z < ground + 1.04 * relief + grid.voxel() {
                for (index, texel) in slice.iter_mut().enumerate() {
                    let position = grid.position(index % grid.size[0], index / grid.size[0], k);
                    let noise = soil.gradient(position.with_z(0.), seed ^ 0x77);
                    let colour = self.soil_colour.0 * (1. - 0.8 * self.occlusion) * (1. + noise);
                    lay_over(texel, colour, grid.coverage(z - ground - relief * noise));
                }
            }
            for blade in &blades {
                self.draw_blade(blade, grid, z, slice);
            }
        });
    }
}
