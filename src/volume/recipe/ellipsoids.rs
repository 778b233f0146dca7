//! Ellipsoids in a medium: translucent solids of several colours that float in a thin haze.
//!
//! Ellipsoids are thrown at the tile from large to small and stay where they do not touch those that are
//! there. Opacities are those of straight paths across the whole shell, so that a finer grid looks the same.

use std::f32::consts::TAU;

use glam::{Quat, Vec3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

use super::Pattern;
use super::grid::{Grid, premultiplied, smoothstep};
use super::keys::keys;
use super::noise::Octaves;
use crate::value::Colour;

keys! {
    /// The keys of `recipe = "ellipsoids"`.
    Ellipsoids {
        /// The most ellipsoids a tile; fewer where they would touch.
        count: u32 = 48, 0..=2000;
        /// Longest half axis of the largest ellipsoids, in tile widths.
        largest: f32 = 0.13, 0.01..=0.3;
        /// Longest half axis of the smallest ellipsoids, in tile widths; at most `largest` counts.
        smallest: f32 = 0.04, 0.005..=0.3;
        /// How much shorter the other two axes may be: 0 makes spheres.
        elongation: f32 = 0.5, 0.0..=0.9;
        /// Opacity of a path as long as the shell is thick, inside an ellipsoid.
        alpha: f32 = 0.995, 0.0..=0.9999999;
        /// How much denser the ellipsoids are towards their surface: 0 is even, 1 hollow; below 0 they are denser towards
        /// their heart, so that normals derived from them point outwards however deep one sees into them.
        rim: f32 = 0.6, -2.0..=1.0;
        /// Opacity of a straight path across the shell through the medium alone.
        medium_alpha: f32 = 0.3, 0.0..=0.9999999;
        /// How uneven the medium is.
        medium_contrast: f32 = 0.5, 0.0..=1.0;
        /// How dark the undersides of the ellipsoids are.
        occlusion: f32 = 0.7, 0.0..=1.0;
        /// How brightly the ellipsoids gleam where they face the sky.
        shine: f32 = 0.6, 0.0..=1.0;
        /// Colour of a third of the ellipsoids.
        first_colour: Colour = Colour::srgb(0xe8453c);
        /// Colour of another third.
        second_colour: Colour = Colour::srgb(0xf2b632);
        /// Colour of the last third.
        third_colour: Colour = Colour::srgb(0x2c9fb8);
        /// Colour of the medium.
        medium_colour: Colour = Colour::srgb(0x8fb4d9);
    }
}

/// One ellipsoid, in tile space.
struct Ellipsoid {
    /// x and y in 0..1.
    centre: Vec3,
    /// Half axes, the longest first.
    axes: Vec3,
    /// From tile space to the frame of the axes.
    turn: Quat,
    colour: Vec3,
}

impl Ellipsoids {
    /// Throws the ellipsoids; one after another, since each looks where the others are.
    fn ellipsoids(&self, height: f32, seed: u32) -> Vec<Ellipsoid> {
        const THROWS: u32 = 40;
        let mut random = Pcg32::seed_from_u64(u64::from(seed));
        let (largest, smallest) = (self.largest.min(0.44 * height), self.smallest.min(self.largest));
        let throws = THROWS * self.count;
        let mut ellipsoids: Vec<Ellipsoid> = Vec::new();
        for throw in 0..throws {
            if ellipsoids.len() == self.count as usize {
                break;
            }
            let progress = (throw as f32 / throws as f32).sqrt();
            let radius = largest * (smallest.min(largest) / largest).powf(progress);
            let mut draw = || random.random::<f32>();
            // The whole ellipsoid, and a little more, is inside the shell.
            let room = 0.94 * height - 2. * radius;
            let centre = Vec3::new(draw(), draw(), 0.02 * height + radius + room.max(0.) * draw());
            let free = ellipsoids.iter().all(|other| {
                let apart = centre - other.centre;
                let apart = apart - apart.with_z(0.).round();
                apart.length() >= 0.94 * (radius + other.axes.x)
            });
            let axes = radius * Vec3::new(1., 1. - self.elongation * draw(), 1. - self.elongation * draw());
            let up = 2. * draw() - 1.;
            let axis = Quat::from_rotation_z(TAU * draw()) * Vec3::new((1. - up * up).sqrt(), 0., up);
            let turn = Quat::from_axis_angle(axis, TAU * draw());
            let colours = [self.first_colour, self.second_colour, self.third_colour];
            let colour = colours[((3. * draw()) as usize).min(2)].0 * (0.8 + 0.4 * draw());
            if free {
                ellipsoids.push(Ellipsoid { centre, axes, turn, colour });
            }
        }
        ellipsoids
    }

    /// Mixes the part of an ellipsoid that crosses the slice at height `z` into the slice.
    fn draw_ellipsoid(&self, ellipsoid: &Ellipsoid, grid: &Grid, z: f32, slice: &mut [[f32; 4]]) {
        let reach = ellipsoid.axes.x + grid.voxel();
        if (z - ellipsoid.centre.z).abs() > reach {
            return;
        }
        let centre = ellipsoid.centre;
        for (j, y) in grid.between(1, centre.y - reach, centre.y + reach) {
            for (i, x) in grid.between(0, centre.x - reach, centre.x + reach) {
                let place = ellipsoid.place(Vec3::new(x, y, z) - centre);
                let cover = grid.coverage(place.distance);
                if cover > 0. {
                    let inside = self.jelly(ellipsoid, &place, grid);
                    let texel = &mut slice[j * grid.size[0] + i];
                    *texel = std::array::from_fn(|c| texel[c] + (inside[c] - texel[c]) * cover);
                }
            }
        }
    }

    /// The texel of a point inside an ellipsoid.
    fn jelly(&self, ellipsoid: &Ellipsoid, place: &Place, grid: &Grid) -> [f32; 4] {
        let density = 1. - self.rim * (1. - place.radius * place.radius).max(0.);
        let light = 1. - self.occlusion * smoothstep(0.9, -0.9, place.outward.z * place.radius.min(1.));
        let gleam = smoothstep(0.9, 1., place.outward.dot(Vec3::new(0.25, 0.3, 0.9).normalize()));
        let shine = self.shine * gleam * smoothstep(0.6, 0.9, place.radius);
        let colour = (ellipsoid.colour * light).lerp(Vec3::ONE, shine);
        premultiplied(colour, grid.opacity(density * depth(self.alpha)))
    }
}

/// Where a point lies to an ellipsoid.
struct Place {
    /// Distance to the surface, negative inside; in tile widths, first order.
    distance: f32,
    /// 0 at the centre, 1 on the surface.
    radius: f32,
    /// Normal of the surface that is through the point and has the same centre and proportions.
    outward: Vec3,
}

impl Ellipsoid {
    fn place(&self, from_centre: Vec3) -> Place {
        let local = self.turn * from_centre;
        let scaled = local / self.axes;
        let radius = scaled.length();
        let gradient = scaled / self.axes;
        let distance = radius * (radius - 1.) / gradient.length().max(1e-6);
        let outward = self.turn.inverse() * gradient.normalize_or(Vec3::Z);
        Place { distance: distance.max(-self.axes.min_element()), radius, outward }
    }
}

/// The optical depth of what has an opacity.
fn depth(alpha: f32) -> f32 {
    -(-alpha).ln_1p()
}

impl Pattern for Ellipsoids {
    fn draw(&self, grid: &Grid, seed: u32, texels: &mut [[f32; 4]]) {
        let ellipsoids = self.ellipsoids(grid.height, seed);
        let wisps = Octaves { cells: 3, count: 3, gain: 0.5, finest: grid.finest_noise() };
        grid.fill(texels, |position| {
            // Nothing reaches the outer surface.
            let level = position.z / grid.height;
            let even = smoothstep(0.97, 0.85, level);
            let uneven = 1. + 2. * self.medium_contrast * wisps.gradient(position, seed ^ 0x6d);
            let density = (even * uneven).max(0.) * depth(self.medium_alpha);
            premultiplied(self.medium_colour.0, grid.opacity(density))
        });
        grid.slices(texels, |k, slice| {
            let z = grid.position(0, 0, k).z;
            for ellipsoid in &ellipsoids {
                self.draw_ellipsoid(ellipsoid, grid, z, slice);
            }
        });
    }
}
