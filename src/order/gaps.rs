//! Relations across gaps, from the [`abuffer`](super::abuffer).
//!
//! Along a pixel's ray the tetrahedra of a connected run are related face by face; between two runs the
//! tetrahedron that the ray leaves last is related to the one that it enters next.
//!
//! ```text
//!   eye ----[ A | B ]-------[ C | D | E ]------>      boundary faces: in A, out B, in C, out E
//!            A<B by a face   C<D<E by faces            the A-buffer adds B<C
//! ```
//!
//! Against section 4.1 of Dufort, Leblanc, Poulin 2005, runs may overlap where the shell overlaps itself. No order of theirs is right,
//! so they are made one cycle: each tetrahedron that such a ray leaves is also put in front of each that it enters.

use super::abuffer::{ABuffer, Crossing};

/// Of no tetrahedron.
const NONE: u32 = u32::MAX;

/// Working memory of one thread, kept between rays.
struct Scratch {
    /// Tetrahedra by which the ray entered, and left, the runs that it is in, and left those before them.
    entered: Vec<u32>,
    left: Vec<u32>,
    left_before: Vec<u32>,
    /// For each tetrahedron the last one that was found in front of it: neighbouring rays say the same.
    last_front: Vec<u32>,
}

/// Relates tetrahedra across gaps: lists of `[front, back]`, with duplicates. `tetrahedra` is the number of all. The set of pairs
/// does not depend on threads.
pub(super) fn relate(abuffer: &ABuffer, tetrahedra: usize) -> Vec<Vec<[u32; 2]>> {
    abuffer.map_bands(
        vec![(); abuffer.band_count()],
        || Scratch::new(tetrahedra),
        |scratch, band, ()| {
            let mut pairs = Vec::new();
            band.each_run(|_, crossings| scratch.follow_ray(crossings, &mut pairs));
            pairs
        },
    )
}

impl Scratch {
    fn new(tetrahedra: usize) -> Self {
        Self {
            entered: Vec::new(),
            left: Vec::new(),
            left_before: Vec::new(),
            last_front: vec![NONE; tetrahedra],
        }
    }

    /// Relates what one ray leaves to what it enters next.
    fn follow_ray(&mut self, crossings: &[Crossing], pairs: &mut Vec<[u32; 2]>) {
        if crossings.len() < 2 {
            return;
        }
        let leaves = crossings.iter().filter(|crossing| crossing.leaves()).count();
        // Every run ends in front of the eye; those that do not begin there hold the eye.
        let mut open_runs = (2 * leaves).saturating_sub(crossings.len());
        let mut overlap = open_runs > 1;
        self.entered.clear();
        self.left.clear();
        self.left_before.clear();
        for (index, crossing) in crossings.iter().enumerate() {
            if crossing.leaves() {
                open_runs = open_runs.saturating_sub(1);
                self.left.push(crossing.cell());
            } else {
                overlap |= open_runs > 0;
                open_runs += 1;
                self.entered.push(crossing.cell());
            }
            if open_runs == 0 || index + 1 == crossings.len() {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::order::relations::BoundaryFace;

    /// The pairs of a stack of faces on the axis, each given as `(depth, tetrahedron, leaves)`.
    fn pairs_of(stack: &[(f64, u32, bool)]) -> Vec<[u32; 2]> {
        let mut list: Vec<(f64, Crossing)> = stack
            .iter()
            .map(|&(depth, cell, leaves)| {
                let face = BoundaryFace { vertices: [0; 3], cell, local: 0, leaves, eye_side: 1 };
                (depth, Crossing::new(&face))
            })
            .collect();
        list.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let crossings: Vec<Crossing> = list.into_iter().map(|(_, crossing)| crossing).collect();
        let mut pairs = vec![];
        Scratch::new(stack.len()).follow_ray(&crossings, &mut pairs);
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
}
