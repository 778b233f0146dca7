//! Plain weave: warp threads along v and weft threads along u, over and under one another.
//!
//! A thread is a tube with an elliptical section around a sine. Its fibres are noise stretched along the
//! thread and twisted around it.

use std::f32::consts::{PI, TAU};

use glam::{Vec2, Vec3};

use super::Pattern;
use super::grid::{Grid, lay_over, smoothstep};
use super::keys::keys;
use super::noise::{gradient, random};
use crate::value::Colour;

keys! {
    /// The keys of `recipe = "weave"`.
    Weave {
        /// Pairs of threads a tile, in each direction: a pair because the weave repeats every two threads.
        pairs: u32 = 4, 1..=256;
        /// Width of a thread as a share of the distance to the next one.
        width: f32 = 0.76, 0.1..=1.0;
        /// Thickness of a thread as a share of its width: 1 is round. Less where the shell is too thin.
        roundness: f32 = 0.75, 0.1..=1.0;
        /// Turns of the yarn around itself a tile.
        twist: u32 = 6, 0..=256;
        /// How strongly the fibres show.
        fibres: f32 = 0.6, 0.0..=1.0;
        /// How much the threads differ from one another in brightness.
        variation: f32 = 0.25, 0.0..=1.0;
        /// How dark the cloth is between and under the threads.
        occlusion: f32 = 0.75, 0.0..=1.0;
        /// Opacity inside a thread.
        opacity: f32 = 1.0, 0.0..=1.0;
        /// Colour of the threads along v.
        warp_colour: Colour = Colour::srgb(0x2f5d8a);
        /// Colour of the threads along u.
        weft_colour: Colour = Colour::srgb(0xd9c7a3);
    }
}

/// The measures of the cloth, in tile widths.
struct Cloth {
    /// Threads a tile in each direction.
    threads: u32,
    half_width: f32,
    half_thickness: f32,
    /// Height of the cloth's middle plane.
    middle: f32,
}

/// Where a point lies in a thread.
struct Place {
    /// Distance to the thread's surface, negative inside; in tile widths.
    distance: f32,
    /// Position in the section; the surface is the unit circle.
    section: Vec2,
}

impl Weave {
    fn cloth(&self, grid: &Grid) -> Cloth {
        let threads = 2 * self.pairs;
        let half_width = 0.5 * self.width / threads as f32;
        let room = (0.25 * grid.height - 0.5 * grid.voxel()).max(0.05 * grid.height);
        let half_thickness = (self.roundness * half_width).min(room);
        let middle = (2. * half_thickness + grid.voxel()).min(0.5 * grid.height);
        Cloth { threads, half_width, half_thickness, middle }
    }

    /// The colour of a thread's yarn at a point of its section, `along` tile widths down its length.
    fn yarn(&self, colour: Vec3, thread: u32, along: f32, section: Vec2, seed: u32) -> Vec3 {
        // Cells along a thread are long and those across it are short.
        const ALONG: u32 = 10;
        const ACROSS: f32 = 3.5;
        const APART: f32 = 64.;
        let turned =
            Vec2::from_angle(TAU * (self.twist as f32 * along + random(thread, seed))).rotate(section);
        let point =
            Vec3::new(along * ALONG as f32, turned.x * ACROSS + APART * thread as f32, turned.y * ACROSS);
        let fibre = gradient(point, [ALONG, 1 << 20], seed);
        let brightness = 1. + self.variation * (random(thread, seed ^ 0x51) - 0.5) * 2.;
        // Skylight: the sides of a thread see less of it than its back.
        let facing = section.y / section.length().max(0.5);
        let light = 1. - 0.6 * self.occlusion * smoothstep(1., -0.3, facing);
        colour * brightness * light * (1. + self.fibres * 2. * fibre)
    }
}

impl Cloth {
    /// The place of a point in the thread that is `across` tile widths away at its nearest; `phase` is the
    /// angle of the thread's wave here, whose crests are at whole turns.
    fn place(&self, across: f32, z: f32, phase: f32) -> Place {
        let amplitude = self.half_thickness;
        let slope = -amplitude * PI * self.threads as f32 * phase.sin();
        let up = (z - self.middle - amplitude * phase.cos()) / (1. + slope * slope).sqrt();
        let radii = Vec2::new(self.half_width, self.half_thickness);
        let section = Vec2::new(across, up) / radii;
        // First order in the distance from the ellipse; exact on it.
        let radius = section.length();
        let steepness = (section / radii).length().max(1e-6);
        let distance = (radius * (radius - 1.) / steepness).max(-radii.min_element());
        Place { distance, section }
    }
}

impl Pattern for Weave {
    fn draw(&self, grid: &Grid, seed: u32, texels: &mut [[f32; 4]]) {
        let cloth = self.cloth(grid);
        let count = cloth.threads as f32;
        grid.fill(texels, |position| {
            // Thread `index` runs at (index + 1/2) / count, and is up where it crosses threads of its own parity.
            let at = |across: f32, along: f32, crest: f32| {
                let index = (across * count).floor();
                let phase = PI * (along * count - 0.5 + index + crest);
                (index as u32, cloth.place(across - (index + 0.5) / count, position.z, phase))
            };
            let (warp_index, warp) = at(position.x, position.y, 0.);
            let (weft_index, weft) = at(position.y, position.x, 1.);
            let level = (position.z - cloth.middle) / (2. * cloth.half_thickness);
            let light = 1. - self.occlusion * smoothstep(0.95, -0.4, level);
            let mut threads = [
                (
                    &weft,
                    self.yarn(self.weft_colour.0, weft_index + cloth.threads, position.x, weft.section, seed),
                ),
                (&warp, self.yarn(self.warp_colour.0, warp_index, position.y, warp.section, seed)),
            ];
            if warp.distance > weft.distance {
                threads.swap(0, 1);
            }
            let mut texel = [0.; 4];
            for (place, colour) in threads {
                lay_over(&mut texel, light * colour, self.opacity * grid.coverage(place.distance));
            }
            texel
        });
    }
}
