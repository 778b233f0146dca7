//! The surface in each texel: triangles are clipped to it (I. E. Sutherland, G. W. Hodgman, *Reentrant Polygon Clipping*,
//! 1974), and area, normal and colour are summed up. A face that lies between two texels counts for both.

use glam::{DVec2, DVec3, Vec3};

use super::{Facet, Grid};
use crate::mesh::model::Material;

/// Less surface than this, in squares of a texel's side, is rounding.
const LEAST_AREA: f64 = 1e-9;

/// The surface in a texel.
#[derive(Clone, Copy, Default)]
pub(super) struct Patch {
    /// In squares of a texel's side.
    area: f64,
    /// The sum of normal times area.
    normal: DVec3,
    /// The sum of linear colour times area.
    colour: DVec3,
}

impl Patch {
    pub fn is_seen(&self) -> bool {
        self.area > LEAST_AREA
    }

    /// The average linear colour.
    pub fn colour(&self) -> Vec3 {
        (self.colour / self.area).as_vec3()
    }

    /// Of unit length; zero where there is no surface, or both sides of it.
    pub fn normal(&self) -> Vec3 {
        if self.normal.length() > LEAST_AREA { self.normal.normalize().as_vec3() } else { Vec3::ZERO }
    }
}

/// A corner of a clipped triangle.
#[derive(Clone, Copy)]
struct Corner {
    position: DVec3,
    uv: DVec2,
}

type Polygon = Vec<Corner>;

/// The surface in each texel, in the order of a volume.
pub(super) fn patches(grid: &Grid, facets: &[Facet], materials: &[Material]) -> Vec<Patch> {
    let rows = grid.rows(facets.iter().map(|facet| {
        let v = facet.corners.map(|corner| corner.y);
        // A face between two rows belongs to both.
        [v[0].min(v[1]).min(v[2]).next_down(), v[0].max(v[1]).max(v[2])]
    }));
    let [width, _, depth] = grid.size;
    grid.fill(|v, patches: &mut [Patch]| {
        for &(facet, row) in &rows[v] {
            let facet = &facets[facet];
            let material = &materials[facet.material as usize];
            let footprint = footprint(facet);
            let corner = |k: usize| Corner { position: facet.corners[k], uv: facet.uvs[k] };
            let strip = slab(&[0, 1, 2].map(corner), 1, row);
            for w in slabs(&strip, 2) {
                if !(0..depth as i64).contains(&w) {
                    continue;
                }
                let bar = slab(&strip, 2, w);
                for column in slabs(&bar, 0) {
                    let Some(u) = grid.wrapped(0, column) else { continue };
                    let piece = slab(&bar, 0, column);
                    let Some((area, uv)) = measure(&piece) else { continue };
                    let patch = &mut patches[w as usize * width + u];
                    patch.area += area;
                    patch.normal += area * facet.area.normalize_or_zero();
                    patch.colour += area * material.colour_at(uv, footprint).as_dvec3();
                }
            }
        }
    })
}

/// The area in the plane of texture coordinates that a square texel of the surface takes up.
fn footprint(facet: &Facet) -> f64 {
    let [a, b, c] = facet.uvs;
    let footprint = 0.5 * (b - a).perp_dot(c - a).abs() / facet.area.length();
    if footprint.is_finite() { footprint } else { 0.0 }
}

/// The texels along `axis` that a polygon reaches into or touches.
fn slabs(polygon: &[Corner], axis: usize) -> std::ops::RangeInclusive<i64> {
    let along = || polygon.iter().map(|corner| corner.position[axis]);
    let (low, high) = (along().fold(f64::INFINITY, f64::min), along().fold(f64::NEG_INFINITY, f64::max));
    // Empty where there are no corners.
    low.next_down().floor() as i64..=high.floor() as i64
}

/// The part of a convex polygon between two planes one texel apart.
fn slab(polygon: &[Corner], axis: usize, texel: i64) -> Polygon {
    let (low, high) = (texel as f64, texel as f64 + 1.0);
    let above = clip(polygon, |corner| corner.position[axis] - low);
    clip(&above, |corner| high - corner.position[axis])
}

/// The part of a convex polygon where `height` is at least 0.
fn clip(polygon: &[Corner], height: impl Fn(&Corner) -> f64) -> Polygon {
    let mut kept = Polygon::with_capacity(polygon.len() + 1);
    for (index, corner) in polygon.iter().enumerate() {
        let next = &polygon[(index + 1) % polygon.len()];
        let (here, there) = (height(corner), height(next));
        if here >= 0.0 {
            kept.push(*corner);
        }
        if (here > 0.0 && there < 0.0) || (here < 0.0 && there > 0.0) {
            let part = here / (here - there);
            kept.push(Corner {
                position: corner.position.lerp(next.position, part),
                uv: corner.uv.lerp(next.uv, part),
            });
        }
    }
    kept
}

/// The area of a convex polygon and the texture coordinates at its centre of gravity; none where it has no area.
fn measure(polygon: &[Corner]) -> Option<(f64, DVec2)> {
    let (first, others) = polygon.split_first()?;
    let (mut area, mut uv) = (0.0, DVec2::ZERO);
    for pair in others.windows(2) {
        let cross = (pair[0].position - first.position).cross(pair[1].position - first.position);
        let part = 0.5 * cross.length();
        area += part;
        uv += part * (first.uv + pair[0].uv + pair[1].uv) / 3.0;
    }
    (area > 0.0).then(|| (area, uv / area))
}
