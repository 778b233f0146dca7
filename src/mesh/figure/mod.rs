//! Figures to voxelise: a tree, a chain, a bust and a dragon, sculpted from smoothly joined parts.
//!
//! A `sculpture` is a field, negative inside; `tetrahedra` makes a closed mesh of it. Nothing lights a volume unless it is asked to,
//! so sky light is painted into the colours.

mod bust;
mod chain;
mod dragon;
mod sculpture;
mod tetrahedra;
mod tree;

use std::ops::Range;

use super::model::Model;
pub(crate) use sculpture::Sculpture;

/// A figure; all stand on the XZ plane, look along +Z and are some two units high.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Figure {
    /// A broad tree: trunk, roots, branches, and tufts of leaves.
    Tree,
    /// A chain along X: two whole links, of which each goes through the next, and through the first again two units on.
    Chain,
    /// Head and shoulders on a foot.
    Bust,
    /// A winged dragon with its tail around it.
    Dragon,
}

impl Figure {
    /// Every figure, by the name that the command line calls it.
    pub const ALL: [(&'static str, Self); 4] =
        [("tree", Self::Tree), ("chain", Self::Chain), ("bust", Self::Bust), ("dragon", Self::Dragon)];

    /// A closed mesh, whose finest parts are some thousandths of a unit.
    pub fn model(self) -> Model {
        self.sculpture(0..2).model()
    }

    /// What the mesh is made from; of a chain the links `links`.
    pub(crate) fn sculpture(self, links: Range<i32>) -> Sculpture {
        match self {
            Self::Tree => tree::tree(),
            Self::Chain => chain::chain(links),
            Self::Bust => bust::bust(),
            Self::Dragon => dragon::dragon(),
        }
    }

    /// After how many units along X it goes on as it began, if it does.
    pub(crate) fn period(self) -> Option<f64> {
        (self == Self::Chain).then_some(chain::PERIOD)
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        let entry = Self::ALL.iter().find(|(_, figure)| *figure == self);
        entry.expect("the table has every figure").0
    }
}
