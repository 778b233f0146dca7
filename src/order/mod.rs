//! Visibility order of tetrahedra, front to back.
//!
//! [`sort`] is SXMPVO (Cook, Max, Silva, Williams, "Image-space visibility ordering for cell projection
//! volume rendering of unstructured data", 2004), as section 4.1 of Dufort, Leblanc, Poulin 2005 uses it,
//! turned round to front to back:
//!
//! 1. [`relations`]: of two tetrahedra that share a face, the one on the eye's side is in front;
//! 2. `gaps`: where a pixel's ray leaves the shell and enters it again, the tetrahedron that it
//!    leaves is in front of the one that it enters;
//! 3. [`search`]: a depth-first search of that graph emits every tetrahedron after all in front of it.
//!
//! The order is right for every pixel's ray as long as tetrahedra do not intersect and their order has no
//! cycle. Cycles are found exactly and reported; intersections (a shell that overlaps itself) have no right
//! order where they are, and [`check()`] counts them apart.

mod abuffer;
pub mod check;
pub mod crossings;
mod gaps;
pub mod relations;
pub mod search;
pub mod sxmpvo;

use std::ops::Range;

pub use check::{Check, check, check_pixels};
pub use crossings::Crossings;
pub use sxmpvo::{Sorted, Sorter, Times, sort};

/// A visibility order of all tetrahedra of a shell for one view.
#[derive(Debug, Clone, PartialEq)]
pub struct Order {
    /// Every tetrahedron id once, front to back.
    pub sequence: Vec<u32>,
    /// Runs of `sequence` whose tetrahedra overlap one another in cycles: inside such a run no order is right
    /// for every pixel. Empty for most meshes.
    pub cycles: Vec<Range<usize>>,
}
