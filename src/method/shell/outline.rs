//! Conservative outlines: for each tetrahedron a quadrilateral on the picture that covers every pixel centre whose ray
//! can meet it, however the rasteriser snaps and rounds. The fragment shader decides exactly which of them do.
//!
//! The outline of a projected tetrahedron is a triangle or a quadrilateral, known from which faces the ray leaves through.
//! Its edges are moved outwards by a margin (as in Hasselgren, Akenine-Moeller, Ohlsson 2005, Conservative Rasterization).
//! Where a corner is so sharp that it would run far away, a rectangle along the longest diagonal takes its place; where
//! the near plane cuts the tetrahedron, an upright rectangle around what is left.

use glam::{DVec2, DVec3};

use crate::scene::View;

/// Pinhole projection of view space (x right, y up, z depth) to pixels (x right, y down).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Projection {
    /// The middle of the picture, in pixels; twice that is its size.
    pub centre: DVec2,
    /// World units between pixel centres at depth 1.
    pub pixel: f64,
    /// Depth of the near plane, world units.
    pub near: f64,
    /// How far outlines reach beyond the exact projection, in pixels.
    pub margin: f64,
}

/// Why a tetrahedron has no outline.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unseen {
    /// All of it lies before the near plane.
    BeforeNear,
    /// All of it lies beside the picture.
    Beside,
}

/// Four corners in pixels, clockwise on the picture (y down); the last two are equal for a triangle.
pub type Outline = [DVec2; 4];

/// Corners sharper than this (sine of half the angle) would be moved by more than ten margins.
const SHARPEST: f64 = 0.1;

/// Outlines that reach farther than this many picture sizes beyond the picture are cut to it: as f32 their corners would be
/// off by more than the margin.
const FARTHEST: f64 = 4.0;

impl Projection {
    /// To the picture of a view, with this margin.
    pub fn new(view: &View, margin: f64) -> Self {
        let centre = 0.5 * DVec2::new(f64::from(view.width), f64::from(view.height));
        Self { centre, pixel: view.pixel_at_unit_depth(), near: view.camera.near, margin }
    }

    /// Where a point beyond the near plane is seen.
    pub fn project(&self, point: DVec3) -> DVec2 {
        self.centre + DVec2::new(point.x, -point.y) / (point.z * self.pixel)
    }

    /// The outline of the tetrahedron with these view-space vertices, given where they [`project`](Self::project) to. Bit `k` of
    /// `exit_faces` is set where the eye lies on the inner side of the face opposite vertex `k`.
    ///
    /// # Errors
    /// [`Unseen`], where no pixel centre can meet it.
    pub fn outline(
        &self,
        vertices: &[DVec3; 4],
        pixels: [DVec2; 4],
        exit_faces: u8,
    ) -> Result<Outline, Unseen> {
        let mut bounds = Bounds::EMPTY;
        let cut = vertices.iter().any(|vertex| vertex.z <= self.near);
        if cut {
            self.bound_beyond_near(vertices, &mut bounds);
        } else {
            pixels.into_iter().for_each(|pixel| bounds.include(pixel));
        }
        if bounds.is_empty() {
            return Err(Unseen::BeforeNear);
        }
        let size = 2.0 * self.centre;
        let bounds = bounds.grown(self.margin);
        if bounds.min.cmpgt(size).any() || bounds.max.cmplt(DVec2::ZERO).any() {
            return Err(Unseen::Beside);
        }
        let far = bounds.min.cmplt(-FARTHEST * size).any() || bounds.max.cmpgt((1.0 + FARTHEST) * size).any();
        if cut || far {
            return Ok(bounds.clamped(-self.margin, size + self.margin).corners());
        }
        let corners = hull(pixels, exit_faces);
        Ok(widened(&corners, self.margin).unwrap_or_else(|| rectangle(&corners, self.margin)))
    }

    /// The projection of the part beyond the near plane: of the vertices there, and of the points where edges are cut.
    fn bound_beyond_near(&self, vertices: &[DVec3; 4], bounds: &mut Bounds) {
        for (i, &a) in vertices.iter().enumerate() {
            if a.z >= self.near {
                bounds.include(self.project(a));
            }
            for &b in &vertices[i + 1..] {
                if (a.z < self.near) != (b.z < self.near) {
                    let cut = a.lerp(b, (self.near - a.z) / (b.z - a.z));
                    bounds.include(self.project(cut.with_z(self.near)));
                }
            }
        }
    }
}

/// An upright rectangle.
struct Bounds {
    min: DVec2,
    max: DVec2,
}

impl Bounds {
    const EMPTY: Self = Self { min: DVec2::INFINITY, max: DVec2::NEG_INFINITY };

    fn include(&mut self, point: DVec2) {
        self.min = self.min.min(point);
        self.max = self.max.max(point);
    }

    fn is_empty(&self) -> bool {
        self.min.x > self.max.x
    }

    fn grown(&self, by: f64) -> Self {
        Self { min: self.min - by, max: self.max + by }
    }

    fn clamped(&self, min: f64, max: DVec2) -> Self {
        Self { min: self.min.max(DVec2::splat(min)), max: self.max.min(max) }
    }

    fn corners(&self) -> Outline {
        let Self { min, max } = *self;
        [min, DVec2::new(max.x, min.y), max, DVec2::new(min.x, max.y)]
    }
}

/// The hull of four projected vertices, the last corner doubled for a triangle.
fn hull(points: [DVec2; 4], exit_faces: u8) -> Outline {
    let others = |k: usize| {
        let [a, b, c] = [1, 2, 3].map(|i| points[(k + i) % 4]);
        [a, b, c, c]
    };
    let bits = exit_faces & 0b1111;
    match bits.count_ones() {
        // Two exit faces: their common edge is one diagonal, the other two vertices lie on either side of it.
        2 => {
            let is_exit = |k: &usize| bits & (1 << k) != 0;
            let mut exits = (0..4).filter(is_exit);
            let mut entries = (0..4).filter(|k| !is_exit(k));
            let mut next = || [exits.next(), entries.next()].map(|k| points[k.expect("two of each")]);
            let [[a, b], [c, d]] = [next(), next()];
            [a, b, c, d]
        }
        // One face covers what all others do: the only exit face, or the only entry face.
        1 => others(bits.trailing_zeros() as usize),
        _ => others((!bits & 0b1111).trailing_zeros() as usize % 4),
    }
}

/// The polygon with its edges moved outwards by `margin`, clockwise; `None` where a corner is too sharp or an
/// edge too short to have a direction.
fn widened(corners: &Outline, margin: f64) -> Option<Outline> {
    let count = if corners[2] == corners[3] { 3 } else { 4 };
    let doubled_area: f64 = (0..count).map(|i| corners[i].perp_dot(corners[(i + 1) % count])).sum();
    let mut polygon = *corners;
    if doubled_area < 0.0 {
        polygon[..count].reverse();
    }
    let mut directions = [DVec2::ZERO; 4];
    for i in 0..count {
        let edge = polygon[(i + 1) % count] - polygon[i];
        let length = edge.length();
        if length.is_nan() || length <= margin {
            return None;
        }
        directions[i] = edge / length;
    }
    let mut moved = [DVec2::ZERO; 4];
    for i in 0..count {
        let (before, after) = (directions[(i + count - 1) % count], directions[i]);
        // Clockwise with y down: the outward normal of an edge is its direction turned by -90 degrees.
        let normals = (-before.perp(), -after.perp());
        let bisector = normals.0 + normals.1;
        // |bisector| / 2 is the sine of half the corner's angle.
        let squared = bisector.length_squared();
        if squared < (2.0 * SHARPEST).powi(2) {
            return None;
        }
        moved[i] = polygon[i] + bisector * (2.0 * margin / squared);
    }
    if count == 3 {
        moved[3] = moved[2];
    }
    Some(moved)
}

/// A rectangle around the corners, along the longest line between two of them, wider by `margin` on every side.
fn rectangle(corners: &Outline, margin: f64) -> Outline {
    let mut longest = DVec2::ZERO;
    for (i, &a) in corners.iter().enumerate() {
        for &b in &corners[i + 1..] {
            if (b - a).length_squared() > longest.length_squared() {
                longest = b - a;
            }
        }
    }
    let along = longest.normalize_or(DVec2::X);
    let mut bounds = Bounds::EMPTY;
    corners.iter().for_each(|corner| bounds.include(DVec2::new(along.dot(*corner), along.perp_dot(*corner))));
    bounds.grown(margin).corners().map(|point| point.x * along + point.y * along.perp())
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    use super::*;

    const PROJECTION: Projection =
        Projection { centre: DVec2::new(32.0, 24.0), pixel: 1.0 / 32.0, near: 0.125, margin: 1.0 / 128.0 };

    fn outline(
        projection: Projection,
        vertices: &[DVec3; 4],
        exit_faces: u8,
    ) -> std::result::Result<Outline, Unseen> {
        projection.outline(vertices, vertices.map(|vertex| projection.project(vertex)), exit_faces)
    }

    /// Exit faces of a tetrahedron seen from the origin.
    fn exit_faces(vertices: &[DVec3; 4]) -> u8 {
        (0..4).fold(0, |bits, k| {
            let [a, b, c] = [1, 2, 3].map(|i| vertices[(k + i) % 4]);
            let normal = (b - a).cross(c - a);
            let inner = normal.dot(vertices[k] - a) * normal.dot(-a) > 0.0;
            bits | (u8::from(inner) << k)
        })
    }

    fn covers(outline: &Outline, point: DVec2) -> bool {
        let inside = |a: DVec2, b: DVec2| (b - a).perp_dot(point - a) >= 0.0;
        (0..4).all(|i| inside(outline[i], outline[(i + 1) % 4]))
    }

    /// Random tetrahedra of all shapes, from blobs to needles and sheets, some of them around the near plane or the eye.
    fn tetrahedra(count: usize) -> impl Iterator<Item = [DVec3; 4]> {
        let mut random = Pcg64::seed_from_u64(5);
        (0..count).map(move |_| {
            let mut scale = || 10f64.powf(random.random_range(-6.0..0.5));
            let scales = DVec3::new(scale(), scale(), scale());
            let mut point =
                |range: f64| DVec3::from_array(std::array::from_fn(|_| random.random_range(-range..range)));
            let centre = point(2.0) + DVec3::Z * 1.5;
            let axes = [point(1.0), point(1.0), point(1.0)];
            std::array::from_fn(|_| {
                let local = point(1.0) * scales;
                centre + local.x * axes[0] + local.y * axes[1] + local.z * axes[2]
            })
        })
    }

    #[test]
    fn every_point_of_the_tetrahedron_is_covered_with_the_margin() {
        let mut random = Pcg64::seed_from_u64(6);
        let mut tested = 0;
        for vertices in tetrahedra(20_000) {
            let outline = outline(PROJECTION, &vertices, exit_faces(&vertices));
            for _ in 0..20 {
                let weights: [f64; 4] = std::array::from_fn(|_| -random.random_range(1e-9..1.0f64).ln());
                let sum: f64 = weights.iter().sum();
                let point: DVec3 =
                    vertices.iter().zip(weights).map(|(vertex, weight)| *vertex * (weight / sum)).sum();
                let pixel = PROJECTION.project(point);
                let in_picture = pixel.cmpge(DVec2::ZERO).all() && pixel.cmple(2.0 * PROJECTION.centre).all();
                if point.z < PROJECTION.near || !in_picture {
                    continue;
                }
                tested += 1;
                let outline =
                    outline.unwrap_or_else(|why| panic!("{vertices:?} is {why:?}, yet covers {pixel}"));
                // Half the margin on every side is left over for the rasteriser.
                for offset in [DVec2::X, DVec2::NEG_X, DVec2::Y, DVec2::NEG_Y] {
                    let moved = (pixel + offset * PROJECTION.margin / 2.0)
                        .clamp(DVec2::ZERO, 2.0 * PROJECTION.centre);
                    assert!(covers(&outline, moved), "{vertices:?}: {outline:?} leaves out {moved}");
                }
            }
        }
        assert!(tested > 50_000, "only {tested} points were in the picture");
    }

    #[test]
    fn an_outline_without_its_margin_is_found_out() {
        let vertices = [
            DVec3::new(0.0, 0.0, 2.0),
            DVec3::new(0.5, 0.0, 2.0),
            DVec3::new(0.0, 0.5, 2.0),
            DVec3::new(0.1, 0.1, 2.5),
        ];
        let exact = Projection { margin: 0.0, ..PROJECTION };
        let outline = outline(exact, &vertices, exit_faces(&vertices)).unwrap();
        let corner = exact.project(vertices[0]);
        assert!(covers(&outline, corner + DVec2::new(0.1, -0.1)));
        assert!(!covers(&outline, corner - DVec2::new(PROJECTION.margin / 2.0, 0.0)));
    }

    #[test]
    fn outlines_are_not_much_larger_than_what_they_cover() {
        let area = |polygon: &Outline| {
            0.5 * (0..4).map(|i| polygon[i].perp_dot(polygon[(i + 1) % 4])).sum::<f64>().abs()
        };
        let mut tested = 0;
        for vertices in tetrahedra(20_000) {
            let points = vertices.map(|vertex| PROJECTION.project(vertex));
            let size = 2.0 * PROJECTION.centre;
            let whole = |(vertex, point): (&DVec3, &DVec2)| {
                vertex.z > PROJECTION.near && point.cmpge(DVec2::ZERO).all() && point.cmple(size).all()
            };
            if !vertices.iter().zip(&points).all(whole) {
                continue;
            }
            let exits = exit_faces(&vertices);
            let outline = outline(PROJECTION, &vertices, exits).unwrap();
            // A rectangle along the longest diagonal is at most twice the hull, whose area is at least half
            // the diagonal times the rectangle's other side. The margin adds a strip along each edge, and a corner moved by
            // at most ten margins at each end of it.
            let hull = hull(points, exits);
            let perimeter: f64 = (0..4).map(|i| hull[i].distance(hull[(i + 1) % 4])).sum();
            let strip = 10.0 * PROJECTION.margin * (perimeter + 10.0 * PROJECTION.margin);
            assert!(area(&outline) <= 2.0 * area(&hull) + strip, "{} for {}", area(&outline), area(&hull));
            tested += 1;
        }
        assert!(tested > 1_000, "only {tested} outlines compared");
    }

    #[test]
    fn what_cannot_be_seen_has_no_outline() {
        let at =
            |centre: DVec3| [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z].map(|corner| centre + 0.1 * corner);
        assert_eq!(outline(PROJECTION, &at(DVec3::new(0.0, 0.0, -1.0)), 1), Err(Unseen::BeforeNear));
        assert_eq!(outline(PROJECTION, &at(DVec3::new(9.0, 0.0, 2.0)), 1), Err(Unseen::Beside));
    }
}
