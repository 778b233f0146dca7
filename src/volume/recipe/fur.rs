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

/// Points of a strand's centre line, from root to tip.
const POINTS: usize = 20;

/// One strand, in tile widths; not wrapped.
struct Strand {
    points: [Vec3; POINTS],
    /// Multiplies the strand's colour.
    brightness: f32,
}

/// Where a point lies along a strand.
struct Nearest {
    /// 0 at the root, 1 at the tip.
    along: f32,
    /// To the centre line, in tile widths.
    distance: f32,
}

impl Fur {
    /// The strands, whatever the grid.
    fn strands(&self, height: f32, seed: u32) -> Vec<Strand> {
        (0..self.density).into_par_iter().map(|index| self.strand(index, height, seed)).collect()
    }

    fn strand(&self, index: u32, height: f32, seed: u32) -> Strand {
        let mut random_of_strand = Pcg32::seed_from_u64(u64::from(seed) << 32 | u64::from(index));
        let mut spread = |range: f32| range * random_of_strand.random_range(-1f32..1.);
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
        let top = height * self.length * (1. - shorter);
        let swirl = gradient((root * 2.).extend(0.5), [2; 2], seed);
        let stray = self.direction_variation.to_radians() * (0.35 * clump_turn + 1.2 * swirl + spread(0.25));
        let leaning =
            Vec2::from_angle(self.direction.to_radians() + stray) * self.lean * top * (1. + spread(0.2));
        let phase = TAU * random(clump.id, seed ^ 0x33) + spread(0.8);
        let brightness = 1. + self.colour_variation * (0.5 * clump_turn + spread(0.7));

        let points = std::array::from_fn(|point| {
            let t = point as f32 / (POINTS - 1) as f32;
            let angle = phase + TAU * self.curl_turns * t;
            let curl = self.curl * t * (Vec2::from_angle(angle) - Vec2::from_angle(phase));
            let across = root + leaning * t.powf(1.6) + to_clump * self.clumping * t * t + curl;
            across.extend(top * t)
        });
        Strand { points, brightness }
    }

    /// Adds the part of a strand that is near the slice at height `z`.
    fn draw_strand(&self, strand: &Strand, grid: &Grid, z: f32, slice: &mut [[f32; 4]]) {
        let reach = self.thickness + grid.voxel();
        let above = strand.points.partition_point(|point| point.z <= z + reach).min(POINTS - 1);
        let below = strand.points.partition_point(|point| point.z < z - reach).saturating_sub(1);
        let near = &strand.points[below..=above];
        let last = strand.points[POINTS - 1].z;
        if last < z - reach || near.len() < 2 {
            return;
        }
        let low = near.iter().copied().reduce(Vec3::min).unwrap_or_default() - reach;
        let high = near.iter().copied().reduce(Vec3::max).unwrap_or_default() + reach;
        for (j, y) in grid.between(1, low.y, high.y) {
            for (i, x) in grid.between(0, low.x, high.x) {
                let position = Vec3::new(x, y, z);
                let Some(nearest) = nearest_on(near, below, position, reach) else { continue };
                let cover = self.cover_at(&nearest, grid.voxel());
                if cover > 0. {
                    let colour = self.colour_at(strand, nearest.along, z / grid.height);
                    lay_over(&mut slice[j * grid.size[0] + i], colour, cover);
                }
            }
        }
    }

    /// How much of a voxel the strand fills. One thinner than a voxel is drawn a voxel wide, and fainter.
    fn cover_at(&self, nearest: &Nearest, voxel: f32) -> f32 {
        let radius = self.thickness * (1. - self.taper * nearest.along);
        let thinness = (2. * radius / voxel).min(1.);
        let tip = smoothstep(1., 0.7, nearest.along);
        thinness * tip * smoothstep(radius + voxel, radius - voxel, nearest.distance)
    }

    fn colour_at(&self, strand: &Strand, along: f32, level: f32) -> Vec3 {
        let colour = Vec3::lerp(self.root_colour.0, self.tip_colour.0, smoothstep(0., 1., along));
        let light = 1. - self.occlusion * (1. - smoothstep(-0.05, 0.85, level));
        colour * strand.brightness * light
    }
}

/// The nearest place on the centre line `points`, whose first is point `first` of its strand; none where it
/// is farther than `reach`.
fn nearest_on(points: &[Vec3], first: usize, position: Vec3, reach: f32) -> Option<Nearest> {
    let mut squared = reach * reach;
    let mut nearest = None;
    for (index, ends) in points.windows(2).enumerate() {
        let (edge, to) = (ends[1] - ends[0], position - ends[0]);
        let t = (to.dot(edge) / edge.length_squared()).clamp(0., 1.);
        let distance = (to - t * edge).length_squared();
        if distance < squared {
            squared = distance;
            nearest = Some((first + index) as f32 + t);
        }
    }
    nearest.map(|place| Nearest { along: place / (POINTS - 1) as f32, distance: squared.sqrt() })
}

impl Pattern for Fur {
    fn draw(&self, grid: &Grid, seed: u32, texels: &mut [[f32; 4]]) {
        let strands = self.strands(grid.height, seed);
        let skin = self.skin_colour.0;
        grid.slices(texels, |k, slice| {
            let z = grid.position(0, 0, k).z;
            let cover = smoothstep(3. * grid.voxel(), 0., z);
            for texel in slice.iter_mut() {
                lay_over(texel, skin * (1. - self.occlusion), cover);
            }
            for strand in &strands {
                self.draw_strand(strand, grid, z, slice);
            }
            for texel in slice {
                *texel = texel.map(|channel| channel * self.opacity);
            }
        });
    }
}
