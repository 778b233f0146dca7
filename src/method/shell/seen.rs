//! A shell as seen from one eye: what the shaders need of each tetrahedron, front to back. Positions are taken relative to the
//! eye in f64 before anything is f32, so that a scene far from the origin loses nothing, and in parts of the scene's own reach, so
//! that its scale changes nothing: not what f32 rounds, nor whether it overflows.

use std::collections::HashSet;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

use bytemuck::{Pod, Zeroable};
use glam::{DMat3, DVec2, DVec3};
use rayon::prelude::*;

use super::outline::{Projection, Unseen};
use super::squares::{SIDE, Squares};
use crate::order::{Crossings, Order, Sorted};
use crate::scene::{Scene, View};

/// `Cell` of `glsl/include/shell.glsl`: see there for each member.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "documented at the one declaration in glsl")]
pub struct Cell {
    pub outline: [[f32; 4]; 2],
    pub planes: [[f32; 4]; 4],
    pub texture: [[f32; 4]; 3],
}

/// `Tile` of `glsl/include/shell.glsl`: see there for each member.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "documented at the one declaration in glsl")]
pub struct Tile {
    pub bounds: [f32; 4],
    pub members: [u32; 2],
    pub picture: u32,
    pub coarsely: u32,
}

/// The side of a [`Tile`] in pixels: small enough that few members of a large cycle reach into one.
const TILE: u32 = 16;

/// Tetrahedra that one task of the thread pool takes at least: some 0.1 ms of work.
const TASK: usize = 512;

/// The part of what is covered that must be magnified for it to be drawn by itself: it is 1.4 times as fast, but another pipeline costs
/// some 5 % of a frame.
const WORTH_PARTING: f64 = 0.25;

/// Whether a tetrahedron is seen, and why not.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Found {
    /// Whether more than level 0 can be needed in it.
    Seen {
        minified: bool,
    },
    WithoutVolume,
    Unseen(Unseen),
}

/// What is drawn together.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Run {
    /// The cells of this part of [`Seen::list`], one after another.
    Sorted(Range<u32>),
    /// These tiles, each resolved per pixel among its members.
    Cycle(Range<u32>),
}

/// All that can be seen, and what cannot.
#[derive(Debug, Clone, Default)]
pub struct Seen {
    /// One a tetrahedron; of those that cannot be seen, anything.
    pub cells: Vec<Cell>,
    /// Tetrahedra, by run, front to back; those of a cycle by tile, nearest first.
    pub list: Vec<u32>,
    /// Where cells meet that have no order of their own.
    pub tiles: Vec<Tile>,
    /// Front to back; every tetrahedron that is seen is in one.
    pub runs: Vec<Run>,
    /// Tetrahedra that can be seen; where rays walk, all that have a volume.
    pub count: u64,
    /// Tetrahedra before the near plane.
    pub before_near: u64,
    /// Tetrahedra beside the picture.
    pub beside: u64,
    /// Whether any level of detail but 0 is needed.
    pub minified: bool,
    /// The same of each square of 64 x 64 pixels, row by row; empty where tetrahedra are sorted.
    pub minified_squares: Vec<bool>,
    /// The unit of all lengths on the device, in world units: how far the shell reaches from the eye.
    pub unit: f64,
}

impl Seen {
    /// Maps the tetrahedra of `scene` to `view`, and lists them in the order `sorted`, for a rasteriser that snaps to `subpixels`
    /// a pixel. `spare`, which is no longer needed, may lend its memory.
    pub fn new(scene: &Scene, sorted: &Sorted, view: &View, subpixels: u32, spare: Option<Self>) -> Self {
        let eye = Eye::new(scene, view, subpixels);
        let mut seen = Self::begun(&eye, spare);
        // In the order of the tetrahedra, since that is how all that is read and written here lies in memory.
        seen.cells.resize(scene.shell.topology.tetrahedra.len(), Cell::zeroed());
        let cells = seen.cells.par_iter_mut().zip(&sorted.exit_faces).enumerate().with_min_len(TASK);
        let mut found = Vec::new();
        cells.map(|(t, (cell, &exit_faces))| eye.map(t, exit_faces, cell)).collect_into_vec(&mut found);

        let Order { sequence, cycles } = &sorted.order;
        let mut done = 0;
        for cycle in cycles {
            seen.add_sorted(&sequence[done..cycle.start], &found);
            seen.add_cycle(&sequence[cycle.clone()], &found, &eye, view);
            done = cycle.end;
        }
        seen.add_sorted(&sequence[done..], &found);
        seen
    }

    /// Maps all tetrahedra of `scene` that have a volume, for rays that walk among them. `spare` as above.
    pub fn all(scene: &Scene, view: &View, subpixels: u32, spare: Option<Self>) -> Self {
        let eye = Eye::new(scene, view, subpixels);
        let mut seen = Self::begun(&eye, spare);
        seen.cells.resize(scene.shell.topology.tetrahedra.len(), Cell::zeroed());
        let cells = seen.cells.par_iter_mut().enumerate().with_min_len(TASK);
        let squares = Squares::of(view);
        let minified: Vec<AtomicBool> = (0..squares.count()).map(|_| AtomicBool::new(false)).collect();
        let mapped = cells.map(|(t, cell)| {
            if !scene.shell.has_maps(t) {
                *cell = Cell::zeroed(); // a ray that comes here ends
                return 0;
            }
            let vertices = eye.vertices(t);
            if eye.fill(t, &vertices.map(|vertex| vertex.position), cell) {
                let before_near = |vertex: Vertex| vertex.position.z <= eye.projection.near;
                let corners = vertices.map(|vertex| (!before_near(vertex)).then_some(vertex.pixel));
                for square in squares.around(corners) {
                    minified[square].store(true, Ordering::Relaxed);
                }
            }
            1
        });
        seen.count = mapped.sum();
        seen.minified_squares = minified.into_iter().map(AtomicBool::into_inner).collect();
        seen.minified = seen.minified_squares.contains(&true);
        seen
    }

    fn begun(eye: &Eye<'_>, spare: Option<Self>) -> Self {
        let mut seen = Self { unit: eye.unit, ..Self::default() };
        if let Some(spare) = spare {
            (seen.cells, seen.list) = (spare.cells, spare.list);
            seen.list.clear();
        }
        seen
    }

    /// The runs, cut where such parts of [`Seen::list`], 0 to 1, ascending, are done; cycles are not cut. No part is empty.
    pub fn parts(&self, after: &[f64]) -> Vec<Vec<Run>> {
        let mut parts = Vec::new();
        let mut part = Vec::new();
        let mut looks = after.iter().map(|part| (part * self.list.len() as f64) as u32).peekable();
        for run in &self.runs {
            let Run::Sorted(Range { mut start, end }) = run.clone() else {
                part.push(run.clone());
                continue;
            };
            while let Some(look) = looks.next_if(|look| *look <= end) {
                if look > start {
                    part.push(Run::Sorted(start..look));
                    start = look;
                }
                if !part.is_empty() {
                    parts.push(std::mem::take(&mut part));
                }
            }
            if start < end {
                part.push(Run::Sorted(start..end));
            }
        }
        parts.extend((!part.is_empty()).then_some(part));
        parts
    }

    fn add_sorted(&mut self, tetrahedra: &[u32], found: &[Found]) {
        let first = self.list.len() as u32;
        for &t in tetrahedra {
            if self.count(found[t as usize]) {
                self.list.push(t);
            }
        }
        let added = first..self.list.len() as u32;
        if !added.is_empty() {
            self.runs.push(Run::Sorted(added));
        }
    }

    fn add_cycle(&mut self, tetrahedra: &[u32], found: &[Found], eye: &Eye<'_>, view: &View) {
        let mut cells: Vec<u32> = tetrahedra.to_vec();
        cells.retain(|&t| self.count(found[t as usize]));
        if cells.is_empty() {
            return;
        }
        // No order is right, but members that come about nearest first are sorted quickly in every pixel.
        cells.sort_by(|&a, &b| eye.nearest(a as usize).total_cmp(&eye.nearest(b as usize)));
        let first_tile = self.tiles.len() as u32;
        let columns = view.width.div_ceil(TILE);
        let size = [f64::from(view.width), f64::from(view.height)];
        let mut inside: Vec<(u32, usize)> = Vec::new(); // tile, place in `cells`
        for (place, &cell) in cells.iter().enumerate() {
            let corners =
                || self.cells[cell as usize].outline.into_iter().flat_map(|[x, y, z, w]| [[x, y], [z, w]]);
            let [across, down] = [0, 1].map(|axis| {
                let pixels = corners().map(|corner| (0.5 + 0.5 * f64::from(corner[axis])) * size[axis]);
                let (low, high) =
                    pixels.fold((f64::INFINITY, 0.0), |(low, high), x| (low.min(x), x.max(high)));
                // A pixel more on either side than outlines in f32 can be off.
                let tile = |pixel: f64| pixel.clamp(0.0, size[axis] - 1.0) as u32 / TILE;
                tile(low - 1.0)..=tile(high + 1.0)
            });
            inside.extend(down.flat_map(|y| across.clone().map(move |x| (y * columns + x, place))));
        }
        inside.sort_unstable();
        for tile in inside.chunk_by(|a, b| a.0 == b.0) {
            let first = self.list.len() as u32;
            self.list.extend(tile.iter().map(|&(_, place)| cells[place]));
            let [x, y] = [tile[0].0 % columns * TILE, tile[0].0 / columns * TILE];
            let clip = |pixel: u32, axis: usize| (2.0 * f64::from(pixel) / size[axis] - 1.0) as f32;
            self.tiles.push(Tile {
                bounds: [clip(x, 0), clip(y, 1), clip(x + TILE, 0), clip(y + TILE, 1)],
                members: [first, self.list.len() as u32],
                picture: 0,
                coarsely: 0,
            });
        }
        self.runs.push(Run::Cycle(first_tile..self.tiles.len() as u32));
    }

    /// Whether a tetrahedron is seen; counts it.
    fn count(&mut self, found: Found) -> bool {
        match found {
            Found::Seen { minified } => {
                self.count += 1;
                self.minified |= minified;
                return true;
            }
            Found::WithoutVolume => {}
            Found::Unseen(Unseen::BeforeNear) => self.before_near += 1,
            Found::Unseen(Unseen::Beside) => self.beside += 1,
        }
        false
    }

    /// Whether others are needed in some of the squares, and no level of detail but 0 in so many that it pays to draw those by
    /// themselves.
    pub fn is_worth_parting(&self, crossings: &Crossings, view: &View) -> bool {
        if !self.minified || !self.minified_squares.contains(&false) {
            return false;
        }
        let across = Squares::of(view).across();
        let side = SIDE as usize;
        let (mut covered, mut magnified) = (0, 0);
        for (y, row) in crossings.of_pixels.chunks_exact(view.width as usize).enumerate() {
            let squares = &self.minified_squares[y / side * across..];
            for (pixels, minified) in row.chunks(side).zip(squares) {
                let here = pixels.iter().filter(|pixel| Crossings::are_some(pixel)).count();
                covered += here;
                magnified += if *minified { 0 } else { here };
            }
        }
        magnified as f64 >= WORTH_PARTING * covered as f64
    }

    /// Whether a pixel lies in a tile.
    pub fn is_tiled(&self, view: &View) -> impl Fn(u32, u32) -> bool + use<> {
        let columns = view.width.div_ceil(TILE);
        let size = [f64::from(view.width), f64::from(view.height)];
        let place = |tile: &Tile| {
            let [x, y] = [0, 1].map(|axis| {
                // Of a corner of whole pixels, in f32.
                let pixel = (0.5 + 0.5 * f64::from(tile.bounds[axis])) * size[axis];
                pixel.round() as u32 / TILE
            });
            y * columns + x
        };
        let tiles: HashSet<u32> = self.tiles.iter().map(place).collect();
        move |x, y| tiles.contains(&(y / TILE * columns + x / TILE))
    }
}

/// The eye, with all that maps to its picture.
struct Eye<'a> {
    scene: &'a Scene,
    /// Rows: right, up, forward.
    view_from_world: DMat3,
    projection: Projection,
    /// See [`Seen::unit`].
    unit: f64,
    /// The shell's, in view space.
    vertices: Vec<Vertex>,
}

/// A vertex as the eye sees it.
#[derive(Clone, Copy)]
struct Vertex {
    /// In view space, world units.
    position: DVec3,
    /// Where it is projected, if it lies beyond the near plane.
    pixel: DVec2,
}

impl<'a> Eye<'a> {
    fn new(scene: &'a Scene, view: &View, subpixels: u32) -> Self {
        // Snapping moves an edge by at most half a subpixel diagonally; corners in f32, at most `FARTHEST` pictures away,
        // are off by less than another half up to pictures of 2^13 pixels.
        let projection = Projection::new(view, 2.0 / f64::from(subpixels));
        let eye = view.camera.eye;
        let view_from_world = view.camera.frame().view_from_world();
        let vertex = |&vertex: &DVec3| {
            let position = view_from_world * (vertex - eye);
            Vertex { position, pixel: projection.project(position) }
        };
        let distances = scene.shell.vertices.iter().map(|vertex| vertex.distance_squared(eye));
        Self {
            scene,
            unit: distances.fold(view.camera.near.powi(2), f64::max).sqrt(),
            view_from_world,
            projection,
            vertices: scene.shell.vertices.par_iter().with_min_len(TASK).map(vertex).collect(),
        }
    }

    fn vertices(&self, t: usize) -> [Vertex; 4] {
        self.scene.shell.topology.tetrahedra[t].map(|id| self.vertices[id as usize])
    }

    /// The least depth of a vertex, in world units.
    fn nearest(&self, t: usize) -> f64 {
        self.vertices(t).map(|vertex| vertex.position.z).into_iter().fold(f64::INFINITY, f64::min)
    }

    /// Fills in the cell of a tetrahedron, where it is seen.
    fn map(&self, t: usize, exit_faces: u8, cell: &mut Cell) -> Found {
        if exit_faces == 0 || !self.scene.shell.has_maps(t) {
            return Found::WithoutVolume;
        }
        let vertices = self.vertices(t);
        let positions = vertices.map(|vertex| vertex.position);
        let pixels = vertices.map(|vertex| vertex.pixel);
        let outline = match self.projection.outline(&positions, pixels, exit_faces) {
            Ok(outline) => outline,
            Err(unseen) => return Found::Unseen(unseen),
        };
        let clip = |corner: DVec2| (corner - self.projection.centre) / self.projection.centre;
        let [a, b, c, d] = outline.map(|corner| clip(corner).as_vec2());
        cell.outline = [[a.x, a.y, b.x, b.y], [c.x, c.y, d.x, d.y]];
        Found::Seen { minified: self.fill(t, &positions, cell) }
    }

    /// Fills in planes and texture of a tetrahedron that has a volume; returns whether more than level 0 can be needed in it.
    fn fill(&self, t: usize, positions: &[DVec3; 4], cell: &mut Cell) -> bool {
        let shell = &self.scene.shell;
        let determinant = shell.determinants[t];
        // Both cells at a face go round it from the same corner, one of them the other way: its area vector is the same in both to
        // the bit, up to its sign. It points outwards in the world where the volume is positive; view space is its mirror image.
        let [origin, corners @ ..] = shell.vertices_of(t);
        let edges = corners.map(|corner| self.view_from_world * (corner - origin));
        let apart =
            [corners[1] - corners[0], corners[2] - corners[0]].map(|edge| self.view_from_world * edge);
        let areas = [
            apart[0].cross(apart[1]),
            edges[2].cross(edges[1]),
            edges[0].cross(edges[2]),
            edges[1].cross(edges[0]),
        ];
        let per_unit = self.unit.recip();
        cell.planes = std::array::from_fn(|k| {
            let area = areas[k].length_squared().sqrt();
            let inwards = if area > 0.0 { area.recip().copysign(determinant) } else { 0.0 };
            let normal = areas[k] * inwards;
            let on_face = positions[usize::from(k == 0)];
            normal.as_vec3().extend((normal.dot(on_face) * per_unit) as f32).into()
        });
        let texture = &shell.texture[t];
        let per_volume = determinant.recip();
        let slopes = [1, 2, 3].map(|k| (texture[k] - texture[0]) * per_volume);
        let rows = [0, 1, 2].map(|i| (0..3).map(|k| slopes[k][i] * areas[k + 1]).sum::<DVec3>());
        cell.texture = std::array::from_fn(|i| {
            let at_eye = texture[0][i] - rows[i].dot(positions[0]);
            (rows[i] * self.unit).as_vec3().extend(at_eye as f32).into()
        });
        let farthest = positions.map(|position| position.z).into_iter().fold(f64::NEG_INFINITY, f64::max);
        // Of all directions, so at least that across the ray.
        let size = self.scene.volume.levels[0].size;
        let texels_per_unit =
            (0..3).map(|i| rows[i].length_squared() * f64::from(size[i]).powi(2)).fold(0.0, f64::max).sqrt();
        let footprint = self.scene.medium.lod_footprint * self.projection.pixel * farthest;
        footprint * texels_per_unit > 1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_cut_and_nothing_of_them_is_lost() {
        let parts = |runs: &[Run], list: usize, after: &[f64]| {
            Seen { runs: runs.to_vec(), list: vec![0; list], ..Seen::default() }.parts(after)
        };
        let sorted = |range| vec![Run::Sorted(range)];
        let looks = [0.25, 0.5, 0.75];
        assert!(parts(&[], 0, &looks).is_empty());
        assert_eq!(parts(&sorted(0..1), 1, &looks), [sorted(0..1)]);
        assert_eq!(parts(&sorted(0..8), 8, &looks), [sorted(0..2), sorted(2..4), sorted(4..6), sorted(6..8)]);
        // Before a cycle, and once after it for all that fall into it.
        let around = [Run::Sorted(0..2), Run::Cycle(0..9), Run::Sorted(7..8)];
        assert_eq!(parts(&around, 8, &looks), [sorted(0..2), vec![Run::Cycle(0..9)], sorted(7..8)]);
        let last = [Run::Sorted(0..3), Run::Cycle(0..9)];
        assert_eq!(parts(&last, 8, &looks), [sorted(0..2), vec![Run::Sorted(2..3), Run::Cycle(0..9)]]);
    }
}
