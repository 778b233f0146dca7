//! Visibility order of tetrahedra, front to back.

use std::ops::Range;

/// A visibility order of all tetrahedra of a shell for one view.
#[derive(Debug, Clone, PartialEq)]
pub struct Order {
    /// Every tetrahedron id once, front to back.
    pub sequence: Vec<u32>,
    /// Runs of `sequence` whose tetrahedra overlap one another in cycles: inside such a run no order is right
    /// for every pixel. Empty for most meshes.
    pub cycles: Vec<Range<usize>>,
}
