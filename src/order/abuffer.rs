//! Relations across gaps: an A-buffer of the shell's boundary faces at the image's pixel centres.
//!
//! Along a pixel's ray the tetrahedra of a connected run are related face by face; between two runs the
//! tetrahedron that the ray leaves last is related to the one that it enters next.
//!
//! ```text
//!   eye ----[ A | B ]-------[ C | D | E ]------>      boundary faces: in A, out B, in C, out E
//!            A<B by a face   C<D<E by faces            the A-buffer adds B<C
//! ```
//!
//! Against section 4.1 of Dufort, Leblanc, Poulin 2005:
//! - faces are sampled in f64 by edge functions of the homogeneous triangle (Olano, Greer 1997), linear in
//!   pixel coordinates whether or not vertices lie behind the eye: nothing is clipped, and only points
//!   in front of the eye are met (the near plane plays no part);
//! - runs may overlap where the shell overlaps itself. No order of theirs is right, so they are made one
//!   cycle: each tetrahedron that such a ray leaves is also put in front of each that it enters;
//! - samples stand 1e-10 pixels off the pixel centres: a symmetric scene sends rays exactly through edges and
//!   vertices, where rounding would decide on its own which faces are met, and in which order.
//!
//! Inverse depth is used for depth: it is linear in pixel coordinates over a plane.

use std::ops::Range;

use glam::DVec3;
use rayon::prelude::*;

use super::relations::BoundaryFace;
use crate::scene::View;

/// Rows of pixels that are worked on together: few enough that their fragments stay in the cache.
const BAND: usize = 16;

/// Pixels right and down from a pixel's centre to its sample. Far above the rounding of projected vertices
/// (1e-13 pixels), so that nothing near a sample is decided by rounding where vertices stand on centres;
/// far below any distance that matters: what a ray cuts off by less than this is thinner than 1e-10 pixels.
const NUDGE: [f64; 2] = [1e-10, 0.6180339887e-10];

/// Pixels by which bounds are widened before pixels are tested one by one: above the rounding of a
/// projected coordinate and above [`NUDGE`], and small enough to cost nothing.
const MARGIN: f64 = 1e-6;

/// End of a list of fragments.
const NONE: u32 = u32::MAX;

/// A linear function of pixel coordinates that are measured from the image's middle.
#[derive(Debug, Clone, Copy)]
struct Line {
    x: f64,
    y: f64,
    constant: f64,
}

impl Line {
    /// The inner product of `normal` with the pixel's ray of unit depth, times `scale`.
    fn new(normal: DVec3, pixel: f64, scale: f64) -> Self {
        Self { x: normal.x * pixel * scale, y: normal.y * pixel * scale, constant: normal.z * scale }
    }

    /// Whether samples where the function is zero count as positive. Of two faces on one edge one owns it.
    fn owns_zero(&self) -> bool {
        self.x > 0.0 || (self.x == 0.0 && self.y > 0.0)
    }
}

/// The image plane: pixels are square, `pixel` wide at depth 1.
#[derive(Debug, Clone, Copy)]
struct Raster {
    width: usize,
    height: usize,
    pixel: f64,
}

impl Raster {
    /// Where column `x` is sampled, from the image's middle.
    fn column(self, x: usize) -> f64 {
        x as f64 + 0.5 - 0.5 * self.width as f64 + NUDGE[0]
    }

    /// Where row `y` is sampled, from the image's middle.
    fn row(self, y: usize) -> f64 {
        y as f64 + 0.5 - 0.5 * self.height as f64 + NUDGE[1]
    }

    /// The indices, of `size` along one axis, whose samples lie in `low..=high`, with a margin.
    fn indices(low: f64, high: f64, size: usize) -> Range<u32> {
        let first = 0.5 * size as f64 - 0.5;
        // Casts round towards zero, saturate, and are one instruction; floor and ceil are calls.
        let begin = (low + first - MARGIN + 1.0).min(size as f64) as u32;
        let end = (high + first + MARGIN + 1.0).min(size as f64) as u32;
        begin..end
    }
}

/// A boundary face as the image sees it.
#[derive(Debug, Clone)]
struct Footprint {
    /// Positive inside.
    edges: [Line; 3],
    /// For each edge `-1 / x`: times the rest of the function it is the column where the edge is crossed.
    edge_columns: [f64; 3],
    /// Inverse depth, in front of the eye inside.
    inverse_depth: Line,
    columns: Range<u32>,
    rows: Range<u32>,
    crossing: Crossing,
}

/// The range of `axis / z`, in pixels, over those points of a triangle that have positive z;
/// empty (low > high) where there are none. Unbounded where an edge passes beside the eye.
fn projected_range(corners: &[DVec3; 3], axis: usize, pixel: f64) -> (f64, f64) {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for front in corners.iter().filter(|corner| corner.z > 0.0) {
        let projected = front[axis] / (front.z * pixel);
        low = low.min(projected);
        high = high.max(projected);
        for behind in corners.iter().filter(|corner| corner.z <= 0.0) {
            // Where the edge comes to depth 0 it projects to infinity, on the side where it is then.
            let (a, b) = (front[axis] * -behind.z, behind[axis] * front.z);
            let rounding = 4.0 * f64::EPSILON * (a.abs() + b.abs());
            if a + b >= -rounding {
                high = f64::INFINITY;
            }
            if a + b <= rounding {
                low = f64::NEG_INFINITY;
            }
        }
    }
    (low, high)
}

impl Footprint {
    /// `None` where the face surely meets no sample.
    /// `vertices` are relative to the eye: right, down, into the picture.
    fn new(face: &BoundaryFace, vertices: &[DVec3], raster: Raster) -> Option<Self> {
        let [p, q, r] = face.vertices.map(|v| vertices[v as usize]);
        let corners = [p, q, r];
        let pixel = raster.pixel;
        let (left, right) = projected_range(&corners, 0, pixel);
        let (top, bottom) = projected_range(&corners, 1, pixel);
        let columns = Raster::indices(left, right, raster.width);
        let rows = Raster::indices(top, bottom, raster.height);
        if columns.is_empty() || rows.is_empty() {
            return None;
        }
        // Differences first: the plane's tilt then has the error of the triangle's shape, not of its distance.
        let normal = (q - p).cross(r - p);
        let eye_side = f64::from(face.eye_side);
        let distance = normal.dot(p);
        if distance * eye_side <= 0.0 || !distance.is_normal() {
            return None; // seen from the side, thinner than rounding
        }
        // An edge function has the same bits, up to its sign, for every triangle on that edge.
        let edges = [q.cross(r), r.cross(p), p.cross(q)].map(|normal| Line::new(normal, pixel, eye_side));
        let inverse_depth = Line::new(normal, pixel, distance.recip());
        let edge_columns = edges.map(|edge| -edge.x.recip());
        Some(Self { edges, edge_columns, inverse_depth, columns, rows, crossing: Crossing::new(face) })
    }

    /// The columns of row `y` that are covered.
    fn covered(&self, y: usize, raster: Raster) -> Range<usize> {
        let row = raster.row(y);
        let at_row = self.edges.map(|edge| edge.y * row + edge.constant);
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        for ((edge, at_row), per_value) in self.edges.iter().zip(at_row).zip(self.edge_columns) {
            let crossing = at_row * per_value;
            low = if edge.x > 0.0 { low.max(crossing) } else { low };
            high = if edge.x < 0.0 { high.min(crossing) } else { high };
        }
        let span = Raster::indices(low, high, raster.width);
        let mut start = span.start.max(self.columns.start) as usize;
        let mut end = (span.end.min(self.columns.end) as usize).max(start);
        // The crossings are rounded; the edge functions decide. Each is monotonic in the column even as
        // rounded, so what is covered is an interval, and only its ends need to be tried.
        let covers = |x: usize| {
            let column = raster.column(x);
            self.edges.iter().zip(at_row).all(|(edge, at_row)| {
                let value = edge.x * column + at_row;
                value > 0.0 || (value == 0.0 && edge.owns_zero())
            })
        };
        while start < end && !covers(start) {
            start += 1;
        }
        while start < end && !covers(end - 1) {
            end -= 1;
        }
        start..end
    }
}

/// What a boundary face does to a ray: it leaves a tetrahedron, or enters it. Ordered: leaves first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Crossing(u32);

impl Crossing {
    const ENTERS: u32 = 1 << 31;

    fn new(face: &BoundaryFace) -> Self {
        debug_assert!(face.cell < Self::ENTERS);
        Self(if face.leaves { face.cell } else { face.cell | Self::ENTERS })
    }

    fn cell(self) -> u32 {
        self.0 & !Self::ENTERS
    }

    fn leaves(self) -> bool {
        self.0 & Self::ENTERS == 0
    }
}

/// Where a ray meets a face.
#[derive(Debug, Clone, Copy)]
struct Fragment {
    inverse_depth: f64,
    crossing: Crossing,
    /// The next fragment of the pixel, or [`NONE`].
    next: u32,
}

/// Working memory of one thread, kept between bands.
struct Scratch {
    /// First fragment of each pixel of the band.
    heads: Vec<u32>,
    fragments: Vec<Fragment>,
    /// The fragments of one pixel.
    list: Vec<Fragment>,
    /// Tetrahedra by which the ray entered, and left, the runs that it is in, and left those before them.
    entered: Vec<u32>,
    left: Vec<u32>,
    left_before: Vec<u32>,
    /// For each tetrahedron the last one that was found in front of it: neighbouring pixels say the same.
    last_front: Vec<u32>,
}

/// Relates tetrahedra across gaps: lists of `[front, back]`, with duplicates.
///
/// `vertices` are in world space, `boundary` is [`Relations::boundary`](super::relations::Relations::boundary)
/// for the eye of `view`, and `tetrahedra` is their number. The set of pairs does not depend on threads.
pub fn relate(
    vertices: &[DVec3],
    tetrahedra: usize,
    boundary: &[BoundaryFace],
    view: &View,
) -> Vec<Vec<[u32; 2]>> {
    let raster = Raster {
        width: view.width as usize,
        height: view.height as usize,
        pixel: view.pixel_at_unit_depth(),
    };
    let frame = view.camera.frame();
    let from_eye = |&vertex: &DVec3| {
        let offset = vertex - view.camera.eye;
        DVec3::new(frame.right.dot(offset), -frame.up.dot(offset), frame.forward.dot(offset))
    };
    let vertices: Vec<DVec3> = vertices.par_iter().with_min_len(1024).map(from_eye).collect();
    let footprints: Vec<Footprint> = boundary
        .par_iter()
        .with_min_len(256)
        .filter_map(|face| Footprint::new(face, &vertices, raster))
        .collect();

    let scratch = || Scratch {
        heads: vec![NONE; raster.width * BAND],
        fragments: Vec::new(),
        list: Vec::new(),
        entered: Vec::new(),
        left: Vec::new(),
        left_before: Vec::new(),
        last_front: vec![NONE; tetrahedra],
    };
    let bands = footprints_of_bands(&footprints, raster);
    bands
        .par_iter()
        .enumerate()
        .map_init(scratch, |scratch, (band, members)| {
            scratch.collect_fragments(band, members, &footprints, raster);
            scratch.relate_pixels()
        })
        .collect()
}

/// For each band of rows, the footprints that reach into it.
fn footprints_of_bands(footprints: &[Footprint], raster: Raster) -> Vec<Vec<u32>> {
    let mut bands = vec![Vec::new(); raster.height.div_ceil(BAND)];
    for (id, footprint) in (0u32..).zip(footprints) {
        let Range { start, end } = footprint.rows;
        for band in &mut bands[start as usize / BAND..(end as usize).div_ceil(BAND)] {
            band.push(id);
        }
    }
    bands
}

impl Scratch {
    /// Fills the lists of the pixels of one band.
    fn collect_fragments(&mut self, band: usize, members: &[u32], footprints: &[Footprint], raster: Raster) {
        self.heads.fill(NONE);
        self.fragments.clear();
        let first_row = band * BAND;
        for &id in members {
            let footprint = &footprints[id as usize];
            let rows = footprint.rows.start as usize..footprint.rows.end as usize;
            for y in rows.start.max(first_row)..rows.end.min(first_row + BAND) {
                let heads = &mut self.heads[(y - first_row) * raster.width..][..raster.width];
                let columns = footprint.covered(y, raster);
                let Line { x: slope, y: row_slope, constant } = footprint.inverse_depth;
                let at_row = row_slope * raster.row(y) + constant;
                for (x, head) in columns.clone().zip(&mut heads[columns]) {
                    let inverse_depth = slope * raster.column(x) + at_row;
                    let next = std::mem::replace(head, self.fragments.len() as u32);
                    self.fragments.push(Fragment { inverse_depth, crossing: footprint.crossing, next });
                }
            }
        }
    }

    /// Sorts the lists and follows each ray.
    fn relate_pixels(&mut self) -> Vec<[u32; 2]> {
        let mut pairs = Vec::new();
        for pixel in 0..self.heads.len() {
            self.list.clear();
            let mut next = self.heads[pixel];
            while next != NONE {
                let fragment = self.fragments[next as usize];
                self.list.push(fragment);
                next = fragment.next;
            }
            if self.list.len() < 2 {
                continue;
            }
            sort_front_to_back(&mut self.list);
            self.follow_ray(&mut pairs);
        }
        pairs
    }

    /// Relates what one ray leaves to what it enters next; `self.list` is sorted.
    fn follow_ray(&mut self, pairs: &mut Vec<[u32; 2]>) {
        let leaves = self.list.iter().filter(|fragment| fragment.crossing.leaves()).count();
        // Every run ends in front of the eye; those that do not begin there hold the eye.
        let mut open_runs = (2 * leaves).saturating_sub(self.list.len());
        let mut overlap = open_runs > 1;
        self.entered.clear();
        self.left.clear();
        self.left_before.clear();
        for index in 0..self.list.len() {
            let crossing = self.list[index].crossing;
            if crossing.leaves() {
                open_runs = open_runs.saturating_sub(1);
                self.left.push(crossing.cell());
            } else {
                overlap |= open_runs > 0;
                open_runs += 1;
                self.entered.push(crossing.cell());
            }
            if open_runs == 0 || index + 1 == self.list.len() {
                self.relate_runs(overlap, pairs);
                overlap = false;
            }
        }
    }

    /// Relates runs that the ray is in together, one as a rule, to those before them, and to one another.
    fn relate_runs(&mut self, overlap: bool, pairs: &mut Vec<[u32; 2]>) {
        for &back in &self.entered {
            let within: &[u32] = if overlap { &self.left } else { &[] };
            for &front in self.left_before.iter().chain(within) {
                if front != back && self.last_front[back as usize] != front {
                    self.last_front[back as usize] = front;
                    pairs.push([front, back]);
                }
            }
        }
        self.entered.clear();
        std::mem::swap(&mut self.left_before, &mut self.left);
        self.left.clear();
    }
}

/// Sorts the fragments of a pixel by depth; faces in the same place (equal to the last bit, since the
/// order of a face's vertices is canonical) by leaves before entries, then by id.
fn sort_front_to_back(list: &mut [Fragment]) {
    list.sort_unstable_by(|a, b| {
        b.inverse_depth.total_cmp(&a.inverse_depth).then(a.crossing.cmp(&b.crossing))
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Camera;

    /// The pairs of a stack of faces on the axis, each given as `(depth, tetrahedron, leaves)`.
    fn pairs_of(stack: &[(f64, u32, bool)]) -> Vec<[u32; 2]> {
        let mut list: Vec<Fragment> = stack
            .iter()
            .map(|&(depth, cell, leaves)| {
                let face = BoundaryFace { vertices: [0; 3], cell, leaves, eye_side: 1 };
                Fragment { inverse_depth: depth.recip(), crossing: Crossing::new(&face), next: NONE }
            })
            .collect();
        sort_front_to_back(&mut list);
        let last_front = vec![NONE; stack.len()];
        let mut scratch = Scratch {
            heads: vec![],
            fragments: vec![],
            list,
            entered: vec![],
            left: vec![],
            left_before: vec![],
            last_front,
        };
        let mut pairs = vec![];
        scratch.follow_ray(&mut pairs);
        pairs
    }

    #[test]
    fn what_a_ray_leaves_is_in_front_of_what_it_enters_next() {
        let outside = [(1.0, 0, false), (2.0, 1, true), (3.0, 2, false), (4.0, 3, true), (5.0, 4, false)];
        assert_eq!(pairs_of(&outside), [[1, 2], [3, 4]]);
        let inside = [(1.0, 0, true), (2.0, 1, false), (3.0, 2, true)];
        assert_eq!(pairs_of(&inside), [[0, 1]]);
        let in_one_place = [(2.0, 1, false), (2.0, 0, true), (1.0, 2, false), (3.0, 3, true)];
        assert_eq!(pairs_of(&in_one_place), [[0, 1]]);
    }

    #[test]
    fn runs_that_overlap_are_one_cycle_between_their_neighbours() {
        // A run ends with 0; then the runs 1..3 and 2..4 overlap, and run 5 follows both.
        let stack = [
            (0.5, 6, false),
            (1.0, 0, true),
            (2.0, 1, false),
            (3.0, 2, false),
            (4.0, 3, true),
            (5.0, 4, true),
            (6.0, 5, false),
            (7.0, 5, true),
        ];
        // With 1 before 3 and 2 before 4 by their faces, 1 3 2 4 are a cycle.
        let mut pairs = pairs_of(&stack);
        pairs.sort_unstable();
        assert_eq!(pairs, [[0, 1], [0, 2], [3, 1], [3, 2], [3, 5], [4, 1], [4, 2], [4, 5]]);
    }

    #[test]
    fn faces_that_reach_behind_the_eye_cover_what_their_part_in_front_projects_to() {
        let camera = Camera { eye: DVec3::ZERO, target: -DVec3::Z, up: DVec3::Y, fov_y: 1.2, near: 0.1 };
        let view = View { camera, width: 40, height: 30, depth: false };
        let raster = Raster { width: 40, height: 30, pixel: view.pixel_at_unit_depth() };
        // A floor below the eye, from far in front to far behind: it covers just the lower half.
        let corners = [DVec3::new(0.0, 1.0, 1e6), DVec3::new(1e7, 1.0, -1e6), DVec3::new(-1e7, 1.0, -1e6)];
        let orientation = corners[0].dot(corners[1].cross(corners[2]));
        let eye_side = if orientation > 0.0 { 1 } else { -1 };
        let face = BoundaryFace { vertices: [0, 1, 2], cell: 0, leaves: false, eye_side };
        let footprint = Footprint::new(&face, &corners, raster).unwrap();
        for y in 0..30 {
            let covered = footprint.covered(y, raster);
            assert_eq!(covered.len(), if y < 15 { 0 } else { 40 }, "row {y}");
        }
        let behind = corners.map(|corner| corner * DVec3::new(1.0, 1.0, 0.0) - DVec3::Z);
        assert!(Footprint::new(&face, &behind, raster).is_none());
    }
}
