//! The shell as a light sees it, in one of its pictures: what shaders need of each tetrahedron, and which may be met in each tile of pixels.

use bytemuck::Zeroable;
use glam::{DMat3, DVec2, DVec3};
use rayon::prelude::*;

use super::seen::{Cell, Tile};
use crate::scene::{LightView, Scene};
use crate::shell::Shell;

/// The side of a [`Tile`] in pixels: a power of two. Where many tetrahedra are seen in one, it is smaller.
const TILE: u32 = 16;

/// Tetrahedra in a tile from which on it is too large, unless it is a pixel already: every pixel of it whose ray does not
/// walk tries them all, a few times,
/// and gives up after `MOST_PASSES` of `glsl/include/gather.glsl`.
const CROWD: usize = 4096;

/// Depth before which a light sees nothing, as a part of the depth of its picture: what it stands in is not drawn by infinite
/// slopes.
pub(super) const NEAR: f32 = 1e-6;

/// What a light sees.
pub(super) struct SeenByLight {
    /// One a tetrahedron; zeros for those that are not seen.
    pub cells: Vec<Cell>,
    /// Those in which something is seen.
    pub tiles: Vec<Tile>,
    /// Tetrahedra, by tile.
    pub members: Vec<u32>,
    /// Whether any level of detail but 0 is needed.
    pub minified: bool,
}

/// Where a picture lies in the image that holds all.
pub(super) struct PictureFrame {
    /// Which picture it is.
    pub index: usize,
    /// Its upper left corner in the image, in pixels.
    pub corner: [u32; 2],
    /// The size of the image, in pixels.
    pub image: [u32; 2],
    /// Pixels a side of the picture.
    pub side: u32,
}

/// A tetrahedron that is seen.
struct Member {
    tetrahedron: u32,
    bounds: Bounds,
    minified: bool,
}

impl SeenByLight {
    /// Maps all tetrahedra of `scene` that have a volume.
    pub fn new(scene: &Scene, view: &LightView, frame: &PictureFrame) -> Self {
        let lens = Lens::new(view, frame.side);
        let mut cells = vec![Cell::zeroed(); scene.shell.topology.tetrahedra.len()];
        let map = |(t, cell): (usize, &mut Cell)| {
            let (mapped, bounds, minified) = lens.cell(scene, t)?;
            *cell = mapped;
            Some(Member { tetrahedron: t as u32, bounds, minified })
        };
        let mut members: Vec<Member> = cells.par_iter_mut().enumerate().filter_map(map).collect();
        // Members that come about nearest first are sorted quickly in every pixel.
        members.par_sort_by(|a, b| a.bounds.nearest.total_cmp(&b.bounds.nearest));
        let minified = members.iter().any(|member| member.minified);
        let mut seen = Self { cells, tiles: Vec::new(), members: Vec::new(), minified };
        let (tile_side, inside) = tiled(frame.side, &members);
        let across = frame.side.div_ceil(tile_side);
        for tile in inside.chunk_by(|a, b| a.0 == b.0) {
            let first = seen.members.len() as u32;
            seen.members.extend(tile.iter().map(|&(_, place)| members[place as usize].tetrahedron));
            let [x, y] = [tile[0].0 % across * tile_side, tile[0].0 / across * tile_side];
            let clip = |axis: usize, pixel: u32| {
                let in_image = frame.corner[axis] + pixel.min(frame.side);
                (2.0 * f64::from(in_image) / f64::from(frame.image[axis]) - 1.0) as f32
            };
            seen.tiles.push(Tile {
                bounds: [clip(0, x), clip(1, y), clip(0, x + tile_side), clip(1, y + tile_side)],
                members: [first, seen.members.len() as u32],
                picture: frame.index as u32,
                coarsely: 0,
            });
        }
        seen
    }
}

/// The tiles of a picture, and the members that are seen in each, as sorted pairs of tile and member; and the side of a tile.
fn tiled(side: u32, members: &[Member]) -> (u32, Vec<(u32, u32)>) {
    let mut tile_side = TILE;
    loop {
        let across = side.div_ceil(tile_side);
        let mut inside: Vec<(u32, u32)> = Vec::new(); // tile, member
        for (place, Member { bounds, .. }) in (0..).zip(members) {
            let tiles = |axis: usize| {
                // A pixel more on either side than rounding can be off.
                let tile = |pixel: f64| pixel.clamp(0.0, f64::from(side) - 1.0) as u32 / tile_side;
                tile(bounds.low[axis] - 1.0)..=tile(bounds.high[axis] + 1.0)
            };
            inside.extend(tiles(1).flat_map(|y| tiles(0).map(move |x| (y * across + x, place))));
        }
        inside.par_sort_unstable();
        let largest = inside.chunk_by(|a, b| a.0 == b.0).map(<[_]>::len).max().unwrap_or(0);
        if largest <= CROWD || tile_side == 1 {
            return (tile_side, inside);
        }
        tile_side /= 2;
    }
}

/// Where a tetrahedron is in a light's picture.
struct Bounds {
    /// In pixels from the upper left corner.
    low: DVec2,
    high: DVec2,
    /// The least depth of a vertex.
    nearest: f64,
}

/// A light's picture, ready to place tetrahedra in.
struct Lens<'a> {
    view: &'a LightView,
    light_from_world: DMat3,
    side: f64,
}

impl<'a> Lens<'a> {
    fn new(view: &'a LightView, side: u32) -> Self {
        Self { view, light_from_world: view.frame.view_from_world(), side: f64::from(side) }
    }

    /// A tetrahedron, where it is, and whether more than level 0 can be needed in it; `None` where none of it is seen.
    fn cell(&self, scene: &Scene, t: usize) -> Option<(Cell, Bounds, bool)> {
        let Shell { vertices, texture, .. } = &*scene.shell;
        if !scene.shell.has_maps(t) {
            return None;
        }
        let unit = self.view.far;
        let corners = scene.shell.vertices_of(t);
        let corners = corners.map(|corner| self.view.place(corner));
        let bounds = self.bounds(&corners)?;
        let planes = scene.shell.planes(t);
        let planes = std::array::from_fn(|k| {
            // From a vertex of the face that both its cells choose, as for the eye.
            let on_face = vertices[scene.shell.face(t, k)[0] as usize] - self.view.origin;
            let normal = planes[k].truncate();
            (self.light_from_world * normal).as_vec3().extend((normal.dot(on_face) / unit) as f32).into()
        });
        let texture_from_light =
            scene.shell.cells()[t].texture_from_world * self.light_from_world.transpose() * unit;
        let at_origin = texture[t][0] - texture_from_light * corners[0];
        let rows =
            std::array::from_fn(|i| texture_from_light.row(i).as_vec3().extend(at_origin[i] as f32).into());
        let size = scene.volume.levels[0].size;
        let densest =
            (0..3).map(|i| f64::from(size[i]) * texture_from_light.row(i).length()).fold(0.0, f64::max);
        let farthest = if self.view.is_parallel {
            1.0
        } else {
            corners.iter().map(|corner| corner.length()).fold(0.0, f64::max)
        };
        let footprint = scene.medium.lod_footprint * self.view.pixel_of_far() * farthest;
        let cell = Cell { outline: [[0.0; 4]; 2], planes, texture: rows };
        Some((cell, bounds, footprint * densest > 1.0))
    }

    fn bounds(&self, corners: &[DVec3; 4]) -> Option<Bounds> {
        let nearest = corners.iter().map(|corner| corner.z).fold(f64::INFINITY, f64::min);
        let farthest = corners.iter().map(|corner| corner.z).fold(f64::NEG_INFINITY, f64::max);
        let near = f64::from(NEAR);
        if farthest <= near {
            return None;
        }
        let (mut low, mut high) = (DVec2::splat(f64::INFINITY), DVec2::splat(f64::NEG_INFINITY));
        let mut include = |point: DVec3| {
            let scale = self.view.pixel_of_far() * if self.view.is_parallel { 1.0 } else { point.z };
            let place = DVec2::new(point.x, -point.y) / scale + 0.5 * self.side;
            (low, high) = (low.min(place), high.max(place));
        };
        let is_cut = !self.view.is_parallel && nearest < near;
        for (i, &corner) in corners.iter().enumerate() {
            if !is_cut || corner.z >= near {
                include(corner);
            }
            if is_cut {
                for &other in &corners[..i] {
                    if (corner.z < near) != (other.z < near) {
                        let part = (near - corner.z) / (other.z - corner.z);
                        include(corner.lerp(other, part).with_z(near));
                    }
                }
            }
        }
        let is_beside = high.min_element() < -1.0 || low.max_element() > self.side + 1.0;
        (!is_beside).then_some(Bounds { low, high, nearest })
    }
}
