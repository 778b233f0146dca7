//! Texture coordinates for meshes that come without: projections from the positions.

use std::f64::consts::{PI, TAU};
use std::str::FromStr;

use glam::{DVec2, DVec3};
use serde::Deserialize;

use super::normals::facet_normal;

/// What to do about a mesh without texture coordinates.
pub(super) const ADVICE: &str = "export the mesh with UVs, or set `projection` under `[mesh]` in the scene to \"spherical\", \"box\", \
                                 \"planar-x\", \"planar-y\" or \"planar-z\"";

/// A world axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Axis {
    /// To the right.
    X,
    /// Up.
    Y,
    /// Towards the viewer.
    Z,
}

/// How texture coordinates are found; in a scene file `"planar-x"`, `"planar-y"`, `"planar-z"`, `"spherical"`
/// or `"box"`. As seen along the projection, or from outside, u runs to the right and v up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub enum Projection {
    /// Along one axis; the longer side of the bounds becomes 0..1, the shorter keeps its proportion.
    Planar {
        /// The axis along which all points have the same texture coordinates.
        axis: Axis,
    },
    /// From the middle of the bounds: longitude becomes u, latitude v. A triangle across the seam runs past
    /// u = 1, and one with a corner at a pole reads the middle of its other two corners there; a triangle
    /// that has a pole inside is distorted.
    Spherical,
    /// Each triangle along the axis that it faces most; the longest side of the bounds becomes 0..1.
    Box,
}

impl FromStr for Projection {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        Ok(match name {
            "planar-x" => Self::Planar { axis: Axis::X },
            "planar-y" => Self::Planar { axis: Axis::Y },
            "planar-z" => Self::Planar { axis: Axis::Z },
            "spherical" => Self::Spherical,
            "box" => Self::Box,
            _ => {
                return Err(format!(
                    "unknown projection \"{name}\": use planar-x, planar-y, planar-z, spherical or box"
                ));
            }
        })
    }
}

impl TryFrom<String> for Projection {
    type Error = String;

    fn try_from(name: String) -> Result<Self, String> {
        name.parse()
    }
}

impl Projection {
    /// Texture coordinates, one a triangle corner. There must be at least one position.
    pub fn uvs(&self, positions: &[DVec3], triangles: &[[u32; 3]]) -> Vec<[DVec2; 3]> {
        let low = positions.iter().copied().fold(DVec3::INFINITY, DVec3::min);
        let high = positions.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
        let corners = |ids: &[u32; 3]| ids.map(|id| positions[id as usize]);
        match *self {
            Self::Planar { axis } => {
                let (right, up) = plane_axes(axis, 1.0);
                let extent = extent(right, low, high).max(extent(up, low, high));
                let project = |p| DVec2::new(along(right, p, low, high), along(up, p, low, high)) / extent;
                triangles.iter().map(|ids| corners(ids).map(project)).collect()
            }
            Self::Spherical => {
                let middle = low.midpoint(high);
                triangles.iter().map(|ids| spherical(corners(ids).map(|p| p - middle))).collect()
            }
            Self::Box => {
                let extent = (high - low).max_element();
                let triangle_uvs = |ids| {
                    let corners = corners(ids);
                    let (axis, sign) = facing(facet_normal(corners));
                    let (right, up) = plane_axes(axis, sign);
                    corners.map(|p| DVec2::new(along(right, p, low, high), along(up, p, low, high)) / extent)
                };
                triangles.iter().map(triangle_uvs).collect()
            }
        }
    }
}

/// The world directions of u and v, each along an axis, as seen from the positive (`sign` = 1) or the
/// negative (-1) end of `axis`: `right x up = sign axis`.
fn plane_axes(axis: Axis, sign: f64) -> (DVec3, DVec3) {
    match axis {
        Axis::X => (DVec3::new(0.0, 0.0, -sign), DVec3::Y),
        Axis::Y => (DVec3::X, DVec3::new(0.0, 0.0, -sign)),
        Axis::Z => (DVec3::new(sign, 0.0, 0.0), DVec3::Y),
    }
}

/// The size of the bounds along a positive or negative axis direction; 1 where they are flat.
fn extent(direction: DVec3, low: DVec3, high: DVec3) -> f64 {
    let extent = direction.abs().dot(high - low);
    if extent > 0.0 { extent } else { 1.0 }
}

/// The distance of `p` from the side of the bounds where an axis direction enters them.
fn along(direction: DVec3, p: DVec3, low: DVec3, high: DVec3) -> f64 {
    let start = if direction.element_sum() > 0.0 { low } else { high };
    direction.dot(p - start)
}

/// The axis that a direction is nearest to, and its sign along it.
fn facing(normal: DVec3) -> (Axis, f64) {
    let size = normal.abs();
    let (axis, component) = if size.x >= size.y && size.x >= size.z {
        (Axis::X, normal.x)
    } else if size.y >= size.z {
        (Axis::Y, normal.y)
    } else {
        (Axis::Z, normal.z)
    };
    (axis, if component < 0.0 { -1.0 } else { 1.0 })
}

fn spherical(corners: [DVec3; 3]) -> [DVec2; 3] {
    // On the axis there is no longitude; as wide as the rounding of a sine of pi.
    let longitude = |p: DVec3| {
        let is_pole = p.x.hypot(p.z) <= 1e-15 * p.length();
        (!is_pole).then(|| p.x.atan2(p.z) / TAU)
    };
    let mut us = corners.map(longitude);
    // All corners within half a turn of the first that has a longitude, ...
    let reference = us.iter().flatten().next().copied().unwrap_or(0.0);
    for u in us.iter_mut().flatten() {
        *u -= (*u - reference).round();
    }
    // ... poles in the middle of the others, and the lot moved so that its middle lies in 0..1.
    let known = us.iter().flatten().count().max(1) as f64;
    let middle = us.iter().flatten().sum::<f64>() / known;
    [0, 1, 2].map(|k| {
        let latitude = corners[k].y.atan2(corners[k].x.hypot(corners[k].z));
        DVec2::new(us[k].unwrap_or(middle) - middle.floor(), 0.5 + latitude / PI)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::generate::{Generator, Plane, Sphere};

    #[test]
    fn spherical_agrees_with_the_sphere() {
        let sphere = Generator::Sphere(Sphere::default()).build().unwrap();
        let uvs = Projection::Spherical.uvs(&sphere.positions, &sphere.triangles);
        let mut compared = 0;
        for (ours, theirs) in uvs.iter().flatten().zip(sphere.uvs.iter().flatten()) {
            // The strips of the seam may be written a whole turn to either side.
            let difference = *ours - *theirs;
            let turns = difference.x.round();
            assert!((difference - DVec2::X * turns).length() < 1e-12, "{ours} for {theirs}");
            compared += 1;
        }
        assert_eq!(compared, 3 * 2208);
        for [a, b, c] in uvs {
            assert!((b - a).perp_dot(c - a) > 0.0, "no strip may run backwards");
        }
    }

    #[test]
    fn planar_agrees_with_the_plane() {
        let plane = Generator::Plane(Plane::default()).build().unwrap();
        let uvs = Projection::Planar { axis: Axis::Y }.uvs(&plane.positions, &plane.triangles);
        for (ours, theirs) in uvs.iter().flatten().zip(plane.uvs.iter().flatten()) {
            assert!((*ours - *theirs).length() < 1e-15, "{ours} for {theirs}");
        }
        let across = Projection::Planar { axis: Axis::X }.uvs(&plane.positions, &plane.triangles);
        assert!(across.iter().flatten().all(|uv| uv.is_finite() && uv.y == 0.0));
    }

    #[test]
    fn box_is_never_mirrored() {
        let sphere = Generator::Sphere(Sphere::default()).build().unwrap();
        let uvs = Projection::Box.uvs(&sphere.positions, &sphere.triangles);
        for [a, b, c] in uvs {
            assert!((b - a).perp_dot(c - a) > 0.0);
            assert!(a.min_element() >= 0.0 && a.max_element() <= 1.0);
        }
    }

    #[test]
    fn names_are_read() {
        #[derive(Debug, Deserialize)]
        struct Table {
            projection: Projection,
        }
        let table: Table = toml::from_str("projection = \"planar-z\"").unwrap();
        assert_eq!(table.projection, Projection::Planar { axis: Axis::Z });
        let error = toml::from_str::<Table>("projection = \"round\"").unwrap_err();
        assert!(error.to_string().contains("spherical"), "{error}");
    }
}
