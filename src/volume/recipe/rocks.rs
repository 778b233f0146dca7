//! Rocks: rounded stones of many sizes, half sunk into the ground.
//!
//! Stones are thrown at the tile from large to small and stay where they do not overlap those that lie
//! there. A stone is an ellipsoid, blunted by a few random planes and roughened by noise.

use std::f32::consts::TAU;

use glam::{Quat, Vec2, Vec3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

use super::Pattern;
use super::grid::{Grid, lay_over, smoothstep};
use super::keys::keys;
use super::noise::Octaves;
use crate::value::Colour;

keys! {
    /// The keys of `recipe = "rocks"`.
    Rocks {
        /// Radius of the largest stones, in tile widths.
        largest: f32 = 0.15, 0.01..=0.3;
        /// Radius of the smallest stones, in tile widths; at most `largest` counts.
        smallest: f32 = 0.025, 0.005..=0.3;
        /// How many stones are thrown; those that fall on others do not stay.
        throws: u32 = 4000, 0..=50_000;
        /// How far stones may overlap: 0 not at all, 1 entirely.
        overlap: f32 = 0.18, 0.0..=0.9;
        /// How flat the stones are: 0 is round.
        flatness: f32 = 0.3, 0.0..=0.9;
        /// How angular the stones are: 0 is smooth.
        angularity: f32 = 0.5, 0.0..=1.0;
        /// Depth of the bumps as a share of a stone's radius.
        roughness: f32 = 0.1, 0.0..=0.5;
        /// Height of the ground as a share of the shell's thickness.
        ground: f32 = 0.2, 0.0..=0.9;
        /// How dark it is between the stones.
        occlusion: f32 = 0.9, 0.0..=1.0;
        /// How much the stones are mottled.
        mottling: f32 = 0.6, 0.0..=1.0;
        /// Colour of the lightest stones; the others lie between this and `dark_colour`.
        light_colour: Colour = Colour::srgb(0xb9b2a4);
        /// Colour of the darkest stones.
        dark_colour: Colour = Colour::srgb(0x6f675f);
        /// The colour of some of the stones.
        accent_colour: Colour = Colour::srgb(0x96785e);
        /// Colour of the ground.
        ground_colour: Colour = Colour::srgb(0x4b3d2e);
    }
}

/// Planes that blunt a stone.
const FACETS: usize = 9;

/// One stone.
struct Stone {
    /// In tile space; x and y in 0..1.
    centre: Vec3,
    /// Reach from the centre in any direction, in tile widths.
    radius: f32,
    /// To the stone's own frame, in which it is a unit sphere before it is blunted.
    turn: Quat,
    shape: Vec3,
    /// Outward normals and distances from the centre, in that frame.
    facets: [(Vec3, f32); FACETS],
    colour: Vec3,
}

impl Rocks {
    /// Throws the stones; one after another, since each looks where the others lie.
    fn stones(&self, height: f32, seed: u32) -> Vec<Stone> {
        let mut random = Pcg32::seed_from_u64(u64::from(seed));
        let smallest = self.smallest.min(self.largest);
        let mut stones: Vec<Stone> = Vec::new();
        for throw in 0..self.throws {
            let progress = throw as f32 / self.throws as f32;
            // Most throws are small stones, which fill the gaps.
            let radius = self.largest * (smallest / self.largest).powf(progress.sqrt());
            let place = Vec2::new(random.random(), random.random());
            let free = stones.iter().all(|other| {
                let apart = place - other.centre.truncate();
                let apart = apart - apart.round();
                apart.length() >= (1. - self.overlap) * (radius + other.radius)
            });
            if free {
                stones.push(self.stone(place, radius, height, &mut random));
            }
        }
        stones
    }

    fn stone(&self, place: Vec2, radius: f32, height: f32, random: &mut Pcg32) -> Stone {
        let mut spread = |low: f32, high: f32| low + (high - low) * random.random::<f32>();
        let mut direction = || {
            let z = spread(-1., 1.);
            Vec2::from_angle(TAU * spread(0., 1.)).extend(0.) * (1. - z * z).sqrt() + Vec3::Z * z
        };
        let facets = std::array::from_fn(|_| direction());
        let tilt = direction();
        let turn =
            Quat::from_axis_angle(tilt, spread(-0.35, 0.35)) * Quat::from_rotation_z(TAU * spread(0., 1.));
        let facets = facets.map(|normal| (normal, 1. - self.angularity * spread(0.1, 0.45)));
        let room = (0.94 * height - self.ground * height).max(0.05 * height);
        let upward = (radius * (1. - self.flatness * spread(0.6, 1.))).min(0.8 * room);
        let sunk = self.ground * height + upward * spread(-0.1, 0.2);
        let shape = Vec3::new(radius, radius * spread(0.72, 1.), upward);
        let stone = Vec3::lerp(self.dark_colour.0, self.light_colour.0, spread(0., 1.));
        let accent = smoothstep(0.62, 1., spread(0., 1.)) * 0.8;
        let colour = Vec3::lerp(stone, self.accent_colour.0, accent);
        Stone { centre: place.extend(sunk), radius, turn: turn.inverse(), shape, facets, colour }
    }

    fn draw_ground(&self, grid: &Grid, k: usize, seed: u32, slice: &mut [[f32; 4]]) {
        let relief = 0.1 * grid.height;
        let above = grid.position(0, 0, k).z - self.ground * grid.height;
        if above > 1.04 * relief + grid.voxel() {
            return;
        }
        let soil = Octaves { cells: 10, count: 4, gain: 0.6, finest: grid.finest_noise() };
        let light = 1. - 0.7 * self.occlusion;
        for (index, texel) in slice.iter_mut().enumerate() {
            let position = grid.position(index % grid.size[0], index / grid.size[0], k);
            let noise = soil.gradient(position.with_z(0.), seed ^ 0x77);
            let colour = self.ground_colour.0 * light * (1. + noise);
            lay_over(texel, colour, grid.coverage(above - relief * noise));
        }
    }

    /// Draws the part of a stone that crosses the slice at height `z`.
    fn draw_stone(&self, stone: &Stone, grid: &Grid, z: f32, seed: u32, slice: &mut [[f32; 4]]) {
        let reach = stone.radius * (1. + 1.7 * self.roughness) + 1.25 * grid.voxel();
        if (z - stone.centre.z).abs() > reach {
            return;
        }
        let bumps = Octaves { cells: 12, count: 4, gain: 0.4, finest: grid.finest_noise() };
        let mottles = Octaves { cells: 9, count: 5, gain: 0.75, finest: grid.finest_noise() };
        for (j, y) in grid.between(1, stone.centre.y - reach, stone.centre.y + reach) {
            for (i, x) in grid.between(0, stone.centre.x - reach, stone.centre.x + reach) {
                let position = Vec3::new(x, y, z);
                let from_centre = position - stone.centre;
                if from_centre.length_squared() > reach * reach {
                    continue;
                }
                let smooth = stone.distance(from_centre);
                if smooth > 1.25 * grid.voxel() + 1.7 * self.roughness * stone.radius {
                    continue;
                }
                let bump = bumps.gradient(position, seed) * self.roughness * stone.radius * 1.6;
                // The bumps make the estimate of the distance up to a fifth too steep.
                let alpha = grid.coverage(0.8 * (smooth - bump));
                if alpha > 0. {
                    let mottle = 1. + 1.6 * self.mottling * mottles.gradient(position, seed ^ 0x3d);
                    let colour = stone.colour * mottle * self.light(grid, z, from_centre.z / stone.shape.z);
                    lay_over(&mut slice[j * grid.size[0] + i], colour, alpha);
                }
            }
        }
    }

    /// The light that reaches a height `z`, `up` of the way from a stone's middle (0) to its top (1).
    fn light(&self, grid: &Grid, z: f32, up: f32) -> f32 {
        let open = 0.5 * smoothstep(self.ground - 0.1, self.ground + 0.5, z / grid.height);
        let facing = 0.5 * smoothstep(-0.4, 0.9, up);
        1. - self.occlusion * (1. - open - facing)
    }
}

impl Stone {
    /// Distance from a point to the smooth stone, negative inside; in tile widths, first order.
    fn distance(&self, from_centre: Vec3) -> f32 {
        // The larger, the sharper the edges of the facets.
        const SHARPNESS: f32 = 14.;
        let local = self.turn * from_centre / self.shape;
        let sphere = local.length();
        let sum: f32 = self
            .facets
            .iter()
            .map(|(normal, distance)| (SHARPNESS * (normal.dot(local) - distance)).exp())
            .sum();
        let blunted = (sum + (SHARPNESS * (sphere - 1.)).exp()).ln() / SHARPNESS;
        blunted * self.shape.min_element()
    }
}

impl Pattern for Rocks {
    fn draw(&self, grid: &Grid, seed: u32, texels: &mut [[f32; 4]]) {
        let stones = self.stones(grid.height, seed);
        grid.slices(texels, |k, slice| {
            let z = grid.position(0, 0, k).z;
            self.draw_ground(grid, k, seed, slice);
            for stone in &stones {
                self.draw_stone(stone, grid, z, seed, slice);
            }
        });
    }
}
