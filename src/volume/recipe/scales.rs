//! Scales: rows of overlapping plates, like roof tiles or the skin of a fish.
//!
//! The tip of a scale points along v and lies on the two scales of the next row, whose seam it covers. Every
//! row lies one lift below the row before it at the same v, so a whole number of rows repeats without an end.

use glam::{IVec2, Vec2, Vec3};

use super::Pattern;
use super::grid::{Grid, lay_over, smoothstep};
use super::keys::keys;
use super::noise::{Octaves, gradient, random};
use crate::value::Colour;

keys! {
    /// The keys of `recipe = "scales"`.
    Scales {
        /// Scales along a tile's side, in a row. There are twice as many rows.
        scales: u32 = 5, 1..=128;
        /// Length of a scale, in distances between rows.
        overlap: f32 = 3.0, 2.2..=5.0;
        /// Shape of the tips: 1 is a wedge, 2 an ellipse, 8 nearly square.
        outline: f32 = 1.7, 1.0..=8.0;
        /// Thickness of a scale as a share of the distance between rows. Less where the shell is too thin.
        thickness: f32 = 0.28, 0.05..=1.0;
        /// How far the tips stand up: 0 lies flat on the next row, 1 a row's distance above it.
        lift: f32 = 0.15, 0.0..=1.0;
        /// How far the sides bend down: 0 is flat, 1 down to the next row.
        dome: f32 = 0.8, 0.0..=1.0;
        /// Height of the ridge along the middle, in thicknesses.
        ridge: f32 = 0.5, 0.0..=2.0;
        /// How strongly the rings of growth show.
        growth: f32 = 0.35, 0.0..=1.0;
        /// How much the scales differ from one another in brightness.
        variation: f32 = 0.35, 0.0..=1.0;
        /// How brightly the scales gleam where they face the sky.
        shine: f32 = 0.5, 0.0..=1.0;
        /// How dark it is under the scales and beside the tips that lie on them.
        occlusion: f32 = 0.85, 0.0..=1.0;
        /// Colour of the scales where they come out.
        root_colour: Colour = Colour::srgb(0x16453f);
        /// Colour of the scales towards their tips.
        colour: Colour = Colour::srgb(0x2f8a6b);
        /// Colour of the rims.
        rim_colour: Colour = Colour::srgb(0xd9b45c);
        /// Colour of the skin under the scales.
        skin_colour: Colour = Colour::srgb(0x1b120d);
    }
}

/// The measures of the scales, in tile widths.
struct Coat {
    /// Scales along a tile's side.
    scales: i32,
    /// Distance between rows; a scale is twice as wide.
    row: f32,
    length: f32,
    half_width: f32,
    half_thickness: f32,
    /// Rise of a scale over its run.
    slope: f32,
    /// How far the sides and the tip bend down.
    dome: f32,
    /// Height of the skin.
    floor: f32,
}

/// What a scale is to a point.
#[derive(Clone, Copy)]
struct Place {
    /// Distance to the scale, negative inside; in tile widths.
    distance: f32,
    /// Distance to its outline seen from above, negative inside; in tile widths.
    to_outline: f32,
    /// From the middle of the root: across, in half widths; and along, 0 at the root, 1 at the tip.
    at: Vec2,
    /// Which scale: along its row, and the row, both wrapped.
    scale: IVec2,
}

impl Scales {
    fn coat(&self, grid: &Grid) -> Coat {
        let row = 0.5 / self.scales as f32;
        let floor = (0.06 * grid.height).max(grid.voxel()).min(0.2 * grid.height);
        let room = (grid.height - floor - 2. * grid.voxel()).max(0.3 * grid.height);
        let rise = self.thickness + self.lift;
        // The rise over all rows that lie on one another, a thickness, and the ridge on top.
        let wanted = row * (rise * self.overlap + self.thickness * (1. + self.ridge));
        let flattening = (room / wanted).min(1.);
        Coat {
            scales: self.scales as i32,
            row,
            length: self.overlap * row,
            half_width: 0.97 * row,
            half_thickness: 0.5 * flattening * self.thickness * row,
            slope: flattening * rise,
            dome: flattening * self.dome * rise * row,
            floor,
        }
    }

    /// The colour of a scale at a point; `shadow` is the distance, in rows, from the tip that lies on it.
    fn horn(&self, grid: &Grid, coat: &Coat, place: &Place, position: Vec3, shadow: f32, seed: u32) -> Vec3 {
        let id = (place.scale.y * coat.scales + place.scale.x) as u32;
        let brightness = 1. + self.variation * (random(id, seed) * 2. - 1.);
        // What is seen of a scale is its last two rows' lengths.
        let seen = smoothstep(1. - 2. / self.overlap, 1., place.at.y);
        let inward = -place.to_outline / coat.row;
        let rim = smoothstep(0.17, 0.04, inward);
        let ring = (inward * 30. + 3. * random(id, seed ^ 0x4d)).sin()
            * smoothstep(1., 3., 0.2 * coat.row / grid.voxel());
        // Streaks fan out along the scale.
        let streak =
            gradient(Vec3::new(place.at.x * 5. + 17. * id as f32, place.at.y * 2., 0.5), [1 << 20; 2], seed);
        let mottles = Octaves { cells: 6, count: 4, gain: 0.6, finest: grid.finest_noise() };
        let mottle = mottles.gradient(position, seed ^ 0x11);
        let grown = 1. + self.growth * (0.35 * ring + 0.9 * streak) + 0.5 * mottle;
        let colour = self.root_colour.0.lerp(self.colour.0, seen) * brightness * grown;
        let colour = colour.lerp(self.rim_colour.0 * (0.8 + 0.2 * brightness), 0.85 * rim);

        let open = smoothstep(-0.05, 0.75, shadow);
        let bend = 1. - 0.45 * place.at.x.abs().min(1.).powi(2);
        let light = 1. - self.occlusion * (1. - bend * (0.12 + 0.88 * open));
        // A gleam down the middle of what is seen, broken by the streaks.
        let gleam =
            smoothstep(0.5, 0., place.at.x.abs()) * smoothstep(0.35, 0.75, seen) * smoothstep(1., 0.8, seen);
        light * colour + Vec3::splat(0.35 * self.shine * gleam * open * (1. + streak).max(0.))
    }
}

impl Coat {
    /// Where a point lies to one scale.
    fn place(&self, scale: IVec2, position: Vec3, outline: f32, ridge: f32) -> Place {
        let across = position.x - self.across(scale);
        let along = position.y - scale.y as f32 * self.row;
        let at = Vec2::new(across / self.half_width, along / self.length);
        let to_outline = self.to_outline(Vec2::new(across, along), outline);
        let ridge =
            ridge * self.half_thickness * smoothstep(0.35, 0., at.x.abs()) * smoothstep(1., 0.6, at.y);
        let tip = smoothstep(0.6, 1., at.y);
        let sag = self.dome * (0.8 * at.x * at.x + 0.35 * tip * tip);
        let middle = self.floor + self.slope * along + ridge - sag;
        // The sheet is sheared, so a vertical distance is too long by the slope of its surface.
        let steepness =
            (1. + self.slope * self.slope + (1.6 * self.dome / self.half_width * at.x).powi(2)).sqrt();
        let off_sheet = (position.z - middle).abs() / steepness - self.half_thickness;
        // Rounded where the sheet meets its outline.
        let round = 0.8 * self.half_thickness;
        let corner = Vec2::new(to_outline, off_sheet) + round;
        let distance = corner.max(Vec2::ZERO).length() + corner.max_element().min(0.) - round;
        let scale = IVec2::new(scale.x.rem_euclid(self.scales), scale.y.rem_euclid(2 * self.scales));
        Place { distance, to_outline, at, scale }
    }

    /// Where the middle of a scale is along u.
    fn across(&self, scale: IVec2) -> f32 {
        (scale.x as f32 + 0.25 + 0.5 * (scale.y & 1) as f32) * 2. * self.row
    }

    /// Distance from a point, across and along a scale, to its outline: straight sides and a superellipse
    /// with the exponent `outline` over the last 1.6 rows. First order.
    fn to_outline(&self, point: Vec2, outline: f32) -> f32 {
        let end = 1.6 * self.row;
        let radii = Vec2::new(self.half_width, end);
        let tip = Vec2::new(point.x.abs(), (point.y - self.length + end).max(0.));
        let scaled = tip / radii;
        let powers = Vec2::new(scaled.x.powf(outline - 1.), scaled.y.powf(outline - 1.));
        let sum = powers.dot(scaled).max(1e-9);
        let radius = sum.powf(1. / outline);
        // The gradient of `radius`.
        let steepness = (powers / radii).length() * radius / sum;
        ((radius - 1.) / steepness.max(1e-6)).max(-0.5 * self.half_width).max(-point.y)
    }

    /// The scale of a row that is nearest to a point.
    fn nearest_of_row(&self, row: i32, x: f32) -> IVec2 {
        let column = x / (2. * self.row) - 0.25 - 0.5 * (row & 1) as f32;
        IVec2::new(column.round() as i32, row)
    }

    /// How far a point of row `row` lies, seen from above, from the tips of the two rows that lie on it; in rows.
    fn to_tips(&self, row: i32, position: Vec3, outline: f32) -> f32 {
        let above = [row - 1, row - 2].map(|row| {
            let scale = self.nearest_of_row(row, position.x);
            let point = Vec2::new(position.x - self.across(scale), position.y - row as f32 * self.row);
            self.to_outline(point, outline)
        });
        above[0].min(above[1]) / self.row
    }
}

impl Pattern for Scales {
    fn draw(&self, grid: &Grid, seed: u32, texels: &mut [[f32; 4]]) {
        let coat = self.coat(grid);
        grid.fill(texels, |position| {
            let mut texel = [0.; 4];
            let skin = self.skin_colour.0 * (1. - 0.7 * self.occlusion);
            lay_over(&mut texel, skin, grid.coverage(position.z - coat.floor));
            // From the lowest scale that reaches here to the highest.
            let last = ((position.y + grid.voxel()) / coat.row).floor() as i32;
            let first = ((position.y - grid.voxel() - coat.length) / coat.row).ceil() as i32;
            for row in (first..=last).rev() {
                let scale = coat.nearest_of_row(row, position.x);
                let place = coat.place(scale, position, self.outline, self.ridge);
                let cover = grid.coverage(place.distance);
                if cover > 0. {
                    let shadow = coat.to_tips(row, position, self.outline);
                    lay_over(&mut texel, self.horn(grid, &coat, &place, position, shadow, seed), cover);
                }
            }
            texel
        });
    }
}
