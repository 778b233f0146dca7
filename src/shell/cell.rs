//! The affine maps of one tetrahedron: barycentric gradients and the linear part of the texture map (the
//! matrix `M^{o->t}` of Dufort et al. 2005, section 3).
//!
//! All is computed from differences of vertices, never from their distance to the world's origin. The volume
//! is Shewchuk's adaptive determinant ("Adaptive precision floating-point arithmetic and fast robust geometric
//! predicates", 1997): its sign is right however thin the tetrahedron, and zero means zero.

use glam::{DMat3, DVec3};
use robust::{Coord3D, orient3d};

use super::{Cell, FACES};

/// Six times the signed volume, with the exact sign: `det(v1-v0, v2-v0, v3-v0)`.
pub(super) fn determinant([v0, v1, v2, v3]: [DVec3; 4]) -> f64 {
    let [v0, v1, v2, v3] = [v0, v1, v2, v3].map(|v| Coord3D { x: v.x, y: v.y, z: v.z });
    orient3d(v1, v2, v3, v0)
}

/// Twice the area of a face times its normal, and the vertex that it was computed from.
///
/// Computed from the smallest id onwards, so that the two sides of a face get the same numbers, negated.
pub(super) fn area_vector(vertices: &[DVec3], face: [u32; 3]) -> (DVec3, DVec3) {
    let mut ids = face;
    ids.sort_unstable();
    let [low, middle, high] = ids.map(|id| vertices[id as usize]);
    let area = (middle - low).cross(high - low);
    let as_wound = [ids, [ids[1], ids[2], ids[0]], [ids[2], ids[0], ids[1]]].contains(&face);
    (if as_wound { area } else { -area }, low)
}

/// The maps of the tetrahedron with these vertex ids, texture coordinates and [`determinant`].
pub(super) fn maps(vertices: &[DVec3], ids: [u32; 4], texture: &[DVec3; 4], determinant: f64) -> Cell {
    if determinant == 0.0 {
        return Cell::default();
    }
    let gradients = FACES.map(|face| {
        let (outward, _) = area_vector(vertices, face.map(|corner| ids[corner]));
        -outward / determinant
    });
    let [t0, t1, t2, t3] = *texture;
    let texture_from_world = outer_product(t1 - t0, gradients[1])
        + outer_product(t2 - t0, gradients[2])
        + outer_product(t3 - t0, gradients[3]);
    if texture_from_world.is_finite() && gradients.iter().all(|gradient| gradient.is_finite()) {
        Cell { gradients, texture_from_world }
    } else {
        Cell::default()
    }
}

fn outer_product(column: DVec3, row: DVec3) -> DMat3 {
    DMat3::from_cols(column * row.x, column * row.y, column * row.z)
}
