//! One normal a position: the average over its triangle corners, weighted by the corners' angles.
//!
//! G. Thürmer, C. A. Wüthrich, "Computing Vertex Normals from Polygonal Facets", Journal of Graphics Tools 3(1),
//! 1998: with these weights the normal does not depend on how a polygon was cut into triangles.

use glam::DVec3;

/// What to do about a position without a normal.
pub(super) const ADVICE: &str =
    "delete degenerate faces, and one side of surfaces that are doubled back to back";

/// What is wrong where there is no normal.
pub(super) fn missing(position: DVec3) -> String {
    format!(
        "the position {position} has no normal: its faces have no area, or face opposite ways and cancel out"
    )
}

/// Unit normals, one a position.
///
/// Where `corner_normals` (one a triangle corner, of any length) are given, they are averaged; where there are
/// none, or where they cancel out, the triangles' own normals are.
///
/// # Errors
/// The id of the first position at which the triangles' own normals cancel out too, or are all
/// degenerate.
pub fn per_position(
    positions: &[DVec3],
    triangles: &[[u32; 3]],
    corner_normals: Option<&[[DVec3; 3]]>,
) -> Result<Vec<DVec3>, usize> {
    let normals = where_there_are(positions, triangles, corner_normals);
    normals.into_iter().enumerate().map(|(id, normal)| normal.ok_or(id)).collect()
}

/// As [`per_position`], with none where there is none.
pub fn where_there_are(
    positions: &[DVec3],
    triangles: &[[u32; 3]],
    corner_normals: Option<&[[DVec3; 3]]>,
) -> Vec<Option<DVec3>> {
    let given = corner_normals.map(|normals| average(positions, triangles, |triangle| normals[triangle]));
    let mut normals = given.unwrap_or_else(|| vec![None; positions.len()]);
    if normals.iter().all(Option::is_some) {
        return normals;
    }
    let own = average(positions, triangles, |triangle| {
        [facet_normal(triangles[triangle].map(|id| positions[id as usize])); 3]
    });
    normals.iter_mut().zip(own).for_each(|(normal, own)| *normal = normal.or(own));
    normals
}

/// The unit normal of a counter-clockwise triangle; zero where its height is below 1e-12 of its longest
/// side, for then rounding decides.
pub fn facet_normal([a, b, c]: [DVec3; 3]) -> DVec3 {
    let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
    let normal = ((b - a) / longest).cross((c - a) / longest);
    if normal.length() > 1e-12 { normal.normalize() } else { DVec3::ZERO }
}

/// The angle-weighted average over the corners at each position, at unit length; none where the corners
/// cancel out to 1e-9 of their weight, for then rounding (1e-16 a corner) spoils the seventh digit.
fn average(
    positions: &[DVec3],
    triangles: &[[u32; 3]],
    corner_normals: impl Fn(usize) -> [DVec3; 3],
) -> Vec<Option<DVec3>> {
    let mut sums = vec![(DVec3::ZERO, 0.0); positions.len()];
    for (triangle, ids) in triangles.iter().enumerate() {
        let corners = ids.map(|id| positions[id as usize]);
        for (k, normal) in corner_normals(triangle).into_iter().enumerate() {
            let along = (corners[(k + 1) % 3] - corners[k]).normalize_or_zero();
            let back = (corners[(k + 2) % 3] - corners[k]).normalize_or_zero();
            let angle = along.cross(back).length().atan2(along.dot(back));
            let (sum, weight) = &mut sums[ids[k] as usize];
            *sum += angle * normal.normalize_or_zero();
            *weight += angle;
        }
    }
    sums.into_iter().map(|(sum, weight)| (sum.length() > 1e-9 * weight).then(|| sum.normalize())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The corner of a cube at the origin: three square faces, of which one is cut into two triangles there.
    fn cube_corner() -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let positions =
            vec![DVec3::ZERO, DVec3::NEG_X, DVec3::NEG_Y, DVec3::NEG_Z, DVec3::NEG_X + DVec3::NEG_Y];
        (positions, vec![[0, 1, 4], [0, 4, 2], [0, 2, 3], [0, 3, 1]])
    }

    #[test]
    fn the_diagonal_of_a_face_does_not_count() {
        let (positions, triangles) = cube_corner();
        let normals = per_position(&positions, &triangles, None).unwrap();
        assert!((normals[0] - DVec3::ONE.normalize()).length() < 1e-15, "{}", normals[0]);
        // Unweighted, the face with two triangles would count twice.
        let unweighted: DVec3 =
            triangles.iter().map(|ids| facet_normal(ids.map(|id| positions[id as usize]))).sum();
        assert!((unweighted.normalize() - DVec3::ONE.normalize()).length() > 0.1);
    }

    #[test]
    fn given_normals_win_where_they_do_not_cancel() {
        let (positions, triangles) = cube_corner();
        let mut given = vec![[3.0 * DVec3::X; 3]; 4];
        assert_eq!(per_position(&positions, &triangles, Some(&given)).unwrap(), [DVec3::X; 5]);
        // Position 4 has the triangles 0 and 1 only, with equal angles.
        given[1][1] = DVec3::NEG_X;
        let normals = per_position(&positions, &triangles, Some(&given)).unwrap();
        assert_eq!(normals[..4], [DVec3::X; 4]);
        assert!((normals[4] - DVec3::Z).length() < 1e-15, "{}", normals[4]);
    }

    #[test]
    fn a_sheet_with_two_sides_has_no_normal() {
        let positions = [DVec3::ZERO, DVec3::X, DVec3::Y];
        assert_eq!(per_position(&positions, &[[0, 1, 2], [0, 2, 1]], None), Err(0));
    }
}
