//! The A-buffer (L. Carpenter, "The A-buffer, an antialiased hidden surface method", 1984): where the ray of each pixel leaves the
//! shell and enters it, front to back.
//!
//! Against section 4.1 of Dufort, Leblanc, Poulin 2005:
//! - faces are sampled in f64 by edge functions of the homogeneous triangle (Olano, Greer 1997), linear in
//!   pixel coordinates whether or not vertices lie behind the eye: nothing is clipped, and only points
//!   in front of the eye are met (the near plane plays no part);
//! - samples stand 1e-10 pixels off the pixel centres: a symmetric scene sends rays exactly through edges and
//!   vertices, where rounding would decide on its own which faces are met, and in which order.
//! - what a pixel's ray crosses is found once for all pixels of a row beside one another whose rays cross the same faces in the same
//!   order, not pixel by pixel.
//!
//! Inverse depth is used for depth: it is linear in pixel coordinates over a plane.

use std::cmp::Ordering;
use std::ops::Range;

use glam::DVec3;
use rayon::prelude::*;

use super::relations::BoundaryFace;
use crate::scene::View;

/// Rows of pixels that are worked on together: few enough that their spans stay in the cache.
const BAND: usize = 16;

/// Pixels right and down from a pixel's centre to its sample. Far above the rounding of projected vertices
/// (1e-13 pixels), so that nothing near a sample is decided by rounding where vertices stand on centres;
/// far below any distance that matters: what a ray cuts off by less than this is thinner than 1e-10 pixels.
const NUDGE: [f64; 2] = [1e-10, 0.6180339887e-10];

/// Pixels by which a sample is off a bound, at least, where it need not be tested: above the rounding of a
/// projected coordinate and above [`NUDGE`], and small enough that few samples are.
const MARGIN: f64 = 1e-6;

/// End of a list of spans.
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
pub(super) struct Raster {
    pub width: usize,
    pub height: usize,
    pub pixel: f64,
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

    /// The indices, of `size` along one axis, whose samples lie in `low..=high`, where each end is off by `margin` to the outside.
    fn indices(low: f64, high: f64, margin: f64, size: usize) -> Range<u32> {
        let first = 0.5 * size as f64 - 0.5;
        // Casts round towards zero, saturate, and are one instruction; floor and ceil are calls.
        let begin = (low + first - margin + 1.0).min(size as f64) as u32;
        let end = (high + first + margin + 1.0).min(size as f64) as u32;
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
    /// Whether an edge runs along the rows: it is crossed nowhere, or where no number says.
    is_level: bool,
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
        let columns = Raster::indices(left, right, MARGIN, raster.width);
        let rows = Raster::indices(top, bottom, MARGIN, raster.height);
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
        let is_level = edge_columns.iter().any(|per_value| !per_value.is_finite());
        Some(Self {
            edges,
            edge_columns,
            is_level,
            inverse_depth,
            columns,
            rows,
            crossing: Crossing::new(face),
        })
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
        // Both faces on an edge find the same crossing, bit for bit: where neither tests, both agree on whose a sample is.
        let clamped = |span: Range<u32>| {
            let start = span.start.max(self.columns.start) as usize;
            start..(span.end.min(self.columns.end) as usize).max(start)
        };
        let span = clamped(Raster::indices(low, high, MARGIN, raster.width));
        if !self.is_level && span == clamped(Raster::indices(low, high, -MARGIN, raster.width)) {
            return span;
        }
        let Range { mut start, mut end } = span;
        // A sample is so near to a crossing that the edge functions decide. Each is monotonic in the column even as
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
pub(super) struct Crossing(u32);

impl Crossing {
    const ENTERS: u32 = 1 << 31;

    pub(super) fn new(face: &BoundaryFace) -> Self {
        let place = face.cell << 2 | u32::from(face.local);
        debug_assert!(face.cell < 1 << 29, "a shell has fewer tetrahedra");
        Self(if face.leaves { place } else { place | Self::ENTERS })
    }

    pub(super) fn cell(self) -> u32 {
        self.place() >> 2
    }

    /// Four times the tetrahedron, and the number of its face.
    pub(super) fn place(self) -> u32 {
        self.0 & !Self::ENTERS
    }

    pub(super) fn leaves(self) -> bool {
        self.0 & Self::ENTERS == 0
    }
}

/// The pixels of a row that a face covers.
#[derive(Debug, Clone, Copy)]
struct Span {
    /// The inverse depth at column `x` is `slope * raster.column(x) + at_row`.
    slope: f64,
    at_row: f64,
    crossing: Crossing,
    /// After its last column.
    end: u32,
    /// The next span that begins where this one does, or [`NONE`].
    next: u32,
}

impl Span {
    fn inverse_depth(&self, column: f64) -> f64 {
        self.slope * column + self.at_row
    }

    /// By depth; faces in the same place (equal to the last bit, since the order of a face's vertices is canonical) by leaves before
    /// entries, then by id.
    fn compare(&self, other: &Self, column: f64) -> Ordering {
        let nearer = other.inverse_depth(column).total_cmp(&self.inverse_depth(column));
        nearer.then(self.crossing.cmp(&other.crossing))
    }
}

/// The boundary faces of a shell in a view, by the bands of rows that they reach into.
pub(super) struct ABuffer {
    raster: Raster,
    footprints: Vec<Footprint>,
    /// Footprints, of each band.
    bands: Vec<Vec<u32>>,
}

/// The spans of one band of rows; its memory is used again for the next.
pub(super) struct Band {
    raster: Raster,
    /// The first span that begins at each pixel, or [`NONE`].
    begins: Vec<u32>,
    spans: Vec<Span>,
    /// Those over one pixel, front to back, and their crossings.
    here: Vec<Span>,
    crossings: Vec<Crossing>,
}

impl ABuffer {
    /// What the eye of `view` sees. `vertices` are in world space, `boundary` is
    /// [`Relations::boundary`](super::relations::Relations::boundary) for it.
    pub(super) fn of_view(vertices: &[DVec3], boundary: &[BoundaryFace], view: &View) -> Self {
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
        Self::new(&vertices, boundary, raster)
    }

    /// `vertices` are relative to the eye: right, down, into the picture.
    pub(super) fn new(vertices: &[DVec3], boundary: &[BoundaryFace], raster: Raster) -> Self {
        let footprints: Vec<Footprint> = boundary
            .par_iter()
            .with_min_len(256)
            .filter_map(|face| Footprint::new(face, vertices, raster))
            .collect();
        let bands = footprints_of_bands(&footprints, raster);
        Self { raster, footprints, bands }
    }

    /// Rows of pixels are worked on in so many bands.
    pub(super) fn band_count(&self) -> usize {
        self.bands.len()
    }

    /// Of each band but the last.
    pub(super) fn pixels_of_band(&self) -> usize {
        BAND * self.raster.width
    }

    /// Pixels of the picture.
    pub(super) fn pixels(&self) -> usize {
        self.raster.width * self.raster.height
    }

    /// What `visit` makes of each band, from the top of the picture down, and of its part of something; each thread that works on
    /// some has a state of its own.
    pub(super) fn map_bands<S, P: Send, T: Send>(
        &self,
        parts: Vec<P>,
        state: impl Fn() -> S + Sync + Send,
        visit: impl Fn(&mut S, &mut Band, P) -> T + Sync + Send,
    ) -> Vec<T> {
        let band = || Band {
            raster: self.raster,
            begins: Vec::new(),
            spans: Vec::new(),
            here: Vec::new(),
            crossings: Vec::new(),
        };
        self.bands
            .par_iter()
            .zip_eq(parts)
            .enumerate()
            .map_init(
                || (state(), band()),
                |(state, band), (number, (members, part))| {
                    band.collect_spans(number, members, &self.footprints);
                    visit(state, band, part)
                },
            )
            .collect()
    }
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

impl Band {
    /// Finds the spans of one band.
    fn collect_spans(&mut self, band: usize, members: &[u32], footprints: &[Footprint]) {
        let raster = self.raster;
        let rows_here = (raster.height - band * BAND).min(BAND);
        self.begins.clear();
        self.begins.resize(raster.width * rows_here, NONE);
        self.spans.clear();
        let first_row = band * BAND;
        for &id in members {
            let footprint = &footprints[id as usize];
            let rows = footprint.rows.start as usize..footprint.rows.end as usize;
            for y in rows.start.max(first_row)..rows.end.min(first_row + BAND) {
                let columns = footprint.covered(y, raster);
                if columns.is_empty() {
                    continue;
                }
                let begins = &mut self.begins[(y - first_row) * raster.width + columns.start];
                let next = std::mem::replace(begins, self.spans.len() as u32);
                let Line { x: slope, y: row_slope, constant } = footprint.inverse_depth;
                self.spans.push(Span {
                    slope,
                    at_row: row_slope * raster.row(y) + constant,
                    crossing: footprint.crossing,
                    end: columns.end as u32,
                    next,
                });
            }
        }
    }

    /// Calls `visit` with what rays cross, front to back, and how many pixels beside one another that is so for: row by row.
    pub(super) fn each_run(&mut self, mut visit: impl FnMut(usize, &[Crossing])) {
        let Self { raster, begins, spans, here, crossings } = self;
        for row in begins.chunks_exact(raster.width) {
            here.clear();
            let (mut x, mut end) = (0, 0);
            while x < row.len() {
                if x == end {
                    here.retain(|span| span.end as usize > x);
                    let mut begin = row[x];
                    while let Some(span) = spans.get(begin as usize) {
                        here.push(*span);
                        begin = span.next;
                    }
                    end = here.iter().map(|span| span.end as usize).min().unwrap_or(row.len());
                    let begin = row[x + 1..end].iter().position(|&begin| begin != NONE);
                    end = begin.map_or(end, |columns| x + 1 + columns);
                }
                let column = raster.column(x);
                here.sort_unstable_by(|a, b| a.compare(b, column));
                // Inverse depths are linear: what is sorted at both ends is sorted between them.
                let last = raster.column(end - 1);
                let is_one = here.is_sorted_by(|a, b| a.compare(b, last).is_le());
                let pixels = if is_one { end - x } else { 1 };
                crossings.clear();
                crossings.extend(here.iter().map(|span| span.crossing));
                visit(pixels, crossings);
                x += pixels;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    use super::*;
    use crate::scene::Camera;

    #[test]
    fn faces_that_reach_behind_the_eye_cover_what_their_part_in_front_projects_to() {
        let camera = Camera { eye: DVec3::ZERO, target: -DVec3::Z, up: DVec3::Y, fov_y: 1.2, near: 0.1 };
        let view = View { camera, width: 40, height: 30, depth: false };
        let raster = Raster { width: 40, height: 30, pixel: view.pixel_at_unit_depth() };
        // A floor below the eye, from far in front to far behind: it covers just the lower half.
        let corners = [DVec3::new(0.0, 1.0, 1e6), DVec3::new(1e7, 1.0, -1e6), DVec3::new(-1e7, 1.0, -1e6)];
        let orientation = corners[0].dot(corners[1].cross(corners[2]));
        let eye_side = if orientation > 0.0 { 1 } else { -1 };
        let face = BoundaryFace { vertices: [0, 1, 2], cell: 0, local: 3, leaves: false, eye_side };
        let footprint = Footprint::new(&face, &corners, raster).unwrap();
        for y in 0..30 {
            let covered = footprint.covered(y, raster);
            assert_eq!(covered.len(), if y < 15 { 0 } else { 40 }, "row {y}");
        }
        let behind = corners.map(|corner| corner * DVec3::new(1.0, 1.0, 0.0) - DVec3::Z);
        assert!(Footprint::new(&face, &behind, raster).is_none());
    }

    /// Random triangles that go through one another, some with corners on pixel centres or in one place, some behind the eye.
    fn faces(random: &mut Pcg64, count: u32) -> (Vec<DVec3>, Vec<BoundaryFace>) {
        let corner = |random: &mut Pcg64| {
            let mut at = DVec3::from_array([0, 1, 2].map(|_| random.random_range(-1.0..1.0)));
            if random.random_bool(0.3) {
                at = (4.0 * at).round() / 4.0;
            }
            at * DVec3::new(8.0, 6.0, 2.0) + 1.5 * DVec3::Z
        };
        let vertices: Vec<DVec3> = (0..3 * count).map(|_| corner(random)).collect();
        let face = |cell: u32| {
            let ids = [0, 1, 2].map(|i| if cell % 5 == 4 { 3 * cell - 3 + i } else { 3 * cell + i });
            let [p, q, r] = ids.map(|id| vertices[id as usize]);
            let eye_side = if p.dot(q.cross(r)) > 0.0 { 1 } else { -1 };
            BoundaryFace { vertices: ids, cell, local: 3, leaves: random.random(), eye_side }
        };
        let faces = (0..count).map(face).collect();
        (vertices, faces)
    }

    #[test]
    fn runs_hold_what_each_pixel_by_itself_meets() {
        let mut random = Pcg64::seed_from_u64(7);
        for (width, height, count) in [(37, 40, 30), (1, 20, 30), (64, 3, 8), (50, 17, 0)] {
            let camera = Camera { eye: DVec3::ZERO, target: -DVec3::Z, up: DVec3::Y, fov_y: 2.0, near: 0.1 };
            let view = View { camera, width, height, depth: false };
            let (vertices, faces) = faces(&mut random, count);
            // Right, down and into the picture, in place of x, y and z.
            let world: Vec<DVec3> = vertices.iter().map(|&v| v * DVec3::new(1.0, -1.0, -1.0)).collect();
            let abuffer = ABuffer::of_view(&world, &faces, &view);
            let raster = abuffer.raster;
            let bands = abuffer.map_bands(
                vec![(); abuffer.band_count()],
                || (),
                |(), band, ()| {
                    let mut pixels = Vec::new();
                    band.each_run(|count, crossings| {
                        pixels.extend(std::iter::repeat_n(crossings.to_vec(), count));
                    });
                    pixels
                },
            );
            let mut crossed = 0;
            for (index, found) in bands.concat().into_iter().enumerate() {
                let (column, y) = (raster.column(index % raster.width), index / raster.width);
                let value = |line: &Line| line.x * column + (line.y * raster.row(y) + line.constant);
                let covers = |edge: &Line| value(edge) > 0.0 || (value(edge) == 0.0 && edge.owns_zero());
                let met = abuffer.footprints.iter().filter(|footprint| footprint.edges.iter().all(covers));
                let mut met: Vec<_> =
                    met.map(|footprint| (value(&footprint.inverse_depth), footprint.crossing)).collect();
                met.retain(|(inverse_depth, _)| *inverse_depth > 0.0);
                met.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
                crossed += met.len();
                let met: Vec<Crossing> = met.into_iter().map(|(_, crossing)| crossing).collect();
                assert_eq!(found, met, "{width} x {height}, pixel {index}");
            }
            assert!(crossed > 2 * count as usize || count == 0, "{crossed}");
        }
    }
}
