//! Trees: a wood seen from above, of broad-leaved trees and conifers on mossy ground.
//!
//! A tree is a tapered trunk and a crown of leaf blobs: ellipsoids whose surface cellular noise breaks up into
//! tufts. The blobs of a broad-leaved tree lie on an ellipsoid around the end of its trunk, those of a conifer
//! on rings that narrow towards its top.

use std::f32::consts::TAU;

use glam::{Vec2, Vec3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

use super::Pattern;
use super::grid::{Grid, lay_among, lay_over, smoothstep};
use super::keys::keys;
use super::noise::Octaves;
use crate::value::Colour;

keys! {
    /// The keys of `recipe = "trees"`.
    Trees {
        /// The most trees a tile; fewer where they would not have room.
        count: u32 = 18, 0..=500;
        /// Radius of the largest crowns, in tile widths.
        crown: f32 = 0.125, 0.01..=0.3;
        /// How much smaller trees may be.
        variation: f32 = 0.45, 0.0..=0.9;
        /// How far crowns may overlap: 0 not at all, 1 entirely.
        overlap: f32 = 0.25, 0.0..=0.9;
        /// The share of the trees that are conifers.
        conifers: f32 = 0.35, 0.0..=1.0;
        /// Leaf blobs a crown.
        blobs: u32 = 26, 1..=100;
        /// How deep the crowns are broken up into tufts of leaves.
        raggedness: f32 = 0.85, 0.0..=1.0;
        /// Height of a broad-leaved tree's trunk below its crown, as a share of the tree's height.
        trunk: f32 = 0.3, 0.0..=0.7;
        /// How dark it is under and between the leaves.
        occlusion: f32 = 0.85, 0.0..=1.0;
        /// How much trees differ in brightness.
        colour_variation: f32 = 0.4, 0.0..=1.0;
        /// Colour of the leaves.
        leaf_colour: Colour = Colour::srgb(0x6f9a35);
        /// Colour of the leaves of some trees; the others lie between this and `leaf_colour`.
        autumn_colour: Colour = Colour::srgb(0xc9962f);
        /// Colour of the needles.
        needle_colour: Colour = Colour::srgb(0x3d7a52);
        /// Colour of the bark.
        bark_colour: Colour = Colour::srgb(0x5f4632);
        /// Colour of the ground.
        ground_colour: Colour = Colour::srgb(0x5d6b2c);
    }
}

/// A tuft of leaves, in tile space; not wrapped.
struct Blob {
    centre: Vec3,
    /// Half axes along x and y, and along z.
    radii: Vec2,
    colour: Vec3,
    /// 0 at the bottom of its crown, 1 at the top.
    level: f32,
}

/// A trunk: a cone from the ground up.
struct Trunk {
    foot: Vec2,
    top: f32,
    radius: f32,
}

/// All that stands on a tile.
#[derive(Default)]
struct Wood {
    trunks: Vec<Trunk>,
    blobs: Vec<Blob>,
}

impl Trees {
    /// Plants the trees; one after another, since each looks where the others stand.
    fn wood(&self, height: f32, floor: f32, seed: u32) -> Wood {
        const THROWS: u32 = 60;
        let mut random = Pcg32::seed_from_u64(u64::from(seed));
        let mut planted: Vec<(Vec2, f32)> = Vec::new();
        let mut wood = Wood::default();
        let throws = THROWS * self.count;
        for throw in 0..throws {
            if planted.len() == self.count as usize {
                break;
            }
            let size = 1. - self.variation * throw as f32 / throws as f32;
            let radius = self.crown * size;
            let foot = Vec2::new(random.random(), random.random());
            let free = planted.iter().all(|(other, other_radius)| {
                let apart = foot - other;
                (apart - apart.round()).length() >= (1. - self.overlap) * (radius + other_radius)
            });
            if free {
                planted.push((foot, radius));
                let top = floor + (0.93 * height - floor) * (1. - 0.7 * (1. - size));
                self.plant(&mut wood, foot, radius, floor..top, &mut random);
            }
        }
        // Upper blobs are drawn over lower ones.
        wood.blobs.sort_by(|a, b| a.centre.z.total_cmp(&b.centre.z));
        wood
    }

    fn plant(
        &self,
        wood: &mut Wood,
        foot: Vec2,
        radius: f32,
        span: std::ops::Range<f32>,
        random: &mut Pcg32,
    ) {
        let mut draw = || random.random::<f32>();
        let tall = span.end - span.start;
        let conifer = draw() < self.conifers;
        let brightness = 1. + self.colour_variation * (draw() - 0.5);
        let autumn = smoothstep(0.6, 1.05, draw());
        let colour = match conifer {
            true => self.needle_colour.0,
            false => self.leaf_colour.0.lerp(self.autumn_colour.0, autumn),
        };
        let (radius, trunk) = if conifer { (0.8 * radius, 0.12) } else { (radius, self.trunk) };
        let bottom = span.start + trunk * tall;
        let crown = span.end - bottom;
        wood.trunks.push(Trunk { foot, top: bottom + 0.6 * crown, radius: 0.16 * radius });
        let turn = draw();
        for index in 0..self.blobs {
            let part = (index as f32 + 0.5) / self.blobs as f32;
            // The golden angle spreads any number of blobs evenly.
            let angle = TAU * (turn + 0.618_034 * index as f32) + 0.5 * (draw() - 0.5);
            let (level, out, size) = if conifer {
                // Even over the mantle of a cone, most of which is low.
                let level = 1. - (1. - part).sqrt();
                (level, 0.68 * (1. - level), 0.12 + 0.26 * (1. - level))
            } else {
                // Even over the upper three quarters of a sphere.
                let up = 1. - 1.5 * (1. - part);
                (0.5 + 0.5 * up, 0.62 * (1. - up * up).sqrt(), 0.34 + 0.12 * draw())
            };
            let blob =
                Vec2::new(size * radius, (size * radius).min(0.3 * crown) * if conifer { 0.8 } else { 1. });
            let centre = Vec2::from_angle(angle) * out * radius;
            // The lowest and the highest blobs end where the crown does.
            let z = bottom + blob.y + level * (crown - 2. * blob.y);
            let colour = colour * brightness * (1. + 0.5 * (draw() - 0.5));
            wood.blobs.push(Blob { centre: (foot + centre).extend(z), radii: blob, colour, level });
        }
    }

    fn draw_trunk(&self, trunk: &Trunk, grid: &Grid, z: f32, slice: &mut [[f32; 4]]) {
        let off_top = z - trunk.top;
        if off_top > grid.voxel() {
            return;
        }
        // The roots spread.
        let spread = 1. + 0.8 * smoothstep(0.15 * grid.height, 0., z) - 0.4 * (z / trunk.top).min(1.);
        let radius = trunk.radius * spread;
        let reach = radius + grid.voxel();
        let light = 1. - self.occlusion * (0.35 + 0.35 * smoothstep(0., trunk.top, z));
        for (j, y) in grid.between(1, trunk.foot.y - reach, trunk.foot.y + reach) {
            for (i, x) in grid.between(0, trunk.foot.x - reach, trunk.foot.x + reach) {
                let off_side = Vec2::new(x, y).distance(trunk.foot) - radius;
                // One thinner than a voxel is drawn a voxel thick, and fainter.
                let fainter = (2. * radius / grid.voxel()).min(1.);
                let cover = fainter * grid.coverage(off_side.max(off_top));
                lay_over(&mut slice[j * grid.size[0] + i], self.bark_colour.0 * light, cover);
            }
        }
    }

    fn draw_blob(&self, blob: &Blob, grid: &Grid, z: f32, seed: u32, slice: &mut [[f32; 4]]) {
        let depth = 0.7 * self.raggedness * blob.radii.y;
        let reach = blob.radii + 0.5 * depth + grid.voxel();
        if (z - blob.centre.z).abs() > reach.y {
            return;
        }
        let leaves = Octaves { cells: 22, count: 2, gain: 0.5, finest: grid.finest_noise() };
        let centre = blob.centre;
        for (j, y) in grid.between(1, centre.y - reach.x, centre.y + reach.x) {
            for (i, x) in grid.between(0, centre.x - reach.x, centre.x + reach.x) {
                let position = Vec3::new(x, y, z);
                let scaled = (position - centre) / Vec3::new(blob.radii.x, blob.radii.x, blob.radii.y);
                let smooth = (scaled.length() - 1.) * blob.radii.y;
                if smooth > 0.5 * depth + grid.voxel() {
                    continue;
                }
                let tuft = leaves.billows(position, seed ^ 0x1e);
                // The tufts make the estimate of the distance too steep.
                let cover = grid.coverage(0.6 * (smooth - depth * (tuft - 0.5)));
                if cover > 0. {
                    let up = smoothstep(-0.7, 1., scaled.z / scaled.length().max(0.3));
                    let high = 0.3 + 0.7 * smoothstep(-0.2, 0.9, blob.level);
                    let outer = 0.45 + 0.55 * smoothstep(0.2, 0.75, tuft);
                    let light = 1. - self.occlusion * (1. - (0.25 + 0.75 * up) * high * outer);
                    lay_among(&mut slice[j * grid.size[0] + i], blob.colour * light, cover);
                }
            }
        }
    }

    /// Draws the slice's part of the ground, which is darker under the trees.
    fn draw_ground(&self, wood: &Wood, floor: f32, grid: &Grid, k: usize, seed: u32, slice: &mut [[f32; 4]]) {
        let z = grid.position(0, 0, k).z;
        let relief = 0.03 * grid.height;
        if z > floor + 1.04 * relief + grid.voxel() {
            return;
        }
        let moss = Octaves { cells: 8, count: 4, gain: 0.7, finest: grid.finest_noise() };
        for (index, texel) in slice.iter_mut().enumerate() {
            let position = grid.position(index % grid.size[0], index / grid.size[0], k);
            let noise = moss.gradient(position.with_z(0.), seed ^ 0x77);
            let shadow = wood.trunks.iter().map(|trunk| {
                let apart = position.truncate() - trunk.foot;
                // A crown's radius is some six of its trunk's.
                smoothstep(7. * trunk.radius, 2. * trunk.radius, (apart - apart.round()).length())
            });
            let light = 1. - self.occlusion * (0.25 + 0.55 * shadow.fold(0., f32::max));
            let colour = self.ground_colour.0 * light * (1. + 1.2 * noise);
            lay_over(texel, colour, grid.coverage(z - floor - relief * noise));
        }
    }
}

impl Pattern for Trees {
    fn draw(&self, grid: &Grid, seed: u32, texels: &mut [[f32; 4]]) {
        let floor = (0.05 * grid.height).max(1.5 * grid.voxel()).min(0.3 * grid.height);
        let wood = self.wood(grid.height, floor, seed);
        grid.slices(texels, |k, slice| {
            let z = grid.position(0, 0, k).z;
            self.draw_ground(&wood, floor, grid, k, seed, slice);
            for trunk in &wood.trunks {
                self.draw_trunk(trunk, grid, z, slice);
            }
            for blob in &wood.blobs {
                self.draw_blob(blob, grid, z, seed, slice);
            }
        });
    }
}
