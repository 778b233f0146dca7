//! Chain mail: the European 4-in-1 weave, in which every ring holds two rings of the row before it and two of
//! the row after it.
//!
//! A ring is a torus. Rings lie in rows along u, each tilted about its row, rows alternately to and fro, so
//! that a row's far sides dip under where the next row's near sides dip too. With `R` the radius of a ring
//! and `a` the distance to the next in its row, rows that lie `a / 4` apart and shifted by `a / 2` are linked
//! for any tilt `t` with `s = a / (8 R cos t) < 1` and `a < 4 R sqrt(1 - s^2)`: then the plane of a ring cuts
//! a ring of the next row once inside the ring and once outside. At [`TILT`] no two wires touch.

use std::f32::consts::TAU;

use glam::{IVec2, Vec2, Vec3};

use super::Pattern;
use super::grid::{Grid, lay_over, smoothstep};
use super::keys::keys;
use super::noise::{Octaves, gradient, random};
use crate::value::Colour;

keys! {
    /// The keys of `recipe = "chain-mail"`.
    ChainMail {
        /// Rings along a tile's side, in a row. There are four times as many rows.
        rings: u32 = 4, 1..=128;
        /// Radius of the wire as a share of a ring's radius.
        wire: f32 = 0.16, 0.08..=0.22;
        /// How much the rings differ from one another in brightness.
        variation: f32 = 0.3, 0.0..=1.0;
        /// How far patches of the rings are tarnished.
        tarnish: f32 = 0.55, 0.0..=1.0;
        /// How brightly the wires gleam where they face the sky.
        shine: f32 = 0.8, 0.0..=1.0;
        /// How dark it is between and under the rings.
        occlusion: f32 = 0.9, 0.0..=1.0;
        /// Opacity of the cloth under the rings; 0 leaves it out.
        backing: f32 = 1.0, 0.0..=1.0;
        /// Colour of the rings.
        colour: Colour = Colour::srgb(0x7f868f);
        /// Colour of the tarnish.
        tarnish_colour: Colour = Colour::srgb(0x6e4d34);
        /// Colour of the cloth under the rings.
        backing_colour: Colour = Colour::srgb(0x4a1f1a);
    }
}

/// How far the rings are tilted, in degrees: linked rings of the thickest wire are then farthest apart.
const TILT: f32 = 37.;

/// Gap between the rings of a row, as a share of their distance.
const GAP: f32 = 0.02;

/// The measures of the mail, in tile widths.
struct Mail {
    /// Rings along a tile's side.
    rings: i32,
    /// Distance to the next ring of a row.
    apart: f32,
    /// From a ring's centre to the middle of its wire.
    radius: f32,
    wire: f32,
    /// Half the thickness of the mail, were it not flattened.
    half: f32,
    /// Height of the rings' centres.
    middle: f32,
    /// What heights are multiplied by, so that the mail fits into the shell; at most 1.
    flattening: f32,
    /// Height of the cloth.
    floor: f32,
}

/// What a ring is to a point.
#[derive(Clone, Copy)]
struct Place {
    /// Distance to the wire's surface, negative inside; in tile widths.
    distance: f32,
    /// From the middle of the wire, unit length.
    outward: Vec3,
    /// Along the ring from +u, in turns.
    around: f32,
    /// Which ring: along its row, and the row, both wrapped.
    ring: IVec2,
}

impl ChainMail {
    fn mail(&self, grid: &Grid) -> Mail {
        let rings = self.rings as i32;
        let apart = 1. / self.rings as f32;
        let radius = 0.5 * apart * (1. - GAP) / (1. + self.wire);
        let wire = self.wire * radius;
        let half = radius * TILT.to_radians().sin() + wire;
        let floor = (0.04 * grid.height).max(grid.voxel()).min(0.25 * grid.height) * self.backing.ceil();
        let room = (grid.height - floor - 2. * grid.voxel()).max(0.3 * grid.height);
        let flattening = (0.5 * room / half).min(1.);
        // The rings sink a little into the cloth.
        let middle = floor + flattening * (half - 0.3 * wire * self.backing);
        Mail { rings, apart, radius, wire, half, middle, flattening, floor }
    }

    /// The colour of a ring at a point of its surface; `crowding` is the distance to the next ring, in wires.
    fn metal(
        &self,
        mail: &Mail,
        place: &Place,
        position: Vec3,
        crowding: f32,
        finest: u32,
        seed: u32,
    ) -> Vec3 {
        let id = (place.ring.y * mail.rings + place.ring.x) as u32;
        let patches = Octaves { cells: 3, count: 5, gain: 0.7, finest };
        let patch = patches.gradient(position, seed ^ 0x7a) + 0.35 * (random(id, seed ^ 0x2c) - 0.5);
        let tarnished = self.tarnish * smoothstep(-0.05, 0.4, patch);
        let brightness = 1. + self.variation * (random(id, seed) - 0.5);
        // Scratches run along the wire.
        const ALONG: u32 = 6;
        let scratch = gradient(
            Vec3::new(place.around * ALONG as f32, id as f32 * 16., place.outward.z * 3.),
            [ALONG, 1 << 20],
            seed,
        );
        let colour =
            self.colour.0.lerp(self.tarnish_colour.0, tarnished) * brightness * (1. + 0.25 * scratch);

        let level = (position.z - mail.middle) / (mail.half * mail.flattening);
        let sky = smoothstep(-0.6, 0.95, level) * (0.15 + 0.85 * smoothstep(-0.5, 1., place.outward.z));
        let gap = smoothstep(-0.1, 1.1, crowding);
        let light = 1. - self.occlusion * (1. - sky * (0.25 + 0.75 * gap));
        // The gleam lies on the upper outer side of the wire, where half of the sky is mirrored.
        let gleam = smoothstep(0.82, 1., place.outward.dot(Vec3::new(0.2, 0.35, 0.9).normalize()));
        let shine = self.shine * (1. - 0.85 * tarnished) * gleam * smoothstep(-0.4, 0.6, level) * gap;
        light * colour + Vec3::splat(0.7 * shine)
    }
}

impl Mail {
    fn centre(&self, ring: IVec2) -> Vec2 {
        let shift = 0.25 + 0.5 * (ring.y & 1) as f32;
        Vec2::new((ring.x as f32 + shift) * self.apart, (ring.y as f32 + 0.5) * 0.25 * self.apart)
    }

    /// The direction in which the rings of a row rise.
    fn slope(row: i32) -> Vec2 {
        let (sin, cos) = TILT.to_radians().sin_cos();
        if row & 1 == 0 { Vec2::new(cos, -sin) } else { Vec2::new(cos, sin) }
    }

    /// Where a point lies to one ring.
    fn place(&self, ring: IVec2, position: Vec3) -> Place {
        let across = position.truncate() - self.centre(ring);
        let up = (position.z - self.middle) / self.flattening;
        // The ring's plane is spanned by x and `slope` in (y, z).
        let slope = Self::slope(ring.y);
        let in_plane = Vec2::new(across.x, slope.dot(Vec2::new(across.y, up)));
        let off_plane = slope.perp_dot(Vec2::new(across.y, up));
        let to_wire = in_plane.normalize_or(Vec2::X) * self.radius;
        let section = in_plane - to_wire;
        let distance = (section.length_squared() + off_plane * off_plane).sqrt();
        let [y, z] = (slope * section.y + slope.perp() * off_plane).to_array();
        Place {
            distance: (distance - self.wire) * self.flattening,
            outward: Vec3::new(section.x, y, z).normalize_or(Vec3::Z),
            around: in_plane.to_angle() / TAU,
            ring: IVec2::new(ring.x.rem_euclid(self.rings), ring.y.rem_euclid(4 * self.rings)),
        }
    }

    /// The two rings that are nearest to a point, the nearer first.
    fn nearest(&self, position: Vec3) -> [Place; 2] {
        let row = (position.y / (0.25 * self.apart)).floor() as i32;
        let mut nearest: [Option<Place>; 2] = [None; 2];
        // A ring reaches R cos t + r from its centre, less than 2.1 rows.
        for row in row - 3..=row + 3 {
            let shift = 0.25 + 0.5 * (row & 1) as f32;
            let column = (position.x / self.apart - shift).round() as i32;
            let place = self.place(IVec2::new(column, row), position);
            let nearer = |other: Option<Place>| other.is_none_or(|other| place.distance < other.distance);
            if nearer(nearest[0]) {
                nearest = [Some(place), nearest[0]];
            } else if nearer(nearest[1]) {
                nearest[1] = Some(place);
            }
        }
        nearest.map(|place| place.expect("seven rows hold more than two rings"))
    }
}

impl Pattern for ChainMail {
    fn draw(&self, grid: &Grid, seed: u32, texels: &mut [[f32; 4]]) {
        let mail = self.mail(grid);
        let finest = grid.finest_noise();
        let threads = Octaves { cells: 24, count: 3, gain: 0.7, finest };
        grid.fill(texels, |position| {
            let nearest = mail.nearest(position);
            let mut texel = [0.; 4];
            let cloth = self.backing * grid.coverage(position.z - mail.floor);
            if cloth > 0. {
                let open = smoothstep(0., 2., nearest[0].distance / mail.wire);
                let light = 1. - self.occlusion * (1. - 0.5 * open);
                let thread = 1. + 0.8 * threads.gradient(position.with_z(0.), seed ^ 0x19);
                lay_over(&mut texel, self.backing_colour.0 * light * thread, cloth);
            }
            let crowding = |other: &Place| other.distance / mail.wire;
            for (place, other) in [(&nearest[1], &nearest[0]), (&nearest[0], &nearest[1])] {
                let cover = grid.coverage(place.distance);
                if cover > 0. {
                    let colour = self.metal(&mail, place, position, crowding(other), finest, seed);
                    lay_over(&mut texel, colour, cover);
                }
            }
            texel
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const POINTS: usize = 720;

    /// Points on the middle of a ring's wire.
    fn wire(mail: &Mail, ring: IVec2, tilted: bool) -> Vec<Vec3> {
        let slope = if tilted { Mail::slope(ring.y) } else { Vec2::X };
        let points = (0..POINTS).map(|index| {
            let on = Vec2::from_angle(TAU * index as f32 / POINTS as f32) * mail.radius;
            mail.centre(ring).extend(0.) + Vec3::new(on.x, slope.x * on.y, slope.y * on.y)
        });
        points.collect()
    }

    /// How often `other` passes through the disc of a ring, and how near it comes to the ring.
    fn links(mail: &Mail, ring: IVec2, other: IVec2, tilted: bool) -> (usize, f32) {
        let (circle, passing) = (wire(mail, ring, tilted), wire(mail, other, tilted));
        let centre = mail.centre(ring).extend(0.);
        let axis = (circle[0] - centre).cross(circle[POINTS / 4] - centre).normalize();
        let crossings = (0..POINTS).filter(|&index| {
            let ends = [passing[index], passing[(index + 1) % POINTS]].map(|point| point - centre);
            axis.dot(ends[0]) * axis.dot(ends[1]) < 0. && ends[0].length() < mail.radius
        });
        let gaps = circle.iter().flat_map(|a| passing.iter().map(|b| a.distance_squared(*b)));
        (crossings.count(), gaps.fold(f32::INFINITY, f32::min).sqrt())
    }

    #[test]
    fn every_ring_holds_four_others_and_touches_none() {
        let grid = Grid { size: [128, 128, 32], height: 0.25 };
        for wire in [0.08, 0.19, 0.22] {
            let mail = ChainMail { wire, ..Default::default() }.mail(&grid);
            let neighbours = (-7..=7).flat_map(|y| (-2..=2).map(move |x| IVec2::new(x, y)));
            let linked = |tilted: bool| {
                let others = neighbours.clone().filter(|&other| other != IVec2::ZERO);
                others.map(|other| links(&mail, IVec2::ZERO, other, tilted)).collect::<Vec<_>>()
            };
            let found = linked(true);
            assert_eq!(found.iter().filter(|(crossings, _)| crossings % 2 == 1).count(), 4);
            let gap = found.iter().map(|(_, gap)| *gap).fold(f32::INFINITY, f32::min);
            // Between neighbours in `POINTS` a chord is nearer than the circle by R (TAU / POINTS)^2 / 8 < 1e-5 R.
            assert!(gap > 2. * mail.wire + 1e-5 * mail.radius, "wires of {wire} touch");
            assert!(linked(false).iter().all(|(crossings, _)| *crossings == 0), "flat rings are linked");
        }
    }
}
