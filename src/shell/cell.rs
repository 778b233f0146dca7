//! The affine maps of one tetrahedron: barycentric gradients and the linear part of the texture map (the
//! matrix `M^{o->t}` of Dufort et al. 2005, section 3).
//!
//! All is computed from differences of vertices, never from their distance to the world's origin. The volume
//! is Shewchuk's adaptive determinant ("Adaptive precision floating-point arithmetic and fast robust geometric
//! predicates", 1997): its sign is right however thin the tetrahedron, and zero means zero.

use glam::{DMat3, DVec3};
use robust::{Coord3D, orient3d};

use super::Cell;

/// Six times the signed volume, with the exact sign: `det(v1-v0, v2-v0, v3-v0)`.
pub(crate) fn determinant([v0, v1, v2, v3]: [DVec3; 4]) -> f64 {
    let [v0, v1, v2, v3] = [v0, v1, v2, v3].map(|v| Coord3D { x: v.x, y: v.y, z: v.z });
    orient3d(v1, v2, v3, v0)
}

/// Twice the area of a triangle times its normal.
pub(super) fn area_vector([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a)
}

/// Whether [`maps`] are finite, given the largest of the texture coordinates and the sum of all squared edges.
pub(super) fn are_finite(determinant: f64, squared_edges: f64, largest: f64) -> bool {
    // No area vector is longer than that sum, and a map is a sum of three products of a gradient and a difference.
    (squared_edges.max(1.0) * (6.0 * largest).max(1.0) / determinant).is_finite()
}

/// The maps of the tetrahedron with these vertices, texture coordinates and [`determinant`]; none where that is zero.
pub(super) fn maps(vertices: [DVec3; 4], texture: [DVec3; 4], determinant: f64) -> Cell {
    if determinant == 0.0 {
        return Cell::default();
    }
    let [a, b, c] = [1, 2, 3].map(|k| vertices[k] - vertices[0]);
    let per_volume = determinant.recip();
    let [of_1, of_2, of_3] = [b.cross(c), c.cross(a), a.cross(b)].map(|area| area * per_volume);
    let opposite = (vertices[2] - vertices[1]).cross(vertices[3] - vertices[1]);
    let gradients = [opposite * -per_volume, of_1, of_2, of_3];
    let [t0, t1, t2, t3] = texture;
    let texture_from_world = outer_product(t1 - t0, gradients[1])
        + outer_product(t2 - t0, gradients[2])
        + outer_product(t3 - t0, gradients[3]);
    Cell { gradients, texture_from_world }
}

fn outer_product(column: DVec3, row: DVec3) -> DMat3 {
    DMat3::from_cols(column * row.x, column * row.y, column * row.z)
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    use super::*;

    const CORNER: [DVec3; 4] = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];

    #[test]
    fn gradients_of_the_corner_of_a_cube() {
        let vertices = CORNER.map(|v| 2.0 * v);
        let texture = CORNER.map(|v| v + DVec3::ONE);
        let cell = maps(vertices, texture, determinant(vertices));
        let halves = [-DVec3::ONE, DVec3::X, DVec3::Y, DVec3::Z].map(|v| 0.5 * v);
        assert_eq!(cell.gradients, halves);
        assert_eq!(cell.texture_from_world, 0.5 * DMat3::IDENTITY);
    }

    #[test]
    fn an_inverted_tetrahedron_has_the_same_maps() {
        let straight = maps(CORNER, CORNER, determinant(CORNER));
        let [v0, v1, v2, v3] = CORNER;
        let swapped = [v0, v2, v1, v3];
        let mirrored = maps(swapped, swapped, determinant(swapped));
        assert_eq!(mirrored.texture_from_world, straight.texture_from_world);
        assert_eq!(mirrored.gradients[1], straight.gradients[2]);
        assert_ne!(mirrored.gradients[1], straight.gradients[1]);
    }

    /// Nearly and exactly flat tetrahedra with large whole coordinates, against whole-number arithmetic.
    #[test]
    fn the_sign_of_the_determinant_is_exact() {
        let mut random = Pcg64Mcg::seed_from_u64(1);
        let mut coordinate = || random.random_range(-(1i64 << 40)..1i64 << 40);
        let mut naive_mistakes = 0;
        for round in 0..300 {
            let [p, q, shift] = std::array::from_fn(|_| [coordinate(), coordinate(), coordinate()]);
            let mut sum: [i64; 3] = std::array::from_fn(|i| p[i] + q[i]);
            sum[0] += round % 3 - 1;
            let exact = {
                let [p, q, r] = [p, q, sum].map(|v| v.map(i128::from));
                p[0] * (q[1] * r[2] - q[2] * r[1])
                    + p[1] * (q[2] * r[0] - q[0] * r[2])
                    + p[2] * (q[0] * r[1] - q[1] * r[0])
            };
            let vertex = |v: [i64; 3]| DVec3::from_array(std::array::from_fn(|i| (v[i] + shift[i]) as f64));
            let vertices = [vertex([0; 3]), vertex(p), vertex(q), vertex(sum)];
            let computed = determinant(vertices);
            assert_eq!(exact.signum() as f64, if computed == 0.0 { 0.0 } else { computed.signum() });
            let naive =
                (vertices[1] - vertices[0]).cross(vertices[2] - vertices[0]).dot(vertices[3] - vertices[0]);
            naive_mistakes += u32::from((naive > 0.0, naive < 0.0) != (exact > 0, exact < 0));
        }
        assert!(naive_mistakes > 0, "these tetrahedra are too easy to tell anything");
    }

    #[test]
    fn a_flat_tetrahedron_has_no_maps() {
        let flat = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(0.1, 0.2, 0.0)];
        assert_eq!(determinant(flat), 0.0);
        assert_eq!(maps(flat, CORNER, 0.0), Cell::default());
    }

    #[test]
    fn a_tetrahedron_too_flat_for_finite_maps_has_none() {
        let low = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(0.1, 0.2, 1e-320)];
        assert!(determinant(low) > 0.0);
        assert!(!are_finite(determinant(low), 8.0, 1.0));
        assert!(are_finite(1e-300, 8.0, 1.0) && !are_finite(1e-300, 8.0, 1e9));
    }
}
