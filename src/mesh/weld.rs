//! Welding: one id for each place, whatever corners, seams or objects of a file meet there.

use std::collections::HashMap;

use glam::DVec3;

/// Welded positions and triangles, and where each came from.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Welded {
    /// No two equal, each used by a triangle.
    pub positions: Vec<DVec3>,
    /// For each position, the id of the first one that had its value.
    pub position_sources: Vec<u32>,
    /// Three different position ids each.
    pub triangles: Vec<[u32; 3]>,
    /// For each triangle, its index before welding.
    pub triangle_sources: Vec<u32>,
}

/// Merges positions that are equal bit for bit (0 and -0 count as equal), drops the triangles that
/// are left with fewer than three different positions, and drops the positions that no triangle uses.
///
/// Ids must be in range. The number of triangles dropped is the difference of the two lengths.
pub fn weld(positions: &[DVec3], triangles: &[[u32; 3]]) -> Welded {
    let mut first_at = HashMap::with_capacity(positions.len());
    let first_like: Vec<u32> =
        (0..).zip(positions).map(|(id, &p)| *first_at.entry(place(p)).or_insert(id)).collect();

    let mut welded = Welded::default();
    let mut new_ids = vec![None; positions.len()];
    for (source, triangle) in (0..).zip(triangles) {
        let [a, b, c] = triangle.map(|id| first_like[id as usize]);
        if a == b || b == c || c == a {
            continue;
        }
        welded.triangle_sources.push(source);
        welded.triangles.push([a, b, c].map(|id| {
            *new_ids[id as usize].get_or_insert_with(|| {
                welded.positions.push(positions[id as usize]);
                welded.position_sources.push(id);
                welded.positions.len() as u32 - 1
            })
        }));
    }
    welded
}

/// The bits of a position, alike for 0 and -0.
fn place(position: DVec3) -> [u64; 3] {
    position.to_array().map(|x| (x + 0.0).to_bits())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_positions_become_one() {
        let positions = [DVec3::ZERO, DVec3::X, DVec3::Y, -0.0 * DVec3::ONE, DVec3::Y, DVec3::Z, DVec3::ONE];
        let welded = weld(&positions, &[[0, 1, 2], [3, 4, 5]]);
        assert_eq!(welded.positions, [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z]);
        assert_eq!(welded.position_sources, [0, 1, 2, 5]);
        assert_eq!(welded.triangles, [[0, 1, 2], [0, 2, 3]]);
    }

    #[test]
    fn positions_one_bit_apart_stay_apart() {
        let positions = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::X.with_x(1.0_f64.next_up())];
        assert_eq!(weld(&positions, &[[0, 1, 2], [0, 3, 2]]).positions.len(), 4);
    }

    #[test]
    fn collapsed_triangles_are_dropped() {
        let positions = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::X, DVec3::Z];
        let welded = weld(&positions, &[[1, 3, 4], [0, 1, 2], [0, 0, 2]]);
        assert_eq!(welded.triangle_sources, [1]);
        assert_eq!(welded.positions, [DVec3::ZERO, DVec3::X, DVec3::Y], "the unused position is gone");
    }
}
