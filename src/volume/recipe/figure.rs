//! Figures: the sculptures of [`mesh::figure`](crate::mesh::figure), in rows and columns.
//!
//! A sculpture is a field, negative inside and near its surface a distance, so texels read it as the other recipes read
//! theirs: no mesh is made, and edges are as soft as everywhere. What stands out over the border of a tile comes in again on
//! the other side.

use glam::{DMat3, DVec2, DVec3, UVec3, Vec2, Vec3};
use rayon::prelude::*;
use serde::Deserialize;
use toml::de::DeTable;

use super::grid::{Grid, lay_among, smoothstep};
use super::keys::keys;
use super::noise::random;
use super::{Pattern, Source};
use crate::Result;
use crate::mesh::figure::{self, Sculpture};
use crate::value::Colour;

keys! {
    /// The keys of `recipe = "figure"`.
    Figure {
        /// Which: `"bust"`, `"chain"`, `"dragon"` or `"tree"`.
        figure: Name = Name(figure::Figure::Bust);
        /// Figures along u. A chain runs on from tile to tile instead, its links as large as there is room.
        columns: u32 = 1, 1..=64;
        /// Rows along v; every other one is shifted by half a figure.
        rows: u32 = 1, 1..=64;
        /// What is left free around each figure, in tile widths.
        margin: f32 = 0.02, 0.0..=0.4;
        /// How much smaller some of the figures are.
        variation: f32 = 0.0, 0.0..=0.9;
        /// Whether the figures look outward, with their heads along v; else they stand on the base.
        lying: bool = false;
        /// How far they are turned about their own upright, in degrees.
        turn: f32 = 0.0, -360.0..=360.0;
        /// How far some of them are turned on the base besides, in degrees either way.
        turn_variation: f32 = 0.0, 0.0..=180.0;
        /// How deep they are sunk into the base, as a share of their height.
        sunk: f32 = 0.0, 0.0..=0.9;
        /// How much flatter they are than sculpted, as in a relief: 0 not at all.
        flatness: f32 = 0.0, 0.0..=0.9;
        /// Opacity of a path as long as the shell is thick, inside a figure; 1 is solid.
        alpha: f32 = 1.0, 0.0..=1.0;
        /// How much of the figures' own colours is seen: 0 leaves `tint`.
        paint: f32 = 1.0, 0.0..=1.0;
        /// Multiplies the colours.
        tint: Colour = Colour::linear(1., 1., 1.);
        /// How dark it is where little of the sky is seen.
        occlusion: f32 = 0.7, 0.0..=1.0;
    }
}

/// A figure by its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub struct Name(pub figure::Figure);

impl TryFrom<String> for Name {
    type Error = String;

    fn try_from(name: String) -> std::result::Result<Self, String> {
        let found = figure::Figure::ALL.iter().find(|(known, _)| *known == name);
        let names = || figure::Figure::ALL.map(|(name, _)| format!("\"{name}\"")).join(", ");
        found
            .map(|(_, figure)| Self(*figure))
            .ok_or_else(|| format!("there is no figure \"{name}\", but {}", names()))
    }
}

/// The keys with what they name.
#[derive(Debug)]
struct Figures {
    keys: Figure,
    sculpture: Sculpture,
}

/// Reads the keys and sculpts.
pub(super) fn read(source: &Source, table: DeTable) -> Result<impl Pattern + use<>> {
    let keys: Figure = source.read(table)?;
    Ok(Figures {
        // Of a chain there is a period on either side of the one that is read.
        sculpture: keys.figure.0.sculpture(-2..4),
        keys,
    })
}

/// One figure on the tile, or a chain across it.
struct Placed {
    /// The middle of its foot, in tile space.
    foot: Vec3,
    /// What of the sculpture is there.
    origin: DVec3,
    /// From along u, v, w in tile widths to the sculpture's axes and units.
    turn: DMat3,
    /// Half of its extent along u and v, in tile widths.
    half: Vec2,
}

impl Figures {
    fn placed(&self, height: f32, seed: u32) -> Vec<Placed> {
        let Figure { rows, margin, variation, turn_variation, sunk, flatness, .. } = self.keys;
        let period = self.keys.figure.0.period();
        let axes = self.axes();
        let [low, high] = self.bounds(axes);
        let extent = high - low;
        let room = |count: u32| f64::from((1. / count as f32 - 2. * margin).max(0.05 / count as f32));
        let flat = f64::from(1. - flatness);
        // Nothing reaches the outer surface.
        let top = 0.94 * f64::from(height) / (extent.z * f64::from(1. - sunk) * flat);
        let across = top.min(room(rows) / extent.y);
        let (columns, fitting) = match period {
            // All of it in one piece, of whole periods.
            Some(period) => (1, 1. / (period * (1. / (period * across)).ceil())),
            None => (self.keys.columns, across.min(room(self.keys.columns) / extent.x)),
        };
        let place = |index: u32| {
            let draw = |purpose: u32| f64::from(random(index, seed ^ purpose));
            let (column, row) = (index % columns, index / columns);
            let (scale, turned) = if period.is_some() {
                (fitting, 0.)
            } else {
                let turned = f64::from(turn_variation) * (2. * draw(0x71) - 1.);
                (fitting * (1. - f64::from(variation) * draw(0x72)), turned)
            };
            // A chain's next row has its upright links where this one's are flat.
            let step = period.map_or(1. / f64::from(columns), |period| period * scale);
            let shift = 0.5 * (row % 2) as f32;
            let foot = Vec3::new(
                step as f32 * (column as f32 + 0.5 + shift),
                (row as f32 + 0.5) / rows as f32,
                -(f64::from(sunk) * extent.z * scale * flat) as f32,
            );
            let reach =
                if turned == 0. { extent.truncate() } else { DVec2::splat(extent.truncate().length()) };
            let sized = DMat3::from_diagonal(DVec3::new(scale, scale, scale * flat).recip());
            Placed {
                foot,
                origin: axes * (0.5 * (low + high)).with_z(low.z),
                turn: axes * DMat3::from_rotation_z(turned.to_radians()) * sized,
                half: if period.is_some() {
                    Vec2::new(0.5, (0.5 * scale * reach.y) as f32)
                } else {
                    (0.5 * scale * reach).as_vec2()
                },
            }
        };
        (0..columns * rows).map(place).collect()
    }

    /// From along u, v, w to the sculpture's axes.
    fn axes(&self) -> DMat3 {
        let axes = match self.keys.lying {
            true => DMat3::IDENTITY,
            false => DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y),
        };
        DMat3::from_rotation_y(-f64::from(self.keys.turn).to_radians()) * axes
    }

    /// The box of the figure along u, v, w, found on a grid.
    fn bounds(&self, axes: DMat3) -> [DVec3; 2] {
        const STEPS: u32 = 64;
        let [low, high] = self.sculpture.bounds();
        let step = (high - low) / f64::from(STEPS);
        let place = |index: u32| {
            let cell = UVec3::new(index % STEPS, index / STEPS % STEPS, index / STEPS / STEPS);
            low + (cell.as_dvec3() + 0.5) * step
        };
        let is_in = |point: &DVec3| self.sculpture.field(*point) < 0.25 * step.max_element();
        let boxes = (0..STEPS.pow(3))
            .into_par_iter()
            .map(place)
            .filter(is_in)
            .map(|point| [axes.transpose() * point; 2]);
        boxes.reduce(|| [DVec3::INFINITY, DVec3::NEG_INFINITY], |a, b| [a[0].min(b[0]), a[1].max(b[1])])
    }

    /// Draws the part of a figure that crosses the slice at height `z`, block by block, each with the parts that are near it.
    fn draw_figure(&self, placed: &Placed, grid: &Grid, z: f32, slice: &mut [[f32; 4]]) {
        const BLOCK: usize = 12;
        let inside = grid.opacity(-(-self.keys.alpha).ln_1p());
        let spacing = grid.spacing().as_dvec3();
        // Of a texel's axes the longest, in the sculpture's units: beyond it no texel is touched by a surface.
        let edge = placed.turn * DMat3::from_diagonal(spacing);
        let edge = edge.x_axis.length().max(edge.y_axis.length()).max(edge.z_axis.length());
        let reach = placed.half + 2. * grid.spacing().truncate();
        let Vec3 { x: u, y: v, .. } = placed.foot;
        let columns: Vec<_> = grid.between(0, u - reach.x, u + reach.x).collect();
        let rows: Vec<_> = grid.between(1, v - reach.y, v + reach.y).collect();
        let period = self.keys.figure.0.period();
        let within = |x: f32, y: f32| placed.turn * (Vec3::new(x, y, z) - placed.foot).as_dvec3();
        for (rows, columns) in
            rows.chunks(BLOCK).flat_map(|rows| columns.chunks(BLOCK).map(move |columns| (rows, columns)))
        {
            let corner = |x: usize, y: usize| within(columns[x].1, rows[y].1);
            let (first, last) = (corner(0, 0), corner(columns.len() - 1, rows.len() - 1));
            let radius = 0.5 * first.distance(last) + 2. * edge;
            let middle = placed.origin + 0.5 * (first + last);
            let around = |reach: f64| match period {
                // A block may span many periods; the few links of one and its neighbours are all that a point meets.
                Some(_) => self.sculpture.clone(),
                None => self.sculpture.around(middle, reach),
            };
            let near = around(radius);
            if near.is_empty() {
                continue;
            }
            let surroundings = around(radius + self.sculpture.horizon());
            for &(j, y) in rows {
                for &(i, x) in columns {
                    let mut point = placed.origin + within(x, y);
                    if let Some(period) = period {
                        point.x = point.x.rem_euclid(period);
                    }
                    if near.field(point) > 2. * edge {
                        continue;
                    }
                    let place = surroundings.place(point);
                    // How fast the field grows from texel to texel says how many texels off the surface is.
                    let steepness = (placed.turn.transpose() * place.outward * spacing).length();
                    // Where parts meet, that is up to a quarter too steep.
                    let cover = smoothstep(1., -1., 0.75 * (place.field / steepness.max(1e-9)) as f32);
                    if cover > 0. {
                        let light = 1. - self.keys.occlusion * (1. - place.sky as f32);
                        let colour = Vec3::ONE.lerp(place.colour, self.keys.paint) * self.keys.tint.0 * light;
                        lay_among(&mut slice[j * grid.size[0] + i], colour, cover * inside);
                    }
                }
            }
        }
    }
}

impl Pattern for Figures {
    fn draw(&self, grid: &Grid, seed: u32, texels: &mut [[f32; 4]]) {
        let figures = self.placed(grid.height, seed);
        grid.slices(texels, |k, slice| {
            let z = grid.position(0, 0, k).z;
            for figure in &figures {
                self.draw_figure(figure, grid, z, slice);
            }
        });
    }
}
